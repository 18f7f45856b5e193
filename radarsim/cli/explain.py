"""``radarsim explain``: everything that one beam meets."""

import json
from enum import StrEnum
from typing import Annotated

import typer

from radarsim import plugins
from radarsim.cli.legacy_sensor import load_scanner, load_scene_and_pose
from radarsim.cli.options import (
    MapArgument,
    SeedOption,
    SensorOption,
    SensorPoseOption,
    SensorSettingsOption,
    SensorStartOption,
)
from radarsim.cli.output import print_lines


class Ray(StrEnum):
    """Which ray of a beam to explain."""

    DRAWN = "drawn"
    RIGHT = "right"
    CENTRE = "centre"
    LEFT = "left"


class ExplanationFormat(StrEnum):
    """Output formats of an explanation."""

    TEXT = "text"
    JSON = "json"


def explain(
    map_: MapArgument,
    *,
    sensor: SensorOption,
    beam: Annotated[
        int, typer.Option(min=0, help="Number of the beam, from 0 at the right.")
    ],
    start: SensorStartOption = None,
    pose: SensorPoseOption = None,
    settings: SensorSettingsOption = None,
    seed: SeedOption = 0,
    ray: Annotated[
        Ray,
        typer.Option(help="The ray that 'scan' draws with this seed, or another one."),
    ] = Ray.DRAWN,
    budget: Annotated[
        bool,
        typer.Option(
            "--budget",
            help="Print the link budget of an FMCW radar in dB; --beam is its azimuth,"
            " clockwise from 0 straight ahead.",
        ),
    ] = False,
    format_: Annotated[
        ExplanationFormat, typer.Option("--format", help="Output format.")
    ] = ExplanationFormat.TEXT,
) -> None:
    """Print everything that one beam meets."""
    from radarsim.cli.explain_report import as_text, explain_beam, with_single_ray
    from radarsim.rng import generator_for

    scanner = load_scanner(sensor, settings)
    scene, sensor_pose = load_scene_and_pose(map_, start=start, pose=pose)
    if budget:
        print_budget = plugins.load("radarsim.explanations", "budget")
        print_budget(scanner, scene, sensor_pose, beam, format_ == "json")
        return
    beams = scanner.settings.beams
    if beam >= beams:
        raise typer.BadParameter(
            f"{beam}, expected 0 to {beams - 1}", param_hint="--beam"
        )
    if ray is not Ray.DRAWN:
        scanner = with_single_ray(scanner, ray.value)
    scan = scanner.scan(scene, sensor_pose, generator_for(seed, sensor))
    explanation = explain_beam(scene, scanner, scan, beam)
    if format_ is ExplanationFormat.JSON:
        typer.echo(json.dumps(explanation, allow_nan=False))
    else:
        print_lines(as_text(explanation))
