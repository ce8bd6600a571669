/* A tree as a sequence: coded in a chunk's scales, sorted by the parents' errors, with the table that prefixes are found by.
 * SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "core/matrix.h"
#include "core/points.h"
#include "spt_build.h"

/* Steps are made so much longer that the largest value has a code, however products are rounded. */
static const double STEP_ROOM = 1 + 1e-6;

/* Distances, so that they hold the difference of two depths that shaders compute, by an exp2() of their own. */
static const double DISTANCE_ROOM = 1 + 1.0 / 64;

struct sequence {
    pbr_instance *instance;
    const struct spt_tree *tree;
    struct spt_chunk *chunk;
    struct spt_entry *drafts; /* in the tree's order */
    float *radii;             /* that hold the nodes' discs in spite of moved centres */
    double side;
};

/* The least code that decodes to v or more. */
static uint32_t code_above(double v, float step) {
    uint32_t code = (uint32_t)ceil(v / (double)step);
    if ((double)((float)code * step) < v) code++;
    return code;
}

/* ---- Codes ---- */

static void choose_origin(struct sequence *sequence) {
    double high[3] = {-INFINITY, -INFINITY, -INFINITY}, *low = sequence->chunk->origin;
    for (int k = 0; k < 3; k++) low[k] = INFINITY;
    for (uint32_t i = 0; i < sequence->tree->count; i++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], sequence->tree->nodes[i].position[k]);
            high[k] = fmax(high[k], sequence->tree->nodes[i].position[k]);
        }
    for (int k = 0; k < 3; k++) sequence->side = fmax(sequence->side, high[k] - low[k]);
    sequence->chunk->position_step = float_above(sequence->side / SPT_CODES * STEP_ROOM);
}

/* Returns how far the position moves. */
static double encode_position(const struct spt_chunk *chunk, const struct spt_node *node, struct spt_entry *entry) {
    const double step = (double)chunk->position_step;
    float decoded[3];
    double moved[3];
    for (int k = 0; k < 3; k++)
        entry->position[k] = step > 0 ? (uint16_t)fmin(rint((node->position[k] - chunk->origin[k]) / step), SPT_CODES) : 0;
    spt_decode_position(chunk, entry, decoded);
    for (int k = 0; k < 3; k++) moved[k] = chunk->origin[k] + (double)decoded[k] - node->position[k];
    return length3(moved);
}

static void encode_places(struct sequence *sequence) {
    struct spt_chunk *chunk = sequence->chunk;
    float largest = 0;
    choose_origin(sequence);
    for (uint32_t i = 0; i < sequence->tree->count; i++) {
        const struct spt_node *node = &sequence->tree->nodes[i];
        struct spt_entry *entry = &sequence->drafts[i];
        const double moved = encode_position(chunk, node, entry);
        sequence->radii[i] = node->radius > 0 ? float_above((double)node->radius + moved) : 0;
        largest = fmaxf(largest, sequence->radii[i]);
        splat_encode_normal(node->normal, entry->normal);
        for (int k = 0; k < 3; k++) entry->colour[k] = unorm8(srgb_from_linear(node->colour[k]));
    }
    chunk->radius_step = float_above((double)largest / SPT_CODES * STEP_ROOM);
    for (uint32_t i = 0; i < sequence->tree->count && largest > 0; i++)
        sequence->drafts[i].radius = (uint16_t)fmin(code_above((double)sequence->radii[i], chunk->radius_step), SPT_CODES);
}

static void encode_errors(struct sequence *sequence) {
    const struct spt_tree *tree = sequence->tree;
    struct spt_chunk *chunk = sequence->chunk;
    const uint32_t most = SPT_NO_PARENT - 1;
    chunk->error_step = fmaxf(float_above((double)tree->nodes[tree->count - 1].error / most * STEP_ROOM), FLT_MIN);
    for (uint32_t i = tree->count; i-- > 0;) { /* parents first */
        const struct spt_node *node = &tree->nodes[i];
        struct spt_entry *entry = &sequence->drafts[i];
        const uint32_t code = code_above((double)node->error, chunk->error_step);
        /* 0 is for leaves alone. */
        entry->error = (uint16_t)(node->children == 0 ? 0 : code < 1 ? 1 : code < most ? code : most);
        entry->parent_error = node->parent == UINT32_MAX ? SPT_NO_PARENT : sequence->drafts[node->parent].error;
    }
}

/* Of the positions as they decode. */
static double distance_to_parent(const struct sequence *sequence, uint32_t i) {
    const struct spt_node *node = &sequence->tree->nodes[i];
    float a[3], b[3];
    double d[3];
    if (node->parent == UINT32_MAX) return 0;
    spt_decode_position(sequence->chunk, &sequence->drafts[i], a);
    spt_decode_position(sequence->chunk, &sequence->drafts[node->parent], b);
    for (int k = 0; k < 3; k++) d[k] = (double)a[k] - (double)b[k];
    return length3(d) * DISTANCE_ROOM;
}

static uint8_t distance_code(const struct spt_chunk *chunk, double distance) {
    if (!(distance > 0)) return 0;
    const double exact = ceil(255 + 16 * log2(distance / (double)chunk->largest_distance));
    uint8_t code = (uint8_t)fmin(fmax(exact, 1), 255);
    while (code < 255 && (double)spt_decode_distance(chunk, code) < distance) code++;
    return code;
}

static void encode_distances(struct sequence *sequence) {
    double largest = 0;
    for (uint32_t i = 0; i < sequence->tree->count; i++) largest = fmax(largest, distance_to_parent(sequence, i));
    sequence->chunk->largest_distance = float_above(largest);
    for (uint32_t i = 0; i < sequence->tree->count; i++)
        sequence->drafts[i].distance = distance_code(sequence->chunk, distance_to_parent(sequence, i));
}

/* ---- Bounds ---- */

/* Around balls, since what has no normal, and what is drawn as a circle, faces the eye. */
static void measure_bounds(struct sequence *sequence) {
    struct spt_chunk *chunk = sequence->chunk;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, reach = 0;
    for (uint32_t i = 0; i < sequence->tree->count; i++) {
        const double radius = (double)spt_decode_radius(chunk, &sequence->drafts[i]);
        float p[3];
        spt_decode_position(chunk, &sequence->drafts[i], p);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], (double)p[k] - radius);
            high[k] = fmax(high[k], (double)p[k] + radius);
        }
    }
    for (int k = 0; k < 3; k++) {
        chunk->minimum[k] = -float_above(-low[k]);
        chunk->maximum[k] = float_above(high[k]);
        chunk->centre[k] = (float)((low[k] + high[k]) / 2);
    }
    for (uint32_t i = 0; i < sequence->tree->count; i++) {
        float p[3];
        double d[3];
        spt_decode_position(chunk, &sequence->drafts[i], p);
        for (int k = 0; k < 3; k++) d[k] = (double)p[k] - (double)chunk->centre[k];
        reach = fmax(reach, length3(d) + (double)spt_decode_radius(chunk, &sequence->drafts[i]));
    }
    chunk->radius = float_above(reach * (1 + 1e-9));
}

static bool lacks_normal(const float normal[3]) {
    return normal[0] == 0 && normal[1] == 0 && normal[2] == 0;
}

/* Around the mean of the leaves', of the normals as they decode. */
static void measure_cone(struct sequence *sequence) {
    struct spt_chunk *chunk = sequence->chunk;
    double sum[3] = {0, 0, 0}, least = 1;
    float normal[3];
    chunk->cone = -1;
    for (uint32_t i = 0; i < sequence->tree->count; i++) {
        splat_decode_normal(sequence->drafts[i].normal, normal);
        if (lacks_normal(normal)) return;
        for (int k = 0; k < 3 && sequence->tree->nodes[i].children == 0; k++) sum[k] += (double)normal[k];
    }
    const double length = length3(sum);
    if (!(length > 0)) return;
    for (uint32_t i = 0; i < sequence->tree->count; i++) {
        double dot = 0;
        splat_decode_normal(sequence->drafts[i].normal, normal);
        for (int k = 0; k < 3; k++) dot += sum[k] / length * (double)normal[k];
        least = fmin(least, dot);
    }
    for (int k = 0; k < 3; k++) chunk->axis[k] = (float)(sum[k] / length);
    chunk->cone = (float)fmax(least - 4 * FLT_EPSILON, -1);
}

/* ---- Order ---- */

/* Parents' errors descending, then own, then as in the tree, which is Morton order. */
static pbr_result sort_drafts(const struct sequence *sequence, struct spt_entry *entries, uint32_t *order) {
    pbr_instance *instance = sequence->instance;
    const uint32_t count = sequence->tree->count;
    struct sort_entry *keys = pbr_allocate(instance, count, sizeof *keys), *spare = pbr_allocate(instance, count, sizeof *spare);
    struct sort_entry *sorted = NULL;
    pbr_result result = keys && spare ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
    for (uint32_t i = 0; i < count && result == PBR_OK; i++) {
        const struct spt_entry *draft = &sequence->drafts[i];
        keys[i].key = (uint64_t)(SPT_CODES - draft->parent_error) << 16 | (uint64_t)(SPT_CODES - draft->error);
        keys[i].value = i;
    }
    if (result == PBR_OK) result = sort_by_key(instance, 1, keys, spare, count, 32, &sorted);
    for (uint32_t i = 0; i < count && result == PBR_OK; i++) {
        entries[i] = sequence->drafts[sorted[i].value];
        if (order) order[i] = sorted[i].value;
    }
    pbr_free(instance, keys);
    pbr_free(instance, spare);
    return result;
}

static void make_table(const struct spt_chunk *chunk, const struct spt_entry *entries, struct spt_step *steps) {
    const uint32_t count = spt_step_count(chunk);
    float least = SPT_ENDLESS, distance = 0;
    for (uint32_t i = 0; i < chunk->count; i++) {
        least = fminf(least, spt_decode_error(chunk, entries[i].error));
        if (i % SPT_STEP == 0) steps[i / SPT_STEP].error = spt_decode_error(chunk, entries[i].parent_error);
        steps[i / SPT_STEP].least = least;
    }
    for (uint32_t k = count; k-- > 0;) {
        for (uint32_t i = k * SPT_STEP; i < chunk->count && i < (k + 1) * SPT_STEP; i++)
            distance = fmaxf(distance, spt_decode_distance(chunk, entries[i].distance));
        steps[k].distance = distance;
    }
}

pbr_result spt_sequence(pbr_instance *instance, const struct spt_tree *tree, struct spt_chunk *chunk,
                        const struct spt_entry **entries, const struct spt_step **steps, uint32_t *order) {
    struct sequence sequence = {.instance = instance, .tree = tree, .chunk = chunk};
    pbr_result result = PBR_ERROR_OUT_OF_MEMORY;
    memset(chunk, 0, sizeof *chunk);
    chunk->count = tree->count;
    chunk->levels = tree->nodes[tree->count - 1].height;
    for (uint32_t i = 0; i < tree->count; i++) chunk->leaves += tree->nodes[i].children == 0;
    struct spt_entry *made = pbr_allocate(instance, chunk->count, sizeof *made);
    struct spt_step *table = pbr_allocate(instance, spt_step_count(chunk), sizeof *table);
    *entries = made;
    *steps = table;
    sequence.drafts = pbr_allocate(instance, chunk->count, sizeof *sequence.drafts);
    sequence.radii = pbr_allocate(instance, chunk->count, sizeof *sequence.radii);
    if (!made || !table || !sequence.drafts || !sequence.radii) goto cleanup;
    encode_places(&sequence);
    encode_errors(&sequence);
    encode_distances(&sequence);
    measure_bounds(&sequence);
    measure_cone(&sequence);
    result = sort_drafts(&sequence, made, order);
    if (result == PBR_OK) make_table(chunk, made, table);
cleanup:
    pbr_free(instance, sequence.drafts);
    pbr_free(instance, sequence.radii);
    return result;
}
