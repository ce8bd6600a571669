/* The instance: memory, log, and the sized structures of the API. SPDX-License-Identifier: MIT */
#include "instance.h"

#include <sched.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { ALIGNMENT = 16 };

const char *pbr_result_name(pbr_result result) {
    switch (result) {
    case PBR_OK: return "PBR_OK";
    case PBR_ERROR_INVALID_ARGUMENT: return "PBR_ERROR_INVALID_ARGUMENT";
    case PBR_ERROR_OUT_OF_MEMORY: return "PBR_ERROR_OUT_OF_MEMORY";
    case PBR_ERROR_OUT_OF_GPU_MEMORY: return "PBR_ERROR_OUT_OF_GPU_MEMORY";
    case PBR_ERROR_UNSUPPORTED: return "PBR_ERROR_UNSUPPORTED";
    case PBR_ERROR_LIMIT: return "PBR_ERROR_LIMIT";
    case PBR_ERROR_BUSY: return "PBR_ERROR_BUSY";
    case PBR_ERROR_IO: return "PBR_ERROR_IO";
    case PBR_ERROR_FORMAT: return "PBR_ERROR_FORMAT";
    case PBR_ERROR_CANCELLED: return "PBR_ERROR_CANCELLED";
    case PBR_ERROR_GL: return "PBR_ERROR_GL";
    case PBR_ERROR_CONTEXT: return "PBR_ERROR_CONTEXT";
    default: return "unknown result";
    }
}

uint32_t pbr_version(void) {
    return PBR_VERSION_NUMBER;
}

/* Large blocks ask for large pages: a fault for each small one took an eighth of the time to build a tree. */
static void *ask_for_large_pages(void *memory, size_t size) {
#ifdef MADV_HUGEPAGE
    enum { LARGE = 4 << 20 };
    if (memory && size >= LARGE) {
        const size_t before = (uintptr_t)memory % (uintptr_t)sysconf(_SC_PAGESIZE);
        madvise((char *)memory - before, before + size, MADV_HUGEPAGE); /* may be refused */
    }
#endif
    return memory;
}

/* Zeroed: fresh pages are, and what nobody writes to costs nothing. */
static void *default_allocate(void *user, size_t size, size_t alignment) {
    (void)user;
    (void)alignment; /* calloc aligns to 16, all that libpbr asks for */
    return ask_for_large_pages(calloc(1, size), size);
}

static void default_release(void *user, void *memory) {
    (void)user;
    free(memory);
}

static uint32_t processor_count(void) {
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) != 0) return 1;
    int n = CPU_COUNT(&set);
    return n > 0 ? (uint32_t)n : 1;
}

pbr_result pbr_instance_create(const pbr_instance_desc *desc, pbr_instance **out) {
    if (!out) return PBR_ERROR_INVALID_ARGUMENT;
    *out = NULL;
    /* The log callback of a desc that may be too short or too long cannot be trusted before the size is checked. */
    pbr_instance bare = {.desc = {.struct_size = sizeof bare.desc}};
    pbr_result result = read_desc(&bare, "pbr_instance_desc", desc, sizeof bare.desc, &bare.desc, sizeof bare.desc);
    if (result != PBR_OK) return result;
    if (!bare.desc.allocate != !bare.desc.release)
        return pbr_log(&bare, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                       "pbr_instance_desc: allocate and release must be given together, or neither");
    if (!bare.desc.allocate) {
        bare.desc.allocate = default_allocate;
        bare.desc.release = default_release;
    }
    if (bare.desc.thread_count > 4096)
        return pbr_log(&bare, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "pbr_instance_desc: thread_count is %u, the limit is 4096",
                       (unsigned)bare.desc.thread_count);
    if (bare.desc.thread_count == 0) bare.desc.thread_count = processor_count();
    pbr_instance *instance = pbr_allocate(&bare, 1, sizeof *instance);
    if (!instance) return PBR_ERROR_OUT_OF_MEMORY;
    instance->desc = bare.desc;
    atomic_init(&instance->children, 0);
    *out = instance;
    return PBR_OK;
}

pbr_result pbr_instance_destroy(pbr_instance **instance) {
    if (!instance || !*instance) return PBR_OK;
    size_t children = atomic_load(&(*instance)->children);
    if (children != 0)
        return pbr_log(*instance, PBR_LOG_ERROR, PBR_ERROR_BUSY,
                       "pbr_instance_destroy: %zu points, meshes or renderers made from the instance are still alive", children);
    pbr_free(*instance, *instance);
    *instance = NULL;
    return PBR_OK;
}

static void *out_of_memory(pbr_instance *instance, size_t count, size_t size) {
    pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_OUT_OF_MEMORY, "out of memory: %zu elements of %zu bytes", count, size);
    return NULL;
}

static void *allocate(pbr_instance *instance, size_t count, size_t size, bool zeroed) {
    const bool is_default = instance->desc.allocate == default_allocate;
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes)) return out_of_memory(instance, count, size);
    const size_t asked = bytes ? bytes : 1;
    void *memory;
    if (is_default && !zeroed) memory = ask_for_large_pages(malloc(asked), asked);
    else memory = instance->desc.allocate(instance->desc.memory_user, asked, ALIGNMENT);
    if (!memory) return out_of_memory(instance, count, size);
    if (!is_default && zeroed) memset(memory, 0, bytes);
    return memory;
}

void *pbr_allocate(pbr_instance *instance, size_t count, size_t size) {
    return allocate(instance, count, size, true);
}

void *allocate_unset(pbr_instance *instance, size_t count, size_t size) {
    return allocate(instance, count, size, false);
}

void *pbr_reallocate(pbr_instance *instance, void *memory, size_t old_count, size_t count, size_t size) {
    void *grown = pbr_allocate(instance, count, size);
    if (!grown) return NULL;
    if (memory) memcpy(grown, memory, (old_count < count ? old_count : count) * size);
    pbr_free(instance, memory);
    return grown;
}

void pbr_free(pbr_instance *instance, void *memory) {
    if (memory) instance->desc.release(instance->desc.memory_user, memory);
}

pbr_result pbr_log(pbr_instance *instance, int32_t level, pbr_result code, const char *format, ...) {
    if (!instance->desc.log) return code;
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    /* Text out of files goes into messages, which are one line. */
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 127) *c = '?';
    instance->desc.log(instance->desc.log_user, level, code, text);
    return code;
}

uint32_t pbr_instance_threads(const pbr_instance *instance) {
    return instance->desc.thread_count;
}

static pbr_result wrong_size(pbr_instance *instance, const char *name, size_t given, size_t minimum) {
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                   "%s: struct_size is %zu, expected at least %zu; was the structure set up by its INIT macro?", name, given,
                   minimum);
}

pbr_result read_desc(pbr_instance *instance, const char *name, const void *in, size_t minimum, void *out, size_t size) {
    if (!in) {
        memset(out, 0, size);
        memcpy(out, &size, sizeof size);
        return PBR_OK;
    }
    size_t given;
    memcpy(&given, in, sizeof given);
    if (given < minimum || given > 65536) return wrong_size(instance, name, given, minimum);
    const unsigned char *bytes = in;
    for (size_t i = size; i < given; i++)
        if (bytes[i] != 0)
            return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_INVALID_ARGUMENT,
                           "%s: byte %zu is set, but this version of libpbr knows only %zu bytes", name, i, size);
    size_t copied = given < size ? given : size;
    memmove(out, in, copied);
    memset((unsigned char *)out + copied, 0, size - copied);
    memcpy(out, &size, sizeof size);
    return PBR_OK;
}

pbr_result write_info(pbr_instance *instance, const char *name, const void *info, size_t size, void *out, size_t minimum) {
    size_t given;
    memcpy(&given, out, sizeof given);
    if (given < minimum || given > 65536) return wrong_size(instance, name, given, minimum);
    size_t copied = given < size ? given : size;
    memcpy((unsigned char *)out + sizeof given, (const unsigned char *)info + sizeof given, copied - sizeof given);
    if (given > size) memset((unsigned char *)out + size, 0, given - size);
    return PBR_OK;
}
