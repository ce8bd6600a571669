/* The threshold from frames' times. SPDX-License-Identifier: MIT
 *
 * Let a frame take time t(h) at threshold h, with t falling no faster than 1 / h^2 (number of nodes, if all else is free), and h*
 * be the threshold that meets the target T. For a measured frame, h sqrt(t(h) / T) lies between h and h*, whatever t and whenever
 * it is known. The threshold moves only if the last STEER_VOTES of these lie on one side of it, and then no farther than the
 * nearest. So it approaches h* from one side, and cannot oscillate. */
#include "steer.h"

#include <math.h>

/* Times within a tenth of the target are left alone: a picture that keeps changing is seen, a tenth of a frame is not. */
static const double TOO_SLOW = 1.1, TOO_FAST = 0.9;
/* The largest steps, factors: coarser at once, or the next frames are late, too; finer with care. At rest it is the step. */
static const double STEP_COARSER = 2, STEP_FINER = 0.70710678118654752;
/* Of the finest: a last step that nobody would see is not worth a frame. */
static const double CLOSE_ENOUGH = 1.01;

static double clamp(double threshold, double finest) {
    return fmax(fmin(threshold, STEER_LARGEST), finest);
}

/* False if it is none. */
static bool take_measurement(struct steer *state, const struct steer_input *input) {
    const double need = input->tag * sqrt(input->seconds);
    if (!(input->seconds > 0) || !(input->tag > 0) || !isfinite(need)) return false;
    state->need[state->next] = need;
    state->next = (state->next + 1) % STEER_VOTES;
    if (state->votes < STEER_VOTES) state->votes++;
    return true;
}

/* The nearest of what the last measurements ask for, if all of them do on the same side; else the threshold as it is. */
static double agreed(const struct steer *state, double threshold, double target) {
    double least = state->need[0], most = state->need[0];
    if (state->votes < STEER_VOTES) return threshold;
    for (int i = 1; i < STEER_VOTES; i++) {
        least = fmin(least, state->need[i]);
        most = fmax(most, state->need[i]);
    }
    least /= sqrt(target);
    most /= sqrt(target);
    if (least * least > TOO_SLOW * threshold * threshold) return fmin(least, STEP_COARSER * threshold);
    if (most * most < TOO_FAST * threshold * threshold) return fmax(most, STEP_FINER * threshold);
    return threshold;
}

static double refined(double threshold, double finest) {
    threshold *= STEP_FINER;
    return threshold < CLOSE_ENOUGH * finest ? finest : threshold;
}

double steer_threshold(const struct steer *state, double finest) {
    return clamp(state->drawn > 0 ? state->drawn : STEER_FIRST, finest);
}

struct steer_output steer(struct steer *state, const struct steer_input *input) {
    if (state->moving == 0) state->moving = state->drawn = STEER_FIRST;
    /* At rest, too, when the last frames in motion become known; refining ones have no tag. */
    const bool is_measured = take_measurement(state, input);
    if (input->moves) {
        state->moving = clamp(state->moving, input->finest);
        if (is_measured) state->moving = clamp(agreed(state, state->moving, input->target), input->finest);
        state->drawn = state->moving;
    } else {
        state->drawn = clamp(refined(state->drawn, input->finest), input->finest);
    }
    return (struct steer_output){
        .threshold = state->drawn, .tag = input->moves ? state->drawn : 0, .is_finest = state->drawn <= input->finest};
}
