/* Messages and progress of a reader. SPDX-License-Identifier: MIT */
#include "reader.h"

#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

static pbr_result error_at(struct reader *reader, pbr_result code, const char *unit, size_t number, const char *format,
                           va_list arguments) {
    char reason[300];
    vsnprintf(reason, sizeof reason, format, arguments);
    return pbr_log(reader->instance, PBR_LOG_ERROR, code, "%s: %s %zu: %s", reader->name, unit, number, reason);
}

pbr_result reader_error_line(struct reader *reader, pbr_result code, size_t position, const char *format, ...) {
    size_t line = 1;
    const char *p = reader->data, *end = reader->data + position;
    while (p < end && (p = memchr(p, reader->line_end, (size_t)(end - p)))) {
        line++;
        p++;
    }
    va_list arguments;
    va_start(arguments, format);
    error_at(reader, code, "line", line, format, arguments);
    va_end(arguments);
    return code;
}

pbr_result reader_error_byte(struct reader *reader, pbr_result code, size_t position, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    error_at(reader, code, "byte", position, format, arguments);
    va_end(arguments);
    return code;
}

void reader_warn(struct reader *reader, uint64_t things, const char *format, ...) {
    char reason[300];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reason, sizeof reason, format, arguments);
    va_end(arguments);
    reader->warnings += things;
    pbr_log(reader->instance, PBR_LOG_WARNING, PBR_OK, "%s: %s", reader->name, reason);
}

pbr_result reader_progress(struct reader *reader, size_t position) {
    if (!reader->progress) return PBR_OK;
    double fraction = reader->size ? (double)position / (double)reader->size : 1;
    if (fraction > reader->fraction) reader->fraction = fraction;
    return reader->progress(reader->progress_user, "reading", reader->fraction) ? PBR_OK : PBR_ERROR_CANCELLED;
}

struct telling {
    struct reader *reader;
    pbr_range_fn work;
    void *user;
    pthread_t caller;
    size_t count, from, to;
    size_t told; /* of `count`; the caller's thread alone looks at this and the next */
    bool is_cancelled;
    atomic_size_t done;
};

static pbr_result work_and_tell(void *user, size_t begin, size_t end) {
    enum { TIMES = 32 };
    struct telling *telling = user;
    const pbr_result result = telling->work(telling->user, begin, end);
    const size_t done = atomic_fetch_add(&telling->done, end - begin) + (end - begin);
    if (result != PBR_OK || !pthread_equal(telling->caller, pthread_self())) return result;
    if ((uint64_t)(done - telling->told) * TIMES < telling->count) return PBR_OK;
    telling->told = done;
    const double share = (double)done / (double)telling->count;
    const size_t at = telling->from + (size_t)(share * (double)(telling->to - telling->from));
    telling->is_cancelled = reader_progress(telling->reader, at) != PBR_OK;
    return telling->is_cancelled ? PBR_ERROR_CANCELLED : PBR_OK;
}

pbr_result reader_parallel(struct reader *reader, size_t count, size_t grain, size_t from, size_t to, pbr_range_fn work,
                           void *user) {
    struct telling telling = {
        .reader = reader, .work = work, .user = user, .caller = pthread_self(), .count = count, .from = from, .to = to};
    pbr_result result = reader_progress(reader, from);
    if (result == PBR_OK) result = pbr_parallel(reader->instance, count, grain, work_and_tell, &telling);
    return telling.is_cancelled ? PBR_ERROR_CANCELLED : result; /* whatever another thread met meanwhile */
}

struct excerpt reader_excerpt(const char *p, const char *end) {
    struct excerpt out = {0};
    for (size_t i = 0; i + 1 < sizeof out.text && p < end; i++, p++) out.text[i] = *p >= ' ' && *p < 127 ? *p : '?';
    return out;
}
