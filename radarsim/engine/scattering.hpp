// What the surfaces of a scene scatter back, and the ground that rays graze; see scattering.py for the theory.
#pragma once
#include "event.hpp"

namespace radarsim::fmcw {

constexpr double LEVEL = 1e-6; // how far the normal of level ground is off the vertical, at most

struct PartScattering { // a row of scattering.py
    double gamma, glint, narrowness, area, volume, albedo, sway;
    double edges[4];     // m, where level ground ends: least x, y and greatest ones
    bool constant_gamma; // at all angles, as that of open ground; else it follows Lambert's law
};
LAYOUT(PartScattering, "", gamma, glint, narrowness, area, volume, albedo, sway, edges, constant_gamma)

struct Scattering {
    Array<const PartScattering> parts; // the last row is that of robots
    double air;                        // cross section of a cubic metre of the air, m^2/m^3
    int64_t open_part;                 // the part that is open ground; -1 for none
    double open_height, open_gamma;    // m, map frame; and its gamma
    Array<const double, 2> patches;    // gamma of open ground by place, if it is not that of open_part everywhere
    Array<const double> corner;        // m, least x and y of these
    double cell;                       // m, side of a patch

    bool has_patches() const { return patches.shape[0] && patches.shape[1]; }
    // The row of a part; robots share the last.
    const PartScattering& of(int64_t part) const {
        int64_t last = parts.size() - 1;
        return parts[part < 0 || part > last ? last : part];
    }
};
LAYOUT(Scattering, "p xy 2", parts, air, open_part, open_height, open_gamma, patches, corner, cell)

struct Grazing { // a ray that meets level ground
    double x, y;         // m, of the place above which it starts
    double ahead, left;  // parts of its direction along x and y, of a level unit vector
    double t, depth;     // m, its length; and from the antenna down to the ground
    double angle;        // rad, of elevations for which it stands
    double near, far;    // m, ranges at which the ground begins and ends
};

// The greatest integer up to a number; the least of all integers where there is none.
inline int64_t floor_of(double number) { return whole_of(floor(number)); }

// The gamma of a surface at an angle of incidence, whose cosine is above 0.
inline double gamma_at(double cosine, double gamma, bool constant_gamma, double glint, double narrowness) {
    double rough = constant_gamma ? gamma : gamma * cosine;
    if (glint <= 0.0) return rough;
    double square = cosine * cosine;
    double lobe = exp(-narrowness * (1.0 - square) / square);
    return rough + glint * lobe / (square * square * cosine);
}
DOOR(gamma_at, "")

inline double surface_gamma(const PartScattering& part, double cosine) {
    return gamma_at(cosine, part.gamma, part.constant_gamma, part.glint, part.narrowness);
}

// The gamma of patched ground at a distance along a ray, m.
inline double patch_gamma(const Scattering& scattering, const Grazing& grazing, double distance) {
    const auto& patches = scattering.patches;
    double along = sqrt(most(distance * distance - grazing.depth * grazing.depth, 0.0));
    double x = grazing.x + along * grazing.ahead - scattering.corner[0];
    double y = grazing.y + along * grazing.left - scattering.corner[1];
    int64_t i = floor_of(x / scattering.cell), j = floor_of(y / scattering.cell);
    bool is_within = 0 <= i && i < patches.shape[0] && 0 <= j && j < patches.shape[1];
    return is_within ? patches(i, j) : scattering.open_gamma;
}

// Whether a surface is level that a ray from above meets at an angle of incidence.
inline bool is_level(const Vector& direction, double cosine) { return fabs(cosine + direction[2]) < LEVEL; }

// A ray of length t from a place over level ground.
inline Grazing over_ground(double x, double y, const Vector& direction, double t, double angle, double near,
                           double far) {
    double level = most(hypot(direction[0], direction[1]), 1e-9);
    return {x, y, direction[0] / level, direction[1] / level, t, -t * direction[2], angle, near, far};
}

// A ray that meets level ground of a part at an event; the view over the ground ends at a distance.
inline Grazing grazing_at(const PartScattering& part, const Event& event, const Vector& direction, double angle,
                          double end) {
    double back = INFINITE, ahead = INFINITE;
    auto cut = [&](double step, double place, double low, double high) {
        if (fabs(step) <= 1e-9) return;
        double first = (low - place) / step, second = (high - place) / step;
        back = least(back, -least(first, second));
        ahead = least(ahead, most(first, second));
    };
    cut(direction[0], event.x, part.edges[0], part.edges[2]);
    cut(direction[1], event.y, part.edges[1], part.edges[3]);
    double t = event.t, near = t - most(back, 0.0), far = least(t + most(ahead, 0.0), end);
    return over_ground(event.x - t * direction[0], event.y - t * direction[1], direction, t, angle, near, far);
}

} // namespace radarsim::fmcw
