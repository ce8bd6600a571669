/* Reading host arrays. SPDX-License-Identifier: MIT */
#include "support.h"

#include "core/attribute.h"

enum { EVERY_FORMAT = 0x1fe };

static void elements_are_read_at_any_format_stride_and_alignment(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    const double values[2][3] = {{-5, 100, 7}, {3, -120, 0}}, positive[2][3] = {{5, 100, 7}, {3, 120, 0}};
    for (uint32_t format = PBR_FORMAT_FLOAT32; format <= PBR_FORMAT_UINT32; format++)
        for (size_t gap = 0; gap < 4; gap++)
            for (size_t shift = 0; shift < 3; shift++) {
                unsigned char memory[128];
                size_t size = format_size(format), stride = 3 * size + gap;
                bool is_unsigned = format == PBR_FORMAT_UINT8 || format == PBR_FORMAT_UINT16 || format == PBR_FORMAT_UINT32;
                const double(*wanted)[3] = is_unsigned ? positive : values;
                for (size_t i = 0; i < 2; i++)
                    for (size_t c = 0; c < 3; c++) {
                        double v = wanted[i][c];
                        float f = (float)v;
                        int32_t n = (int32_t)v; /* little endian: its first bytes are the narrower integers */
                        const void *from = format == PBR_FORMAT_FLOAT32   ? (void *)&f
                                           : format == PBR_FORMAT_FLOAT64 ? (void *)&v
                                                                          : (void *)&n;
                        memcpy(memory + shift + i * stride + c * size, from, size);
                    }
                pbr_attribute attribute = {memory + shift, gap ? stride : 0, format, 3};
                assert_int_equal(attribute_check(instance, "test", &attribute, 2, EVERY_FORMAT, 1, 4, true), PBR_OK);
                for (uint64_t i = 0; i < 2; i++) {
                    double read[3];
                    attribute_read(&attribute, i, read);
                    assert_memory_equal(read, wanted[i], sizeof read);
                }
            }
    host_stop(&host, instance);
}

static void contract_violations_are_refused(void **state) {
    (void)state;
    struct host host;
    pbr_instance *instance = host_start(&host, 1);
    float data[3] = {0};
    const struct {
        pbr_attribute attribute;
        uint64_t count;
    } wrong[] = {
        {{NULL, 0, PBR_FORMAT_FLOAT32, 3}, 1},               /* required */
        {{data, 0, PBR_FORMAT_UINT8, 3}, 1},                 /* not an allowed format */
        {{data, 0, 77, 3}, 1},                               /* not a format */
        {{data, 0, 0, 3}, 1},                                /* not a format */
        {{data, 0, PBR_FORMAT_FLOAT32, 2}, 1},               /* too few components */
        {{data, 0, PBR_FORMAT_FLOAT32, 4}, 1},               /* too many */
        {{data, 11, PBR_FORMAT_FLOAT32, 3}, 1},              /* elements would overlap */
        {{data, (size_t)1 << 62, PBR_FORMAT_FLOAT32, 3}, 5}, /* (count - 1) x stride overflows */
        {{data, (size_t)1 << 61, PBR_FORMAT_FLOAT32, 3}, 5}, /* more than any object can hold */
        {{data, 0, PBR_FORMAT_FLOAT32, 3}, UINT64_MAX},
    };
    for (size_t i = 0; i < COUNT(wrong); i++) {
        pbr_attribute attribute = wrong[i].attribute;
        host.messages = 0;
        assert_int_equal(attribute_check(instance, "positions", &attribute, wrong[i].count, 1u << PBR_FORMAT_FLOAT32, 3, 3, true),
                         PBR_ERROR_INVALID_ARGUMENT);
        assert_int_equal(host.messages, 1);
        assert_non_null(strstr(host.text, "positions"));
    }
    pbr_attribute absent = {NULL, 3, 99, 99};
    assert_int_equal(attribute_check(instance, "normals", &absent, 5, 0, 3, 3, false), PBR_OK);
    host_stop(&host, instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(elements_are_read_at_any_format_stride_and_alignment),
        cmocka_unit_test(contract_violations_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
