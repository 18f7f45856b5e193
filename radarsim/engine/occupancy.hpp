// Occupancy grids: updates of a map with the evidence of a scan, and a distance transform.
//
// Each layer stores the log-odds of a kind of obstacle as an integer in tenths. A beam that hits such an obstacle
// raises the log-odds, a beam that passes through the cell lowers them. A cell is updated once per scan and layer,
// regardless of the number of beams, and a hit has precedence over passing beams. So beams that graze a wall do not
// erase it while others end at it, and cells near the robot, where beams are dense, do not become more certain than
// distant cells.
#pragma once
#include "bindings.hpp"

namespace radarsim {

using Vector2 = double[2]; // x and y

enum class BeamEnd : int8_t { NOTHING, UNSURE, HIT, SPENT, AIR, BLIND }; // the same as in scan.py, like the layers
enum Layer { SOLID_LAYER, FOLIAGE_LAYER, SMOKE_LAYER, BEAM_END_LAYER, LAYERS };

constexpr int LOG_ODDS_HIT = 9;    // tenths; odds of 2.5 to 1
constexpr int LOG_ODDS_FREE = 2;   // tenths; odds of 1 to 1.2, since side rays often miss thin objects
constexpr int LOG_ODDS_LIMIT = 60; // tenths; limited, so that the map can change when obstacles move

// Flags of a cell. SENSED and NEAR are permanent. During the update with a scan, each layer has a flag for cells that
// were hit, and IS_CROSSED marks cells that were updated as free.
enum CellFlag : uint8_t { SENSED = 1, NEAR = 2, HAS_HIT = 4, IS_CROSSED = 64 };

struct GridCells {
    Array<int8_t, 3> evidence; // log-odds in tenths by layer, row and column
    Array<uint8_t, 2> flags;
    double first_row, first_column; // first row and column of the arrays, in cells from the map's origin
};

struct BeamsOverCells {
    double x, y; // start of all beams, in cells from the map's origin
    Array<const Vector2> directions;
    Array<const double> known_range; // cells
    Array<const BeamEnd> ends;

    // Whether the beam ended at an obstacle; maximum ranges and rain drops do not count.
    bool is_obstructed(int64_t beam) const {
        return ends[beam] == BeamEnd::UNSURE || ends[beam] == BeamEnd::HIT || ends[beam] == BeamEnd::SPENT;
    }
};

// Visits the cells along a beam in order, including the cells of both ends.
class BeamWalk {
  public:
    int64_t row, column; // indices in the arrays; the crossed cells do not depend on the size of the arrays
    int64_t left = 0;    // number of remaining cells, including the current cell; 0 if the beam leaves the arrays

    BeamWalk(const GridCells& cells, const BeamsOverCells& beams, int64_t beam, double near, double far) {
        const auto& [dx, dy] = beams.directions[beam];
        double x = beams.x + near * dx, y = beams.y + near * dy;
        bool is_inside = near <= far && place(floor(x) - cells.first_column, cells.flags.shape[1], column) &&
                         place(floor(y) - cells.first_row, cells.flags.shape[0], row) &&
                         place(floor(beams.x + far * dx) - cells.first_column, cells.flags.shape[1], last_column_) &&
                         place(floor(beams.y + far * dy) - cells.first_row, cells.flags.shape[0], last_row_);
        if (!is_inside) return;
        right_ = dx > 0.0 ? 1 : -1, up_ = dy > 0.0 ? 1 : -1;
        step_x_ = fabs(1.0 / dx), step_y_ = fabs(1.0 / dy); // infinite if the beam is parallel to an axis
        next_x_ = dx != 0.0 ? (floor(x) + (dx > 0.0) - x) / dx : INFINITE;
        next_y_ = dy != 0.0 ? (floor(y) + (dy > 0.0) - y) / dy : INFINITE;
        // The number of steps is the number of rows plus columns between both ends. Counting steps instead of measuring
        // distance loses no cell to rounding errors.
        left = llabs(last_column_ - column) + llabs(last_row_ - row) + 1;
    }

    void step() {
        left--;
        // Step over the nearer border, but never past the last row or column: distances to borders are sums, whose
        // rounding errors could move the beam beyond its end.
        if (column != last_column_ && (next_x_ < next_y_ || row == last_row_)) {
            column += right_;
            next_x_ += step_x_;
        } else {
            row += up_;
            next_y_ += step_y_;
        }
    }

  private:
    int64_t last_row_, last_column_;
    int right_, up_;
    double step_x_, step_y_, next_x_, next_y_;

    static bool place(double cell, int64_t count, int64_t& index) {
        if (!(cell >= 0.0 && cell < double(count))) return false;
        index = int64_t(cell);
        return true;
    }
};

inline void add_hit(const GridCells& cells, int layer, int64_t row, int64_t column) {
    // A cell is updated only once per scan, since dense beams near the robot are not independent evidence.
    uint8_t flag = uint8_t(HAS_HIT << layer), &flags = cells.flags(row, column);
    if (flags & flag) return;
    flags |= flag;
    int8_t& evidence = cells.evidence(layer, row, column);
    evidence = int8_t(minimum(evidence + LOG_ODDS_HIT, LOG_ODDS_LIMIT));
}

inline void add_free(const GridCells& cells, int64_t row, int64_t column, bool sees_through) {
    uint8_t flags = cells.flags(row, column);
    if (flags & IS_CROSSED) return;
    cells.flags(row, column) = flags | IS_CROSSED | SENSED;
    for (int layer = 0; layer < LAYERS; layer++) {
        // A laser does not detect foliage and smoke, so its beams are no evidence that a cell is free of them.
        if (!sees_through && (layer == FOLIAGE_LAYER || layer == SMOKE_LAYER)) continue;
        // Layers with a hit in this scan are skipped, since beams may graze a wall at which others end.
        if (flags & (HAS_HIT << layer)) continue;
        int8_t& evidence = cells.evidence(layer, row, column);
        evidence = int8_t(maximum(evidence - LOG_ODDS_FREE, -LOG_ODDS_LIMIT));
    }
}

// Update the cells before the ends of beams as free.
inline void add_free_cells(const GridCells& cells, const BeamsOverCells& beams, double short_range,
                           bool sees_through) {
    for (int64_t k = 0; k < beams.known_range.size(); k++) {
        // A blinded beam has a known range of 0, but would still mark the cell of the scanner as free.
        if (beams.ends[k] == BeamEnd::BLIND) continue;
        BeamWalk walk(cells, beams, k, 0.0, beams.known_range[k]);
        // The cell of an obstacle is not free.
        for (int64_t end = beams.is_obstructed(k); walk.left > end; walk.step()) {
            add_free(cells, walk.row, walk.column, sees_through);
            // The vector from the scanner to the centre of the cell.
            double dx = cells.first_column + double(walk.column) + 0.5 - beams.x;
            double dy = cells.first_row + double(walk.row) + 0.5 - beams.y;
            if (dx * dx + dy * dy < short_range * short_range) cells.flags(walk.row, walk.column) |= NEAR;
        }
    }
}

// Update a map with a scan. Beams that leave the arrays are ignored. All lengths are in cells; x and y are relative to
// the map's origin. Crossed cells within the short range become NEAR.
inline void add_scan(Array<int8_t, 3> evidence, Array<uint8_t, 2> flags, int64_t first_row, int64_t first_column,
                     double x, double y, Array<const Vector2> directions, Array<const double> known_range,
                     Array<const BeamEnd> ends, Array<const int64_t> hit_beams, Array<const double> near,
                     Array<const double> far, Array<const int8_t> layers, double short_range, bool sees_through) {
    GridCells cells = {evidence, flags, double(first_row), double(first_column)};
    BeamsOverCells beams = {x, y, directions, known_range, ends};
    // Hits are processed first, since passing beams must not lower the log-odds of cells that other beams of the scan
    // hit.
    for (int64_t k = 0; k < near.size(); k++) {
        if (hit_beams[k] < 0 || hit_beams[k] >= ends.size() || layers[k] < 0 || layers[k] >= LAYERS) continue;
        for (BeamWalk walk(cells, beams, hit_beams[k], near[k], far[k]); walk.left > 0; walk.step())
            add_hit(cells, layers[k], walk.row, walk.column);
    }
    for (int64_t k = 0; k < ends.size(); k++) {
        BeamWalk end(cells, beams, k, known_range[k], known_range[k]);
        if (!end.left || !beams.is_obstructed(k)) continue;
        add_hit(cells, BEAM_END_LAYER, end.row, end.column);
        flags(end.row, end.column) |= SENSED; // the cell is known although it is not free
    }
    add_free_cells(cells, beams, short_range, sees_through);
    // Clear the flags of this scan along the beams, since clearing the whole array would be slow for large maps.
    for (int64_t k = 0; k < ends.size(); k++)
        if (ends[k] != BeamEnd::BLIND)
            for (BeamWalk walk(cells, beams, k, 0.0, known_range[k]); walk.left > 0; walk.step())
                flags(walk.row, walk.column) &= SENSED | NEAR;
}
BIND(add_scan, "4rc rc n n n k k k k")

constexpr int32_t FARTHEST = 32767; // cells; the sum of two squares fits in 32 bits

// Compute the distance from each cell to the nearest true cell, from centre to centre, in cells; distances beyond the
// limit or beyond FARTHEST are infinite.
inline void fill_distances(Array<const bool, 2> cells, double limit, Array<double, 2> distances) {
    int64_t rows = cells.shape[0], columns = cells.shape[1];
    limit = minimum(limit, double(FARTHEST));
    // Squared distances are separable: first the nearest true cell in the same row is found, from both sides, then the
    // minimum over the rows within reach.
    Buffer<int32_t> in_rows(rows * columns), nearest(columns);
    for (int64_t i = 0; i < rows; i++) {
        int32_t *squares = &in_rows[i * columns], since = FARTHEST + 1;
        auto count = [&](int64_t j) { since = cells(i, j) ? 0 : since <= FARTHEST ? since + 1 : since; };
        for (int64_t j = 0; j < columns; j++) count(j), squares[j] = since;
        since = FARTHEST + 1;
        for (int64_t j = columns - 1; j >= 0; j--) {
            count(j);
            int32_t distance = minimum(squares[j], since);
            squares[j] = distance * distance;
        }
    }
    int64_t reach = int64_t(maximum(0.0, limit));
    for (int64_t i = 0; i < rows; i++) {
        for (int64_t j = 0; j < columns; j++) nearest[j] = INT32_MAX;
        for (int64_t k = i > reach ? i - reach : 0; k <= i + reach && k < rows; k++) {
            int32_t *squares = &in_rows[k * columns], square = int32_t((i - k) * (i - k));
            for (int64_t j = 0; j < columns; j++) nearest[j] = minimum(nearest[j], squares[j] + square);
        }
        // The search was limited to near rows, but not to near columns.
        for (int64_t j = 0; j < columns; j++) {
            double distance = sqrt(double(nearest[j]));
            distances(i, j) = distance > limit ? INFINITE : distance;
        }
    }
}
BIND(fill_distances, "rc rc")

enum class EchoKind : int8_t { ENTER, LEAVE, SHEET, HIT, SPENT, RAIN };

// Pair the echoes of beams that enter a target with the echoes of beams that leave it, and set near and far range of
// each pair. Echoes are sorted by beam, target and range. A beam that leaves a target without entering it started
// inside it; a beam that enters without leaving ended inside it. Nested copies of a target count once.
inline void pair_echoes(Array<const int64_t> beams, Array<const int64_t> targets, Array<const double> ranges,
                        Array<const EchoKind> kinds, Array<const double> known_range, Array<double> near,
                        Array<double> far, Array<bool> is_hit) {
    int64_t depth = 0, count = beams.size(); // depth: number of nested copies of a target around the beam
    double begun = 0.0;
    auto add = [&](int64_t i, double from, double to, bool counts) {
        near[i] = from, far[i] = to, is_hit[i] = counts;
    };
    for (int64_t i = 0; i < count; i++) {
        double range = ranges[i];
        EchoKind kind = kinds[i];
        if (kind == EchoKind::LEAVE) {
            add(i, begun, range, depth <= 1);
            // The beam may have started inside several copies; the next copy that it leaves begins here.
            if (depth <= 1) begun = range;
            if (depth > 0) depth--;
        } else if (kind == EchoKind::SHEET || kind == EchoKind::HIT) {
            add(i, range, range, true);
        } else if (kind == EchoKind::SPENT) {
            add(i, depth ? begun : range, range, true);
            depth = 0;
        } else if (kind != EchoKind::RAIN) {
            if (!depth) begun = range;
            depth++;
        }
        if (i + 1 < count && beams[i + 1] == beams[i] && targets[i + 1] == targets[i]) continue;
        if (depth > 0 && beams[i] >= 0 && beams[i] < known_range.size())
            add(i, begun, maximum(known_range[beams[i]], range), true);
        depth = 0, begun = 0.0;
    }
}
BIND(pair_echoes, "e e e e b e e e")

} // namespace radarsim
