/* Frames are timed by the GPU's clock, without waiting and without a trace. SPDX-License-Identifier: MIT */
#include "support.h"

#include "gl/timer.h"

#include <string.h>
#include <time.h>

/* A copy of the context's table in which single functions can be replaced. */
struct spy {
    struct gl gl;
    PFNGLGENQUERIESPROC gen_queries;
    PFNGLDELETEQUERIESPROC delete_queries;
    PFNGLQUERYCOUNTERPROC query_counter;
    PFNGLGETQUERYOBJECTUIVPROC get_available;
    PFNGLGETQUERYOBJECTUI64VPROC get_result;
};

static struct {
    const struct gl *gl;
    int generated, deleted, stamped, read; /* calls */
    bool available;
    GLuint64 results[2]; /* in the order in which they are read */
} seen;

static void APIENTRY gen_queries(GLsizei n, GLuint *names) {
    seen.generated++;
    (*seen.gl->GenQueries)(n, names);
}
static void APIENTRY delete_queries(GLsizei n, const GLuint *names) {
    seen.deleted++;
    (*seen.gl->DeleteQueries)(n, names);
}
static void APIENTRY query_counter(GLuint query, GLenum target) {
    seen.stamped++;
    (*seen.gl->QueryCounter)(query, target);
}
static void APIENTRY get_available(GLuint query, GLenum what, GLuint *value) {
    (void)query;
    assert_int_equal(what, GL_QUERY_RESULT_AVAILABLE);
    *value = seen.available;
}
static void APIENTRY get_result(GLuint query, GLenum what, GLuint64 *value) {
    (void)query;
    assert_int_equal(what, GL_QUERY_RESULT);
    assert_in_range(seen.read, 0, 1);
    *value = seen.results[seen.read++];
}

static void spy_on(const struct gl *gl, struct spy *spy) {
    *spy = (struct spy){*gl, gen_queries, delete_queries, query_counter, get_available, get_result};
    memset(&seen, 0, sizeof seen);
    seen.gl = gl;
    spy->gl.GenQueries = &spy->gen_queries;
    spy->gl.DeleteQueries = &spy->delete_queries;
    spy->gl.QueryCounter = &spy->query_counter;
}

static void fake_results(struct spy *spy) {
    spy->gl.GetQueryObjectuiv = &spy->get_available;
    spy->gl.GetQueryObjectui64v = &spy->get_result;
}

/* Timestamps alone: what is drawn between them does not matter here. */
static void time_frame(const struct gl *gl, struct timer *timer, float tag) {
    timer_begin(gl, timer);
    timer_end(gl, timer, tag);
}

/* Timestamps before a finish are known after it. */
static bool take_after_finish(const struct gl *gl, struct timer *timer, double *seconds, float *tag) {
    glFinish();
    return timer_take(gl, timer, seconds, tag);
}

/* As a renderer made from this sees it. */
static const struct gl *load(void **state, const pbr_renderer_desc *desc) {
    static struct gl gl;
    const struct host *host = *state;
    gl = (struct gl){0};
    assert_int_equal(gl_load(host->instance, desc, &gl), PBR_OK);
    return &gl;
}

static const struct gl *context_of(void **state) {
    const pbr_renderer_desc desc = host_renderer_desc();
    return load(state, &desc);
}

static void need(bool condition, const char *what) {
    if (condition) return;
    print_message("skipped: the context has no %s\n", what);
    skip();
}

static const struct gl *context_with_timestamps(void **state) {
    const struct gl *gl = context_of(state);
    need(gl->timestamp_bits > 0, "timestamps");
    return gl;
}

/* Every desktop context that the tests use has timestamps, and OpenGL ES as an extension brings them. */
static void timestamps_are_found_where_they_are(void **state) {
    const struct gl *gl = context_of(state);
    assert_int_equal(gl->timestamp_bits > 0, !context_is_es() || context_has_extension("GL_EXT_disjoint_timer_query"));
    assert_int_equal(gl->has_query_buffer,
                     !context_is_es() && (context_has(44, 0) || context_has_extension("GL_ARB_query_buffer_object")));
}

static void expect_times_of_frames(const struct gl *gl) {
    struct timer timer = {0};
    double seconds = -1;
    float tag = 0;
    assert_false(timer_take(gl, &timer, &seconds, &tag));
    for (int i = 1; i < 20; i++) {
        time_frame(gl, &timer, (float)i);
        assert_true(take_after_finish(gl, &timer, &seconds, &tag));
        assert_true(seconds >= 0 && tag == (float)i);
        assert_false(timer_take(gl, &timer, &seconds, &tag));
    }
    timer_free(gl, &timer);
}

static void a_frame_s_time_comes_once_with_its_tag(void **state) {
    expect_times_of_frames(context_of(state));
}

/* libepoxy ends the process where it does not find a function. */
static void the_default_lookup_finds_the_functions_too(void **state) {
    const pbr_renderer_desc desc = PBR_RENDERER_DESC_INIT;
    expect_times_of_frames(load(state, &desc));
}

static void the_newest_time_is_given_and_older_ones_are_dropped(void **state) {
    const struct gl *gl = context_of(state);
    struct timer timer = {0};
    double seconds = -1;
    float tag = 0;
    for (int i = 1; i <= 3; i++) time_frame(gl, &timer, (float)i);
    assert_true(take_after_finish(gl, &timer, &seconds, &tag));
    assert_true(tag == 3);
    assert_false(timer_take(gl, &timer, &seconds, &tag));
    timer_free(gl, &timer);
}

static void frames_beyond_the_ring_are_not_timed(void **state) {
    const struct gl *gl = context_of(state);
    struct timer timer = {0};
    double seconds = -1;
    float tag = 0;
    for (int round = 0; round < 3; round++) {
        for (int i = 1; i <= TIMER_FRAMES + 3; i++) time_frame(gl, &timer, (float)i);
        assert_true(take_after_finish(gl, &timer, &seconds, &tag));
        assert_true(tag == TIMER_FRAMES);
        time_frame(gl, &timer, 0.5f); /* the ring's start moves */
        assert_true(take_after_finish(gl, &timer, &seconds, &tag));
        assert_true(tag == 0.5f);
    }
    timer_free(gl, &timer);
}

static void a_frame_that_does_not_end_is_forgotten(void **state) {
    const struct gl *gl = context_of(state);
    struct timer timer = {0};
    double seconds = -1;
    float tag = 0;
    timer_end(gl, &timer, 1);
    assert_false(take_after_finish(gl, &timer, &seconds, &tag));
    for (int i = 0; i < 3 * TIMER_FRAMES; i++) timer_begin(gl, &timer);
    assert_false(take_after_finish(gl, &timer, &seconds, &tag));
    time_frame(gl, &timer, 2);
    timer_end(gl, &timer, 3);
    assert_true(take_after_finish(gl, &timer, &seconds, &tag));
    assert_true(tag == 2);
    assert_false(timer_take(gl, &timer, &seconds, &tag));
    timer_free(gl, &timer);
}

static void queries_are_made_once_and_freed(void **state) {
    struct spy spy;
    struct timer timer = {0};
    double seconds;
    float tag;
    spy_on(context_with_timestamps(state), &spy);
    assert_int_equal(timer_object_count(&timer), 0);
    for (int i = 0; i < 5 * TIMER_FRAMES; i++) {
        time_frame(&spy.gl, &timer, 1);
        if (i % 3 == 0) take_after_finish(&spy.gl, &timer, &seconds, &tag);
        assert_int_equal(timer_object_count(&timer), 2 * TIMER_FRAMES);
    }
    assert_int_equal(seen.generated, 1);
    assert_int_equal(seen.stamped, 2 * 5 * TIMER_FRAMES);
    const GLuint query = timer.frames[0].begin;
    assert_true(glIsQuery(query));
    timer_free(&spy.gl, &timer);
    assert_int_equal(seen.deleted, 2 * TIMER_FRAMES);
    assert_false(glIsQuery(query));
    assert_int_equal(timer_object_count(&timer), 0);
    timer_free(&spy.gl, &timer);
    assert_int_equal(seen.deleted, 2 * TIMER_FRAMES);
}

static void an_abandoned_timer_makes_no_call(void **state) {
    struct spy spy;
    struct timer timer = {0};
    spy_on(context_with_timestamps(state), &spy);
    time_frame(&spy.gl, &timer, 1);
    const struct timer kept = timer;
    timer_free(NULL, &timer);
    assert_int_equal(seen.deleted, 0);
    assert_int_equal(timer_object_count(&timer), 0);
    timer = kept;
    timer_free(&spy.gl, &timer);
}

/* A result that is asked for before it is there makes the caller wait. */
static void results_are_read_only_when_they_are_there(void **state) {
    struct spy spy;
    struct timer timer = {0};
    double seconds;
    float tag;
    spy_on(context_with_timestamps(state), &spy);
    fake_results(&spy);
    for (int i = 0; i < 3 * TIMER_FRAMES; i++) {
        time_frame(&spy.gl, &timer, (float)i);
        assert_false(timer_take(&spy.gl, &timer, &seconds, &tag));
    }
    assert_int_equal(seen.read, 0);
    seen.available = true;
    seen.results[0] = UINT64_C(7000000000);
    seen.results[1] = UINT64_C(9500000000);
    assert_true(timer_take(&spy.gl, &timer, &seconds, &tag));
    assert_true(tag == TIMER_FRAMES - 1);
    assert_true(seconds == 1e-9 * 2.5e9); /* the thread took less: it had nothing to do */
    timer_free(&spy.gl, &timer);
}

/* 36 bits of nanoseconds last for 68 seconds. */
static void a_counter_may_start_again(void **state) {
    struct spy spy;
    struct timer timer = {0};
    double seconds;
    float tag;
    spy_on(context_with_timestamps(state), &spy);
    fake_results(&spy);
    const int bits[] = {36, 64};
    for (size_t i = 0; i < sizeof bits / sizeof *bits; i++) {
        spy.gl.timestamp_bits = bits[i];
        seen.available = true;
        seen.read = 0;
        seen.results[0] = (bits[i] < 64 ? UINT64_C(1) << bits[i] : 0) - UINT64_C(5000000000);
        seen.results[1] = UINT64_C(3000000000);
        time_frame(&spy.gl, &timer, 1);
        assert_true(timer_take(&spy.gl, &timer, &seconds, &tag));
        assert_true(seconds == 1e-9 * 8e9);
    }
    timer_free(&spy.gl, &timer);
}

/* The thread's time counts where it is longer, and alone where there are no timestamps. A sleep is never shorter than it should. */
static void the_thread_s_time_counts_too(void **state) {
    const struct timespec nap = {0, 3000000};
    for (int with = 0; with < 2; with++) {
        struct gl gl = *context_of(state);
        struct timer timer = {0};
        double seconds = 0;
        float tag = 0;
        if (!with) gl.timestamp_bits = 0;
        timer_begin(&gl, &timer);
        assert_int_equal(nanosleep(&nap, NULL), 0);
        timer_end(&gl, &timer, 5);
        if (with) glFinish();
        assert_true(timer_take(&gl, &timer, &seconds, &tag));
        assert_true(seconds >= 0.003 && tag == 5);
        if (!with) assert_int_equal(timer_object_count(&timer), 0);
        timer_free(&gl, &timer);
    }
}

/* The host's own query of elapsed time goes on, and ours work within it. */
static void a_running_query_of_the_host_is_not_disturbed(void **state) {
    const struct gl *gl = context_with_timestamps(state);
    struct timer timer = {0};
    double seconds;
    float tag = 0;
    GLuint query = 0, elapsed = 0;
    struct target target;
    need(!context_is_es(), "function to ask for elapsed time by its desktop name");
    assert_true(target_create(&target, 64, 64, GL_RGBA8, 0, 0));
    glGenQueries(1, &query);
    glBeginQuery(GL_TIME_ELAPSED, query);
    time_frame(gl, &timer, 1);
    target_clear(&target, (const float[4]){1, 1, 1, 1}, 1);
    assert_true(take_after_finish(gl, &timer, &seconds, &tag));
    glEndQuery(GL_TIME_ELAPSED);
    expect_no_gl_error("within a query");
    glGetQueryObjectuiv(query, GL_QUERY_RESULT, &elapsed);
    assert_true(elapsed > 0);
    glDeleteQueries(1, &query);
    target_destroy(&target);
    timer_free(gl, &timer);
}

/* While a buffer for results is bound they go there instead of where the pointer points to. */
static void a_buffer_for_results_of_the_host_stays_as_it_is(void **state) {
    const struct gl *gl = context_of(state);
    const GLuint fill[4] = {0xabcdef01, 0xabcdef01, 0xabcdef01, 0xabcdef01};
    struct timer timer = {0};
    double seconds = -1;
    float tag = 0;
    GLuint buffer = 0, after[4] = {0};
    GLint bound = 0;
    need(gl->has_query_buffer, "buffers for results");
    glGenBuffers(1, &buffer);
    glBindBuffer(GL_QUERY_BUFFER, buffer);
    glBufferData(GL_QUERY_BUFFER, sizeof fill, fill, GL_DYNAMIC_READ);
    time_frame(gl, &timer, 1);
    assert_true(take_after_finish(gl, &timer, &seconds, &tag));
    assert_true(seconds >= 0 && tag == 1);
    glGetIntegerv(GL_QUERY_BUFFER_BINDING, &bound);
    assert_int_equal(bound, buffer);
    glGetBufferSubData(GL_QUERY_BUFFER, 0, sizeof after, after);
    assert_memory_equal(after, fill, sizeof fill);
    glBindBuffer(GL_QUERY_BUFFER, 0);
    glDeleteBuffers(1, &buffer);
    timer_free(gl, &timer);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        GL_TEST(timestamps_are_found_where_they_are),
        GL_TEST(a_frame_s_time_comes_once_with_its_tag),
        GL_TEST(the_default_lookup_finds_the_functions_too),
        GL_TEST(the_newest_time_is_given_and_older_ones_are_dropped),
        GL_TEST(frames_beyond_the_ring_are_not_timed),
        GL_TEST(a_frame_that_does_not_end_is_forgotten),
        GL_TEST(queries_are_made_once_and_freed),
        GL_TEST(an_abandoned_timer_makes_no_call),
        GL_TEST(results_are_read_only_when_they_are_there),
        GL_TEST(a_counter_may_start_again),
        GL_TEST(the_thread_s_time_counts_too),
        GL_TEST(a_running_query_of_the_host_is_not_disturbed),
        GL_TEST(a_buffer_for_results_of_the_host_stays_as_it_is),
    };
    return RUN_GL_TESTS("timer", tests);
}
