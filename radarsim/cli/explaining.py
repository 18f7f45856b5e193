"""``radarsim explain``: the life of one beam."""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import typer

from radarsim.cli.scanning import Request
from radarsim.raycast.penetration import EventKind
from radarsim.raycast.rays import Event, Rays
from radarsim.raycast.tracers import tracer_of
from radarsim.scene.scene import Part
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT, Sides
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.scan import Scan

RAYS = {"right": RIGHT, "centre": CENTRE, "left": LEFT}
ENDS = {
    EventKind.HIT: "hit",
    EventKind.SPENT: "spent",
    EventKind.OUT_OF_RANGE: "out_of_range",
}


def write_explanation(request: Request, *, beam: int, ray: str, form: str) -> None:
    """Follow one beam and print everything that it met.

    Raises:
        MapError: If the map is wrong.
        typer.BadParameter: If an option is.
    """
    scene, scanner, pose, rng = request.read()
    if beam >= scanner.settings.beams:
        raise typer.BadParameter(
            f"{beam}, expected 0 to {scanner.settings.beams - 1}", param_hint="--beam"
        )
    scan = scanner.scan(scene, pose, rng)
    sides, cast = _rays(scanner, scan, ray)
    one = cast.take(np.array([beam]))
    events = tracer_of(scene).explain(one)[0]
    told = {
        "sensor": scanner.name,
        "beam": beam,
        "angle": float(scanner.angles[beam]),
        "ray": None if sides is None else int(sides[beam]),
        "origin": one.origins[0].tolist(),
        "direction": one.directions[0].tolist(),
        **explanation(events, scene.parts, scanner),
    }
    if ray == "drawn":  # a beam need not read where one of its rays ends
        told["range"] = _number(float(scan.ranges[beam]))
    if form == "json":
        typer.echo(json.dumps(told, allow_nan=False))
    else:
        typer.echo("\n".join(as_text(told)))


def _rays(scanner: RangeScanner, scan: Scan, ray: str) -> tuple[Sides | None, Rays]:
    """Give a ray of each beam: those that gave the ranges, or all on one side."""
    if ray == "drawn":
        return scan.rays, scan.cast
    if not scanner.has_side_rays:
        return None, scan.cast
    try:
        return scanner.one_ray(scan.pose, RAYS[ray])
    except ValueError:
        count = scanner.settings.rays_of_a_beam
        raise typer.BadParameter(
            f"{ray!r}, expected drawn: {scanner.name}'s beams have {count} rays",
            param_hint="--ray",
        ) from None


def explanation(
    events: Sequence[Event], parts: Sequence[Part], scanner: RangeScanner
) -> dict[str, Any]:
    """Pair entries with exits, and say how the ray ended."""
    crossings: list[dict[str, Any]] = []
    open_: dict[int, dict[str, Any]] = {}
    for event in events[:-1]:
        if event.kind is EventKind.SHEET:
            crossings.append(_sheet_row(event, parts, scanner))
        elif event.kind is EventKind.LEAVE:
            open_.pop(event.part).update(exit=event.t, power_after=_power(event))
        else:
            open_[event.part] = _row(event, parts)
            crossings.append(open_[event.part])
    end = events[-1]
    for row in open_.values():
        row["power_after"] = _power(end)
    blind = end.kind is EventKind.SPENT and scanner.settings.spent_reads == "zero"
    found = None if end.kind is EventKind.OUT_OF_RANGE else end.t
    return {
        "power": _number(scanner.settings.penetration_power),
        "crossings": crossings,
        "outcome": ENDS[end.kind],
        "range": 0.0 if blind else found,
        "distance": end.t,
        "object": parts[end.part].object_name if end.part >= 0 else None,
        "material": parts[end.part].material.name if end.part >= 0 else None,
        "power_left": _power(end),
    }


def _row(event: Event, parts: Sequence[Part]) -> dict[str, Any]:
    """Begin the row of a volume."""
    part = parts[event.part]
    return {
        "object": part.object_name,
        "material": part.material.name,
        "starts_inside": event.kind is EventKind.START_INSIDE,
        "entry": event.t,
        "exit": None,
        "power_before": _power(event),
        "power_after": _power(event),
    }


def _sheet_row(
    event: Event, parts: Sequence[Part], scanner: RangeScanner
) -> dict[str, Any]:
    loss = parts[event.part].material.sheet_loss or 0.0
    if scanner.settings.medium == "laser":
        loss = 0.0  # a sheet that lets light through takes none
    after = _number(max(event.power - loss, 0.0))
    return {**_row(event, parts), "exit": event.t, "power_after": after}


def _power(event: Event) -> float | None:
    return _number(event.power)


def _number(power: float) -> float | None:
    """Give a power as JSON can hold it; None for an infinite one."""
    return power if math.isfinite(power) else None


def as_text(told: dict[str, Any]) -> list[str]:
    """Tell the same in sentences."""
    ray = {None: "", -1: ", right ray", 0: ", centre ray", 1: ", left ray"}[told["ray"]]
    degrees = math.degrees(told["angle"])
    lines = [
        f"{told['sensor']}, beam {told['beam']} at {degrees:.2f} deg{ray}",
        f"leaves with power {_shown(told['power'])}",
    ]
    for row in told["crossings"]:
        way = (
            "starts inside" if row["starts_inside"] else f"{row['entry']:.4f} m: enters"
        )
        out = "stays in" if row["exit"] is None else f"leaves at {row['exit']:.4f} m"
        before, after = _shown(row["power_before"]), _shown(row["power_after"])
        lines.append(
            f"{way} {row['object']} ({row['material']}), {out},"
            f" power {before} to {after}"
        )
    where = f"{told['distance']:.4f} m"
    what = f"{told['object']} ({told['material']})"
    ends = {
        "hit": f"{where}: hits {what}",
        "spent": f"{where}: spent in {what}",
        "out_of_range": f"{where}: out of range",
    }
    lines.append(f"{ends[told['outcome']]}, power left {_shown(told['power_left'])}")
    reads = "nothing" if told["range"] is None else f"{told['range']:.4f} m"
    return [*lines, f"reads {reads}"]


def _shown(power: float | None) -> str:
    return "unlimited" if power is None else f"{power:.4f}"
