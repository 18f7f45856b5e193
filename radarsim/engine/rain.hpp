// The rain that a radar detects; see rain.py for the theory.
#pragma once
#include "echo_extraction.hpp"

namespace radarsim {

constexpr double MOST_CELLS = 1e7; // between two events; a search farther on would not end

// What is left of a search from cell to cell.
struct Search {
    double t;      // m, the first cell that was not searched, or that shows rain
    double budget; // each cell takes its -log(probability that nothing shows); at most 0 if rain shows
};

// Search cells of constant contrast up to a distance; one exponential random number, the budget, decides it all.
inline Search search_rain(Search from, double end, double cell, double contrast) {
    auto [t, budget] = from;
    // Where it does not rain, skip the cells, but stay at multiples of their depth.
    if (contrast <= 0.0) return {t + cell * most(ceil((end - t) / cell), 0.0), budget};
    for (; t < end; t += cell) {
        // log1p stays exact where the probability of a detection is tiny.
        budget += log1p(-exp(-t * t / contrast));
        if (budget <= 0.0) break;
    }
    return {t, budget};
}

// Find the nearest cell of each beam in which rain is detected; return how many beams have one. Contrasts are those
// of each part at 1 m; other arguments as in rain.py.
inline int64_t find_rain(Array<const Event> events, Array<const int64_t> rays, Array<const double, 2> random,
                         int64_t air_part, Array<const double> contrasts, double cell, double margin_db,
                         double nearest, double full_power, Array<Echo> found) {
    int64_t i = 0, count = 0, parts = contrasts.size();
    Room<bool> enclosing(parts);
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
                // The exponential distribution has no memory: what a detected cell has above the detection limit
                // is distributed as without the limit.
                double level = 10.0 * log10(1.0 + contrast / (t * t) * random(1, beam));
                bool is_limited = 0.0 < full_power && full_power < INFINITE;
                double share = is_limited ? (power - lost) / full_power : 1.0;
                double above = least(level, margin_db) - margin_db * (1.0 - share);
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
DOOR(find_rain, "e b 2b p b")

} // namespace radarsim
