// Computes the colours of a camera's rays; see camera.py for the theory.
#pragma once
#include "echoes.hpp"

namespace radarsim {

// Add the colours of rays to pixels.
//   incidence: cosine between each ray and the normal of the surface that it hit
//   colours: colours of the parts, the last of which is the air, then the colour of robots
//   background: colour of each ray behind all surfaces
//   ambient: brightness of a surface that is parallel to the ray
inline void shade(Array<const Event> events, Array<const double> incidence, Array<const Vector> colours,
                  Array<const Vector> background, Array<Vector> pixels, double full_power, double ambient) {
    int64_t robots = colours.size() - 1, air = robots > 0 ? robots - 1 : 0, ray = -1;
    if (robots < 0) return;
    List<int32_t> enclosing(events.size());
    double power = full_power, seen = 1.0;
    for (const Event& event : events) {
        if (!is_known(event, pixels.size(), robots)) continue;
        if (event.ray != ray) {
            ray = event.ray, power = full_power, seen = 1.0;
            enclosing.clear();
        }
        auto add = [&](double share, const Vector& colour) {
            for (int channel = 0; channel < 3; channel++) pixels[ray][channel] += share * colour[channel];
        };
        // In nested volumes the last entered volume gives the colour; outside of all volumes the air does.
        int64_t medium = enclosing.size() ? enclosing.end()[-1] : air;
        double passed = exp(event.power - power);
        add(seen * (1.0 - passed), colours[medium]);
        seen *= passed;
        power = event.power;
        switch (event.kind) {
        case Kind::START_INSIDE:
        case Kind::ENTER: enclosing.append(event.part); break;
        case Kind::LEAVE: enclosing.remove(event.part); break;
        case Kind::HIT:
        case Kind::ABSORBED: {
            double cosine = incidence[ray] > 0.0 ? incidence[ray] : 0.0; // nan counts as 0
            int64_t part = event.part >= 0 && event.part < robots ? event.part : robots;
            add(seen * (ambient + (1.0 - ambient) * cosine), colours[part]);
            break;
        }
        case Kind::OUT_OF_RANGE: add(seen, background[ray]); break;
        default: break;
        }
    }
}
BIND(shade, "e n c n n")

} // namespace radarsim
