/* Drawing sequential point trees: chunks of a page in one call where the context can, from the page or from what was selected of
 * it. SPDX-License-Identifier: MIT */
#ifndef PBR_GL_SEQUENCE_DRAW_H
#define PBR_GL_SEQUENCE_DRAW_H

#include "draw.h"

/* The view's draw list: chunks that the item's passes need, whether they are there or not. Of blended kinds all passes draw the
 * same, what the accumulation pass needs: splats reach no farther in the others. */
pbr_result sequence_list(pbr_view *view, const struct placement *placement);

/* Whether the item selects, and compute shaders see all of a page. */
bool sequence_can_be_selected(const pbr_renderer *renderer, const struct prepared_item *prepared);

pbr_result sequence_draw(pbr_view *view, const struct placement *placement, enum pass pass, pbr_stats *stats);

#endif
