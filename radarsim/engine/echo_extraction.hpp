// Turn the events along rays into the echoes of beams; see echo_extraction.py for the theory.
#pragma once
#include "echo_strength.hpp"

namespace radarsim {

constexpr double LEAF_BACKSCATTER = 2.0 / 3.0; // as in echo_extraction.py
constexpr double EQUAL_STRENGTHS = 1e-12;      // relative difference below which they are

struct Echo {
    int64_t beam;
    int64_t row;     // the ray, counted over all beams
    double t;        // m from the start of the ray; of a volume, that up to which half of its power came back
    double front;    // m, where the echo begins: of a volume, where the ray enters it
    int64_t part;    // as in Traces
    double power;    // left on arrival, for a hit without what the surface absorbs
    double strength; // share of what a rough wall ahead returns of the whole beam
    uint8_t kind;    // an EventKind
    bool ends;       // whether a ray ends there
};
LAYOUT(Echo, "", beam, row, t, front, part, power, strength, kind, ends)

struct Placed { // an event among those of a beam, to be sorted by range
    double range;
    int64_t event;
};

// Merge two sorted runs; of equal ranges those of the first run come first.
inline void merge_runs(Placed* run, int64_t middle, int64_t end, Placed* spare) {
    memcpy(spare, run, middle * sizeof(Placed));
    int64_t first = 0, second = middle;
    for (int64_t k = 0; first < middle; k++)
        run[k] = second < end && run[second].range < spare[first].range ? run[second++] : spare[first++];
}

// Sort by range; those of equal range keep their order. Most lists are short, and those of each ray are almost
// sorted: insertion is the fastest. Longer lists are merged from runs that were sorted so.
inline void sort_by_range(Placed* echoes, int64_t count, Placed* spare) {
    constexpr int64_t SHORT = 16;
    for (int64_t k = 1; k < count; k++) {
        Placed echo = echoes[k];
        int64_t i = k, start = k - k % SHORT;
        for (; i > start && echoes[i - 1].range > echo.range; i--) echoes[i] = echoes[i - 1];
        echoes[i] = echo;
    }
    for (int64_t width = SHORT; width < count; width *= 2)
        for (int64_t start = 0; start + width < count; start += 2 * width) {
            int64_t left = count - start;
            merge_runs(echoes + start, width, left < 2 * width ? left : 2 * width, spare);
        }
}

// Fill the echoes of all events, beam by beam, sorted by range; return how many there are, or -1 if an event is of
// another ray or part. Incidence is empty, or the cosine of each ray's angle.
inline int64_t extract_echoes(Array<const Event> events, Array<const double> weights, Array<const double> incidence,
                              int64_t rays_per_beam, Array<const double> parts, double air,
                              Array<const double> scattering, double full, double nepers, bool spreads,
                              Array<Echo> echoes) {
    int64_t n = events.size(), total = 0;
    bool has_incidence = incidence.size() > 0;
    if (rays_per_beam < 1 || (has_incidence && incidence.size() != weights.size())) return -1;
    for (const Event& event : events)
        if (!is_known(event, weights.size(), parts.size())) return -1;
    Densities densities = {parts, air, scattering};
    ReturnLaw law = {full, nepers, spreads};
    Room<Return> returns(n);
    List<Volume> volumes(n);
    compute_strengths(events, densities, law, volumes, returns);
    find_ranges(events, densities, law, volumes, returns);
    List<Placed> placed(n);
    Room<Placed> spare(n);
    for (int64_t i = 0; i < n;) {
        int64_t beam = events[i].ray / rays_per_beam;
        placed.clear();
        for (; i < n && events[i].ray / rays_per_beam == beam; i++) {
            bool returns_echo = events[i].kind >= Kind::ENTER && events[i].kind <= Kind::SPENT;
            if (returns_echo && weights[events[i].ray] > 0.0) placed.append({returns[i].range, i});
        }
        sort_by_range(placed.begin(), placed.size(), spare.data());
        for (auto [range, row] : placed) {
            const auto& [ray, t, part, kind, power, absorbed, x, y, z] = events[row];
            bool hit = kind == Kind::HIT;
            double strength = returns[row].strength;
            if (has_incidence) strength *= hit ? incidence[ray] : LEAF_BACKSCATTER;
            // Rounding can add up to a little more than the whole power.
            strength = least(weights[ray] * strength, 1.0);
            echoes[total++] = {beam, ray, range, t, part, power - (hit ? absorbed : 0.0), strength, uint8_t(kind),
                               hit || kind == Kind::SPENT};
        }
    }
    return total;
}
DOOR(extract_echoes, "e r i p p e")

// Whether one echo rather than another gives a merged echo its kind.
inline bool represents(const Echo& one, const Echo& other) {
    if (one.ends != other.ends) return one.ends;
    return one.strength > other.strength * (1.0 + EQUAL_STRENGTHS);
}

// The first echo of a beam from i on that has strength or is an end; the number of all if there is none.
inline int64_t first_with_power(Array<const Echo> echoes, int64_t i) {
    for (int64_t beam = echoes[i].beam; i < echoes.size() && echoes[i].beam == beam; i++)
        if (echoes[i].strength > 0.0 || echoes[i].ends) return i;
    return echoes.size();
}

// Merge the echoes of each beam that are closer together than a resolution; return how many are left.
inline int64_t merge_echoes(Array<const Echo> echoes, double resolution, Array<Echo> merged) {
    int64_t left = 0, n = echoes.size();
    for (int64_t i = 0, j; i < n; i = j) {
        int64_t first = first_with_power(echoes, i), best = i;
        double end = echoes[i].t; // nothing to merge with
        if (first < n && echoes[first].t - echoes[i].t < resolution) end = echoes[first].t + resolution;
        else first = i;
        double nearest = echoes[first].t, total = 0.0, mean = 0.0;
        for (j = i; j == i || (j < n && echoes[j].beam == echoes[i].beam && echoes[j].t < end); j++) {
            total += echoes[j].strength;
            mean += echoes[j].strength * (echoes[j].t - nearest);
            if (represents(echoes[j], echoes[best])) best = j;
        }
        Echo& echo = merged[left++] = echoes[best];
        echo.t = total > 0.0 ? nearest + mean / total : nearest;
        if (Kind(echo.kind) != Kind::ENTER) echo.front = echo.t;
        echo.strength = least(total, 1.0);
    }
    return left;
}
DOOR(merge_echoes, "e e")

enum Mode { LAST, FIRST, STRONGEST };

// Select the echo that gives each beam its range, and set its range and ray; see echo_extraction.py. Return how many
// beams read one; their rows come first in selected.
inline int64_t select_echoes(Array<const Echo> echoes, int64_t mode, double threshold, bool reads_spent,
                             Array<int64_t> selected, Array<double> ranges, Array<int64_t> rays) {
    auto is_above = [&](const Echo& echo) { return mode != LAST && echo.strength > threshold; };
    for (int64_t& row : selected) row = -1;
    for (int64_t i = 0; i < echoes.size(); i++) {
        const Echo& echo = echoes[i];
        if (echo.beam < 0 || echo.beam >= selected.size()) continue;
        int64_t& row = selected[echo.beam];
        bool has_above = row >= 0 && is_above(echoes[row]);
        bool is_better = !has_above || (mode == STRONGEST && echo.strength > echoes[row].strength);
        if (is_above(echo) ? is_better : echo.ends && !has_above) row = i;
    }
    int64_t count = 0;
    for (int64_t row : selected)
        if (row >= 0 && (reads_spent || Kind(echoes[row].kind) != Kind::SPENT)) {
            const Echo& echo = echoes[selected[count++] = row];
            ranges[echo.beam] = echo.t;
            rays[echo.beam] = echo.row;
        }
    return count;
}
DOOR(select_echoes, "e b b b")

} // namespace radarsim
