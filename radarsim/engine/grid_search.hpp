// Searches on grids: cheapest paths over all 8 neighbours.
#pragma once
#include "door.hpp"

namespace radarsim {

// A queue from which the least value comes first; values that compare equal are equal.
template <typename T> class Heap {
  public:
    Heap() = default;
    ~Heap() { free(values_); }
    Heap(const Heap&) = delete;
    Heap& operator=(const Heap&) = delete;
    bool is_empty() const { return !size_; }

    void push(T value) {
        if (size_ == capacity_) {
            capacity_ = 2 * capacity_ + 64;
            values_ = static_cast<T*>(realloc(values_, capacity_ * sizeof(T)));
            if (!values_) abort();
        }
        int64_t i = size_++;
        for (; i > 0 && value < values_[(i - 1) / 2]; i = (i - 1) / 2) values_[i] = values_[(i - 1) / 2];
        values_[i] = value;
    }

    T pop() {
        T least = values_[0], last = values_[--size_];
        int64_t i = 0;
        for (int64_t child = 1; child < size_; child = 2 * i + 1) {
            child += child + 1 < size_ && values_[child + 1] < values_[child];
            if (!(values_[child] < last)) break;
            values_[i] = values_[child];
            i = child;
        }
        values_[i] = last;
        return least;
    }

  private:
    T* values_ = nullptr;
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
DOOR(search_grid, "rc rc rc rc")

} // namespace radarsim
