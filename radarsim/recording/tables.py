"""Recordings as datasets of xarray, and as tables of Parquet."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from radarsim.atomic_write import write_atomically
from radarsim.optional_packages import import_optional
from radarsim.recording.series import EchoSeries, PoseSeries, ScanSeries

if TYPE_CHECKING:
    import xarray

    from radarsim.recording.recording import Recording

POSE: Final = ("x", "y", "z", "roll", "pitch", "yaw")
EXTRA: Final = "tables"

Columns = dict[str, Any]


def tree_of(recording: "Recording") -> "xarray.DataTree":
    """Return a recording as a tree; see ``Recording.to_xarray``."""
    package = import_optional("xarray", EXTRA)

    def dataset(dimension: str, columns: Columns, frame: str) -> "xarray.Dataset":
        variables = {name: (dimension, column) for name, column in columns.items()}
        found: xarray.Dataset = package.Dataset(variables, attrs={"frame": frame})
        return found.set_coords("time")

    groups = {}
    for name, scans in recording.scans.items():
        groups[f"/{name}/scan"] = package.Dataset(
            {"ranges": (("time", "angle"), scans.ranges, {"units": "m"})},
            {"time": scans.times, "angle": scans.angles},
            {
                "frame": scans.frame,
                "range_min": scans.range_min,
                "range_max": scans.range_max,
            },
        )
    for name, poses in recording.poses.items():
        groups[f"/{name}"] = dataset("time", _pose_columns(poses), poses.frame)
    for name, echoes in recording.echoes.items():
        groups[f"/{name}/echoes"] = dataset("echo", _echo_columns(echoes), echoes.frame)
    tree: xarray.DataTree = package.DataTree.from_dict(groups)
    tree.attrs = recording.info.to_text()
    return tree


def write_parquet(recording: "Recording", folder: Path) -> list[Path]:
    """Write a recording as tables; see ``Recording.to_parquet``."""
    arrow = import_optional("pyarrow", EXTRA)
    parquet = import_optional("pyarrow.parquet", EXTRA)
    tables = {
        "scans": _joined("scanner", recording.scans, _scan_columns),
        "poses": _joined("source", recording.poses, _pose_columns),
        "echoes": _joined("scanner", recording.echoes, _echo_columns),
    }
    folder.mkdir(parents=True, exist_ok=True)
    contents = {}
    for name, columns in tables.items():
        parts = [arrow.table(part) for part in columns]
        if not parts:
            continue
        table = arrow.concat_tables(parts)
        buffer = arrow.BufferOutputStream()
        parquet.write_table(table, buffer)
        contents[folder / f"{name}.parquet"] = buffer.getvalue().to_pybytes()
    write_atomically(contents)
    return list(contents)


def _joined(
    key: str, series: Mapping[str, Any], columns_of: Callable[[Any], Columns]
) -> Iterator[Columns]:
    """Yield the columns of each series, with its name in the first."""
    for name, each in series.items():
        yield {key: np.full(len(each.times), name), **columns_of(each)}


def _scan_columns(scans: ScanSeries) -> Columns:
    count = len(scans.times)
    step = scans.angles[1] - scans.angles[0] if len(scans.angles) > 1 else 0.0
    return {
        "time": scans.times,
        "angle_min": np.full(count, scans.angles[0]),
        "angle_increment": np.full(count, step),
        "range_min": np.full(count, scans.range_min),
        "range_max": np.full(count, scans.range_max),
        "ranges": list(scans.ranges),
    }


def _pose_columns(poses: PoseSeries) -> Columns:
    return {"time": poses.times, **dict(zip(POSE, poses.poses.T, strict=True))}


def _echo_columns(echoes: EchoSeries) -> Columns:
    return {
        "time": echoes.times,
        "beam": echoes.beams,
        **dict(zip("xyz", echoes.points.T, strict=True)),
        "range": echoes.ranges,
        "strength": echoes.strengths,
        "power": echoes.power,
        "kind": echoes.kinds,
        "object": echoes.objects,
        "material": echoes.materials,
    }
