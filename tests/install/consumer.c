/* What a user of the installed libraries does first, in C and in C++: it is compiled as both. SPDX-License-Identifier: MIT */
#include <pbr/image.h>
#include <pbr/io.h>
#include <pbr/pbr.h>
#include <stdio.h>

static void print_message(void *user, int32_t level, pbr_result code, const char *text) {
    (void)user;
    fprintf(stderr, "%d %s: %s\n", (int)level, pbr_result_name(code), text);
}

int main(void) {
    static const char ply[] = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
                              "0 0 0\n3 4 0\n";
    int failed = 1;
    pbr_instance *instance = NULL;
    pbr_points_info info = PBR_POINTS_INFO_INIT;
    pbr_file_content content = PBR_FILE_CONTENT_INIT;
    pbr_image image = PBR_IMAGE_INIT;
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    desc.log = print_message;

    if (pbr_version() != PBR_VERSION_NUMBER) return 1;
    if (pbr_instance_create(&desc, &instance)) return 1;
    if (pbr_read_memory(instance, "two points", ply, sizeof ply - 1, NULL, &content)) goto cleanup;
    if (pbr_points_get_info(content.points, &info) || info.count != 2 || info.bounding_radius != 2.5) goto cleanup;
    if (pbr_image_create(instance, 4, 4, 0, &image)) goto cleanup;
    failed = 0;
cleanup:
    pbr_image_destroy(instance, &image);
    pbr_points_release(&content.points);
    if (pbr_instance_destroy(&instance)) failed = 1;
    if (!failed) printf("consumer: ok\n");
    return failed;
}
