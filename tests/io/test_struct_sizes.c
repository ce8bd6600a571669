/* Every sized structure of libpbr-io is taken in every size that docs/abi.md promises, and in no other.
 * SPDX-License-Identifier: MIT */
#include "../struct_sizes.h"
#include "support.h"

#include <pbr/image.h>
#include <pbr/io.h>
#include <unistd.h>

static const char file[] = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                           "end_header\n1 2 3\n";

static pbr_result use_read(void *user, void *desc) {
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_result result = pbr_read_memory(user, "file", file, sizeof file - 1, desc, &content);
    assert_int_equal(content.points != NULL, result == PBR_OK);
    pbr_points_release(&content.points);
    return result;
}

/* To a folder that does not exist: a structure that is taken is followed by that error. */
static pbr_result use_write(void *user, void *desc) {
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    assert_int_equal(pbr_read_memory(user, "file", file, sizeof file - 1, NULL, &content), PBR_OK);
    pbr_result result = pbr_write_file(user, "/nowhere/at/all.ply", content.points, NULL, desc);
    pbr_points_release(&content.points);
    return result == PBR_ERROR_IO ? PBR_OK : result;
}

static pbr_result use_content(void *user, void *structure) {
    pbr_result result = pbr_read_memory(user, "file", file, sizeof file - 1, NULL, structure);
    if (result != PBR_OK) return result;
    pbr_file_content *content = structure;
    pbr_points_release(&content->points); /* an address: another one each time */
    return result;
}

static pbr_result use_source_info(void *user, void *info) {
    return pbr_file_source_get_info(user, info);
}

static pbr_result use_image(void *user, void *image) {
    pbr_result result = pbr_image_create(user, 2, 2, 1, image);
    if (result == PBR_OK) pbr_image_destroy(user, image);
    return result;
}

static void descriptions_of_every_promised_size_are_taken_and_no_other(void **state) {
    static const struct sized read = SIZED(pbr_read_desc, progress_user, NULL, use_read),
                              write = SIZED(pbr_write_desc, progress_user, NULL, use_write);
    struct host host;
    pbr_instance *instance = host_instance(&host);
    (void)state;
    check_input_sizes(&read, instance);
    check_input_sizes(&write, instance);
    host_finish(&host, instance);
}

static void contents_are_written_as_far_as_they_reach(void **state) {
    static const struct sized s = SIZED(pbr_file_content, encoding, NULL, use_content);
    struct host host;
    pbr_instance *instance = host_instance(&host);
    (void)state;
    check_output_sizes(&s, instance);
    host_finish(&host, instance);
}

static void what_is_told_of_sources_is_written_as_far_as_it_reaches(void **state) {
    static const struct sized s = SIZED(pbr_file_source_info, encoding, NULL, use_source_info);
    static const char ply[] = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                              "property float z\nend_header\n0123456789ab";
    char name[] = "/tmp/pbr-source-XXXXXX";
    const int opened = mkstemp(name);
    struct host host;
    pbr_instance *instance = host_instance(&host);
    pbr_file_source *source = NULL;
    (void)state;
    assert_true(opened >= 0 && write(opened, ply, sizeof ply - 1) == (ssize_t)sizeof ply - 1 && close(opened) == 0);
    assert_int_equal(pbr_file_source_open(instance, name, NULL, NULL, &source), PBR_OK);
    check_output_sizes(&s, source);
    pbr_file_source_close(&source);
    remove(name);
    host_finish(&host, instance);
}

static void images_of_every_promised_size_are_taken_and_no_other(void **state) {
    static const struct sized s = SIZED(pbr_image, depth, NULL, use_image);
    struct host host;
    pbr_instance *instance = host_instance(&host);
    (void)state;
    check_input_sizes(&s, instance);
    host_finish(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(descriptions_of_every_promised_size_are_taken_and_no_other),
        cmocka_unit_test(contents_are_written_as_far_as_they_reach),
        cmocka_unit_test(what_is_told_of_sources_is_written_as_far_as_it_reaches),
        cmocka_unit_test(images_of_every_promised_size_are_taken_and_no_other),
    };
    return cmocka_run_group_tests_name("struct_sizes", tests, NULL, NULL);
}
