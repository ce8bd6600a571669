/* SPDX-License-Identifier: MIT */
/** @file instance.h
 * The instance: where memory comes from, where messages go, how many threads may be used. It replaces all global state.
 */
#ifndef PBR_INSTANCE_H
#define PBR_INSTANCE_H

#include <pbr/base.h>

PBR_BEGIN_DECLS

/** The allocator, the log and the threads of everything made from it. Outlives its children; any thread may use it at any time. */
typedef struct pbr_instance pbr_instance;

/** Gravity of a message. */
enum {
    PBR_LOG_ERROR = 1,   /**< Why a call failed; once for each failure. */
    PBR_LOG_WARNING = 2, /**< Something was put right, left out or found, and the call goes on. */
    PBR_LOG_INFO = 3     /**< Anything else; nothing so far. */
};

/**
 * Receives one message. May be called from any thread that calls libpbr and from its worker threads, so it must be thread
 * safe; it must not call back into libpbr.
 * @param user   `log_user` of the descriptor.
 * @param level  PBR_LOG_...
 * @param code   The #pbr_result that the message explains, or #PBR_OK.
 * @param text   One line of English in UTF-8 without a line end, valid during the call.
 */
typedef void (*pbr_log_fn)(void *user, int32_t level, pbr_result code, const char *text);

/** What #pbr_instance_create needs. */
typedef struct pbr_instance_desc {
    size_t struct_size;
    /** Returns `size` bytes aligned to `alignment` (a power of two, at most 64), or NULL. May be called from worker threads;
     * must not call back into libpbr. NULL = the C library's, and then `release` must be NULL too. */
    void *(*allocate)(void *user, size_t size, size_t alignment);
    /** Takes back what `allocate` returned; never called with NULL. */
    void (*release)(void *user, void *memory);
    void *memory_user; /**< First argument of `allocate` and `release`. */
    pbr_log_fn log; /**< NULL = messages are dropped. */
    void *log_user; /**< First argument of `log`. */
    /** Threads that a long call may use, the caller's included; 0 = one per processor this process may run on, 4096 at most (no
     * call uses more than 64). Workers live only as long as the call that started them, and block every signal. Renderers of an instance
     * with more than one have a thread besides, for hierarchies (#PBR_FRAME_WAIT). */
    uint32_t thread_count;
} pbr_instance_desc;

#define PBR_INSTANCE_DESC_INIT PBR_SIZED(pbr_instance_desc)

/**
 * Creates an instance.
 * @param desc  NULL = all defaults. The callbacks must stay valid until the instance is destroyed.
 * @param out   Receives the instance, or NULL on error. The caller owns it.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT, #PBR_ERROR_LIMIT (`thread_count`), #PBR_ERROR_OUT_OF_MEMORY. Errors are explained
 *         to `desc->log`, unless `desc->struct_size` itself is wrong: then it cannot be trusted.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_instance_create(const pbr_instance_desc *desc, pbr_instance **out);

/**
 * Destroys an instance that has no children left, and sets `*instance` to NULL.
 * @param instance  NULL and a pointer to NULL are allowed.
 * @return #PBR_OK; #PBR_ERROR_BUSY if points, meshes or renderers made from it live on: then nothing is destroyed and
 *         `*instance` stays.
 * Any thread, once no other call on the instance runs; no context. Since 0.1.
 */
PBR_API pbr_result pbr_instance_destroy(pbr_instance **instance);

PBR_END_DECLS
#endif
