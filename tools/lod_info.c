/* Telling what a hierarchy is like: its nodes by level, children and cones. SPDX-License-Identifier: MIT */
#include "lod_info.h"

#include <inttypes.h>
#include <stdio.h>

#include "kinds.h"

struct facts {
    const struct input *input;
    pbr_lod_info info;
    pbr_lod_statistics counts;
    size_t levels;                                              /* that have nodes */
    double branching;                                           /* mean children of inner nodes */
    double bytes_per_node, bytes_per_point, bytes_per_triangle; /* not finite where there are none */
};

static struct facts find_facts(const struct input *input, const pbr_lod_info *info, const pbr_lod_statistics *counts) {
    struct facts facts = {.input = input, .info = *info, .counts = *counts};
    uint64_t inner = 0, children = 0;
    for (size_t i = 0; i < PBR_LOD_LEVELS; i++)
        if (counts->level_nodes[i] > 0) facts.levels = i + 1;
    for (size_t i = 0; i < 5; i++) {
        inner += counts->children[i];
        children += i * counts->children[i];
    }
    facts.branching = inner > 0 ? (double)children / (double)inner : 0;
    facts.bytes_per_node = (double)info->data_bytes / (double)counts->nodes;
    facts.bytes_per_point = (double)info->data_bytes / (double)info->point_count;
    facts.bytes_per_triangle = (double)info->data_bytes / (double)info->triangle_count;
    return facts;
}

static const char *format_name(const pbr_lod_info *info) {
    return info->file_format == PBR_LOD_FILE_QS ? "QS" : "PBR";
}

static void put_counts(struct json *json, const char *key, const uint64_t *counts, size_t count) {
    double numbers[PBR_LOD_LEVELS]; /* exact: no tree has 2^53 nodes */
    for (size_t i = 0; i < count; i++) numbers[i] = (double)counts[i];
    json_numbers(json, key, numbers, count);
}

/* Of a hierarchy over a mesh, which is in the file, too: what there is of that. */
static void put_sizes(const struct facts *facts, struct json *json) {
    json_integer(json, "bytes", facts->info.data_bytes);
    if (facts->info.kind == PBR_LOD_POP) {
        json_number(json, "bytes_per_triangle", facts->bytes_per_triangle);
        return;
    }
    json_number(json, "bytes_per_node", facts->bytes_per_node);
    json_number(json, "bits_per_node", 8 * facts->bytes_per_node);
    json_number(json, "bytes_per_point", facts->bytes_per_point);
}

static void print_json(const struct facts *facts, struct json *json) {
    const pbr_lod_info *info = &facts->info;
    const pbr_lod_statistics *counts = &facts->counts;
    json_open_object(json, NULL);
    json_string(json, "file", facts->input->path);
    json_string(json, "format", format_name(info));
    json_string(json, "lod", kind_name(lod_kinds, info->kind));
    json_integer(json, "points", info->kind == PBR_LOD_POP ? info->vertex_count : info->point_count);
    if (info->kind == PBR_LOD_POP) json_integer(json, "triangles", info->triangle_count);
    json_truth(json, "colours", info->has_colours);
    json_truth(json, "normal_fields", info->has_normal_fields);
    json_numbers(json, "centre", info->centre, 3);
    json_number(json, "bounding_radius", info->radius);
    put_sizes(facts, json);
    json_integer(json, "nodes", counts->nodes);
    json_integer(json, "leaves", counts->leaves);
    json_integer(json, "levels", counts->levels + (counts->nodes > 0));
    put_counts(json, "level_nodes", counts->level_nodes, facts->levels);
    json_number(json, "branching", facts->branching);
    put_counts(json, "children", counts->children, 5);
    put_counts(json, "cones", counts->cones, 4);
    json_number(json, "overhang_mean", counts->overhang_mean);
    json_number(json, "overhang_largest", counts->overhang_largest);
    json_number(json, "leaf_radius_mean", counts->leaf_radius_mean);
    json_integer(json, "damaged", counts->damaged);
    json_integer(json, "memory_bytes", info->memory_bytes);
    json_number(json, "load_ms", facts->input->load_ms);
    json_close_object(json);
}

static void print_counts(const char *label, const uint64_t *counts, size_t count) {
    printf("  %-10s", label);
    for (size_t i = 0; i < count; i++) printf("%s %" PRIu64, i > 0 ? "," : "", counts[i]);
    printf("\n");
}

/* What is known of trees of spheres. Those of POP are in each other. */
static void print_tree(const struct facts *facts) {
    const pbr_lod_statistics *counts = &facts->counts;
    print_counts("levels", counts->level_nodes, facts->levels);
    printf("  children   %.3g in the mean;", facts->branching);
    for (size_t i = 0; i < 5; i++)
        if (counts->children[i] > 0) printf(" %zu: %" PRIu64, i, counts->children[i]);
    printf("\n");
    print_counts("cones", counts->cones, 4);
    if (facts->info.kind == PBR_LOD_POP) return;
    printf("  overhang   %.3g of the parent's radius in the mean, %.3g at most\n", counts->overhang_mean, counts->overhang_largest);
}

static void print_text(const struct facts *facts) {
    const pbr_lod_info *info = &facts->info;
    const pbr_lod_statistics *counts = &facts->counts;
    const bool is_pop = info->kind == PBR_LOD_POP;
    session_print_name(facts->input->path);
    printf("\n  format     %s, hierarchy of kind %s\n", format_name(info), kind_name(lod_kinds, info->kind));
    if (is_pop) printf("  triangles  %" PRIu64 "\n  vertices   %" PRIu64 "\n", info->triangle_count, info->vertex_count);
    else printf("  points     %" PRIu64 "\n", info->point_count);
    printf("  colours    %s\n", info->has_colours ? "given" : "none");
    printf("  sphere     centre (%.9g, %.9g, %.9g), radius %.9g\n", info->centre[0], info->centre[1], info->centre[2],
           info->radius);
    printf("  bytes      %" PRIu64 ": ", info->data_bytes);
    if (is_pop) printf("%.3g a triangle\n", facts->bytes_per_triangle);
    else
        printf("%.3g a node (%.4g bits), %.3g a point\n", facts->bytes_per_node, 8 * facts->bytes_per_node, facts->bytes_per_point);
    printf("  nodes      %" PRIu64 ", %" PRIu64 " of them leaves, on %" PRIu64 " levels\n", counts->nodes, counts->leaves,
           counts->levels + (counts->nodes > 0));
    if (info->kind != PBR_LOD_SPT) print_tree(facts);
    else printf("  fields     %s\n", info->has_normal_fields ? "of normals" : "none");
    printf("  leaves     radius %g in the mean\n", counts->leaf_radius_mean);
    if (counts->damaged > 0) printf("  damaged    %" PRIu64 " groups of nodes lie outside the file\n", counts->damaged);
    printf("  memory     %.1f MB\n  opened in  %.1f ms\n", 1e-6 * (double)info->memory_bytes, facts->input->load_ms);
}

bool lod_info_print(struct session *session, const struct input *input, struct json *json) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_lod_statistics counts = PBR_LOD_STATISTICS_INIT;
    const unsigned errors = atomic_load(&session->errors);
    pbr_result result = pbr_lod_get_info(input->lod, &info);
    if (result == PBR_OK) result = pbr_lod_measure(input->lod, session_progress, session, &counts);
    session_progress_end(session);
    if (!session_check(session, result, errors, input->path)) return false;
    const struct facts facts = find_facts(input, &info, &counts);
    if (json) print_json(&facts, json);
    else print_text(&facts);
    return true;
}
