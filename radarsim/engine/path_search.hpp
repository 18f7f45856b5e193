// Searches for cheapest paths: of a point over all 8 neighbours of cells, and of a rectangle (see
// footprint_planning.py).
#pragma once
#include "bindings.hpp"

namespace radarsim {

// A queue from which the least value comes first; values that compare equal are equal.
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
    // Equal costs are sorted by cells, so that of several cheapest paths it is always the same.
    bool operator<(const QueuedCell& other) const {
        return cost < other.cost || (cost == other.cost && cell < other.cell);
    }
};

// Visit cells by cost until one is a target (Dijkstra); return it, or -1. The costs are those of a step of one cell
// into each. Sets the cost of the cheapest way to each cell, which has to be infinite before, and the cell before it.
inline int64_t search_grid(Array<const double, 2> cost, int64_t row, int64_t column, Array<const bool, 2> targets,
                           Array<int64_t, 2> parents, Array<double, 2> best) {
    int64_t rows = cost.shape[0], columns = cost.shape[1];
    if (row < 0 || row >= rows || column < 0 || column >= columns) return -1;
    Heap<QueuedCell> queue;
    best(row, column) = 0.0;
    queue.push({0.0, row * columns + column});
    while (!queue.is_empty()) {
        auto [so_far, cell] = queue.pop();
        if (so_far > best.data[cell]) continue; // a cheaper way here has been found since this was queued
        if (targets.data[cell]) return cell;
        int64_t i = cell / columns, j = cell % columns;
        for (int64_t k = i - 1; k <= i + 1; k++)
            for (int64_t n = j - 1; n <= j + 1; n++) {
                if (k < 0 || k >= rows || n < 0 || n >= columns || (k == i && n == j)) continue;
                double total = so_far + cost(k, n) * (k == i || n == j ? 1.0 : sqrt(2.0));
                // Less, and not as much, for the same reason as above. No step costs less than nothing.
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
using MotionCosts = double[4];    // of each motion: forward, backward, and the turns to the next headings

// The cells of a grid and the motions of a robot on it. A state is the number of a cell times 16, and a heading.
struct PoseLattice {
    Array<const int64_t, 2> masks; // for each cell, as footprint_planning.py makes them
    Array<const CellStep> steps;   // along each heading, from one centre to the next

    int64_t cells() const { return masks.shape[0] * masks.shape[1]; }
    bool has_cell(int64_t cell) const {
        return cell >= 0 && cell < cells() && cells() < INT32_MAX / HEADINGS && steps.size() == HEADINGS;
    }

    // Return the state after a motion, and set what it is too near to, a bit per margin.
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
    double guess, so_far; // the costs of the whole way, and to the state
    int64_t state;
    bool operator<(const QueuedState& other) const {
        if (guess != other.guess) return guess < other.guess;
        return so_far < other.so_far || (so_far == other.so_far && state < other.state);
    }
};

// Visit states by cost, guided (A*), until one is in the goal; return it, or -1. The first is at heading 0 in the
// start. Within the second and the third margin a motion costs more. Sets the state before each, plus 1.
inline int64_t search_states(Array<const int64_t, 2> masks, Array<const CellStep> steps,
                             Array<const MotionCosts> costs, double more, double little_more,
                             Array<const double, 2> guide, int64_t start, int64_t goal, Array<int32_t, 2> parents) {
    PoseLattice lattice = {masks, steps};
    if (!lattice.has_cell(start) || parents.shape[0] < lattice.cells()) return -1;
    // Only pages that are written take memory. Zero for states without a parent, to which no way is known.
    Buffer<double> best(lattice.cells() * HEADINGS);
    int64_t first = start * HEADINGS;
    Heap<QueuedState> queue;
    queue.push({guide.data[start], 0.0, first});
    while (!queue.is_empty()) {
        auto [guess, so_far, state] = queue.pop();
        if (so_far > best[state]) continue; // a cheaper way here has been found since this was queued
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

// Whether motions lead from heading 0 in a cell to another cell. Motions can be undone. So states are visited from both
// cells in turn until they meet, or none is left on one side: that is far less than a search visits that fails.
inline int64_t are_joined(Array<const int64_t, 2> masks, Array<const CellStep> steps, int64_t start, int64_t goal) {
    PoseLattice lattice = {masks, steps};
    if (!lattice.has_cell(start) || !lattice.has_cell(goal)) return false;
    if (start == goal) return true;
    List<int32_t> queues[2] = {List<int32_t>(lattice.cells() * HEADINGS), List<int32_t>(lattice.cells() * HEADINGS)};
    Buffer<int8_t> sides(lattice.cells() * HEADINGS); // from which each state was visited
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
