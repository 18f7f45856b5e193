// Occupancy grids: the evidence that one scan gives for the cells of a map, and distances of cells.
//
// Each layer holds evidence in tenths of log-odds, as whole numbers: more when a beam hits what the layer is of, less
// when a beam passes through without hitting it. A cell gets one piece of evidence per scan and layer, however many
// beams cross it, and a hit outweighs beams that pass: beams that slide along a wall, among others that end on it, do
// not wear it away, and cells near the robot, where beams are dense, do not become surer than those far away.
#pragma once
#include "bindings.hpp"

namespace radarsim {

using Vector2 = double[2]; // x and y

enum class BeamEnd : int8_t { NOTHING, UNSURE, HIT, SPENT, AIR, BLIND }; // as in scan.py, and so are the layers
enum Layer { SOLID_LAYER, FOLIAGE_LAYER, SMOKE_LAYER, BEAM_END_LAYER, LAYERS };

constexpr int LOG_ODDS_HIT = 9;    // tenths; odds of 2.5 to 1
constexpr int LOG_ODDS_FREE = 2;   // 1 to 1.2: side rays often miss thin objects
constexpr int LOG_ODDS_LIMIT = 60; // so that a map can still change where things moved

// Flags of a cell: two that stay, one for each layer that has had its hit of this scan, and one for cells that have
// had their evidence for being free.
enum CellFlag : uint8_t { SENSED = 1, NEAR = 2, HAS_HIT = 4, IS_CROSSED = 64 };

struct GridCells {
    Array<int8_t, 3> evidence; // by layer, row and column
    Array<uint8_t, 2> flags;
    double first_row, first_column; // numbers of those of the arrays, counted from the map's origin
};

struct BeamsOverCells {
    double x, y; // where they begin, in cells from the map's origin
    Array<const Vector2> directions;
    Array<const double> known_range; // cells
    Array<const BeamEnd> ends;

    // A beam at its maximum range, or at a drop of rain, has ended at nothing that stays.
    bool is_obstructed(int64_t beam) const {
        return ends[beam] == BeamEnd::UNSURE || ends[beam] == BeamEnd::HIT || ends[beam] == BeamEnd::SPENT;
    }
};

// A walk over the cells along a beam, in order, those at both ends included.
class BeamWalk {
  public:
    int64_t row, column; // in the arrays, which have no influence on what cells are crossed, to the last bit
    int64_t left = 0;    // how many cells are left, this one included; none if the beam leaves the arrays

    BeamWalk(const GridCells& cells, const BeamsOverCells& beams, int64_t beam, double near, double far) {
        const auto& [dx, dy] = beams.directions[beam];
        double x = beams.x + near * dx, y = beams.y + near * dy;
        bool is_inside = near <= far && place(floor(x) - cells.first_column, cells.flags.shape[1], column) &&
                         place(floor(y) - cells.first_row, cells.flags.shape[0], row) &&
                         place(floor(beams.x + far * dx) - cells.first_column, cells.flags.shape[1], last_column_) &&
                         place(floor(beams.y + far * dy) - cells.first_row, cells.flags.shape[0], last_row_);
        if (!is_inside) return;
        right_ = dx > 0.0 ? 1 : -1, up_ = dy > 0.0 ? 1 : -1;
        step_x_ = fabs(1.0 / dx), step_y_ = fabs(1.0 / dy); // infinite along an axis
        next_x_ = dx != 0.0 ? (floor(x) + (dx > 0.0) - x) / dx : INFINITE;
        next_y_ = dy != 0.0 ? (floor(y) + (dy > 0.0) - y) / dy : INFINITE;
        // Between them a beam makes as many steps as there are rows and columns. Counting those, and not the
        // distance, loses no cell to rounding.
        left = llabs(last_column_ - column) + llabs(last_row_ - row) + 1;
    }

    void step() {
        left--;
        // To the nearer border, but never past the last row or column: the distances to borders are sums, whose
        // rounding would carry the beam beyond its end.
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
    // Once per scan: dense beams near the robot are no better evidence.
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
        // A laser's ranges tell nothing of foliage and smoke, not that there is none.
        if (!sees_through && (layer == FOLIAGE_LAYER || layer == SMOKE_LAYER)) continue;
        // Only layers that had no hit in it: beams slide along a wall on which others end.
        if (flags & (HAS_HIT << layer)) continue;
        int8_t& evidence = cells.evidence(layer, row, column);
        evidence = int8_t(maximum(evidence - LOG_ODDS_FREE, -LOG_ODDS_LIMIT));
    }
}

// Add the evidence of all cells before the ends of beams.
inline void add_free_cells(const GridCells& cells, const BeamsOverCells& beams, double short_range,
                           bool sees_through) {
    for (int64_t k = 0; k < beams.known_range.size(); k++) {
        // Its known range is 0, which would still mark the cell of the scanner as free.
        if (beams.ends[k] == BeamEnd::BLIND) continue;
        BeamWalk walk(cells, beams, k, 0.0, beams.known_range[k]);
        // The cell of the end itself is not free.
        for (int64_t end = beams.is_obstructed(k); walk.left > end; walk.step()) {
            add_free(cells, walk.row, walk.column, sees_through);
            // From scanner to middle of cell.
            double dx = cells.first_column + double(walk.column) + 0.5 - beams.x;
            double dy = cells.first_row + double(walk.row) + 0.5 - beams.y;
            if (dx * dx + dy * dy < short_range * short_range) cells.flags(walk.row, walk.column) |= NEAR;
        }
    }
}

// Add a scan to a map. Of what leaves the arrays nothing is added. All lengths are in cells; where they are counted
// from the map's origin, so are x and y. A cell may be NEAR within the short range.
inline void add_scan(Array<int8_t, 3> evidence, Array<uint8_t, 2> flags, int64_t first_row, int64_t first_column,
                     double x, double y, Array<const Vector2> directions, Array<const double> known_range,
                     Array<const BeamEnd> ends, Array<const int64_t> hit_beams, Array<const double> near,
                     Array<const double> far, Array<const int8_t> layers, double short_range, bool sees_through) {
    GridCells cells = {evidence, flags, double(first_row), double(first_column)};
    BeamsOverCells beams = {x, y, directions, known_range, ends};
    // Hits first: beams that pass must not weaken what others of the same scan hit.
    for (int64_t k = 0; k < near.size(); k++) {
        if (hit_beams[k] < 0 || hit_beams[k] >= ends.size() || layers[k] < 0 || layers[k] >= LAYERS) continue;
        for (BeamWalk walk(cells, beams, hit_beams[k], near[k], far[k]); walk.left > 0; walk.step())
            add_hit(cells, layers[k], walk.row, walk.column);
    }
    for (int64_t k = 0; k < ends.size(); k++) {
        BeamWalk end(cells, beams, k, known_range[k], known_range[k]);
        if (!end.left || !beams.is_obstructed(k)) continue;
        add_hit(cells, BEAM_END_LAYER, end.row, end.column);
        flags(end.row, end.column) |= SENSED; // known, though it is not free
    }
    add_free_cells(cells, beams, short_range, sees_through);
    // Along the beams once more, as no other cells have flags of this scan: clearing the whole array would take
    // longer the larger the map is.
    for (int64_t k = 0; k < ends.size(); k++)
        if (ends[k] != BeamEnd::BLIND)
            for (BeamWalk walk(cells, beams, k, 0.0, known_range[k]); walk.left > 0; walk.step())
                flags(walk.row, walk.column) &= SENSED | NEAR;
}
BIND(add_scan, "4rc rc n n n k k k k")

constexpr int32_t FARTHEST = 32767; // cells; the sum of two squares fits in 32 bits

// Fill in the distance from each cell to the nearest true one, center to center, in cells; infinite beyond a limit, and
// beyond the farthest.
inline void fill_distances(Array<const bool, 2> cells, double limit, Array<double, 2> distances) {
    int64_t rows = cells.shape[0], columns = cells.shape[1];
    limit = minimum(limit, double(FARTHEST));
    // Squares of distances are separable: first the nearest true cell within each row, from both sides, then the best
    // of the rows near by.
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
        // Only the rows were limited, but not the columns.
        for (int64_t j = 0; j < columns; j++) {
            double distance = sqrt(double(nearest[j]));
            distances(i, j) = distance > limit ? INFINITE : distance;
        }
    }
}
BIND(fill_distances, "rc rc")

// Join the points where beams enter targets with those where they leave them: the echoes of a scan are sorted by beam,
// then by target, then by range. A beam that leaves a target which it has not entered began inside it; one that does
// not leave what it has entered ended there. A target nested in itself counts once.
enum class EchoKind : int8_t { ENTER, LEAVE, SHEET, HIT, SPENT, RAIN };

inline void pair_echoes(Array<const int64_t> beams, Array<const int64_t> targets, Array<const double> ranges,
                        Array<const EchoKind> kinds, Array<const double> known_range, Array<double> near,
                        Array<double> far, Array<bool> is_hit) {
    int64_t depth = 0, count = beams.size(); // how deep the beam is in copies of one target, one in another
    double begun = 0.0;
    auto add = [&](int64_t i, double from, double to, bool counts) {
        near[i] = from, far[i] = to, is_hit[i] = counts;
    };
    for (int64_t i = 0; i < count; i++) {
        double range = ranges[i];
        EchoKind kind = kinds[i];
        if (kind == EchoKind::LEAVE) {
            add(i, begun, range, depth <= 1);
            // It may have begun in several copies: the next one it leaves begins here.
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
