/* Files: the whole content of one as memory, and one that appears under its name only when complete.
 * SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_FILE_H
#define PBR_CORE_FILE_H

#include <pbr/support.h>
#include <stdatomic.h>
#include <stdbool.h>

struct source {
    pbr_instance *instance;
    const unsigned char *data; /* read only */
    size_t size;
    bool mapped;
};

/* Opens a regular file by mapping it, or a file or pipe by reading it to its end (`stream`). A mapping faults if the file is
 * truncated while it is used; a stream does not. Errors are logged. */
pbr_result source_open(pbr_instance *instance, const char *path, bool stream, struct source *out);
void source_close(struct source *source);

/* Of a mapping that is read here and there: what lies around is not to be read along. */
void source_read_at_random(const struct source *source);

/* Of a mapping: these bytes will not be read again soon, and need not count as the process's memory. Any thread. */
void source_done_with(const struct source *source, size_t begin, size_t size);

/* A file written under a temporary name in its own folder. */
struct output {
    pbr_instance *instance;
    const char *path; /* the caller's */
    char *temporary;
    int file;
    atomic_int error; /* errno of a write that failed, 0 = none */
};

pbr_result output_open(pbr_instance *instance, const char *path, struct output *out);

/* Writes at a place; false once any write has failed. Any thread. */
bool output_write(struct output *output, const void *data, size_t size, uint64_t offset);

/* Gives the file its name if `keep` and nothing failed, else removes it. Takes back a zeroed or closed output too. */
pbr_result output_close(struct output *output, bool keep);

/* A file without a name in the folder of another, that is gone when it is closed or the process ends. */
pbr_result scratch_open(pbr_instance *instance, const char *beside, int *file);
void scratch_close(int file);

/* All of `size` bytes at a place. Errors are logged with the path. Any thread. */
pbr_result scratch_write(pbr_instance *instance, const char *beside, int file, const void *data, size_t size, uint64_t offset);
pbr_result scratch_read(pbr_instance *instance, const char *beside, int file, void *data, size_t size, uint64_t offset);

#endif
