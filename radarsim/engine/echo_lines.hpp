// Sorts the echoes of a scan into lines.
#pragma once
#include "door.hpp"

namespace radarsim {

struct WrittenEcho {
    double beam, range, power, strength; // m; shares from 0 to 1
};
LAYOUT(WrittenEcho, "", beam, range, power, strength)

struct EchoRows {
    int64_t part, start, end; // of a line: the echoes of a part from a row to that before the end
    int64_t before;           // of a row: where the echo was before
};
LAYOUT(EchoRows, "", part, start, end, before)

struct PartEchoes { // the echoes of a part
    int64_t part, beam;   // the beam of the first
    int64_t count, start; // how many, and the row of the first
    int64_t place;        // of the next one that comes
};

// Group echoes by part, in the order of the first of each.
inline void group_echoes(Array<const int64_t> parts, Array<const int64_t> beams, List<PartEchoes>& groups,
                         Room<int64_t>& group_of) {
    // A power of two, so that a mask replaces the division; at most half full, so that probes stay short.
    int64_t size = 16;
    while (size < 2 * parts.size()) size *= 2;
    Room<int64_t> table(size); // groups by the hash of their part, from 1
    for (int64_t row = 0; row < parts.size(); row++) {
        uint64_t slot = (uint64_t(parts[row]) * 2654435761 >> 8) & (size - 1); // the upper bits are spread
        while (table[slot] && groups[table[slot] - 1].part != parts[row]) slot = (slot + 1) & (size - 1);
        if (!table[slot]) {
            groups.append({parts[row], beams[row], 0, 0, 0});
            table[slot] = groups.size();
        }
        group_of[row] = table[slot] - 1;
        groups[group_of[row]].count++;
    }
}

// Write the lines of groups by their first beam, and for the same beam by their part; returns how many.
inline int64_t share_lines(List<PartEchoes>& groups, int64_t echoes_a_line, Array<EchoRows> rows) {
    Room<int64_t> ranks(groups.size());
    for (int64_t group = 0; group < groups.size(); group++) { // by beam they are sorted already
        const auto& [part, beam, count, start, place] = groups[group];
        int64_t at = group;
        for (; at && groups[ranks[at - 1]].beam == beam && groups[ranks[at - 1]].part > part; at--)
            ranks[at] = ranks[at - 1];
        ranks[at] = group;
    }
    int64_t line = 0, start = 0;
    for (int64_t rank = 0; rank < groups.size(); rank++) {
        PartEchoes& group = groups[ranks[rank]];
        group.start = group.place = start;
        for (int64_t end = start + group.count; start < end; start = rows[line++].end)
            rows[line] = {group.part, start, end - start > echoes_a_line ? start + echoes_a_line : end, 0};
    }
    return line;
}

// A share without rounding errors, and zero without a sign.
inline double clip_to_unit(double share) { return share <= 0.0 ? 0.0 : least(share, 1.0); }

inline double power_share(double power, double full_power) {
    if (isinf(full_power)) return 1.0;
    return full_power > 0.0 ? clip_to_unit(power / full_power) : 0.0;
}

// Sort echoes into lines of one part each, as many as fit into a line: the echoes of a part by beam and range. They
// come sorted by beam. Returns the number of lines.
inline int64_t sort_echoes(Array<const int64_t> parts, Array<const int64_t> beams, Array<const double> ranges,
                           Array<const double> power, Array<const double> strength, double full_power,
                           int64_t echoes_a_line, Array<WrittenEcho> echoes, Array<EchoRows> rows) {
    if (echoes_a_line < 1) return 0;
    List<PartEchoes> groups(parts.size());
    Room<int64_t> group_of(parts.size());
    group_echoes(parts, beams, groups, group_of);
    int64_t count = share_lines(groups, echoes_a_line, rows);
    for (int64_t row = 0; row < parts.size(); row++) {
        PartEchoes& group = groups[group_of[row]];
        int64_t place = group.place++;
        double beam = double(beams[row]);
        // Insertion, as a beam has few echoes of one part.
        for (; place > group.start && echoes[place - 1].beam == beam && echoes[place - 1].range > ranges[row]; place--) {
            echoes[place] = echoes[place - 1];
            rows[place].before = rows[place - 1].before;
        }
        rows[place].before = row;
        echoes[place] = {beam, ranges[row], power_share(power[row], full_power), clip_to_unit(strength[row])};
    }
    return count;
}
DOOR(sort_echoes, "n n n n n n n")

} // namespace radarsim
