// Scan matching: fits a scan to a map of points by the Gauss-Newton method with robust weights; see scan_matching.py.
#pragma once
#include "point_map.hpp"

namespace radarsim {

constexpr int MAX_ITERATIONS = 12;
constexpr double ROBUST_SCALE = 4.0;              // squared distance, in variances, at which the weight is a quarter
constexpr int64_t SAMPLED_POINTS = 150;           // maximum number of points for the comparison of start poses
constexpr double HALF_SCORE = 1 / (0.05 * 0.05);  // 1/m^2; a point known to 5 cm scores one half
constexpr int WIDER = 1;                          // number of wider windows that are searched for lines
constexpr int WIDER_ALONG = 2;                    // number of wider windows in a corridor
constexpr double CORRIDOR_RATIO = 0.3;            // a corridor has a smaller ratio of least to most information
// Normals have errors of some degrees, so the points of a wall seem to have up to this share of information along the
// wall, although they have none.
constexpr double LEAST_RATIO = 0.05;
constexpr double INLIER_WEIGHT = 0.25;    // least robust weight of an inlier
constexpr double MAX_SPOT = 0.15 * 0.15;  // m^2, largest variance of a spot
constexpr double RANGE_ERROR = 0.02;      // m, error of ranges and of the map's lines

struct ScanPoints { // the points of a scan, see scan_matching.py
    Array<const Vector2> places, along, normals;
    double spread;
    bool spots;
};

struct Symmetric { // a symmetric (2, 2) matrix
    double xx = 0.0, xy = 0.0, yy = 0.0;
};

struct Heading {
    double c, s;
    explicit Heading(double yaw) : c(cos(yaw)), s(sin(yaw)) {}
};

struct Equations { // normal equations for x, y and yaw: the lower triangle of the matrix, and the gradient
    double normal[3][3] = {}, gradient[3] = {};
};

// Project the information about translation onto a unit vector. Source: Zhang, Kaess and Singh, "On degeneracy of
// optimization-based state estimation problems" (2016), with a ratio instead of the absolute threshold.
inline void keep_only(Equations& equations, double nx, double ny) {
    auto& [normal, gradient] = equations;
    // Compute the lower triangle of P N P, where P = n n^T acts on x and y. The entry of the yaw alone does not change.
    double a = normal[0][0], b = normal[1][0], c = normal[1][1];
    double strength = a * nx * nx + 2.0 * b * nx * ny + c * ny * ny;
    normal[0][0] = strength * nx * nx, normal[1][0] = strength * nx * ny, normal[1][1] = strength * ny * ny;
    double cross = nx * normal[2][0] + ny * normal[2][1];
    normal[2][0] = cross * nx, normal[2][1] = cross * ny;
    double force = nx * gradient[0] + ny * gradient[1];
    gradient[0] = force * nx, gradient[1] = force * ny;
}

// Solve the equations in place by Cholesky decomposition; the gradient becomes the solution.
inline void solve(Equations& equations) {
    auto& [normal, gradient] = equations;
    for (int j = 0; j < 3; j++) {
        for (int i = j; i < 3; i++)
            for (int k = 0; k < j; k++) normal[i][j] -= normal[i][k] * normal[j][k];
        normal[j][j] = sqrt(normal[j][j]);
        for (int i = j + 1; i < 3; i++) normal[i][j] /= normal[j][j];
    }
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k < j; k++) gradient[j] -= normal[j][k] * gradient[k];
        gradient[j] /= normal[j][j];
    }
    for (int j = 2; j >= 0; j--) {
        for (int k = j + 1; k < 3; k++) gradient[j] -= normal[k][j] * gradient[k];
        gradient[j] /= normal[j][j];
    }
}

// Return the information matrix, 1/m^2, of the distance from an echo to a shape. The echo has a standard deviation,
// spread, along the unit vector across its beam. Lines always count; spots count only if the flag is set.
inline Symmetric information_of(const LocalShape& shape, const Vector2& across, double spread, bool spots) {
    double a = shape.xx, b = shape.xy, c = shape.yy;
    double half = (a + c) / 2, turn = hypot((a - c) / 2, b);
    // Compute the eigenvalues; rounding errors can make the smaller one negative.
    double small = maximum(half - turn, 0.0), large = half + turn;
    double noise = RANGE_ERROR * RANGE_ERROR, wide = spread * spread;
    if (large >= LINE_RATIO * small) {
        double angle = atan2(2.0 * b, a - c) / 2, nx = -sin(angle), ny = cos(angle);
        // Only the component of the spread along the normal moves the echo away from the line.
        double facing = nx * across[0] + ny * across[1];
        double weight = 1.0 / (small + noise + wide * facing * facing);
        return {weight * nx * nx, weight * nx * ny, weight * ny * ny};
    }
    if (!spots || large > MAX_SPOT) return {};
    a += noise + wide * across[0] * across[0];
    b += wide * across[0] * across[1];
    c += noise + wide * across[1] * across[1];
    double area = 2.0 * (a * c - b * b); // doubled, since both directions belong to a single echo
    return {c / area, -b / area, a / area};
}

struct Match { // a point of the scan compared with the map, map frame
    double rx, ry;         // m, vector from the robot to the point
    double ex = 0, ey = 0; // m, vector from the point to the mean of the map's points around it
    Symmetric information; // information matrix of that vector
    double weight = 0.0;   // robust weight; 0 where the map has no points

    double score() const {
        // Wide shapes are near every point, so only narrow shapes distinguish poses.
        double trace = information.xx + information.yy;
        return weight * trace / (trace + HALF_SCORE);
    }
};

inline Match compare(const PointTable& table, const ScanPoints& points, int64_t i, double x, double y,
                     const Heading& heading, int wider) {
    auto [c, s] = heading;
    const auto& [px, py] = points.places[i];
    const auto& [dx, dy] = points.along[i];
    const auto& [nx, ny] = points.normals[i];
    Match match;
    match.rx = c * px - s * py, match.ry = s * px + c * py;
    LocalShape shape = shape_around(table, x + match.rx, y + match.ry, {c * nx - s * ny, s * nx + c * ny}, wider);
    if (!shape.found) return match;
    // The unit vector across the beam: the beam rotated by the heading plus a right angle.
    match.information = information_of(shape, {-s * dx - c * dy, c * dx - s * dy}, points.spread, points.spots);
    double ex = match.ex = shape.dx, ey = match.ey = shape.dy;
    const auto& [xx, xy, yy] = match.information;
    double off = xx * ex * ex + 2.0 * xy * ex * ey + yy * ey * ey; // the squared Mahalanobis distance
    double share = ROBUST_SCALE / (ROBUST_SCALE + off);
    // Without information in the map every distance would be 0, a perfect fit.
    match.weight = xx + yy > 0.0 ? share * share : 0.0;
    return match;
}

struct Quality {
    double score = 0.0;  // the sum of the scores of all points
    int64_t inliers = 0; // the number of inliers
};

// Set the normal equations of the points at a pose, and return how well they fit.
inline Quality add_up(const PointTable& table, const ScanPoints& points, const double* state, int wider,
                      Equations& equations) {
    equations = {};
    auto& [normal, gradient] = equations;
    Heading heading(state[2]);
    Quality quality;
    for (int64_t i = 0; i < points.places.size(); i++) {
        Match match = compare(table, points, i, state[0], state[1], heading, wider);
        quality.score += match.score();
        quality.inliers += match.weight > INLIER_WEIGHT;
        const auto& [xx, xy, yy] = match.information;
        double a = match.weight * xx, b = match.weight * xy, d = match.weight * yy;
        // The Jacobian of the point with respect to x, y and yaw is [1 0 -ry; 0 1 rx].
        double fx = a * match.ex + b * match.ey, fy = b * match.ex + d * match.ey, rx = match.rx, ry = match.ry;
        double p = b * rx - a * ry, q = d * rx - b * ry;
        gradient[0] += fx;
        gradient[1] += fy;
        gradient[2] += rx * fy - ry * fx;
        normal[0][0] += a;
        normal[1][0] += b;
        normal[1][1] += d;
        normal[2][0] += p;
        normal[2][1] += q;
        normal[2][2] += rx * q - ry * p;
    }
    return quality;
}

struct Constraint { // the information of all points about translation
    double ratio;  // ratio of the least to the most information over all directions
    double nx, ny; // unit vector of the direction with the most information
};

// Compute how points constrain translation. Robust weights are not used, since a robot with a wrong pose would
// otherwise seem to be in a corridor.
inline Constraint constraint_of(const PointTable& table, const ScanPoints& points, const double* state) {
    Heading heading(state[2]);
    double a = 0.0, b = 0.0, c = 0.0;
    for (int64_t i = 0; i < points.places.size(); i++) {
        Symmetric information = compare(table, points, i, state[0], state[1], heading, WIDER_ALONG).information;
        a += information.xx;
        b += information.xy;
        c += information.yy;
    }
    double half = (a + c) / 2, away = hypot((a - c) / 2, b), angle = atan2(2.0 * b, a - c) / 2;
    return {half > 0.0 ? (half - away) / (half + away) : 1.0, cos(angle), sin(angle)};
}

// Move a pose, x, y and yaw, to the best fit of the scan. The predicted pose has the given information, known, about
// each coordinate. Sets the information matrix of the points alone, and as outcome the score and the number of inliers
// before the last step.
inline bool fit_scan(const PointTable& table, Array<const Vector2> places, Array<const Vector2> along,
                     Array<const Vector2> normals, double spread, bool spots, Array<double> state,
                     Array<const double> predicted, Array<const double> known, Array<double, 2> information,
                     Array<double> outcome) {
    if (!is_valid(table)) return false;
    ScanPoints points = {places, along, normals, spread, spots};
    // The constraint is computed only once, at the start, so all steps of a fit minimise the same sum.
    auto [ratio, nx, ny] = constraint_of(table, points, state.data);
    int wider = ratio < CORRIDOR_RATIO ? WIDER_ALONG : WIDER;
    Equations equations;
    auto& [normal, gradient] = equations;
    for (int step = 0; step < MAX_ITERATIONS; step++) {
        auto [score, inliers] = add_up(table, points, state.data, wider, equations);
        outcome[0] = score, outcome[1] = double(inliers);
        // The remaining information along a corridor is only the error of the normals. It would slow the robot down or
        // push it forward by a share of each step.
        if (ratio < LEAST_RATIO) keep_only(equations, nx, ny);
        for (int j = 0; j < 3; j++)
            for (int k = 0; k <= j; k++) information(j, k) = information(k, j) = normal[j][k] + 0.0; // never -0.0
        // Yaws need no wrapping, since start poses and predictions never differ by a full turn.
        for (int k = 0; k < 3; k++) {
            normal[k][k] += known[k];
            gradient[k] += known[k] * (predicted[k] - state[k]);
        }
        solve(equations);
        for (int k = 0; k < 3; k++) state[k] += gradient[k];
        // Stop when points within 10 m of the robot move by less than about 0.1 mm.
        if (maximum(fabs(gradient[0]), fabs(gradient[1]), 10.0 * fabs(gradient[2])) < 1e-4) break;
    }
    return true;
}
BIND(fit_scan, "k k k 3 3 3 33 2")

// Return the row of the start pose (x, y and yaw) at which a sample of points fits best; -1 for an invalid table.
inline int64_t best_start(const PointTable& table, Array<const Vector2> places, Array<const Vector2> along,
                          Array<const Vector2> normals, double spread, bool spots,
                          Array<const Vector> starts) {
    if (!is_valid(table)) return -1;
    ScanPoints points = {places, along, normals, spread, spots};
    int64_t best = 0, step = 1 + places.size() / SAMPLED_POINTS;
    double best_score = -1.0;
    for (int64_t k = 0; k < starts.size(); k++) {
        Heading heading(starts[k][2]);
        double score = 0.0;
        // Only narrow windows are used, since wide windows do not resolve the differences between poses.
        for (int64_t i = 0; i < places.size(); i += step)
            score += compare(table, points, i, starts[k][0], starts[k][1], heading, 0).score();
        if (score > best_score) best = k, best_score = score;
    }
    return best;
}
BIND(best_start, "k k k s")

} // namespace radarsim
