/* SPDX-License-Identifier: MIT */
/** @file io.h
 * libpbr-io: reading and writing point and mesh files. The format is recognised by content, not by name. Every file is treated as
 * hostile: sizes are checked before they are used, and an error names the file, the place and the reason in the log.
 */
#ifndef PBR_IO_H
#define PBR_IO_H

#include <pbr/lod.h>
#include <pbr/mesh.h>
#include <pbr/points.h>

PBR_BEGIN_DECLS

/** File formats. */
enum {
    PBR_FILE_UNKNOWN = 0, /**< Nothing was read. */
    /** PLY, ASCII or binary of either byte order. Of a vertex: x y z, nx ny nz, red green blue alpha (or r g b a, or diffuse_red
     * ...), radius; other numbers of it are scalars. Faces are polygons or triangle strips. Where a mesh has no colours, but
     * texture coordinates and a `comment TextureFile`, a vertex gets the mean of the texture around it: see docs/files.md. */
    PBR_FILE_PLY = 1,
    /** LAS 1.0 to 1.5, point formats 0 to 10, not compressed. Scalars: intensity, classification, return_number,
     * number_of_returns, and relative_gps_time, in seconds after the first point's (a float would lose the absolute time).
     * 16-bit colours; where none of the file passes 255, they are 8-bit colours. */
    PBR_FILE_LAS = 2,
    /** Text, a point a line (.xyz, .asc, .txt, .csv), parted by blanks, commas or semicolons: x y z; then of 4 columns a scalar, of
     * 6 normals if all have length 1, else colours; of 7 a scalar and those three; of 9 normals and colours, either first. Of any
     * other number, scalars. Colours lie in 0..1, 0..255 or 0..65535, as the largest number of the file says, and are sRGB. */
    PBR_FILE_XYZ = 3,
    /** The same after a line that counts the points, of one scan or several; the scalar is the intensity. */
    PBR_FILE_PTS = 4,
    /** Wavefront OBJ: v with or without r g b, vn, f. A vertex has one normal: the mean of those that its corners name; of a file
     * without faces, the vn of the same number. Colours as in #PBR_FILE_XYZ; a vertex of a mesh without gets the mean of the
     * materials around it (mtllib, usemtl, vt): map_Kd, else Kd; see docs/files.md. The rest is ignored. */
    PBR_FILE_OBJ = 5,
    /** OFF, COFF, NOFF, CNOFF as text. Colours as in #PBR_FILE_XYZ. */
    PBR_FILE_OFF = 6,
    /** TRI (University of West Bohemia): sections Vertices, Vertices' Normals, Vertices' Colours and Triangles, each with its
     * number of rows, of three numbers each. Indices count from 0 or 1, as they themselves show, and `encoding` tells which.
     * Colours as in #PBR_FILE_XYZ. Other sections are passed over. More in docs/files.md. */
    PBR_FILE_TRI = 7
};

/** Flags of #pbr_read_desc. */
enum {
    /** Read through a buffer, not a memory mapping: for pipes, and for files that others may change or truncate meanwhile. Sizes are found
     * in one pass and used in another: of a mapped file that changes between them, memory may be overwritten. */
    PBR_READ_STREAM = 1u << 0,
    /** Do not estimate radii for points that have none (and no faces): take the file as it is. */
    PBR_READ_KEEP_RADII = 1u << 1
};

/** How to read. */
typedef struct pbr_read_desc {
    size_t struct_size;
    uint32_t flags;             /**< PBR_READ_... */
    uint32_t radius_neighbours; /**< As in #pbr_points_desc. */
    float radius_scale;         /**< Factor on estimated radii and on those from faces, 0 = 1. */
    uint32_t reserved;          /**< Must be 0. */
    pbr_progress_fn progress;   /**< May be NULL. */
    void *progress_user;        /**< First argument of `progress`. */
} pbr_read_desc;

#define PBR_READ_DESC_INIT PBR_SIZED(pbr_read_desc)

/** What a file holds. Set `struct_size` before the call (#PBR_FILE_CONTENT_INIT). */
typedef struct pbr_file_content {
    size_t struct_size;
    uint32_t format;        /**< PBR_FILE_... */
    uint32_t warning_count; /**< Things put right or left out; each was logged as a warning (the first few of each kind). */
    uint64_t vertex_count;  /**< Vertices or points read from the file, before any is dropped. */
    uint64_t face_count;    /**< Faces read from the file: polygons, or the triangles of strips. */
    int32_t radii_estimated; /**< 1: the points' radii were estimated from their spacing (#PBR_POINTS_ESTIMATE_RADII). */
    uint32_t reserved;       /**< 0. */
    pbr_points *points;     /**< Set if the file has no faces: one point a vertex. The caller releases it. */
    pbr_mesh *mesh;         /**< Set if the file has faces: polygons are fanned into triangles. The caller releases it. */
    char encoding[32];      /**< For instance "binary_little_endian". */
} pbr_file_content;

#define PBR_FILE_CONTENT_INIT PBR_SIZED(pbr_file_content)

/**
 * Reads a file: points, with radii estimated if it has none (but see #PBR_READ_KEEP_RADII), or a mesh. Materials and textures that
 * it names are read if they lie in its folder or below; where they cannot be, there is a warning, and the mesh has no colours.
 * @param instance  Outlives what is read.
 * @param path      UTF-8.
 * @param desc      NULL = defaults.
 * @param content   Written on success; on error its points and mesh are NULL. What it pointed to before is not released.
 * @return #PBR_OK, #PBR_ERROR_IO, #PBR_ERROR_FORMAT, #PBR_ERROR_UNSUPPORTED, #PBR_ERROR_LIMIT, #PBR_ERROR_OUT_OF_MEMORY,
 *         #PBR_ERROR_CANCELLED, #PBR_ERROR_INVALID_ARGUMENT.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_read_file(pbr_instance *instance, const char *path, const pbr_read_desc *desc, pbr_file_content *content);

/**
 * The same from memory. Other files that the data names are not read.
 * @param instance  Outlives what is read.
 * @param name      Names the source in messages; NULL = "memory".
 * @param data      `size` bytes, read during the call only; NULL with 0.
 * @param size      Bytes.
 * @param desc      NULL = defaults. #PBR_READ_STREAM changes nothing.
 * @param content   As #pbr_read_file.
 * @return As #pbr_read_file, but for #PBR_ERROR_IO. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_read_memory(pbr_instance *instance, const char *name, const void *data, size_t size, const pbr_read_desc *desc,
                                   pbr_file_content *content);

/**
 * Reads a file into points that can be drawn: those of the file with radii (given, or estimated), or those of its mesh
 * (#pbr_mesh_to_points).
 * @param instance  Outlives the points.
 * @param path      UTF-8.
 * @param desc      NULL = defaults. With #PBR_READ_KEEP_RADII points may be without radii: they are drawn at the smallest size.
 * @param out       Receives the points with one reference, or NULL on error.
 * @return As #pbr_read_file. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_read_points(pbr_instance *instance, const char *path, const pbr_read_desc *desc, pbr_points **out);

/** The points of a file, read where they lie, a range at a time: for more than fits into memory (#pbr_lod_build_file). */
typedef struct pbr_file_source pbr_file_source;

/** What a #pbr_file_source holds. Set `struct_size` before the call (#PBR_FILE_SOURCE_INFO_INIT). */
typedef struct pbr_file_source_info {
    size_t struct_size;
    uint32_t format;        /**< #PBR_FILE_PLY or #PBR_FILE_LAS. */
    uint32_t warning_count; /**< As in #pbr_file_content. */
    uint64_t point_count;   /**< Whole ones that the file holds. */
    uint64_t face_count;    /**< Faces beside them, as the file declares; they are not read. */
    int32_t has_normals;    /**< 1: normals are read. */
    int32_t has_colours;    /**< 1: colours are read. */
    int32_t has_radii;      /**< 1: radii are read. */
    uint32_t reserved;      /**< 0. */
    char encoding[32];      /**< As in #pbr_file_content. */
} pbr_file_source_info;

#define PBR_FILE_SOURCE_INFO_INIT PBR_SIZED(pbr_file_source_info)

/**
 * Opens a file of points for reading it in pieces. Experimental. It must be LAS, or binary PLY whose vertices have no lists, and a
 * regular file: it is mapped, and a mapped file that somebody shortens ends the process with SIGBUS when its lost part is read. Of
 * LAS whose colours do not pass 255 all colours are looked at now; of other files the header only.
 * @param instance       Outlives the source.
 * @param path           UTF-8.
 * @param progress       May be NULL; returning 0 cancels.
 * @param progress_user  First argument of `progress`.
 * @param out            Receives the source, or NULL on error.
 * @return As #pbr_read_file; #PBR_ERROR_UNSUPPORTED also for files that can only be read whole, text for instance.
 * Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_file_source_open(pbr_instance *instance, const char *path, pbr_progress_fn progress, void *progress_user,
                                        pbr_file_source **out);

/**
 * Describes a source. Experimental.
 * @param source  Is only read.
 * @param info    `struct_size` set by the caller; as much of the structure is written.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_file_source_get_info(const pbr_file_source *source, pbr_file_source_info *info);

/**
 * Reads points [first, first + count), with the values that #pbr_read_file gives. A #pbr_lod_source_fn. Experimental.
 * @param source  A #pbr_file_source; only read.
 * @param first   Counts from 0, in the order of the file.
 * @param count   Any number that the file holds.
 * @param batch   Where to. Normals and radii that the file lacks are left as they are, and colours become white. Arrays but for
 *                the positions may be NULL.
 * @return #PBR_OK, #PBR_ERROR_INVALID_ARGUMENT. Any thread, several at once; no context. Since 0.1.
 */
PBR_API pbr_result pbr_file_source_read(void *source, uint64_t first, uint64_t count, const pbr_lod_batch *batch);

/**
 * Closes a source and sets `*source` to NULL. Experimental.
 * @param source  NULL and a pointer to NULL are allowed.
 * Any thread; no context. Since 0.1.
 */
PBR_API void pbr_file_source_close(pbr_file_source **source);

/** How to write. */
typedef struct pbr_write_desc {
    size_t struct_size;
    uint32_t flags;           /**< Must be 0. */
    uint32_t reserved;        /**< Must be 0. */
    pbr_progress_fn progress; /**< May be NULL. */
    void *progress_user;      /**< First argument of `progress`. */
} pbr_write_desc;

#define PBR_WRITE_DESC_INIT PBR_SIZED(pbr_write_desc)

/**
 * Writes points or a mesh as binary little-endian PLY: positions as float, or as double where float would change one; normals, if
 * they were given; colours with alpha; radii and scalars of points (a mesh's scalars are not written). The file appears under its
 * name when it is complete; until then the old one stays.
 * @param instance  Receives messages, and lends memory during the call.
 * @param path      UTF-8; must end in .ply.
 * @param points    Either points or a mesh; the other is NULL.
 * @param mesh      See `points`.
 * @param desc      NULL = defaults.
 * @return #PBR_OK, #PBR_ERROR_IO, #PBR_ERROR_UNSUPPORTED (another ending), #PBR_ERROR_OUT_OF_MEMORY, #PBR_ERROR_CANCELLED,
 *         #PBR_ERROR_INVALID_ARGUMENT. Any thread; no context. Since 0.1.
 */
PBR_API pbr_result pbr_write_file(pbr_instance *instance, const char *path, const pbr_points *points, const pbr_mesh *mesh,
                                  const pbr_write_desc *desc);

PBR_END_DECLS
#endif
