/* A caller's sized structure, taken over. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_SIZED_H
#define PBR_IO_SIZED_H

#include <pbr/support.h>
#include <string.h>

/* Copies a structure whose first member is its size into `out`, of this version's `size` bytes and set to its defaults, which a
 * NULL `in` leaves. The first version's structures are this version's; a longer one may only add zeros. */
static inline pbr_result take_sized(pbr_instance *instance, const char *name, const void *in, void *out, size_t size) {
    size_t given;
    if (!in) return PBR_OK;
    memcpy(&given, in, sizeof given);
    if (given < size || given > 65536)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: wrong struct_size", name);
    for (size_t i = size; i < given; i++)
        if (((const unsigned char *)in)[i] != 0)
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                           "%s: a member is set that this version does not know", name);
    memcpy(out, in, size);
    return PBR_OK;
}

/* Writes a structure of `size` bytes into a caller's, as far as that one reaches, and zeros where it reaches further. */
static inline pbr_result give_sized(pbr_instance *instance, const char *name, const void *from, size_t size, void *out) {
    size_t given;
    memcpy(&given, out, sizeof given);
    if (given < size || given > 65536)
        return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT, "%s: wrong struct_size", name);
    memcpy((char *)out + sizeof given, (const char *)from + sizeof given, size - sizeof given);
    memset((char *)out + size, 0, given - size);
    return PBR_OK;
}

#endif
