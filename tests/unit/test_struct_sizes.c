/* Every sized structure of the CPU side is taken in every size that docs/abi.md promises, and in no other.
 * SPDX-License-Identifier: MIT */
#include "../struct_sizes.h"
#include "support.h"

struct objects {
    struct host host;
    pbr_instance *instance;
    pbr_points *points;
    pbr_mesh *mesh;
};

static const float corners[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
static const uint16_t triangle[3] = {0, 1, 2};

static const pbr_points_desc points_desc = {
    .struct_size = sizeof points_desc, .count = 3, .positions = {corners, 0, PBR_FORMAT_FLOAT32, 3}, .radius = 1};
static const pbr_mesh_desc mesh_desc = {.struct_size = sizeof mesh_desc,
                                        .vertex_count = 3,
                                        .positions = {corners, 0, PBR_FORMAT_FLOAT32, 3},
                                        .indices = triangle,
                                        .index_format = PBR_FORMAT_UINT16,
                                        .triangle_count = 1};

static pbr_result use_instance(void *user, void *desc) {
    pbr_instance *instance = NULL;
    pbr_result result = pbr_instance_create(desc, &instance);
    (void)user;
    assert_int_equal(instance != NULL, result == PBR_OK);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    return result;
}

static pbr_result use_points(void *user, void *desc) {
    struct objects *objects = user;
    pbr_points *points = NULL;
    pbr_result result = pbr_points_create(objects->instance, desc, &points);
    assert_int_equal(points != NULL, result == PBR_OK);
    pbr_points_release(&points);
    return result;
}

static pbr_result use_points_copy(void *user, void *desc) {
    struct objects *objects = user;
    return pbr_points_copy(objects->points, 0, 3, desc);
}

static pbr_result use_points_info(void *user, void *info) {
    struct objects *objects = user;
    return pbr_points_get_info(objects->points, info);
}

static pbr_result use_mesh(void *user, void *desc) {
    struct objects *objects = user;
    pbr_mesh *mesh = NULL;
    pbr_result result = pbr_mesh_create(objects->instance, desc, &mesh);
    assert_int_equal(mesh != NULL, result == PBR_OK);
    pbr_mesh_release(&mesh);
    return result;
}

static pbr_result use_mesh_to_points(void *user, void *desc) {
    struct objects *objects = user;
    pbr_points *points = NULL;
    pbr_result result = pbr_mesh_to_points(objects->mesh, desc, &points);
    assert_int_equal(points != NULL, result == PBR_OK);
    pbr_points_release(&points);
    return result;
}

static pbr_result use_mesh_copy(void *user, void *desc) {
    struct objects *objects = user;
    return pbr_mesh_copy(objects->mesh, desc);
}

static pbr_result use_mesh_info(void *user, void *info) {
    struct objects *objects = user;
    return pbr_mesh_get_info(objects->mesh, info);
}

static const struct sized inputs[] = {
    SIZED(pbr_instance_desc, thread_count, NULL, use_instance),
    SIZED(pbr_points_desc, progress_user, &points_desc, use_points),
    SIZED(pbr_points_copy_desc, reserved, NULL, use_points_copy),
    SIZED(pbr_mesh_desc, reserved, &mesh_desc, use_mesh),
    SIZED(pbr_mesh_copy_desc, triangles, NULL, use_mesh_copy),
    SIZED(pbr_mesh_to_points_desc, progress_user, NULL, use_mesh_to_points),
};

static const struct sized outputs[] = {
    SIZED(pbr_points_info, memory_bytes, NULL, use_points_info),
    SIZED(pbr_mesh_info, memory_bytes, NULL, use_mesh_info),
};

static void start(struct objects *objects) {
    objects->instance = host_start(&objects->host, 1);
    assert_int_equal(pbr_points_create(objects->instance, &points_desc, &objects->points), PBR_OK);
    assert_int_equal(pbr_mesh_create(objects->instance, &mesh_desc, &objects->mesh), PBR_OK);
}

static void stop(struct objects *objects) {
    pbr_points_release(&objects->points);
    pbr_mesh_release(&objects->mesh);
    host_stop(&objects->host, objects->instance);
}

static void inputs_of_every_promised_size_are_taken_and_no_other(void **state) {
    struct objects objects = {.instance = NULL};
    (void)state;
    start(&objects);
    for (size_t i = 0; i < COUNT(inputs); i++) check_input_sizes(&inputs[i], &objects);
    stop(&objects);
}

static void outputs_are_written_as_far_as_they_reach(void **state) {
    struct objects objects = {.instance = NULL};
    (void)state;
    start(&objects);
    for (size_t i = 0; i < COUNT(outputs); i++) check_output_sizes(&outputs[i], &objects);
    stop(&objects);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inputs_of_every_promised_size_are_taken_and_no_other),
        cmocka_unit_test(outputs_are_written_as_far_as_they_reach),
    };
    return cmocka_run_group_tests_name("struct_sizes", tests, NULL, NULL);
}
