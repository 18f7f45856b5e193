// Searches for the cheapest path: for a point on an 8-connected grid, and for a rectangular footprint (see
// footprint_planning.py).
#pragma once
#include "bindings.hpp"

namespace radarsim {

// A priority queue (binary heap) with the least value first. The order of values must be total.
template <typename T> class Heap : Memory {
  public:
    bool is_empty() const { return !size_; }

    void push(T value) {
        if (size_ == capacity_) {
            capacity_ = 2 * capacity_ + 64;
            hold(realloc(data_, capacity_ * sizeof(T)));
        }
        T* values = static_cast<T*>(data_);
        int64_t i = size_++;
        for (; i > 0 && value < values[(i - 1) / 2]; i = (i - 1) / 2) values[i] = values[(i - 1) / 2];
        values[i] = value;
    }

    T pop() {
        T *values = static_cast<T*>(data_), first = values[0], last = values[--size_];
        int64_t i = 0;
        for (int64_t child = 1; child < size_; child = 2 * i + 1) {
            child += child + 1 < size_ && values[child + 1] < values[child];
            if (!(values[child] < last)) break;
            values[i] = values[child];
            i = child;
        }
        values[i] = last;
        return first;
    }

  private:
    int64_t size_ = 0, capacity_ = 0;
};

struct QueuedCell {
    double cost;
    int64_t cell;
    // Equal costs are sorted by cell, so the same path is chosen among several cheapest paths.
    bool operator<(const QueuedCell& other) const {
        return cost < other.cost || (cost == other.cost && cell < other.cell);
    }
};

// Find the cheapest path to a target cell (Dijkstra's algorithm); returns the target, or -1. The array cost has the
// cost of a step of one cell into each cell. For visited cells, the function sets best, which must be infinite before,
// to the cost of the cheapest path, and parents to the previous cell.
inline int64_t search_grid(Array<const double, 2> cost, int64_t row, int64_t column, Array<const bool, 2> targets,
                           Array<int64_t, 2> parents, Array<double, 2> best) {
    int64_t rows = cost.shape[0], columns = cost.shape[1];
    if (row < 0 || row >= rows || column < 0 || column >= columns) return -1;
    Heap<QueuedCell> queue;
    best(row, column) = 0.0;
    queue.push({0.0, row * columns + column});
    while (!queue.is_empty()) {
        auto [so_far, cell] = queue.pop();
        if (so_far > best.data[cell]) continue; // a cheaper path to this cell was found after it was queued
        if (targets.data[cell]) return cell;
        int64_t i = cell / columns, j = cell % columns;
        for (int64_t k = i - 1; k <= i + 1; k++)
            for (int64_t n = j - 1; n <= j + 1; n++) {
                if (k < 0 || k >= rows || n < 0 || n >= columns || (k == i && n == j)) continue;
                double total = so_far + cost(k, n) * (k == i || n == j ? 1.0 : sqrt(2.0));
                // A path replaces another path only if it is strictly cheaper, so each cell is visited once. Negative
                // costs are ignored.
                if (!(so_far <= total && total < best(k, n))) continue;
                best(k, n) = total;
                parents(k, n) = cell;
                queue.push({total, k * columns + n});
            }
    }
    return -1;
}
BIND(search_grid, "rc rc rc rc")

constexpr int HEADINGS = 16;
using CellStep = int64_t[2];      // columns and rows
using MotionCosts = double[4];    // costs of the motions: forward, backward, and turns to the next headings

// A state lattice: the cells of a grid and the motions of a robot. A state is the index of a cell times 16 plus a
// heading.
struct PoseLattice {
    Array<const int64_t, 2> masks; // bit masks of each cell from footprint_planning.py
    Array<const CellStep> steps;   // for each heading the step from a cell centre to the next

    int64_t cells() const { return masks.shape[0] * masks.shape[1]; }
    bool has_cell(int64_t cell) const {
        return cell >= 0 && cell < cells() && cells() < INT32_MAX / HEADINGS && steps.size() == HEADINGS;
    }

    // Return the state after a motion, and set a bit for each margin that an obstacle intrudes on.
    int64_t after(int64_t state, int motion, int64_t& bits) const {
        int64_t cell = state / HEADINGS, heading = state % HEADINGS;
        if (motion >= 2) {
            int turn = 2 * motion - 5;
            int64_t mask = masks.data[cell], to = (heading + turn) & (HEADINGS - 1);
            bits = mask >> (2 * to & 15) | mask >> ((2 * heading + turn) & 15);
            return cell * HEADINGS + to;
        }
        int sign = 1 - 2 * motion;
        int64_t row = cell / masks.shape[1] + sign * steps[heading][1];
        int64_t column = cell % masks.shape[1] + sign * steps[heading][0];
        bits = 1;
        if (row < 0 || row >= masks.shape[0] || column < 0 || column >= masks.shape[1]) return state;
        bits = masks(row, column) >> (2 * heading & 15);
        return (row * masks.shape[1] + column) * HEADINGS + heading;
    }
};

struct QueuedState {
    double guess, so_far; // estimated cost of the whole path, and cost up to the state
    int64_t state;
    bool operator<(const QueuedState& other) const {
        if (guess != other.guess) return guess < other.guess;
        return so_far < other.so_far || (so_far == other.so_far && state < other.state);
    }
};

// Find the cheapest path from heading 0 in the start cell to the goal cell (A*); returns the state in the goal, or -1.
// The guide is the estimated remaining cost of each cell. Motions within the second and the third margin of obstacles
// cost more. Sets for each visited state the previous state plus 1.
inline int64_t search_states(Array<const int64_t, 2> masks, Array<const CellStep> steps,
                             Array<const MotionCosts> costs, double more, double little_more,
                             Array<const double, 2> guide, int64_t start, int64_t goal, Array<int32_t, 2> parents) {
    PoseLattice lattice = {masks, steps};
    if (!lattice.has_cell(start) || parents.shape[0] < lattice.cells()) return -1;
    // Only pages that are written use memory. The value is meaningless for states without a parent.
    Buffer<double> best(lattice.cells() * HEADINGS);
    int64_t first = start * HEADINGS;
    Heap<QueuedState> queue;
    queue.push({guide.data[start], 0.0, first});
    while (!queue.is_empty()) {
        auto [guess, so_far, state] = queue.pop();
        if (so_far > best[state]) continue; // a cheaper path to this state was found after it was queued
        if (state / HEADINGS == goal) return state;
        for (int motion = 0; motion < 4; motion++) {
            int64_t bits, after = lattice.after(state, motion, bits);
            if (bits & 1) continue;
            double cost = 1.0 + more * double(bits >> 16 & 1) + little_more * double(bits >> 32 & 1);
            double total = so_far + costs[state % HEADINGS][motion] * cost;
            bool is_known = parents.data[after] || after == first;
            if (!(so_far <= total && total < (is_known ? best[after] : INFINITE))) continue;
            best[after] = total;
            parents.data[after] = int32_t(state + 1);
            queue.push({total + guide.data[after / HEADINGS], total, after});
        }
    }
    return -1;
}
BIND(search_states, "rc h h rc sh")

// Whether the goal can be reached from heading 0 in the start cell. Motions are reversible, so a bidirectional search
// expands states from both cells alternately until they meet or one side has none left. A failed search then visits far
// fewer states than a search from one side.
inline int64_t are_joined(Array<const int64_t, 2> masks, Array<const CellStep> steps, int64_t start, int64_t goal) {
    PoseLattice lattice = {masks, steps};
    if (!lattice.has_cell(start) || !lattice.has_cell(goal)) return false;
    if (start == goal) return true;
    List<int32_t> queues[2] = {List<int32_t>(lattice.cells() * HEADINGS), List<int32_t>(lattice.cells() * HEADINGS)};
    Buffer<int8_t> sides(lattice.cells() * HEADINGS); // side from which each state was visited, plus 1
    auto visit = [&](int side, int64_t state) {
        sides[state] = int8_t(side + 1);
        queues[side].append(int32_t(state));
    };
    visit(0, start * HEADINGS);
    for (int heading = 0; heading < HEADINGS; heading++)
        if (!(masks.data[goal] >> (2 * heading & 15) & 1)) visit(1, goal * HEADINGS + heading);
    for (int64_t done = 0;; done++)
        for (int side = 0; side < 2; side++) {
            if (done == queues[side].size()) return false;
            int64_t state = queues[side][done];
            for (int motion = 0; motion < 4; motion++) {
                int64_t bits, after = lattice.after(state, motion, bits);
                if (bits & 1 || sides[after] == side + 1) continue;
                if (sides[after]) return true;
                visit(side, after);
            }
        }
}
BIND(are_joined, "rc h")

} // namespace radarsim
