"""Scans in words: what one sees, and how it was measured."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from radarsim.plotting.annotations import as_words
from radarsim.plotting.sight import Sight
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.sensors.scan import Scan


def describe_scans(who: str, scans: Sequence[Scan], sight: Sight) -> str:
    """Return the title of a picture: what one sees in it.

    Args:
        who: The sensor, and where it is.
        scans: One or more scans of one sensor.
        sight: How the beams of the first one see.
    """
    scan = scans[0]
    if len(scans) > 1:
        return f"{who}: {_count_all(scans)}"
    beams = len(scan.ranges)
    if blinded := int(np.count_nonzero(scan.ranges == 0)):
        return f"{who}: {blinded} of {beams} beams are blinded"
    if through := int(sight.through.sum()):
        return f"{who}: {through} of {beams} beams see through {sight.words}"
    stopped = Counter(_penetrable_readings(scan))
    if stopped:
        ((material, count),) = stopped.most_common(1)
        name = as_words(material)
        return f"{who}: {name} stops {count} of {beams} beams, none sees through"
    read = int(np.count_nonzero(np.isfinite(scan.ranges)))
    return f"{who}: {read} of {beams} beams read something"


def _count_all(scans: Sequence[Scan]) -> str:
    if scans[0].echoes.settings.return_mode == "all":
        return f"{sum(len(s.echoes) for s in scans)} echoes of {len(scans)} scans"
    read = sum(int(np.isfinite(scan.ranges).sum()) for scan in scans)
    return f"{read} readings of {len(scans)} scans"


def _penetrable_readings(scan: Scan) -> list[str]:
    """Return the material of each echo from something that some beams can enter."""
    echoes, parts = scan.echoes, scan.echoes.scene_parts
    names = []
    for part in echoes.parts.tolist():
        if part < len(parts):
            material = parts[part].material
            if material.penetrable or material.sheet_loss is not None:
                names.append(material.name)
    return names


def describe_beams(scans: Sequence[Scan]) -> str:
    """Return the parameters of scans in small print: pose, beams, echoes, returns."""
    scan = scans[0]
    beyond = sum(int(np.count_nonzero(~np.isfinite(s.ranges))) for s in scans)
    blind = sum(int(np.count_nonzero(s.ranges == 0)) for s in scans)
    counted = f"{len(scans)} scans of " if len(scans) > 1 else ""
    counted += f"{len(scan.ranges)} beams, {beyond} without return"
    counted += f", {blind} blinded" if blind else ""
    return (
        f"sensor at x {scan.pose.x:.2f} m, y {scan.pose.y:.2f} m,"
        f" yaw {math.degrees(scan.pose.yaw):.0f}°; section at z {scan.pose.z:.2f} m;"
        f" {counted}; {_beams(scan.echoes.settings)}"
    )


def _beams(settings: SensorSettings) -> str:
    """Describe the rays of a beam and the echoes that it keeps."""
    mode = settings.return_mode
    echoes = "all echoes" if mode == "all" else f"{mode} echo"
    if not settings.has_side_rays:
        return echoes
    answer = "together" if settings.combines_rays else "one drawn"
    if settings.side_mode == "cone":
        return f"cone of {settings.cone_rays} rays, {answer}, {echoes}"
    return f"N = {settings.side_offset_uu:g} {settings.side_mode}, {answer}, {echoes}"
