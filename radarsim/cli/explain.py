"""``radarsim explain``: the volumes, mirrors and surfaces that one beam meets."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click
import numpy as np
from annotated_types import Ge

from radarsim import plugins
from radarsim.cli.fields import MapName
from radarsim.cli.output import print_lines
from radarsim.cli.scan import PlacedSensor
from radarsim.plans import RARE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from radarsim.raycast.rays import Event
    from radarsim.scene.scene import Part, Scene
    from radarsim.sensors.range_scanner import RangeScanner
    from radarsim.sensors.scan import Scan


def explain(
    map_: MapName,
    plan: PlacedSensor,
    *,
    beam: Annotated[int, Ge(0)],
    format_: Literal["text", "json"] = "text",
    budget: Annotated[bool, RARE] = False,
) -> None:
    """Print everything that one beam meets.

    Args:
        map_: A map file or the name of a shipped map; MAP@VARIANT selects a variant.
        plan: The sensor and its pose.
        beam: Number of the beam; the rightmost beam is 0.
        format_: Output format.
        budget: Print the link budget of an FMCW radar in dB; --beam then counts the
            azimuths clockwise, from 0 straight ahead.
    """
    from radarsim.rng import generator_for
    from radarsim.scene.map_file import load_map

    scanner = plan.load_scanner()
    scene = load_map(map_)
    pose = plan.find_pose(scene)
    if budget:
        print_budget = plugins.load("radarsim.explanations", "budget")
        print_budget(scanner, scene, pose, beam, format_ == "json")
        return
    beams = scanner.settings.beams
    if beam >= beams:
        text = f"{beam}, expected 0 to {beams - 1}"
        raise click.BadParameter(text, param_hint="--beam")
    scan = scanner.scan(scene, pose, generator_for(plan.seed, plan.sensor))
    explanation = explain_beam(scene, scanner, scan, beam)
    if format_ == "json":
        click.echo(json.dumps(explanation, allow_nan=False))
    else:
        print_lines(as_text(explanation))


def explain_beam(
    scene: Scene, scanner: RangeScanner, scan: Scan, beam: int
) -> dict[str, Any]:
    """Return all volumes, mirrors and surfaces that a beam met, as data for JSON.

    Args:
        scene: The scene that was scanned.
        scanner: The scanner.
        scan: A scan by this scanner.
        beam: Number of the beam.
    """
    from radarsim.raycast.rays import EventKind
    from radarsim.raycast.tracer import tracer_of

    settings, tracer = scanner.settings, tracer_of(scene)
    cast = scan.cast.take(np.array([beam]))
    events = tracer.explain(cast)[0]
    one, power = 1.0, settings.penetration_power
    if scan.targets is not None:  # rays of a detector have power in decibels
        one = cast.ray_classes[0].power_per_db
        power = float(cast.power[0]) / one
        events = [
            replace(each, power=each.power / one, absorbed=each.absorbed / one)
            for each in events
        ]
    echoes, targets = scan.echoes, None
    if scan.targets is not None:
        rows = np.flatnonzero(scan.targets.beams == beam)
        targets = [
            {
                "range": float(scan.targets.ranges[k]),
                "dbm": float(scan.targets.dbm[k]),
                "rcs_dbsm": float(scan.targets.rcs_dbsm[k]),
                "snr_db": float(scan.targets.snr_db[k]),
            }
            for k in rows
        ]
    rain = (echoes.beams == beam) & (echoes.kinds == EventKind.RAIN)
    cloud = echoes.answers_in_clouds().get(beam)
    # A detector always reads the spectrum of all rays of a beam.
    together = echoes.settings.combines_rays and scan.targets is None
    return {
        "sensor": scanner.name,
        "beam": beam,
        "angle": float(scanner.angles[beam]),
        "ray": None if scan.rays is None else int(scan.rays[beam]),
        "one_of": echoes.settings.rays_per_beam if together else 1,
        "origin": cast.origins[0].tolist(),
        "direction": cast.directions[0].tolist(),
        **_explain_events(events, tracer.parts, power),
        # The reading may differ from the distance at which this ray ends.
        "range": _finite(float(scan.ranges[beam])),
        "rain": float(echoes.ranges[rain][0]) if rain.any() else None,
        "cloud": cloud.name if cloud else None,
        "return_mode": settings.return_mode,
        "detector": settings.detector,
        "targets": targets,
        "air": tracer.losses(scan.cast.ray_classes[0])[1] / one,
    }


def _explain_events(
    events: Sequence[Event], parts: Sequence[Part], power: float
) -> dict[str, Any]:
    """Return the volumes that a ray crossed, and how the ray ended."""
    from radarsim.raycast.rays import EventKind

    crossings: list[dict[str, Any]] = []
    entered: dict[int, dict[str, Any]] = {}  # volumes that the ray is in, by part
    mirrors: list[dict[str, Any]] = []
    for event in events[:-1]:
        part, before = parts[event.part], _finite(event.power)
        after = _finite(event.power - event.absorbed)
        what = {"object": part.object_name, "material": part.material.name}
        powers = {"power_before": before, "power_after": after}
        if event.kind is EventKind.MIRRORED:
            place = {"at": event.t, "position": list(event.position)}
            mirrors.append({**what, **place, **powers})
        elif event.kind is EventKind.LEAVE:
            entered.pop(event.part).update(exit=event.t, power_after=before)
        else:
            is_sheet = event.kind is EventKind.SHEET
            row = {
                **what,
                "starts_inside": event.kind is EventKind.START_INSIDE,
                "entry": event.t,
                "exit": event.t if is_sheet else None,
                "power_before": before,
                "power_after": after if is_sheet else before,
            }
            crossings.append(row)
            if not is_sheet:
                entered[event.part] = row
    end = events[-1]
    # The ray ended inside these volumes, so there is no event with the power at their
    # exit.
    for row in entered.values():
        row["power_after"] = _finite(end.power)
    # The power that is left after the absorption at the end of the ray.
    left = _finite(end.power - end.absorbed)
    if end.kind is EventKind.ABSORBED:
        left = 0.0
    return {
        "power": _finite(power),
        "crossings": crossings,
        "mirrors": mirrors,
        "outcome": end.kind.name.lower(),
        "distance": end.t,
        "object": parts[end.part].object_name if end.part >= 0 else None,
        "material": parts[end.part].material.name if end.part >= 0 else None,
        "power_left": left,
    }


def _finite(value: float) -> float | None:
    """Return a finite number unchanged; None otherwise, as JSON has no infinity."""
    return value if math.isfinite(value) else None


def as_text(report: dict[str, Any]) -> list[str]:
    """Return an explanation as sentences, one per line."""
    names = {None: "", -1: ", right ray", 0: ", centre ray", 1: ", left ray"}
    ray = names[report["ray"]]
    degrees = math.degrees(report["angle"])
    if report["one_of"] > 1:
        ray += f", one of {report['one_of']} that answer together"
    # With a detector, ``power`` is the maximum one-way loss of a ray, dB.
    full = report["power"] if report["targets"] is not None else None
    lines = [f"{report['sensor']}, beam {report['beam']} at {degrees:.2f} deg{ray}"]
    if full is None:
        lines.append(f"sent with power {_power_text(report['power'])}")
    else:
        lines.append(f"followed to a loss of {full:.1f} dB one way")
    if report["air"]:
        taken = f"{report['air']:.6f} {'of power' if full is None else 'dB'} per metre"
        lines.append(f"everywhere: the air takes {taken}")
    met = [(row["entry"], _crossing_text(row, full)) for row in report["crossings"]]
    met += [(row["at"], _mirror_text(row, full)) for row in report["mirrors"]]
    if report["rain"] is not None:
        met.append((report["rain"], f"{report['rain']:.4f} m: rain shows"))
    lines += [text for _, text in sorted(met, key=lambda event: event[0])]
    end = f"{report['distance']:.4f} m"
    part = f"{report['object']} ({report['material']})"
    endings = {
        "hit": f"{end}: hits {part}",
        "spent": f"{end}: spent in {part}",
        "out_of_range": f"{end}: out of range",
        "absorbed": f"{end}: absorbed by {part}",
    }
    left = report["power_left"]
    if full is None:
        rest = f"power left {_power_text(left)}"
    else:
        rest = f"loss {full - left:.1f} dB"
    lines.append(f"{endings[report['outcome']]}, {rest}")
    if report["targets"] is not None:
        lines += [
            f"{target['range']:.4f} m: a target of {target['dbm']:.1f} dBm"
            for target in report["targets"]
        ]
        detector = f" by its detector {report['detector']!r}"
    else:
        detector = ""
    return [*lines, _reading_text(report) + detector]


def _reading_text(report: dict[str, Any]) -> str:
    """Return the reading of a beam as a sentence."""
    if report["range"] is None:
        return "reads nothing"
    mirrored = any(row["at"] < report["range"] for row in report["mirrors"])
    ghost = ", a ghost: it was mirrored on its way" if mirrored else ""
    mode = report["return_mode"]
    found = "echo" if report["targets"] is None else "target"
    which = f", its {mode} {found}" if mode in ("first", "strongest") else ""
    inside = f", from inside {report['cloud']}" if report["cloud"] else ""
    return f"reads {report['range']:.4f} m{which}{inside}{ghost}"


def _crossing_text(row: dict[str, Any], full: float | None) -> str:
    entry = f"{row['entry']:.4f} m: enters"
    enters = "starts inside" if row["starts_inside"] else entry
    leaves = "stays in" if row["exit"] is None else f"leaves at {row['exit']:.4f} m"
    volume = f"{row['object']} ({row['material']})"
    return f"{enters} {volume}, {leaves}, {_change_text(row, full)}"


def _mirror_text(row: dict[str, Any], full: float | None) -> str:
    x, y, z = row["position"]
    mirror = f"{row['object']} ({row['material']}) at ({x:.2f}, {y:.2f}, {z:.2f})"
    return f"{row['at']:.4f} m: mirrored by {mirror}, {_change_text(row, full)}"


def _change_text(row: dict[str, Any], full: float | None) -> str:
    """Return a change of power as text; if ``full`` is given, as losses in dB."""
    before, after = row["power_before"], row["power_after"]
    if full is None:
        return f"power {_power_text(before)} to {_power_text(after)}"
    return f"loss {full - before:.1f} to {full - after:.1f} dB"


def _power_text(power: float | None) -> str:
    return "unlimited" if power is None else f"{power:.4f}"
