// The engine: all that is too slow in Python. One library, as C headers compile in seconds.
#include "directions.hpp"
#include "echoes.hpp"
#include "lines.hpp"
#include "motion.hpp"
#include "occupancy.hpp"
#include "path_search.hpp"
#include "readings.hpp"
#include "scan_matching.hpp"
#include "shading.hpp"
#include "spectra.hpp"
#include "topology.hpp"
#include "trace.hpp"
#include "turn_echoes.hpp"
#include "walls.hpp"

#define EXPORT extern "C" __attribute__((visibility("default")))

// A description of all functions and structures, as library.py reads it.
EXPORT const char* radarsim_describe() {
    static radarsim::bindings::Text text;
    if (!text.memory()[0]) radarsim::bindings::describe_all(text);
    return text.memory();
}

// The digest of the sources that this was compiled from.
EXPORT const char* radarsim_sources() { return RADARSIM_SOURCES; }
