/* LAS 1.0 to 1.5, uncompressed point record formats 0 to 10 (ASPRS LAS specification, little-endian throughout).
 *
 * A header, records of variable length (VLRs), then point records of one size. Counts, sizes and offsets are taken as claims:
 * points are what the bytes after the offset hold, at most as many as declared. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "arrays.h"
#include "core/file.h"
#include "formats.h"
#include "records.h"

/* Header fields by their offset, with the versions that have them. */
enum {
    AT_MAJOR = 24,
    AT_MINOR = 25,
    AT_HEADER_SIZE = 94,   /* uint16 */
    AT_POINTS = 96,        /* uint32 */
    AT_VLR_COUNT = 100,    /* uint32 */
    AT_FORMAT = 104,       /* uint8 */
    AT_RECORD_SIZE = 105,  /* uint16 */
    AT_LEGACY_COUNT = 107, /* uint32 */
    AT_SCALE = 131,        /* 3 doubles */
    AT_OFFSET = 155,       /* 3 doubles */
    HEADER_SIZE = 227,     /* up to 1.2; later ones are longer */
    AT_COUNT = 247,        /* uint64, from 1.4 on */
    COUNT_END = 255,
    VLR_SIZE = 54 /* uint16 reserved, char[16] user, uint16 record, uint16 length, char[32] description; then the content */
};

/* Point record fields: 3 x int32 position, uint16 intensity, then by layout. Offset 0: the format has no such field. */
struct layout {
    uint8_t size, time, colour;
    bool extended; /* 4-bit returns and 8-bit classes (formats 6 to 10) instead of 3 and 5 bits */
};

static const struct layout LAYOUTS[] = {{20, 0, 0, false},  {28, 20, 0, false},  {26, 0, 20, false}, {34, 20, 28, false},
                                        {57, 20, 0, false}, {63, 20, 28, false}, {30, 22, 0, true},  {36, 22, 30, true},
                                        {38, 22, 30, true}, {59, 22, 0, true},   {67, 22, 30, true}};

enum { AT_INTENSITY = 12, AT_RETURNS = 14, AT_CLASS = 15, AT_EXTENDED_CLASS = 16 };

struct las {
    struct reader *reader;
    unsigned minor, format;
    size_t header_size, points_at, record_size;
    uint64_t declared;
    double scale[3], offset[3];
    const struct layout *layout;
    struct arrays arrays;
    double (*positions)[3];
    uint16_t *intensity;
    uint8_t *class, *return_number, *return_count;
    double *time, first_time;
    uint16_t (*colours)[3];
    atomic_uint colour_bits; /* of all channels of all points, or-ed */
    size_t first;            /* point that the current step begins with */
};

static inline uint64_t read_bytes(const char *p, size_t size) {
    const unsigned char *bytes = (const unsigned char *)p;
    uint64_t value = 0;
    for (size_t i = 0; i < size; i++) value |= (uint64_t)bytes[i] << (8 * i);
    return value;
}

static inline unsigned read16(const char *p) {
    return (unsigned)read_bytes(p, 2);
}

static inline uint32_t read32(const char *p) {
    return (uint32_t)read_bytes(p, 4);
}

static inline double read_double(const char *p) {
    uint64_t bits = read_bytes(p, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

bool las_recognise(const struct reader *reader) {
    return reader->size >= 4 && memcmp(reader->data, "LASF", 4) == 0;
}

/* ---- the header ---- */

/* Compressed files keep the header, set high bits of the format, and name their method in a VLR. */
static bool is_compressed(const struct las *las) {
    static const char *const USERS[] = {"laszip encoded", "copc"};
    const char *data = las->reader->data, *end = data + las->points_at;
    if (las->format & 0xc0) return true;
    uint32_t count = read32(data + AT_VLR_COUNT);
    const char *p = data + las->header_size;
    for (uint32_t i = 0; i < count && end - p >= VLR_SIZE; i++) {
        for (size_t k = 0; k < sizeof USERS / sizeof *USERS; k++)
            if (strncmp(p + 2, USERS[k], 16) == 0) return true;
        size_t length = read16(p + 20);
        p += VLR_SIZE;
        p += length < (size_t)(end - p) ? length : (size_t)(end - p);
    }
    return false;
}

static pbr_result read_header(struct las *las) {
    struct reader *reader = las->reader;
    const char *data = reader->data;
    if (reader->size < HEADER_SIZE) return reader_error_byte(reader, PBR_ERROR_FORMAT, reader->size, "the LAS header ends early");
    las->minor = (unsigned char)data[AT_MINOR];
    las->format = (unsigned char)data[AT_FORMAT];
    las->header_size = read16(data + AT_HEADER_SIZE);
    las->points_at = read32(data + AT_POINTS);
    las->record_size = read16(data + AT_RECORD_SIZE);
    las->declared = read32(data + AT_LEGACY_COUNT);
    if (data[AT_MAJOR] != 1 || las->minor > 5)
        return reader_error_byte(reader, PBR_ERROR_UNSUPPORTED, AT_MAJOR, "LAS version %u.%u is not supported",
                                 (unsigned)(unsigned char)data[AT_MAJOR], las->minor);
    if (las->header_size < HEADER_SIZE)
        return reader_error_byte(reader, PBR_ERROR_FORMAT, AT_HEADER_SIZE, "a LAS header of %zu bytes", las->header_size);
    if (las->points_at < las->header_size)
        return reader_error_byte(reader, PBR_ERROR_FORMAT, AT_POINTS, "the points begin inside the header, at byte %zu",
                                 las->points_at);
    if (las->points_at > reader->size)
        return reader_error_byte(reader, PBR_ERROR_FORMAT, reader->size, "the data ends before the points, which begin at byte %zu",
                                 las->points_at);
    if (las->minor >= 4 && las->header_size >= COUNT_END) {
        uint64_t count = read_bytes(data + AT_COUNT, 8);
        if (count != las->declared && count > 0 && las->declared > 0)
            reader_warn(reader, 1, "the two point counts differ: %llu and %llu; the first is taken", (unsigned long long)count,
                        (unsigned long long)las->declared);
        if (count > 0) las->declared = count;
    }
    return PBR_OK;
}

static pbr_result check_layout(struct las *las) {
    struct reader *reader = las->reader;
    if (is_compressed(las))
        return reader_error_byte(reader, PBR_ERROR_UNSUPPORTED, AT_FORMAT,
                                 "compressed LAS is not supported; decompress with laszip or pdal translate");
    if (las->format >= sizeof LAYOUTS / sizeof *LAYOUTS)
        return reader_error_byte(reader, PBR_ERROR_UNSUPPORTED, AT_FORMAT, "LAS point format %u is not supported", las->format);
    las->layout = &LAYOUTS[las->format];
    if (las->record_size < las->layout->size)
        return reader_error_byte(reader, PBR_ERROR_FORMAT, AT_RECORD_SIZE, "point records of %zu bytes; format %u takes %u",
                                 las->record_size, las->format, (unsigned)las->layout->size);
    for (int k = 0; k < 3; k++) {
        las->scale[k] = read_double(reader->data + AT_SCALE + 8 * k);
        las->offset[k] = read_double(reader->data + AT_OFFSET + 8 * k);
        if (!isfinite(las->scale[k]) || las->scale[k] == 0)
            return reader_error_byte(reader, PBR_ERROR_FORMAT, (size_t)(AT_SCALE + 8 * k), "a scale that is 0 or not finite");
        if (!isfinite(las->offset[k]))
            return reader_error_byte(reader, PBR_ERROR_FORMAT, (size_t)(AT_OFFSET + 8 * k), "an offset that is not finite");
    }
    return PBR_OK;
}

static pbr_result count_points(struct las *las) {
    struct reader *reader = las->reader;
    uint64_t there = (reader->size - las->points_at) / las->record_size;
    las->arrays.count = las->declared < there ? las->declared : there;
    if (las->declared > 0 && there == 0)
        return reader_error_byte(reader, PBR_ERROR_FORMAT, reader->size, "the data ends before the first whole point");
    if (las->arrays.count < las->declared)
        reader_warn(reader, 1, "the data ends after %llu of %llu points", (unsigned long long)las->arrays.count,
                    (unsigned long long)las->declared);
    if (las->declared == 0) reader_warn(reader, 1, "the file has no points");
    return PBR_OK;
}

/* ---- the points ---- */

static const char NO_COLOURS[] = "all colours are 0: left out";

static void *own(const pbr_attribute *attribute) {
    return (void *)(uintptr_t)attribute->data;
}

static pbr_result make_arrays(struct las *las) {
    struct arrays *arrays = &las->arrays;
    pbr_attribute made[5] = {{0}};
    uint64_t rows = arrays->count;
    pbr_result result = arrays_make(arrays, rows, PBR_FORMAT_FLOAT64, 3, &arrays->positions);
    if (result == PBR_OK) result = arrays_make_scalar(arrays, rows, PBR_FORMAT_UINT16, "intensity", &made[0]);
    if (result == PBR_OK) result = arrays_make_scalar(arrays, rows, PBR_FORMAT_UINT8, "classification", &made[1]);
    if (result == PBR_OK) result = arrays_make_scalar(arrays, rows, PBR_FORMAT_UINT8, "return_number", &made[2]);
    if (result == PBR_OK) result = arrays_make_scalar(arrays, rows, PBR_FORMAT_UINT8, "number_of_returns", &made[3]);
    if (result == PBR_OK && las->layout->time)
        result = arrays_make_scalar(arrays, rows, PBR_FORMAT_FLOAT64, "relative_gps_time", &made[4]);
    if (result == PBR_OK && las->layout->colour) result = arrays_make(arrays, rows, PBR_FORMAT_UINT16, 3, &arrays->colours);
    las->positions = own(&arrays->positions);
    las->intensity = own(&made[0]);
    las->class = own(&made[1]);
    las->return_number = own(&made[2]);
    las->return_count = own(&made[3]);
    las->time = own(&made[4]);
    las->colours = own(&arrays->colours);
    return result;
}

static inline unsigned decode_point(const struct las *las, size_t i, const char *p) {
    const struct layout *layout = las->layout;
    unsigned returns = (unsigned char)p[AT_RETURNS], bits = 0;
    for (int k = 0; k < 3; k++) las->positions[i][k] = (int32_t)read32(p + 4 * k) * las->scale[k] + las->offset[k];
    las->intensity[i] = (uint16_t)read16(p + AT_INTENSITY);
    las->class[i] = layout->extended ? (uint8_t)p[AT_EXTENDED_CLASS] : (uint8_t)(p[AT_CLASS] & 31);
    las->return_number[i] = (uint8_t)(layout->extended ? returns & 15 : returns & 7);
    las->return_count[i] = (uint8_t)(layout->extended ? returns >> 4 : returns >> 3 & 7);
    if (layout->time) las->time[i] = read_double(p + layout->time) - las->first_time;
    for (int k = 0; layout->colour && k < 3; k++) bits |= las->colours[i][k] = (uint16_t)read16(p + layout->colour + 2 * k);
    return bits;
}

static pbr_result decode_points(void *user, size_t begin, size_t end) {
    struct las *las = user;
    unsigned bits = 0;
    for (size_t i = begin; i < end; i++) bits |= decode_point(las, i, las->reader->data + las->points_at + i * las->record_size);
    atomic_fetch_or(&las->colour_bits, bits);
    return PBR_OK;
}

/* Writers that have 8 bits a channel often leave them in the low half of the 16 that the format has. */
static pbr_result widen_colours(void *user, size_t begin, size_t end) {
    const struct las *las = user;
    for (size_t i = begin; i < end; i++)
        for (int k = 0; k < 3; k++) las->colours[i][k] = (uint16_t)(las->colours[i][k] * 257u);
    return PBR_OK;
}

static pbr_result read_points(struct las *las) {
    enum { GRAIN = 8192 };
    struct reader *reader = las->reader;
    const size_t count = (size_t)las->arrays.count, end = las->points_at + count * las->record_size;
    if (las->arrays.count > PBR_MAX_POINTS)
        return pbr_log(reader->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu points, the limit is %llu", reader->name,
                       (unsigned long long)las->arrays.count, (unsigned long long)PBR_MAX_POINTS);
    pbr_result result = make_arrays(las);
    if (result == PBR_OK && las->time && count > 0) {
        las->first_time = read_double(reader->data + las->points_at + las->layout->time);
        if (!isfinite(las->first_time)) las->first_time = 0;
    }
    if (result == PBR_OK) result = reader_parallel(reader, count, GRAIN, las->points_at, end, decode_points, las);
    if (result != PBR_OK || !las->colours || count == 0) return result;
    unsigned bits = atomic_load(&las->colour_bits);
    if (bits == 0) {
        reader_warn(reader, 1, "%s", NO_COLOURS);
        las->arrays.colours = (pbr_attribute){0};
    } else if (bits <= 255) {
        result = pbr_parallel(reader->instance, count, GRAIN, widen_colours, las);
    }
    return result;
}

pbr_result las_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    struct las las = {.reader = reader, .arrays = {.instance = reader->instance}};
    atomic_init(&las.colour_bits, 0);
    pbr_result result = read_header(&las);
    if (result == PBR_OK) result = check_layout(&las);
    if (result == PBR_OK) result = count_points(&las);
    if (result == PBR_OK) result = read_points(&las);
    if (result == PBR_OK) result = reader_progress(reader, reader->size);
    if (result == PBR_OK) result = arrays_points(&las.arrays, desc, content);
    if (result == PBR_OK) {
        content->format = PBR_FILE_LAS;
        content->vertex_count = las.arrays.count;
        snprintf(content->encoding, sizeof content->encoding, "1.%u, point format %u", las.minor, las.format);
    }
    arrays_free(&las.arrays);
    return result;
}

/* ---- the points where they are ---- */

static pbr_result look_at_colours(void *user, size_t begin, size_t end) {
    struct las *las = user;
    unsigned bits = 0;
    for (size_t i = las->first + begin; i < las->first + end && bits <= 255; i++) {
        const char *p = las->reader->data + las->points_at + i * las->record_size + las->layout->colour;
        for (int k = 0; k < 3; k++) bits |= read16(p + 2 * k);
    }
    atomic_fetch_or(&las->colour_bits, bits);
    return PBR_OK;
}

/* Whether the colours have 8 bits or 16 is told by all of them, up to the first that has more than 8. */
static pbr_result find_colours(struct las *las, struct records *out) {
    enum { GRAIN = 8192, STEP = 64 * GRAIN };
    const size_t count = (size_t)las->arrays.count;
    pbr_result result = PBR_OK;
    for (; las->first < count && atomic_load(&las->colour_bits) <= 255 && result == PBR_OK; las->first += STEP) {
        const size_t begin = las->points_at + las->first * las->record_size;
        const size_t now = count - las->first < STEP ? count - las->first : STEP;
        result = reader_progress(las->reader, begin);
        if (result == PBR_OK) result = pbr_parallel(las->reader->instance, now, GRAIN, look_at_colours, las);
        if (las->reader->file) source_done_with(las->reader->file, begin, now * las->record_size);
    }
    const unsigned bits = atomic_load(&las->colour_bits);
    if (result == PBR_OK && bits == 0 && count > 0) reader_warn(las->reader, 1, "%s", NO_COLOURS);
    out->colours = RECORD_UNORM16;
    for (size_t k = 0; k < 3 && bits > 0; k++)
        out->colour[k] = (struct record_field){las->layout->colour + 2 * k, PLY_UINT16, bits <= 255 ? 257 : 1, 0};
    return result;
}

pbr_result las_records(struct reader *reader, struct records *out) {
    struct las las = {.reader = reader};
    atomic_init(&las.colour_bits, 0);
    pbr_result result = read_header(&las);
    if (result == PBR_OK) result = check_layout(&las);
    if (result == PBR_OK) result = count_points(&las);
    if (result != PBR_OK) return result;
    out->data = reader->data + las.points_at;
    out->size = las.record_size;
    out->count = las.arrays.count;
    for (size_t k = 0; k < 3; k++) out->position[k] = (struct record_field){4 * k, PLY_INT32, las.scale[k], las.offset[k]};
    snprintf(out->encoding, sizeof out->encoding, "1.%u, point format %u", las.minor, las.format);
    return las.layout->colour ? find_colours(&las, out) : PBR_OK;
}
