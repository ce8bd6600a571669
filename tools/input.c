/* Reading files with libpbr-io. SPDX-License-Identifier: MIT */
#include "input.h"

#include <string.h>

/* Points that can be drawn: the file's, or one for each vertex of its mesh. */
static pbr_result make_points(pbr_file_content *content, pbr_progress_fn progress, void *user, struct input *input) {
    if (!content->mesh) {
        pbr_points_info info = PBR_POINTS_INFO_INIT;
        input->points = pbr_points_retain(content->points);
        pbr_points_get_info(input->points, &info);
        input->radii = content->radii_estimated ? "estimated" : info.has_radii ? "given" : "none";
        return PBR_OK;
    }
    pbr_mesh_to_points_desc desc = PBR_MESH_TO_POINTS_DESC_INIT;
    desc.progress = progress;
    desc.progress_user = user;
    input->radii = "from faces";
    pbr_result result = pbr_mesh_get_info(content->mesh, &input->mesh);
    return result == PBR_OK ? pbr_mesh_to_points(content->mesh, &desc, &input->points) : result;
}

bool input_load(struct session *session, const char *path, bool keep_surface, pbr_progress_fn progress, void *user,
                struct input *input) {
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    unsigned errors = atomic_load(&session->errors);
    double start = session_seconds();
    *input = (struct input){.path = path, .mesh = PBR_MESH_INFO_INIT, .info = PBR_POINTS_INFO_INIT};
    desc.progress = progress;
    desc.progress_user = user;
    pbr_result result = pbr_read_file(session->instance, path, &desc, &content);
    if (result == PBR_OK) {
        input->vertex_count = content.vertex_count;
        input->face_count = content.face_count;
        input->format = content.format;
        input->warning_count = content.warning_count;
        input->is_mesh = content.mesh != NULL;
        memcpy(input->encoding, content.encoding, sizeof input->encoding);
        result = make_points(&content, progress, user, input);
    }
    if (result == PBR_OK) result = pbr_points_get_info(input->points, &input->info);
    if (result == PBR_OK && keep_surface) input->surface = pbr_mesh_retain(content.mesh);
    pbr_points_release(&content.points);
    pbr_mesh_release(&content.mesh);
    input->load_ms = 1e3 * (session_seconds() - start);
    session_progress_end(session);
    return result != PBR_ERROR_CANCELLED && session_check(session, result, errors, path);
}

void input_release(struct input *input) {
    pbr_points_release(&input->points);
    pbr_mesh_release(&input->surface);
}
