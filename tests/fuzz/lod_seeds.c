/* Writes small hierarchies as the library does: what the fuzzer starts from. SPDX-License-Identifier: MIT
 *
 *   fuzz_lod_seeds FOLDER
 */
#include <math.h>
#include <pbr/pbr.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST = 200 };

/* Points along a spiral on a sphere. */
static pbr_lod *make_lod(pbr_instance *instance, uint32_t kind, uint32_t flags, size_t count, int attributes) {
    static float positions[MOST][3], radii[MOST];
    static uint8_t colours[MOST][4];
    pbr_points_desc points_desc = PBR_POINTS_DESC_INIT;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_points *points = NULL;
    pbr_lod *lod = NULL;
    for (size_t i = 0; i < count; i++) {
        const float z = (2 * (float)i + 1) / (float)count - 1, turn = 2.4f * (float)i, s = sqrtf(1 - z * z);
        positions[i][0] = s * cosf(turn), positions[i][1] = s * sinf(turn), positions[i][2] = z;
        radii[i] = 2 / sqrtf((float)count);
        for (int k = 0; k < 3; k++) colours[i][k] = (uint8_t)(127 + 127 * positions[i][k]);
        colours[i][3] = 255;
    }
    points_desc.count = count;
    points_desc.positions = (pbr_attribute){.data = positions, .format = PBR_FORMAT_FLOAT32, .components = 3};
    points_desc.radii = (pbr_attribute){.data = radii, .format = PBR_FORMAT_FLOAT32, .components = 1};
    if (attributes) {
        points_desc.normals = points_desc.positions;
        points_desc.colours = (pbr_attribute){.data = colours, .format = PBR_FORMAT_UINT8, .components = 4};
    }
    if (pbr_points_create(instance, &points_desc, &points) != PBR_OK) return NULL;
    desc.kind = kind;
    desc.flags = flags;
    desc.points = points;
    pbr_lod_create(instance, &desc, &lod);
    pbr_points_release(&points);
    return lod;
}

/* A strip of triangles along a screw, twisted, two vertices to each step. */
static pbr_lod *make_strip(pbr_instance *instance, size_t count, int attributes) {
    static float positions[MOST + 2][3];
    static uint8_t colours[MOST + 2][4];
    static uint16_t triangles[MOST][3];
    pbr_mesh_desc mesh_desc = PBR_MESH_DESC_INIT;
    pbr_lod_desc desc = PBR_LOD_DESC_INIT;
    pbr_mesh *mesh = NULL;
    pbr_lod *lod = NULL;
    for (size_t i = 0; i < count + 2; i++) {
        const float turn = 0.1f * (float)(i / 2), side = i % 2 ? 0.2f : -0.2f;
        positions[i][0] = (1 + side) * cosf(turn), positions[i][1] = 0.05f * turn, positions[i][2] = (1 + side) * sinf(turn);
        for (int k = 0; k < 3; k++) colours[i][k] = (uint8_t)(i * 5 + 80 * (size_t)k);
        colours[i][3] = 255;
    }
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++) triangles[i][k] = (uint16_t)(i + (i % 2 && k ? 3 - k : k));
    mesh_desc.vertex_count = count > 0 ? count + 2 : 0;
    mesh_desc.positions = (pbr_attribute){.data = positions, .format = PBR_FORMAT_FLOAT32, .components = 3};
    if (attributes) mesh_desc.colours = (pbr_attribute){.data = colours, .format = PBR_FORMAT_UINT8, .components = 4};
    mesh_desc.indices = triangles;
    mesh_desc.index_format = PBR_FORMAT_UINT16;
    mesh_desc.triangle_count = count;
    if (pbr_mesh_create(instance, &mesh_desc, &mesh) != PBR_OK) return NULL;
    desc.kind = PBR_LOD_POP;
    desc.mesh = mesh;
    pbr_lod_create(instance, &desc, &lod);
    pbr_mesh_release(&mesh);
    return lod;
}

int main(int argc, char **argv) {
    static const size_t counts[] = {0, 1, 4, 5, 40, MOST};
    static const struct {
        uint32_t kind, flags, file_format;
        const char *name;
    } forms[] = {{PBR_LOD_QSPLAT, 0, PBR_LOD_FILE_PBR, "pbr"},
                 {PBR_LOD_QSPLAT, 0, PBR_LOD_FILE_QS, "qs"},
                 {PBR_LOD_SPT, 0, PBR_LOD_FILE_PBR, "spt.pbr"},
                 {PBR_LOD_SPT, PBR_LOD_NORMAL_FIELDS, PBR_LOD_FILE_PBR, "fields.pbr"},
                 {PBR_LOD_POP, 0, PBR_LOD_FILE_PBR, "pop.pbr"}};
    pbr_instance *instance = NULL;
    if (argc != 2 || pbr_instance_create(NULL, &instance) != PBR_OK) return 2;
    for (size_t i = 0; i < 2 * sizeof counts / sizeof *counts; i++)
        for (size_t f = 0; f < sizeof forms / sizeof *forms; f++) {
            char path[4096];
            pbr_lod *lod = forms[f].kind == PBR_LOD_POP ? make_strip(instance, counts[i / 2], i % 2)
                                                        : make_lod(instance, forms[f].kind, forms[f].flags, counts[i / 2], i % 2);
            snprintf(path, sizeof path, "%s/%zu%s.%s", argv[1], counts[i / 2], i % 2 ? "_all" : "", forms[f].name);
            if (!lod || pbr_lod_save(lod, path, forms[f].file_format, NULL, NULL) != PBR_OK) {
                fprintf(stderr, "%s: cannot be written\n", path);
                return 1;
            }
            pbr_lod_release(&lod);
        }
    pbr_instance_destroy(&instance);
    return 0;
}
