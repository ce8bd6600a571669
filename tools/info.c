/* pbr info: what a file holds. SPDX-License-Identifier: MIT */
#include <inttypes.h>

#include "commands.h"
#include "input.h"
#include "json.h"
#include "lod_info.h"
#include "options.h"

static const char *format_name(uint32_t format) {
    static const char *const NAMES[] = {
        [PBR_FILE_PLY] = "PLY", [PBR_FILE_LAS] = "LAS", [PBR_FILE_XYZ] = "XYZ", [PBR_FILE_PTS] = "PTS",
        [PBR_FILE_OBJ] = "OBJ", [PBR_FILE_OFF] = "OFF", [PBR_FILE_TRI] = "TRI"};
    return format < sizeof NAMES / sizeof *NAMES && NAMES[format] ? NAMES[format] : "unknown";
}

static const char *normals_name(const struct input *input) {
    if (!input->info.has_normals) return "none";
    return input->is_mesh && !input->mesh.has_normals ? "from faces" : "given";
}

static void print_json(const struct input *input, struct json *json) {
    const pbr_points_info *info = &input->info;
    json_open_object(json, NULL);
    json_string(json, "file", input->path);
    json_string(json, "format", format_name(input->format));
    json_string(json, "encoding", input->encoding);
    json_integer(json, "vertices", input->vertex_count);
    json_integer(json, "faces", input->face_count);
    json_integer(json, "triangles", input->mesh.triangle_count);
    json_integer(json, "points", info->count);
    json_integer(json, "dropped", info->dropped_count);
    json_integer(json, "dropped_triangles", input->mesh.dropped_triangle_count);
    json_integer(json, "unreferenced", input->mesh.unreferenced_count);
    json_integer(json, "degenerate", input->mesh.degenerate_count);
    json_string(json, "normals", normals_name(input));
    json_truth(json, "colours", info->has_colours);
    json_open_object(json, "radii");
    json_string(json, "source", input->radii);
    json_number(json, "minimum", (double)info->radius_minimum);
    json_number(json, "mean", (double)info->radius_mean);
    json_number(json, "maximum", (double)info->radius_maximum);
    json_close_object(json);
    json_open_array(json, "scalars");
    for (uint32_t i = 0; i < info->scalar_count; i++) json_string(json, NULL, pbr_points_scalar_name(input->points, i));
    json_close_array(json);
    json_numbers(json, "minimum", info->minimum, 3);
    json_numbers(json, "maximum", info->maximum, 3);
    json_numbers(json, "centre", info->centre, 3);
    json_number(json, "bounding_radius", info->bounding_radius);
    json_integer(json, "warnings", input->warning_count);
    json_integer(json, "memory_bytes", info->memory_bytes + input->mesh.memory_bytes);
    json_number(json, "load_ms", input->load_ms);
    json_close_object(json);
}

static void print_text(const struct input *input) {
    const pbr_points_info *info = &input->info;
    session_print_name(input->path);
    printf("\n  format     %s, %s\n", format_name(input->format), input->encoding);
    printf("  vertices   %" PRIu64 "\n", input->vertex_count);
    if (input->is_mesh)
        printf("  faces      %" PRIu64 ": %" PRIu64 " triangles, %" PRIu64 " without area, %" PRIu64 " dropped\n",
               input->face_count, input->mesh.triangle_count, input->mesh.degenerate_count, input->mesh.dropped_triangle_count);
    printf("  points     %" PRIu64, info->count);
    if (input->is_mesh) printf(", %" PRIu64 " vertices in no face", input->mesh.unreferenced_count);
    if (info->dropped_count) printf(", %" PRIu64 " dropped (not finite)", info->dropped_count);
    printf("\n  normals    %s\n  colours    %s\n", normals_name(input), info->has_colours ? "given" : "none");
    printf("  radii      %s: %g to %g, mean %g\n", input->radii, (double)info->radius_minimum, (double)info->radius_maximum,
           (double)info->radius_mean);
    printf("  scalars   %s", info->scalar_count ? "" : " none");
    for (uint32_t i = 0; i < info->scalar_count; i++) {
        fputs(i ? ", " : " ", stdout);
        session_print_name(pbr_points_scalar_name(input->points, i));
    }
    printf("\n  box        (%.9g, %.9g, %.9g) to (%.9g, %.9g, %.9g)\n", info->minimum[0], info->minimum[1], info->minimum[2],
           info->maximum[0], info->maximum[1], info->maximum[2]);
    printf("  sphere     centre (%.9g, %.9g, %.9g), radius %.9g\n", info->centre[0], info->centre[1], info->centre[2],
           info->bounding_radius);
    printf("  memory     %.1f MB\n  read in    %.1f ms\n", 1e-6 * (double)(info->memory_bytes + input->mesh.memory_bytes),
           input->load_ms);
}

/* As JSON or, without, as text. False with a message. */
static bool print(struct session *session, const struct input *input, struct json *json) {
    if (input->lod) return lod_info_print(session, input, json);
    if (json) print_json(input, json);
    else print_text(input);
    return true;
}

static int run_info(struct session *session, int argc, char **argv) {
    enum { JSON };
    static const struct option_rule rules[] = {[JSON] = {"--json", false}, {NULL, false}};
    struct option_scan scan = {.argc = argc, .argv = argv};
    struct json json = {.file = stdout};
    bool as_json = false;
    int file_count = 0, status = STATUS_OK, option;

    while ((option = option_next(&scan, rules)) != OPTION_END) {
        if (option == OPTION_BAD) return session_fail(session, "info: %s (see pbr info --help)", scan.error), STATUS_USAGE;
        if (option == JSON) as_json = true;
        if (option == OPTION_OPERAND) argv[file_count++] = argv[scan.next - 1]; /* operands to the front, never ahead of the scan */
    }
    if (file_count == 0) return session_fail(session, "info: no file given (see pbr info --help)"), STATUS_USAGE;
    if (as_json && file_count > 1) json_open_array(&json, NULL);
    for (int i = 0; i < file_count; i++) {
        struct input input;
        bool told =
            input_load(session, argv[i], 0, session_progress, session, &input) && print(session, &input, as_json ? &json : NULL);
        if (!told) status = STATUS_FAILED;
        input_release(&input);
    }
    if (as_json && file_count > 1) json_close_array(&json);
    return status;
}

const struct command info_command = {
    "info", run_info,
    "usage: pbr info FILE... [--json]\n"
    "\n"
    "Tells what each file holds, as points that can be drawn: a mesh's vertices, or a file's points with the radii that it gives "
    "or that\n"
    "their spacing suggests. Of a hierarchy, .pbr or .qs, it walks over everything and counts. --json prints an object, or an\n"
    "array of objects for more than one file.\n"};
