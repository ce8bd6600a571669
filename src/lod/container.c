/* Reading and writing .pbr. SPDX-License-Identifier: MIT */
#include "container.h"

#include <string.h>

#include "core/file.h"

/* The header: magic, version, sections, size of the file, checksum of the rest of the header and of the table. An entry of the
 * table: type, place, size, checksum of the first part, size of the first part. */
enum { HEADER = 32, ENTRY = 40, VERSION = 1, SECTIONS_MOST = 64, FIRST_MOST = 256 };

static const uint8_t MAGIC[8] = {0x89, 'P', 'B', 'R', '\r', '\n', 0x1a, '\n'};

/* FNV-1a (Fowler, Noll & Vo), 64 bits: finds accidents, not forgeries. */
static uint64_t checksum(const uint8_t *p, uint64_t size, uint64_t sum) {
    for (uint64_t i = 0; i < size; i++) sum = (sum ^ p[i]) * UINT64_C(0x100000001b3);
    return sum;
}
static const uint64_t CHECKSUM_START = UINT64_C(0xcbf29ce484222325);

static uint64_t header_checksum(const uint8_t *data, uint64_t sections) {
    return checksum(data + HEADER, sections * ENTRY, checksum(data, HEADER - 8, CHECKSUM_START));
}

bool container_recognise(const uint8_t *data, uint64_t size) {
    return size >= sizeof MAGIC && memcmp(data, MAGIC, sizeof MAGIC) == 0;
}

static pbr_result wrong(pbr_instance *instance, const char *path, uint64_t at, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: byte %llu: %s", path, (unsigned long long)at, what);
}

static pbr_result check_header(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, uint64_t *sections) {
    if (size < HEADER) return wrong(instance, path, size, "the file ends within its header");
    const uint64_t version = load_little(data + 8, 4), stated = load_little(data + 16, 8);
    *sections = load_little(data + 12, 4);
    if (version != VERSION)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: version %llu of the .pbr format; this library knows %d",
                       path, (unsigned long long)version, VERSION);
    if (*sections > SECTIONS_MOST || HEADER + *sections * ENTRY > size)
        return wrong(instance, path, 12, "an impossible number of sections");
    if (header_checksum(data, *sections) != load_little(data + 24, 8)) return wrong(instance, path, 24, "the header is damaged");
    if (stated > size)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: the file ends at byte %llu of %llu", path,
                       (unsigned long long)size, (unsigned long long)stated);
    return PBR_OK;
}

pbr_result container_find(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, const char *const *types,
                          size_t type_count, struct container_section *out, size_t *type) {
    uint64_t sections = 0;
    const pbr_result result = check_header(instance, path, data, size, &sections);
    if (result != PBR_OK) return result;
    for (uint64_t i = 0; i < sections; i++) {
        const uint64_t entry = HEADER + i * ENTRY, at = load_little(data + entry + 8, 8), bytes = load_little(data + entry + 16, 8);
        const uint64_t first = load_little(data + entry + 32, 8);
        *type = 0;
        while (*type < type_count && memcmp(data + entry, types[*type], 8) != 0) ++*type;
        if (*type == type_count) continue;
        if (at > size || bytes > size - at || first > bytes || first > FIRST_MOST)
            return wrong(instance, path, entry, "a section lies outside the file");
        if (checksum(data + at, first, CHECKSUM_START) != load_little(data + entry + 24, 8))
            return wrong(instance, path, at, "the section's header is damaged");
        *out = (struct container_section){.size = bytes, .data = data + at};
        memcpy(out->type, types[*type], 8);
        return PBR_OK;
    }
    *type = 0;
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                   "%s: none of its %llu sections is a hierarchy that this library knows", path, (unsigned long long)sections);
}

static pbr_result write_parts(struct output *output, const struct container_part *parts, size_t count, uint64_t total,
                              const struct progress *progress) {
    enum { PIECE = 16 << 20 };
    uint64_t at = CONTAINER_DATA, done = 0;
    pbr_result result = progress_report(progress, "writing", 0);
    for (size_t i = 0; i < count; i++)
        for (uint64_t from = 0; from < parts[i].size && result == PBR_OK;) {
            const uint64_t piece = parts[i].size - from < PIECE ? parts[i].size - from : PIECE;
            output_write(output, (const uint8_t *)parts[i].data + from, (size_t)piece, at);
            at += piece, from += piece, done += piece;
            result = progress_report(progress, "writing", (double)done / (double)total);
        }
    return result;
}

void container_write_header(struct output *output, const char type[8], const struct container_part *first, uint64_t section_size) {
    uint8_t head[HEADER + ENTRY] = {0};
    memcpy(head, MAGIC, sizeof MAGIC);
    store_little(VERSION, 4, head + 8);
    store_little(1, 4, head + 12);
    store_little(CONTAINER_DATA + section_size, 8, head + 16);
    memcpy(head + HEADER, type, 8);
    store_little(CONTAINER_DATA, 8, head + HEADER + 8);
    store_little(section_size, 8, head + HEADER + 16);
    store_little(checksum(first->data, first->size, CHECKSUM_START), 8, head + HEADER + 24);
    store_little(first->size, 8, head + HEADER + 32);
    store_little(header_checksum(head, 1), 8, head + 24);
    output_write(output, head, sizeof head, 0);
}

pbr_result container_write(pbr_instance *instance, const char *path, const char type[8], const struct container_part *parts,
                           size_t count, const struct progress *progress) {
    struct output output = {0};
    uint64_t size = 0;
    for (size_t i = 0; i < count; i++) size += parts[i].size;
    pbr_result result = output_open(instance, path, &output);
    if (result == PBR_OK) container_write_header(&output, type, &parts[0], size);
    if (result == PBR_OK) result = write_parts(&output, parts, count, size, progress);
    const pbr_result closed = output_close(&output, result == PBR_OK);
    return result == PBR_OK ? closed : result;
}
