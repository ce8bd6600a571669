/* PLY files: what their properties mean, and the points or mesh they make. SPDX-License-Identifier: MIT */
#include "ply.h"

#include <stdio.h>
#include <string.h>

#include "arrays.h"
#include "formats.h"
#include "ply_paint.h"
#include "ply_rows.h"
#include "records.h"

enum role {
    ROLE_X,
    ROLE_Y,
    ROLE_Z,
    ROLE_NX,
    ROLE_NY,
    ROLE_NZ,
    ROLE_RED,
    ROLE_GREEN,
    ROLE_BLUE,
    ROLE_ALPHA,
    ROLE_RADIUS,
    ROLE_COUNT
};

static const struct {
    const char *name;
    enum role role;
} ROLES[] = {{"x", ROLE_X},
             {"y", ROLE_Y},
             {"z", ROLE_Z},
             {"nx", ROLE_NX},
             {"ny", ROLE_NY},
             {"nz", ROLE_NZ},
             {"red", ROLE_RED},
             {"green", ROLE_GREEN},
             {"blue", ROLE_BLUE},
             {"alpha", ROLE_ALPHA},
             {"r", ROLE_RED},
             {"g", ROLE_GREEN},
             {"b", ROLE_BLUE},
             {"a", ROLE_ALPHA},
             {"diffuse_red", ROLE_RED},
             {"diffuse_green", ROLE_GREEN},
             {"diffuse_blue", ROLE_BLUE},
             {"diffuse_alpha", ROLE_ALPHA},
             {"radius", ROLE_RADIUS}};

bool ply_is_role(const char *name) {
    for (size_t i = 0; i < sizeof ROLES / sizeof *ROLES; i++)
        if (strcmp(ROLES[i].name, name) == 0) return true;
    return false;
}

#define NO_PROPERTY UINT32_MAX
enum { SCALAR_NAME = 64 };

/* One reading of a file. */
struct job {
    struct reader *reader;
    struct ply_header header;
    const struct ply_element *vertex;
    const struct ply_element *last; /* that has data in the file; NULL if none has */
    uint32_t role[ROLE_COUNT];      /* property of the vertex element, or NO_PROPERTY */
    uint32_t scalar[PBR_MAX_SCALARS];
    uint32_t scalar_count;
    struct ply_column *columns; /* one a vertex property */
    struct arrays arrays;       /* `count`: whole rows read */
    char scalar_names[PBR_MAX_SCALARS][SCALAR_NAME];
    bool have_vertices, cut;
    struct ply_faces faces;
    size_t room; /* triangles that `faces` has room for */
    struct ply_polygons polygons;
    uint32_t shapes; /* elements that give triangles */
};

static const struct ply_property *vertex_property(const struct job *job, uint32_t index) {
    return &job->header.properties[job->vertex->first_property + index];
}

static bool is_float(enum ply_type type) {
    return type == PLY_FLOAT32 || type == PLY_FLOAT64;
}

/* ---- what the properties mean ---- */

static bool has_roles(const struct job *job, enum role first) {
    return job->role[first] != NO_PROPERTY && job->role[first + 1] != NO_PROPERTY && job->role[first + 2] != NO_PROPERTY;
}

/* Colours need all three channels, and either all integers or all floating point. */
static bool colours_fit(struct job *job) {
    if (!has_roles(job, ROLE_RED)) return false;
    bool first = is_float(vertex_property(job, job->role[ROLE_RED])->type);
    for (int i = ROLE_GREEN; i <= ROLE_BLUE; i++)
        if (is_float(vertex_property(job, job->role[i])->type) != first) {
            reader_warn(job->reader, 1, "colour channels are partly integers, partly floats; kept as scalars");
            return false;
        }
    return true;
}

static void drop_roles(struct job *job, enum role first, enum role last) {
    for (int i = (int)first; i <= (int)last; i++) job->role[i] = NO_PROPERTY;
}

static void find_roles(struct job *job) {
    for (int i = 0; i < ROLE_COUNT; i++) job->role[i] = NO_PROPERTY;
    for (uint32_t i = 0; i < job->vertex->property_count; i++) {
        const struct ply_property *property = vertex_property(job, i);
        for (size_t k = 0; k < sizeof ROLES / sizeof *ROLES && property->count_type == PLY_NONE; k++)
            if (ply_word_is(property->name, ROLES[k].name) && job->role[ROLES[k].role] == NO_PROPERTY) job->role[ROLES[k].role] = i;
    }
    if (!has_roles(job, ROLE_NX)) drop_roles(job, ROLE_NX, ROLE_NZ);
    if (!colours_fit(job)) drop_roles(job, ROLE_RED, ROLE_ALPHA);
}

static void find_scalars(struct job *job) {
    uint32_t left_out = 0;
    for (uint32_t i = 0; i < job->vertex->property_count; i++) {
        bool taken = vertex_property(job, i)->count_type != PLY_NONE;
        for (int k = 0; k < ROLE_COUNT; k++) taken |= job->role[k] == i;
        if (taken) continue;
        if (job->scalar_count < PBR_MAX_SCALARS) job->scalar[job->scalar_count++] = i;
        else left_out++;
    }
    if (left_out)
        reader_warn(job->reader, 1, "%u vertex properties left out: a point has at most %d scalars", (unsigned)left_out,
                    PBR_MAX_SCALARS);
}

static const struct ply_element *find_element(const struct ply_header *header, const char *name) {
    for (uint32_t i = 0; i < header->element_count; i++)
        if (ply_word_is(header->elements[i].name, name)) return &header->elements[i];
    return NULL;
}

static pbr_result find_vertex(struct job *job) {
    job->vertex = find_element(&job->header, "vertex");
    if (!job->vertex)
        return reader_error_line(job->reader, PBR_ERROR_FORMAT, job->header.size - 1, "the file has no element 'vertex'");
    find_roles(job);
    if (!has_roles(job, ROLE_X))
        return reader_error_line(job->reader, PBR_ERROR_UNSUPPORTED, job->header.size - 1,
                                 "element 'vertex' has no numbers x, y and z");
    return PBR_OK;
}

/* ---- the arrays ---- */

static enum ply_store store_of(uint32_t format) {
    switch (format) {
    case PBR_FORMAT_FLOAT64: return STORE_DOUBLE;
    case PBR_FORMAT_UINT16: return STORE_UNORM16;
    case PBR_FORMAT_UINT8: return STORE_UNORM8;
    default: return STORE_FLOAT;
    }
}

/* Sends a vertex property to one component of an array. */
static void direct(struct job *job, uint32_t property, const pbr_attribute *array, uint32_t component, double scale) {
    size_t size = array->stride / array->components;
    job->columns[property] = (struct ply_column){store_of(array->format), scale,
                                                 (unsigned char *)(uintptr_t)array->data + component * size, array->stride};
}

/* float holds up to 24 bits: wider properties need double. */
static uint32_t position_format(const struct job *job, enum role first) {
    for (int i = (int)first; i < (int)first + 3; i++) {
        enum ply_type type = vertex_property(job, job->role[i])->type;
        if (type == PLY_FLOAT64 || type == PLY_INT32 || type == PLY_UINT32) return PBR_FORMAT_FLOAT64;
    }
    return PBR_FORMAT_FLOAT32;
}

/* What a channel of this type holds at full: integers other than ushort are read as 0..255, as writers mean them. */
static double full_value(enum ply_type type) {
    return is_float(type) ? 1 : type == PLY_UINT16 ? 65535 : 255;
}

/* What colours are stored as. */
static uint32_t colour_format(const struct job *job) {
    bool wide = false;
    for (int i = ROLE_RED; i <= ROLE_BLUE; i++) wide |= vertex_property(job, job->role[i])->type == PLY_UINT16;
    return is_float(vertex_property(job, job->role[ROLE_RED])->type) ? PBR_FORMAT_FLOAT32
           : wide                                                    ? PBR_FORMAT_UINT16
                                                                     : PBR_FORMAT_UINT8;
}

static double format_full(uint32_t format) {
    return format == PBR_FORMAT_FLOAT32 ? 1 : format == PBR_FORMAT_UINT16 ? 65535 : 255;
}

static pbr_result make_colours(struct job *job, uint64_t rows) {
    if (job->role[ROLE_RED] == NO_PROPERTY) return PBR_OK;
    uint32_t format = colour_format(job);
    double full = format_full(format);
    uint32_t components = job->role[ROLE_ALPHA] == NO_PROPERTY ? 3 : 4;
    pbr_result result = arrays_make(&job->arrays, rows, format, components, &job->arrays.colours);
    for (uint32_t i = 0; i < components && result == PBR_OK; i++) {
        uint32_t property = job->role[ROLE_RED + i];
        direct(job, property, &job->arrays.colours, i, full / full_value(vertex_property(job, property)->type));
    }
    return result;
}

static pbr_result make_scalar(struct job *job, uint64_t rows, uint32_t index) {
    const struct ply_word *name = &vertex_property(job, job->scalar[index])->name;
    size_t length = name->length < SCALAR_NAME ? name->length : SCALAR_NAME - 1;
    memcpy(job->scalar_names[index], name->text, length);
    pbr_attribute values;
    pbr_result result = arrays_make_scalar(&job->arrays, rows, PBR_FORMAT_FLOAT32, job->scalar_names[index], &values);
    if (result == PBR_OK) direct(job, job->scalar[index], &values, 0, 1);
    return result;
}

static pbr_result make_vertex_arrays(struct job *job, uint64_t rows) {
    pbr_result result = arrays_make(&job->arrays, rows, position_format(job, ROLE_X), 3, &job->arrays.positions);
    for (uint32_t i = 0; i < 3 && result == PBR_OK; i++) direct(job, job->role[ROLE_X + i], &job->arrays.positions, i, 1);
    if (result == PBR_OK && has_roles(job, ROLE_NX))
        result = arrays_make(&job->arrays, rows, PBR_FORMAT_FLOAT32, 3, &job->arrays.normals);
    for (uint32_t i = 0; i < 3 && job->arrays.normals.data; i++) direct(job, job->role[ROLE_NX + i], &job->arrays.normals, i, 1);
    if (result == PBR_OK) result = make_colours(job, rows);
    if (result == PBR_OK && job->role[ROLE_RADIUS] != NO_PROPERTY) {
        result = arrays_make(&job->arrays, rows, PBR_FORMAT_FLOAT32, 1, &job->arrays.radii);
        if (result == PBR_OK) direct(job, job->role[ROLE_RADIUS], &job->arrays.radii, 0, 1);
    }
    for (uint32_t i = 0; i < job->scalar_count && result == PBR_OK; i++) result = make_scalar(job, rows, i);
    return result;
}

/* ---- the elements ---- */

static enum ply_shape shape_of(const struct job *job, const struct ply_element *element, uint32_t *index_property) {
    enum ply_shape shape = ply_word_is(element->name, "face")                                                  ? SHAPE_POLYGON
                           : ply_word_is(element->name, "tristrips") || ply_word_is(element->name, "tristrip") ? SHAPE_STRIP
                                                                                                               : SHAPE_NONE;
    for (uint32_t i = 0; i < element->property_count && shape != SHAPE_NONE; i++) {
        const struct ply_property *property = &job->header.properties[element->first_property + i];
        bool named = ply_word_is(property->name, "vertex_indices") || ply_word_is(property->name, "vertex_index");
        if (named && property->count_type != PLY_NONE) {
            *index_property = i;
            return shape;
        }
    }
    return SHAPE_NONE;
}

static const struct ply_element *last_with_data(const struct job *job) {
    const struct ply_element *last = NULL;
    for (size_t i = 0; i < job->header.element_count; i++)
        if (job->header.elements[i].count > 0 && job->header.elements[i].property_count > 0) last = &job->header.elements[i];
    return last;
}

static pbr_result no_vertex(struct job *job, size_t position) {
    static const char REASON[] = "the data ends before the first whole vertex";
    if (job->header.encoding == PLY_ASCII) return reader_error_line(job->reader, PBR_ERROR_FORMAT, position, "%s", REASON);
    return reader_error_byte(job->reader, PBR_ERROR_FORMAT, position, "%s", REASON);
}

static pbr_result read_element(struct job *job, const struct ply_element *element, size_t *position) {
    struct reader *reader = job->reader;
    bool ascii = job->header.encoding == PLY_ASCII, is_vertex = element == job->vertex;
    struct ply_target target = {.properties = job->header.properties + element->first_property,
                                .property_count = element->property_count};
    target.shape = shape_of(job, element, &target.index_property);
    target.vertex_count = job->have_vertices ? job->arrays.count : job->vertex->count;
    if (target.vertex_count > PBR_MAX_POINTS) target.vertex_count = PBR_MAX_POINTS;

    /* Never more rows than the bytes that are left can hold. */
    size_t smallest = ply_smallest_row(&target, ascii);
    uint64_t count = element->count, most = smallest ? (reader->size - *position + ascii) / smallest : count, rows = 0;
    if (count > most) count = most;
    if (is_vertex && count > PBR_MAX_POINTS)
        return pbr_log(reader->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%s: %llu vertices, the limit is %llu", reader->name,
                       (unsigned long long)count, (unsigned long long)PBR_MAX_POINTS);
    pbr_result result = is_vertex ? make_vertex_arrays(job, count) : PBR_OK;
    if (result != PBR_OK) return result;
    if (is_vertex) target.columns = job->columns;

    if (target.shape == SHAPE_POLYGON)
        job->polygons = (struct ply_polygons){element, target.index_property, *position, 0, target.vertex_count};
    job->shapes += target.shape != SHAPE_NONE;
    bool last = count == element->count && (!job->last || element >= job->last);
    result = ascii ? ply_ascii_rows(reader, &target, count, last, position, &rows, &job->faces, &job->room)
                   : ply_binary_rows(reader, &target, count, job->header.encoding == PLY_BIG_ENDIAN, position, &rows, &job->faces,
                                     &job->room);
    if (job->polygons.element == element) job->polygons.rows = rows;
    if (is_vertex) {
        job->arrays.count = rows;
        job->have_vertices = true;
    }
    if (result != PBR_OK || rows == element->count) return result;
    job->cut = true;
    if (is_vertex && rows == 0) return no_vertex(job, *position);
    struct excerpt name = reader_excerpt(element->name.text, element->name.text + element->name.length);
    reader_warn(reader, 1, "the data ends after %llu of %llu rows of element '%s'", (unsigned long long)rows,
                (unsigned long long)element->count, name.text);
    return PBR_OK;
}

static void warn_trailing(struct job *job, size_t position) {
    const char *p = job->reader->data + position, *end = job->reader->data + job->reader->size;
    if (job->header.encoding == PLY_ASCII)
        while (p < end && (*p == ' ' || (*p >= '\t' && *p <= '\r'))) p++;
    if (p < end) reader_warn(job->reader, 1, "%zu bytes after the last element ignored", (size_t)(end - p));
}

static pbr_result read_elements(struct job *job) {
    size_t position = job->header.size;
    job->last = last_with_data(job);
    for (uint32_t i = 0; i < job->header.element_count && !job->cut; i++) {
        pbr_result result = read_element(job, &job->header.elements[i], &position);
        if (result != PBR_OK) return result;
    }
    if (!job->have_vertices) return no_vertex(job, position);
    if (!job->cut) warn_trailing(job, position);
    return reader_progress(job->reader, job->reader->size);
}

/* ---- points and mesh ---- */

/* Faces that came before vertices that then turned out fewer than declared. */
static void drop_out_of_range(struct job *job) {
    size_t kept = 0;
    for (size_t i = 0; i < job->faces.count; i++) {
        uint32_t corners[3];
        memcpy(corners, job->faces.triangles[i], sizeof corners);
        if (corners[0] < job->arrays.count && corners[1] < job->arrays.count && corners[2] < job->arrays.count)
            memcpy(job->faces.triangles[kept++], corners, sizeof corners);
    }
    job->faces.out_of_range += job->faces.count - kept;
    job->faces.count = kept;
}

static void warn_faces(struct job *job) {
    ply_faces_warn(job->reader, &job->faces);
    if (job->vertex->count == 0) reader_warn(job->reader, 1, "the file has no vertices");
}

static void free_job(struct job *job) {
    pbr_instance *instance = job->reader->instance;
    arrays_free(&job->arrays);
    pbr_free(instance, job->columns);
    pbr_free(instance, job->faces.triangles);
    ply_header_free(instance, &job->header);
}

static const char *const ENCODINGS[] = {"", "ascii", "binary_little_endian", "binary_big_endian"};

pbr_result ply_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    struct job job = {.reader = reader, .arrays = {.instance = reader->instance}};
    pbr_result result = ply_header_read(reader, &job.header);
    if (result == PBR_OK) result = find_vertex(&job);
    if (result != PBR_OK) goto cleanup;
    find_scalars(&job);
    job.columns = pbr_allocate(reader->instance, job.vertex->property_count, sizeof *job.columns);
    if (!job.columns) {
        result = PBR_ERROR_OUT_OF_MEMORY;
        goto cleanup;
    }
    result = read_elements(&job);
    if (result != PBR_OK) goto cleanup;
    if (job.arrays.count < job.vertex->count) drop_out_of_range(&job);
    else if (job.shapes == 1) result = ply_paint(reader, &job.header, &job.polygons, &job.arrays, &job.faces);
    if (result != PBR_OK) goto cleanup;
    warn_faces(&job);
    if (job.faces.count > 0) result = arrays_mesh(&job.arrays, job.faces.triangles, job.faces.count, desc, content);
    else result = arrays_points(&job.arrays, desc, content);
    content->format = PBR_FILE_PLY;
    content->vertex_count = job.arrays.count;
    content->face_count = job.faces.faces;
    snprintf(content->encoding, sizeof content->encoding, "%s", ENCODINGS[job.header.encoding]);
cleanup:
    free_job(&job);
    return result;
}

/* ---- the points where they are ---- */

static bool has_lists(const struct job *job, const struct ply_element *element) {
    for (uint32_t i = 0; i < element->property_count; i++)
        if (job->header.properties[element->first_property + i].count_type != PLY_NONE) return true;
    return false;
}

static size_t row_size(const struct job *job, const struct ply_element *element) {
    const struct ply_target target = {.properties = job->header.properties + element->first_property,
                                      .property_count = element->property_count};
    return ply_smallest_row(&target, false);
}

static pbr_result no_records(struct job *job, const char *why) {
    return pbr_log(job->reader->instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED, "%s: cannot be read in pieces: %s",
                   job->reader->name, why);
}

/* Where the vertices begin. */
static pbr_result find_records(struct job *job, size_t *position) {
    *position = job->header.size;
    if (job->header.encoding == PLY_ASCII) return no_records(job, "it is text; only LAS and binary PLY can");
    if (has_lists(job, job->vertex)) return no_records(job, "its vertices have lists");
    for (const struct ply_element *element = job->header.elements; element < job->vertex; element++) {
        if (has_lists(job, element)) return no_records(job, "there are lists before its vertices");
        const size_t size = row_size(job, element);
        if (size > 0 && element->count > (job->reader->size - *position) / size) return no_vertex(job, job->reader->size);
        *position += (size_t)element->count * size;
    }
    return PBR_OK;
}

static pbr_result count_records(struct job *job, size_t position, struct records *out) {
    out->data = job->reader->data + position;
    out->size = row_size(job, job->vertex);
    out->count = (job->reader->size - position) / out->size;
    if (out->count == 0 && job->vertex->count > 0) return no_vertex(job, position);
    if (job->vertex->count == 0) reader_warn(job->reader, 1, "the file has no vertices");
    if (out->count < job->vertex->count)
        reader_warn(job->reader, 1, "the data ends after %llu of %llu rows of element 'vertex'", (unsigned long long)out->count,
                    (unsigned long long)job->vertex->count);
    else out->count = job->vertex->count;
    return PBR_OK;
}

static struct record_field make_field(const struct job *job, enum role role, double scale) {
    struct record_field field = {.scale = scale};
    if (job->role[role] == NO_PROPERTY) return field;
    for (uint32_t i = 0; i < job->role[role]; i++) field.at += ply_type_size(vertex_property(job, i)->type);
    field.type = vertex_property(job, job->role[role])->type;
    return field;
}

static void find_fields(const struct job *job, struct records *out) {
    for (enum role k = 0; k < 3; k++) {
        out->position[k] = make_field(job, ROLE_X + k, 1);
        out->normal[k] = make_field(job, ROLE_NX + k, 1);
    }
    out->radius = make_field(job, ROLE_RADIUS, 1);
    if (job->role[ROLE_RED] == NO_PROPERTY) return;
    const uint32_t format = colour_format(job);
    out->colours = format == PBR_FORMAT_FLOAT32 ? RECORD_LINEAR : format == PBR_FORMAT_UINT16 ? RECORD_UNORM16 : RECORD_UNORM8;
    for (enum role k = 0; k < 3; k++)
        out->colour[k] =
            make_field(job, ROLE_RED + k, format_full(format) / full_value(vertex_property(job, job->role[ROLE_RED + k])->type));
}

pbr_result ply_records(struct reader *reader, struct records *out) {
    struct job job = {.reader = reader, .arrays = {.instance = reader->instance}};
    size_t position;
    pbr_result result = ply_header_read(reader, &job.header);
    if (result == PBR_OK) result = find_vertex(&job);
    if (result == PBR_OK) result = find_records(&job, &position);
    if (result == PBR_OK) result = count_records(&job, position, out);
    if (result == PBR_OK) {
        uint32_t property;
        find_fields(&job, out);
        out->big_endian = job.header.encoding == PLY_BIG_ENDIAN;
        snprintf(out->encoding, sizeof out->encoding, "%s", ENCODINGS[job.header.encoding]);
        for (uint32_t i = 0; i < job.header.element_count; i++)
            if (shape_of(&job, &job.header.elements[i], &property) != SHAPE_NONE) out->face_count += job.header.elements[i].count;
    }
    free_job(&job);
    return result;
}
