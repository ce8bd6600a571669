/* Building POP hierarchies: balls, normals, cones and colours from the triangles up. SPDX-License-Identifier: MIT */
#include "pop_build.h"

#include <float.h>
#include <string.h>

#include "core/colour.h"
#include "core/matrix.h"
#include "core/points.h"
#include "lod.h"
#include "pop_sphere.h"

/* Triangles weigh by their area in averages. Those without, no less than this part of the extent's square, so that there is an
 * average where all are such. */
static const double LEAST_WEIGHT = 1e-18;

/* Normals whose mean is shorter point into no common direction. */
static const double LEAST_MEAN = 1e-3;

struct building {
    pbr_instance *instance;
    const pbr_mesh *mesh;
    struct pop *pop;
    double extent;    /* the box's longest side, or 1 */
    double origin[3]; /* of vertices, relative to the centre */
    struct pop_item *items;
    float linear[256];
    uint32_t cut_level; /* whose nodes are shared out to threads, with all below */
    struct made *made;  /* of these */
};

/* Of a node, what its parent needs beside what it decodes to. */
struct made {
    double normal[3], colour[3], weight; /* sums by weight; colour in linear light */
    double half_angle;                   /* of the cone around the decoded normal */
};

static void vertex_position(const struct building *building, uint32_t vertex, double out[3]) {
    points_position(building->mesh->vertices, vertex, out);
    for (int k = 0; k < 3; k++) out[k] = (double)(float)(out[k] + building->origin[k]); /* as it will be stored */
}

static void corners_of(const struct building *building, const uint32_t vertices[3], double out[3][3]) {
    for (int i = 0; i < 3; i++) vertex_position(building, vertices[i], out[i]);
}

static struct pop_node *node_of(struct pop *pop, uint32_t level, uint64_t index) {
    return (struct pop_node *)(uintptr_t)&pop->nodes[pop->shape.levels[level].first + index];
}

/* ---- Nodes ---- */

/* With the centre where its code is; the radius must then hold what the ball holds, and is what makes it sure. */
static void encode_centre(const struct pop *pop, const double centre[3], struct pop_node *node, double decoded[3]) {
    for (int k = 0; k < 3; k++) node->position[k] = pop_encode_coordinate(pop, centre[k]);
    const struct pop_ball ball = pop_decode_ball(pop, node);
    for (int k = 0; k < 3; k++) decoded[k] = (double)ball.centre[k];
}

static void encode_rest(const struct building *building, double radius, struct made *made, struct pop_node *node) {
    uint8_t srgb[3] = {255, 255, 255};
    node->size = (uint16_t)(pop_encode_radius(building->pop, radius) | pop_encode_cone(made->half_angle) << POP_RADIUS_BITS);
    for (int k = 0; k < 3 && building->pop->has_colours; k++)
        srgb[k] = unorm8(srgb_from_linear((float)(made->colour[k] / made->weight)));
    node->colour = qsplat_encode_colour(srgb);
}

static bool decode_axis(const struct pop_node *node, double out[3]) {
    int16_t code[2];
    float n[3];
    pop_decode_normal(node, code);
    splat_decode_normal(code, n);
    for (int k = 0; k < 3; k++) out[k] = (double)n[k];
    return dot3(out, out) > 0;
}

/* The normals' mean is the node's; false if there is none. */
static bool encode_axis(const struct made *made, struct pop_node *node, double axis[3]) {
    static const double none[3] = {0, 0, 0};
    pop_encode_normal(length3(made->normal) > LEAST_MEAN * made->weight ? made->normal : none, node->normal);
    return decode_axis(node, axis);
}

/* Of unit vectors. Not by the cosine, which is blind where they are parallel. */
static double chord_between(const double a[3], const double b[3]) {
    double d[3];
    for (int k = 0; k < 3; k++) d[k] = a[k] - b[k];
    return length3(d);
}
static double angle_of_chord(double chord) {
    return 2 * asin(fmin(chord / 2, 1));
}

static double weight_of(const struct building *building, const double corners[3][3]) {
    double u[3], v[3], normal[3];
    for (int k = 0; k < 3; k++) {
        u[k] = (corners[1][k] - corners[0][k]) / building->extent;
        v[k] = (corners[2][k] - corners[0][k]) / building->extent;
    }
    cross3(u, v, normal);
    return fmax(length3(normal) / 2, LEAST_WEIGHT);
}

/* The mean of its corners' normals and colours, and a cone around all that the triangle may be lit by. */
static struct made average_corners(const struct building *building, const uint32_t vertices[3], double weight,
                                   struct pop_node *node) {
    const pbr_points *points = building->mesh->vertices;
    struct made made = {.weight = weight};
    double normals[3][3], axis[3];
    for (int i = 0; i < 3; i++) {
        float n[3];
        splat_decode_normal(points->normals[vertices[i]], n);
        for (int k = 0; k < 3; k++) {
            normals[i][k] = (double)n[k];
            made.normal[k] += weight / 3 * normals[i][k];
            made.colour[k] += weight / 3 * (points->colours ? (double)building->linear[points->colours[vertices[i]][k]] : 1);
        }
    }
    const bool has_axis = encode_axis(&made, node, axis);
    double widest = 0;
    for (int i = 0; i < 3; i++)
        widest = has_axis && dot3(normals[i], normals[i]) > 0 ? fmax(widest, chord_between(axis, normals[i])) : 2;
    made.half_angle = angle_of_chord(widest);
    return made;
}

static struct made make_leaf(const struct building *building, uint64_t index) {
    struct pop *pop = building->pop;
    struct pop_node *node = node_of(pop, 0, index);
    const uint32_t *vertices = pop->triangles[index];
    double corners[3][3], centre[3];
    struct ball points[3];
    corners_of(building, vertices, corners);
    ball_centre_of_triangle((const double(*)[3])corners, centre);
    encode_centre(pop, centre, node, centre);
    for (int i = 0; i < 3; i++) {
        memcpy(points[i].centre, corners[i], sizeof points[i].centre);
        points[i].radius = 0;
    }
    struct made made = average_corners(building, vertices, weight_of(building, (const double(*)[3])corners), node);
    encode_rest(building, ball_radius_around(centre, points, 3), &made, node);
    return made;
}

static struct made combine(const struct building *building, const struct pop_node *children, const struct made *parts, int count,
                           struct pop_node *node) {
    struct made made = {0};
    struct ball balls[POP_CHILDREN];
    double axis[3], centre[3];
    for (int i = 0; i < count; i++) {
        const struct pop_ball ball = pop_decode_ball(building->pop, &children[i]);
        for (int k = 0; k < 3; k++) {
            balls[i].centre[k] = (double)ball.centre[k];
            made.normal[k] += parts[i].normal[k];
            made.colour[k] += parts[i].colour[k];
        }
        balls[i].radius = (double)ball.radius;
        made.weight += parts[i].weight;
    }
    const bool has_axis = encode_axis(&made, node, axis);
    for (int i = 0; i < count; i++) {
        double other[3];
        if (has_axis && decode_axis(&children[i], other))
            made.half_angle = fmax(made.half_angle, fmin(angle_of_chord(chord_between(axis, other)) + parts[i].half_angle, M_PI));
        else made.half_angle = M_PI;
    }
    const struct ball around = ball_around(balls, count);
    encode_centre(building->pop, around.centre, node, centre);
    encode_rest(building, ball_radius_around(centre, balls, count), &made, node);
    return made;
}

/* The node and all below, but for what was made before. */
static struct made make_node(const struct building *building, uint32_t level, uint64_t index, bool below_is_made) {
    struct pop *pop = building->pop;
    struct made parts[POP_CHILDREN];
    uint64_t first;
    if (below_is_made && level == building->cut_level) return building->made[index];
    if (level == 0) return make_leaf(building, index);
    const uint32_t count = pop_children(&pop->shape, level, index, &first);
    for (uint32_t i = 0; i < count; i++) parts[i] = make_node(building, level - 1, first + i, below_is_made);
    struct pop_node *node = node_of(pop, level, index);
    return combine(building, pop_node_at(pop, level - 1, first), parts, (int)count, node);
}

static pbr_result make_nodes(void *user, size_t begin, size_t end) {
    const struct building *building = user;
    for (size_t i = begin; i < end; i++) building->made[i] = make_node(building, building->cut_level, i, false);
    return PBR_OK;
}

static pbr_result make_tree(struct building *building, const struct progress *progress) {
    enum { PIECES = 256 }; /* that threads share, and on each of them at least so many triangles: */
    const struct pop_shape *shape = &building->pop->shape;
    uint32_t level = shape->level_count - 1;
    while (level > 0 && shape->levels[level].count < PIECES) level--;
    const size_t count = (size_t)shape->levels[level].count;
    building->cut_level = level;
    building->made = pbr_allocate(building->instance, count, sizeof *building->made);
    if (!building->made) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = progress_report(progress, "building", 0);
    if (result == PBR_OK) result = pbr_parallel(building->instance, count, (count + PIECES - 1) / PIECES, make_nodes, building);
    if (result != PBR_OK) return result;
    make_node(building, shape->level_count - 1, 0, true);
    return progress_report(progress, "building", 1);
}

/* ---- Order ---- */

static pbr_result make_items(void *user, size_t begin, size_t end) {
    const struct building *building = user;
    const double scale = POP_ITEM_EXTENT / (2 * building->extent), most = POP_ITEM_EXTENT;
    for (size_t i = begin; i < end; i++) {
        double corners[3][3], centre[3];
        corners_of(building, building->mesh->triangles[i], corners);
        ball_centre_of_triangle((const double(*)[3])corners, centre);
        struct pop_item *item = &building->items[i];
        for (int k = 0; k < 3; k++) item->at[k] = (int32_t)fmax(fmin(rint(centre[k] * scale), most), -most);
        item->triangle = (uint32_t)i;
    }
    return PBR_OK;
}

static pbr_result place_triangles(void *user, size_t begin, size_t end) {
    const struct building *building = user;
    for (size_t i = begin; i < end; i++)
        memcpy((void *)(uintptr_t)building->pop->triangles[i], building->mesh->triangles[building->items[i].triangle],
               sizeof(uint32_t[3]));
    return PBR_OK;
}

static pbr_result order_triangles(struct building *building, const struct progress *progress) {
    enum { GRAIN = 1 << 13 };
    pbr_instance *instance = building->instance;
    const size_t count = (size_t)building->mesh->triangle_count;
    building->items = pbr_allocate(instance, count, sizeof *building->items);
    if (!building->items) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_result result = pbr_parallel(instance, count, GRAIN, make_items, building);
    if (result == PBR_OK) result = pop_order(instance, building->items, count, progress);
    if (result == PBR_OK) result = pbr_parallel(instance, count, GRAIN, place_triangles, building);
    pbr_free(instance, building->items);
    building->items = NULL;
    return result;
}

/* ---- Vertices ---- */

static pbr_result make_records(void *user, size_t begin, size_t end) {
    const struct building *building = user;
    const pbr_points *points = building->mesh->vertices;
    struct splat *records = (struct splat *)(uintptr_t)building->pop->vertices;
    for (size_t i = begin; i < end; i++) {
        double position[3];
        vertex_position(building, (uint32_t)i, position);
        for (int k = 0; k < 3; k++) records[i].position[k] = (float)position[k];
        for (int k = 0; k < 2; k++) records[i].normal[k] = points->normals ? points->normals[i][k] : SPLAT_NO_NORMAL;
        if (points->colours) memcpy(records[i].colour, points->colours[i], sizeof records[i].colour);
        else memset(records[i].colour, 255, sizeof records[i].colour);
    }
    return PBR_OK;
}

/* A triangle is blended with the splats around it as one of this radius. */
static pbr_result spread_radii(const struct building *building) {
    const struct pop *pop = building->pop;
    struct splat *records = (struct splat *)(uintptr_t)pop->vertices;
    uint32_t *counts = pbr_allocate(building->instance, (size_t)pop->vertex_count, sizeof *counts);
    if (!counts) return PBR_ERROR_OUT_OF_MEMORY;
    for (uint64_t i = 0; i < building->mesh->triangle_count; i++) {
        const float radius = pop_decode_ball(pop, pop_node_at(pop, 0, i)).radius;
        for (int k = 0; k < 3; k++) {
            const uint32_t vertex = pop->triangles[i][k];
            records[vertex].radius += (radius - records[vertex].radius) / (float)++counts[vertex]; /* the mean so far */
        }
    }
    pbr_free(building->instance, counts);
    return PBR_OK;
}

static pbr_result make_vertices(const struct building *building) {
    struct pop *pop = building->pop;
    const pbr_mesh *mesh = building->mesh;
    pop->vertex_count = mesh->vertices->count;
    pop->vertices = pbr_allocate(building->instance, (size_t)pop->vertex_count, sizeof *pop->vertices);
    if (!pop->vertices) return PBR_ERROR_OUT_OF_MEMORY;
    pbr_parallel(building->instance, (size_t)pop->vertex_count, 1 << 14, make_records, (void *)(uintptr_t)building);
    for (uint64_t i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++) {
            const float *p = pop->vertices[pop->triangles[i][k]].position;
            const double at[3] = {(double)p[0], (double)p[1], (double)p[2]};
            pop->span = fmax(pop->span, dot3(at, at));
        }
    pop->span = sqrt(pop->span);
    return spread_radii(building);
}

/* ---- All of it ---- */

/* A ball is no larger than one around the box's middle that holds its children's, whose centres are in the box: within sqrt(3) of
 * the box's half side, and that much more with each level. */
static void choose_steps(const double minimum[3], const double maximum[3], struct pop *pop) {
    const double most_radius = 2 * POP_LEVELS, least = 0x1p-80; /* of a step: so that radius steps are no denormal floats */
    double reach = 0;
    for (int k = 0; k < 3; k++) reach = fmax(reach, fmax(maximum[k] - pop->centre[k], pop->centre[k] - minimum[k]));
    pop->position_step = float_above(fmax(reach / POP_POSITION_CODES, least));
    int exponent;
    frexp(most_radius * (double)pop->position_step * POP_POSITION_CODES / pop_decode_size((1u << POP_RADIUS_BITS) - 1), &exponent);
    pop->radius_step = ldexpf(1, exponent);
}

static pbr_result start(struct building *building) {
    const pbr_mesh *mesh = building->mesh;
    struct pop *pop = building->pop;
    pbr_result result = lod_choose_centre(building->instance, mesh->minimum, mesh->maximum, pop->centre, &building->extent);
    if (result != PBR_OK) return result;
    if (!(building->extent > 0)) building->extent = 1;
    for (int k = 0; k < 3; k++) building->origin[k] = mesh->vertices->origin[k] - pop->centre[k];
    for (int i = 0; i < 256; i++) building->linear[i] = linear_from_srgb((float)i / 255);
    choose_steps(mesh->minimum, mesh->maximum, pop);
    pop->has_colours = mesh->vertices->colours != NULL;
    pop->owns = true;
    pop->nodes = pbr_allocate(building->instance, (size_t)pop->shape.nodes, sizeof *pop->nodes);
    pop->triangles = pbr_allocate(building->instance, (size_t)mesh->triangle_count, sizeof *pop->triangles);
    return pop->nodes && pop->triangles ? PBR_OK : PBR_ERROR_OUT_OF_MEMORY;
}

static void measure_radius(struct pop *pop) {
    static const double centre[3] = {0, 0, 0};
    const struct pop_ball root = pop_decode_ball(pop, &pop->nodes[0]);
    const struct ball ball = {{(double)root.centre[0], (double)root.centre[1], (double)root.centre[2]}, (double)root.radius};
    pop->radius = ball_radius_around(centre, &ball, 1);
}

pbr_result pop_build(const pbr_mesh *mesh, const struct progress *progress, struct pop *pop) {
    struct building building = {.instance = mesh->instance, .mesh = mesh, .pop = pop};
    *pop = (struct pop){0};
    if (mesh->triangle_count > POP_TRIANGLES_MOST)
        return pbr_log(mesh->instance, PBR_LOG_ERROR, PBR_ERROR_LIMIT, "%llu triangles, the limit of a hierarchy is %llu",
                       (unsigned long long)mesh->triangle_count, (unsigned long long)POP_TRIANGLES_MOST);
    pop_shape_of(mesh->triangle_count, &pop->shape);
    if (mesh->triangle_count == 0) return progress_report(progress, "building", 1);
    pbr_result result = start(&building);
    if (result == PBR_OK) result = order_triangles(&building, progress);
    if (result == PBR_OK) result = make_tree(&building, progress);
    pbr_free(mesh->instance, building.made);
    if (result == PBR_OK) result = make_vertices(&building);
    if (result == PBR_OK) measure_radius(pop);
    else pop_free(mesh->instance, pop);
    return result;
}
