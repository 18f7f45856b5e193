// The engine: all computations that are too slow in Python. The headers are compiled together, which takes seconds.
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

// Return the description of all functions and structures, which library.py reads.
EXPORT const char* radarsim_describe() {
    static radarsim::bindings::Text text;
    if (!text.memory()[0]) radarsim::bindings::describe_all(text);
    return text.memory();
}

// Return the digest of the source files from which this library was compiled.
EXPORT const char* radarsim_sources() { return RADARSIM_SOURCES; }
