/* Instances and sized structures. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/instance.h"

struct small {
    size_t struct_size;
    uint32_t a, b;
};

struct large {
    struct small known;
    uint32_t added[2];
};

static void short_structures_are_completed_with_zeros(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct small old = {sizeof old, 1, 2};
    struct large now;
    memset(&now, 0xff, sizeof now);
    assert_int_equal(read_desc(instance, "test", &old, sizeof old, &now, sizeof now), PBR_OK);
    assert_int_equal(now.known.struct_size, sizeof now);
    assert_int_equal(now.known.a, 1);
    assert_int_equal(now.known.b, 2);
    assert_int_equal(now.added[0], 0);
    assert_int_equal(now.added[1], 0);
    assert_int_equal(read_desc(instance, "test", NULL, sizeof old, &now, sizeof now), PBR_OK);
    assert_int_equal(now.known.a, 0);
    host_stop(&host, instance);
}

static void long_structures_are_accepted_only_with_a_zero_tail(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct large newer = {{sizeof newer, 1, 2}, {0, 0}};
    struct small now;
    assert_int_equal(read_desc(instance, "test", &newer, sizeof now, &now, sizeof now), PBR_OK);
    assert_int_equal(now.b, 2);
    newer.added[1] = 1;
    assert_int_equal(read_desc(instance, "test_desc", &newer, sizeof now, &now, sizeof now), PBR_ERROR_INVALID_ARGUMENT);
    assert_non_null(strstr(host.text, "test_desc"));
    host_stop(&host, instance);
}

static void absurd_struct_sizes_are_refused(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const size_t sizes[] = {0, 1, sizeof(struct small) - 1, 65537, SIZE_MAX};
    for (size_t i = 0; i < COUNT(sizes); i++) {
        struct small wrong = {sizes[i], 0, 0}, now;
        assert_int_equal(read_desc(instance, "test", &wrong, sizeof now, &now, sizeof now), PBR_ERROR_INVALID_ARGUMENT);
        host.text[0] = '\0';
        assert_int_equal(write_info(instance, "info", &(struct small){sizeof now, 0, 0}, sizeof now, &wrong, sizeof now),
                         PBR_ERROR_INVALID_ARGUMENT);
        assert_non_null(strstr(host.text, "info"));
    }
    host_stop(&host, instance);
}

static void information_is_written_as_far_as_the_caller_knows_it(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    struct large info = {{sizeof info, 1, 2}, {3, 4}}, out = {{sizeof(struct small), 9, 9}, {9, 9}};
    assert_int_equal(write_info(instance, "info", &info, sizeof info, &out, sizeof(struct small)), PBR_OK);
    assert_int_equal(out.known.struct_size, sizeof(struct small));
    assert_int_equal(out.known.b, 2);
    assert_int_equal(out.added[0], 9);
    struct large newer = {{sizeof newer, 9, 9}, {9, 9}};
    assert_int_equal(write_info(instance, "info", &info.known, sizeof info.known, &newer, sizeof info.known), PBR_OK);
    assert_int_equal(newer.known.a, 1);
    assert_int_equal(newer.added[1], 0);
    host_stop(&host, instance);
}

static void instance_with_children_is_busy(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    pbr_points_desc desc = PBR_POINTS_DESC_INIT;
    pbr_points *points;
    assert_int_equal(pbr_points_create(instance, &desc, &points), PBR_OK);
    pbr_points *second = pbr_points_retain(points);
    pbr_instance *same = instance;
    assert_int_equal(pbr_instance_destroy(&instance), PBR_ERROR_BUSY);
    assert_ptr_equal(instance, same);
    assert_int_equal(host.code, PBR_ERROR_BUSY);
    pbr_points_release(&points);
    assert_null(points);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_ERROR_BUSY);
    pbr_points_release(&second);
    host_stop(&host, instance);
}

static void descriptors_of_instances_are_checked(void **state) {
    (void)state;
    struct host host = {0};
    pbr_instance_desc desc = PBR_INSTANCE_DESC_INIT;
    pbr_instance *instance = (pbr_instance *)&host;
    desc.log = host_log;
    desc.log_user = &host;
    desc.allocate = host_allocate;
    desc.memory_user = &host;
    assert_int_equal(pbr_instance_create(&desc, &instance), PBR_ERROR_INVALID_ARGUMENT); /* allocate without release */
    assert_null(instance);
    assert_int_equal(host.messages, 1);
    desc.release = host_release;
    desc.thread_count = 4097;
    assert_int_equal(pbr_instance_create(&desc, &instance), PBR_ERROR_LIMIT);
    desc.thread_count = 1;
    atomic_store(&host.fail_at, 1);
    assert_int_equal(pbr_instance_create(&desc, &instance), PBR_ERROR_OUT_OF_MEMORY);
    assert_null(instance);
    assert_int_equal(pbr_instance_create(&desc, NULL), PBR_ERROR_INVALID_ARGUMENT);
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    assert_true(pbr_instance_threads(instance) >= 1);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
    assert_int_equal(pbr_instance_destroy(NULL), PBR_OK);
}

static void memory_is_zeroed_and_sizes_are_checked(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    assert_null(pbr_allocate(instance, SIZE_MAX / 2, 3));
    assert_int_equal(host.code, PBR_ERROR_OUT_OF_MEMORY);
    uint32_t *memory = pbr_allocate(instance, 10, sizeof *memory);
    for (uint32_t i = 0; i < 10; i++) {
        assert_int_equal(memory[i], 0);
        memory[i] = i;
    }
    memory = pbr_reallocate(instance, memory, 10, 20, sizeof *memory);
    for (uint32_t i = 0; i < 20; i++) assert_int_equal(memory[i], i < 10 ? i : 0);
    atomic_store(&host.fail_at, 1);
    assert_null(pbr_reallocate(instance, memory, 20, 30, sizeof *memory));
    assert_int_equal(memory[9], 9);
    pbr_free(instance, memory);
    memory = pbr_allocate(instance, 0, 8);
    assert_non_null(memory);
    pbr_free(instance, memory);
    host_stop(&host, instance);
}

/* The C library's own memory too, when it has been used before: of blocks from its heap, mapped ones, and those in large pages. */
static void memory_is_zeroed_without_an_allocator(void **state) {
    (void)state;
    static const size_t sizes[] = {1 << 10, 1 << 20, 5 << 20};
    pbr_instance *instance;
    assert_int_equal(pbr_instance_create(NULL, &instance), PBR_OK);
    for (size_t i = 0; i < COUNT(sizes); i++)
        for (int again = 0; again < 8; again++) {
            unsigned char *memory = pbr_allocate(instance, sizes[i], 1);
            assert_non_null(memory);
            unsigned any = 0;
            for (size_t k = 0; k < sizes[i]; k++) any |= memory[k];
            assert_int_equal(any, 0);
            memset(memory, 255, sizes[i]);
            pbr_free(instance, memory);
        }
    assert_int_equal(pbr_instance_destroy(&instance), PBR_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(short_structures_are_completed_with_zeros),
        cmocka_unit_test(long_structures_are_accepted_only_with_a_zero_tail),
        cmocka_unit_test(absurd_struct_sizes_are_refused),
        cmocka_unit_test(information_is_written_as_far_as_the_caller_knows_it),
        cmocka_unit_test(instance_with_children_is_busy),
        cmocka_unit_test(descriptors_of_instances_are_checked),
        cmocka_unit_test(memory_is_zeroed_and_sizes_are_checked),
        cmocka_unit_test(memory_is_zeroed_without_an_allocator),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
