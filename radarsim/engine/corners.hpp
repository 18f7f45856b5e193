// Corners of a scene as seen from an antenna; see corners_and_edges.py for the theory.
#pragma once
#include "bindings.hpp"

namespace radarsim::fmcw {

constexpr double LEAST_HEIGHT = 0.05; // m, of the antenna above both facets of a corner
constexpr double OFF = 0.002;         // m, offset of points, so that their own surfaces do not hide them
constexpr double DENT_AREA = 1.0;     // m^2, area from which metal sheets have full slope; estimate

struct Corner { // a line at which two facets meet at a right angle
    double foot[3], along[3]; // a point on the line, m, map frame, and the unit vector of the line
    double ends[2];           // m, ends of the common line, along it from the foot
    double normals[6];        // unit normals of both facets
    double depths[2];         // m, widths of the facets from the line
    double reflected[2];      // share of power reflected at normal incidence
    bool is_mirror[2];        // whether that share is the same at all angles
    double slopes[2];         // variances of the facets' slopes, rad^2
};
ROW(Corner, foot, along, ends, normals, depths, reflected, is_mirror, slopes)

struct SeenCorner {
    double position[3], distance; // m
    double rcs;                   // m^2, if both the corner and the beam covered the whole lobe
    // Across and along the line: the share of the slopes' variance in the beam, and the lower and the upper angle of
    // the corner, in units of the width of the lobe.
    double lit[2], angles[4];
};
ROW(SeenCorner, position, distance, rcs, lit, angles)

// Find the corners that open to an antenna; return their number. The variances of the two-way beam in azimuth and
// elevation are in rad^2.
inline int64_t see_corners(Array<const Corner> corners, Array<const double> origin, double wavelength, double azimuth,
                           double elevation, Array<SeenCorner> seen) {
    int64_t count = 0;
    for (const auto& [foot, along, ends, normals, depths, reflected, is_mirror, slopes] : corners) {
        double way[3] = {origin[0] - foot[0], origin[1] - foot[1], origin[2] - foot[2]};
        // The sum has the order of numpy.einsum.
        auto ahead = [&](const double* a) { return a[0] * way[0] + a[2] * way[2] + a[1] * way[1]; };
        double heights[2] = {ahead(normals), ahead(normals + 3)}, place = ahead(along), length = ends[1] - ends[0];
        if (!(minimum(heights[0], heights[1]) > LEAST_HEIGHT)) continue;
        double distance = hypot(heights[0], heights[1]), across = 1.0, upright = 1.0, mixed = 1.0;
        double half = INFINITE, sums[2] = {}; // m; variances of slopes across and along the line
        for (int k = 0; k < 2; k++) {
            double cosine = heights[k] / distance;
            // The Fresnel equations; see point_echoes.py.
            double root = sqrt(minimum(reflected[k], 0.999)), index = (1.0 + root) / (1.0 - root);
            double square = index * index, inside = sqrt(square - 1.0 + cosine * cosine);
            double first = (cosine - inside) / (cosine + inside);
            double second = (square * cosine - inside) / (square * cosine + inside);
            across *= first * first, upright *= second * second;
            mixed *= is_mirror[k] ? reflected[k] : (first * first + second * second) / 2.0;
            half = minimum(half, depths[k] * cosine);
            // On a facet that is smaller than a dent, slopes are smaller than on a large one. Slopes across the line
            // deflect the wave fully, slopes along it in proportion to the cosine of the angle of incidence.
            double slope = slopes[k] * minimum(depths[k] * length / DENT_AREA, 1.0);
            sums[0] += slope, sums[1] += slope * (cosine * cosine);
        }
        double share = is_mirror[0] || is_mirror[1] ? mixed : (across + upright) / 2.0;
        double area = minimum(2.0 * half * length, wavelength * distance / 2.0); // m^2, the Fresnel zone at most
        double waves = wavelength * wavelength / (8.0 * M_PI * area); // variance of the lobe from diffraction, rad^2
        double spans[] = {-half, half, ends[0] - place, ends[1] - place};
        SeenCorner& found = seen[count++];
        double near = minimum(maximum(place, ends[0]), ends[1]);
        for (int axis = 0; axis < 3; axis++)
            found.position[axis] = foot[axis] + near * along[axis] + OFF * (normals[axis] + normals[axis + 3]);
        found.distance = distance, found.rcs = M_PI * (distance * distance) * share;
        for (int k = 0; k < 4; k++) {
            double beam = (fabs(along[2]) > sqrt(0.5)) == (k < 2) ? azimuth : elevation, slope = sums[k / 2];
            found.lit[k / 2] = beam / (beam + slope);
            found.angles[k] = spans[k] / distance / sqrt(2.0 * (found.lit[k / 2] * slope + waves));
        }
    }
    return count;
}
BIND(see_corners, "c 3 c")

} // namespace radarsim::fmcw
