/* Files are read on a thread of their own, in their order, until that is stopped. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../../tools/view_loader.h"

static atomic_uint notices;

static void notice(void) {
    atomic_fetch_add(&notices, 1);
}

struct files {
    struct session session;
    char folder[64], points[80], pipe[80], absent[80];
};

static struct files make_files(void) {
    struct files files = {.folder = "/tmp/pbr-loader-XXXXXX"};
    assert_non_null(mkdtemp(files.folder));
    snprintf(files.points, sizeof files.points, "%s/points.xyz", files.folder);
    snprintf(files.pipe, sizeof files.pipe, "%s/pipe.xyz", files.folder);
    snprintf(files.absent, sizeof files.absent, "%s/absent.xyz", files.folder);
    FILE *file = fopen(files.points, "w");
    assert_non_null(file);
    for (int i = 0; i < 1000; i++) fprintf(file, "%d %d 0\n", i % 32, i / 32);
    fclose(file);
    assert_int_equal(mkfifo(files.pipe, 0600), 0);
    return files;
}

static void remove_files(struct files *files) {
    unlink(files->points);
    unlink(files->pipe);
    rmdir(files->folder);
}

/* Waits for a file, and fails the test if there is none left. */
static enum loader_news next(struct loader *loader, struct input *input, char *message) {
    for (;;) {
        bool is_running = loader_progress(loader).is_running;
        enum loader_news news = loader_take(loader, input, message, SESSION_LINE);
        if (news != LOADER_NOTHING || !is_running) return news;
        usleep(1000);
    }
}

static void files_come_in_their_order_with_their_errors(void **state) {
    (void)state;
    struct files files = make_files();
    const char *paths[] = {files.points, files.absent, files.points};
    struct input input;
    char message[SESSION_LINE];
    assert_true(session_open(&files.session));
    struct loader *loader = loader_start(&files.session, paths, 3, 0, notice);
    assert_non_null(loader);
    for (int i = 0; i < 3; i++) {
        enum loader_news news = next(loader, &input, message);
        assert_int_equal(news, i == 1 ? LOADER_FAILURE : LOADER_INPUT);
        if (i == 1) assert_non_null(strstr(message, files.absent));
        else assert_int_equal(input.info.count, 1000);
        input_release(&input);
    }
    assert_int_equal(next(loader, &input, message), LOADER_NOTHING);
    struct loader_progress progress = loader_progress(loader);
    assert_false(progress.is_running);
    assert_int_equal(progress.index, 3);
    assert_true(atomic_load(&notices) >= 3);
    assert_true(loader_stop(&loader));
    assert_null(loader);
    session_close(&files.session);
    assert_null(files.session.instance); /* nothing of it lives on */
    remove_files(&files);
}

static void what_was_read_and_not_taken_is_released(void **state) {
    (void)state;
    struct files files = make_files();
    const char *paths[] = {files.points};
    assert_true(session_open(&files.session));
    struct loader *loader = loader_start(&files.session, paths, 1, 0, notice);
    assert_non_null(loader);
    while (loader_progress(loader).is_running) usleep(1000);
    assert_true(loader_stop(&loader));
    session_close(&files.session);
    assert_null(files.session.instance);
    remove_files(&files);
}

/* The reader asks at its first progress; the files after it are not begun. */
static void stopping_cancels_what_is_read_and_leaves_the_rest(void **state) {
    (void)state;
    struct files files = make_files();
    const char *paths[] = {files.pipe, files.absent};
    assert_true(session_open(&files.session));
    struct loader *loader = loader_start(&files.session, paths, 2, 0, notice);
    assert_non_null(loader);
    int pipe = open(files.pipe, O_WRONLY); /* once the loader reads from it */
    assert_true(pipe >= 0);
    struct loader_progress progress = loader_progress(loader);
    assert_true(progress.is_running && progress.index == 0 && !progress.stage);
    assert_string_equal(progress.path, files.pipe);
    assert_int_equal(write(pipe, "1 2 3\n", 6), 6);
    /* It hangs in a read that does not end. */
    assert_false(loader_stop(&loader));
    assert_non_null(loader);
    const unsigned before = atomic_load(&notices);
    assert_int_equal(close(pipe), 0);
    assert_true(loader_stop(&loader));
    assert_int_equal(atomic_load(&notices), before);
    assert_int_equal(atomic_load(&files.session.errors), 0);
    assert_string_equal(files.session.last_error, "");
    session_close(&files.session);
    assert_null(files.session.instance);
    remove_files(&files);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(files_come_in_their_order_with_their_errors),
        cmocka_unit_test(what_was_read_and_not_taken_is_released),
        cmocka_unit_test(stopping_cancels_what_is_read_and_leaves_the_rest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
