"""Colours of rays of light, from the events along them, as machine code.

Surfaces are matt and are lit from where the camera is: their brightness depends on the
cosine between the ray and their normal (Lambert), and is at least ``AMBIENT``. Volumes
that let light through veil what is behind them: a ray that loses the power d in a
volume gets the share 1 - exp(-d) of the volume's colour (Beer and Lambert).
"""

from typing import Any, Final

import numpy as np

from radarsim.jit import njit_cached, njit_inline
from radarsim.raycast.attenuation import EventKind

FULL_POWER: Final = 50.0  # a ray that has lost it sees nothing: exp(-50) is 2e-22
AMBIENT: Final = 0.45  # brightness of a surface along the ray

# numba compiles plain integers faster than the members of an enumeration.
_START_INSIDE, _ENTER = int(EventKind.START_INSIDE), int(EventKind.ENTER)
_LEAVE, _OUT_OF_RANGE = int(EventKind.LEAVE), int(EventKind.OUT_OF_RANGE)
_HIT, _ABSORBED = int(EventKind.HIT), int(EventKind.ABSORBED)


@njit_inline
def brightness(cosine: Any) -> Any:
    """Return the brightness of a surface, 0 to 1.

    Args:
        cosine: Cosine between the ray and the surface's normal; nan counts as 0.
    """
    return AMBIENT + (1.0 - AMBIENT) * (cosine if cosine > 0.0 else 0.0)


@njit_inline
def _leave(enclosing: Any, count: Any, part: Any) -> Any:
    """Remove a part from the first ``count`` of a list; return the new count."""
    kept = 0
    for i in range(count):
        if enclosing[i] != part:
            enclosing[kept] = enclosing[i]
            kept += 1
    return kept


@njit_inline
def _add(pixels: Any, ray: Any, share: Any, colour: Any) -> None:
    for channel in range(3):
        pixels[ray, channel] += share * colour[channel]


@njit_cached
def shade(
    events: Any, incidence: Any, colours: Any, background: Any, pixels: Any
) -> None:
    """Compute the colours of rays that started with ``FULL_POWER``.

    Args:
        events: Rows of EVENT, ordered by ray and by distance.
        incidence: (N,) cosine between each ray and the normal of what it hit.
        colours: (P + 1, 3) of the parts, the air's last, then that of robots.
        background: (N, 3) colour of what is behind everything.
        pixels: (N, 3) zeros, to which the colours are added.
    """
    robots = len(colours) - 1
    enclosing = np.zeros(len(colours), np.int64)
    ray, inside, power, seen = -1, 0, FULL_POWER, 1.0
    for k in range(len(events)):
        event = events[k]
        if event.ray != ray:
            ray, inside, power, seen = event.ray, 0, FULL_POWER, 1.0
        medium = enclosing[inside - 1] if inside else robots - 1
        passed = np.exp(event.power - power)
        _add(pixels, ray, seen * (1.0 - passed), colours[medium])
        seen *= passed
        power = event.power
        if event.kind in (_START_INSIDE, _ENTER):
            enclosing[inside] = event.part
            inside += 1
        elif event.kind == _LEAVE:
            inside = _leave(enclosing, inside, event.part)
        elif event.kind in (_HIT, _ABSORBED):
            share = seen * brightness(incidence[ray])
            _add(pixels, ray, share, colours[min(event.part, robots)])
        elif event.kind == _OUT_OF_RANGE:
            _add(pixels, ray, seen, background[ray])
