/* Any bytes as a picture of the codec that FUZZ_PICTURE reads, picture_read_png for instance. SPDX-License-Identifier: MIT */
#include "fuzz.h"

#include "io/picture.h"

/* Both planes have as many numbers as the size says: the sanitizer sees one too few. Not their sum's value, but that it is taken.
 */
static float add_up(const pbr_image *image) {
    float sum = 0;
    size_t pixels = (size_t)image->width * image->height;
    for (size_t i = 0; i < 4 * pixels; i++) sum += image->rgba[i];
    for (size_t i = 0; i < pixels && image->depth; i++) sum += image->depth[i];
    return sum;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct host host;
    /* Compression lets small files hold large pictures: where the pixels pass this, reading must fail in order. */
    pbr_instance *instance = host_start(&host, (size_t)256 << 20);
    pbr_image image = PBR_IMAGE_INIT;
    struct source source = {.instance = instance, .data = data, .size = size};
    pbr_result result = FUZZ_PICTURE(instance, "input", &source, &image);
    expect(result == PBR_OK || host.errors > 0, "an error is explained");
    if (result == PBR_OK) {
        expect(image.rgba && image.width && image.height, "a picture has pixels");
        volatile float sum = add_up(&image);
        (void)sum;
    }
    pbr_image_destroy(instance, &image);
    host_stop(&host, instance);
    return 0;
}
