/* Mutates hierarchies' files as libFuzzer does, then puts the checksums and sizes of .pbr right: else nearly every change of a
 * header would end at them, and most changes are in the gap before the section. SPDX-License-Identifier: MIT */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "lod/container.h"

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t most);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned int seed);

/* docs/qsplat.md, ".pbr". */
enum { HEADER = 32, ENTRY = 40 };

/* FNV-1a. */
static uint64_t sum_up(const uint8_t *p, uint64_t size, uint64_t sum) {
    for (uint64_t i = 0; i < size; i++) sum = (sum ^ p[i]) * UINT64_C(0x100000001b3);
    return sum;
}
static const uint64_t SUM_START = UINT64_C(0xcbf29ce484222325);

static bool has_one_section(const uint8_t *data, size_t size) {
    return size >= HEADER + ENTRY && container_recognise(data, size) && load_little(data + 12, 4) == 1;
}

/* Of the first part of the section, if that is there, and of the header. */
static void correct_checksums(uint8_t *data, size_t size) {
    const uint64_t at = load_little(data + HEADER + 8, 8), first = load_little(data + HEADER + 32, 8);
    if (at <= size && first <= size - at) store_little(sum_up(data + at, first, SUM_START), 8, data + HEADER + 24);
    store_little(sum_up(data + HEADER, ENTRY, sum_up(data, HEADER - 8, SUM_START)), 8, data + 24);
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned int seed) {
    if (seed % 4 && size > CONTAINER_DATA && most > CONTAINER_DATA && has_one_section(data, size)) {
        size = CONTAINER_DATA + LLVMFuzzerMutate(data + CONTAINER_DATA, size - CONTAINER_DATA, most - CONTAINER_DATA);
        store_little(size, 8, data + 16);
        store_little(size - CONTAINER_DATA, 8, data + HEADER + 16);
    } else {
        size = LLVMFuzzerMutate(data, size, most);
    }
    if (seed % 16 && has_one_section(data, size)) correct_checksums(data, size); /* wrong ones are tried too */
    return size;
}
