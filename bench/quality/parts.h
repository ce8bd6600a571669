/* The parts of the quality programme. Each prints a section of Markdown on stdout, and returns false with a message on stderr.
 * SPDX-License-Identifier: MIT */
#ifndef PARTS_H
#define PARTS_H

#include "studio.h"

struct plan {
    const char *data;   /* folder of the scans */
    const char *output; /* folder for pictures; NULL: none are written */
    bool is_quick;      /* little of everything */
};

bool quality_tables(struct studio *studio, const struct plan *plan);
bool quality_aliasing(struct studio *studio, const struct plan *plan);
bool quality_holes(struct studio *studio, const struct plan *plan);
/* The measures against closed forms; needs nothing drawn. */
bool quality_self_test(struct studio *studio);

#endif
