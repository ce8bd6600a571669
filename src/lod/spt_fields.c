/* Normal fields of a sequence's entries: the leaves' are their points', the others' come from their children, by the least squares
 * of core/normal_field.c over whole discs in the place of neighbours.
 *
 * x: offsets from a node's centre along its tangents T = (t b), in its radius r. Over the disc of a child, of centre x_c, normal
 * n_c with the tangential part y_c = T^T n_c, radius r_c, and own change of the normal D_c per offset, the means of x x^T and y x^T
 * are
 *     x_c x_c^T + (r_c / r)^2 / 4 (1 - y_c y_c^T)   and   y_c x_c^T + r_c^2 / (4 r) T^T D_c T:
 * u u^T has the mean r_c^2 / 4 (1 - n_c n_c^T) over the offsets u from the disc's centre, and D_c n_c is 0. A child weighs as much
 * as the leaves below, and all children together as twelve neighbours, so that the damping counts as little.
 *
 * On spheres and cylinders of radius R the children's normals turn by 1 / R, and all of it is linear but for how far discs are
 * below the surface, of the order of r^2 / R^2: the fit is 1 / R again. SPDX-License-Identifier: MIT */
#include "core/matrix.h"
#include "spt_build.h"

static const double CHILDREN_WEIGH = 12;

struct fields {
    const struct spt_builder *builder;
    const struct spt_tree *tree;
    const struct spt_chunk *chunk;
    const struct spt_entry *entries;
    uint32_t *entry_of;             /* node -> entry */
    struct normal_moments *moments; /* of nodes */
    struct normal_field *out;       /* of entries */
};

/* What a field is relative to. */
struct frame {
    double t[3], b[3], radius;
};

static void make_frame(const float normal[3], double radius, struct frame *out) {
    const double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]};
    disc_tangents(n, out->t, out->b);
    out->radius = radius;
}

/* Of an entry as it decodes. False: its disc has no normal or no extent, and so no field. */
static bool entry_frame(const struct fields *fields, uint32_t node, struct frame *out) {
    const struct spt_entry *entry = &fields->entries[fields->entry_of[node]];
    float normal[3];
    splat_decode_normal(entry->normal, normal);
    make_frame(normal, (double)spt_decode_radius(fields->chunk, entry), out);
    return out->radius > 0 && (normal[0] != 0 || normal[1] != 0 || normal[2] != 0);
}

/* T^T D T: a field's change per unit of length, along another frame's tangents; a, b as in struct normal_field. */
static void turn_field(const struct normal_field *field, const struct frame *from, const struct frame *to, double a[2],
                       double b[2]) {
    double fa[2], fb[2], out[2][2];
    const double m[2][2] = {{dot3(to->t, from->t), dot3(to->t, from->b)}, {dot3(to->b, from->t), dot3(to->b, from->b)}};
    normal_field_decode(field, fa, fb);
    for (int k = 0; k < 2; k++) { /* along the k-th tangent of `to` */
        const double along[2] = {m[k][0] * fa[0] + m[k][1] * fb[0], m[k][0] * fa[1] + m[k][1] * fb[1]};
        for (int i = 0; i < 2; i++) out[k][i] = (m[i][0] * along[0] + m[i][1] * along[1]) / from->radius;
    }
    for (int i = 0; i < 2; i++) {
        a[i] = out[0][i];
        b[i] = out[1][i];
    }
}

/* The point's field, in the entry's radius and tangents, which coding may have changed. */
static void take_points(const struct fields *fields, uint32_t i, const struct frame *frame) {
    const struct spt_node *leaf = &fields->tree->nodes[i];
    const float radius = fields->builder->points->radii[leaf->point];
    struct frame own;
    double a[2], b[2];
    make_frame(leaf->normal, (double)radius, &own);
    turn_field(&fields->builder->fields[leaf->point], &own, frame, a, b);
    for (int k = 0; k < 2; k++) {
        a[k] *= frame->radius;
        b[k] *= frame->radius;
    }
    normal_field_encode(a, b, &fields->out[fields->entry_of[i]]);
}

/* frame: the child's; of radius 0 where it has no field. */
static void add_to_parent(const struct fields *fields, uint32_t i, const struct frame *frame) {
    const struct spt_node *child = &fields->tree->nodes[i], *node = &fields->tree->nodes[child->parent];
    struct normal_moments *m = &fields->moments[child->parent];
    struct frame over;
    double offset[3], normal[3], a[2] = {0, 0}, b[2] = {0, 0}, cosine = 0;
    if (!entry_frame(fields, child->parent, &over)) return;
    for (int k = 0; k < 3; k++) {
        offset[k] = (child->position[k] - node->position[k]) / over.radius;
        normal[k] = (double)child->normal[k];
        cosine += normal[k] * (double)node->normal[k];
    }
    if (cosine <= NORMAL_FIELD_LEAST_COSINE) return;
    if (frame->radius > 0) turn_field(&fields->out[fields->entry_of[i]], frame, &over, a, b);
    const double weight = CHILDREN_WEIGH * (double)child->weight / (double)node->weight,
                 ratio = (double)child->radius / over.radius;
    const double x[2] = {dot3(offset, over.t), dot3(offset, over.b)}, y[2] = {dot3(normal, over.t), dot3(normal, over.b)};
    const double spread = ratio * ratio / 4, change = spread * over.radius;
    m->xx += weight * (x[0] * x[0] + spread * (1 - y[0] * y[0]));
    m->xy += weight * (x[0] * x[1] - spread * y[0] * y[1]);
    m->yy += weight * (x[1] * x[1] + spread * (1 - y[1] * y[1]));
    m->t[0] += weight * (x[0] * y[0] + change * a[0]);
    m->t[1] += weight * (x[1] * y[0] + change * b[0]);
    m->b[0] += weight * (x[0] * y[1] + change * a[1]);
    m->b[1] += weight * (x[1] * y[1] + change * b[1]);
}

pbr_result spt_make_fields(const struct spt_builder *builder, const struct spt_tree *tree, const struct spt_chunk *chunk,
                           const struct spt_entry *entries, const uint32_t *order, struct normal_field *out) {
    pbr_instance *instance = builder->instance;
    struct fields fields = {builder, tree, chunk, entries, .out = out};
    fields.entry_of = pbr_allocate(instance, tree->count, sizeof *fields.entry_of);
    fields.moments = pbr_allocate(instance, tree->count, sizeof *fields.moments);
    const bool done = fields.entry_of && fields.moments;
    for (uint32_t e = 0; e < tree->count && done; e++) fields.entry_of[order[e]] = e;
    for (uint32_t i = 0; i < tree->count && done; i++) { /* children first */
        const struct spt_node *node = &tree->nodes[i];
        struct frame frame;
        if (!entry_frame(&fields, i, &frame)) frame.radius = 0;
        else if (node->children == 0) take_points(&fields, i, &frame);
        else normal_field_solve(&fields.moments[i], 1, &out[fields.entry_of[i]]);
        if (node->parent != UINT32_MAX) add_to_parent(&fields, i, &frame);
    }
    pbr_free(instance, fields.entry_of);
    pbr_free(instance, fields.moments);
    return done ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}
