# What Doxygen wants to read at each place and the headers say once. Lines stay lines: warnings name the header's own.
# SPDX-License-Identifier: MIT
s|size_t struct_size;$|& /**< Set by the structure's `PBR_..._INIT`: its size as the caller was compiled with it. */|
s|^#define PBR_[A-Z_]*_INIT PBR_SIZED(\(pbr_[a-z_]*\))$|& /**< A #\1 of which `struct_size` is set and the rest is zero. */|
# Not the end of a sentence, which ends the short description.
s| et al\. | et al.\\ |g
# The end of each function's comment: where it may be called, and since when.
s#\(Any thread\|Context\|No context\)\([^.]*\.\) Since \([0-9.]*[0-9]\)\.#@calls{\1\2} @since \3#
