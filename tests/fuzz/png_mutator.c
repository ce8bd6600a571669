/* Mutates pictures as libFuzzer does, then puts the checksums of PNG chunks right: else nearly every change would end at them.
 * SPDX-License-Identifier: MIT */
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <zlib.h>

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t most);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned int seed);

static uint32_t get32(const uint8_t *p) {
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

static void put32(uint8_t *p, uint32_t value) {
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(value >> (24 - 8 * i));
}

/* A chunk: length of the data, 4 letters, data, CRC-32 over letters and data (PNG specification, 5.3). */
static void correct_checksums(uint8_t *data, size_t size) {
    size_t at = 8;
    if (size < at || memcmp(data, "\x89PNG\r\n\x1a\n", at) != 0) return;
    while (size - at >= 12) {
        size_t length = get32(data + at);
        if (length > size - at - 12) return;
        put32(data + at + 8 + length, (uint32_t)crc32(0, data + at + 4, (uInt)length + 4));
        at += 12 + length;
    }
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned int seed) {
    size = LLVMFuzzerMutate(data, size, most);
    if (seed % 16) correct_checksums(data, size); /* wrong ones are tried too */
    return size;
}
