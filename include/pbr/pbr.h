/* SPDX-License-Identifier: MIT */
/** @file pbr.h
 * All of libpbr. (libpbr-io has its own: pbr/io.h, pbr/image.h and pbr/reference.h.)
 */
#ifndef PBR_PBR_H
#define PBR_PBR_H

#include <pbr/base.h>
#include <pbr/instance.h>
#include <pbr/lod.h>
#include <pbr/mesh.h>
#include <pbr/points.h>
#include <pbr/render.h>
#include <pbr/renderer.h>

#endif
