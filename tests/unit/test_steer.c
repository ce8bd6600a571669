/* The threshold that follows a frame time. SPDX-License-Identifier: MIT */
#include "support.h"

#include "lod/steer.h"

enum { LONGEST_DELAY = 4, EXPONENTS = 3 };

static const double TARGET = 0.016, FINEST = 1;

/* A frame takes fixed + load / threshold^exponent seconds, and its time is known `delay` frames later, give or take `noise` of it,
 * unless it is lost. */
struct machine {
    double fixed, load;
    int exponent, delay;
    double noise;
    double lost;       /* probability */
    int outlier_every; /* this frame seems three times as slow */
};

struct simulation {
    struct machine machine;
    struct steer steer;
    double finest, target;
    uint64_t seed;
    int frame;
    double tags[LONGEST_DELAY + 1], seconds[LONGEST_DELAY + 1]; /* by frame, in turn; 0 = not measured */
};

static struct simulation start(struct machine machine) {
    return (struct simulation){.machine = machine, .finest = FINEST, .target = TARGET, .seed = 7};
}

static double frame_seconds(const struct machine *machine, double threshold) {
    return machine->fixed + machine->load / pow(threshold, machine->exponent);
}

static double measured(struct simulation *s, double threshold) {
    const struct machine *machine = &s->machine;
    double seconds = frame_seconds(machine, threshold) * (1 + machine->noise * (2 * uniform(&s->seed) - 1));
    if (machine->outlier_every && s->frame % machine->outlier_every == 0) seconds *= 3;
    return uniform(&s->seed) < machine->lost ? 0 : seconds;
}

static struct steer_output step(struct simulation *s, bool moves) {
    const int known = (s->frame + LONGEST_DELAY + 1 - s->machine.delay) % (LONGEST_DELAY + 1), now = s->frame % (LONGEST_DELAY + 1);
    const struct steer_input input = {
        .finest = s->finest, .target = s->target, .moves = moves, .seconds = s->seconds[known], .tag = s->tags[known]};
    const struct steer_output output = steer(&s->steer, &input);
    assert_true(output.threshold >= s->finest);
    assert_true(output.threshold <= fmax(s->finest, STEER_LARGEST));
    assert_int_equal(output.is_finest, output.threshold == s->finest);
    s->tags[now] = output.tag;
    s->seconds[now] = measured(s, output.threshold);
    s->frame++;
    return output;
}

static struct steer_output run(struct simulation *s, int frames, bool moves) {
    struct steer_output output = {0};
    for (int i = 0; i < frames; i++) output = step(s, moves);
    return output;
}

/* Of a frame's time, from the last motion's threshold. */
static double load_now(const struct simulation *s) {
    return frame_seconds(&s->machine, s->steer.moving) / s->target;
}

static bool is_near_target(const struct simulation *s) {
    return load_now(s) > 0.9 - 1e-9 && load_now(s) < 1.1 + 1e-9;
}

/* Moves for so many frames: how many pass until the time stays in the band, and how often the threshold changes its direction. */
struct response {
    int settled, turns;
};

static struct response respond(struct simulation *s, int frames) {
    struct response response = {0, 0};
    double before = s->frame ? s->steer.moving : STEER_FIRST, direction = 0;
    for (int i = 0; i < frames; i++) {
        const double change = step(s, true).threshold - before;
        if (change * direction < 0) response.turns++;
        if (change != 0) direction = change;
        before += change;
        if (!is_near_target(s)) response.settled = i + 1;
    }
    return response;
}

/* A machine that meets the target at this threshold, with this part of its time fixed. */
static struct machine machine_at(double threshold, double fixed, int exponent, int delay) {
    return (struct machine){
        .fixed = fixed * TARGET, .load = (1 - fixed) * TARGET * pow(threshold, exponent), .exponent = exponent, .delay = delay};
}

/* All votes are known delay + STEER_VOTES - 1 frames after the change. To coarser one step suffices, to finer it takes two. */
static void a_step_of_the_load_is_followed_from_one_side(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++)
        for (int change = 0; change < 2; change++) {
            struct simulation s = start(machine_at(change ? 12 : 6, 0, 2, delay));
            respond(&s, 100);
            assert_true(is_near_target(&s));
            s.machine.load *= change ? 0.25 : 4;
            const struct response response = respond(&s, 100);
            assert_true(is_near_target(&s));
            assert_int_equal(response.turns, 0);
            assert_true(response.settled > 0 && response.settled <= delay + STEER_VOTES);
        }
}

/* Where less of the time depends on the threshold each step leaves a part of the way, with exponent 1 half of it (in logarithms);
 * the next can be voted on only when the frames after it are known. */
static void a_part_that_does_not_depend_on_the_threshold_slows_it_down_only(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++)
        for (int exponent = 1; exponent <= 2; exponent++)
            for (int change = 0; change < 2; change++) {
                struct simulation s = start(machine_at(change ? 12 : 6, exponent == 2 ? 0.5 : 0, exponent, delay));
                respond(&s, 200);
                assert_true(is_near_target(&s));
                s.machine.load *= change ? 0.25 : 4;
                const struct response response = respond(&s, 200);
                assert_true(is_near_target(&s));
                assert_int_equal(response.turns, 0);
                assert_true(response.settled > 0 && response.settled <= (exponent == 2 ? 4 : 5) * (delay + STEER_VOTES - 1));
            }
}

/* What cannot be steered ends at a limit, and leaves it as soon as it can. */
static void an_unreachable_target_is_not_wound_up(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++) {
        struct simulation s = start((struct machine){.fixed = 3 * TARGET, .load = TARGET, .exponent = 2, .delay = delay});
        assert_int_equal(respond(&s, 60).turns, 0);
        for (int i = 0; i < 1000; i++) assert_true(step(&s, true).threshold == STEER_LARGEST);
        s.machine.fixed = 0.1 * TARGET;
        assert_true(run(&s, delay + STEER_VOTES, true).threshold < STEER_LARGEST);
        s.machine.load = 0;
        for (int i = 0; i < 100; i++) step(&s, true);
        assert_true(step(&s, true).threshold == FINEST);
        for (int i = 0; i < 1000; i++) step(&s, true);
        s.machine.load = 16 * TARGET;
        assert_true(run(&s, delay + STEER_VOTES, true).threshold > FINEST);
    }
}

static void constant_times_lead_to_a_limit_or_are_left_alone(void **state) {
    (void)state;
    const double loads[] = {0.5, 0.95, 1.05, 2};
    const double ends[] = {FINEST, STEER_FIRST, STEER_FIRST, STEER_LARGEST};
    for (size_t i = 0; i < COUNT(loads); i++)
        for (int delay = 1; delay <= LONGEST_DELAY; delay++) {
            struct simulation s = start((struct machine){.load = loads[i] * TARGET, .delay = delay});
            assert_int_equal(respond(&s, 100).turns, 0);
            assert_true(step(&s, true).threshold == ends[i]);
        }
}

/* Times seem off by up to 15 %. Those that agree move the threshold where 0.85 t > 1.1 T or 1.15 t < 0.9 T at the latest: t > 1.294
 * T, t < 0.783 T. A move goes no farther than one measurement, at most 15 % beyond the target. */
static void noise_moves_little(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++)
        for (int exponent = 1; exponent <= 2; exponent++) {
            struct machine machine = machine_at(8, 0.1, exponent, delay);
            machine.noise = 0.15;
            machine.lost = 0.3;
            struct simulation s = start(machine);
            for (int step_of_load = 0; step_of_load < 2; step_of_load++) {
                respond(&s, 100);
                for (int i = 0; i < 1000; i++) {
                    assert_true(load_now(&s) > 0.78 && load_now(&s) < 1.3);
                    step(&s, true);
                }
                s.machine.load *= 4;
            }
        }
}

/* A time at the target seems beyond one side of the band with probability 1/6; all votes do once in 1300 frames. */
static void noise_turns_the_threshold_seldom(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++) {
        struct machine machine = machine_at(8, 0.1, 2, delay);
        machine.noise = 0.15;
        struct simulation s = start(machine);
        respond(&s, 100);
        assert_in_range(respond(&s, 2000).turns, 0, 20);
    }
}

/* The same thresholds as without them, but perhaps a little later. */
static void single_outliers_are_not_seen(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++) {
        struct machine machine = machine_at(8, 0.2, 2, delay);
        machine.outlier_every = 7;
        struct simulation s = start(machine);
        assert_int_equal(respond(&s, 100).turns, 0);
        assert_true(is_near_target(&s));
        const double threshold = s.steer.moving;
        for (int i = 0; i < 200; i++) assert_true(step(&s, true).threshold == threshold);
        s.machine.load *= 0.25;
        assert_int_equal(respond(&s, 100).turns, 0);
        assert_true(is_near_target(&s));
    }
}

/* Half of them, for instance because queries are late. */
static void lost_measurements_cost_time_only(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++) {
        struct machine machine = machine_at(6, 0.2, 2, delay);
        machine.lost = 0.5;
        struct simulation s = start(machine);
        assert_int_equal(respond(&s, 200).turns, 0);
        assert_true(is_near_target(&s));
        s.machine.load *= 4;
        assert_int_equal(respond(&s, 200).turns, 0);
        assert_true(is_near_target(&s));
    }
}

static void without_measurements_the_threshold_stays(void **state) {
    (void)state;
    struct simulation s = start((struct machine){.load = 100, .exponent = 2, .delay = 1, .lost = 1});
    for (int i = 0; i < 100; i++) assert_true(step(&s, true).threshold == STEER_FIRST);
}

static void what_is_no_measurement_is_ignored(void **state) {
    (void)state;
    const double bad[] = {0, -1, NAN, INFINITY, -INFINITY};
    struct steer steered = {0};
    for (size_t i = 0; i < COUNT(bad); i++)
        for (int k = 0; k < 10; k++) {
            const struct steer_input seconds = {FINEST, TARGET, true, bad[i], 4}, tag = {FINEST, TARGET, true, 1, bad[i]};
            assert_true(steer(&steered, &seconds).threshold == STEER_FIRST);
            assert_true(steer(&steered, &tag).threshold == STEER_FIRST);
        }
    /* Finite, but their product is not. */
    const struct steer_input huge = {FINEST, TARGET, true, 1e308, 1e308};
    for (int k = 0; k < 10; k++) assert_true(steer(&steered, &huge).threshold == STEER_FIRST);
    const struct steer_input good = {FINEST, TARGET, true, 1, 4};
    for (int k = 0; k < STEER_VOTES; k++) assert_true(steer(&steered, &good).threshold == (k < STEER_VOTES - 1 ? 4 : 8));
}

static void rest_refines_by_a_root_of_two_to_the_finest(void **state) {
    (void)state;
    struct simulation s = start(machine_at(11, 0.1, 2, 2));
    double before = run(&s, 100, true).threshold;
    assert_true(before > 10);
    for (int frames = 0; before > FINEST; frames++) {
        const struct steer_output output = step(&s, false);
        assert_true(output.tag == 0);
        assert_true(frames < 8); /* 2 log2 11 = 6.9 */
        if (output.is_finest) assert_true(output.threshold == FINEST && before / sqrt(2) < 1.01 * FINEST);
        else assert_true(fabs(output.threshold - before / sqrt(2)) < 1e-12 * before);
        before = output.threshold;
    }
    for (int i = 0; i < 100; i++) assert_true(step(&s, false).is_finest);
}

/* From 4 pixels four steps lead to one, rounding or not. */
static void a_view_that_has_never_moved_refines_too(void **state) {
    (void)state;
    struct simulation s = start((struct machine){.load = 1, .exponent = 2, .delay = 1});
    run(&s, 3, false);
    assert_false(s.steer.drawn == FINEST);
    assert_true(step(&s, false).is_finest);
}

/* Refining frames take longer; when motion begins again, some of them have only just become known. */
static void motion_goes_on_where_it_ended(void **state) {
    (void)state;
    for (int delay = 1; delay <= LONGEST_DELAY; delay++)
        for (int rest = 1; rest < 40; rest++) {
            struct simulation s = start(machine_at(10, 0.1, 2, delay));
            const double moving = run(&s, 100, true).threshold;
            for (int again = 0; again < 3; again++) {
                assert_true(run(&s, rest, false).threshold < moving);
                for (int i = 0; i < 20; i++) {
                    const struct steer_output output = step(&s, true);
                    assert_true(output.threshold == moving && output.tag == moving);
                }
            }
        }
}

/* What is known of the load holds for any target. */
static void another_target_is_met_at_once(void **state) {
    (void)state;
    struct simulation s = start(machine_at(8, 0, 2, 3));
    respond(&s, 100);
    s.target = TARGET / 4;
    step(&s, true);
    assert_true(is_near_target(&s));
    s.target = TARGET;
    assert_false(is_near_target(&s));
    run(&s, 2, true); /* the largest step to finer is half as large */
    assert_true(is_near_target(&s));
}

static void the_finest_may_change_at_any_time(void **state) {
    (void)state;
    struct simulation s = start(machine_at(3, 0, 2, 2));
    respond(&s, 100);
    s.finest = 5;
    assert_true(step(&s, true).threshold == 5);
    s.finest = 100; /* above the largest: what the host asks for comes first */
    assert_true(step(&s, true).threshold == 100);
    assert_true(step(&s, false).threshold == 100);
    s.finest = 0.5;
    assert_true(step(&s, false).threshold == STEER_LARGEST);
    assert_true(run(&s, 20, false).threshold == 0.5);
    s.finest = 2;
    assert_true(step(&s, false).threshold == 2);
    respond(&s, 100);
    assert_true(is_near_target(&s));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_step_of_the_load_is_followed_from_one_side),
        cmocka_unit_test(a_part_that_does_not_depend_on_the_threshold_slows_it_down_only),
        cmocka_unit_test(an_unreachable_target_is_not_wound_up),
        cmocka_unit_test(constant_times_lead_to_a_limit_or_are_left_alone),
        cmocka_unit_test(noise_moves_little),
        cmocka_unit_test(noise_turns_the_threshold_seldom),
        cmocka_unit_test(single_outliers_are_not_seen),
        cmocka_unit_test(lost_measurements_cost_time_only),
        cmocka_unit_test(without_measurements_the_threshold_stays),
        cmocka_unit_test(what_is_no_measurement_is_ignored),
        cmocka_unit_test(rest_refines_by_a_root_of_two_to_the_finest),
        cmocka_unit_test(a_view_that_has_never_moved_refines_too),
        cmocka_unit_test(motion_goes_on_where_it_ended),
        cmocka_unit_test(another_target_is_met_at_once),
        cmocka_unit_test(the_finest_may_change_at_any_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
