// Sorts the echoes of a scan into lines of the protocol, and writes numbers into templates of lines; line_template.py
// describes the marks in the templates.
//
// Numbers below 2^31 with up to six decimals are below 2^52 when they are scaled to integers, so halves are exact and
// the digits are the same as those of NumberFormat.
#pragma once
#include "bindings.hpp"

namespace radarsim {

constexpr uint8_t FIRST_MARK = 0xC0, IN_SERIES = 0x20, LINE_END = 0xDA, TRUTH = 0xDB, FLIPPED = 0xDC, WRAPPED = 0xDD,
                  POSITIVE = 0xDE, BLOCK_END = 0xF9;
enum Rounding { NEAREST, FLOAT32, TRUNCATED, WHOLE };
constexpr int64_t MISFIT = -2, TOO_LARGE = -1; // error codes, returned instead of a number of bytes

constexpr double LARGEST_WRITTEN = 2147483648.0;
constexpr int64_t LONGEST_NUMBER = 19; // sign, ten digits, point, seven decimals; "False" is shorter
constexpr int64_t POWERS[] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000, 10000000000,
                              100000000000, 1000000000000, 10000000000000, 100000000000000, 1000000000000000,
                              10000000000000000, 100000000000000000};

// Apply the changes that the marks before a number specify: bit 0 is FLIPPED, bit 1 is WRAPPED, bit 2 is POSITIVE.
inline double change_number(double value, int changes) {
    if (changes & 1) value = 0.0 - value;
    if (changes & 2) value = wrap_angle(value);
    if (changes & 4) value += value < 0.0 ? 2 * M_PI : 0.0; // -0.0 becomes 0.0
    return value;
}

// Multiply and round to an integer, with a single rounding; exact halves are rounded to even.
inline int64_t scale_number(double size, double scale) {
    double product = size * scale, whole = rint(product);
    if (fabs(product - whole) == 0.5) {
        // The product itself may have been rounded to an exact half. Its rounding error can be computed exactly, since
        // the products of a scale of 20 bits with the upper and with the lower half of the digits are exact.
        double split = size * 134217729.0, upper = split - (split - size); // 2^27 + 1
        double error = (upper * scale - product) + (size - upper) * scale;
        if (error != 0.0) whole = error > 0.0 ? product + 0.5 : product - 0.5;
    }
    return int64_t(whole);
}

// The two digits of each number below 100.
struct Pairs {
    uint8_t digits[100][2];
    constexpr Pairs() : digits() {
        for (int i = 0; i < 100; i++) digits[i][0] = uint8_t('0' + i / 10), digits[i][1] = uint8_t('0' + i % 10);
    }
};
constexpr Pairs PAIRS;

// Write the last digits of a number so that they stop before end; returns the number without these digits.
inline uint64_t write_last_digits(uint64_t number, int count, uint8_t* end) {
    for (; count > 1; count -= 2, number /= 100) memcpy(end -= 2, PAIRS.digits[number % 100], 2);
    if (!count) return number;
    end[-1] = uint8_t('0' + number % 10);
    return number / 10;
}

// Write a scaled number with its decimal point; returns the position after it.
inline uint8_t* write_digits(int64_t scaled, int decimals, uint8_t* at) {
    int whole = 1; // digits before the point
    while (scaled >= POWERS[whole + decimals]) whole++;
    uint8_t *point = at + whole, *end = point + (decimals ? 1 + decimals : 0);
    uint64_t rest = write_last_digits(uint64_t(scaled), decimals, end); // from the last digit to the first
    if (decimals) *point = '.';
    write_last_digits(rest, whole, point);
    return end;
}

inline uint8_t* write_number(double value, uint8_t mark, uint8_t* at) {
    int rounding = mark >> 3 & 3, decimals = mark & 7;
    int64_t scale = POWERS[decimals], scaled; // signed, since unsigned integers are slow to convert
    float single = float(value), size = fabsf(single), whole = truncf(size);
    bool is_negative;
    if (rounding == TRUNCATED) {
        // The fraction never rounds up to the scale: the largest fraction in single precision times a power of ten is
        // closer to the next lower number.
        scaled = int64_t(whole) * scale + int64_t((size - whole) * float(scale));
        is_negative = single < 0.0f;
    } else if (rounding == FLOAT32) {
        scaled = scale_number(size, double(scale));
        is_negative = signbit(single);
    } else {
        scaled = rounding == NEAREST ? scale_number(fabs(value), double(scale)) : int64_t(fabs(value));
        is_negative = value < 0.0 && scaled;
    }
    if (is_negative) *at++ = '-';
    return write_digits(scaled, decimals, at);
}

inline uint8_t* write_truth(bool value, uint8_t* at) {
    for (const char* text = value ? "True" : "False"; *text; text++) *at++ = uint8_t(*text);
    return at;
}

// Write lines from templates; returns the number of bytes, or the error code MISFIT or TOO_LARGE. Numbers and entries
// of series are in the order of the marks for them. A single call writes the lines of all robots, since a tick can have
// hundreds of lines.
inline int64_t write_lines(Array<const uint8_t> templates, Array<const double> numbers, Array<const double> series,
                           Array<uint8_t> out) {
    if (out.size() < 2 * templates.size() + LONGEST_NUMBER * (numbers.size() + series.size())) return MISFIT;
    const double *number = numbers.begin(), *entry = series.begin();
    uint8_t* at = out.begin();
    int changes = 0;
    for (uint8_t code : templates) {
        if (code < FIRST_MARK || code == BLOCK_END) *at++ = code;
        else if (FLIPPED <= code && code <= POSITIVE) changes |= 1 << (code - FLIPPED);
        else if (code == LINE_END) *at++ = '\r', *at++ = '\n';
        else {
            bool in_series = code & IN_SERIES;
            if (in_series ? entry == series.end() : number == numbers.end()) return MISFIT;
            double value = in_series ? *entry++ : *number++;
            if (!(fabs(value) < LARGEST_WRITTEN)) return TOO_LARGE; // also for NaN
            if (changes) value = change_number(value, changes);
            changes = 0;
            at = code == TRUTH ? write_truth(value != 0.0, at) : write_number(value, code, at);
        }
    }
    return number == numbers.end() && entry == series.end() ? at - out.begin() : MISFIT;
}
BIND(write_lines, "t n s o")

struct WrittenEcho {
    double beam, range, power, strength; // range in m; power and strength are shares from 0 to 1
};
ROW(WrittenEcho, beam, range, power, strength)

struct EchoRows {
    int64_t part, start, end; // per line: the part, and the rows of its echoes from start to before end
    int64_t before;           // per row: the row of the echo before sorting
};
ROW(EchoRows, part, start, end, before)

struct PartEchoes { // the echoes that belong to a part of the scene
    int64_t part, beam;   // the part, and the beam of the first echo
    int64_t count, start; // number of echoes, and row of the first echo
    int64_t place;        // row for the next echo
};

// Group echoes by part, in the order of the first echo of each part.
inline void group_echoes(Array<const int64_t> parts, Array<const int64_t> beams, List<PartEchoes>& groups,
                         Buffer<int64_t>& group_of) {
    // The size is a power of two, so a mask replaces the division. The table is at most half full, so probes are short.
    int64_t size = 16;
    while (size < 2 * parts.size()) size *= 2;
    Buffer<int64_t> table(size); // number of the group, from 1, by the hash of its part
    for (int64_t row = 0; row < parts.size(); row++) {
        uint64_t slot = (uint64_t(parts[row]) * 2654435761 >> 8) & (size - 1); // upper bits are better distributed
        while (table[slot] && groups[table[slot] - 1].part != parts[row]) slot = (slot + 1) & (size - 1);
        if (!table[slot]) {
            groups.append({parts[row], beams[row], 0, 0, 0});
            table[slot] = groups.size();
        }
        group_of[row] = table[slot] - 1;
        groups[group_of[row]].count++;
    }
}

// Write the lines of all groups, sorted by the first beam, then by part; returns the number of lines.
inline int64_t share_lines(List<PartEchoes>& groups, int64_t echoes_a_line, Array<EchoRows> rows) {
    Buffer<int64_t> ranks(groups.size());
    for (int64_t group = 0; group < groups.size(); group++) { // groups are already sorted by beam
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

// Clip a share to the range from 0 to 1; -0.0 becomes 0.0.
inline double clip_to_unit(double share) { return share <= 0.0 ? 0.0 : minimum(share, 1.0); }

inline double power_share(double power, double full_power) {
    if (isinf(full_power)) return 1.0;
    return full_power > 0.0 ? clip_to_unit(power / full_power) : 0.0;
}

// Sort echoes into lines; each line has echoes of a single part, sorted by beam and range, up to a maximum number. The
// input is sorted by beam. Returns the number of lines.
inline int64_t sort_echoes(Array<const int64_t> parts, Array<const int64_t> beams, Array<const double> ranges,
                           Array<const double> power, Array<const double> strength, double full_power,
                           int64_t echoes_a_line, Array<WrittenEcho> echoes, Array<EchoRows> rows) {
    if (echoes_a_line < 1) return 0;
    List<PartEchoes> groups(parts.size());
    Buffer<int64_t> group_of(parts.size());
    group_echoes(parts, beams, groups, group_of);
    int64_t count = share_lines(groups, echoes_a_line, rows);
    for (int64_t row = 0; row < parts.size(); row++) {
        PartEchoes& group = groups[group_of[row]];
        int64_t place = group.place++;
        double beam = double(beams[row]);
        // Insertion sort, since a beam has few echoes of the same part.
        auto follows = [&](const WrittenEcho& echo) { return echo.beam == beam && echo.range > ranges[row]; };
        for (; place > group.start && follows(echoes[place - 1]); place--) {
            echoes[place] = echoes[place - 1];
            rows[place].before = rows[place - 1].before;
        }
        rows[place].before = row;
        echoes[place] = {beam, ranges[row], power_share(power[row], full_power), clip_to_unit(strength[row])};
    }
    return count;
}
BIND(sort_echoes, "n n n n n n n")

} // namespace radarsim
