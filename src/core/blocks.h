/* A point set cut into spatial blocks and packed as splat records: how a whole cloud lies on the GPU.
 *
 * Points are ordered along a Morton curve and cut into blocks of at most BLOCK_SPLATS, the unit of culling. Runs of blocks form
 * chunks, the unit of a GPU buffer, each with a double origin of its own so that its float positions are exact enough: no
 * coordinate moves by more than 1/128 of its point's radius where the input is finer than that (short of absurd radii, see
 * blocks_build). SPDX-License-Identifier: MIT */
#ifndef PBR_CORE_BLOCKS_H
#define PBR_CORE_BLOCKS_H

#include "points.h"
#include "splat.h"

enum { BLOCK_SPLATS = 2048, CHUNK_SPLATS = 1 << 22 /* 96 MiB of records: below the 128 MiB of a storage block */ };

struct block {
    double centre[3]; /* of a sphere around the splats' centres; object space relative to the points' origin */
    float radius;
    float largest_splat; /* radius */
    float axis[3], cone; /* of the splats' normals: unit, and the cosine of the largest angle to it; -1: they have none in common */
    uint32_t chunk;
    uint32_t first, count; /* records within the chunk */
};

struct chunk {
    double origin[3]; /* relative to the points' origin */
    uint64_t first;   /* index into `order` */
    uint32_t count;
    uint32_t first_block, block_count;
};

struct blocks {
    uint32_t *order; /* points->count: record -> point */
    struct block *blocks;
    struct chunk *chunks;
    uint32_t block_count, chunk_count;
};

/* Orders and cuts (float sets of at most BLOCK_SPLATS keep the host's order); the arrays belong to `out` until blocks_free. */
pbr_result blocks_build(const pbr_points *points, struct blocks *out);
void blocks_free(pbr_instance *instance, struct blocks *blocks);

/* Packs the records of one chunk (chunk->count of them). Points without normals, colours or radii get none, white and 0. */
void blocks_pack(const pbr_points *points, const struct blocks *blocks, uint32_t chunk, struct splat *out);

#endif
