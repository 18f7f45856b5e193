// Horizontal slices of triangles, and a grid of square cells to find the walls near a position; see obstacles.py.
#pragma once
#include "robot.hpp"

namespace radarsim::robots {

struct WallEntry { // a wall that crosses a cell
    int64_t cell;  // number of the cell, ascending on each floor
    int64_t wall;  // number of the wall on its floor
};
ROW(WallEntry, cell, wall)

struct WallGrid { // the grid of a floor
    double left, bottom; // corner of the first cell, m
    double cell;         // size of a cell, m
    int64_t columns, rows;
    int64_t first, end; // range of the entries of this floor
    int64_t first_line; // index of the floor's first wall
};
ROW(WallGrid, left, bottom, cell, columns, rows, first, end, first_line)

struct Walls {
    Array<const LineSegment> lines;
    Array<const WallEntry> entries;
    Array<const WallGrid> floors;
    Array<int64_t> marks;    // number of the last search that found each wall
    Array<int64_t> searches; // number of searches
};
LAYOUT(Walls, "w e f w 1", lines, entries, floors, marks, searches)

using Ends = double[2][2]; // m, x and y of both ends, map frame

constexpr double CELL_TOLERANCE = 1e-6;  // cells; a wall that is closer to a cell counts as crossing it
constexpr double FARTHEST_CROSSED = 1e7; // cells; larger grids would not fit in memory

inline int64_t first_cell(double low) { return int64_t(floor(low - CELL_TOLERANCE)); }
inline int64_t last_cell(double high) { return int64_t(floor(high + CELL_TOLERANCE)); }

// Call a function with row and column of each cell that a segment crosses, or never if an end is too far away.
template <typename F> void visit_cells(const Ends& segment, const WallGrid& grid, F visit) {
    double x[2], y[2];
    for (int end = 0; end < 2; end++) {
        x[end] = (segment[end][0] - grid.left) / grid.cell;
        y[end] = (segment[end][1] - grid.bottom) / grid.cell;
        if (!(fabs(x[end]) < FARTHEST_CROSSED && fabs(y[end]) < FARTHEST_CROSSED)) return;
    }
    int low = y[1] >= y[0] ? 0 : 1;
    double run = x[1 - low] - x[low], rise = y[1 - low] - y[low];
    int64_t last_row = last_cell(y[low] + rise);
    for (int64_t row = first_cell(y[low]); row <= last_row; row++) {
        // The part of the segment within the row, as shares of its length.
        double begin = 0.0, end = 1.0;
        if (rise != 0.0) {
            begin = minimum(maximum((double(row) - CELL_TOLERANCE - y[low]) / rise, 0.0), 1.0);
            end = minimum(maximum((double(row + 1) + CELL_TOLERANCE - y[low]) / rise, 0.0), 1.0);
        }
        begin = x[low] + begin * run, end = x[low] + end * run;
        int64_t last = last_cell(maximum(begin, end));
        for (int64_t column = first_cell(minimum(begin, end)); column <= last; column++) visit(row, column);
    }
}

// Write an entry for each cell that a segment crosses, segment by segment, if there is room; returns their number. The
// grid is enlarged if necessary. Indices of cells are right only if the grid already has its final size, so a first
// call is needed to find the size.
inline int64_t enter_crossings(Array<const Ends> segments, Array<WallGrid> grid, Array<WallEntry> entries) {
    int64_t count = 0, &columns = grid[0].columns, &rows = grid[0].rows;
    for (int64_t wall = 0; wall < segments.size(); wall++)
        visit_cells(segments[wall], grid[0], [&](int64_t row, int64_t column) {
            columns = maximum(columns, column + 1), rows = maximum(rows, row + 1);
            if (count < entries.size()) entries[count] = {row * columns + column, wall};
            count++;
        });
    return count;
}
BIND(enter_crossings, "s 1 e")

struct CellRange {
    int64_t first, last;
};

// Return the range of cells within reach of a position along an axis with count cells.
inline CellRange cells_within(double place, double reach, double cell, int64_t count) {
    // Indices are limited before they are converted to integers, since the position may be far outside of the grid.
    double first = minimum(maximum(0.0, (place - reach) / cell), double(count));
    double last = minimum(maximum(-1.0, (place + reach) / cell), double(count) - 1.0);
    return {int64_t(floor(first)), int64_t(floor(last))};
}

inline bool is_near(const LineSegment& line, double x, double y, double reach) {
    double dx = x - line.middle_x, dy = y - line.middle_y;
    double share = (dx * line.half_x + dy * line.half_y) / (line.half_x * line.half_x + line.half_y * line.half_y);
    share = minimum(maximum(share, -1.0), 1.0);
    dx -= share * line.half_x;
    dy -= share * line.half_y;
    return dx * dx + dy * dy <= reach * reach;
}

// Write the walls of a floor within reach of a position, each once; returns their number. The array must have room for
// all walls.
inline int64_t find_walls(const Walls& walls, double floor, double x, double y, double reach,
                          Array<LineSegment> found) {
    if (!(floor >= 0.0 && floor < double(walls.floors.size())) || found.size() < walls.lines.size()) return 0;
    const WallGrid& grid = walls.floors[int64_t(floor)];
    if (grid.end > walls.entries.size()) return 0;
    CellRange columns = cells_within(x - grid.left, reach, grid.cell, grid.columns);
    CellRange rows = cells_within(y - grid.bottom, reach, grid.cell, grid.rows);
    // A wall may be in several cells. Each found wall is marked with the number of the search, so that marks need not
    // be reset.
    int64_t search = ++walls.searches[0], count = 0;
    for (int64_t row = rows.first; row <= rows.last; row++) {
        int64_t first = row * grid.columns + columns.first, last = row * grid.columns + columns.last;
        auto is_in_reach = [&](int64_t entry) { return walls.entries[entry].cell >= first; };
        int64_t entry = first_where(grid.first, grid.end, is_in_reach);
        for (; entry < grid.end && walls.entries[entry].cell <= last; entry++) {
            int64_t wall = grid.first_line + walls.entries[entry].wall;
            if (wall >= walls.lines.size() || walls.marks[wall] == search) continue;
            walls.marks[wall] = search;
            if (is_near(walls.lines[wall], x, y, reach)) found[count++] = walls.lines[wall];
        }
    }
    return count;
}
BIND(find_walls, "l")

using Corners = int32_t[3];

// Compute the points at which a horizontal plane cuts two sides of a triangle, and return whether it cuts the triangle.
// The cut sides meet at the corner that is alone on one side of the plane. A corner in the plane counts as above it.
inline bool cut_sides(Array<const Vector> vertices, const Corners& face, double height, Ends& cut) {
    bool above[3];
    for (int i = 0; i < 3; i++) above[i] = vertices[face[i]][2] >= height;
    if (above[0] == above[1] && above[1] == above[2]) return false;
    int alone = above[1] == above[2] ? 0 : above[0] == above[2] ? 1 : 2;
    const Vector& first = vertices[face[alone]];
    for (int end = 0; end < 2; end++) {
        const Vector& other = vertices[face[(alone + 1 + end) % 3]];
        double share = (height - first[2]) / (other[2] - first[2]);
        for (int axis = 0; axis < 2; axis++) cut[end][axis] = first[axis] + share * (other[axis] - first[axis]);
    }
    return true;
}

// Slice triangles; returns the number of segments, or -1 if a corner is not among the vertices.
inline int64_t slice_faces(Array<const Vector> vertices, Array<const Corners> faces, double height,
                           Array<Ends> segments) {
    int64_t count = 0;
    for (const Corners& face : faces) {
        for (int32_t corner : face)
            if (corner < 0 || corner >= vertices.size()) return -1;
        count += cut_sides(vertices, face, height, segments[count]);
    }
    return count;
}
BIND(slice_faces, "v f f")

// Write the indices of the boxes that overlap a given box; returns their number.
inline int64_t find_boxes(Array<const double, 2> lows, Array<const double, 2> highs, double left, double right,
                          double lower, double upper, double bottom, double top, Array<int64_t> found) {
    int64_t count = 0;
    for (int64_t box = 0; box < lows.shape[1]; box++)
        if (lows(2, box) <= top && bottom <= highs(2, box) && lows(0, box) <= right && left <= highs(0, box) &&
            lows(1, box) <= upper && lower <= highs(1, box))
            found[count++] = box;
    return count;
}
BIND(find_boxes, "3b 3b b")

// Enlarge a box so that it contains a point. The first three numbers of the box are its lower corner, the others are
// its upper corner.
inline void extend(double* box, const Vector& point) {
    for (int axis = 0; axis < 3; axis++) { // the corners of an empty box are nan
        if (!(box[axis] <= point[axis])) box[axis] = point[axis];
        if (!(box[axis + 3] >= point[axis])) box[axis + 3] = point[axis];
    }
}

// Clip triangles to a horizontal slab, and write the bounding boxes of the clipped triangles as degenerate triangles:
// lower corner, upper corner, lower corner.
inline void clip_to_slab(Array<const Triangle> triangles, double low, double high, Array<Triangle> outlines) {
    const double heights[2] = {low, high};
    for (int64_t i = 0; i < triangles.size(); i++) {
        double* box = outlines[i];
        for (int k = 0; k < 6; k++) box[k] = NOT_A_NUMBER;
        for (int corner = 0; corner < 3; corner++) {
            const Vector &begin = corner_of(triangles[i], corner), &end = corner_of(triangles[i], (corner + 1) % 3);
            if (begin[2] >= low && begin[2] <= high) extend(box, begin);
            for (double height : heights) { // add the points at which the side crosses a face of the slab
                double before = begin[2] - height, after = end[2] - height, share = before / (before - after);
                if (before * after < 0.0) extend(box, begin + share * (end - begin));
            }
        }
        memcpy(box + 6, box, 3 * sizeof(double));
    }
}
BIND(clip_to_slab, "t t")

} // namespace radarsim::robots
