/* pbr convert: points into a hierarchy's file, a hierarchy into another file or back into points. SPDX-License-Identifier: MIT */
#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <string.h>
#include <sys/stat.h>

#include "commands.h"
#include "input.h"
#include "json.h"
#include "kinds.h"
#include "options.h"
#include "stream.h"

enum { FORMAT_PLY = 0 }; /* beside PBR_LOD_FILE_... */

struct convert {
    struct session *session;
    const char *source, *output;
    uint32_t lod;     /* PBR_LOD_...; 0: not said */
    uint32_t format;  /* FORMAT_PLY or PBR_LOD_FILE_... */
    uint32_t threads; /* 0: one a processor */
    uint32_t memory;  /* megabytes to build in, out of core; 0: everything is held */
    bool fields;      /* a sequential point tree's */
    double radius;    /* of every point, out of core; 0: its own, or estimated */
    bool as_json;
};

/* What came of it. */
struct outcome {
    uint64_t points, file_bytes;
    uint64_t triangles; /* of a hierarchy over a mesh, whose vertices the points are; else 0 */
    double load_ms, build_ms, save_ms;
    double radius; /* of every point; 0: its own */
};

static bool find_format(const char *name, uint32_t *format) {
    static const struct {
        const char *ending;
        uint32_t format;
    } formats[] = {{".pbr", PBR_LOD_FILE_PBR}, {".qs", PBR_LOD_FILE_QS}, {".ply", FORMAT_PLY}};
    for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++) {
        if (!has_ending(name, formats[i].ending)) continue;
        *format = formats[i].format;
        return true;
    }
    return false;
}

static pbr_result write_output(const struct convert *convert, const struct input *input) {
    struct session *session = convert->session;
    if (convert->format != FORMAT_PLY) return pbr_lod_save(input->lod, convert->output, convert->format, session_progress, session);
    pbr_write_desc desc = PBR_WRITE_DESC_INIT;
    desc.progress = session_progress;
    desc.progress_user = session;
    return pbr_write_file(session->instance, convert->output, input->points, NULL, &desc);
}

/* False with a message. */
static bool measure_output(const struct convert *convert, struct outcome *outcome) {
    struct stat status;
    if (stat(convert->output, &status) != 0) {
        session_fail(convert->session, "%s: %s", convert->output, strerror(errno));
        return false;
    }
    outcome->file_bytes = (uint64_t)status.st_size;
    return true;
}

static bool save(const struct convert *convert, const struct input *input, struct outcome *outcome) {
    struct session *session = convert->session;
    const unsigned errors = atomic_load(&session->errors);
    const double start = session_seconds();
    const pbr_result result = write_output(convert, input);
    outcome->save_ms = 1e3 * (session_seconds() - start);
    session_progress_end(session);
    return session_check(session, result, errors, convert->output) && measure_output(convert, outcome);
}

static void print_json(const struct convert *convert, const struct outcome *outcome) {
    struct json json = {.file = stdout};
    json_open_object(&json, NULL);
    json_integer(&json, "points", outcome->points);
    if (outcome->triangles > 0) json_integer(&json, "triangles", outcome->triangles);
    json_integer(&json, "file_bytes", outcome->file_bytes);
    if (outcome->triangles > 0) json_number(&json, "bytes_per_triangle", (double)outcome->file_bytes / (double)outcome->triangles);
    else json_number(&json, "bytes_per_point", (double)outcome->file_bytes / (double)outcome->points);
    json_number(&json, "load_ms", outcome->load_ms);
    json_number(&json, "build_ms", outcome->build_ms);
    json_number(&json, "save_ms", outcome->save_ms);
    if (convert->memory > 0) json_number(&json, "radius", outcome->radius);
    json_integer(&json, "peak_rss_bytes", session_peak_memory());
    json_close_object(&json);
}

static void print_text(const char *name, const struct outcome *outcome) {
    const char *what = outcome->triangles > 0 ? "triangle" : "point";
    const uint64_t count = outcome->triangles > 0 ? outcome->triangles : outcome->points;
    session_print_name(name);
    printf(": %" PRIu64 " %ss, ", count, what);
    if (outcome->triangles > 0) printf("%" PRIu64 " vertices, ", outcome->points);
    printf("%" PRIu64 " bytes", outcome->file_bytes);
    if (count > 0) printf(", %.2f bytes a %s", (double)outcome->file_bytes / (double)count, what);
    if (outcome->build_ms > 0)
        printf("; built in %.2f s, %.0f %ss a second", 1e-3 * outcome->build_ms, 1e3 * (double)count / outcome->build_ms, what);
    if (outcome->radius > 0) printf("; every radius %g", outcome->radius);
    printf("\n");
}

/* Whether there are fields where they were asked for. False with a message. */
static bool check_fields(const struct convert *convert, const struct input *input) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    if (!convert->fields || (pbr_lod_get_info(input->lod, &info) == PBR_OK && info.has_normal_fields)) return true;
    session_fail(convert->session, "%s: has no normals, or is a hierarchy without normal fields", convert->source);
    return false;
}

/* Holding everything. False with a message. */
static bool convert_whole(const struct convert *convert, struct outcome *outcome) {
    struct session *session = convert->session;
    struct input input;
    const unsigned kind = convert->lod << INPUT_KIND_SHIFT, fields = convert->fields ? INPUT_FIELDS : 0;
    const unsigned wanted = convert->format == FORMAT_PLY ? INPUT_LEAVES : INPUT_BUILD | kind | fields;
    const bool loaded = input_load(session, convert->source, wanted, session_progress, session, &input);
    outcome->points = input.info.count;
    if (convert->format != FORMAT_PLY && input.lod_kind == PBR_LOD_POP) outcome->triangles = input.mesh.triangle_count;
    outcome->load_ms = input.load_ms;
    outcome->build_ms = input.build_ms;
    const bool done = loaded && check_fields(convert, &input) && save(convert, &input, outcome);
    input_release(&input);
    return done;
}

/* Out of core; what is built is written at once. */
static bool convert_stream(const struct convert *convert, struct outcome *outcome) {
    struct stream stream = {.session = convert->session,
                            .input = convert->source,
                            .output = convert->output,
                            .memory = convert->memory,
                            .radius = convert->radius};
    if (!stream_build(&stream)) return false;
    outcome->points = stream.points;
    outcome->load_ms = stream.load_ms;
    outcome->build_ms = stream.build_ms;
    outcome->radius = stream.radius;
    return measure_output(convert, outcome);
}

static int run(const struct convert *convert) {
    struct outcome outcome = {0};
    if (!session_set_threads(convert->session, convert->threads)) return STATUS_FAILED;
    if (!(convert->memory > 0 ? convert_stream : convert_whole)(convert, &outcome)) return STATUS_FAILED;
    if (convert->as_json) print_json(convert, &outcome);
    else print_text(convert->output, &outcome);
    return STATUS_OK;
}

static const char *parse_radius(const char *text, double *radius) {
    return parse_number_within(text, FLT_MIN, FLT_MAX, radius) ? NULL : "a positive number";
}

static const char *parse_lod(const char *text, uint32_t *lod) {
    return kind_parse(lod_kinds, text, lod) && *lod != LOD_NONE && *lod != LOD_AUTO ? NULL : "qsplat, spt or pop";
}

static int run_convert(struct session *session, int argc, char **argv) {
    enum { LOD, FIELDS, THREADS, MEMORY, RADIUS, JSON };
    static const struct option_rule rules[] = {[LOD] = {"--lod", true},
                                               [FIELDS] = {"--normal-fields", false},
                                               [THREADS] = {"--threads", true},
                                               [MEMORY] = {"--memory", true},
                                               [RADIUS] = {"--radius", true},
                                               [JSON] = {"--json", false},
                                               {NULL, false}};
    struct option_scan scan = {.argc = argc, .argv = argv};
    struct convert convert = {.session = session};
    int option;

    while ((option = option_next(&scan, rules)) != OPTION_END) {
        const char *expected = NULL;
        switch (option) {
        case LOD: expected = parse_lod(scan.value, &convert.lod); break;
        case FIELDS: convert.fields = true; break;
        case THREADS: expected = parse_count(scan.value, 1, 4096, &convert.threads) ? NULL : "a number from 1 to 4096"; break;
        case MEMORY: expected = parse_memory(scan.value, &convert.memory); break;
        case RADIUS: expected = parse_radius(scan.value, &convert.radius); break;
        case JSON: convert.as_json = true; break;
        case OPTION_OPERAND:
            if (convert.output) return session_usage(session, "convert", "more than two files given");
            if (convert.source) convert.output = scan.value;
            else convert.source = scan.value;
            break;
        default: return session_usage(session, "convert", scan.error);
        }
        if (expected) return session_bad_value(session, "convert", rules[option].name, scan.value, expected);
    }
    if (!convert.output) return session_usage(session, "convert", "IN and OUT are needed");
    if (!find_format(convert.output, &convert.format))
        return session_bad_value(session, "convert", "OUT", convert.output, "a name ending in .pbr, .qs or .ply");
    if (convert.memory > 0 && convert.format != PBR_LOD_FILE_PBR)
        return session_usage(session, "convert", "--memory writes .pbr only");
    if (convert.memory > 0 && convert.lod > PBR_LOD_QSPLAT)
        return session_usage(session, "convert", "--memory builds hierarchies of kind qsplat only");
    if (convert.fields && (convert.lod != PBR_LOD_SPT || convert.format != PBR_LOD_FILE_PBR))
        return session_usage(session, "convert", "--normal-fields needs --lod spt, and OUT.pbr");
    if (convert.radius > 0 && convert.memory == 0) return session_usage(session, "convert", "--radius needs --memory");
    return run(&convert);
}

const struct command convert_command = {
    "convert", run_convert,
    "usage: pbr convert IN OUT.pbr|OUT.qs|OUT.ply [options]\n"
    "\n"
    "Builds a hierarchy of points, or of a mesh's vertices, and writes it: .pbr is libpbr's own container, .qs the QSplat "
    "programs'\n"
    "version 11. A hierarchy is written again in the other form; into .ply go its finest points, or those of another file. OUT\n"
    "appears when it is complete; until then an old one stays.\n"
    "\n"
    "  --lod KIND            of hierarchy: qsplat, a tree of bounding spheres; spt, a sequential point tree; or pop, of a\n"
    "                        mesh, with its triangles; the latter two in .pbr only; qsplat\n"
    "  --normal-fields       of spt: with a field of normals for each node, for --shade phong-field; from points, not from a\n"
    "                        hierarchy\n"
    "  --memory MB           build a .pbr out of core, in this much memory, 32 at least. IN is LAS or binary PLY; faces are left\n"
    "                        out, and nothing is asked of a point's neighbours: where IN has no radii, all points get the same\n"
    "                        one, estimated from their number and how much space they fill; where it has no normals, there\n"
    "                        are none\n"
    "  --radius R            with --memory: of every point, in IN's units, instead of its own or an estimate\n"
    "  --threads N           how many to use, 1 to 4096; one a processor\n"
    "  --json                print an object\n"};
