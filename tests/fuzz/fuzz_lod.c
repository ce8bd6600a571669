/* Any bytes as a hierarchy's file: opened, measured, cut or asked for ranges, made into points. SPDX-License-Identifier: MIT */
#include "fuzz.h"

#include <math.h>
#include <sys/mman.h>
#include <unistd.h>

#include "lod/cut.h"
#include "lod/lod.h"
#include "lod/spt_cut.h"

/* The input as a file; one for all inputs. Returns its path. */
static const char *as_file(const uint8_t *data, size_t size) {
    static int file = -1;
    static char path[64];
    if (file < 0) file = memfd_create("input", 0);
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    expect(file >= 0 && ftruncate(file, 0) == 0 && pwrite(file, data, size, 0) == (ssize_t)size, "there is memory for a file");
    return path;
}

/* Paths that meet may be walked more than once, but not all of them; no record is under 4 bytes. */
static uint64_t most_nodes(size_t size) {
    return size / 4 + (1 << 21);
}

/* Writes no more than the cut counts, which the address sanitizer watches. */
static void check_drawn(const pbr_lod *lod, const struct cut *cut) {
    struct splat *records = malloc(cut->count * sizeof *records + 1);
    uint32_t(*triangles)[3] = malloc(cut->triangle_count * sizeof *triangles + 1);
    if (!records || !triangles) abort();
    memset(records, 0xff, cut->count * sizeof *records);              /* what is not written is not finite, */
    memset(triangles, 0xff, cut->triangle_count * sizeof *triangles); /* or no vertex */
    lod_gather(lod, cut, records, triangles);
    for (size_t i = 0; i < cut->count; i++) {
        for (int k = 0; k < 3; k++) expect(isfinite(records[i].position[k]), "positions are finite");
        expect(records[i].radius >= 0 && isfinite(records[i].radius), "radii are finite and not negative");
    }
    for (size_t i = 0; i < cut->triangle_count; i++)
        for (int k = 0; k < 3; k++) expect(triangles[i][k] < lod->pop.vertex_count, "corners are vertices that are there");
    free(records);
    free(triangles);
}

/* Of a hierarchy over a mesh a cut is made of the last one, `before`; and here, of nothing. (They are the same where balls are no
 * larger than the hierarchy says, which is not asked of a file.) */
static void check_anew(pbr_instance *instance, const pbr_lod *lod, const struct cut_view *view, const struct cut *before) {
    const uint64_t nodes = lod->pop.shape.nodes, triangles = lod_triangle_count(lod);
    struct cut anew = {0};
    expect(lod_cut(lod, view, NULL, NULL, &anew) == PBR_OK, "a hierarchy can be cut once more");
    expect(anew.visited <= nodes && before->visited <= nodes, "each node is looked at once");
    expect(anew.count + anew.triangle_count <= nodes && before->count + before->triangle_count <= nodes, "each node is drawn once");
    expect(anew.triangle_count <= triangles && before->triangle_count <= triangles, "triangles are leaves");
    cut_free(instance, &anew);
}

/* Seen from outside at the first threshold; from its middle, facing, at the others. */
static void check_cut(pbr_instance *instance, const pbr_lod *lod, size_t size, double threshold, struct cut *cut) {
    const double scale = lod_radius(lod) > 0 ? 1 / lod_radius(lod) : 1;
    struct cut_view view = {.size_per_radius = 500 * scale,
                            .node_size_per_radius = 500 * scale,
                            .size_minimum = 1,
                            .size_maximum = 1e18,
                            .point_limit = 64,
                            .viewport = {1000, 1000},
                            .eye = {0, 0, 1, 0},
                            .culls = threshold > 0,
                            .threshold = threshold};
    for (int k = 0; k < 3; k++) view.to_clip[5 * k] = (threshold > 0 ? 2 : 0.5) * scale;
    view.to_clip[15] = 1;
    expect(lod_cut(lod, &view, NULL, NULL, cut) == PBR_OK, "a hierarchy can be cut");
    expect(cut->visited <= most_nodes(size), "a cut's work is bounded by the file");
    expect(cut->points_only <= cut->count, "a cut counts right");
    if (lod->kind == &lod_kind_pop) check_anew(instance, lod, &view, cut);
    else expect(cut->count <= cut->visited && cut->triangle_count == 0, "what is drawn was looked at");
    check_drawn(lod, cut);
}

/* Thresholds from 0, with steps that are small enough for a cut to be made of the last one at the end. */
static void check_cuts(pbr_instance *instance, const pbr_lod *lod, size_t size) {
    static const double thresholds[] = {0, 1, 2, 2.001, 2.002, 20};
    struct cut cut = {0};
    for (size_t i = 0; i < sizeof thresholds / sizeof *thresholds && lod_can_be_cut(lod); i++)
        check_cut(instance, lod, size, thresholds[i], &cut);
    cut_free(instance, &cut);
}

/* Of a sequential point tree; reads all of its tables, entries and fields. */
static void check_ranges(const struct spt *spt) {
    for (uint32_t c = 0; c < spt->chunk_count; c++) {
        const struct spt_chunk *chunk = &spt->chunks[c];
        for (double s = 1e-9; s < 1e12; s *= 97) {
            uint32_t first, end;
            spt_range(chunk, spt->steps[c], s, 0.5, 20, &first, &end);
            expect(first <= end && end <= chunk->count, "a range is within its chunk");
        }
        for (uint32_t i = 0; i < chunk->count; i++) {
            const struct spt_entry *entry = &spt->entries[c][i];
            expect(isfinite(spt_decode_radius(chunk, entry)) && isfinite(spt_decode_distance(chunk, entry->distance)) &&
                       spt_decode_error(chunk, entry->error) <= SPT_ENDLESS,
                   "what entries decode to is finite");
            double a[2] = {0, 0}, b[2] = {0, 0};
            if (spt->fields) normal_field_decode(&spt->fields[c][i], a, b);
            expect(fabs(a[0]) <= 2 && fabs(a[1]) <= 2 && fabs(b[0]) <= 2 && fabs(b[1]) <= 2, "fields are small");
        }
    }
}

/* And as a frame asks. */
static void check_list(pbr_instance *instance, const struct spt *spt) {
    struct spt_sizes *sizes = calloc(spt->chunk_count + 1, sizeof *sizes);
    struct draw_list list = {0};
    if (!sizes) abort();
    for (int known = 0; known < 2; known++)
        for (double threshold = 0; threshold < 3; threshold++) {
            const double scale = spt->radius > 0 ? 1 / spt->radius : 1;
            struct cut_view view = {.size_per_radius = 500 * scale,
                                    .node_size_per_radius = 500 * scale,
                                    .size_maximum = 1e18,
                                    .point_limit = 64,
                                    .viewport = {1000, 1000},
                                    .eye = {0, 0, 0, 1},
                                    .culls = threshold > 0,
                                    .threshold = threshold};
            for (int k = 0; k < 3; k++) view.to_clip[5 * k] = scale;
            view.to_clip[11] = -scale;
            view.to_clip[15] = threshold; /* in the middle, or before it */
            list.count = 0;
            expect(spt_list(instance, spt, sizes, &view, &list) == PBR_OK, "chunks can be listed");
            for (size_t i = 0; i < list.count; i++) {
                const struct draw_range *range = &list.ranges[i];
                expect(range->chunk < spt->chunk_count, "chunks that are listed are there");
                expect((uint64_t)range->first + range->count <= spt->chunks[range->chunk].count, "and so are their entries");
            }
            for (uint32_t c = 0; c < spt->chunk_count && !known; c++)
                spt_measure_sizes(&spt->chunks[c], spt->entries[c], &sizes[c]);
        }
    pbr_free(instance, list.ranges);
    free(sizes);
}

static void check_lod(struct host *host, pbr_instance *instance, const pbr_lod *lod, size_t size) {
    pbr_lod_info info = PBR_LOD_INFO_INIT;
    pbr_lod_statistics statistics = PBR_LOD_STATISTICS_INIT;
    pbr_points *points = NULL;
    expect(pbr_lod_get_info(lod, &info) == PBR_OK, "a hierarchy describes itself");
    for (int k = 0; k < 3; k++) expect(isfinite(info.centre[k]), "the centre is finite");
    expect(info.radius >= 0 && isfinite(info.radius), "the radius is finite and not negative");
    expect(pbr_lod_measure(lod, NULL, NULL, &statistics) == PBR_OK, "a hierarchy can be measured");
    expect(statistics.nodes <= most_nodes(size), "there are no more nodes than the file can hold");
    check_cuts(instance, lod, size);
    check_ranges(&lod->spt);
    check_list(instance, &lod->spt);
    /* A QSplat tree is only counted when it is walked. */
    const pbr_result result = pbr_lod_to_points(lod, NULL, NULL, &points);
    expect(result == (info.point_count > PBR_MAX_POINTS ? PBR_ERROR_LIMIT : PBR_OK), "a hierarchy becomes points");
    expect(!host->refused, "what a hierarchy takes is bounded by its file");
    pbr_points_release(&points);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct host host;
    pbr_instance *instance = host_start(&host, 16 * size + ((size_t)256 << 20));
    pbr_lod_open_desc desc = PBR_LOD_OPEN_DESC_INIT;
    pbr_lod *lod = NULL;
    desc.flags = PBR_LOD_OPEN_READ;
    const pbr_result result = pbr_lod_open(instance, as_file(data, size), &desc, &lod);
    expect(result == PBR_OK ? host.errors == 0 : host.errors == 1, "an error is explained once, a success never");
    expect((result == PBR_OK) == (lod != NULL), "an error leaves nothing");
    if (lod) check_lod(&host, instance, lod, size);
    pbr_lod_release(&lod);
    host_stop(&host, instance);
    return 0;
}
