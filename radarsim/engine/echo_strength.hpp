// What comes back of each event along rays; see echo_extraction.py for the theory.
#pragma once
#include "event.hpp"

namespace radarsim {

constexpr double NOTHING_LEFT = 1e-12; // share of a ray's power; as in echo_extraction.py

struct Densities {
    Array<const double> parts; // power lost per metre in each
    double air;
    Array<const double> scattering; // of each part, relative to foliage
};

struct ReturnLaw {
    double full, nepers;
    bool spreads; // whether the echo of a volume has the range of half its power

    // What comes back of a ray that has a share of its power left.
    double returned(double share) const { return share <= NOTHING_LEFT ? 0.0 : exp(nepers * (share - 1.0)); }
    double share_left(const Event& event, double power) const {
        if (event.kind == Kind::SPENT) return 0.0;
        return full > 0.0 ? power / full : 1.0;
    }
    double share_before(const Event& event) const { return share_left(event, event.power); }
    double share_behind(const Event& event) const { return share_left(event, event.power - event.absorbed); }
};

// What comes back of an event.
struct Return {
    double strength; // of its echo, had its ray the whole beam
    double range;    // m, of its echo
    double loss;     // what does not come back from behind the stretch before it, of what would from before that
    double missing;  // to half of the strength
};

// A volume around a point of a ray.
struct Volume {
    int32_t part;
    int64_t entry; // the event at which the ray entered it; -1 if it started inside
};

// Whether an event is of one of so many rays and, unless its ray ends there, parts.
inline bool is_known(const Event& event, int64_t rays, int64_t parts) {
    if (event.ray < 0 || event.ray >= rays) return false;
    return event.kind > Kind::SHEET || (event.part >= 0 && event.part < parts);
}

inline double total_density(const Densities& densities, const List<Volume>& volumes) {
    double total = densities.air;
    for (const Volume& volume : volumes) total += densities.parts[volume.part];
    return total;
}

// What a volume returns of a loss that it shares with the air and others.
inline double share_of(const Densities& densities, const Volume& volume, double total) {
    return densities.parts[volume.part] / total * densities.scattering[volume.part];
}

inline void update_volumes(List<Volume>& volumes, const Event& event, int64_t i) {
    if (event.kind == Kind::ENTER) volumes.append({event.part, i});
    if (event.kind == Kind::START_INSIDE) volumes.append({event.part, -1});
    if (event.kind != Kind::LEAVE) return;
    for (Volume& volume : volumes)
        if (volume.part == event.part) {
            volume = volumes.end()[-1]; // their order does not matter
            volumes.shorten(volumes.size() - 1);
            return;
        }
}

// Add a loss along a stretch to the echoes of the volumes around it, in proportion to density. The echo of a volume
// is that of its near side. One around the start has none: its share, like the air's, returns no echo.
inline void credit_volumes(double loss, const Densities& densities, const List<Volume>& volumes,
                           Room<Return>& returns) {
    if (loss <= 0.0) return;
    double total = total_density(densities, volumes);
    if (total <= 0.0) return;
    for (const Volume& volume : volumes)
        if (volume.entry >= 0) returns[volume.entry].strength += loss * share_of(densities, volume, total);
}

// Compute strengths and losses.
inline void compute_strengths(Array<const Event> events, const Densities& densities, const ReturnLaw& law,
                              List<Volume>& volumes, Room<Return>& returns) {
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
        returns[i].loss = left - arriving;
        credit_volumes(returns[i].loss, densities, volumes, returns);
        // Only sheets and surfaces take power at one point.
        left = behind == share ? arriving : law.returned(behind);
        if (event.kind == Kind::HIT) returns[i].strength = left;
        if (event.kind == Kind::SHEET) returns[i].strength = (arriving - left) * densities.scattering[event.part];
        update_volumes(volumes, event, i);
    }
}

// A part of a ray's way along which the volumes around it are the same.
struct Stretch {
    double near, far;      // m
    double before, behind; // shares of its power that the ray has there
    double loss;           // as of the event at its end
};

// Set the ranges up to which half of the power of volumes has come back, where that is on this stretch.
inline void find_middles(const Stretch& stretch, const Densities& densities, const ReturnLaw& law,
                         const List<Volume>& volumes, Room<Return>& returns) {
    auto [near, far, before, behind, loss] = stretch;
    if (loss <= 0.0) return;
    double total = total_density(densities, volumes);
    if (total <= 0.0) return;
    for (const Volume& volume : volumes) {
        double share = share_of(densities, volume, total);
        if (volume.entry < 0 || share <= 0.0 || returns[volume.entry].missing <= 0.0) continue;
        Return& entry = returns[volume.entry];
        double credit = loss * share;
        if (credit >= entry.missing) {
            double left = law.returned(before) - entry.missing / share;
            double at = left > 0.0 ? 1.0 + log(left) / law.nepers : behind;
            double lost = (before - at) / (before - behind);
            entry.range = near + least(most(lost, 0.0), 1.0) * (far - near);
        }
        entry.missing -= credit;
    }
}

// Find the ranges, when strengths and losses are known.
inline void find_ranges(Array<const Event> events, const Densities& densities, const ReturnLaw& law,
                        List<Volume>& volumes, Room<Return>& returns) {
    int64_t ray = -1;
    double near = 0.0, before = 1.0;
    for (int64_t i = 0; i < events.size(); i++) {
        const Event& event = events[i];
        returns[i].range = event.t;
        if (!law.spreads) continue;
        if (event.ray != ray) {
            ray = event.ray, near = 0.0, before = 1.0;
            volumes.clear();
        }
        Stretch stretch = {near, event.t, before, law.share_before(event), returns[i].loss};
        find_middles(stretch, densities, law, volumes, returns);
        if (event.kind == Kind::ENTER) returns[i].missing = returns[i].strength / 2.0;
        near = event.t, before = law.share_behind(event);
        update_volumes(volumes, event, i);
    }
}

} // namespace radarsim
