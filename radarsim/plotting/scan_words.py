"""Scans in words: what one sees, and how it was measured."""

import math
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from radarsim.plotting.annotations import as_words
from radarsim.plotting.sight import Sight, lets_beams_in, name_materials
from radarsim.sensors.scan import Scan


def describe_scans(scans: Sequence[Scan], sights: Sequence[Sight]) -> str:
    """Return the title of a picture: what one sees in it.

    Args:
        scans: One or more scans of one sensor.
        sights: How their beams see.
    """
    beams = len(scans[0].ranges)
    many = f", in {len(scans)} scans" if len(scans) > 1 else ""
    blinded = [int(np.count_nonzero(scan.ranges == 0)) for scan in scans]
    if any(blinded):
        return f"{_span(blinded)} of {beams} beams are blinded{many}"
    through = [int(sight.through.sum()) for sight in sights]
    if any(through):
        materials = (material for sight in sights for material in sight.materials)
        words = name_materials(materials)
        meeting = [int(np.count_nonzero(sight.meeting)) for sight in sights]
        seeing = f"{_span(through)} of {beams} beams see through {words}"
        if min(meeting) < beams:
            met = f"{_span(meeting)} beams that meet {words}"
            seeing = f"{_span(through)} of the {met} see through it"
        held = any((sight.stopped & sight.meeting).any() for sight in sights)
        seeing += _with_target(scans[0], "their")
        return f"{seeing}{many}" if held else f"{seeing}, none is stopped{many}"
    pairs = zip(scans, sights, strict=True)
    stopped = [Counter(_penetrable_readings(*pair)) for pair in pairs]
    if total := sum(stopped, Counter()):
        ((material, _),) = total.most_common(1)
        count = _span([each[material] for each in stopped])
        name = as_words(material)
        seeing = f"none sees through{_with_target(scans[0], 'its')}"
        return f"{name} stops {count} of {beams} beams, {seeing}{many}"
    read = [int(np.count_nonzero(np.isfinite(scan.ranges))) for scan in scans]
    return f"{_span(read)} of {beams} beams read something{many}"


def _with_target(scan: Scan, whose: str) -> str:
    """Return which target of a beam counts, if a detector has found them; or nothing.

    A beam has several, and may see through something with another one.
    """
    return "" if scan.targets is None else f" with {whose} {_read_target(scan)} target"


def _read_target(scan: Scan) -> str:
    mode = scan.echoes.settings.return_mode
    return {"all": "farthest", "last": "farthest", "first": "nearest"}.get(mode, mode)


def _span(counts: Sequence[int]) -> str:
    """Return the least and the greatest of some counts, or the one that all are.

    >>> _span([5, 3, 4]), _span([2, 2])
    ('3 to 5', '2')
    """
    least, most = min(counts), max(counts)
    return f"{least}" if least == most else f"{least} to {most}"


def _penetrable_readings(scan: Scan, sight: Sight) -> list[str]:
    """Return the material of each reading of something that some beams can enter."""
    if scan.targets is not None:
        return [each.name for each in sight.read if each is not None]
    echoes, parts = scan.echoes, scan.echoes.scene_parts
    names = []
    read = np.isclose(echoes.ranges, scan.ranges[echoes.beams])
    for part in echoes.parts[read].tolist():
        if part < len(parts):
            material = parts[part].material
            if lets_beams_in(material):
                names.append(material.name)
    return names


def title_scans(scans: Sequence[Scan], sights: Sequence[Sight]) -> str:
    """Return the name of the sensor and what one sees, as a title."""
    return f"{name_sensor(scans[0])}: {describe_scans(scans, sights)}"


def name_sensor(scan: Scan) -> str:
    """Return the name of a sensor as words, with its medium, such as Laser (sick)."""
    name, medium = as_words(scan.sensor), scan.echoes.settings.medium
    if re.search(rf"\b{medium}\b", name):
        return name[0].upper() + name[1:]
    return f"{medium.capitalize()} ({name})"


def describe_beams(scene: str, scans: Sequence[Scan]) -> str:
    """Return the parameters of scans in small print: pose, beams, echoes, returns.

    Args:
        scene: Name of the map.
        scans: One or more scans of one sensor in it.
    """
    scan = scans[0]
    beyond = sum(int(np.count_nonzero(~np.isfinite(s.ranges))) for s in scans)
    blind = sum(int(np.count_nonzero(s.ranges == 0)) for s in scans)
    counted = f"{len(scans)} scans of " if len(scans) > 1 else ""
    counted += f"{len(scan.ranges)} beams, {beyond} without return"
    counted += f", {blind} blinded" if blind else ""
    return (
        f"{scan.sensor} in {scene}, at x {scan.pose.x:.2f} m, y {scan.pose.y:.2f} m,"
        f" yaw {math.degrees(scan.pose.yaw):.0f}°; section at z {scan.pose.z:.2f} m;"
        f" {counted}; {_beams(scan)}"
    )


def _beams(scan: Scan) -> str:
    """Describe the rays of a beam and the echoes that it keeps."""
    settings = scan.echoes.settings
    mode = settings.return_mode
    if scan.targets is not None:
        return f"{_read_target(scan)} target of the detector {settings.detector!r}"
    echoes = "all echoes" if mode == "all" else f"{mode} echo"
    if not settings.has_side_rays:
        return echoes
    answer = "together" if settings.combines_rays else "one drawn"
    if settings.side_mode == "cone":
        return f"cone of {settings.cone_rays} rays, {answer}, {echoes}"
    return f"N = {settings.side_offset_uu:g} {settings.side_mode}, {answer}, {echoes}"
