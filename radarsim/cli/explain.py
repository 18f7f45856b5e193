"""``radarsim explain``: the life of one beam."""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import typer

from radarsim.cli.scan import Request
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Event
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.scene import Part
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.scan import Scan

RAYS = {"right": RIGHT, "centre": CENTRE, "left": LEFT}
ENDS = {
    EventKind.HIT: "hit",
    EventKind.SPENT: "spent",
    EventKind.OUT_OF_RANGE: "out_of_range",
    EventKind.ABSORBED: "absorbed",
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
    together = scanner.settings.rays_per_beam if ray == "drawn" else 1
    together *= scanner.settings.combines_rays
    if ray != "drawn":
        scanner = _with_only(scanner, ray)
    scan = scanner.scan(scene, pose, rng)
    cast = scan.cast
    one = cast.take(np.array([beam]))
    tracer = tracer_of(scene)
    events = tracer.explain(one)[0]
    told = {
        "sensor": scanner.name,
        "beam": beam,
        "angle": float(scanner.angles[beam]),
        "ray": None if scan.rays is None else int(scan.rays[beam]),
        "one_of": max(together, 1),
        "origin": one.origins[0].tolist(),
        "direction": one.directions[0].tolist(),
        **explanation(events, tracer.parts, scanner.settings.penetration_power),
    }
    # a beam need not read where one of its rays ends
    told["range"] = _number(float(scan.ranges[beam]))
    told["rain"] = rain_at(scan, beam)
    told["return_mode"] = scanner.settings.return_mode
    told["air"] = tracer.densities(scan.cast.ray_classes[0])[1]
    if form == "json":
        typer.echo(json.dumps(told, allow_nan=False))
    else:
        typer.echo("\n".join(as_text(told)))


def _with_only(scanner: RangeScanner, ray: str) -> RangeScanner:
    """Give the same scanner with one ray of three.

    Raises:
        typer.BadParameter: If its beams have not three rays.
    """
    settings = scanner.settings
    count = settings.rays_per_beam
    if settings.has_side_rays and settings.side_mode != "cone":
        weights = tuple(float(side == RAYS[ray]) for side in (RIGHT, CENTRE, LEFT))
        update = {"ray_weights": weights, "ray_choice": "drawn"}
        return RangeScanner(scanner.name, settings.model_copy(update=update))
    if count == 1 and ray == "centre":
        return scanner
    expected = "drawn or centre" if count == 1 else "drawn"
    raise typer.BadParameter(
        f"{ray!r}, expected {expected}: {scanner.name}'s beams have {count}"
        f" {'ray' if count == 1 else 'rays'}",
        param_hint="--ray",
    )


def rain_at(scan: Scan, beam: int) -> float | None:
    """Give where rain shows in a beam, m; None where it does not, or is not kept."""
    echoes = scan.echoes
    rows = (echoes.beams == beam) & (echoes.kinds == EventKind.RAIN)
    return float(echoes.ranges[rows][0]) if rows.any() else None


def explanation(
    events: Sequence[Event], parts: Sequence[Part], power: float
) -> dict[str, Any]:
    """Pair entries with exits, and say how a ray of that power ended."""
    crossings: list[dict[str, Any]] = []
    open_: dict[int, dict[str, Any]] = {}
    mirrors: list[dict[str, Any]] = []
    for event in events[:-1]:
        if event.kind is EventKind.SHEET:
            crossings.append(_sheet_row(event, parts))
        elif event.kind is EventKind.MIRRORED:
            mirrors.append(_mirror_row(event, parts))
        elif event.kind is EventKind.LEAVE:
            open_.pop(event.part).update(exit=event.t, power_after=_power(event))
        else:
            open_[event.part] = _row(event, parts)
            crossings.append(open_[event.part])
    end = events[-1]
    for row in open_.values():
        row["power_after"] = _power(end)
    return {
        "power": _number(power),
        "crossings": crossings,
        "mirrors": mirrors,
        "outcome": ENDS[end.kind],
        "distance": end.t,
        "object": parts[end.part].object_name if end.part >= 0 else None,
        "material": parts[end.part].material.name if end.part >= 0 else None,
        "power_left": _left(end),
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


def _sheet_row(event: Event, parts: Sequence[Part]) -> dict[str, Any]:
    after = _number(event.power - event.absorbed)
    return {**_row(event, parts), "exit": event.t, "power_after": after}


def _mirror_row(event: Event, parts: Sequence[Part]) -> dict[str, Any]:
    part = parts[event.part]
    return {
        "object": part.object_name,
        "material": part.material.name,
        "at": event.t,
        "position": list(event.position),
        "power_before": _power(event),
        "power_after": _number(event.power - event.absorbed),
    }


def _left(end: Event) -> float | None:
    """Give what is left of a ray where it ends, and what is kept there is gone."""
    if end.kind is EventKind.ABSORBED:
        return 0.0
    return _number(end.power - end.absorbed)


def _power(event: Event) -> float | None:
    return _number(event.power)


def _number(power: float) -> float | None:
    """Give a power as JSON can hold it; None for an infinite one."""
    return power if math.isfinite(power) else None


def as_text(told: dict[str, Any]) -> list[str]:
    """Tell the same in sentences."""
    ray = {None: "", -1: ", right ray", 0: ", centre ray", 1: ", left ray"}[told["ray"]]
    degrees = math.degrees(told["angle"])
    if told["one_of"] > 1:
        ray += f", one of {told['one_of']} that answer together"
    lines = [
        f"{told['sensor']}, beam {told['beam']} at {degrees:.2f} deg{ray}",
        f"leaves with power {_shown(told['power'])}",
    ]
    if told["air"]:
        lines.append(f"everywhere: the air takes {told['air']:.6f} of it per metre")
    met = [(row["entry"], _crossing_text(row)) for row in told["crossings"]]
    met += [(row["at"], _mirror_text(row)) for row in told["mirrors"]]
    if told["rain"] is not None:
        met.append((told["rain"], f"{told['rain']:.4f} m: rain shows"))
    lines += [text for _, text in sorted(met, key=lambda found: found[0])]
    where = f"{told['distance']:.4f} m"
    what = f"{told['object']} ({told['material']})"
    ends = {
        "hit": f"{where}: hits {what}",
        "spent": f"{where}: spent in {what}",
        "out_of_range": f"{where}: out of range",
        "absorbed": f"{where}: absorbed by {what}",
    }
    lines.append(f"{ends[told['outcome']]}, power left {_shown(told['power_left'])}")
    if told["range"] is None:
        return [*lines, "reads nothing"]
    mirrored = any(row["at"] < told["range"] for row in told["mirrors"])
    ghost = ", a ghost: it was mirrored on its way" if mirrored else ""
    mode = told["return_mode"]
    which = f", its {mode} echo" if mode in ("first", "strongest") else ""
    return [*lines, f"reads {told['range']:.4f} m{which}{ghost}"]


def _crossing_text(row: dict[str, Any]) -> str:
    way = "starts inside" if row["starts_inside"] else f"{row['entry']:.4f} m: enters"
    out = "stays in" if row["exit"] is None else f"leaves at {row['exit']:.4f} m"
    before, after = _shown(row["power_before"]), _shown(row["power_after"])
    what = f"{row['object']} ({row['material']})"
    return f"{way} {what}, {out}, power {before} to {after}"


def _mirror_text(row: dict[str, Any]) -> str:
    x, y, z = row["position"]
    before, after = _shown(row["power_before"]), _shown(row["power_after"])
    what = f"{row['object']} ({row['material']}) at ({x:.2f}, {y:.2f}, {z:.2f})"
    return f"{row['at']:.4f} m: mirrored by {what}, power {before} to {after}"


def _shown(power: float | None) -> str:
    return "unlimited" if power is None else f"{power:.4f}"
