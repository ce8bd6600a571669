/* What docs/abi.md says about the sizes of structures, held for one structure at a time. Each call gets a copy of exactly the bytes
 * that it was promised, so that a sanitizer sees more being touched. SPDX-License-Identifier: MIT */
#ifndef PBR_TESTS_STRUCT_SIZES_H
#define PBR_TESTS_STRUCT_SIZES_H

#include <setjmp.h>
#include <stdalign.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <pbr/base.h>

/* The size of a structure in the release that brought it: up to the member that was its last then, and the padding. A structure
 * that grows keeps its line. */
#define FIRST_SIZE(type, last)                                                                                                     \
    ((offsetof(type, last) + sizeof(((type *)0)->last) + alignof(type) - 1) / alignof(type) * alignof(type))

struct sized {
    const char *name;
    size_t first, now; /* size in its first release, and in these headers */
    const void *value; /* a valid one; NULL = zeros */
    pbr_result (*use)(void *user, void *structure);
};

#define SIZED(type, last, value, use)                                                                                              \
    { #type, FIRST_SIZE(type, last), sizeof(type), value, use }

/* `fill` is what the bytes past the value hold, and all bytes without a value. */
static inline unsigned char *sized_copy(const struct sized *s, size_t given, size_t bytes, int fill) {
    unsigned char *copy = malloc(bytes < sizeof given ? sizeof given : bytes);
    assert_non_null(copy);
    memset(copy, fill, bytes);
    if (s->value) memcpy(copy, s->value, bytes < s->now ? bytes : s->now);
    memcpy(copy, &given, sizeof given);
    return copy;
}

static inline void expect_result(const struct sized *s, void *user, unsigned char *structure, pbr_result wanted, const char *what) {
    pbr_result result = s->use(user, structure);
    if (result != wanted) fail_msg("%s, %s: %s", s->name, what, pbr_result_name(result));
    free(structure);
}

/* Sizes that no structure had. The library may look no further than the size. */
static inline void check_refused_sizes(const struct sized *s, void *user) {
    const size_t sizes[] = {0, 1, sizeof(size_t), s->first - 1, 65537, SIZE_MAX};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        expect_result(s, user, sized_copy(s, sizes[i], sizeof(size_t), 0), PBR_ERROR_INVALID_ARGUMENT, "of a size that none had");
}

/* A structure that the caller fills. */
static inline void check_input_sizes(const struct sized *s, void *user) {
    static const size_t longer[] = {1, 4, 8, 64, 1000};
    assert_true(s->first <= s->now);
    for (size_t given = s->first; given <= s->now; given++)
        expect_result(s, user, sized_copy(s, given, given, 0), PBR_OK, "an older prefix");
    for (size_t i = 0; i < sizeof longer / sizeof longer[0]; i++) {
        size_t given = s->now + longer[i];
        expect_result(s, user, sized_copy(s, given, given, 0), PBR_OK, "longer by zeros");
        for (int last = 0; last < 2; last++) {
            unsigned char *copy = sized_copy(s, given, given, 0);
            copy[last ? given - 1 : s->now] = 1;
            expect_result(s, user, copy, PBR_ERROR_INVALID_ARGUMENT, "longer, with a member that is unknown");
        }
    }
    check_refused_sizes(s, user);
}

/* A structure that the library fills: as far as the caller's reaches, and zeros where it reaches further. */
static inline void check_output_sizes(const struct sized *s, void *user) {
    size_t most = s->now + 64;
    unsigned char *whole = sized_copy(s, s->now, s->now, 0xaa);
    assert_true(s->first <= s->now);
    assert_int_equal(s->use(user, whole), PBR_OK);
    for (size_t given = s->first; given <= most; given++) {
        unsigned char *copy = sized_copy(s, given, given, 0xaa);
        if (s->use(user, copy) != PBR_OK) fail_msg("%s of %zu bytes is refused", s->name, given);
        size_t kept, common = given < s->now ? given : s->now;
        memcpy(&kept, copy, sizeof kept);
        assert_int_equal(kept, given);
        assert_memory_equal(copy + sizeof kept, whole + sizeof kept, common - sizeof kept);
        for (size_t i = common; i < given; i++) assert_int_equal(copy[i], 0);
        free(copy);
    }
    free(whole);
    check_refused_sizes(s, user);
}

#endif
