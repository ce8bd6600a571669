/* The file formats, as read.c tries them. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_FORMATS_H
#define PBR_IO_FORMATS_H

#include "reader.h"
#include "records.h"

/* Each pair: whether the content is of the format, and the reading of a whole file that is. Beside it, of formats that allow for
 * it: where the points lie. `out` comes as zeros. */

bool ply_recognise(const struct reader *reader);
pbr_result ply_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);
pbr_result ply_records(struct reader *reader, struct records *out);

bool las_recognise(const struct reader *reader);
pbr_result las_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);
pbr_result las_records(struct reader *reader, struct records *out);

bool off_recognise(const struct reader *reader);
pbr_result off_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);

/* Text whose first line is a statement of OBJ. */
bool obj_recognise(const struct reader *reader);
pbr_result obj_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);

/* Text whose first line is a heading of TRI. */
bool tri_recognise(const struct reader *reader);
pbr_result tri_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);

/* .xyz, .asc, .txt and .pts: text whose first line is numbers. */
bool points_text_recognise(const struct reader *reader);
pbr_result points_text_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);

/* Formats that are known and not read: the error tells what the file is, and what to convert it with. */
bool foreign_recognise(const struct reader *reader);
pbr_result foreign_read(struct reader *reader, const pbr_read_desc *desc, pbr_file_content *content);

#endif
