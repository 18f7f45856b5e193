"""The link budget of an azimuth: the gains and losses of its echoes in decibels.

A ray in the middle of the beam represents the whole beam, as if the surfaces that it
meets filled the beam. The entries of an echo sum to its received power.
"""

import json
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.antenna import (
    directivity,
    elevation_limits,
    elevation_pattern,
)
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.radar_equation import dbm_of, noise_power
from radarsim.addons.fmcw.scattering import GRAZING, scene_scattering
from radarsim.cli.output import print_lines
from radarsim.engine import engine
from radarsim.errors import PresetError
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.rays import Event, EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import RangeScanner

_STEPS = 2001  # samples of the integral over the beam
_WIDTH = 38  # width of the labels, characters


def print_budget(
    scanner: RangeScanner, scene: Scene, pose: Pose3, azimuth: int, as_json: bool
) -> None:
    """Print the link budget of one azimuth of a radar.

    Raises:
        click.BadParameter: If the sensor is not an FMCW radar, or has no such azimuth.
    """
    try:
        budget = link_budget(scanner.fmcw, scene, pose, azimuth)
    except PresetError as error:
        raise click.BadParameter(str(error)) from None
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--beam") from None
    if as_json:
        click.echo(json.dumps(budget))
    else:
        print_lines(_as_text(budget))


def _as_text(budget: Mapping[str, Any]) -> Iterator[str]:
    def line(label: str, number: float, unit: str) -> str:
        return f"  {label:{_WIDTH}}{number:8.1f} {unit}"

    angle = -math.degrees(budget["angle"])
    yield f"azimuth {budget['azimuth']}, {angle:.1f} deg clockwise from straight ahead"
    for number, entry in enumerate(budget["entries"]):
        yield line(entry["label"], entry["db"], "dBm" if number == 0 else "dB")
    for echo in budget["echoes"]:
        yield ""
        place = f"{echo['kind']} at {echo['range']:.2f} m"
        yield f"{echo['object_name']} ({echo['material']}), {place}"
        for entry in echo["entries"]:
            yield line(entry["label"], entry["db"], "dB")
        yield line("received", echo["received"], "dBm")
        yield line("noise", budget["noise"], "dBm")
        yield line("signal to noise", echo["received"] - budget["noise"], "dB")
    if not budget["echoes"]:
        yield "nothing comes back"


def link_budget(
    radar: FmcwRadar, scene: Scene, pose: Pose3, azimuth: int
) -> dict[str, Any]:
    """Return the gains and losses, dB, of all echoes that one azimuth receives.

    Args:
        radar: The radar.
        scene: The map.
        pose: Pose of the antenna, map frame.
        azimuth: Index of the azimuth, 0 to A - 1.

    Returns:
        The ``azimuth``, its ``angle``, rad, counter-clockwise from straight ahead, the
        ``noise`` in a bin, dBm, and the ``echoes`` by range. Each echo has
        ``object_name``, ``material``, ``kind``, ``range``, m, and ``received`` power,
        dBm. The common ``entries``, and the ``entries`` of each echo, have a ``label``
        and the ``db`` that they add; the first common entry is in dBm.

    Raises:
        ValueError: If there is no such azimuth.
    """
    it = radar.settings
    if not 0 <= azimuth < it.azimuths:
        raise ValueError(f"azimuth {azimuth}, expected 0 to {it.azimuths - 1}")
    common = {
        "transmitted": it.transmit_dbm,
        "lines and radome": -it.loss_db,
        "antenna gain, out and back": 2 * _db(directivity(it)),
        "wavelength^2 / (4 pi)^3": _db(it.wavelength**2 / (4 * math.pi) ** 3),
        "solid angle of the beam": _db(beam_solid_angle(it)),
    }
    angle = float(radar.angles[azimuth])
    ahead: Floats = np.array([[math.cos(angle), math.sin(angle), 0.0]])
    directions = ahead @ pose.rotation().T
    rays = radar.rays(pose.position()[None], directions / np.linalg.norm(directions))
    tracer = tracer_of(scene)
    incidence = float(tracer.trace(rays, incidence=True).incidence[0])
    scattering = scene_scattering(tracer, radar.ray_class).parts
    echoes = []
    for event, lost in _with_losses(tracer.explain(rays)[0], radar, tracer.parts):
        echo = _echo_of(event, incidence, scattering, radar)
        if echo is not None:
            kind, label, gamma = echo
            part = tracer.parts[event.part]  # the scene has no robots
            own = {f"1 / R^2 at {event.t:.2f} m": -20 * math.log10(event.t)}
            # These one-way losses are doubled, since the echo returns on the same path.
            own |= {f"lost in {name}": -2 * db for name, db in lost.items()}
            own[label] = _db(gamma)
            echoes.append(
                {
                    "object_name": part.object_name,
                    "material": part.material.name,
                    "kind": kind,
                    "range": event.t,
                    "entries": _entries(own),
                    "received": sum([*common.values(), *own.values()]),
                }
            )
    return {
        "azimuth": azimuth,
        "angle": angle,
        "entries": _entries(common),
        "noise": float(dbm_of(noise_power(it))),
        "echoes": echoes,
    }


def _entries(ledger: Mapping[str, float]) -> list[dict[str, Any]]:
    return [{"label": label, "db": db} for label, db in ledger.items()]


def beam_solid_angle(settings: FmcwSettings) -> float:
    """Return the integral of the two-way antenna pattern over all directions, sr."""
    low, high = elevation_limits(settings)
    elevations = np.linspace(low, high, _STEPS)
    up = (elevation_pattern(settings, elevations) ** 2).mean() * (high - low)
    width = math.radians(settings.beamwidth_az_deg)
    across = width * math.sqrt(math.pi / (8 * math.log(2)))
    return float(across * up)


def _echo_of(
    event: Event,
    incidence: float,
    scattering: NDArray[np.void],
    radar: FmcwRadar,
) -> tuple[str, str, float] | None:
    """Return the kind, cause and gamma of the echo of an event on a ray, if any."""
    # The last row of the scattering table is for all robots.
    part = scattering[min(event.part, len(scattering) - 1)]
    if event.kind is EventKind.HIT:
        cosine = max(incidence, GRAZING)
        law = part[["gamma", "constant_gamma", "glint", "narrowness"]].item()
        gamma = engine.gamma_at(cosine, *law)
        degrees = math.degrees(math.acos(min(incidence, 1.0)))
        return "surface", f"backscatter, met at {degrees:.0f} deg", float(gamma)
    if event.kind is EventKind.MIRRORED:
        gamma = float(part["gamma"])
        return "mirror", "backscatter beside the reflection", gamma
    if event.kind in (EventKind.ENTER, EventKind.START_INSIDE) and event.t > 0:
        # A volume returns power to every bin that the ray passes; the budget shows the
        # first bin.
        gamma = float(part["volume"] * radar.settings.resolution)
        label = f"backscatter of the first {radar.settings.resolution:.2f} m"
        return ("volume", label, gamma) if gamma > 0 else None
    if event.kind is EventKind.SHEET:
        loss = event.absorbed / radar.ray_class.power_per_db
        gamma = float(part["albedo"] * (1 - 10 ** (-loss / 10)))
        return ("sheet", "backscatter of a sheet", gamma) if gamma > 0 else None
    return None


def _with_losses(
    events: Sequence[Event], radar: FmcwRadar, parts: Sequence[Part]
) -> Iterator[tuple[Event, Mapping[str, float]]]:
    """Yield each event on a ray, and each material's one-way loss, dB, before it."""
    power, inside = radar.full_power, list[int]()
    lost: dict[str, float] = defaultdict(float)

    def add(part: int | None, taken: float) -> None:
        if taken > 0:
            name = "air" if part is None else parts[part].material.name
            lost[name] += taken / radar.ray_class.power_per_db

    for event in events:
        # Where volumes overlap, the loss is assigned to the volume entered last.
        add(inside[-1] if inside else None, power - event.power)
        power = event.power
        yield event, lost
        if event.kind in (EventKind.ENTER, EventKind.START_INSIDE):
            inside.append(event.part)
        elif event.kind is EventKind.LEAVE and event.part in inside:
            inside.remove(event.part)
        elif event.kind is EventKind.MIRRORED:
            inside.clear()
        if event.kind in (EventKind.SHEET, EventKind.MIRRORED):
            add(event.part, event.absorbed)
            power -= event.absorbed


def _db(ratio: float) -> float:
    return 10 * math.log10(ratio) if ratio > 0 else -math.inf
