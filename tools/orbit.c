/* Turning, moving and zooming. SPDX-License-Identifier: MIT */
#include "orbit.h"

static double clamp(double value, double least, double most) {
    return fmin(fmax(value, least), most);
}

/* To a hundredth of a degree. */
static double round_degrees(double degrees) {
    return round(degrees * 100) / 100;
}

/* In -180..180. */
static double wrap(double degrees) {
    return round_degrees(remainder(degrees, 360));
}

/* Within -90..90; from outside of that not further out. */
static double tilt(double from, double by) {
    return round_degrees(clamp(from + by, fmin(from, -90), fmax(from, 90)));
}

static double round_digits(double value, int digits) {
    const double unit = pow(10, floor(log10(value)) + 1 - digits);
    return unit < 1 ? round(value * round(1 / unit)) / round(1 / unit) : round(value / unit) * unit;
}

double orbit_step(double value, double steps, int digits) {
    const double largest = 0.5 * pow(10, 1 - digits); /* error of rounding, of the value */
    double at = 4 * log2(value), whole = round(at);
    if (fabs(at - whole) < 8 * largest) at = whole; /* 4 / ln 2 = 5.8 */
    return round_digits(exp2((at + steps) / 4), digits);
}

static double bounded(const double view[3], double zoom) {
    return clamp(zoom, fmin(view[2], ORBIT_LEAST_ZOOM), fmax(view[2], ORBIT_MOST_ZOOM));
}

void orbit_turn(double view[3], double right, double down) {
    view[0] = wrap(view[0] - right);
    view[1] = tilt(view[1], down);
}

void orbit_zoom(double view[3], double steps) {
    view[2] = bounded(view, orbit_step(view[2], steps, 4));
}

void orbit_rescale(double view[3], double radius_before, double radius_after) {
    const double factor = radius_after / radius_before;
    if (factor > 0 && isfinite(factor)) view[2] = bounded(view, round_digits(view[2] * factor, 6));
}

void orbit_light(double light[2], double right, double down) {
    light[0] = wrap(light[0] + right);
    light[1] = tilt(light[1], -down);
}

double orbit_pixel(const struct camera *camera, const double centre[3]) {
    double away[3];
    for (int k = 0; k < 3; k++) away[k] = centre[k] - camera->eye[k];
    return (camera->is_parallel ? 1 : hypot(hypot(away[0], away[1]), away[2])) / camera->pixel_scale;
}

void orbit_pan(const struct camera *camera, double right, double down, double centre[3]) {
    const double pixel = orbit_pixel(camera, centre), *axes = camera->view; /* its rows: right, up, back */
    for (int k = 0; k < 3; k++) centre[k] += pixel * (down * axes[4 * k + 1] - right * axes[4 * k]);
}

double orbit_round(double coordinate, double pixel) {
    double digits = ceil(2 - log10(pixel)), scale = pow(10, fabs(digits));
    if (!(fabs(digits) < 300)) return coordinate;
    return digits > 0 ? round(coordinate * scale) / scale : round(coordinate / scale) * scale;
}
