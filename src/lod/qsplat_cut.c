/* The cut of a QSplat tree (Rusinkiewicz & Levoy 2000, section 3.2), by all threads.
 *
 * What is below a node lies in the cube around its sphere, so over that a plane's value changes by the radius times the sum of its
 * normal's magnitudes: "outside" and "inside" are never wrong, whoever wrote the file. The upper levels are walked breadth first
 * until there are enough subtrees; these are the threads' work. Records go into blocks that the threads take from one pool, and
 * stay there until they are copied out in order. SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/matrix.h"
#include "cut.h"
#include "pop_cut.h"
#include "qsplat.h"
#include "question.h"

enum {
    BLOCK = 64,  /* records */
    PARTS = 256, /* subtrees that are looked for in a large tree */
    QUEUE = PARTS + 8,
    STACK = 1024,       /* groups: some 340 levels; a tree that is deeper is damaged */
    ALLOWANCE = 1 << 12 /* nodes that a subtree may visit before more are asked for, in a large tree */
};

static const uint32_t NONE = UINT32_MAX;

static const double EDGE_ANGLE = 0.15; /* radians: discs that are nearer to being seen from their edge are taken for such */

/* What a cut of a tree asks. */
struct asking {
    const struct qsplat *tree;
    const struct qsplat_codes *codes;
    struct question of;
    float cone[3][2];                  /* cosine and sine of the half angle per code; the last has none */
    float edge_cone[3][2];             /* of that and EDGE_ANGLE */
    const struct occlusion *occlusion; /* NULL: nothing hides */
};

struct list {
    uint32_t first, last, used; /* blocks; records in the last */
    size_t count;
};

/* A group of siblings to be walked, and all below. */
struct step {
    struct qsplat_sphere parent;
    struct qsplat_group group;
    bool is_inside, faces_eye;
};

/* Splats that points draw, those of them that lie between the pixels' centres, and those that points may not draw. */
enum { POINT, BETWEEN, QUAD, LISTS };

struct cut_part {
    struct step step;
    struct list lists[LISTS];
    size_t places[LISTS]; /* in the cut's records */
    uint64_t visited, culled, hidden, damaged, allowance;
    double nearness; /* sum of 1 / w */
};

struct work {
    const struct asking *asking;
    struct cut *cut;
    const atomic_bool *cancel;
    atomic_uint next_block;
    /* Nodes that may be visited, what parts take and do not need included; and how many these take at a time. */
    _Atomic uint64_t left;
    uint64_t allowance;
};

/* ---- The question ---- */

/* Cones of files by others hold normals before they were coded: both ends may be off by the code's largest error, 0.0487. */
static void make_cones(const struct qsplat *tree, struct asking *q) {
    static const double sines[3] = {1.0 / 16, 4.0 / 16, 9.0 / 16};
    for (int i = 0; i < 3; i++) {
        const double angle = asin(sines[i]) + (tree->own ? 1e-5 : 2 * 0.0487);
        q->cone[i][0] = (float)cos(angle);
        q->cone[i][1] = (float)sin(angle);
        q->edge_cone[i][0] = (float)cos(angle + EDGE_ANGLE);
        q->edge_cone[i][1] = (float)sin(angle + EDGE_ANGLE);
    }
}

static void ask(const struct qsplat *tree, const struct cut_view *view, const struct occlusion *occlusion, struct asking *asking) {
    *asking = (struct asking){.tree = tree, .codes = tree->codes, .occlusion = occlusion && occlusion->by ? occlusion : NULL};
    question_ask(view, (double)tree->radius, BOUND_CUBE, &asking->of);
    make_cones(tree, asking);
}

static bool is_outside(const struct question *q, const struct qsplat_sphere *s, bool alone) {
    for (int i = 0; i < OUTSIDE_TESTS; i++) {
        const float reach = (alone ? q->outside[i].own_reach : q->outside[i].reach) * s->radius + q->error;
        const float wider = (alone ? q->wider[i].own_reach : q->wider[i].reach) * s->radius + q->error;
        if (side_value(&q->outside[i], s->centre) + reach < 0 && side_value(&q->wider[i], s->centre) + wider < 0) return true;
    }
    return false;
}

static bool is_inside(const struct question *q, const struct qsplat_sphere *s, float w) {
    const float farthest = w + q->w.reach * s->radius;
    if (!(w - q->w.reach * s->radius - q->error > 0)) return false;
    for (int i = 0; i < q->inside_count; i++) {
        const struct side *f = &q->inside[i];
        if (side_value(f, s->centre) - f->reach * s->radius - f->per_w * farthest - q->error < 0) return false;
    }
    return true;
}

/* Which way normals face within a cone, cosine and sine, around the node's: -1 away, 1 towards the eye, 0 neither for all. */
static int cone_facing(const struct asking *asking, const struct qsplat_node *node, const struct qsplat_sphere *s,
                       const float cone[2]) {
    const float *axis = asking->codes->normals[node->normal];
    const struct facing f = question_facing(&asking->of, axis, cone[0], cone[1], s->centre, s->radius);
    return f.most < 0 ? -1 : f.least > 0 ? 1 : 0;
}

/* Which way the splats of a node face, all of them: -1 away, 1 towards the eye, 0 unknown. */
static int facing(const struct asking *asking, const struct qsplat_node *node, const struct qsplat_sphere *s) {
    const struct question *q = &asking->of;
    const float *axis = asking->codes->normals[node->normal];
    if (!node->children) { /* one splat, at its centre */
        float along = 0, squared = 0;
        for (int k = 0; k < 3; k++) {
            const float to_eye = q->eye[k] - s->centre[k] * q->eye[3];
            along += to_eye * axis[k];
            squared += to_eye * to_eye;
        }
        const float room = 1e-4f * sqrtf(squared) + (axis[0] == 0 && axis[1] == 0 && axis[2] == 0 ? FLT_MAX : 0);
        return along < -0.01f * room - q->eye_room ? -1 : 1;
    }
    return node->cone == 3 ? 0 : cone_facing(asking, node, s, asking->cone[node->cone]);
}

static inline bool is_between_pixels(const struct asking *asking, const struct qsplat_node *node, const struct qsplat_sphere *s,
                                     float w) {
    static const float any[3] = {0, 0, 0};
    const float *axis = asking->codes->normals[node->normal];
    if (axis[0] == 0 && axis[1] == 0 && axis[2] == 0) return false;
    const bool may_turn = node->cone == 3 && node->children;
    return question_is_between_pixels(&asking->of, s->centre, s->radius, may_turn ? any : axis, w);
}

/* ---- Walking ---- */

/* NULL where the pool has no more blocks: then they are only counted. */
static struct splat *new_record(struct work *work, struct list *list) {
    struct cut *cut = work->cut;
    if (list->first == NONE || list->used == BLOCK) {
        const uint32_t block = atomic_fetch_add_explicit(&work->next_block, 1, memory_order_relaxed);
        const bool fits = block < cut->block_count;
        if (list->first == NONE) list->first = block;
        else if (fits) cut->next_blocks[list->last] = block;
        list->last = fits ? block : NONE;
        list->used = 0;
    }
    list->count++;
    list->used++;
    return list->last != NONE ? &cut->blocks[(size_t)list->last * BLOCK + list->used - 1] : NULL;
}

static void emit(struct work *work, struct cut_part *part, const struct qsplat_node *node, const struct qsplat_sphere *s, int to) {
    const struct qsplat *tree = work->asking->tree;
    struct splat *record = new_record(work, &part->lists[to]);
    float turned[3];
    if (!record) return;
    memcpy(record->position, s->centre, sizeof record->position);
    record->radius = s->radius;
    memcpy(record->normal, tree->codes->octahedral[node->normal], sizeof record->normal);
    if (node->cone == 3 && node->children &&
        question_turn_to_eye(&work->asking->of, tree->codes->normals[node->normal], s->centre, s->radius, turned))
        splat_encode_normal(turned, record->normal);
    if (tree->has_colours) qsplat_decode_colour(node->colour, record->colour);
    else memset(record->colour, 255, sizeof record->colour);
}

/* Of nodes so large that this spares more work than it takes, and that the threshold leaves out. */
static inline bool is_hidden(const struct asking *asking, const struct qsplat_sphere *s, float distance) {
    const float least = fmaxf(OCCLUDERS_TILE, asking->of.threshold) * distance;
    return asking->occlusion && asking->of.size * s->radius > least &&
           occluders_hide(asking->occlusion, s->centre, (double)s->radius);
}

/* Whether an inner node is drawn as it is: no larger than the threshold, and than what may nearly be seen from the edge. There its
 * disc would be a line, up to half its radius below what it stands for: a notch in the outline. */
static inline bool is_fine(const struct asking *asking, const struct qsplat_node *node, const struct qsplat_sphere *s,
                           float distance) {
    const struct question *q = &asking->of;
    const float size = q->size * s->radius, *axis = asking->codes->normals[node->normal];
    if (!(distance > 0 && size <= q->threshold * distance)) return false;
    if (size <= q->edge * distance) return true;
    if (axis[0] == 0 && axis[1] == 0 && axis[2] == 0) return true;
    return node->cone != 3 && cone_facing(asking, node, s, asking->edge_cone[node->cone]) != 0;
}

/* True if what is below the node is to be walked, `step` says how. */
static inline bool visit_node(struct work *work, struct cut_part *part, const struct step *above, const struct qsplat_node *node,
                              struct step *step) {
    const struct question *q = &work->asking->of;
    const struct qsplat_sphere s = qsplat_decode_sphere(work->asking->codes, node->sphere, &above->parent);
    const float w = side_value(&q->w, s.centre);
    bool inside = above->is_inside, faces = above->faces_eye;
    if (!inside) {
        if (is_outside(q, &s, node->children == 0)) {
            part->culled++;
            return false;
        }
        inside = is_inside(q, &s, w);
    }
    if (!faces) {
        const int way = facing(work->asking, node, &s);
        if (way < 0) {
            part->culled++;
            return false;
        }
        faces = way > 0 && node->children;
    }
    const float distance = w > q->w_least ? w : q->w_least;
    const bool hidden = node->children && is_hidden(work->asking, &s, distance);
    if (!node->children || hidden || is_fine(work->asking, node, &s, distance)) {
        part->hidden += hidden;
        if (w > 0) part->nearness += 1 / (double)w;
        const bool is_point = inside && s.radius <= q->point * (w * q->w_kept - q->w_lost);
        emit(work, part, node, &s, !is_point ? QUAD : is_between_pixels(work->asking, node, &s, w) ? BETWEEN : POINT);
        return false;
    }
    *step = (struct step){s, {0, node->children, node->grandchildren}, inside, faces};
    return true;
}

/* Whether a group may be visited: it is in the file, and there are not more of them than that can have. */
static bool may_visit(struct work *work, struct cut_part *part, const struct qsplat_group *group) {
    if (part->allowance < group->count) {
        uint64_t left = atomic_load_explicit(&work->left, memory_order_relaxed), taken;
        do taken = left < work->allowance ? left : work->allowance;
        while (
            !atomic_compare_exchange_weak_explicit(&work->left, &left, left - taken, memory_order_relaxed, memory_order_relaxed));
        part->allowance += taken;
    }
    if (part->allowance < group->count || !qsplat_group_is_inside(work->asking->tree, group)) {
        part->damaged++;
        return false;
    }
    part->allowance -= group->count;
    part->visited += group->count;
    return true;
}

static inline void expect_group(const struct qsplat *tree, const struct qsplat_group *group) {
    if (tree->residency && qsplat_group_is_inside(tree, group)) residency_expect(tree->residency, tree->nodes + group->at);
}

/* Visits a group's nodes; up to four steps below are left in `below`, the first child's first. Returns how many. */
static inline uint32_t visit_group(struct work *work, struct cut_part *part, const struct step *step, struct step *below) {
    const struct qsplat *tree = work->asking->tree;
    const bool has_colours = tree->has_colours;
    const uint32_t size = has_colours ? 6 : 4;
    uint64_t next = 0;
    uint32_t count = 0;
    if (!may_visit(work, part, &step->group)) return 0;
    qsplat_touch(tree, &step->group);
    const bool follows = step->group.inner && qsplat_follow(tree, &step->group, &next);
    const uint8_t *p = tree->nodes + step->group.at + (step->group.inner ? 4 : 0);
    for (uint32_t i = 0; i < step->group.count; i++, p += size) {
        struct qsplat_node node = qsplat_read_node(p, has_colours);
        if (node.children && !follows) {
            part->damaged++;
            node.children = 0;
        }
        const struct qsplat_group group = {next, node.children, node.grandchildren};
        if (node.children) next += qsplat_group_size(tree, &group);
        if (!visit_node(work, part, step, &node, &below[count])) continue;
        below[count].group.at = group.at;
        if (count++ > 0) expect_group(tree, &group); /* the first one is next */
    }
    return count;
}

static inline bool is_cancelled(const struct work *work) {
    return work->cancel && atomic_load_explicit(work->cancel, memory_order_relaxed);
}

static void walk_part(struct work *work, struct cut_part *part) {
    struct step stack[STACK], below[QSPLAT_CHILDREN];
    uint32_t count = 1;
    stack[0] = part->step;
    while (count > 0 && !is_cancelled(work)) {
        const struct step step = stack[--count];
        const uint32_t found = visit_group(work, part, &step, below);
        if (count + found > STACK) {
            part->damaged++;
            continue;
        }
        for (uint32_t i = found; i-- > 0;) stack[count++] = below[i];
    }
}

static void allow(struct work *work, uint64_t nodes) {
    work->allowance = nodes / PARTS < ALLOWANCE ? nodes / PARTS + QSPLAT_CHILDREN : ALLOWANCE;
    atomic_init(&work->left, nodes + work->allowance * (1 + QUEUE));
}

static pbr_result walk_parts(void *user, size_t begin, size_t end) {
    struct work *work = user;
    for (size_t i = begin; i < end; i++) walk_part(work, &work->cut->parts[1 + i]);
    return PBR_OK;
}

static void start_part(struct cut_part *part, const struct step *step) {
    *part = (struct cut_part){.lists = {{NONE, NONE, 0, 0}, {NONE, NONE, 0, 0}, {NONE, NONE, 0, 0}}};
    if (step) part->step = *step;
}

/* Whatever the number of threads: the order depends on it. */
static uint32_t wanted_parts(const struct qsplat *tree) {
    return tree->leaves / 512 < PARTS - 4 ? 4 + (uint32_t)(tree->leaves / 512) : PARTS;
}

/* Walks the upper levels. Part 0 gets what is drawn of them, the next ones a subtree each. */
static size_t find_parts(struct work *work) {
    struct cut_part *parts = work->cut->parts;
    const struct qsplat *tree = work->asking->tree;
    struct step queue[QUEUE];
    uint32_t first = 0, count = 0;
    start_part(&parts[0], NULL);
    if (tree->root_children > 0)
        queue[count++] = (struct step){{{0, 0, 0}, tree->radius}, qsplat_root_group(tree), false, !work->asking->of.culls};
    while (count > 0 && count < wanted_parts(tree) && !is_cancelled(work)) {
        const struct step step = queue[first];
        struct step below[QSPLAT_CHILDREN];
        first = (first + 1) % QUEUE;
        count--;
        const uint32_t found = visit_group(work, &parts[0], &step, below);
        for (uint32_t i = 0; i < found; i++) queue[(first + count++) % QUEUE] = below[i];
    }
    for (uint32_t i = 0; i < count; i++) start_part(&parts[1 + i], &queue[(first + i) % QUEUE]);
    return count;
}

/* ---- Records in order ---- */

struct gathering {
    const struct cut *cut;
    struct splat *out;
};

static pbr_result copy_part(void *user, size_t begin, size_t end) {
    const struct gathering *gathering = user;
    const struct cut *cut = gathering->cut;
    for (size_t i = begin; i < end; i++)
        for (int l = 0; l < LISTS; l++) {
            const struct list *list = &cut->parts[i].lists[l];
            struct splat *to = gathering->out + cut->parts[i].places[l];
            uint32_t block = list->first;
            for (size_t left = list->count; left > 0; block = cut->next_blocks[block]) {
                const size_t some = left < BLOCK ? left : BLOCK;
                memcpy(to, cut->blocks + (size_t)block * BLOCK, some * sizeof *to);
                to += some;
                left -= some;
            }
        }
    return PBR_OK;
}

void cut_gather(pbr_instance *instance, const struct cut *cut, struct splat *out) {
    enum { MANY = 1 << 16 }; /* splats, that are worth starting threads */
    struct gathering gathering = {cut, out};
    if (cut->count < MANY) copy_part(&gathering, 0, cut->part_count);
    else pbr_parallel(instance, cut->part_count, 16, copy_part, &gathering);
}

static void sum_up(struct cut *cut) {
    size_t place = 0;
    double nearness = 0;
    for (int l = 0; l < LISTS; l++) {
        for (size_t i = 0; i < cut->part_count; i++) {
            cut->parts[i].places[l] = place;
            place += cut->parts[i].lists[l].count;
            if (l == BETWEEN) cut->between += cut->parts[i].lists[l].count;
        }
        if (l == BETWEEN) cut->points_only = place;
    }
    cut->count = place;
    for (size_t i = 0; i < cut->part_count; i++) {
        cut->visited += cut->parts[i].visited;
        cut->culled += cut->parts[i].culled;
        cut->hidden += cut->parts[i].hidden;
        cut->damaged += cut->parts[i].damaged;
        nearness += cut->parts[i].nearness;
    }
    cut->nearness = cut->count > 0 ? nearness / (double)cut->count : 0;
}

/* More blocks than there were, whose content is lost. */
static pbr_result grow_blocks(pbr_instance *instance, struct cut *cut, uint32_t count) {
    pbr_free(instance, cut->blocks);
    pbr_free(instance, cut->next_blocks);
    cut->block_count = 0;
    cut->blocks = pbr_allocate(instance, (size_t)count * BLOCK, sizeof *cut->blocks);
    cut->next_blocks = pbr_allocate(instance, count, sizeof *cut->next_blocks);
    if (!cut->blocks || !cut->next_blocks) return PBR_ERROR_OUT_OF_MEMORY;
    cut->block_count = count;
    return PBR_OK;
}

static pbr_result prepare(pbr_instance *instance, const struct qsplat *tree, struct cut *cut) {
    enum { FIRST = 16 }; /* full blocks that are taken before it is known how many are needed */
    const uint32_t parts = wanted_parts(tree) + QUEUE - PARTS;
    if (cut->part_capacity < 1 + parts) {
        pbr_free(instance, cut->parts);
        cut->part_capacity = 0;
        cut->parts = pbr_allocate(instance, 1 + parts, sizeof *cut->parts);
        if (!cut->parts) return PBR_ERROR_OUT_OF_MEMORY;
        cut->part_capacity = 1 + parts;
    }
    const uint64_t full = tree->leaves / BLOCK, most = tree->leaves < 1 + parts ? tree->leaves : 1 + parts;
    /* And some for each part that are not full. */
    const uint64_t blocks = (full < FIRST ? full : FIRST) + LISTS * most + 1;
    return cut->block_count > 0 ? PBR_OK : grow_blocks(instance, cut, (uint32_t)blocks);
}

pbr_result qsplat_cut(pbr_instance *instance, const struct qsplat *tree, const struct cut_view *view,
                      const struct occlusion *occlusion, const atomic_bool *cancel, struct cut *cut) {
    struct asking asking;
    ask(tree, view, occlusion, &asking);
    cut->count = cut->points_only = cut->between = cut->part_count = 0;
    cut->visited = cut->culled = cut->hidden = cut->damaged = 0;
    pbr_result result = prepare(instance, tree, cut);
    while (result == PBR_OK) {
        struct work work = {.asking = &asking, .cut = cut, .cancel = cancel};
        allow(&work, qsplat_most_nodes(tree));
        const size_t parts = find_parts(&work);
        result = pbr_parallel(instance, parts, 1, walk_parts, &work);
        if (result != PBR_OK) break;
        if (is_cancelled(&work)) return PBR_ERROR_CANCELLED;
        const uint32_t needed = atomic_load(&work.next_block);
        if (needed <= cut->block_count) {
            cut->part_count = 1 + parts;
            sum_up(cut);
            return PBR_OK;
        }
        if (needed > UINT32_MAX / 4) return PBR_ERROR_OUT_OF_MEMORY;
        result = grow_blocks(instance, cut, needed + needed / 8);
    }
    return result;
}

void cut_free(pbr_instance *instance, struct cut *cut) {
    pbr_free(instance, cut->parts);
    pbr_free(instance, cut->blocks);
    pbr_free(instance, cut->next_blocks);
    if (cut->front) pop_cut_free(instance, cut->front);
    pbr_free(instance, cut->front);
    *cut = (struct cut){0};
}
