// Writes numbers into templates of lines; line_template.py describes their marks.
//
// Numbers below 2^31 with up to six decimals are below 2^52 when they are scaled to whole numbers, so that their
// halves are exact: the digits are those of NumberFormat.
#pragma once
#include "door.hpp"

namespace radarsim {

constexpr uint8_t FIRST_MARK = 0xC0, IN_SERIES = 0x20, LINE_END = 0xDA, TRUTH = 0xDB, FLIPPED = 0xDC, WRAPPED = 0xDD,
                  POSITIVE = 0xDE, BLOCK_END = 0xF9;
enum Rounding { NEAREST, FLOAT32, TRUNCATED, WHOLE };
enum WrittenLines { WRITTEN, TOO_LARGE, MISFIT };

constexpr double LARGEST_WRITTEN = 2147483648.0;
constexpr int64_t LONGEST_NUMBER = 19; // sign, ten digits, point, seven decimals; a truth value is less
constexpr uint64_t POWERS[] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000, 10000000000,
                               100000000000, 1000000000000, 10000000000000, 100000000000000, 1000000000000000,
                               10000000000000000, 100000000000000000};

// A number as the marks before its own change it; bits of their places from FLIPPED on are set.
inline double change_number(double value, int changes) {
    if (changes & 1) value = 0.0 - value;
    if (changes & 2) {
        value = remainder(value, 2 * M_PI); // as geometry.wrap_angle does
        if (value <= -M_PI) value = M_PI;
    }
    if (changes & 4) value += value < 0.0 ? 2 * M_PI : 0.0; // -0.0 becomes 0.0
    return value;
}

// A product as a whole number, rounded once; exact halves become even.
inline uint64_t scale_number(double size, double scale) {
    double product = size * scale, whole = rint(product);
    if (fabs(product - whole) == 0.5) {
        // The product may have been rounded to the half. Its error is exact: the upper half of the digits times a
        // scale of 20 bits is, and so is the lower half.
        double split = size * 134217729.0, upper = split - (split - size); // 2^27 + 1
        double error = (upper * scale - product) + (size - upper) * scale;
        if (error != 0.0) whole = error > 0.0 ? product + 0.5 : product - 0.5;
    }
    return uint64_t(whole);
}

// Write a scaled number with its point at a place; returns the place behind.
inline uint8_t* write_digits(uint64_t scaled, int decimals, uint8_t* at) {
    int digits = decimals + 1;
    while (scaled >= POWERS[digits]) digits++;
    // From the last to the first, since a division yields the last.
    uint8_t* end = at + digits + (decimals > 0);
    for (uint8_t* place = end; place > at; scaled /= 10) {
        *--place = uint8_t('0' + scaled % 10);
        if (end - place == decimals) *--place = '.';
    }
    return end;
}

inline uint8_t* write_number(double value, uint8_t mark, uint8_t* at) {
    int decimals = mark & 7;
    uint64_t scale = POWERS[decimals], scaled;
    float single = float(value), size = fabsf(single), whole = truncf(size);
    bool is_negative = value < 0.0;
    switch (mark >> 3 & 3) {
    case TRUNCATED:
        // Never as much as the scale: the largest fraction of single precision times a power of ten is nearer to
        // the number below that power.
        scaled = uint64_t(whole) * scale + uint64_t((size - whole) * float(scale));
        is_negative = single < 0.0f;
        break;
    case FLOAT32:
        scaled = scale_number(size, double(scale));
        is_negative = signbit(single);
        break;
    case NEAREST:
        scaled = scale_number(fabs(value), double(scale));
        is_negative = is_negative && scaled;
        break;
    default:
        scaled = uint64_t(fabs(value));
        is_negative = is_negative && scaled;
    }
    if (is_negative) *at++ = '-';
    return write_digits(scaled, decimals, at);
}

inline uint8_t* write_truth(bool value, uint8_t* at) {
    for (const char* text = value ? "True" : "False"; *text; text++) *at++ = uint8_t(*text);
    return at;
}

// Write blocks of lines after each other, and the end of each block. Numbers, and those of series, are in the order
// of their marks. One pass over the templates of all robots, as a tick can have hundreds of lines.
inline int64_t write_lines(Array<const uint8_t> templates, Array<const double> numbers, Array<const double> series,
                           Array<uint8_t> out, Array<int64_t> ends) {
    if (out.size() < 2 * templates.size() + LONGEST_NUMBER * (numbers.size() + series.size())) return MISFIT;
    const double *number = numbers.begin(), *entry = series.begin();
    uint8_t* at = out.begin();
    int64_t block = 0;
    int changes = 0;
    for (uint8_t code : templates) {
        if (code < FIRST_MARK) *at++ = code;
        else if (FLIPPED <= code && code <= POSITIVE) changes |= 1 << (code - FLIPPED);
        else if (code == LINE_END) *at++ = '\r', *at++ = '\n';
        else if (code == BLOCK_END) {
            if (block == ends.size()) return MISFIT;
            ends[block++] = at - out.data;
        } else {
            bool in_series = code & IN_SERIES;
            const double*& next = in_series ? entry : number;
            if (next == (in_series ? series : numbers).end()) return MISFIT;
            double value = *next++;
            if (!(fabs(value) < LARGEST_WRITTEN)) return TOO_LARGE; // NaN too
            at = code == TRUTH ? write_truth(value != 0.0, at) : write_number(change_number(value, changes), code, at);
            changes = 0;
        }
    }
    return number == numbers.end() && entry == series.end() && block == ends.size() ? WRITTEN : MISFIT;
}
DOOR(write_lines, "t n s o b")

} // namespace radarsim
