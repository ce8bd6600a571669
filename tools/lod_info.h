/* What pbr info tells of a hierarchy. SPDX-License-Identifier: MIT */
#ifndef LOD_INFO_H
#define LOD_INFO_H

#include "input.h"
#include "json.h"

/* Counts all of an input's hierarchy, with a bar, and prints it: as an object, or as text without `json`. False with a message. */
bool lod_info_print(struct session *session, const struct input *input, struct json *json);

#endif
