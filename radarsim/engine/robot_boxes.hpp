// Intersections of rays with robots, which are upright boxes that stop every ray and, unlike the scene, move.
//
// A grid of square cells, seen from above, covers all boxes. Each cell lists the boxes whose bounding circles reach
// into the cell. A ray visits the cells along its path in order and tests the listed boxes until it has hit a box
// before the end of a cell. In a hall with a thousand robots, a ray tests about a dozen boxes (row j of the
// benchmarks).
//
// The grid does not change the results, since the circles have a margin that is much larger than rounding errors. All
// boxes are tested if coordinates are too large for this margin, or if there are too few boxes or rays for a grid to be
// faster.
#pragma once
#include "bindings.hpp"

namespace radarsim {

constexpr int64_t MIN_BOXES = 8, MIN_RAYS = 16; // with fewer boxes or rays the grid has a single cell
constexpr double SLACK = 1e-6;                  // m, margin around the bounding circles of boxes
constexpr double MAX_COORDINATE = 1e5;          // m; with larger coordinates rounding errors approach SLACK
constexpr double MIN_SLOPE = 1e-200;            // a ray with a smaller slope along an axis never leaves its cell

struct RobotBox { // a row of Boxes.table
    double x, y, z, cos, sin, length, width, height, footprint_radius, id;
};
ROW(RobotBox, x, y, z, cos, sin, length, width, height, footprint_radius, id)

struct Span {
    double near, far;
};

// Return the distances at which a ray enters and leaves the slab from -half to half along an axis.
inline Span intersect_slab(double start, double slope, double half) {
    if (slope == 0.0) return fabs(start) <= half ? Span{-INFINITE, INFINITE} : Span{INFINITE, -INFINITE};
    double first = (-half - start) / slope, second = (half - start) / slope;
    return {minimum(first, second), maximum(first, second)};
}

// Return the distance at which a ray hits a box, m; -1 if it misses. A ray that starts inside also hits the box.
inline double intersect_box(const RobotBox& box, const Vector& origin, const Vector& direction) {
    double ex = direction[0], ey = direction[1], dx = origin[0] - box.x, dy = origin[1] - box.y;
    // Most boxes are too far from the ray and are rejected by their circles.
    if (fabs(ex * dy - ey * dx) > box.footprint_radius) return -1.0;
    double c = box.cos, s = box.sin;
    Span ahead = intersect_slab(c * dx + s * dy, c * ex + s * ey, box.length);
    Span across = intersect_slab(c * dy - s * dx, c * ey - s * ex, box.width);
    Span above = intersect_slab(origin[2] - box.z, direction[2], box.height);
    double near = maximum(ahead.near, across.near, above.near), far = minimum(ahead.far, across.far, above.far);
    double t = near >= 0.0 ? near : far;
    return near <= far && t >= 0.0 ? t : -1.0;
}

// Return the cosine between a ray and the normal of the face of the box that it hit.
inline double box_incidence(Array<const RobotBox> boxes, int64_t id, const Vector& origin, const Vector& direction,
                            double t) {
    double cosine = 0.0;
    for (int64_t i = 0; i < boxes.size(); i++) {
        const RobotBox& box = boxes[i];
        if (box.id != double(id)) continue;
        double c = box.cos, s = box.sin;
        double x = origin[0] + t * direction[0] - box.x, y = origin[1] + t * direction[1] - box.y;
        double z = origin[2] + t * direction[2] - box.z;
        // The hit point is on the face with the nearest plane.
        double ahead = fabs(fabs(c * x + s * y) - box.length);
        double across = fabs(fabs(c * y - s * x) - box.width);
        double above = fabs(fabs(z) - box.height);
        if (ahead <= across && ahead <= above)
            cosine = fabs(c * direction[0] + s * direction[1]);
        else if (across <= above)
            cosine = fabs(c * direction[1] - s * direction[0]);
        else
            cosine = fabs(direction[2]);
    }
    return cosine;
}

inline int64_t cell_at(double offset, int64_t cells) {
    return int64_t(minimum(maximum(0.0, offset), double(cells) - 1.0));
}

// A grid of boxes over the x-y plane; it has a single cell if more cells would not be faster.
class BoxGrid {
  public:
    const Array<const RobotBox> boxes;

    BoxGrid(Array<const RobotBox> boxes, int64_t rays)
        : boxes(boxes), layout_(lay_out(boxes, rays)), heads_(layout_.cells() + 1), links_(count_links()) {
        list_boxes();
    }

    // Whether a box other than the carrier's may be within a radius around a point.
    bool is_near(int64_t carrier, const Vector& point, double radius) const {
        Cells around = cells_around(point[0], point[1], radius);
        for (int64_t row = around.low; row <= around.high; row++) {
            const int32_t* heads = &heads_[row * layout_.columns];
            for (int64_t k = heads[around.left]; k < heads[around.right + 1]; k++) {
                const RobotBox& box = boxes[links_[k]];
                double dx = point[0] - box.x, dy = point[1] - box.y, reach = radius + box.footprint_radius;
                if (dx * dx + dy * dy <= reach * reach && box.id != double(carrier)) return true;
            }
        }
        return false;
    }

    // Find the nearest surface of all boxes except the carrier's; at equal distances the last box counts. Returns the
    // distance, m, at most max_range, and sets the id of the box, -1 for none.
    double intersect(int64_t carrier, const Vector& origin, const Vector& direction, double max_range,
                     int64_t& id) const {
        double nearest = max_range;
        int64_t found = -1;
        id = -1;
        // Without a grid, a single step tests all boxes.
        int64_t cell = 0, column = 0, row = 0, end = layout_.cells();
        Border x_border, y_border;
        if (end > 1 && maximum(fabs(origin[0]), fabs(origin[1])) <= MAX_COORDINATE) {
            double x = (origin[0] - layout_.x) * layout_.per_metre, y = (origin[1] - layout_.y) * layout_.per_metre;
            double ex = direction[0] * layout_.per_metre, ey = direction[1] * layout_.per_metre;
            double enter = enter_grid(x, y, ex, ey);
            if (enter > max_range) return max_range;
            column = cell_at(x + enter * ex, layout_.columns), row = cell_at(y + enter * ey, layout_.rows);
            x_border = first_border(x, ex, column), y_border = first_border(y, ey, row);
            cell = row * layout_.columns + column, end = cell + 1;
        }
        while (true) {
            for (int64_t k = heads_[cell]; k < heads_[end]; k++) {
                int64_t i = links_[k];
                if (boxes[i].id == double(carrier)) continue;
                double t = intersect_box(boxes[i], origin, direction);
                if (t >= 0.0 && (t < nearest || (t == nearest && i > found))) nearest = t, found = i;
            }
            // Boxes that are only in later cells are farther away than the end of this cell.
            if (nearest <= minimum(x_border.next, y_border.next)) break;
            if (x_border.next < y_border.next)
                column += x_border.step, x_border.next += x_border.apart;
            else
                row += y_border.step, y_border.next += y_border.apart;
            if (column < 0 || column >= layout_.columns || row < 0 || row >= layout_.rows) break;
            cell = row * layout_.columns + column, end = cell + 1;
        }
        if (found >= 0) id = whole_of(boxes[found].id);
        return nearest;
    }

  private:
    struct Layout {
        double x, y, per_metre; // coordinates of the lower corner, m; cells per metre
        int64_t columns, rows;
        int64_t cells() const { return columns * rows; }
    };
    struct Cells {
        int64_t left, right, low, high;
    };
    struct Border { // distances at which a ray crosses cell borders along an axis, m
        double next = INFINITE, apart = INFINITE;
        int64_t step = 0;
    };

    static Layout lay_out(Array<const RobotBox> boxes, int64_t rays) {
        double right = -INFINITE, high = -INFINITE, squares = 0.0, size = INFINITE;
        double left = INFINITE, low = INFINITE;
        for (int64_t i = 0; i < boxes.size(); i++) {
            const RobotBox& box = boxes[i];
            // The margin is doubled, so a ray that misses the grid misses its boxes by at least SLACK.
            double radius = box.footprint_radius + 2.0 * SLACK;
            left = minimum(left, box.x - radius), right = maximum(right, box.x + radius);
            low = minimum(low, box.y - radius), high = maximum(high, box.y + radius);
            squares += radius * radius;
        }
        if (maximum(maximum(-left, right, -low), high) <= MAX_COORDINATE) {
            // The number of cells is about the number of boxes, and cells are not smaller than the mean box.
            double area = (right - left) * (high - low), longest = maximum(right - left, high - low);
            double count = double(boxes.size());
            size = maximum(sqrt(maximum(area, 4.0 * squares) / count), longest / count);
        }
        if (boxes.size() < MIN_BOXES || rays < MIN_RAYS || !(left <= right && low <= high && size < INFINITE)) {
            left = right = low = high = 0.0;
            size = INFINITE;
        }
        return {left, low, 1.0 / size, int64_t((right - left) / size) + 1, int64_t((high - low) / size) + 1};
    }

    Cells cells_around(double x, double y, double radius) const {
        x = (x - layout_.x) * layout_.per_metre, y = (y - layout_.y) * layout_.per_metre, radius *= layout_.per_metre;
        return {cell_at(x - radius, layout_.columns), cell_at(x + radius, layout_.columns),
                cell_at(y - radius, layout_.rows), cell_at(y + radius, layout_.rows)};
    }

    // Call a function with the list head of each cell that the circle of a box overlaps.
    template <typename Visit> void visit_cells(const RobotBox& box, Visit visit) {
        Cells around = cells_around(box.x, box.y, box.footprint_radius + SLACK);
        for (int64_t row = around.low; row <= around.high; row++)
            for (int64_t column = around.left; column <= around.right; column++)
                visit(heads_[row * layout_.columns + column]);
    }

    // Set the head of each cell to the end of its list; returns the total length of all lists.
    int64_t count_links() {
        for (const RobotBox& box : boxes) visit_cells(box, [](int32_t& head) { head++; });
        for (int64_t cell = 1; cell <= layout_.cells(); cell++) heads_[cell] += heads_[cell - 1];
        return heads_[layout_.cells()];
    }

    // Fill the lists from the end, so that each head becomes the beginning of its list.
    void list_boxes() {
        for (int64_t i = 0; i < boxes.size(); i++)
            visit_cells(boxes[i], [&](int32_t& head) { links_[--head] = int32_t(i); });
    }

    // Return the distance at which a ray enters the grid, m; inf if it misses the grid.
    double enter_grid(double x, double y, double ex, double ey) const {
        double half_x = 0.5 * double(layout_.columns), half_y = 0.5 * double(layout_.rows);
        if (fabs(x - half_x) <= half_x && fabs(y - half_y) <= half_y) return 0.0;
        Span ahead = intersect_slab(x - half_x, ex, half_x), across = intersect_slab(y - half_y, ey, half_y);
        double enter = maximum(ahead.near, across.near, 0.0);
        return enter <= minimum(ahead.far, across.far) ? enter : INFINITE;
    }

    static Border first_border(double start, double slope, int64_t cell) {
        if (fabs(slope) < MIN_SLOPE) return {};
        double inverse = 1.0 / slope;
        bool is_forward = slope > 0.0;
        return {(double(cell + is_forward) - start) * inverse, fabs(inverse), is_forward ? 1 : -1};
    }

    Layout layout_;
    Buffer<int32_t> heads_, links_; // beginning of each cell's list in links_, and the lists of all cells
};

} // namespace radarsim
