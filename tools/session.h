/* What every subcommand shares: an instance of libpbr whose messages become lines on stderr, whose allocations are counted, and
 * whose long work shows a progress bar on a terminal. SPDX-License-Identifier: MIT */
#ifndef SESSION_H
#define SESSION_H

#include <pbr/instance.h>
#include <stdatomic.h>
#include <stdbool.h>

/* Exit status of the command. */
enum { STATUS_OK = 0, STATUS_FAILED = 1, STATUS_USAGE = 2 };

enum { SESSION_LINE = 1024 }; /* bytes of a message, the last 0 */

struct session {
    pbr_instance *instance;
    atomic_uint_fast64_t allocations; /* made by libpbr so far */
    atomic_uint errors;               /* messages of level error so far */
    bool has_terminal;                /* stderr is one */
    /* Under stderr's lock: */
    bool shows_bar; /* a bar stands on the terminal's last line */
    char last_error[SESSION_LINE];
};

/* False with a message on stderr if there is no memory. `session` must stay where it is: the instance points to it. */
bool session_open(struct session *session);
void session_close(struct session *session);

/* How many threads long work may use, 0 = one a processor; before anything is made of the instance. False with a message. */
bool session_set_threads(struct session *session, uint32_t count);

/* One line on stderr, "pbr: ...", its control characters replaced. Returns STATUS_FAILED. */
int session_fail(struct session *session, const char *format, ...) __attribute__((format(printf, 2, 3)));
void session_warn(struct session *session, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* The newest error's text, for showing it elsewhere, too. Any thread. */
void session_last_error(struct session *session, char *text, size_t capacity);

/* The same for a command line that is wrong, "pbr: COMMAND: ...". Both return STATUS_USAGE. */
int session_usage(struct session *session, const char *command, const char *what);
int session_bad_value(struct session *session, const char *command, const char *option, const char *value, const char *expected);

/* A name on stdout. File names and names inside files are not ours: no terminal escapes pass. */
void session_print_name(const char *name);

/* True if `result` is PBR_OK. Otherwise there is a message: libpbr's own if it logged one since `errors_before`, else this one. */
bool session_check(struct session *session, pbr_result result, unsigned errors_before, const char *what);

/* A pbr_progress_fn with the session as user: a bar on a terminal, nothing in a pipe. */
int session_progress(void *user, const char *stage, double fraction);
void session_progress_end(struct session *session);

/* The most memory that the process has occupied so far, bytes. */
uint64_t session_peak_memory(void);

/* Seconds on a clock that never jumps. */
double session_seconds(void);

#endif
