/* A sequential point tree in our own container: a header, the chunks, their tables, their entries, their fields, as they are in
 * memory.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "container.h"
#include "lod.h"
#include "spt.h"

/* Leaves, entries: 64 bits each; chunks, flags: 32 bits each; centre, radius, span: doubles. */
enum { HEADER = 64, HAS_COLOURS = 1, HAS_NORMALS = 2, HAS_FIELDS = 4 };

/* A step that is larger decodes to what is above SPT_ENDLESS. */
static const float STEP_MOST = 1e25f;

static pbr_result wrong(pbr_instance *instance, const char *path, const char *what) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_FORMAT, "%s: the section of the sequential point tree %s", path, what);
}

static pbr_result foreign(pbr_instance *instance, const char *path) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                   "%s: files of sequential point trees are for little-endian machines", path);
}

/* ---- Reading ---- */

static bool are_within(const float *v, size_t count, float least, float most) {
    for (size_t i = 0; i < count; i++)
        if (!(v[i] >= least && v[i] <= most)) return false;
    return true;
}

static const char *chunk_fault(const struct spt_chunk *chunk, uint64_t first) {
    if (chunk->count == 0 || chunk->count > SPT_ENTRIES_MOST || chunk->leaves == 0 || chunk->leaves > chunk->count)
        return "has a chunk with an impossible number of entries";
    if (chunk->first != first) return "has a chunk in an impossible place";
    for (int k = 0; k < 3; k++)
        if (!(fabs(chunk->origin[k]) <= LOD_EXTENT_MOST)) return "has a chunk with an impossible origin";
    const float steps[] = {chunk->position_step, chunk->radius_step, chunk->error_step, chunk->largest_distance};
    if (!are_within(steps, 4, 0, STEP_MOST) || !are_within(&chunk->radius, 1, 0, SPT_ENDLESS) || !(chunk->error_step > 0))
        return "has a chunk with impossible scales";
    if (!are_within(chunk->minimum, 3, -SPT_ENDLESS, SPT_ENDLESS) || !are_within(chunk->maximum, 3, -SPT_ENDLESS, SPT_ENDLESS) ||
        !are_within(chunk->centre, 3, -SPT_ENDLESS, SPT_ENDLESS) || !are_within(chunk->axis, 3, -1.001f, 1.001f) ||
        !are_within(&chunk->cone, 1, -1, 1))
        return "has a chunk with impossible bounds";
    for (int k = 0; k < 3; k++)
        if (chunk->minimum[k] > chunk->maximum[k] || chunk->reserved[k] != 0) return "has a chunk with impossible bounds";
    return NULL;
}

/* Falling, as a search in them expects. */
static const char *table_fault(const struct spt_step *steps, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        const float all[] = {steps[i].error, steps[i].distance, steps[i].least};
        if (!are_within(all, 3, 0, SPT_ENDLESS)) return "has a table with impossible numbers";
        if (i > 0 && (steps[i].error > steps[i - 1].error || steps[i].distance > steps[i - 1].distance ||
                      steps[i].least > steps[i - 1].least))
            return "has a table out of order";
    }
    return NULL;
}

static uint64_t load_flags(const uint8_t *header) {
    return load_little(header + 20, 4);
}

static pbr_result parse_header(pbr_instance *instance, const char *path, const uint8_t *data, struct spt *spt) {
    const uint64_t flags = load_flags(data);
    spt->leaves = load_little(data, 8);
    spt->count = load_little(data + 8, 8);
    spt->chunk_count = (uint32_t)load_little(data + 16, 4);
    spt->has_colours = (flags & HAS_COLOURS) != 0;
    spt->has_normals = (flags & HAS_NORMALS) != 0;
    memcpy(spt->centre, data + 24, sizeof spt->centre);
    memcpy(&spt->radius, data + 48, sizeof spt->radius);
    memcpy(&spt->span, data + 56, sizeof spt->span);
    if (flags & ~(uint64_t)(HAS_COLOURS | HAS_NORMALS | HAS_FIELDS))
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_UNSUPPORTED,
                       "%s: the section of the sequential point tree has flags of a later version", path);
    for (int k = 0; k < 3; k++)
        if (!isfinite(spt->centre[k])) return wrong(instance, path, "has a centre that is not finite");
    if (!(spt->radius >= 0 && spt->radius <= (double)SPT_ENDLESS && spt->span >= 0 && spt->span <= (double)SPT_ENDLESS))
        return wrong(instance, path, "has an impossible radius");
    return PBR_OK;
}

static pbr_result parse_chunks(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct spt *spt) {
    uint64_t entries = 0, leaves = 0, steps = 0;
    const char *fault = NULL;
    if (spt->chunk_count > 0) memcpy(spt->chunks, data + HEADER, spt->chunk_count * sizeof *spt->chunks);
    for (uint32_t i = 0; i < spt->chunk_count; i++) {
        const struct spt_chunk *chunk = &spt->chunks[i];
        fault = chunk_fault(chunk, entries);
        if (fault) return wrong(instance, path, fault);
        entries += chunk->count;
        leaves += chunk->leaves;
        steps += spt_step_count(chunk);
    }
    if (entries != spt->count || leaves != spt->leaves) return wrong(instance, path, "has other chunks than it says");
    const uint64_t room = size - HEADER - spt->chunk_count * sizeof *spt->chunks;
    const uint64_t entry_bytes = sizeof(struct spt_entry) + (spt->fields ? sizeof(struct normal_field) : 0);
    if (steps * sizeof(struct spt_step) + entries * entry_bytes > room) return wrong(instance, path, "lacks entries");
    const uint8_t *table = data + HEADER + spt->chunk_count * sizeof *spt->chunks;
    const uint8_t *first = table + steps * sizeof(struct spt_step), *fields = first + entries * sizeof(struct spt_entry);
    for (uint32_t i = 0; i < spt->chunk_count; i++) {
        const struct spt_chunk *chunk = &spt->chunks[i];
        spt->steps[i] = (const struct spt_step *)(const void *)table;
        spt->entries[i] = (const struct spt_entry *)(const void *)first + chunk->first;
        if (spt->fields) spt->fields[i] = (const struct normal_field *)(const void *)fields + chunk->first;
        table += spt_step_count(chunk) * sizeof(struct spt_step);
        fault = table_fault(spt->steps[i], spt_step_count(chunk));
        if (fault) return wrong(instance, path, fault);
    }
    return PBR_OK;
}

pbr_result spt_section_parse(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, struct spt *spt) {
    *spt = (struct spt){.owns = false};
    if (!is_little_endian()) return foreign(instance, path);
    if (size < HEADER) return wrong(instance, path, "is shorter than its header");
    if ((uintptr_t)data % sizeof(float) != 0) return wrong(instance, path, "is not aligned to 4 bytes");
    pbr_result result = parse_header(instance, path, data, spt);
    if (result == PBR_OK && spt->chunk_count > (size - HEADER) / sizeof *spt->chunks)
        result = wrong(instance, path, "lacks chunks");
    if (result != PBR_OK) return result;
    spt->chunks = pbr_allocate(instance, spt->chunk_count, sizeof *spt->chunks);
    spt->entries = pbr_allocate(instance, spt->chunk_count, sizeof *spt->entries);
    spt->steps = pbr_allocate(instance, spt->chunk_count, sizeof *spt->steps);
    const bool has_fields = (load_flags(data) & HAS_FIELDS) != 0;
    if (has_fields) spt->fields = pbr_allocate(instance, spt->chunk_count, sizeof *spt->fields);
    if (!spt->chunks || !spt->entries || !spt->steps || (has_fields && !spt->fields)) return PBR_ERROR_OUT_OF_MEMORY;
    return parse_chunks(instance, path, data, size, spt);
}

/* ---- Writing ---- */

static void store_header(const struct spt *spt, uint8_t header[HEADER]) {
    const uint64_t flags =
        (spt->has_colours ? HAS_COLOURS : 0) | (spt->has_normals ? HAS_NORMALS : 0) | (spt->fields ? HAS_FIELDS : 0);
    memset(header, 0, HEADER);
    store_little(spt->leaves, 8, header);
    store_little(spt->count, 8, header + 8);
    store_little(spt->chunk_count, 4, header + 16);
    store_little(flags, 4, header + 20);
    memcpy(header + 24, spt->centre, sizeof spt->centre);
    memcpy(header + 48, &spt->radius, sizeof spt->radius);
    memcpy(header + 56, &spt->span, sizeof spt->span);
}

pbr_result spt_section_write(pbr_instance *instance, const char *path, const struct spt *spt, const struct progress *progress) {
    uint8_t header[HEADER];
    const size_t chunks = spt->chunk_count, count = 2 + (spt->fields ? 3 : 2) * chunks;
    if (!is_little_endian()) return foreign(instance, path);
    struct container_part *parts = pbr_allocate(instance, count, sizeof *parts);
    if (!parts) return PBR_ERROR_OUT_OF_MEMORY;
    store_header(spt, header);
    parts[0] = (struct container_part){header, sizeof header};
    parts[1] = (struct container_part){spt->chunks, chunks * sizeof *spt->chunks};
    for (size_t i = 0; i < chunks; i++) {
        const struct spt_chunk *chunk = &spt->chunks[i];
        parts[2 + i] = (struct container_part){spt->steps[i], spt_step_count(chunk) * sizeof(struct spt_step)};
        parts[2 + chunks + i] = (struct container_part){spt->entries[i], chunk->count * sizeof(struct spt_entry)};
        if (spt->fields)
            parts[2 + 2 * chunks + i] = (struct container_part){spt->fields[i], chunk->count * sizeof(struct normal_field)};
    }
    const pbr_result result = container_write(instance, path, SPT_SECTION, parts, count, progress);
    pbr_free(instance, parts);
    return result;
}
