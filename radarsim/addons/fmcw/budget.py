"""The link budget of one direction: what becomes of the power, in decibels.

One ray in the middle of the beam stands for all of it, as if what it meets filled the
beam. The decibels of an echo add up to the power that is received of it.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass

import click
import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.radar_equation import (
    dbm_of,
    directivity,
    elevation_limits,
    elevation_pattern,
    noise_power,
)
from radarsim.addons.fmcw.scattering import (
    GRAZING,
    scene_scattering,
)
from radarsim.cli.output import print_lines
from radarsim.engine import engine
from radarsim.errors import PresetError
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Event, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import RangeScanner

_STEPS = 2001  # of the integral over the beam
_WIDTH = 38  # of the labels


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the ledger.

    Attributes:
        label: What it is.
        db: dB that it adds; of the first line dBm.
    """

    label: str
    db: float


@dataclass(frozen=True, slots=True)
class EchoBudget:
    """An echo and what it is reckoned from.

    Attributes:
        object_name: The object that returns it.
        material: The name of its material.
        kind: ``surface``, ``volume``, ``sheet`` or ``mirror``.
        range: m.
        entries: The entries of its own, after those that all echoes have.
        received: dBm.
    """

    object_name: str
    material: str
    kind: str
    range: float
    entries: list[Entry]
    received: float


@dataclass(frozen=True, slots=True)
class Budget:
    """The ledger of one direction.

    Attributes:
        azimuth: Number of the direction.
        angle: Its angle, rad, counter-clockwise from straight ahead.
        entries: What all echoes have in common.
        noise: Noise in a bin, dBm.
        echoes: The echoes by range.
    """

    azimuth: int
    angle: float
    entries: list[Entry]
    noise: float
    echoes: list[EchoBudget]

    def lines(self) -> Iterator[str]:
        """Yield the ledger as text."""

        def line(label: str, number: float, unit: str) -> str:
            return f"  {label:{_WIDTH}}{number:8.1f} {unit}"

        angle = -math.degrees(self.angle)
        yield f"azimuth {self.azimuth}, {angle:.1f} deg clockwise from straight ahead"
        for number, entry in enumerate(self.entries):
            yield line(entry.label, entry.db, "dBm" if number == 0 else "dB")
        for echo in self.echoes:
            yield ""
            place = f"{echo.kind} at {echo.range:.2f} m"
            yield f"{echo.object_name} ({echo.material}), {place}"
            for entry in echo.entries:
                yield line(entry.label, entry.db, "dB")
            yield line("received", echo.received, "dBm")
            yield line("noise", self.noise, "dBm")
            yield line("signal to noise", echo.received - self.noise, "dB")
        if not self.echoes:
            yield "nothing comes back"


def print_budget(
    scanner: RangeScanner, scene: Scene, pose: Pose3, azimuth: int, as_json: bool
) -> None:
    """Print the link budget of a direction.

    Raises:
        click.BadParameter: If the sensor is no FMCW radar, or has no such direction.
    """
    try:
        budget = link_budget(scanner.fmcw, scene, pose, azimuth)
    except PresetError as error:
        raise click.BadParameter(str(error)) from None
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--beam") from None
    if as_json:
        click.echo(json.dumps(asdict(budget)))
    else:
        print_lines(budget.lines())


def link_budget(radar: FmcwRadar, scene: Scene, pose: Pose3, azimuth: int) -> Budget:
    """Return the link budget of a direction.

    Args:
        radar: The radar.
        scene: The map.
        pose: Pose of the antenna, map frame.
        azimuth: Number of the direction, 0 to A - 1.

    Raises:
        ValueError: If there is no such direction.
    """
    it = radar.settings
    if not 0 <= azimuth < it.azimuths:
        raise ValueError(f"azimuth {azimuth}, expected 0 to {it.azimuths - 1}")
    common = [
        Entry("transmitted", it.transmit_dbm),
        Entry("lines and radome", -it.loss_db),
        Entry("antenna gain, out and back", 2 * _db(directivity(it))),
        Entry("wavelength^2 / (4 pi)^3", _db(it.wavelength**2 / (4 * math.pi) ** 3)),
        Entry("solid angle of the beam", _db(beam_solid_angle(it))),
    ]
    angle = float(radar.angles[azimuth])
    ahead: Floats = np.array([[math.cos(angle), math.sin(angle), 0.0]])
    directions = ahead @ pose.rotation().T
    rays = Rays(
        pose.position()[None, :].copy(),
        directions / np.linalg.norm(directions),
        np.full(1, it.max_range),
        np.full(1, radar.full_power),
        np.zeros(1, np.uint8),
        np.full(1, -1, np.int64),
        (radar.ray_class,),
    )
    tracer = tracer_of(scene)
    incidence = float(tracer.trace(rays, incidence=True).incidence[0])
    scattering = scene_scattering(tracer, radar.ray_class).parts
    losses = _Losses(radar, tracer.parts)
    echoes = []
    for event in tracer.explain(rays)[0]:
        losses.advance(event)
        echo = _echo_of(event, incidence, scattering, radar)
        if echo is not None:
            kind, label, gamma = echo
            part = tracer.parts[event.part]  # without robots in the scene
            own = [Entry(f"1 / R^2 at {event.t:.2f} m", -20 * math.log10(event.t))]
            # Twice, as losses are counted one way and an echo comes back the same way.
            own += [Entry(f"lost in {name}", -2 * db) for name, db in losses.by_name()]
            own.append(Entry(label, _db(gamma)))
            received = sum(entry.db for entry in [*common, *own])
            name, material = part.object_name, part.material.name
            echoes.append(EchoBudget(name, material, kind, event.t, own, received))
        losses.take(event)
    return Budget(azimuth, angle, common, float(dbm_of(noise_power(it))), echoes)


def beam_solid_angle(settings: FmcwSettings) -> float:
    """Return the integral of the two-way pattern, sr."""
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
    """Return the kind of an echo, what it is due to, and its gamma; or None."""
    resolution = radar.settings.resolution
    per_db = radar.ray_class.power_per_db
    # Robots share the last row.
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
        # A volume returns into every bin that the ray passes: here the first of them.
        gamma = float(part["volume"] * resolution)
        label = f"backscatter of the first {resolution:.2f} m"
        return ("volume", label, gamma) if gamma > 0 else None
    if event.kind is EventKind.SHEET:
        loss = event.absorbed / per_db
        gamma = float(part["albedo"] * (1 - 10 ** (-loss / 10)))
        return ("sheet", "backscatter of a sheet", gamma) if gamma > 0 else None
    return None


class _Losses:
    """What each material has taken from a ray so far."""

    def __init__(self, radar: FmcwRadar, parts: Sequence[Part]) -> None:
        self._per_db = radar.ray_class.power_per_db
        self._power = radar.full_power
        self._parts = parts
        self._inside: list[int] = []
        self._lost: dict[str, float] = {}  # dB

    def advance(self, event: Event) -> None:
        """Add what was lost on the way to an event."""
        # Where volumes overlap, the last entered one is named.
        self._add(self._inside[-1] if self._inside else None, self._power - event.power)
        self._power = event.power

    def take(self, event: Event) -> None:
        """Add what is lost at an event, and note what the ray is in."""
        if event.kind in (EventKind.ENTER, EventKind.START_INSIDE):
            self._inside.append(event.part)
        elif event.kind is EventKind.LEAVE and event.part in self._inside:
            self._inside.remove(event.part)
        elif event.kind is EventKind.MIRRORED:
            self._inside.clear()
        if event.kind in (EventKind.SHEET, EventKind.MIRRORED):
            self._add(event.part, event.absorbed)
            self._power -= event.absorbed

    def by_name(self) -> Iterable[tuple[str, float]]:
        """Return the losses so far by names of materials, dB one way."""
        return self._lost.items()

    def _add(self, part: int | None, power: float) -> None:
        name = "air" if part is None else self._parts[part].material.name
        if power > 0:
            self._lost[name] = self._lost.get(name, 0.0) + power / self._per_db


def _db(ratio: float) -> float:
    return 10 * math.log10(ratio) if ratio > 0 else -math.inf
