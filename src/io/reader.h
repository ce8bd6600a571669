/* What every format's reader works on: the bytes, and how it tells what it meets. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_READER_H
#define PBR_IO_READER_H

#include <pbr/io.h>
#include <pbr/support.h>
#include <stdbool.h>

struct source;

struct reader {
    pbr_instance *instance;
    const struct source *file; /* that the bytes are mapped from, where that is to be read in pieces; or NULL */
    const char *name;          /* of the source, for messages */
    const char *path;          /* of the file, in whose folder those lie that it names; NULL: none are read */
    const char *data;
    size_t size;
    char line_end; /* '\n', or '\r' in files that use nothing else */
    pbr_progress_fn progress;
    void *progress_user;
    double fraction; /* last reported */
    uint64_t warnings;
};

/* "NAME: line N: ..." of the line that holds the byte at `position`. Returns `code`. */
pbr_result reader_error_line(struct reader *reader, pbr_result code, size_t position, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* "NAME: byte N: ...", N counted from 0. Returns `code`. */
pbr_result reader_error_byte(struct reader *reader, pbr_result code, size_t position, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Logs one warning that stands for `things` things put right or left out. */
void reader_warn(struct reader *reader, uint64_t things, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* Tells how far into the file the work is. Returns PBR_ERROR_CANCELLED if the host wants no more. */
pbr_result reader_progress(struct reader *reader, size_t position);

/* As pbr_parallel of `count` things that lie in the file from `from` to `to`. On the calling thread it is told, a few dozen times,
 * how far the work is. */
pbr_result reader_parallel(struct reader *reader, size_t count, size_t grain, size_t from, size_t to, pbr_range_fn work,
                           void *user);

/* A piece of a file, made fit for a message: cut, and control characters replaced. */
struct excerpt {
    char text[33];
};
struct excerpt reader_excerpt(const char *p, const char *end);

#endif
