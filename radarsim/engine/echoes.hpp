// Computes echoes from the events along rays, and echoes of rain; see echo_extraction.py and rain_and_clouds.py.
#pragma once
#include "attenuation.hpp"

namespace radarsim {

constexpr double NOTHING_LEFT = 1e-12; // share of a ray's power; as in echo_extraction.py

struct Densities {
    Array<const double> parts; // power lost per metre in each part
    double air;
    Array<const double> scattering; // backscatter of each part relative to foliage
};

struct ReturnLaw {
    double full, nepers;
    bool spreads; // whether the range of a volume's echo is the range at which half of its power has returned

    // Return the share of the power that returns from a ray with this share of its power left.
    double returned(double share) const { return share <= NOTHING_LEFT ? 0.0 : exp(nepers * (share - 1.0)); }
    double share_left(const Event& event, double power) const {
        if (event.kind == Kind::SPENT) return 0.0;
        return full > 0.0 ? power / full : 1.0;
    }
    double share_before(const Event& event) const { return share_left(event, event.power); }
    double share_behind(const Event& event) const { return share_left(event, event.power - event.absorbed); }
};

// The echo of an event.
struct Return {
    double strength; // strength of the echo if the ray were the whole beam
    double range;    // m, range of the echo
    double loss;     // decrease of the returned power over the interval before the event
    double missing;  // power that has to return until half of the strength is reached
};

// A volume that encloses a point of a ray.
struct Volume {
    int32_t part;
    int64_t entry; // the event at which the ray entered it; -1 if it started inside
};

// Whether the ray of an event is valid and, unless the ray ends at the event, the part of the event is valid too.
inline bool is_known(const Event& event, int64_t rays, int64_t parts) {
    if (event.ray < 0 || event.ray >= rays) return false;
    return event.kind > Kind::SHEET || (event.part >= 0 && event.part < parts);
}

inline double total_density(const Densities& densities, const List<Volume>& volumes) {
    double total = densities.air;
    for (const Volume& volume : volumes) total += densities.parts[volume.part];
    return total;
}

inline void update_volumes(List<Volume>& volumes, const Event& event, int64_t i) {
    if (event.kind == Kind::ENTER) volumes.append({event.part, i});
    if (event.kind == Kind::START_INSIDE) volumes.append({event.part, -1});
    if (event.kind != Kind::LEAVE) return;
    for (Volume& volume : volumes)
        if (volume.part == event.part) {
            volume = volumes.end()[-1]; // the order of volumes does not matter
            volumes.shorten(volumes.size() - 1);
            return;
        }
}

// Distribute the loss in an interval to the volumes that enclose the interval, in proportion to their densities: call a
// function with the entry event and the share of each volume. The echo of a volume belongs to its entry event. A volume
// around the start of the ray has no entry, so its share, like the share of the air, gives no echo.
template <typename F>
void share_loss(double loss, const Densities& densities, const List<Volume>& volumes, F add) {
    double total = loss > 0.0 ? total_density(densities, volumes) : 0.0;
    if (total <= 0.0) return;
    for (const auto& [part, entry] : volumes)
        if (entry >= 0) add(entry, densities.parts[part] / total * densities.scattering[part]);
}

// Compute the strengths and losses of all events.
inline void compute_strengths(Array<const Event> events, const Densities& densities, const ReturnLaw& law,
                              List<Volume>& volumes, Buffer<Return>& returns) {
    int64_t ray = -1;
    const double whole = law.returned(1.0);
    double left = whole;
    for (int64_t i = 0; i < events.size(); i++) {
        const Event& event = events[i];
        if (event.ray != ray) {
            ray = event.ray, left = whole;
            volumes.clear();
        }
        double share = law.share_before(event), behind = law.share_behind(event), arriving = law.returned(share);
        double loss = returns[i].loss = left - arriving;
        share_loss(loss, densities, volumes,
                   [&](int64_t entry, double part) { returns[entry].strength += loss * part; });
        // Only sheets and surfaces absorb power at a point.
        left = behind == share ? arriving : law.returned(behind);
        if (event.kind == Kind::HIT) returns[i].strength = left;
        if (event.kind == Kind::SHEET) returns[i].strength = (arriving - left) * densities.scattering[event.part];
        update_volumes(volumes, event, i);
    }
}

// Compute the ranges of echoes from strengths and losses. The range of a volume's echo is the range up to which half of
// its power has returned.
inline void find_ranges(Array<const Event> events, const Densities& densities, const ReturnLaw& law,
                        List<Volume>& volumes, Buffer<Return>& returns) {
    int64_t ray = -1;
    double near = 0.0, before = 1.0; // range of the previous event, m, and the share of the power behind it
    for (int64_t i = 0; i < events.size(); i++) {
        const Event& event = events[i];
        returns[i].range = event.t;
        if (!law.spreads) continue;
        if (event.ray != ray) {
            ray = event.ray, near = 0.0, before = 1.0;
            volumes.clear();
        }
        double loss = returns[i].loss, behind = law.share_before(event);
        share_loss(loss, densities, volumes, [&](int64_t number, double part) {
            Return& entry = returns[number];
            double credit = loss * part;
            if (0.0 < entry.missing && entry.missing <= credit) {
                double left = law.returned(before) - entry.missing / part;
                double at = left > 0.0 ? 1.0 + log(left) / law.nepers : behind;
                double lost = (before - at) / (before - behind);
                entry.range = near + minimum(maximum(lost, 0.0), 1.0) * (event.t - near);
            }
            entry.missing -= credit;
        });
        if (event.kind == Kind::ENTER) returns[i].missing = returns[i].strength / 2.0;
        near = event.t, before = law.share_behind(event);
        update_volumes(volumes, event, i);
    }
}

constexpr double LEAF_BACKSCATTER = 2.0 / 3.0; // as in echo_extraction.py
constexpr double EQUAL_STRENGTHS = 1e-12;      // relative difference below which strengths are equal

struct Echo {
    int64_t beam;
    int64_t row;     // index of the ray among the rays of all beams
    double t;        // range, m from the start of the ray; for a volume up to half of its returned power
    double front;    // range at which the echo begins, m; for a volume its entry
    int64_t part;    // the part, as in Traces
    double power;    // power left on arrival; for a hit after absorption by the surface
    double strength; // share of the power that a rough wall returns at normal incidence of the whole beam
    uint8_t kind;    // the EventKind
    bool ends;       // whether the ray ends at this echo
};
ROW(Echo, beam, row, t, front, part, power, strength, kind, ends)

struct Placed { // an event of a beam with its range, for sorting
    double range;
    int64_t event;
};

// Merge two sorted runs; elements of the first run come first if ranges are equal.
inline void merge_runs(Placed* run, int64_t middle, int64_t end, Placed* spare) {
    memcpy(spare, run, middle * sizeof(Placed));
    int64_t first = 0, second = middle;
    for (int64_t k = 0; first < middle; k++)
        run[k] = second < end && run[second].range < spare[first].range ? run[second++] : spare[first++];
}

// Sort by range; the sort is stable. Most lists are short and almost sorted for each ray, so insertion sort is fastest.
// Longer lists are split into short runs, which are sorted by insertion and merged.
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

// Compute the echoes of all events, beam by beam, sorted by range. Returns the number of echoes, or -1 if an event has
// an unknown ray or part. Incidence is empty, or has the cosine of the angle of incidence of each ray.
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
    Buffer<Return> returns(n);
    List<Volume> volumes(n);
    compute_strengths(events, densities, law, volumes, returns);
    find_ranges(events, densities, law, volumes, returns);
    List<Placed> placed(n);
    Buffer<Placed> spare(n);
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
            // By rounding errors the strength may be slightly greater than the full power.
            strength = minimum(weights[ray] * strength, 1.0);
            echoes[total++] = {beam, ray, range, t, part, power - (hit ? absorbed : 0.0), strength, uint8_t(kind),
                               hit || kind == Kind::SPENT};
        }
    }
    return total;
}
BIND(extract_echoes, "e r i p p e")

// Whether a merged echo takes its kind from the first of two echoes.
inline bool represents(const Echo& one, const Echo& other) {
    if (one.ends != other.ends) return one.ends;
    return one.strength > other.strength * (1.0 + EQUAL_STRENGTHS);
}

// Return the index of the first echo from i on, in the same beam, that has strength or ends the ray; the number of
// echoes if there is none.
inline int64_t first_with_power(Array<const Echo> echoes, int64_t i) {
    for (int64_t beam = echoes[i].beam; i < echoes.size() && echoes[i].beam == beam; i++)
        if (echoes[i].strength > 0.0 || echoes[i].ends) return i;
    return echoes.size();
}

// Merge echoes of the same beam that are closer together than a resolution; return the number of remaining echoes.
inline int64_t merge_echoes(Array<const Echo> echoes, double resolution, Array<Echo> merged) {
    int64_t left = 0, n = echoes.size();
    for (int64_t i = 0, j; i < n; i = j) {
        int64_t first = first_with_power(echoes, i), best = i;
        double end = echoes[i].t; // by default there is no echo to merge with
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
        echo.strength = minimum(total, 1.0);
    }
    return left;
}
BIND(merge_echoes, "e e")

enum Mode { LAST, FIRST, STRONGEST };

// Select the echo that determines the range of each beam, and set range and ray; see echo_extraction.py. Returns the
// number of beams with an echo; the rows of these echoes come first in selected.
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
BIND(select_echoes, "e b b b")

constexpr double MOST_CELLS = 1e7; // maximum number of cells between two events; searching more would take too long

// The state of a search for rain, range cell by range cell.
struct Search {
    double t;      // m, range of the next cell, or of the cell in which rain is detected
    double budget; // falls in each cell by -log(probability of no detection); at most 0 if rain is detected
};

// Search cells of constant contrast up to a distance. A single exponential random number, the budget, decides in which
// cell rain is detected.
inline Search search_rain(Search from, double end, double cell, double contrast) {
    auto [t, budget] = from;
    // Without rain all cells are skipped; the range must remain a multiple of the depth of a cell.
    if (contrast <= 0.0) return {t + cell * maximum(ceil((end - t) / cell), 0.0), budget};
    for (; t < end; t += cell) {
        // log1p is exact even if the probability of a detection is tiny.
        budget += log1p(-exp(-t * t / contrast));
        if (budget <= 0.0) break;
    }
    return {t, budget};
}

// Find the nearest cell of each beam in which rain is detected; return the number of beams with such a cell. Contrasts
// has the contrast of each part at 1 m; see rain_and_clouds.py for the other arguments.
inline int64_t find_rain(Array<const Event> events, Array<const int64_t> rays, Array<const double, 2> random,
                         int64_t air_part, Array<const double> contrasts, double cell, double margin_db,
                         double nearest, double full_power, Array<Echo> found) {
    int64_t i = 0, count = 0, parts = contrasts.size();
    Buffer<bool> enclosing(parts);
    for (int64_t beam = 0; beam < rays.size(); beam++) {
        for (int64_t part = 0; part < parts; part++) enclosing[part] = part == air_part; // as at the start
        Search search = {nearest, random(0, beam)};
        double before = 0.0, power = full_power; // distance and power after the previous event
        while (i < events.size() && events[i].ray < rays[beam]) i++;
        for (; i < events.size() && events[i].ray == rays[beam] && search.budget > 0.0; i++) {
            const Event& event = events[i];
            if (!is_known(event, INT64_MAX, parts) || !(event.t - search.t < MOST_CELLS * cell)) continue;
            double contrast = 0.0;
            int64_t raining = -1;
            for (int64_t part = 0; part < parts; part++)
                if (enclosing[part] && contrasts[part] > 0.0) contrast += contrasts[part], raining = part;
            search = search_rain(search, event.t, cell, contrast);
            if (search.budget <= 0.0) {
                double t = search.t;
                // Power falls linearly between events; unlimited power does not fall.
                double lost = power < INFINITE ? (power - event.power) * (t - before) : 0.0;
                lost /= event.t - before;
                // The exponential distribution is memoryless: the excess of a detected cell over the detection limit
                // has the same distribution as the contrast itself.
                double level = 10.0 * log10(1.0 + contrast / (t * t) * random(1, beam));
                bool is_limited = 0.0 < full_power && full_power < INFINITE;
                double share = is_limited ? (power - lost) / full_power : 1.0;
                double above = minimum(level, margin_db) - margin_db * (1.0 - share);
                if (above > 0.0)
                    found[count++] = {beam, rays[beam], t, t, raining, power - lost,
                                      pow(10.0, (above - margin_db) / 10.0), uint8_t(Kind::RAIN), false};
            }
            if (event.kind == Kind::START_INSIDE || event.kind == Kind::ENTER) enclosing[event.part] = true;
            if (event.kind == Kind::LEAVE) enclosing[event.part] = false;
            before = event.t, power = event.power - event.absorbed;
        }
    }
    return count;
}
BIND(find_rain, "e b 2b p b")

} // namespace radarsim
