/* Messages, counted memory and the progress bar. SPDX-License-Identifier: MIT */
#include "session.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

static void *counted_allocate(void *user, size_t size, size_t alignment) {
    struct session *session = user;
    void *memory = NULL;
    atomic_fetch_add(&session->allocations, 1);
    return posix_memalign(&memory, alignment < sizeof(void *) ? sizeof(void *) : alignment, size) == 0 ? memory : NULL;
}

static void counted_release(void *user, void *memory) {
    (void)user;
    free(memory);
}

static void put_printable(FILE *file, const char *text) {
    for (; *text; text++) putc((unsigned char)*text < 0x20 || *text == 0x7f ? '?' : *text, file);
}

void session_print_name(const char *name) {
    put_printable(stdout, name);
}

/* stderr's lock keeps lines of several threads whole. */
static void put_line(struct session *session, const char *prefix, const char *text) {
    flockfile(stderr);
    session_progress_end(session);
    fputs(prefix, stderr);
    put_printable(stderr, text);
    putc('\n', stderr);
    funlockfile(stderr);
}

static void put_error(struct session *session, const char *text) {
    flockfile(stderr);
    put_line(session, "pbr: ", text);
    snprintf(session->last_error, sizeof session->last_error, "%s", text);
    funlockfile(stderr);
}

void session_last_error(struct session *session, char *text, size_t capacity) {
    flockfile(stderr);
    snprintf(text, capacity, "%s", session->last_error);
    funlockfile(stderr);
}

static void receive_log(void *user, int32_t level, pbr_result code, const char *text) {
    struct session *session = user;
    (void)code;
    if (level == PBR_LOG_ERROR) {
        atomic_fetch_add(&session->errors, 1);
        put_error(session, text);
    } else if (level == PBR_LOG_WARNING) {
        put_line(session, "pbr: warning: ", text);
    }
}

static bool create_instance(struct session *session, uint32_t thread_count) {
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    desc.thread_count = thread_count;
    desc.allocate = counted_allocate;
    desc.release = counted_release;
    desc.memory_user = session;
    desc.log = receive_log;
    desc.log_user = session;
    return session_check(session, pbr_instance_create(&desc, &session->instance), 0, "cannot start");
}

bool session_open(struct session *session) {
    *session = (struct session){.has_terminal = isatty(STDERR_FILENO)};
    return create_instance(session, 0);
}

bool session_set_threads(struct session *session, uint32_t count) {
    pbr_instance_destroy(&session->instance);
    return create_instance(session, count);
}

void session_close(struct session *session) {
    session_progress_end(session);
    pbr_instance_destroy(&session->instance);
}

int session_fail(struct session *session, const char *format, ...) {
    char line[SESSION_LINE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    put_error(session, line);
    return STATUS_FAILED;
}

void session_warn(struct session *session, const char *format, ...) {
    char line[SESSION_LINE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    put_line(session, "pbr: warning: ", line);
}

int session_usage(struct session *session, const char *command, const char *what) {
    session_fail(session, "%s: %s (see pbr %s --help)", command, what, command);
    return STATUS_USAGE;
}

int session_bad_value(struct session *session, const char *command, const char *option, const char *value, const char *expected) {
    session_fail(session, "%s: %s: '%s' is not %s", command, option, value, expected);
    return STATUS_USAGE;
}

bool session_check(struct session *session, pbr_result result, unsigned errors_before, const char *what) {
    if (result == PBR_OK) return true;
    if (atomic_load(&session->errors) == errors_before) session_fail(session, "%s: %s", what, pbr_result_name(result));
    return false;
}

int session_progress(void *user, const char *stage, double fraction) {
    enum { CELLS = 40 };
    struct session *session = user;
    char bar[CELLS + 1];
    if (!session->has_terminal) return 1;
    double share = fraction > 1 ? 1 : fraction > 0 ? fraction : 0;
    for (int i = 0; i < CELLS; i++) bar[i] = i < (int)(share * CELLS + 0.5) ? '#' : '.';
    bar[CELLS] = '\0';
    flockfile(stderr);
    fprintf(stderr, "\r[%s] %3d %% %s\033[K", bar, (int)(share * 100), stage);
    session->shows_bar = true;
    funlockfile(stderr);
    return 1;
}

void session_progress_end(struct session *session) {
    flockfile(stderr);
    if (session->shows_bar) fputs("\r\033[K", stderr);
    session->shows_bar = false;
    funlockfile(stderr);
}

uint64_t session_peak_memory(void) {
    struct rusage usage;
    return getrusage(RUSAGE_SELF, &usage) == 0 ? (uint64_t)usage.ru_maxrss * 1024 : 0;
}

double session_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
