// A map of points that gives the mean and covariance of the points around any position; see point_map.py for the
// theory.
#pragma once
#include "bindings.hpp"

namespace radarsim {

using Vector2 = double[2]; // x and y
// Sums over the points of a cell of 1, x, y, x x, x y and y y, relative to its centre, m: first unweighted, then
// weighted by the x and by the y component of the points' normals.
using Moments = double[3][6];

using Pair = double __attribute__((vector_size(16))); // a SIMD vector of two numbers

inline Pair pair_at(const double* numbers) {
    Pair pair;
    memcpy(&pair, numbers, sizeof(pair));
    return pair;
}

inline void add_pair(double* sums, Pair terms) {
    terms += pair_at(sums);
    memcpy(sums, &terms, sizeof(terms));
}

constexpr double FINEST = 0.1; // m
constexpr int LEVELS = 5;
constexpr double MIN_WEIGHT = 2.0; // least weight of the points in a window; about eight points
constexpr double LINE_RATIO = 4.0; // least ratio of the variances along and across a line
// Columns and rows have 28 bits each, which is 13000 km of the finest cells in each direction.
constexpr int64_t CELL_OFFSET = 1 << 27; // makes the indices of cells positive

// A hash table of cells, with open addressing; its length is a power of two.
struct PointTable {
    Array<int64_t> keys; // key of the cell in each row; 0 in free rows
    Array<Moments> moments;
};
LAYOUT(PointTable, "c c", keys, moments)

// Whether the length of a table is a power of two, as searches require.
inline bool is_valid(const PointTable& table) {
    int64_t rows = table.keys.size();
    return rows > 0 && !(rows & (rows - 1));
}

// Return the index of the cell around a coordinate, along an axis; coordinates that are too large or NaN share a cell.
inline int64_t cell_around(double place) { return fabs(place) < CELL_OFFSET ? int64_t(floor(place)) : CELL_OFFSET; }

// Return the key of a cell. Levels are counted from 1, since key 0 marks a free row of the table.
inline int64_t cell_key(int level, int64_t column, int64_t row) {
    return int64_t(level + 1) << 56 | (column + CELL_OFFSET) << 28 | (row + CELL_OFFSET);
}

// Return the row of a cell, or the free row in which it would be stored.
inline int64_t find_key(const PointTable& table, int64_t key) {
    // Fibonacci hashing multiplies by 2^64 divided by the golden ratio: keys of neighbouring cells differ only
    // slightly, and the upper bits of the product distribute them over the table.
    int64_t last = table.keys.size() - 1, row = int64_t(uint64_t(key) * 0x9E3779B97F4A7C15 >> 29) & last;
    // Linear probing ends, since at least half of the rows are free, see add_points.
    while (table.keys[row] != 0 && table.keys[row] != key) row = (row + 1) & last;
    return row;
}

// Copy all cells to a table that is at least twice as long.
inline bool copy_table(const PointTable& table, const PointTable& larger) {
    if (!is_valid(table) || !is_valid(larger) || larger.keys.size() < 2 * table.keys.size()) return false;
    for (int64_t i = 0; i < table.keys.size(); i++) {
        if (!table.keys[i]) continue;
        // The row of a cell depends on the length of the table.
        int64_t row = find_key(larger, table.keys[i]);
        larger.keys[row] = table.keys[i];
        memcpy(&larger.moments[row], &table.moments[i], sizeof(Moments));
    }
    return true;
}
BIND(copy_table, "")

// Add points to a table in which some rows are used. Returns the number of newly used rows; -1 if the table is too
// short.
inline int64_t add_points(const PointTable& packed, int64_t used, Array<const Vector2> points,
                          Array<const Vector2> normals) {
    const PointTable table = packed; // a copy, so that the compiler knows that writes to arrays do not change it
    // At least half of the rows stay free, even if each point needs a new cell at every level.
    if (!is_valid(table) || used < 0 || table.keys.size() / 2 - used < LEVELS * points.size()) return -1;
    int64_t cells = 0;
    for (int64_t i = 0; i < points.size(); i++) {
        double size = FINEST;
        for (int level = 0; level < LEVELS; level++) {
            int64_t column = cell_around(points[i][0] / size), line = cell_around(points[i][1] / size);
            int64_t key = cell_key(level, column, line), row = find_key(table, key);
            if (!table.keys[row]) table.keys[row] = key, cells++;
            // Coordinates are relative to the centre of the cell, since far from the map's origin squares would lose
            // the digits that the covariance needs.
            double x = points[i][0] - (double(column) + 0.5) * size, y = points[i][1] - (double(line) + 0.5) * size;
            const double factors[3] = {1.0, normals[i][0], normals[i][1]};
            for (int k = 0; k < 3; k++) {
                double f = factors[k], fx = f * x, fy = f * y, *sums = table.moments[row][k];
                add_pair(sums, Pair{f, fx});
                add_pair(sums + 2, Pair{fy, fx * x});
                add_pair(sums + 4, Pair{fx * y, fy * y});
            }
            size *= 2.0; // exact, so that searches compute the same cells
        }
    }
    return cells;
}
BIND(add_points, "p p")

// Return the weight of a cell along an axis, by a quadratic B-spline. Step is -1, 0 or 1 from the cell of the point,
// and t the offset of the point from the centre of that cell, in cells. The three weights sum to one.
inline double spline(int step, double t) {
    double across = 0.5 + step * t;
    return step ? 0.5 * (across * across) : 0.75 - t * t;
}

struct Window { // weighted moments of the map's points around a point, relative to this point
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
};

// Sum the moments of the cells around a point. With a normal, points of the map are weighted by how well their normals
// agree with it; with a zero vector all points count equally.
inline Window sum_around(const PointTable& table, int level, double x, double y, const Vector2& normal) {
    auto [nx, ny] = normal;
    double size = FINEST * double(1 << level);
    // The weight of a point with normal v is (1 + u . v) / 2 for the given normal u.
    double whole = nx * nx + ny * ny > 0.0 ? 0.5 : 1.0;
    int64_t column = cell_around(x / size), line = cell_around(y / size);
    double tx = x / size - double(column) - 0.5, ty = y / size - double(line) - 0.5;
    // All cells are looked up first, so that the processor prefetches their moments.
    const Moments* cells[3][3];
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++)
#pragma GCC unroll 3
        for (int j = 0; j < 3; j++) {
            int64_t row = find_key(table, cell_key(level, column + i - 1, line + j - 1));
            cells[i][j] = table.keys[row] ? &table.moments[row] : nullptr;
            if (table.keys[row])
                for (int k = 0; k < 3; k++) __builtin_prefetch(&table.moments[row][k]);
        }
    const double weights[3] = {spline(-1, ty), spline(0, ty), spline(1, ty)};
    Window window;
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        double fx = whole * spline(i - 1, tx), u = (i - 1 - tx) * size;
#pragma GCC unroll 3
        for (int j = 0; j < 3; j++) {
            if (!cells[i][j]) continue;
            double f = fx * weights[j], v = (j - 1 - ty) * size, sums[6];
            const Moments& moments = *cells[i][j];
            for (int k = 0; k < 6; k += 2) {
                Pair sum = f * (pair_at(&moments[0][k]) + nx * pair_at(&moments[1][k]) + ny * pair_at(&moments[2][k]));
                memcpy(&sums[k], &sum, sizeof(sum));
            }
            // Shift the moments from the centre of the cell, at (u, v) from the point, to the point.
            double m = sums[0], p = sums[1], q = sums[2];
            window.n += m;
            window.x += p + m * u;
            window.y += q + m * v;
            window.xx += sums[3] + 2.0 * u * p + m * u * u;
            window.xy += sums[4] + u * q + v * p + m * u * v;
            window.yy += sums[5] + 2.0 * v * q + m * v * v;
        }
    }
    return window;
}

struct LocalShape { // the distribution of the map's points around a point
    int64_t found;     // whether there are enough points; otherwise all fields are 0
    double dx, dy;     // m, vector from the point to the mean
    double xx, xy, yy; // m^2, covariance
};
ROW(LocalShape, found, dx, dy, xx, xy, yy)

// Whether points with this covariance lie along a line.
inline bool is_line(double xx, double xy, double yy) {
    double half = (xx + yy) / 2, turn = hypot((xx - yy) / 2, xy);
    // Rounding errors can make the smaller eigenvalue negative.
    return half + turn >= LINE_RATIO * maximum(half - turn, 0.0);
}

// Return the shape of the map around a point on a surface with a normal; the normal is a zero vector if unknown. If the
// first window with enough points is not a line, some wider windows are tried.
inline LocalShape shape_around(const PointTable& table, double x, double y, const Vector2& normal, int wider) {
    LocalShape first = {};
    int last = LEVELS - 1;
    // The search starts with the finest level, which follows the shape best where points are dense.
    for (int level = 0; level <= last; level++) {
        auto [n, a, b, aa, ab, bb] = sum_around(table, level, x, y, normal);
        if (!(n >= MIN_WEIGHT)) continue;
        a /= n, b /= n;
        LocalShape shape = {true, a, b, aa / n - a * a, ab / n - a * b, bb / n - b * b};
        if (is_line(shape.xx, shape.xy, shape.yy)) return shape;
        // This window is used unless a slightly wider window has a line, which constrains the robot only perpendicular
        // to it.
        if (first.found) continue;
        first = shape;
        if (level + wider < last) last = level + wider;
    }
    return first;
}

inline bool find_shape(const PointTable& table, double x, double y, double nx, double ny, Array<LocalShape> shape) {
    if (!is_valid(table)) return false;
    shape[0] = shape_around(table, x, y, {nx, ny}, 0);
    return true;
}
BIND(find_shape, "1")

constexpr int64_t NEIGHBOURS = 8;     // maximum number of neighbours of a point in the scan, to each side
constexpr double RADIUS = 0.4;        // m, maximum distance of neighbours
constexpr int64_t MIN_NEIGHBOURS = 4; // least number of points of a line, including the point itself
// Least cosine between beam and normal; lines nearly along the beam are only the scatter of single points.
constexpr double LEAST_FACING = 0.2;

// Set the normals of points of a scan whose neighbours form a line: unit vectors that point into the surface.
inline void fill_normals(Array<const Vector2> places, Array<const Vector2> along, Array<Vector2> normals) {
    int64_t count = places.size(), side = (count - 1) / 2; // in a short scan no point may count twice
    if (side > NEIGHBOURS) side = NEIGHBOURS;
    for (int64_t i = 0; i < count; i++) {
        int64_t n = 0;
        double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
        for (int64_t k = i - side; k <= i + side; k++) {
            int64_t j = k < 0 ? k + count : k < count ? k : k - count; // scans cover the full circle
            double u = places[j][0] - places[i][0], v = places[j][1] - places[i][1];
            // Neighbouring beams may end at different objects, metres apart.
            if (!(u * u + v * v < RADIUS * RADIUS)) continue;
            n++;
            x += u;
            y += v;
            xx += u * u;
            xy += u * v;
            yy += v * v;
        }
        if (n < MIN_NEIGHBOURS) continue;
        double count_ = double(n);
        x /= count_, y /= count_;
        xx = xx / count_ - x * x, xy = xy / count_ - x * y, yy = yy / count_ - y * y;
        if (!is_line(xx, xy, yy)) continue;
        // The angle of the principal axis; the normal is perpendicular to it.
        double angle = atan2(2.0 * xy, xx - yy) / 2, nx = -sin(angle), ny = cos(angle);
        double facing = nx * along[i][0] + ny * along[i][1];
        if (!(fabs(facing) > LEAST_FACING)) continue;
        double inward = copysign(1.0, facing);
        normals[i][0] = inward * nx, normals[i][1] = inward * ny;
    }
}
BIND(fill_normals, "k k k")

} // namespace radarsim
