/* The files that a file names. SPDX-License-Identifier: MIT */
#ifndef PBR_IO_BESIDE_H
#define PBR_IO_BESIDE_H

#include "core/file.h"
#include "reader.h"

/* Reads the file that the reader's own names, as hostile a name as all that it holds: relative to its folder, not out of it by ".."
 * or links, a regular file, at most `most` bytes. What cannot be read so has no data, after a warning, or in silence if the
 * reader's bytes are no file's; an error is only PBR_ERROR_OUT_OF_MEMORY. Closed by source_close. */
pbr_result beside_read(struct reader *reader, const char *name, size_t length, size_t most, struct source *out);

#endif
