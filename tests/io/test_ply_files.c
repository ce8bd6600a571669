/* PLY files of many writers, and broken ones, against counts taken from their headers by hand. SPDX-License-Identifier: MIT */
#include "support.h"

#include <pbr/io.h>
#include <unistd.h>

struct expected {
    const char *path;
    pbr_result result;
    uint64_t vertices, faces, triangles; /* triangles 0: points */
    uint64_t dropped;                    /* points with a non-finite coordinate */
    uint32_t warnings;
    bool normals, colours; /* of points */
    uint32_t scalars;
};

/* Hostile files, each with its deliberate outcome: no vertices is an empty set with a warning; no vertex element is an error; a
 * vertex without x, y, z is not supported; more rows than declared are trailing bytes and a warning; infinite coordinates drop
 * their points. */
static const struct expected FILES[] = {
    {"meshes/bun_zipper.ply", PBR_OK, 35947, 69451, 69451, 0, 0, 0, 0, 0},
    {"meshes/bunny_colour.ply", PBR_OK, 35947, 69451, 69451, 0, 0, 0, 0, 0},
    {"meshes/bunny_tristrips.ply", PBR_OK, 34834, 69451, 69451, 0, 0, 0, 0, 0},
    {"meshes/dragon_vrip.ply", PBR_OK, 437645, 871414, 871414, 0, 0, 0, 0, 0},
    {"meshes/dragon_vrip_res3.ply", PBR_OK, 22998, 47794, 47794, 0, 0, 0, 0, 0},
    {"meshes/horse.ply", PBR_OK, 48485, 96966, 96966, 0, 0, 0, 0, 0},
    {"points/cgal_b9_training.ply", PBR_OK, 22300, 0, 0, 0, 0, 0, 1, 1},
    {"points/cgal_building.ply", PBR_OK, 100000, 0, 0, 0, 0, 1, 0, 1},
    {"gaussians/pc_short.ply", PBR_OK, 100, 0, 0, 0, 2, 1, 0, 32},
    {"gaussians/test-splat.3-points-from-train.ply", PBR_OK, 3, 0, 0, 0, 1, 1, 0, 32},
    {"gaussians/train-1000.ply", PBR_OK, 1000, 0, 0, 0, 1, 1, 0, 32},
    {"gaussians/playcanvas_guitar.compressed.ply", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/Box.ply", PBR_OK, 24, 8, 12, 0, 0, 0, 0, 0},
    {"formats/ply/Wuson.ply", PBR_OK, 11184, 3732, 3732, 0, 1, 0, 0, 0},
    {"formats/ply/cube.ply", PBR_OK, 8, 6, 12, 0, 0, 0, 0, 0},
    {"formats/ply/cube_att.ply", PBR_OK, 24, 12, 12, 0, 0, 0, 0, 0},
    {"formats/ply/cube_binary.ply", PBR_OK, 8, 12, 12, 0, 0, 0, 0, 0},
    {"formats/ply/cube_binary_header_with_RN_newline.ply", PBR_OK, 8, 12, 12, 0, 0, 0, 0, 0},
    {"formats/ply/cube_binary_starts_with_nl.ply", PBR_OK, 8, 6, 12, 0, 0, 0, 0, 0},
    {"formats/ply/cube_quads.ply", PBR_OK, 8, 6, 12, 0, 0, 0, 0, 0},
    {"formats/ply/cube_uv.ply", PBR_OK, 24, 6, 12, 0, 0, 0, 0, 0},
    {"formats/ply/delim_test.ply", PBR_OK, 24, 8, 12, 0, 0, 0, 0, 0},
    {"formats/ply/float-color.ply", PBR_OK, 3, 1, 1, 0, 0, 0, 0, 0},
    {"formats/ply/float_inf_point_cloud.ply", PBR_OK, 16, 0, 0, 3, 0, 0, 0, 0},
    {"formats/ply/int_point_cloud.ply", PBR_OK, 16, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_mesh.ply", PBR_OK, 4, 2, 2, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_mesh_fixed.ply", PBR_OK, 4, 2, 2, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_simple_binary.ply", PBR_OK, 3, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_simple_text.ply", PBR_OK, 3, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_sized_dims.ply", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_unsized_dims.ply", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/pdal_text_extradim.ply", PBR_OK, 1, 0, 0, 0, 0, 1, 1, 1},
    {"formats/ply/point_cloud_test_pos.ply", PBR_OK, 4, 0, 0, 0, 0, 0, 0, 0},
    {"formats/ply/point_cloud_test_pos_norm.ply", PBR_OK, 4, 0, 0, 0, 0, 1, 0, 0},
    {"formats/ply/points.ply", PBR_OK, 4, 0, 0, 0, 0, 1, 1, 0},
    {"formats/ply/pond.0.ply", PBR_OK, 70051, 0, 0, 0, 0, 1, 1, 1},
    {"formats/ply/test_extra_whitespace.ply", PBR_OK, 3, 1, 1, 0, 0, 0, 0, 0},
    {"formats/ply/test_generic.ply", PBR_OK, 114, 224, 224, 0, 0, 0, 0, 0},
    {"formats/ply/test_more_datatypes.ply", PBR_OK, 3, 1, 1, 0, 0, 0, 0, 0},
    {"formats/ply/test_pos_color.ply", PBR_OK, 114, 224, 224, 0, 0, 0, 0, 0},
    {"formats/ply/test_pos_color_ascii.ply", PBR_OK, 114, 224, 224, 0, 0, 0, 0, 0},
    {"hostile/delim_test.ply", PBR_OK, 24, 8, 12, 0, 0, 0, 0, 0},
    {"hostile/empty.ply", PBR_OK, 0, 0, 0, 0, 1, 0, 0, 0},
    {"hostile/float_inf_point_cloud.ply", PBR_OK, 16, 0, 0, 3, 0, 0, 0, 0},
    {"hostile/issue_2421.ply", PBR_OK, 1, 0, 0, 0, 0, 0, 0, 1},
    {"hostile/no_vertex.ply", PBR_ERROR_FORMAT, 0, 0, 0, 0, 0, 0, 0, 0},
    {"hostile/ply_empty_ascii.ply", PBR_OK, 0, 0, 0, 0, 1, 0, 0, 0},
    {"hostile/ply_empty_bin.ply", PBR_OK, 0, 0, 0, 0, 1, 0, 0, 0},
    {"hostile/ply_empty_header.ply", PBR_ERROR_FORMAT, 0, 0, 0, 0, 0, 0, 0, 0},
    {"hostile/points_ascii_with_lists.ply", PBR_OK, 5, 0, 0, 0, 0, 0, 0, 0},
    {"hostile/points_emptyascii.ply", PBR_OK, 12, 0, 0, 0, 1, 0, 0, 0},
    {"hostile/points_emptyface.ply", PBR_OK, 1024, 0, 0, 0, 0, 0, 0, 0},
    {"hostile/rply_input.ply", PBR_OK, 3, 1, 1, 0, 1, 0, 0, 0},
    {"hostile/test_extra_whitespace.ply", PBR_OK, 3, 1, 1, 0, 0, 0, 0, 0},
    {"hostile/test_more_datatypes.ply", PBR_OK, 3, 1, 1, 0, 0, 0, 0, 0},
    {"hostile/empty.obj", PBR_ERROR_UNSUPPORTED, 0, 0, 0, 0, 0, 0, 0, 0},
};

static bool has_data(void) {
    if (access(test_data(), R_OK) == 0) return true;
    print_message("skipped: no test data at %s (PBR_TEST_DATA)\n", test_data());
    return false;
}

static void check_points(const struct expected *file, const pbr_points *points) {
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    assert_int_equal(pbr_points_get_info(points, &info), PBR_OK);
    assert_int_equal(info.count, file->vertices - file->dropped);
    assert_int_equal(info.dropped_count, file->dropped);
    assert_int_equal(info.has_normals, file->normals);
    assert_int_equal(info.has_colours, file->colours);
    assert_int_equal(info.has_radii, 0);
    assert_int_equal(info.scalar_count, file->scalars);
}

static void check_file(const struct expected *file, uint32_t flags) {
    struct host host;
    char path[4096];
    pbr_instance *instance = host_instance(&host);
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_read_desc desc = PBR_READ_DESC_INIT;
    desc.flags = flags;
    snprintf(path, sizeof path, "%s/%s", test_data(), file->path);
    pbr_result result = pbr_read_file(instance, path, &desc, &content);
    if (result != file->result) fail_msg("%s: %s (%s)", file->path, pbr_result_name(result), host.error);
    if (content.vertex_count != file->vertices || content.face_count != file->faces || content.warning_count != file->warnings)
        fail_msg("%s: %llu vertices, %llu faces, %u warnings", file->path, (unsigned long long)content.vertex_count,
                 (unsigned long long)content.face_count, (unsigned)content.warning_count);
    assert_int_equal(host.errors, result == PBR_OK ? 0 : 1);
    assert_int_equal(content.points != NULL, result == PBR_OK && file->triangles == 0);
    assert_int_equal(content.mesh != NULL, file->triangles != 0);
    if (content.points) check_points(file, content.points);
    if (content.mesh) {
        pbr_mesh_info info = PBR_MESH_INFO_INIT;
        assert_int_equal(pbr_mesh_get_info(content.mesh, &info), PBR_OK);
        assert_int_equal(info.vertex_count, file->vertices);
        assert_int_equal(info.triangle_count, file->triangles);
    }
    pbr_points_release(&content.points);
    pbr_mesh_release(&content.mesh);
    host_finish(&host, instance);
}

static void every_file_gives_what_its_header_says_or_its_error(void **state) {
    (void)state;
    if (!has_data()) skip();
    for (size_t i = 0; i < sizeof FILES / sizeof *FILES; i++) check_file(&FILES[i], PBR_READ_KEEP_RADII);
}

static void streams_read_as_mappings_do(void **state) {
    (void)state;
    if (!has_data()) skip();
    for (size_t i = 0; i < sizeof FILES / sizeof *FILES; i++) check_file(&FILES[i], PBR_READ_STREAM | PBR_READ_KEEP_RADII);
}

static void missing_files_and_folders_are_io_errors(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    assert_int_equal(pbr_read_file(instance, "no such file.ply", NULL, &content), PBR_ERROR_IO);
    assert_non_null(strstr(host.error, "no such file.ply"));
    assert_int_equal(pbr_read_file(instance, "/", NULL, &content), PBR_ERROR_IO);
    assert_int_equal(pbr_read_file(instance, "/dev/zero", NULL, &content), PBR_ERROR_IO);
    host_finish(&host, instance);
}

static void points_come_with_radii_unless_told_otherwise(void **state) {
    (void)state;
    if (!has_data()) skip();
    static const char *const PATHS[] = {"meshes/dragon_vrip_res3.ply", "hostile/points_emptyface.ply"};
    for (size_t i = 0; i < 2; i++)
        for (int keep = 0; keep < 2; keep++) {
            struct host host;
            char path[4096];
            pbr_instance *instance = host_instance(&host);
            pbr_points *points = NULL;
            pbr_points_info info = PBR_POINTS_INFO_INIT;
            pbr_read_desc desc = PBR_READ_DESC_INIT;
            if (keep) desc.flags = PBR_READ_KEEP_RADII;
            snprintf(path, sizeof path, "%s/%s", test_data(), PATHS[i]);
            assert_int_equal(pbr_read_points(instance, path, &desc, &points), PBR_OK);
            assert_int_equal(pbr_points_get_info(points, &info), PBR_OK);
            assert_int_equal(info.has_radii, i == 0 || !keep); /* a mesh's radii come from its faces */
            pbr_points_release(&points);
            host_finish(&host, instance);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_file_gives_what_its_header_says_or_its_error),
        cmocka_unit_test(streams_read_as_mappings_do),
        cmocka_unit_test(missing_files_and_folders_are_io_errors),
        cmocka_unit_test(points_come_with_radii_unless_told_otherwise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
