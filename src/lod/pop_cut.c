/* Cuts of POP hierarchies, from the root or from the last cut. SPDX-License-Identifier: MIT */
#include "pop_cut.h"

#include <float.h>
#include <string.h>

#include "core/matrix.h"
#include "core/minmax.h"
#include "qsplat.h"

/* For good, whatever the motion. */
static const double ALWAYS = INFINITY;

/* What is known of a node: whether it stops, how, and by how much. */
struct verdict {
    bool stops;
    enum pop_fate fate;
    float slack; /* the motion after which this may be another */
};

struct cutting {
    pbr_instance *instance;
    const struct pop *pop;
    const struct question *q;
    const atomic_bool *cancel;
    struct pop_cut *cut; /* made anew from: */
    const struct pop_front_node *old;
    size_t old_count;
    uint32_t point_level;        /* nodes below it are drawn as triangles */
    float cones[POP_NO_CONE][2]; /* cosine and sine */
    float size_per_w;            /* of radius 1, in thresholds */
    pbr_result result;
};

/* ---- One node ---- */

/* How much the value may change before its sign may. */
static inline float slack_of(const struct pop_measure *measure, float value) {
    return fabsf(value) * measure->scale * (1 - 1e-4f) - measure->error;
}

/* Several functions of which one below 0 decides: how long it is certain that there is one, or that there is none. */
struct tally {
    bool negative;
    float out, in;
};

static const struct tally NOTHING_ASKED = {false, -FLT_MAX, FLT_MAX};

static inline void count_value(struct tally *tally, const struct pop_measure *measure, float value) {
    const float slack = slack_of(measure, value);
    if (value < 0) tally->negative = true, tally->out = largerf(tally->out, slack);
    else tally->in = lesserf(tally->in, slack);
}

static inline float slack_of_tally(const struct tally *tally) {
    return tally->negative ? tally->out : tally->in;
}

static bool is_outside(const struct cutting *c, const struct pop_ball *b, float *slack) {
    const struct question *q = c->q;
    struct tally tally = NOTHING_ASKED;
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const float own = side_value(&q->outside[i], b->centre) + (q->outside[i].reach * b->radius + q->error);
        const float wide = side_value(&q->wider[i], b->centre) + (q->wider[i].reach * b->radius + q->error);
        count_value(&tally, &c->cut->measures[POP_ASKS_OUTSIDE + i], largerf(own, wide));
    }
    *slack = slack_of_tally(&tally);
    return tally.negative;
}

static bool faces_away(const struct cutting *c, const struct pop_node *node, const struct pop_ball *b, float *slack) {
    int16_t code[2];
    float axis[3];
    const uint32_t cone = pop_cone(node);
    *slack = FLT_MAX;
    if (!c->q->culls || cone == POP_NO_CONE) return false;
    pop_decode_normal(node, code);
    splat_decode_normal(code, axis);
    const float most = question_facing(c->q, axis, c->cones[cone][0], c->cones[cone][1], b->centre, b->radius).most;
    *slack = slack_of(&c->cut->measures[POP_ASKS_FACING], most);
    return most < 0;
}

static bool is_small(const struct cutting *c, const struct pop_ball *b, float w, float *slack) {
    const struct question *q = c->q;
    const float distance = largerf(w, q->w_least), value = distance - c->size_per_w * b->radius;
    *slack = FLT_MAX;
    if (!(q->threshold > 0)) return false;
    *slack = slack_of(&c->cut->measures[POP_ASKS_DEPTH], value);
    return value >= 0 && distance > 0;
}

/* Whether GL points draw it for certain. */
static bool fits_a_point(const struct cutting *c, const struct pop_ball *b, float w, float *slack) {
    const struct question *q = c->q;
    const struct pop_measure *depth = &c->cut->measures[POP_ASKS_DEPTH];
    const float farthest = w + q->w.reach * b->radius;
    struct tally tally = NOTHING_ASKED;
    *slack = FLT_MAX;
    if (!(q->point > 0)) return false;
    count_value(&tally, depth, w - q->w.reach * b->radius - q->error);
    count_value(&tally, depth, w * q->w_kept - q->w_lost - b->radius / q->point);
    for (int i = 0; i < q->inside_count; i++) {
        const struct side *f = &q->inside[i];
        const float value = side_value(f, b->centre) - f->reach * b->radius - f->per_w * farthest - q->error;
        count_value(&tally, &c->cut->measures[POP_ASKS_INSIDE + i], value);
    }
    *slack = slack_of_tally(&tally);
    return !tally.negative;
}

static struct verdict judge(const struct cutting *c, uint32_t level, const struct pop_node *node) {
    const struct pop_ball ball = pop_decode_ball(c->pop, node);
    float view_slack, facing_slack, size_slack, point_slack;
    if (is_outside(c, &ball, &view_slack)) return (struct verdict){true, POP_CULLED, view_slack};
    if (faces_away(c, node, &ball, &facing_slack)) return (struct verdict){true, POP_CULLED, facing_slack};
    const float w = side_value(&c->q->w, ball.centre), seen_slack = lesserf(view_slack, facing_slack);
    if (level < c->point_level) return (struct verdict){level == 0, POP_TRIANGLE, seen_slack};
    if (!is_small(c, &ball, w, &size_slack)) return (struct verdict){level == 0, POP_TRIANGLE, lesserf(seen_slack, size_slack)};
    const bool point = fits_a_point(c, &ball, w, &point_slack);
    return (struct verdict){true, point ? POP_POINT : POP_QUAD, lesserf(lesserf(seen_slack, size_slack), point_slack)};
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
    *until = fmin(*until, c->cut->motion + fmax((double)verdict.slack, 0));
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

/* From one view to the next. Balls' centres lie within `span` of the hierarchy's, and their radii are no larger. */
struct change {
    double span;
    const struct question *from, *to;
};

static double length_of(const float v[3]) {
    const double d[3] = {(double)v[0], (double)v[1], (double)v[2]};
    return length3(d);
}

static double difference(float a, float b) {
    return fabs((double)b - (double)a);
}

static double distance_of(const float a[3], const float b[3]) {
    const double d[3] = {difference(a[0], b[0]), difference(a[1], b[1]), difference(a[2], b[2])};
    return length3(d);
}

/* Of a plane's value, anywhere. */
static double side_change(const struct change *change, const struct side *a, const struct side *b) {
    return (distance_of(a->normal, b->normal) + difference(a->reach, b->reach)) * change->span + difference(a->offset, b->offset) +
           difference(change->from->error, change->to->error);
}

static double largest_value(const struct side *side, double span) {
    return (length_of(side->normal) + (double)side->reach) * span + fabs((double)side->offset);
}

static double inside_change(const struct change *change, int i, double w) {
    const struct side *a = &change->from->inside[i], *b = &change->to->inside[i];
    return side_change(change, a, b) + (double)b->per_w * w +
           difference(a->per_w, b->per_w) * largest_value(&change->from->w, change->span);
}

static float size_per_w(const struct question *q) {
    return q->size / q->threshold;
}

/* Of what sizes are compared by; w: what that changes. */
static double depth_change(const struct change *change, double w) {
    const struct question *a = change->from, *b = change->to;
    double most = w;
    if (a->threshold > 0) most = w + difference(a->w_least, b->w_least) + difference(size_per_w(a), size_per_w(b)) * change->span;
    if (!(a->point > 0)) return most;
    return fmax(most, (double)b->w_kept * w + difference(a->w_kept, b->w_kept) * largest_value(&a->w, change->span) +
                          difference(a->w_lost, b->w_lost) + fabs(1 / (double)b->point - 1 / (double)a->point) * change->span);
}

static double facing_change(const struct change *change) {
    const struct question *a = change->from, *b = change->to;
    if (!a->culls) return 0;
    return (distance_of(a->eye, b->eye) + 2 * change->span * difference(a->eye[3], b->eye[3])) * (1 + 2e-4) +
           difference(a->eye_room, b->eye_room);
}

/* What values may have changed, as a length: the most of all. */
static double motion_of(const struct change *change, const struct pop_measure *measures) {
    const struct question *a = change->from, *b = change->to;
    const double w = side_change(change, &a->w, &b->w);
    double most = fmax(depth_change(change, w) * (double)measures[POP_ASKS_DEPTH].scale,
                       facing_change(change) * (double)measures[POP_ASKS_FACING].scale);
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const double own = side_change(change, &a->outside[i], &b->outside[i]);
        const double wide = side_change(change, &a->wider[i], &b->wider[i]);
        most = fmax(most, fmax(own, wide) * (double)measures[POP_ASKS_OUTSIDE + i].scale);
    }
    for (int i = 0; i < a->inside_count; i++)
        most = fmax(most, inside_change(change, i, w) * (double)measures[POP_ASKS_INSIDE + i].scale);
    return most * (1 + 1e-6);
}

/* What jumps rather than changes. */
static bool is_comparable(const struct question *a, const struct question *b) {
    return a->inside_count == b->inside_count && a->culls == b->culls && (a->threshold > 0) == (b->threshold > 0) &&
           (a->point > 0) == (b->point > 0) && a->point_cost == b->point_cost;
}

/* A plane whose value hardly differs over the hierarchy, as a far one's, counts as if it differed a little. */
static double scale_of(const struct side *side, double span) {
    const double scale = 1 / fmax(length_of(side->normal), 1e-4 * fabs((double)side->offset) / span);
    return isfinite(scale) ? scale : 1;
}

/* The longest vector from a node to the eye; in whatever units these are. */
static double eye_distance(const struct question *q, double span) {
    return length_of(q->eye) + span * fabs((double)q->eye[3]);
}

/* Any scales are right; these make lengths of all values. Of facing, as if the eye were as near as the hierarchy is large. */
static void choose_scales(const struct question *q, double span, struct pop_measure measures[POP_QUESTIONS]) {
    const double facing = span / eye_distance(q, span);
    for (int i = 0; i < OUTSIDE_TESTS; i++) measures[POP_ASKS_OUTSIDE + i].scale = (float)scale_of(&q->outside[i], span);
    for (int i = 0; i < q->inside_count; i++) measures[POP_ASKS_INSIDE + i].scale = (float)scale_of(&q->inside[i], span);
    measures[POP_ASKS_DEPTH].scale = (float)scale_of(&q->w, span);
    measures[POP_ASKS_FACING].scale = isfinite(facing) ? (float)facing : 1;
}

/* Of a sum of some products; twice, as two values are compared. */
static double rounding_of(const struct question *q, const struct side *side, double span) {
    const double rounding = 2 * 16 * (double)FLT_EPSILON;
    return rounding * (largest_value(side, span) + (double)q->error + (double)side->per_w * largest_value(&q->w, span));
}

/* Of facing, the sine is the root of a difference. */
static void find_errors(const struct question *q, double span, const struct pop_measure measures[POP_QUESTIONS],
                        double errors[POP_QUESTIONS]) {
    memset(errors, 0, POP_QUESTIONS * sizeof *errors);
    for (int i = 0; i < OUTSIDE_TESTS; i++)
        errors[POP_ASKS_OUTSIDE + i] = fmax(rounding_of(q, &q->outside[i], span), rounding_of(q, &q->wider[i], span));
    for (int i = 0; i < q->inside_count; i++) errors[POP_ASKS_INSIDE + i] = rounding_of(q, &q->inside[i], span);
    errors[POP_ASKS_DEPTH] = rounding_of(q, &q->w, span);
    errors[POP_ASKS_FACING] = q->culls ? 2 * 1e-3 * eye_distance(q, span) : 0;
    for (int i = 0; i < POP_QUESTIONS; i++) errors[i] *= (double)measures[i].scale;
}

/* Adds what the view has moved to the cut's motion. False if nothing is known of what it was before. */
static bool move(const struct pop *pop, const struct question *q, struct pop_cut *cut) {
    const struct change change = {pop->radius * (1 + 1e-6), &cut->question, q};
    double errors[POP_QUESTIONS];
    if (cut->node_count == 0 || !is_comparable(&cut->question, q)) return false;
    find_errors(q, pop->radius, cut->measures, errors);
    for (int i = 0; i < POP_QUESTIONS; i++)
        if (!(errors[i] <= (double)cut->measures[i].error) || isinf(cut->measures[i].error)) return false;
    const double motion = cut->motion + motion_of(&change, cut->measures);
    if (!(motion < 1e6 * pop->radius)) return false; /* while `until` is exact enough */
    cut->motion = motion;
    return true;
}

/* ---- Cuts ---- */

static void start_anew(const struct pop *pop, const struct question *q, struct pop_cut *cut) {
    double errors[POP_QUESTIONS];
    cut->motion = 0;
    memset(cut->measures, 0, sizeof cut->measures);
    choose_scales(q, pop->radius, cut->measures);
    find_errors(q, pop->radius, cut->measures, errors);
    for (int i = 0; i < POP_QUESTIONS; i++) cut->measures[i].error = 2 * (float)errors[i]; /* they change as the view does */
}

/* Nodes of a level have about as many leaves. */
static uint32_t find_point_level(const struct pop_shape *shape, double point_cost) {
    uint32_t level = 0;
    while (level + 1 < shape->level_count && (double)shape->levels[0].count < point_cost * (double)shape->levels[level].count)
        level++;
    return level;
}

static struct cutting start(pbr_instance *instance, const struct pop *pop, const struct question *q, const atomic_bool *cancel,
                            struct pop_cut *cut) {
    static const double sines[] = POP_CONE_SINES;
    struct cutting c = {.instance = instance, .pop = pop, .q = q, .cancel = cancel, .cut = cut, .size_per_w = size_per_w(q)};
    for (int i = 0; i < POP_NO_CONE; i++) {
        c.cones[i][0] = (float)sqrt(1 - sines[i] * sines[i]);
        c.cones[i][1] = (float)sines[i];
    }
    c.point_level = find_point_level(&pop->shape, (double)q->point_cost);
    cut->visited = 0;
    memset(cut->counts, 0, sizeof cut->counts);
    return c;
}

static pbr_result finish(struct cutting *c) {
    c->cut->question = *c->q;
    if (c->result == PBR_OK) return PBR_OK;
    c->cut->node_count = 0;
    memset(c->cut->counts, 0, sizeof c->cut->counts);
    return c->result;
}

static pbr_result cut_from_root(struct cutting *c) {
    c->cut->node_count = 0;
    start_anew(c->pop, c->q, c->cut);
    if (c->pop->shape.level_count > 0) walk(c, c->pop->shape.level_count - 1, 0, ALWAYS);
    return finish(c);
}

static pbr_result cut_from_last(struct cutting *c) {
    struct pop_cut *cut = c->cut;
    struct pop_front_node *old = cut->nodes;
    const size_t capacity = cut->capacity;
    c->old = old;
    c->old_count = cut->node_count;
    cut->nodes = cut->spare, cut->capacity = cut->spare_capacity;
    cut->spare = old, cut->spare_capacity = capacity;
    cut->node_count = 0;
    update(c);
    return finish(c);
}

pbr_result pop_cut_walk(pbr_instance *instance, const struct pop *pop, const struct cut_view *view, const atomic_bool *cancel,
                        struct pop_cut *cut) {
    struct question question;
    question_ask(view, pop->radius, BOUND_BALL, &question);
    struct cutting c = start(instance, pop, &question, cancel, cut);
    return cut_from_root(&c);
}

pbr_result pop_cut_update(pbr_instance *instance, const struct pop *pop, const struct cut_view *view, const atomic_bool *cancel,
                          struct pop_cut *cut) {
    struct question question;
    question_ask(view, pop->radius, BOUND_BALL, &question);
    struct cutting c = start(instance, pop, &question, cancel, cut);
    return move(pop, &question, cut) ? cut_from_last(&c) : cut_from_root(&c);
}

void pop_cut_free(pbr_instance *instance, struct pop_cut *cut) {
    pbr_free(instance, cut->nodes);
    pbr_free(instance, cut->spare);
    *cut = (struct pop_cut){0};
}

/* ---- Records ---- */

static void make_record(const struct pop *pop, const struct pop_cut *cut, const struct pop_node *node, const struct pop_ball *ball,
                        struct splat *out) {
    struct splat record; /* `out` may be memory that must not be read */
    float axis[3], turned[3];
    memcpy(record.position, ball->centre, sizeof record.position);
    record.radius = ball->radius;
    pop_decode_normal(node, record.normal);
    if (pop_cone(node) == POP_NO_CONE) {
        splat_decode_normal(record.normal, axis);
        if (question_turn_to_eye(&cut->question, axis, ball->centre, ball->radius, turned))
            splat_encode_normal(turned, record.normal);
    }
    if (pop->has_colours) qsplat_decode_colour(node->colour, record.colour);
    else memset(record.colour, 255, sizeof record.colour);
    *out = record;
}

void pop_cut_gather(const struct pop *pop, const struct pop_cut *cut, struct splat *records, uint32_t (*triangles)[3]) {
    struct splat *next[] = {[POP_POINT] = records, [POP_QUAD] = records + cut->counts[POP_POINT]};
    for (size_t i = 0; i < cut->node_count; i++) {
        const struct pop_front_node *front = &cut->nodes[i];
        if (front->fate == POP_TRIANGLE) memcpy(*triangles++, pop->triangles[front->index], sizeof *triangles);
        if (front->fate != POP_POINT && front->fate != POP_QUAD) continue;
        const struct pop_node *node = pop_node_at(pop, front->level, front->index);
        const struct pop_ball ball = pop_decode_ball(pop, node);
        make_record(pop, cut, node, &ball, next[front->fate]++);
    }
}

double pop_cut_nearness(const struct pop *pop, const struct pop_cut *cut) {
    const uint64_t drawn = cut->counts[POP_POINT] + cut->counts[POP_QUAD] + cut->counts[POP_TRIANGLE];
    double nearness = 0;
    for (size_t i = 0; i < cut->node_count; i++) {
        const struct pop_front_node *front = &cut->nodes[i];
        if (front->fate == POP_CULLED) continue;
        const struct pop_ball ball = pop_decode_ball(pop, pop_node_at(pop, front->level, front->index));
        const float w = side_value(&cut->question.w, ball.centre);
        if (w > 0) nearness += 1 / (double)w;
    }
    return drawn > 0 ? nearness / (double)drawn : 0;
}
