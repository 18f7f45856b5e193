// The walls near a place, from a grid of square cells; see wall_grid.py.
#pragma once
#include "footprint.hpp"

namespace radarsim::robots {

struct WallEntry { // a wall that crosses a cell
    int64_t cell;  // number of the cell, ascending on each floor
    int64_t wall;
};
LAYOUT(WallEntry, "", cell, wall)

struct WallGrid { // of a floor
    double left, bottom; // corner of the first cell, m
    double cell;         // size of a cell, m
    int64_t columns, rows;
    int64_t first, end; // its entries
};
LAYOUT(WallGrid, "", left, bottom, cell, columns, rows, first, end)

struct Walls {
    Array<const LineSegment> lines;
    Array<const WallEntry> entries;
    Array<const WallGrid> floors;
    Array<int64_t> marks;    // number of the search that found a wall last
    Array<int64_t> searches; // their number
};
LAYOUT(Walls, "w e f w 1", lines, entries, floors, marks, searches)

struct CellRange {
    int64_t first, last;
};

// The cells within reach on an axis, of a number of cells.
inline CellRange cells_within(double place, double reach, double cell, int64_t count) {
    // Limited before they become whole numbers: the place may be far off the grid.
    double first = least(most((place - reach) / cell, 0.0), double(count));
    double last = least(most((place + reach) / cell, -1.0), double(count) - 1.0);
    return {int64_t(floor(first)), int64_t(floor(last))};
}

// The first entry of a floor whose cell is not before one.
inline int64_t first_entry(Array<const WallEntry> entries, const WallGrid& grid, int64_t cell) {
    int64_t first = grid.first, end = grid.end;
    while (first < end) {
        int64_t middle = (first + end) / 2;
        if (entries[middle].cell < cell) first = middle + 1;
        else end = middle;
    }
    return first;
}

inline bool is_near(const LineSegment& line, double x, double y, double reach) {
    double dx = x - line.middle_x, dy = y - line.middle_y;
    double share = (dx * line.half_x + dy * line.half_y) / (line.half_x * line.half_x + line.half_y * line.half_y);
    share = least(most(share, -1.0), 1.0);
    dx -= share * line.half_x;
    dy -= share * line.half_y;
    return dx * dx + dy * dy <= reach * reach;
}

// Write the walls of a floor within reach of a place, each once; returns their number. There is room for all walls.
inline int64_t find_walls(const Walls& walls, double floor, double x, double y, double reach,
                          Array<LineSegment> found) {
    if (!(floor >= 0.0 && floor < double(walls.floors.size())) || found.size() < walls.lines.size()) return 0;
    const WallGrid& grid = walls.floors[int64_t(floor)];
    CellRange columns = cells_within(x - grid.left, reach, grid.cell, grid.columns);
    CellRange rows = cells_within(y - grid.bottom, reach, grid.cell, grid.rows);
    // A wall is in several cells. Marks with the number of the search need not be reset.
    int64_t search = ++walls.searches[0], count = 0;
    for (int64_t row = rows.first; row <= rows.last; row++) {
        int64_t last = row * grid.columns + columns.last;
        int64_t entry = first_entry(walls.entries, grid, row * grid.columns + columns.first);
        for (; entry < grid.end && walls.entries[entry].cell <= last; entry++) {
            int64_t wall = walls.entries[entry].wall;
            if (walls.marks[wall] == search) continue;
            walls.marks[wall] = search;
            if (is_near(walls.lines[wall], x, y, reach)) found[count++] = walls.lines[wall];
        }
    }
    return count;
}
DOOR(find_walls, "l")

// The gap of a rectangle, within a circle of a radius, to the walls of the only floor; infinite if none is near.
inline double find_gap(const Walls& walls, double x, double y, double yaw, double half_length, double half_width,
                       double radius, Array<LineSegment> lines) {
    int64_t count = find_walls(walls, 0.0, x, y, radius, lines);
    return find_contact({lines.data, {count}}, {x, y, yaw}, half_length, half_width).gap;
}
DOOR(find_gap, "l")

} // namespace radarsim::robots
