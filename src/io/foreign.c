/* Formats that libpbr knows by their first bytes and does not read. SPDX-License-Identifier: MIT */
#include <string.h>

#include "formats.h"

struct foreign {
    const char *magic;
    size_t length;
    const char *advice; /* "... is not supported; ..." */
};

#define MAGIC(text) text, sizeof(text) - 1

static const struct foreign FOREIGN[] = {
    {MAGIC("ASTM-E57"), "E57 is not supported; convert it to LAS or PLY, for instance with CloudCompare or pdal translate"},
    {MAGIC("# .PCD"), "PCD is not supported; convert it to PLY, for instance with pcl_pcd2ply or pdal translate"},
    {MAGIC("VERSION .7"), "PCD is not supported; convert it to PLY, for instance with pcl_pcd2ply or pdal translate"},
    {MAGIC("QSplat"), "QSplat (.qs) is not supported; convert the mesh that it was made from to PLY, OBJ or OFF"},
    {MAGIC("solid "), "STL is not supported; convert it to PLY, OBJ or OFF, for instance with MeshLab"},
    {MAGIC("glTF"), "binary glTF is not supported; convert it to PLY or OBJ, for instance with Blender or assimp"},
    {MAGIC("{"), "JSON (glTF) is not supported; convert it to PLY or OBJ, for instance with Blender or assimp"},
    {MAGIC("PK\003\004"), "a zip archive is not supported; unpack it first"},
    {MAGIC("\037\213"), "gzip is not supported; unpack it first, or convert .spz to PLY"},
    {MAGIC("\376\377"), "UTF-16 text is not supported; convert it to UTF-8, for instance with iconv"},
    {MAGIC("\377\376"), "UTF-16 text is not supported; convert it to UTF-8, for instance with iconv"},
};

static const struct foreign *find(const struct reader *reader) {
    for (size_t i = 0; i < sizeof FOREIGN / sizeof *FOREIGN; i++)
        if (reader->size >= FOREIGN[i].length && memcmp(reader->data, FOREIGN[i].magic, FOREIGN[i].length) == 0) return &FOREIGN[i];
    return NULL;
}

bool foreign_recognise(const struct reader *reader) {
    return find(reader) != NULL;
}

pbr_result foreign_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content) {
    (void)desc;
    (void)content;
    const struct foreign *foreign = find(reader);
    return reader_error_byte(reader, PBR_ERROR_UNSUPPORTED, 0, "%s", foreign ? foreign->advice : "not a format that libpbr reads");
}
