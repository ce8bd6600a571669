/* Blocks, chunks and packed records. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/blocks.h"

static pbr_points *make_points(pbr_instance *instance, const void *positions, uint32_t format, uint64_t count, const float *radii) {
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points;
    desc.count = count;
    desc.positions = (pbr_attribute){positions, 0, format, 3};
    if (radii) desc.radii = (pbr_attribute){radii, 0, PBR_FORMAT_FLOAT32, 1};
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    return points;
}

/* What every cut promises. Returns the largest shift of a coordinate by packing, in radii of its splat. */
static double check_blocks(const pbr_points *points, const struct blocks *blocks) {
    uint8_t *seen = calloc(points->count + 1, 1);
    uint64_t next = 0;
    uint32_t next_block = 0;
    double worst = 0;
    for (uint32_t c = 0; c < blocks->chunk_count; c++) {
        const struct chunk *chunk = &blocks->chunks[c];
        struct splat *splats = calloc(chunk->count, sizeof *splats);
        assert_int_equal(chunk->first, next);
        assert_int_equal(chunk->first_block, next_block);
        assert_true(chunk->count > 0 && chunk->count <= CHUNK_SPLATS && chunk->block_count > 0);
        blocks_pack(points, blocks, c, splats);
        uint32_t record = 0;
        for (uint32_t b = 0; b < chunk->block_count; b++) {
            const struct block *block = &blocks->blocks[next_block++];
            assert_int_equal(block->chunk, c);
            assert_int_equal(block->first, record);
            assert_true(block->count > 0 && block->count <= BLOCK_SPLATS);
            for (uint32_t i = 0; i < block->count; i++, record++) {
                const uint32_t point = blocks->order[chunk->first + record];
                const struct splat *splat = &splats[record];
                double p[3], squared = 0;
                points_position(points, point, p);
                assert_int_equal(seen[point]++, 0);
                assert_true(splat->radius == (points->radii ? points->radii[point] : 0));
                assert_true(splat->radius <= block->largest_splat);
                for (int k = 0; k < 3; k++) {
                    double packed = chunk->origin[k] + splat->position[k], shift = fabs(packed - p[k]);
                    squared += (packed - block->centre[k]) * (packed - block->centre[k]);
                    if (shift > 0) worst = fmax(worst, shift / splat->radius);
                }
                /* The radius is rounded up in float; 1e-12 is for the double arithmetic of this check. */
                assert_true(sqrt(squared) <= block->radius * (1 + 1e-12));
            }
        }
        assert_int_equal(record, chunk->count);
        next += chunk->count;
        free(splats);
    }
    assert_int_equal(next, points->count);
    assert_int_equal(next_block, blocks->block_count);
    free(seen);
    return worst;
}

static void blocks_hold_every_point_once_inside_their_spheres(void **state) {
    (void)state;
    enum { MOST = 30000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*positions)[3] = calloc(MOST, sizeof *positions), *radii = calloc(MOST, sizeof *radii);
    uint64_t random = 1;
    for (int i = 0; i < MOST; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] = (float)(uniform(&random) + (k == 1 ? 5e6 : -3 * k));
        radii[i] = (float)(0.01 * uniform(&random));
    }
    const uint64_t counts[] = {0, 1, BLOCK_SPLATS - 1, BLOCK_SPLATS, BLOCK_SPLATS + 1, 2 * BLOCK_SPLATS, MOST};
    for (size_t i = 0; i < COUNT(counts); i++) {
        pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT32, counts[i], radii);
        struct blocks blocks;
        assert_int_equal(blocks_build(points, &blocks), PBR_OK);
        assert_true(check_blocks(points, &blocks) == 0); /* float positions are moved exactly */
        if (counts[i] <= BLOCK_SPLATS)
            for (uint32_t j = 0; j < counts[i]; j++) assert_int_equal(blocks.order[j], j);
        blocks_free(instance, &blocks);
        pbr_points_release(&points);
    }
    free(positions);
    free(radii);
    host_stop(&host, instance);
}

/* 64 blocks along a curve through a cube are far smaller than the cube: culling would be pointless otherwise. */
static void blocks_are_local(void **state) {
    (void)state;
    enum { MANY = 64 * BLOCK_SPLATS };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*positions)[3] = calloc(MANY, sizeof *positions);
    uint64_t random = 2;
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++) positions[i][k] = (float)uniform(&random);
    pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT32, MANY, NULL);
    struct blocks blocks;
    double mean = 0;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    check_blocks(points, &blocks);
    for (uint32_t b = 0; b < blocks.block_count; b++) mean += blocks.blocks[b].radius / blocks.block_count;
    /* The curve's cells of 1/64 of the cube hold a little more or less than a block, so most blocks lie in two neighbouring cells:
     * half the diagonal of such a box is 0.306, that of the cube 0.866. A few blocks straddle the curve's long jumps. */
    assert_true(mean < 0.35);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    free(positions);
    host_stop(&host, instance);
}

/* Survey coordinates with details of millimetres, over kilometres: one float origin could not hold them. */
static void packed_survey_coordinates_keep_their_detail(void **state) {
    (void)state;
    enum { MANY = 60000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    double(*positions)[3] = calloc(MANY, sizeof *positions);
    float *radii = calloc(MANY, sizeof *radii);
    uint64_t random = 3;
    for (int i = 0; i < MANY; i++) {
        /* Dense spots, as around a scanner's stations. */
        double x = 500 * (i / 6000), y = 300 * (i / 6000 % 3);
        positions[i][0] = 637000 + x + 10 * uniform(&random);
        positions[i][1] = 851000 + y + 10 * uniform(&random);
        positions[i][2] = 120 + uniform(&random);
        radii[i] = 0.002f;
    }
    pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT64, MANY, radii);
    struct blocks blocks;
    assert_non_null(points->wide);
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    assert_true(check_blocks(points, &blocks) <= 1.0 / 128);
    assert_true(blocks.chunk_count > 1 && blocks.chunk_count <= 60);
    for (uint32_t c = 0; c < blocks.chunk_count; c++) { /* and in object space, origin and all */
        const struct chunk *chunk = &blocks.chunks[c];
        struct splat *splats = calloc(chunk->count, sizeof *splats);
        blocks_pack(points, &blocks, c, splats);
        for (uint32_t i = 0; i < chunk->count; i++)
            for (int k = 0; k < 3; k++) {
                double p = points->origin[k] + chunk->origin[k] + splats[i].position[k];
                /* 1.2e-10: half a unit in the last place of 851000 in double, for each of the sums */
                assert_true(fabs(p - positions[blocks.order[chunk->first + i]][k]) <= 0.002 / 128 + 4 * 1.2e-10);
            }
        free(splats);
    }
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    free(positions);
    free(radii);
    host_stop(&host, instance);
}

/* A cloud of millimetre splats with a stray point at (0, 0, 0): no block may hold both. */
static void a_stray_point_costs_its_block_no_precision(void **state) {
    (void)state;
    enum { MANY = 1000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    double positions[MANY][3];
    float radii[MANY];
    uint64_t random = 5;
    for (int i = 0; i < MANY; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] = i == 500 ? 0 : 500000 + uniform(&random);
        radii[i] = 0.001f;
    }
    pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT64, MANY, radii);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    assert_true(check_blocks(points, &blocks) <= 1.0 / 128);
    assert_int_equal(blocks.chunk_count, 2);
    assert_true(blocks.block_count <= 12); /* halving 1000 records down to the stray one */
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

/* Radii that no float could honour may not make a buffer for each point. */
static void absurd_radii_do_not_multiply_chunks(void **state) {
    (void)state;
    enum { MANY = 20000 };
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    double(*positions)[3] = calloc(MANY, sizeof *positions);
    float *radii = calloc(MANY, sizeof *radii);
    uint64_t random = 6;
    for (int i = 0; i < MANY; i++) {
        for (int k = 0; k < 3; k++) positions[i][k] = 1e6 * uniform(&random);
        radii[i] = 1e-30f;
    }
    pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT64, MANY, radii);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    check_blocks(points, &blocks);
    assert_true(blocks.chunk_count <= 300);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    free(positions);
    free(radii);
    host_stop(&host, instance);
}

static void coincident_points_make_full_blocks(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*positions)[3] = calloc(3 * BLOCK_SPLATS, sizeof *positions);
    pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT32, 3 * BLOCK_SPLATS, NULL);
    struct blocks blocks;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    check_blocks(points, &blocks);
    assert_int_equal(blocks.block_count, 3);
    for (int b = 0; b < 3; b++) assert_true(blocks.blocks[b].radius == 0);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    free(positions);
    host_stop(&host, instance);
}

static void absent_attributes_pack_as_none_white_and_zero(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const float position[3] = {1, 2, 3};
    pbr_points *points = make_points(instance, position, PBR_FORMAT_FLOAT32, 1, NULL);
    struct blocks blocks;
    struct splat splat;
    assert_int_equal(blocks_build(points, &blocks), PBR_OK);
    blocks_pack(points, &blocks, 0, &splat);
    assert_true(splat.radius == 0);
    assert_int_equal(splat.normal[0], SPLAT_NO_NORMAL);
    assert_int_equal(splat.normal[1], SPLAT_NO_NORMAL);
    for (int k = 0; k < 4; k++) assert_int_equal(splat.colour[k], 255);
    blocks_free(instance, &blocks);
    pbr_points_release(&points);
    host_stop(&host, instance);
}

static pbr_result build(pbr_instance *instance, void *user) {
    struct blocks blocks;
    pbr_result result = blocks_build(user, &blocks);
    if (result == PBR_OK) blocks_free(instance, &blocks);
    return result;
}

static void failing_allocations_leave_nothing_behind(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 2);
    float(*positions)[3] = calloc(5000, sizeof *positions);
    for (int i = 0; i < 5000; i++) positions[i][0] = (float)i;
    pbr_points *points = make_points(instance, positions, PBR_FORMAT_FLOAT32, 5000, NULL);
    fail_every_allocation(&host, instance, build, points);
    pbr_points_release(&points);
    free(positions);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blocks_hold_every_point_once_inside_their_spheres),
        cmocka_unit_test(blocks_are_local),
        cmocka_unit_test(packed_survey_coordinates_keep_their_detail),
        cmocka_unit_test(a_stray_point_costs_its_block_no_precision),
        cmocka_unit_test(absurd_radii_do_not_multiply_chunks),
        cmocka_unit_test(coincident_points_make_full_blocks),
        cmocka_unit_test(absent_attributes_pack_as_none_white_and_zero),
        cmocka_unit_test(failing_allocations_leave_nothing_behind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
