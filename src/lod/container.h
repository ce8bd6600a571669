/* .pbr, the library's own container: named sections of a file that is mapped as it is. Little-endian; docs/qsplat.md has the
 * layout. SPDX-License-Identifier: MIT */
#ifndef PBR_LOD_CONTAINER_H
#define PBR_LOD_CONTAINER_H

#include <stdbool.h>
#include <string.h>

#include "core/instance.h"

struct container_section {
    char type[8];
    uint64_t size;
    const uint8_t *data; /* in the file */
};

bool container_recognise(const uint8_t *data, uint64_t size);

/* Checks the header and finds the first section that is of one of the types, each of 8 bytes, and of which. Errors are logged with
 * the path. */
pbr_result container_find(pbr_instance *instance, const char *path, const uint8_t *data, uint64_t size, const char *const *types,
                          size_t type_count, struct container_section *out, size_t *type);

/* A part of a section that is written. */
struct container_part {
    const void *data;
    uint64_t size;
};

/* Writes a file of one section, made of parts. The first part, 256 bytes at most, is covered by a checksum. */
pbr_result container_write(pbr_instance *instance, const char *path, const char type[8], const struct container_part *parts,
                           size_t count, const struct progress *progress);

/* The same for a section that its maker writes itself, from CONTAINER_DATA on: the file's header. */
struct output;
enum { CONTAINER_DATA = 4096 };
void container_write_header(struct output *output, const char type[8], const struct container_part *first, uint64_t section_size);

/* Whether what lies in files as it is can be used so. */
static inline bool is_little_endian(void) {
    const uint16_t one = 1;
    uint8_t first;
    memcpy(&first, &one, 1);
    return first == 1;
}

/* Numbers in the file. */
static inline void store_little(uint64_t v, int bytes, uint8_t *p) {
    for (int i = 0; i < bytes; i++) p[i] = (uint8_t)(v >> 8 * i);
}
static inline uint64_t load_little(const uint8_t *p, int bytes) {
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--) v = v << 8 | p[i];
    return v;
}

#endif
