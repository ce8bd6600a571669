/* Panels of the viewer: information, keys, progress, messages. SPDX-License-Identifier: MIT */
#include "view_panels.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "json.h"
#include "utf8.h"

static const overlay_colour ground = 0x14171ce8, edge = 0xffffff24, bright = 0xf4f6f8ff, plain = 0xd2d8dfff, dim = 0x8e99a6ff,
                            accent = 0x5aa9ffff, groove = 0xffffff2b, red = 0xff8a7aff;

enum { LABEL = 12, LINES = 40, COLUMNS = 100 }; /* characters to the values; most lines and their length in a table */

/* A panel of lines, each of a label and a value. */
struct table {
    struct {
        char label[24], value[COLUMNS];
    } lines[LINES];
    int count;
};

static void add_line(struct table *table, const char *label, const char *format, ...) __attribute__((format(printf, 3, 4)));

static void add_line(struct table *table, const char *label, const char *format, ...) {
    va_list arguments;
    if (table->count == LINES) return;
    snprintf(table->lines[table->count].label, sizeof table->lines[0].label, "%s", label);
    va_start(arguments, format);
    vsnprintf(table->lines[table->count].value, sizeof table->lines[0].value, format, arguments);
    va_end(arguments);
    table->count++;
}

/* 5,000,000 */
static void group_digits(uint64_t number, char text[32]) {
    char digits[24];
    int count = snprintf(digits, sizeof digits, "%" PRIu64, number), at = 0;
    for (int i = 0; i < count; i++) {
        if (i > 0 && (count - i) % 3 == 0) text[at++] = ',';
        text[at++] = digits[i];
    }
    text[at] = '\0';
}

static void add_count(struct table *table, const char *label, uint64_t number) {
    char text[32];
    group_digits(number, text);
    add_line(table, label, "%s", text);
}

/* Numbers with commas between, as options take them. */
static void add_numbers(struct table *table, const char *label, const double *numbers, int count) {
    char text[3 * (JSON_NUMBER + 1)] = "";
    for (int i = 0; i < count; i++) {
        size_t length = strlen(text);
        if (i > 0) text[length++] = ',';
        json_number_text(numbers[i], text + length);
    }
    add_line(table, label, "%s", text);
}

static void draw_panel(struct overlay *overlay, int x, int y, int width, int height) {
    const int thin = overlay->font.advance > 12 ? overlay->font.advance / 8 : 1;
    overlay_box(overlay, x, y, width, height, ground);
    overlay_box(overlay, x, y, width, thin, edge);
    overlay_box(overlay, x, y + height - thin, width, thin, edge);
    overlay_box(overlay, x, y + thin, thin, height - 2 * thin, edge);
    overlay_box(overlay, x + width - thin, y + thin, thin, height - 2 * thin, edge);
}

/* Text of which as many characters as fit are drawn: of a longer one the end. */
static void draw_end(struct overlay *overlay, int x, int y, int width, overlay_colour colour, const char *text) {
    const size_t room = (size_t)(width > 0 ? width : 0) / (size_t)overlay->font.advance;
    size_t length = utf8_count(text);
    if (length > room && room > 3) {
        overlay_text(overlay, x, y, colour, "...");
        x += 3 * overlay->font.advance;
        for (; length + 3 > room; length--) utf8_next(&text);
    }
    if (length <= room) overlay_text(overlay, x, y, colour, text);
}

/* Widest value, in characters. */
static int value_width(const struct table *table) {
    size_t widest = 0;
    for (int i = 0; i < table->count; i++) {
        size_t length = utf8_count(table->lines[i].value);
        widest = length > widest ? length : widest;
    }
    return (int)widest;
}

static void draw_lines(struct overlay *overlay, const struct table *table, int first, int count, int x, int y, int label_width,
                       overlay_colour label_colour) {
    const int advance = overlay->font.advance, line = overlay->font.line;
    for (int i = first; i < first + count && i < table->count; i++, y += line) {
        overlay_text(overlay, x, y, label_colour, table->lines[i].label);
        overlay_text(overlay, x + label_width * advance, y, plain, table->lines[i].value);
    }
}

static void put_title(const struct view_facts *facts, char *title, size_t capacity) {
    const struct scene *scene = facts->scene;
    if (scene->input_count == 1) snprintf(title, capacity, "%s", view_file_name(scene->inputs[0].path));
    else snprintf(title, capacity, "%u files", (unsigned)scene->input_count);
}

static void put_switches(const struct view_state *state, struct table *table) {
    const struct scene_options *options = &state->options;
    char text[COLUMNS] = "";
    if (options->vertices) strcat(text, ", vertices of meshes");
    if (options->parallel) strcat(text, ", orthographic");
    if (options->cull) strcat(text, ", no back faces");
    if (state->spins) strcat(text, ", spinning");
    if (text[0]) add_line(table, "", "%s", text + 2);
}

static void put_threshold(const struct scene_options *options, double drawn, struct table *table) {
    const double threshold = scene_options_threshold(options);
    if (threshold > 0 && drawn > threshold) add_line(table, "threshold", "%g px, now %.1f", threshold, drawn);
    else if (threshold > 0) add_line(table, "threshold", "%g px", threshold);
    else add_line(table, "threshold", "0: leaves");
}

static void put_facts(const struct view_facts *facts, struct table *table) {
    const struct scene_options *options = &facts->state->options;
    char colour[COLUMNS];
    view_colour_name(options, colour, sizeof colour);
    add_line(table, "frame", "%.*f ms", facts->frame_ms < 10 ? 2 : facts->frame_ms < 100 ? 1 : 0, facts->frame_ms);
    add_count(table, "points", scene_point_count(facts->scene));
    add_count(table, "drawn", facts->stats.splats_drawn);
    add_count(table, "culled", facts->stats.splats_culled);
    if (facts->stats.triangles_drawn > 0) add_count(table, "triangles", facts->stats.triangles_drawn);
    if (facts->stats.nodes_hidden > 0) add_count(table, "hidden", facts->stats.nodes_hidden);
    if (scene_hierarchy(facts->scene) != LOD_NONE) put_threshold(options, (double)facts->stats.threshold, table);
    add_line(table, "GPU memory", "%.1f MiB", (double)facts->stats.gpu_memory_bytes / 1048576);
    add_line(table, "splats", "%s", kind_name(splat_kinds, options->splat));
    if (scene_options_blending(options) == PBR_BLEND_FILL) add_line(table, "blend", "fill");
    add_line(table, "lighting", "%s", kind_name(shading_kinds, options->shading));
    add_line(table, "colour", "%s", colour);
    add_line(table, "radii", "\xc3\x97 %g", options->radius_scale > 0 ? options->radius_scale : 1);
    if (options->size_minimum > 0) add_line(table, "least size", "%g px", options->size_minimum);
    if (options->low_pass > 0) add_line(table, "low-pass", "%g px\xc2\xb2", options->low_pass);
    add_numbers(table, "view", options->view, 3);
    if (options->has_centre) add_numbers(table, "centre", options->centre, 3);
    if (options->light[0] != 0 || options->light[1] != 0) add_numbers(table, "light", options->light, 2);
    put_switches(facts->state, table);
}

/* Upper left. */
static void draw_info(struct overlay *overlay, const struct view_facts *facts) {
    const int advance = overlay->font.advance, line = overlay->font.line, margin = 3 * advance / 2;
    struct table table = {.count = 0};
    char title[256];
    put_facts(facts, &table);
    put_title(facts, title, sizeof title);
    int characters = LABEL + value_width(&table), title_width = (int)utf8_count(title);
    characters = characters > title_width ? characters : title_width < 40 ? title_width : 40;
    const int width = characters * advance + 2 * margin, height = (table.count + 2) * line + 2 * margin + line / 2;
    const int x = advance + margin;
    int y = advance + margin;
    draw_panel(overlay, advance, advance, width, height);
    draw_end(overlay, x, y, characters * advance, bright, title);
    y += 5 * line / 4;
    draw_lines(overlay, &table, 0, table.count, x, y, LABEL, dim);
    overlay_text(overlay, x, y + table.count * line + line / 4, dim, "h  keys");
}

static void put_keys(struct table *table) {
    char names[COLUMNS] = "", numbers[24];
    size_t length = 0;
    for (uint32_t i = 0; splat_kinds[i].name && length < sizeof names; i++)
        length += (size_t)snprintf(names + length, sizeof names - length, " %s", splat_kinds[i].name);
    add_line(table, "left drag", "turn");
    add_line(table, "right drag", "move; also middle, and shift + left");
    add_line(table, "wheel", "zoom");
    add_line(table, "ctrl + left", "turn the light");
    snprintf(numbers, sizeof numbers, "1 .. %u", (unsigned)kind_count(splat_kinds));
    add_line(table, numbers, "splats:%s", names);
    for (const struct view_key *key = view_keys; key->name; key++) add_line(table, key->name, "%s", key->what);
}

/* In the middle, in two columns where there is room. */
static void draw_help(struct overlay *overlay) {
    const int advance = overlay->font.advance, line = overlay->font.line, margin = 2 * advance, gap = 4 * advance;
    struct table table = {.count = 0};
    put_keys(&table);
    const int column = (LABEL + 1 + value_width(&table)) * advance;
    const int columns = 2 * column + gap + 2 * margin <= (int)overlay->size[0] ? 2 : 1,
              rows = (table.count + columns - 1) / columns;
    const int width = columns * column + (columns - 1) * gap + 2 * margin, height = rows * line + 2 * margin + 3 * line / 2;
    int x = ((int)overlay->size[0] - width) / 2, y = ((int)overlay->size[1] - height) / 2;
    x = x > 0 ? x : 0;
    y = y > 0 ? y : 0;
    draw_panel(overlay, x, y, width, height);
    overlay_text(overlay, x + margin, y + margin, bright, "Pointer and keys");
    for (int i = 0; i < columns; i++)
        draw_lines(overlay, &table, i * rows, rows, x + margin + i * (column + gap), y + margin + 3 * line / 2, LABEL + 1, accent);
}

/* A full bar up to `fraction`, or, of a stage that does not tell how far it is, a piece that moves. */
static void draw_bar(struct overlay *overlay, int x, int y, int width, const struct view_facts *facts) {
    const int height = overlay->font.advance / 2;
    overlay_box(overlay, x, y, width, height, groove);
    if (facts->loading.stage) {
        double fraction = fmin(fmax(facts->loading.fraction, 0), 1);
        overlay_box(overlay, x, y, (int)lround(fraction * width), height, accent);
    } else {
        const int piece = width / 5;
        double swing = fabs(remainder(facts->seconds, 3)) / 1.5; /* 0..1 and back in 3 s */
        overlay_box(overlay, x + (int)lround(swing * (width - piece)), y, piece, height, accent);
    }
}

/* Draws it at the bottom, or in the middle while there is nothing else to see. Returns the place above it. */
static int draw_loading(struct overlay *overlay, const struct view_facts *facts, int bottom) {
    enum { CHARACTERS = 56 };
    const int advance = overlay->font.advance, line = overlay->font.line, margin = 3 * advance / 2;
    const int room = (int)overlay->size[0] - 2 * advance, wanted = CHARACTERS * advance + 2 * margin;
    const int width = wanted < room ? wanted : room, height = 2 * line + 2 * margin + advance, inner = width - 2 * margin;
    const int x = ((int)overlay->size[0] - width) / 2;
    const bool is_alone = facts->scene->input_count == 0;
    const int y = is_alone ? ((int)overlay->size[1] - height) / 2 : bottom - height;
    char heading[256], state[64] = "reading";
    if (facts->loading.stage)
        snprintf(state, sizeof state, "%s, %d %%", facts->loading.stage, (int)(100 * facts->loading.fraction));
    if (facts->state->options.input_count > 1)
        snprintf(heading, sizeof heading, "%u of %u  %s", (unsigned)facts->loading.index + 1,
                 (unsigned)facts->state->options.input_count, view_file_name(facts->loading.path));
    else snprintf(heading, sizeof heading, "%s", view_file_name(facts->loading.path));
    draw_panel(overlay, x, y, width, height);
    draw_end(overlay, x + margin, y + margin, inner, bright, heading);
    draw_end(overlay, x + margin, y + margin + line, inner, dim, state);
    draw_bar(overlay, x + margin, y + height - margin - advance / 2, inner, facts);
    return is_alone ? bottom : y - advance;
}

/* One line in a panel of its own, with a mark of its colour; returns the place above it. */
static int draw_message(struct overlay *overlay, int bottom, overlay_colour mark, const char *text) {
    const int advance = overlay->font.advance, margin = 3 * advance / 2;
    const int room = (int)overlay->size[0] - 2 * advance, wanted = (int)utf8_count(text) * advance + 2 * margin;
    const int width = wanted < room ? wanted : room, height = overlay->font.line + margin;
    const int x = ((int)overlay->size[0] - width) / 2, y = bottom - height;
    draw_panel(overlay, x, y, width, height);
    overlay_box(overlay, x, y, advance / 2, height, mark);
    draw_end(overlay, x + margin, y + margin / 2, width - 2 * margin, bright, text);
    return y - advance / 2;
}

void view_panels_draw(struct overlay *overlay, const struct view_facts *facts) {
    const struct view_state *state = facts->state;
    int bottom = (int)overlay->size[1] - overlay->font.advance;
    if (state->shows_info && !state->shows_help && facts->scene->input_count > 0) draw_info(overlay, facts);
    if (facts->loading.is_running) bottom = draw_loading(overlay, facts, bottom);
    if (facts->notice) bottom = draw_message(overlay, bottom, accent, facts->notice);
    for (uint32_t i = facts->error_count; state->shows_info && i > 0; i--)
        bottom = draw_message(overlay, bottom, red, facts->errors[i - 1]);
    if (state->shows_help) draw_help(overlay);
}

const char *view_file_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash && slash[1] ? slash + 1 : path;
}
