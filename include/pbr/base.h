/* libpbr: point-based rendering inside the host's OpenGL program.
 * SPDX-License-Identifier: MIT */
/** @file base.h
 * Results, the library's version, and the conventions that every other header builds on.
 *
 * - A function that can fail returns #pbr_result. The detail (which argument, which size, which OpenGL function) goes once to
 *   the instance's log callback; nothing is printed.
 * - Input structures begin with `struct_size`, are set up by their `PBR_..._INIT` macro, take zero as "the default", and grow
 *   only at the end. A structure shorter than this version's is accepted; a longer one only if what it adds is all zero.
 * - Arrays of such structures are walked by the `struct_size` of their first element; all elements carry the same.
 * - Matrices are double, column-major: element (row r, column c) of `m` is `m[4 * c + r]`; they multiply column vectors.
 * - The floating-point environment is taken to be what a C program starts with: rounding to nearest, no exception trapped. Exceptions are
 *   raised and mean nothing. Subnormal numbers may be flushed to zero.
 * - Eye space looks down -z. Window coordinates have their origin at the lower left and pixel centres at halves.
 */
#ifndef PBR_BASE_H
#define PBR_BASE_H

#include <stddef.h>
#include <stdint.h>

/** @cond */
#if defined(PBR_STATIC)
#define PBR_API
#elif defined(_WIN32)
#if defined(PBR_BUILDING)
#define PBR_API __declspec(dllexport)
#else
#define PBR_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define PBR_API __attribute__((visibility("default")))
#else
#define PBR_API
#endif

#ifdef __cplusplus
#define PBR_BEGIN_DECLS extern "C" {
#define PBR_END_DECLS }
/* A value of structure T whose struct_size is set and whose other members are zero. */
template <class T> inline T pbr_sized_() {
    T value = T();
    value.struct_size = sizeof(T);
    return value;
}
#define PBR_SIZED(T) pbr_sized_<T>()
#else
#define PBR_BEGIN_DECLS
#define PBR_END_DECLS
#define PBR_SIZED(T) {.struct_size = sizeof(T)}
#endif
/** @endcond */

#define PBR_VERSION_MAJOR 0 /**< Version of these headers. #pbr_version tells the version of the library that runs. */
#define PBR_VERSION_MINOR 1 /**< Grows with what is added. */
#define PBR_VERSION_PATCH 0 /**< Grows with corrections. */
/** The whole version as one number: 1,000,000 major + 1,000 minor + patch. */
#define PBR_VERSION_NUMBER (PBR_VERSION_MAJOR * 1000000 + PBR_VERSION_MINOR * 1000 + PBR_VERSION_PATCH)

PBR_BEGIN_DECLS

/** #PBR_OK, or a negative error. Later versions may return errors that are not listed here. */
typedef int32_t pbr_result;

/** Values of #pbr_result. */
enum {
    PBR_OK = 0,                       /**< Done. */
    PBR_ERROR_INVALID_ARGUMENT = -1,  /**< A pointer, size, enum or matrix that the function's contract excludes. */
    PBR_ERROR_OUT_OF_MEMORY = -2,     /**< The host's allocator returned NULL. */
    PBR_ERROR_OUT_OF_GPU_MEMORY = -3, /**< OpenGL could not hold a buffer, or the renderer's budget is smaller than one frame's need. */
    PBR_ERROR_UNSUPPORTED = -4,       /**< The context or this build lacks what was asked for; the log names it. */
    PBR_ERROR_LIMIT = -5,             /**< A limit of the library or the context was passed; the log names it and its value. */
    PBR_ERROR_BUSY = -6,              /**< The object still has children or users. */
    PBR_ERROR_IO = -7,                /**< The operating system refused to open, read or write a file. */
    PBR_ERROR_FORMAT = -8,            /**< A file's content is not what its format says. */
    PBR_ERROR_CANCELLED = -9,         /**< A progress callback asked to stop. */
    PBR_ERROR_GL = -10,               /**< The driver refused what its version promises: a shader, a framebuffer. */
    PBR_ERROR_CONTEXT = -11           /**< No OpenGL context is current, or the renderer was abandoned. */
};

/**
 * The name of a result, for messages.
 * @param result  Any value.
 * @return Such as "PBR_ERROR_LIMIT"; "unknown result" for a value that is none. In static storage, never NULL.
 * Any thread; no context. Since 0.1.
 */
PBR_API const char *pbr_result_name(pbr_result result);

/**
 * The version of the library that runs.
 * @return Its #PBR_VERSION_NUMBER. Any thread; no context. Since 0.1.
 */
PBR_API uint32_t pbr_version(void);

/**
 * Progress of long work on the CPU. Called from the thread that called the function, a few dozen times per stage; by
 * #pbr_write_file once for 16,384 vertices or triangles.
 * @param user      The pointer given beside the callback.
 * @param stage     What is being done, a short English phrase in static storage.
 * @param fraction  0..1, not decreasing within a stage.
 * @return Non-zero to go on, 0 to cancel: the function then returns #PBR_ERROR_CANCELLED and leaves nothing behind.
 */
typedef int (*pbr_progress_fn)(void *user, const char *stage, double fraction);

/** How one number of an attribute is stored. */
enum {
    PBR_FORMAT_NONE = 0,    /**< Of an attribute that is absent. */
    PBR_FORMAT_FLOAT32 = 1, /**< float */
    PBR_FORMAT_FLOAT64 = 2, /**< double */
    PBR_FORMAT_INT8 = 3,    /**< int8_t */
    PBR_FORMAT_UINT8 = 4,   /**< uint8_t */
    PBR_FORMAT_INT16 = 5,   /**< int16_t */
    PBR_FORMAT_UINT16 = 6,  /**< uint16_t */
    PBR_FORMAT_INT32 = 7,   /**< int32_t */
    PBR_FORMAT_UINT32 = 8   /**< uint32_t */
};

/**
 * An array of attributes in the host's memory, read during the call that it is passed to and not kept.
 * Absent when `data` is NULL. Elements need no alignment. This structure is final: it will not grow.
 * @code
 * struct { float position[3]; uint8_t colour[4]; } vertices[3] = {{{0, 0, 0}, {255, 0, 0, 255}}};
 * pbr_attribute positions = {vertices[0].position, sizeof *vertices, PBR_FORMAT_FLOAT32, 3};
 * pbr_attribute colours = {vertices[0].colour, sizeof *vertices, PBR_FORMAT_UINT8, 4};
 * @endcode
 */
typedef struct pbr_attribute {
    const void *data;    /**< First element, or NULL. */
    size_t stride;       /**< Bytes from one element to the next; 0 = tightly packed. */
    uint32_t format;     /**< PBR_FORMAT_... of each component, in the host's byte order. */
    uint32_t components; /**< Numbers per element. */
} pbr_attribute;

PBR_END_DECLS
#endif
