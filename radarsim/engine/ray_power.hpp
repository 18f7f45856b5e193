// Computes the echoes of a ray from the events along it, and adds them to the power in range bins.
#pragma once
#include "range_lines.hpp"

namespace radarsim::fmcw {

constexpr double GRAZING = 1e-3;      // the smallest cosine of an angle of incidence
constexpr double OVERLAP = 1.5;       // elevations that a ray of ground stands for, in spacings of rays
constexpr double STRAIGHT_BACK = 0.9; // minimum cosine between a corner's outgoing ray and the way back to the antenna
constexpr double SECOND_GAMMA = 0.05; // mean gamma of surfaces at a second bounce; estimate
constexpr double SECOND_LENGTH = 4.0; // m, mean extra range of a second bounce; estimate
constexpr double SECOND_ENDS = 4.0;   // maximum extra range of a second bounce, in multiples of SECOND_LENGTH
constexpr double LONGEST_SPREAD = 3.0; // m, maximum length over which a grazed surface is spread

struct FanRays { // the rays of a fan in a scene
    Array<const int64_t> column;
    // As in ray_fan.py, but the weights are multiplied by K and divided by the noise power.
    Array<const double> across, weights, spread;
    Array<const Vector> directions; // unit vectors, map frame
    Array<const double> shift;      // m, shift of the measured ranges by the Doppler effect
    Array<const double> ranges;     // m, length of each ray; inf if it hits nothing
    Array<const double> incidence;  // cosine of the angle of incidence
    double full, db_per_power;      // penetration power at the start, and one-way dB per unit of this power
    double wavelength;              // m
};
LAYOUT(FanRays, "r r r r r r r r", column, across, weights, spread, directions, shift, ranges, incidence, full,
       db_per_power, wavelength)

inline Vector place_of(const Event& event) { return {event.x, event.y, event.z}; }

// Follows one ray from event to event.
class RayWalk {
  public:
    RayWalk(const FanRays& rays, Array<const Event> events, const Scattering& scattering, const RangeLines& lines,
            GroundView& view, List<int64_t>& inside, int64_t ray, int64_t first)
        : rays_(rays), events_(events), scattering_(scattering), lines_(lines), view_(view), inside_(inside), ray_(ray),
          first_(first), place_{rays.column[ray] & 1, rays.across[ray], rays.weights[ray], rays.shift[ray], 0.0} {}

    // Add the echoes of the ray; return the index of the first event of the next ray.
    int64_t add() {
        double t = 0.0, power = rays_.full;
        bool is_turned = false; // whether a mirror has changed the direction that the ray has in the fan
        int64_t i = first_;
        inside_.clear();
        for (; i < events_.size() && events_[i].ray == ray_; i++) {
            const Event& event = events_[i];
            // Power never increases; a rounding error must not give a volume a negative echo.
            double left = minimum(event.power, power);
            add_volumes(t, event.t, power, left);
            switch (event.kind) {
            case Kind::HIT:
                // The model of level ground needs the direction of the ray in the fan, so after a mirror ground is
                // treated like any other surface.
                if (!is_turned && is_level(rays_.directions[ray_], rays_.incidence[ray_]))
                    add_level(event, share_left(left));
                else add_end(event, share_left(left));
                break;
            case Kind::OUT_OF_RANGE:
                if (!is_turned) add_open_ground(event, t, power);
                break;
            case Kind::SHEET: {
                // A sheet has no depth, so it scatters a share of the power that it absorbs.
                double taken = 1.0 - pow(10.0, -0.1 * event.absorbed * rays_.db_per_power);
                const PartScattering& part = scattering_.of(event.part);
                add_surface(lines_, place_.swaying(part.sway), event.t, part.albedo * taken * share_left(left), 0.0);
                break;
            }
            case Kind::MIRRORED: {
                double gamma = gamma_of(scattering_.of(event.part), mirror_cosine(i), event.t);
                double through = share_left(left);
                add_surface(lines_, place_, event.t, gamma * through, 0.0);
                if (is_turned) add_corner(i, through);
                is_turned = true;
                break;
            }
            default: break;
            }
            pass_surface(event);
            t = event.t, power = left - event.absorbed;
        }
        return i;
    }

  private:
    // Return the share of the wave's power that arrives back at the antenna from a point at which the ray has this
    // power left. Penetration power counts one-way decibels, so they are doubled.
    double share_left(double left) const { return pow(10.0, -0.2 * (rays_.full - left) * rays_.db_per_power); }

    // Update the list of volumes that enclose the ray.
    void pass_surface(const Event& event) {
        switch (event.kind) {
        case Kind::START_INSIDE:
        case Kind::ENTER:
            if (inside_.size() < scattering_.parts.size()) inside_.append(event.part);
            break;
        case Kind::LEAVE:
            for (int64_t i = inside_.size() - 1; i >= 0; i--)
                if (inside_[i] == event.part) inside_.remove(event.part);
            break;
        case Kind::MIRRORED: inside_.clear(); break; // the next segment enters the volumes again
        default: break;
        }
    }

    // Add the echo of the volumes between two events; power and left are the ray's power at the first and the second.
    void add_volumes(double near, double far, double power, double left) {
        double volume = scattering_.air, sway = 0.0; // sum of the radar cross sections per volume
        for (int64_t part : inside_) {
            volume += scattering_.of(part).volume;
            sway = maximum(sway, scattering_.of(part).sway);
        }
        if (!(volume > 0.0 && far > near)) return;
        double loss = (rays_.full - power) * rays_.db_per_power;
        double slope = (power - left) / (far - near) * rays_.db_per_power;
        add_volume(lines_, place_.swaying(sway), near, far, volume, loss, slope);
    }

    // Add the echo of the surface that ends the ray; through is the share of the power that is left after both ways.
    void add_end(const Event& event, double through) {
        double cosine = maximum(rays_.incidence[ray_], GRAZING);
        const PartScattering& part = scattering_.of(event.part);
        double gamma = gamma_of(part, cosine, event.t);
        // The tangent of the angle of incidence determines how much farther away the next ray meets the surface.
        double slant = sqrt(1.0 - cosine * cosine) / cosine;
        double length = minimum(rays_.spread[ray_] * event.t * slant, LONGEST_SPREAD);
        add_surface(lines_, place_, event.t, gamma * through, length);
        add_second_bounce(part, event.t, through);
    }

    // Add the echoes of other surfaces by reflection at a smooth surface, on the way out and on the way back.
    void add_second_bounce(const PartScattering& part, double t, double through) {
        if (part.glint <= 0.0) return;
        double reflected = part.glint / part.narrowness, slope = 0.5 * NEPER_DB / SECOND_LENGTH;
        double volume = SECOND_GAMMA * reflected * reflected * through / SECOND_LENGTH;
        add_volume(lines_, place_, t, t + SECOND_ENDS * SECOND_LENGTH, volume, 0.0, slope);
    }

    // Add the echo of the level ground that ends the ray.
    void add_level(const Event& event, double through) {
        // Level ground is visible up to the point at which the next higher ray meets an upright surface.
        int64_t after = ray_ + 1;
        double end = INFINITE;
        if (after < rays_.column.size() && rays_.column[after] == rays_.column[ray_] &&
            !is_level(rays_.directions[after], rays_.incidence[after]))
            end = maximum(rays_.ranges[after], rays_.ranges[ray_]);
        const PartScattering& part = scattering_.of(event.part);
        double angle = OVERLAP * rays_.spread[ray_];
        add_level_ground(part, grazing_at(part, event, rays_.directions[ray_], angle, end), through);
    }

    // Add the echo of open ground that the ray meets beyond the edge of the map, after an event at t, m; power is the
    // ray's power there.
    void add_open_ground(const Event& end, double t, double power) {
        const Vector& direction = rays_.directions[ray_];
        if (scattering_.open_part < 0 || direction[2] >= 0.0) return;
        double way = end.t + (scattering_.open_height - end.z) / direction[2];
        if (way <= t || way >= end.t) return;
        double lost = rays_.full - power + (power - end.power) * (way - t) / (end.t - t);
        double through = pow(10.0, -0.2 * lost * rays_.db_per_power), angle = OVERLAP * rays_.spread[ray_];
        double x = end.x - end.t * direction[0], y = end.y - end.t * direction[1];
        add_level_ground(scattering_.of(scattering_.open_part),
                         over_ground(x, y, direction, way, angle, 0.0, INFINITE), through);
    }

    // Add the echo of a part's level ground, or of all patches in the interval of ranges that the ray stands for.
    void add_level_ground(const PartScattering& part, const Grazing& grazing, double through) {
        double gamma = 1.0;
        if (!part.constant_gamma || !scattering_.has_patches())
            gamma = surface_gamma(part, maximum(grazing.depth / grazing.t, GRAZING));
        add_ground(lines_, place_, grazing, gamma * through, part.constant_gamma, scattering_, view_);
    }

    // Add the echo that several mirrors, such as a corner of two walls, reflect back to the antenna; last is the event
    // at the last mirror. They are modelled as a single mirror that the ray meets at normal incidence, at half of the
    // length of the closed path. Its variance of slopes is the sum of the variances of all mirrors.
    void add_corner(int64_t last, double through) {
        const Event &event = events_[last], &after = events_[last + 1], &start = events_[first_];
        const Vector& ahead = rays_.directions[ray_];
        double run = after.t - event.t;
        if (run <= 0.0) return;
        Vector way = place_of(start) - start.t * ahead - place_of(event);
        double straight = length_of(way);
        double back = dot(place_of(after) - place_of(event), way) / (run * maximum(straight, 1e-9));
        if (back < STRAIGHT_BACK) return;
        // The angle of incidence on the single mirror is half of the angle by which the ray misses the antenna.
        double square = minimum(0.5 * (1.0 + back), 1.0), distance = 0.5 * (event.t + straight);
        double share = 1.0, spread = 0.0, area = 0.0;
        for (int64_t i = first_; i <= last; i++) {
            if (events_[i].kind != Kind::MIRRORED) continue;
            const PartScattering& part = scattering_.of(events_[i].part);
            if (part.narrowness <= 0.0) return;
            share *= part.glint / part.narrowness;
            spread += 0.5 / part.narrowness;
            area += part.area * mirror_cosine(i);
        }
        spread += lobe_of(area, distance);
        double gamma = gamma_at(sqrt(square), 0.0, true, share * 0.5 / spread, 0.5 / spread);
        add_surface(lines_, place_, distance, gamma * through, 0.0);
    }

    // Return the variance of the angles into which diffraction spreads the reflection of a mirror with this area. Of a
    // large mirror only the Fresnel zone around the shortest path contributes.
    double lobe_of(double area, double distance) const {
        double zone = minimum(area, 0.5 * rays_.wavelength * distance);
        return rays_.wavelength * rays_.wavelength / (8.0 * M_PI * maximum(zone, 1e-6));
    }

    // Return the gamma of a surface at a distance, m; the lobe of a mirror is widened by its slopes and by diffraction.
    double gamma_of(const PartScattering& part, double cosine, double distance) const {
        if (part.area <= 0.0) return surface_gamma(part, cosine);
        double spread = 0.5 / part.narrowness + lobe_of(part.area, distance);
        double glint = part.glint / part.narrowness * 0.5 / spread;
        return gamma_at(cosine, part.gamma, part.constant_gamma, glint, 0.5 / spread);
    }

    // Return the cosine of the angle of incidence on a mirror, which is half of the length of the change of the unit
    // direction. Events have positions but no directions, so directions are computed from positions; a mirror is
    // never the last event of a ray.
    double mirror_cosine(int64_t mirror) const {
        int64_t before = mirror - 1; // the mirror before this one
        while (before >= first_ && events_[before].kind != Kind::MIRRORED) before--;
        const Event &here = events_[mirror], &after = events_[mirror + 1];
        double run = after.t - here.t;
        if (run <= 0.0) return 1.0;
        Vector direction = rays_.directions[ray_];
        if (before >= first_) {
            const Event& last = events_[before];
            direction = (place_of(here) - place_of(last)) / maximum(here.t - last.t, 1e-9);
        }
        Vector change = (place_of(after) - place_of(here)) / run - direction;
        return minimum(maximum(0.5 * length_of(change), GRAZING), 1.0);
    }

    const FanRays& rays_;
    Array<const Event> events_;
    const Scattering& scattering_;
    const RangeLines& lines_;
    GroundView& view_;
    List<int64_t>& inside_; // parts of the volumes that enclose the current point
    int64_t ray_, first_;   // index of the ray, and of its first event
    Place place_;
};

} // namespace radarsim::fmcw
