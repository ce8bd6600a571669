/* Reading the viewer's files on a thread of its own, one after the other. SPDX-License-Identifier: MIT */
#ifndef VIEW_LOADER_H
#define VIEW_LOADER_H

#include "input.h"

struct loader;

/* What is being read. */
struct loader_progress {
    bool is_running;
    uint32_t index; /* of the file, from 0 */
    const char *path;
    const char *stage; /* NULL until the reader tells */
    double fraction;   /* of the stage */
};

enum loader_news { LOADER_NOTHING, LOADER_INPUT, LOADER_FAILURE };

/* `paths` and `session` outlive the loader. `wanted`: as input_load takes it. `notify` is called on its thread whenever there is
 * news or progress, and not after loader_stop. NULL with a message if there is no memory or no thread. */
struct loader *loader_start(struct session *session, const char *const *paths, uint32_t count, unsigned wanted,
                            void (*notify)(void));

struct loader_progress loader_progress(struct loader *loader);

/* The next file that is done, in their order: LOADER_INPUT with what was read, the caller's to release, or LOADER_FAILURE; its
 * message is on stderr, and in `message`. */
enum loader_news loader_take(struct loader *loader, struct input *input, char *message, size_t capacity);

/* Cancels what is being read and waits for the thread, but not for long: false if it hangs in a read that does not end, of a pipe
 * that nobody writes to for instance. Then the loader and the session are still in use, and the process is to end with _exit. */
bool loader_stop(struct loader **loader);

#endif
