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
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT
from radarsim.sensors.range_scanner import RangeScanner

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
    tracer = tracer_of(scene)
    plan = scanner.plan(tracer, pose, rng)
    if ray != "drawn":
        sides = np.full_like(plan.sides, RAYS[ray])
        plan = scanner.replan(plan, sides)
    one = Rays(
        *(
            getattr(plan.rays, name)[beam : beam + 1]
            for name in Rays.__dataclass_fields__
        )
    )
    events = tracer.explain(one)[0]
    told = {
        "sensor": scanner.name,
        "beam": beam,
        "angle": float(scanner.angles[beam]),
        "ray": int(plan.sides[beam]) if scanner.has_side_rays else None,
        "origin": one.origins[0].tolist(),
        "direction": one.directions[0].tolist(),
        **explanation(events, scene.parts, scanner),
    }
    if form == "json":
        typer.echo(json.dumps(told, allow_nan=False))
    else:
        typer.echo("\n".join(as_text(told)))


def explanation(
    events: Sequence[Event], parts: Sequence[Part], scanner: RangeScanner
) -> dict[str, Any]:
    """Pair entries with exits, and say how the ray ended."""
    crossings: list[dict[str, Any]] = []
    open_: dict[int, dict[str, Any]] = {}
    at, power = 0.0, scanner.settings.penetration_power
    for event in events[:-1]:
        density = sum(_density(parts[part], scanner) for part in open_)
        before = power - density * (event.t - at) if density else power
        at, power = event.t, event.power
        if event.kind in (EventKind.START_INSIDE, EventKind.ENTER, EventKind.SHEET):
            row = _row(event, parts, before)
            crossings.append(row)
            if event.kind is not EventKind.SHEET:
                open_[event.part] = row
        else:
            open_.pop(event.part).update(exit=event.t, power_after=_power(event))
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


def _density(part: Part, scanner: RangeScanner) -> float:
    radar = scanner.settings.medium == "radar"
    return part.material.density if radar else part.material.laser_density


def _row(event: Event, parts: Sequence[Part], before: float) -> dict[str, Any]:
    """Begin the row of a volume, or make that of a sheet."""
    part = parts[event.part]
    sheet = event.kind is EventKind.SHEET
    return {
        "object": part.object_name,
        "material": part.material.name,
        "starts_inside": event.kind is EventKind.START_INSIDE,
        "entry": event.t,
        "exit": event.t if sheet else None,
        "power_before": _number(before if sheet else event.power),
        "power_after": _power(event),
    }


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
