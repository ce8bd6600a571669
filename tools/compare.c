/* pbr compare: how far two pictures are apart. SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "commands.h"
#include "comparison.h"
#include "json.h"
#include "options.h"

struct compare_options {
    const char *inputs[2];
    const char *output; /* NULL = no picture of the differences */
    bool as_json, has_background;
    float background[3]; /* sRGB */
    double levels;       /* of 255: pixels that differ by more are counted */
};

static const char *const channel_names[3] = {"red", "green", "blue"};

static void print_json(const struct compare_options *options, const pbr_image *picture, const struct comparison *comparison) {
    struct json json = {.file = stdout};
    const double background[3] = {(double)comparison->background[0], (double)comparison->background[1],
                                  (double)comparison->background[2]};
    json_open_object(&json, NULL);
    json_string(&json, "a", options->inputs[0]);
    json_string(&json, "b", options->inputs[1]);
    json_integer(&json, "width", picture->width);
    json_integer(&json, "height", picture->height);
    json_number(&json, "psnr_db", comparison_psnr(comparison));
    json_number(&json, "rmse_8bit", 255 * sqrt(comparison->mean_square));
    json_number(&json, "rmse_linear", sqrt(comparison->mean_square_linear));
    json_number(&json, "ssim", comparison->ssim);
    json_open_object(&json, "far_apart");
    json_number(&json, "levels", options->levels);
    json_integer(&json, "pixels", comparison->far_apart);
    json_close_object(&json);
    json_open_object(&json, "largest_difference");
    json_number(&json, "value_8bit", 255 * comparison->largest);
    json_integer(&json, "x", comparison->x);
    json_integer(&json, "y", comparison->y);
    json_string(&json, "channel", channel_names[comparison->channel]);
    json_number(&json, "a_8bit", 255 * comparison->values[0]);
    json_number(&json, "b_8bit", 255 * comparison->values[1]);
    json_close_object(&json);
    json_string(&json, "covered_by", comparison->by_alpha ? "alpha" : "background");
    if (comparison->by_alpha) json_string(&json, "background", NULL);
    else json_numbers(&json, "background", background, 3);
    json_integer(&json, "covered_a", comparison->covered[0]);
    json_integer(&json, "covered_b", comparison->covered[1]);
    json_integer(&json, "covered_only_a", comparison->covered_only[0]);
    json_integer(&json, "covered_only_b", comparison->covered_only[1]);
    json_close_object(&json);
}

static void print_text(const struct compare_options *options, const pbr_image *picture, const struct comparison *comparison) {
    session_print_name(options->inputs[0]);
    fputs(" (a) and ", stdout);
    session_print_name(options->inputs[1]);
    printf(" (b), %" PRIu32 " x %" PRIu32 " pixels\n", picture->width, picture->height);
    if (comparison->mean_square > 0) printf("  PSNR       %.2f dB, of sRGB-encoded values\n", comparison_psnr(comparison));
    else printf("  PSNR       inf dB: equal in sRGB-encoded values\n");
    printf("  RMSE       %.4g of 255, of sRGB-encoded values; %.4g of 1, of linear ones\n", 255 * sqrt(comparison->mean_square),
           sqrt(comparison->mean_square_linear));
    if (isnan(comparison->ssim)) printf("  SSIM       none: smaller than %d x %d pixels\n", SSIM_WINDOW, SSIM_WINDOW);
    else printf("  SSIM       %.5f, of luma of sRGB-encoded values\n", comparison->ssim);
    printf("  largest    %.4g of 255, %s of pixel (%" PRIu32 ", %" PRIu32 "): a has %.4g, b %.4g\n", 255 * comparison->largest,
           channel_names[comparison->channel], comparison->x, comparison->y, 255 * comparison->values[0],
           255 * comparison->values[1]);
    printf("  far apart  %" PRIu64 " pixels, %.3g %%, by more than %g of 255\n", comparison->far_apart,
           100 * (double)comparison->far_apart / ((double)picture->width * picture->height), options->levels);
    printf("  covered    %" PRIu64 " pixels in a, %" PRIu64 " in b; only in a %" PRIu64 ", only in b %" PRIu64,
           comparison->covered[0], comparison->covered[1], comparison->covered_only[0], comparison->covered_only[1]);
    if (comparison->by_alpha) printf(" (alpha above 0)\n");
    else
        printf(" (other than the background, %.3g,%.3g,%.3g)\n", (double)comparison->background[0],
               (double)comparison->background[1], (double)comparison->background[2]);
}

static bool read_pictures(struct session *session, const struct compare_options *options, pbr_image pictures[2]) {
    for (int p = 0; p < 2; p++) {
        unsigned errors = atomic_load(&session->errors);
        pbr_result result = pbr_image_read(session->instance, options->inputs[p], &pictures[p]);
        if (!session_check(session, result, errors, options->inputs[p])) return false;
    }
    if (pictures[0].width == pictures[1].width && pictures[0].height == pictures[1].height) return true;
    session_fail(session, "%s has %ux%u pixels, %s %ux%u: pictures of different sizes cannot be compared", options->inputs[0],
                 (unsigned)pictures[0].width, (unsigned)pictures[0].height, options->inputs[1], (unsigned)pictures[1].width,
                 (unsigned)pictures[1].height);
    return false;
}

static bool write_difference(struct session *session, const char *path, const pbr_image pictures[2],
                             const struct comparison *comparison) {
    pbr_image difference = PBR_IMAGE_INIT;
    unsigned errors = atomic_load(&session->errors);
    bool is_linear = !strcmp(path + strlen(path) - 4, ".exr");
    pbr_result result = comparison_picture(session->instance, pictures, comparison, is_linear, &difference);
    if (result == PBR_OK) result = pbr_image_write(session->instance, &difference, path);
    pbr_image_destroy(session->instance, &difference);
    return session_check(session, result, errors, path);
}

static int compare(struct session *session, const struct compare_options *options) {
    pbr_image pictures[2] = {PBR_IMAGE_INIT, PBR_IMAGE_INIT};
    struct comparison comparison;
    int status = STATUS_FAILED;
    if (!read_pictures(session, options, pictures)) goto cleanup;
    unsigned errors = atomic_load(&session->errors);
    pbr_result result = comparison_make(session->instance, pictures, options->has_background ? options->background : NULL,
                                        options->levels, &comparison);
    if (!session_check(session, result, errors, "compare")) goto cleanup;
    if (comparison.not_finite)
        session_warn(session, "%s, %s: %" PRIu64 " numbers are not finite and count as 0", options->inputs[0], options->inputs[1],
                     comparison.not_finite);
    if (options->output && !write_difference(session, options->output, pictures, &comparison)) goto cleanup;
    if (options->as_json) print_json(options, &pictures[0], &comparison);
    else print_text(options, &pictures[0], &comparison);
    status = STATUS_OK;
cleanup:
    for (int p = 0; p < 2; p++) pbr_image_destroy(session->instance, &pictures[p]);
    return status;
}

static int run_compare(struct session *session, int argc, char **argv) {
    enum { OUTPUT, JSON, BACKGROUND, LEVELS };
    static const struct option_rule rules[] = {[OUTPUT] = {"-o", true},
                                               [JSON] = {"--json", false},
                                               [BACKGROUND] = {"--background", true},
                                               [LEVELS] = {"--levels", true},
                                               {NULL, false}};
    struct option_scan scan = {.argc = argc, .argv = argv};
    struct compare_options options = {.levels = 16};
    int input_count = 0, option;

    while ((option = option_next(&scan, rules)) != OPTION_END) {
        switch (option) {
        case OUTPUT:
            options.output = scan.value;
            if (!is_picture_name(scan.value))
                return session_bad_value(session, "compare", "-o", scan.value, "a name ending in .png or .exr");
            break;
        case JSON: options.as_json = true; break;
        case BACKGROUND:
            options.has_background = true;
            if (!parse_rgb(scan.value, 3, options.background))
                return session_bad_value(session, "compare", "--background", scan.value, "R,G,B, each 0 to 1");
            break;
        case LEVELS:
            if (!parse_number_within(scan.value, 0, 255, &options.levels))
                return session_bad_value(session, "compare", "--levels", scan.value, "a number from 0 to 255");
            break;
        case OPTION_OPERAND:
            if (input_count == 2) return session_usage(session, "compare", "more than two pictures");
            options.inputs[input_count++] = scan.value;
            break;
        default: return session_usage(session, "compare", scan.error);
        }
    }
    if (input_count < 2) return session_usage(session, "compare", "two pictures are needed");
    return compare(session, &options);
}

const struct command compare_command = {
    "compare", run_compare,
    "usage: pbr compare A B [options]\n"
    "\n"
    "Tells how far two PNG or OpenEXR pictures of one size are apart. Colours are compared as seen over black, sRGB-encoded and\n"
    "clamped to 0..1; only the linear RMSE takes them as they are. PSNR and RMSE are over red, green and blue. SSIM is that of\n"
    "Wang et al. 2004 on luma (0.299, 0.587, 0.114): Gaussian window of 11 x 11 pixels, sigma 1.5, K1 0.01, K2 0.03, the mean "
    "over\n"
    "the windows that lie wholly in the picture. A pixel is covered where alpha is above 0, or, where neither picture is\n"
    "transparent anywhere, where it is not of the background's colour.\n"
    "\n"
    "  -o FILE               a picture of the differences. PNG: magnitudes, the largest stretched to white; OpenEXR: linear, A - "
    "B\n"
    "  --background R,G,B    sRGB, 0..1; the colour of A's upper left pixel\n"
    "  --levels N            count pixels of which red, green or blue differs by more than N of 255; 16\n"
    "  --json                print an object; psnr_db is null where the pictures are equal (it is infinite then)\n"};
