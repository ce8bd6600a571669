/* Any bytes as a picture. SPDX-License-Identifier: MIT */
#include "fuzz.h"

#include <pbr/image.h>
#include <sys/mman.h>
#include <unistd.h>

/* A file of these bytes without a name in any folder. */
static int make_file(const uint8_t *data, size_t size) {
    int file = memfd_create("picture", MFD_CLOEXEC);
    size_t done = 0;
    while (file >= 0 && done < size) {
        ssize_t written = write(file, data + done, size - done);
        expect(written > 0, "the picture fits into memory");
        done += (size_t)written;
    }
    expect(file >= 0, "a file can be made");
    return file;
}

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
    char path[64];
    /* Compression lets small files hold large pictures: where the pixels pass this, reading must fail in order. */
    pbr_instance *instance = host_start(&host, (size_t)256 << 20);
    pbr_image image = PBR_IMAGE_INIT;
    int file = make_file(data, size);
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    pbr_result result = pbr_image_read(instance, path, &image);
    close(file);
    expect(result == PBR_OK || host.errors > 0, "an error is explained");
    if (result == PBR_OK) {
        expect(image.rgba && image.width && image.height, "a picture has pixels");
        volatile float sum = add_up(&image);
        (void)sum;
    } else {
        expect(!image.rgba && !image.depth && !image.width && !image.height, "an error leaves nothing");
    }
    pbr_image_destroy(instance, &image);
    host_stop(&host, instance);
    return 0;
}
