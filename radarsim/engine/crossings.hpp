// Where a line crosses triangles, in float64, and the list of a ray's crossings.
//
// The triangle is seen along the line: points are sheared so that the line becomes the third axis. The line crosses
// the triangle if the origin is inside the triangle's projection onto the first two axes, which is so where it is on
// the same side of all three edges. The depth of the crossing is interpolated from the depths of the corners.
//
// Rule 1: each corner is sheared on its own by the same operations, so that it has one projection, whichever triangle
// it is taken from.
//
// Rule 2: the side of an edge is the sign of a difference of two products. Rounding can make this difference zero, but
// never reverses its sign; computed for the triangle on the other side of the edge, it is the exact opposite.
//
// Rule 3: where it is zero, the line goes through the edge. It is treated as passing beside the edge, displaced by an
// infinitesimal step along the first axis and a still smaller one along the second, the same for all triangles
// (simulation of simplicity). Hence a line through an edge or a corner crosses exactly one triangle of a surface, and
// along any line a closed surface is entered as often as it is left.
//
// Rule 4: the depth is a mean of the corners' depths with weights of one sign, so that no grazing line is given a
// crossing outside the triangle.
#pragma once
#include "door.hpp"

namespace radarsim {

constexpr double INFINITESIMAL = 1e-290; // by which a line is displaced from an edge
constexpr double TINY = 1e-30;           // coordinates below are set to zero

// One surface that a ray crosses.
struct Crossing {
    double t;     // m
    int32_t part;
    int32_t sign; // added to the part's winding number: 1 on entering, -1 on leaving
};

// The shear that makes a line the third axis.
struct Line {
    int first, second, third; // the axes of space in the order of projection
    double origin[3];         // m, in that order
    double shear_first, shear_second;
    double scale;             // of depths
};

inline double flush_to_zero(double number) { return fabs(number) < TINY ? 0.0 : number; }

inline Line project_line(const Vector& origin, const Vector& direction) {
    int third = 0; // the line's steepest axis: no factor below is greater than 1
    if (fabs(direction[1]) > fabs(direction[third])) third = 1;
    if (fabs(direction[2]) > fabs(direction[third])) third = 2;
    Line line;
    line.first = (third + 1) % 3, line.second = (third + 2) % 3, line.third = third;
    line.origin[0] = flush_to_zero(origin[line.first]);
    line.origin[1] = flush_to_zero(origin[line.second]);
    line.origin[2] = flush_to_zero(origin[third]);
    line.scale = 1.0 / direction[third];
    line.shear_first = flush_to_zero(direction[line.first] * line.scale);
    line.shear_second = flush_to_zero(direction[line.second] * line.scale);
    return line;
}

// Twice the signed area of the origin and an edge from a to b: its sign is the side of the edge on
// which the line passes; it is 0 only for an edge that is seen as a point.
inline double edge_side(double ax, double ay, double bx, double by) {
    double area = ax * by - ay * bx;
    if (area != 0.0) return area;
    double end = ay != by ? ay : bx, start = ay != by ? by : ax;
    if (end == start) return 0.0;
    return end > start ? INFINITESIMAL : -INFINITESIMAL;
}

// Intersect a line with one triangle. Returns 1 if the line enters by the front face, -1 if it
// leaves by the back face, 0 if it misses; t is the distance along the line.
inline int cross_triangle(const Line& line, const Triangle& corners, double& t) {
    const double* p = corners;
    int i = line.first, j = line.second, k = line.third;
    double az = p[k] - line.origin[2], bz = p[k + 3] - line.origin[2], cz = p[k + 6] - line.origin[2];
    double ax = p[i] - line.origin[0] - line.shear_first * az;
    double bx = p[i + 3] - line.origin[0] - line.shear_first * bz;
    double cx = p[i + 6] - line.origin[0] - line.shear_first * cz;
    double ay = p[j] - line.origin[1] - line.shear_second * az;
    double by = p[j + 3] - line.origin[1] - line.shear_second * bz;
    double cy = p[j + 6] - line.origin[1] - line.shear_second * cz;
    double a = edge_side(bx, by, cx, cy), b = edge_side(cx, cy, ax, ay), c = edge_side(ax, ay, bx, by);
    double area = a + b + c; // of one sign if the line passes all edges on the same side
    if (area == 0.0 || (least(a, b, c) < 0.0 && most(a, b, c) > 0.0)) return 0;
    t = line.scale * ((a * az + b * bz + c * cz) / area);
    return (area > 0.0) == (line.scale > 0.0) ? -1 : 1;
}

// Order by distance; at equal distances by part, and entering before leaving.
inline bool comes_after(const Crossing& one, const Crossing& other) {
    if (one.t != other.t) return one.t > other.t;
    if (one.part != other.part) return one.part > other.part;
    return one.sign < other.sign;
}

// Shell's sort with gaps of 3k + 1: most rays have a few crossings.
inline void sort_crossings(Crossing* crossings, int64_t count) {
    int64_t gap = 1;
    while (gap < count / 3) gap = 3 * gap + 1;
    for (; gap > 0; gap /= 3)
        for (int64_t start = gap; start < count; start++)
            for (int64_t i = start; i >= gap && comes_after(crossings[i - gap], crossings[i]); i -= gap) {
                Crossing kept = crossings[i];
                crossings[i] = crossings[i - gap];
                crossings[i - gap] = kept;
            }
}

} // namespace radarsim
