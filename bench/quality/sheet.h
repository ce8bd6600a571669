/* Pictures of equal size side by side, each with its name. SPDX-License-Identifier: MIT */
#ifndef SHEET_H
#define SHEET_H

#include "session.h"
#include <pbr/image.h>

struct sheet {
    pbr_image image;
    uint32_t cell[2]; /* pixels */
};

/* False with a message. To be destroyed by sheet_write. */
bool sheet_create(struct session *session, uint32_t columns, uint32_t rows, const uint32_t cell[2], struct sheet *sheet);
/* What of the picture a cell has room for, from the corner on, each pixel `zoom` x `zoom` large. */
void sheet_place(struct sheet *sheet, uint32_t column, uint32_t row, const char *label, const pbr_image *picture,
                 const uint32_t corner[2], uint32_t zoom);
/* Four times the difference between the pictures' sRGB values. */
void sheet_place_difference(struct sheet *sheet, uint32_t column, uint32_t row, const char *label, const pbr_image *picture,
                            const pbr_image *truth, const uint32_t corner[2]);
/* Writes FOLDER/NAME and destroys the sheet; no folder: destroys it only. False with a message. */
bool sheet_write(struct session *session, struct sheet *sheet, const char *folder, const char *name);

#endif
