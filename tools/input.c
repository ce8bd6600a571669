/* Reading files with libpbr-io, and hierarchies. SPDX-License-Identifier: MIT */
#include "input.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "kinds.h"

/* One load: what its steps share. */
struct load {
    struct session *session;
    unsigned wanted;
    pbr_progress_fn progress;
    void *user;
    struct input *input;
};

static uint32_t wanted_kind(const struct load *load) {
    return load->wanted >> INPUT_KIND_SHIFT;
}

/* The first bytes decide, as they do in pbr_lod_open. A pipe's would be lost to its reader: those are files of points. */
bool input_is_hierarchy(const char *path) {
    static const char qsplat[] = "QSplat", pbr[] = "\x89PBR\r\n\x1a\n";
    char start[sizeof pbr - 1] = "";
    struct stat status;
    if (stat(path, &status) != 0 || !S_ISREG(status.st_mode)) return false;
    FILE *file = fopen(path, "rb");
    const size_t count = file ? fread(start, 1, sizeof start, file) : 0;
    if (file) fclose(file);
    return count == sizeof start && (!memcmp(start, qsplat, sizeof qsplat - 1) || !memcmp(start, pbr, sizeof start));
}

/* Points that can be drawn: the file's, or one for each vertex of its mesh. */
static pbr_result make_points(struct load *load, pbr_file_content *content) {
    struct input *input = load->input;
    if (!content->mesh) {
        pbr_points_info info = PBR_POINTS_INFO_INIT;
        input->points = pbr_points_retain(content->points);
        pbr_points_get_info(input->points, &info);
        input->radii = content->radii_estimated ? "estimated" : info.has_radii ? "given" : "none";
        return PBR_OK;
    }
    pbr_mesh_to_points_desc desc = PBR_MESH_TO_POINTS_DESC_INIT;
    desc.progress = load->progress;
    desc.progress_user = load->user;
    input->radii = "from faces";
    pbr_result result = pbr_mesh_get_info(content->mesh, &input->mesh);
    return result == PBR_OK ? pbr_mesh_to_points(content->mesh, &desc, &input->points) : result;
}

static pbr_result read_points(struct load *load) {
    struct input *input = load->input;
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    desc.progress = load->progress;
    desc.progress_user = load->user;
    pbr_result result = pbr_read_file(load->session->instance, input->path, &desc, &content);
    if (result == PBR_OK) {
        input->vertex_count = content.vertex_count;
        input->face_count = content.face_count;
        input->format = content.format;
        input->warning_count = content.warning_count;
        input->is_mesh = content.mesh != NULL;
        memcpy(input->encoding, content.encoding, sizeof input->encoding);
        result = make_points(load, &content);
    }
    if (result == PBR_OK) result = pbr_points_get_info(input->points, &input->info);
    const bool needs_mesh = load->wanted & INPUT_SURFACE || (load->wanted & INPUT_BUILD && wanted_kind(load) == PBR_LOD_POP);
    if (result == PBR_OK && needs_mesh) input->surface = pbr_mesh_retain(content.mesh);
    pbr_points_release(&content.points);
    pbr_mesh_release(&content.mesh);
    return result;
}

static pbr_result open_hierarchy(struct load *load) {
    struct input *input = load->input;
    pbr_lod_info lod = PBR_LOD_INFO_INIT;
    pbr_result result = pbr_lod_open(load->session->instance, input->path, NULL, &input->lod);
    if (result == PBR_OK) result = pbr_lod_get_info(input->lod, &lod);
    if (result != PBR_OK) return result;
    input->lod_kind = lod.kind;
    input->radii = "given";
    input->info.count = lod.kind == PBR_LOD_POP ? lod.vertex_count : lod.point_count;
    input->mesh.triangle_count = lod.triangle_count;
    input->info.has_colours = lod.has_colours;
    input->info.bounding_radius = lod.bounding_radius;
    input->info.radius_maximum = (float)(lod.radius - lod.bounding_radius); /* at most */
    for (int k = 0; k < 3; k++) {
        input->info.centre[k] = lod.centre[k];
        input->info.minimum[k] = lod.centre[k] - lod.bounding_radius;
        input->info.maximum[k] = lod.centre[k] + lod.bounding_radius;
    }
    return PBR_OK;
}

/* The points go: what is drawn is the hierarchy, which has no scalars. */
static pbr_result build(struct load *load) {
    struct input *input = load->input;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    const double start = session_seconds();
    input->lod_kind = desc.kind = wanted_kind(load) ? wanted_kind(load) : PBR_LOD_QSPLAT;
    if (desc.kind == PBR_LOD_POP) desc.mesh = input->surface;
    else desc.points = input->points;
    if (desc.kind == PBR_LOD_SPT && load->wanted & INPUT_FIELDS) desc.flags = PBR_LOD_NORMAL_FIELDS;
    desc.progress = load->progress;
    desc.progress_user = load->user;
    pbr_result result = pbr_lod_create(load->session->instance, &desc, &input->lod);
    pbr_points_release(&input->points);
    if (!(load->wanted & INPUT_SURFACE)) pbr_mesh_release(&input->surface);
    input->info.scalar_count = 0;
    input->build_ms = 1e3 * (session_seconds() - start);
    return result;
}

bool input_load(struct session *session, const char *path, unsigned wanted, pbr_progress_fn progress, void *user,
                struct input *input) {
    struct load load = {session, wanted, progress, user, input};
    const unsigned errors = atomic_load(&session->errors);
    const double start = session_seconds();
    *input = (struct input){.path = path, .mesh = PBR_MESH_INFO_INIT, .info = PBR_POINTS_INFO_INIT};
    pbr_result result = input_is_hierarchy(path) ? open_hierarchy(&load) : read_points(&load);
    input->load_ms = 1e3 * (session_seconds() - start);
    const uint32_t kind = wanted_kind(&load);
    if (result == PBR_OK && input->lod && kind && kind != input->lod_kind) {
        session_fail(session, "%s: is a hierarchy of another kind, %s", path, kind_name(lod_kinds, input->lod_kind));
        return false;
    }
    if (result == PBR_OK && wanted & INPUT_BUILD && kind == PBR_LOD_POP && !input->lod && !input->surface) {
        session_fail(session, "%s: has no triangles, of which hierarchies of kind pop are made", path);
        return false;
    }
    if (result == PBR_OK && wanted & INPUT_BUILD && !input->lod) result = build(&load);
    if (result == PBR_OK && wanted & INPUT_LEAVES && input->lod)
        result = pbr_lod_to_points(input->lod, progress, user, &input->points);
    session_progress_end(session);
    return result != PBR_ERROR_CANCELLED && session_check(session, result, errors, path);
}

struct input input_move(struct input *from) {
    struct input input = *from;
    from->lod = NULL;
    from->points = NULL;
    from->surface = NULL;
    return input;
}

void input_release(struct input *input) {
    pbr_lod_release(&input->lod);
    pbr_points_release(&input->points);
    pbr_mesh_release(&input->surface);
}
