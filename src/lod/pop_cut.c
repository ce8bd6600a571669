/* Cuts of POP hierarchies, from the root or from the last cut. SPDX-License-Identifier: MIT */
#include "pop_cut.h"

#include <float.h>
#include <string.h>

#include "core/matrix.h"
#include "qsplat.h"

/* For good, whatever the motion. */
static const double ALWAYS = INFINITY;

/* What is known of a node: whether it stops, how, and by how much. */
struct verdict {
    bool stops;
    enum pop_fate fate;
    double slack; /* the motion after which this may be another */
};

struct cutting {
    pbr_instance *instance;
    const struct pop *pop;
    const struct question *q;
    const atomic_bool *cancel;
    struct pop_cut *cut; /* made anew from: */
    const struct pop_front_node *old;
    size_t old_count;
    float cones[POP_NO_CONE][2]; /* cosine and sine */
    pbr_result result;
};

/* ---- One node ---- */

/* Below 0: outside. */
static float outside_value(const struct question *q, const struct pop_ball *b) {
    float least = FLT_MAX;
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const float own = side_value(&q->outside[i], b->centre) + (q->outside[i].reach * b->radius + q->error);
        const float wide = side_value(&q->wider[i], b->centre) + (q->wider[i].reach * b->radius + q->error);
        least = fminf(least, fmaxf(own, wide));
    }
    return least;
}

/* Below 0: GL points may not draw it. */
static float point_value(const struct question *q, const struct pop_ball *b, float w) {
    const float farthest = w + q->w.reach * b->radius;
    float least = w - q->w.reach * b->radius - q->error;
    for (int i = 0; i < q->inside_count; i++) {
        const struct side *f = &q->inside[i];
        least = fminf(least, side_value(f, b->centre) - f->reach * b->radius - f->per_w * farthest - q->error);
    }
    return q->point > 0 ? fminf(least, w * q->w_kept - q->w_lost - b->radius / q->point) : -FLT_MAX;
}

/* Below 0: too large for a point. */
static float size_value(const struct question *q, const struct pop_ball *b, float w) {
    const float distance = fmaxf(w, q->w_least);
    return q->threshold > 0 ? distance - q->size / q->threshold * b->radius : -FLT_MAX;
}

/* Below 0: faces away. */
static float away_value(const struct cutting *c, const struct pop_node *node, const struct pop_ball *b) {
    int16_t code[2];
    float axis[3];
    const uint32_t cone = pop_cone(node);
    if (!c->q->culls || cone == POP_NO_CONE) return FLT_MAX;
    pop_decode_normal(node, code);
    splat_decode_normal(code, axis);
    return question_facing(c->q, axis, c->cones[cone][0], c->cones[cone][1], b->centre, b->radius).most;
}

/* Less what rounding may be of it, relative to the value and to all. */
static double slack_of(const struct cutting *c, enum pop_question asked, float value) {
    return fabs((double)value) * c->cut->scales[asked] * (1 - 1e-4) - 2 * c->cut->errors[asked];
}

static struct verdict judge(const struct cutting *c, uint32_t level, const struct pop_node *node) {
    const struct question *q = c->q;
    const struct pop_ball ball = pop_decode_ball(c->pop, node);
    const float outside = outside_value(q, &ball);
    if (outside < 0) return (struct verdict){true, POP_CULLED, slack_of(c, POP_ASKS_PLANES, outside)};
    const float away = away_value(c, node, &ball);
    if (away < 0) return (struct verdict){true, POP_CULLED, slack_of(c, POP_ASKS_FACING, away)};
    const float w = side_value(&q->w, ball.centre), size = size_value(q, &ball, w);
    struct verdict verdict = {level == 0, POP_TRIANGLE,
                              fmin(slack_of(c, POP_ASKS_PLANES, outside), slack_of(c, POP_ASKS_SIZE, size))};
    if (away < FLT_MAX) verdict.slack = fmin(verdict.slack, slack_of(c, POP_ASKS_FACING, away));
    /* Of a ball without extent at the eye, which has no size. */
    if (size < 0 || !(fmaxf(w, q->w_least) > 0)) return verdict;
    const float point = point_value(q, &ball, w);
    return (struct verdict){true, point < 0 ? POP_QUAD : POP_POINT, fmin(verdict.slack, slack_of(c, POP_ASKS_PLANES, point))};
}

/* ---- The front ---- */

static bool make_room(struct cutting *c) {
    struct pop_cut *cut = c->cut;
    const size_t capacity = cut->capacity ? 2 * cut->capacity : 1024;
    struct pop_front_node *grown = pbr_reallocate(c->instance, cut->nodes, cut->capacity, capacity, sizeof *grown);
    if (!grown) {
        c->result = PBR_ERROR_OUT_OF_MEMORY;
        return false;
    }
    cut->nodes = grown;
    cut->capacity = capacity;
    return true;
}

static inline void append(struct cutting *c, struct pop_front_node node) {
    struct pop_cut *cut = c->cut;
    if (cut->node_count == cut->capacity && !make_room(c)) return;
    cut->nodes[cut->node_count++] = node;
    cut->counts[node.fate]++;
}

static inline bool is_cancelled(const struct cutting *c) {
    return c->cancel && atomic_load_explicit(c->cancel, memory_order_relaxed);
}

/* Looks at a node. True if it stops, and is now the front's; else, `*until` is no later than what is known of it holds. */
static bool visit(struct cutting *c, uint32_t level, uint32_t index, double *until) {
    c->cut->visited++;
    const struct verdict verdict = judge(c, level, pop_node_at(c->pop, level, index));
    *until = fmin(*until, c->cut->motion + verdict.slack);
    if (verdict.stops)
        append(c, (struct pop_front_node){.index = index, .level = (uint8_t)level, .fate = (uint8_t)verdict.fate, .until = *until});
    return verdict.stops;
}

/* The cut of the node and all below. `until`: of those above whose first it is. */
static void walk(struct cutting *c, uint32_t level, uint32_t index, double until) {
    if (c->result != PBR_OK || visit(c, level, index, &until)) return;
    uint64_t first;
    const uint32_t count = pop_children(&c->pop->shape, level, index, &first);
    if (level > 3 && is_cancelled(c)) c->result = PBR_ERROR_CANCELLED;
    for (uint32_t i = 0; i < count; i++) walk(c, level - 1, (uint32_t)first + i, i == 0 ? until : ALWAYS);
}

/* Those above a node whose first node it is, the node itself included, from below. */
static uint32_t find_firsts(const struct pop_shape *shape, const struct pop_front_node *node, uint32_t chain[POP_LEVELS]) {
    uint32_t count = 1;
    chain[0] = node->index;
    for (uint32_t level = node->level; level + 1 < shape->level_count; level++) {
        uint64_t first;
        const uint64_t parent = pop_parent(shape, level, chain[count - 1]);
        pop_children(shape, level + 1, parent, &first);
        if (first != chain[count - 1]) break;
        chain[count++] = (uint32_t)parent;
    }
    return count;
}

static bool is_below(const struct pop_shape *shape, const struct pop_front_node *node, uint32_t level, uint32_t index) {
    uint64_t above = node->index;
    for (uint32_t l = node->level; l < level; l++) above = pop_parent(shape, l, above);
    return node->level <= level && above == index;
}

/* The first of the old front's nodes from `at` on that is not below a node which `at` is: by steps that double, then by halves. */
static size_t skip_below(const struct cutting *c, size_t at, uint32_t level, uint32_t index) {
    const struct pop_shape *shape = &c->pop->shape;
    size_t step = 1, low = at; /* below it for certain */
    while (low + step < c->old_count && is_below(shape, &c->old[low + step], level, index)) low += step, step *= 2;
    size_t high = low + step < c->old_count ? low + step : c->old_count;
    while (low + 1 < high) {
        const size_t middle = low + (high - low) / 2;
        if (is_below(shape, &c->old[middle], level, index)) low = middle;
        else high = middle;
    }
    return high;
}

/* Looks again at the old front's node and at all above it that it is the first of. Returns the first one that is not dealt with. */
static size_t renew(struct cutting *c, size_t at) {
    const struct pop_front_node *node = &c->old[at];
    uint32_t chain[POP_LEVELS];
    double until = ALWAYS;
    for (uint32_t i = find_firsts(&c->pop->shape, node, chain); i-- > 1;)
        if (visit(c, node->level + i, chain[i], &until)) return skip_below(c, at, node->level + i, chain[i]);
    walk(c, node->level, node->index, until);
    return at + 1;
}

static void update(struct cutting *c) {
    enum { OFTEN = 1 << 10 };
    for (size_t i = 0; i < c->old_count && c->result == PBR_OK;) {
        if (i % OFTEN == 0 && is_cancelled(c)) c->result = PBR_ERROR_CANCELLED;
        if (c->old[i].until > c->cut->motion) append(c, c->old[i++]);
        else i = renew(c, i);
    }
}

/* ---- Motion ---- */

/* How far what is asked may change from one view to the next, over a ball around the centre: balls' centres lie within `span` of
 * it, their radii are no larger than `span`. */
struct change {
    double span;
    const struct question *from, *to;
};

/* Of a plane's value. */
static double side_change(const struct change *change, const struct side *a, const struct side *b) {
    double squared = 0;
    for (int k = 0; k < 3; k++) squared += pow((double)b->normal[k] - (double)a->normal[k], 2);
    return sqrt(squared) * change->span + fabs((double)b->offset - (double)a->offset) +
           fabs((double)b->reach - (double)a->reach) * change->span;
}

static double largest_w(const struct change *change, const struct side *w) {
    double squared = 0;
    for (int k = 0; k < 3; k++) squared += pow((double)w->normal[k], 2);
    return (sqrt(squared) + (double)w->reach) * change->span + fabs((double)w->offset);
}

static double per_pixel(const struct question *q) {
    return (double)(q->size / q->threshold);
}

static double planes_change(const struct change *change) {
    const struct question *a = change->from, *b = change->to;
    const double w = side_change(change, &a->w, &b->w), most_w = fmax(largest_w(change, &a->w), largest_w(change, &b->w));
    double most = w;
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        most = fmax(most, side_change(change, &a->outside[i], &b->outside[i]));
        most = fmax(most, side_change(change, &a->wider[i], &b->wider[i]));
    }
    for (int i = 0; i < a->inside_count; i++) {
        const double per_w = fabs((double)b->inside[i].per_w - (double)a->inside[i].per_w);
        const double own = side_change(change, &a->inside[i], &b->inside[i]);
        most = fmax(most, own + per_w * most_w + fabs((double)b->inside[i].per_w) * w);
    }
    if (a->point > 0)
        most = fmax(most, fabs((double)b->w_kept - (double)a->w_kept) * most_w + fabs((double)b->w_kept) * w +
                              fabs((double)b->w_lost - (double)a->w_lost) +
                              fabs(1 / (double)b->point - 1 / (double)a->point) * change->span);
    return most + fabs((double)b->error - (double)a->error);
}

static double size_change(const struct change *change) {
    const struct question *a = change->from, *b = change->to;
    if (!(a->threshold > 0)) return 0;
    return side_change(change, &a->w, &b->w) + fabs((double)b->w_least - (double)a->w_least) +
           fabs(per_pixel(b) - per_pixel(a)) * change->span;
}

static double facing_change(const struct change *change) {
    const struct question *a = change->from, *b = change->to;
    double d[3];
    if (!a->culls) return 0;
    for (int k = 0; k < 3; k++) d[k] = (double)b->eye[k] - (double)a->eye[k];
    return length3(d) * (1 + 2e-4) + fabs((double)b->eye_room - (double)a->eye_room);
}

/* What jumps rather than changes. */
static bool is_comparable(const struct question *a, const struct question *b) {
    return a->inside_count == b->inside_count && a->culls == b->culls && (a->threshold > 0) == (b->threshold > 0) &&
           (a->point > 0) == (b->point > 0) && a->eye[3] == b->eye[3];
}

static double eye_distance(const struct question *q) {
    const double eye[3] = {(double)q->eye[0], (double)q->eye[1], (double)q->eye[2]};
    return length3(eye);
}

/* Of facing, the sine is the root of a difference. */
static void find_errors(const struct question *q, double span, const double scales[POP_QUESTIONS], double errors[POP_QUESTIONS]) {
    errors[POP_ASKS_PLANES] = scales[POP_ASKS_PLANES] * (double)q->error;
    errors[POP_ASKS_SIZE] = scales[POP_ASKS_SIZE] * (double)q->error;
    errors[POP_ASKS_FACING] = q->culls ? scales[POP_ASKS_FACING] * 1e-3 * (eye_distance(q) + span * fabs((double)q->eye[3])) : 0;
}

static double steepness(const struct side *side) {
    const double normal[3] = {(double)side->normal[0], (double)side->normal[1], (double)side->normal[2]};
    return length3(normal);
}

/* Object units; of facing, as if the eye were as near as the hierarchy is large. Any scales are right. */
static void choose_scales(const struct question *q, double span, double scales[POP_QUESTIONS]) {
    double steepest = 0;
    for (int i = 0; i < OUTSIDE_TESTS; i++) steepest = fmax(steepest, steepness(&q->outside[i]));
    scales[POP_ASKS_PLANES] = 1 / steepest;
    scales[POP_ASKS_SIZE] = 1 / steepness(&q->w);
    scales[POP_ASKS_FACING] = span / fmax(span, eye_distance(q));
    for (int i = 0; i < POP_QUESTIONS; i++)
        if (!isfinite(scales[i])) scales[i] = 1;
}

/* Adds what the view has moved to the cut's motion. False if nothing is known of what it was before. */
static bool move(const struct pop *pop, const struct question *q, struct pop_cut *cut) {
    const struct change change = {pop->radius * (1 + 1e-6), &cut->question, q};
    double errors[POP_QUESTIONS], motion;
    if (cut->node_count == 0 || !is_comparable(&cut->question, q)) return false;
    find_errors(q, pop->radius, cut->scales, errors);
    for (int i = 0; i < POP_QUESTIONS; i++)
        if (!(errors[i] <= cut->errors[i])) return false;
    motion = fmax(cut->scales[POP_ASKS_PLANES] * planes_change(&change), cut->scales[POP_ASKS_SIZE] * size_change(&change));
    motion = fmax(motion, cut->scales[POP_ASKS_FACING] * facing_change(&change));
    if (!(cut->motion + motion < 1e6 * pop->radius)) return false; /* while until - motion is exact enough */
    cut->motion += motion * (1 + 1e-6);
    return true;
}

/* ---- Cuts ---- */

static void start_anew(const struct pop *pop, const struct question *q, struct pop_cut *cut) {
    cut->motion = 0;
    choose_scales(q, pop->radius, cut->scales);
    find_errors(q, pop->radius, cut->scales, cut->errors);
    for (int i = 0; i < POP_QUESTIONS; i++) cut->errors[i] *= 2; /* they change as the view does */
}

static struct cutting start(pbr_instance *instance, const struct pop *pop, const atomic_bool *cancel, struct pop_cut *cut) {
    static const double sines[] = POP_CONE_SINES;
    struct cutting c = {.instance = instance, .pop = pop, .cancel = cancel, .cut = cut};
    for (int i = 0; i < POP_NO_CONE; i++) {
        c.cones[i][0] = (float)sqrt(1 - sines[i] * sines[i]);
        c.cones[i][1] = (float)sines[i];
    }
    cut->visited = 0;
    memset(cut->counts, 0, sizeof cut->counts);
    return c;
}

static pbr_result finish(struct cutting *c, const struct question *q) {
    c->cut->question = *q;
    if (c->result == PBR_OK) return PBR_OK;
    c->cut->node_count = 0;
    memset(c->cut->counts, 0, sizeof c->cut->counts);
    return c->result;
}

static pbr_result cut_from_root(struct cutting *c, const struct question *q) {
    c->q = q;
    c->cut->node_count = 0;
    start_anew(c->pop, q, c->cut);
    if (c->pop->shape.level_count > 0) walk(c, c->pop->shape.level_count - 1, 0, ALWAYS);
    return finish(c, q);
}

pbr_result pop_cut_walk(pbr_instance *instance, const struct pop *pop, const struct cut_view *view, const atomic_bool *cancel,
                        struct pop_cut *cut) {
    struct question question;
    struct cutting c = start(instance, pop, cancel, cut);
    question_ask(view, pop->radius, BOUND_BALL, &question);
    return cut_from_root(&c, &question);
}

pbr_result pop_cut_update(pbr_instance *instance, const struct pop *pop, const struct cut_view *view, const atomic_bool *cancel,
                          struct pop_cut *cut) {
    struct question question;
    struct cutting c = start(instance, pop, cancel, cut);
    question_ask(view, pop->radius, BOUND_BALL, &question);
    if (!move(pop, &question, cut)) return cut_from_root(&c, &question);
    struct pop_front_node *old = cut->nodes;
    const size_t capacity = cut->capacity;
    c.q = &question;
    c.old = old;
    c.old_count = cut->node_count;
    cut->nodes = cut->spare, cut->capacity = cut->spare_capacity;
    cut->spare = old, cut->spare_capacity = capacity;
    cut->node_count = 0;
    update(&c);
    return finish(&c, &question);
}

void pop_cut_free(pbr_instance *instance, struct pop_cut *cut) {
    pbr_free(instance, cut->nodes);
    pbr_free(instance, cut->spare);
    *cut = (struct pop_cut){0};
}

/* ---- Records ---- */

static void make_record(const struct pop *pop, const struct pop_cut *cut, const struct pop_node *node, const struct pop_ball *ball,
                        bool is_leaf, struct splat *out) {
    float axis[3], turned[3];
    memcpy(out->position, ball->centre, sizeof out->position);
    out->radius = ball->radius;
    pop_decode_normal(node, out->normal);
    if (pop_cone(node) == POP_NO_CONE && !is_leaf) {
        splat_decode_normal(out->normal, axis);
        if (question_turn_to_eye(cut->question.eye, axis, ball->centre, turned)) splat_encode_normal(turned, out->normal);
    }
    if (pop->has_colours) qsplat_decode_colour(node->colour, out->colour);
    else memset(out->colour, 255, sizeof out->colour);
}

double pop_cut_gather(const struct pop *pop, const struct pop_cut *cut, struct splat *records, uint32_t *triangles) {
    struct splat *next[] = {[POP_POINT] = records, [POP_QUAD] = records + cut->counts[POP_POINT]};
    const uint64_t drawn = cut->counts[POP_POINT] + cut->counts[POP_QUAD] + cut->counts[POP_TRIANGLE];
    double nearness = 0;
    for (size_t i = 0; i < cut->node_count; i++) {
        const struct pop_front_node *front = &cut->nodes[i];
        if (front->fate == POP_CULLED) continue;
        const struct pop_node *node = pop_node_at(pop, front->level, front->index);
        const struct pop_ball ball = pop_decode_ball(pop, node);
        const float w = side_value(&cut->question.w, ball.centre);
        if (w > 0) nearness += 1 / (double)w;
        if (front->fate == POP_TRIANGLE) *triangles++ = front->index;
        else make_record(pop, cut, node, &ball, front->level == 0, next[front->fate]++);
    }
    return drawn > 0 ? nearness / (double)drawn : 0;
}
