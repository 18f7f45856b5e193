"""What one beam of a scan met, by the echoes that came with that very scan."""

import math
from typing import Any, Final

from radarsim.addons.web.requests import BadRequest, Explain
from radarsim.addons.web.robot_view import RobotView, SeenScan
from radarsim.client.robot_info import no_return

ENDS: Final = ("hit", "spent", "rain")  # kinds of echoes that may end a beam
OUT_OF_RANGE: Final = "out_of_range"
_WORDS: Final = {
    "enter": "enters",
    "leave": "leaves",
    "sheet": "passes a sheet of",
    "hit": "hits",
    "spent": "spent in",
    "rain": "rain shows in",
}


def explain_beam(robot: RobotView, request: Explain) -> dict[str, Any]:
    """Return the message that explains a beam.

    Raises:
        BadRequest: If there is no such scan or beam, or its echoes were not told.
    """
    seen = robot.find_scan(request.scanner, request.t)
    if seen is None:
        at = "" if request.t is None else f" at {request.t:g} s"
        raise BadRequest(f"no scan of {request.scanner!r}{at} is remembered")
    count = len(seen.scan.ranges)
    if request.beam >= count:
        raise BadRequest(f"beam {request.beam}, expected 0 to {count - 1}")
    if seen.echoes is None:
        raise BadRequest(f"no echoes of {request.scanner!r} came with that scan")
    max_range = robot.scanner(request.scanner).max_range
    rows = _rows(seen, request.beam)
    reading = float(seen.scan.ranges[request.beam])
    has_return = reading < no_return(max_range)
    end = _end(rows, reading if has_return else None)
    return {
        "op": "explanation",
        "robot": robot.name,
        "scanner": seen.scan.name,
        "beam": request.beam,
        "angle": _angle(seen, request.beam),
        "t": seen.scan.time,
        "rows": rows,
        "end": end,
        "text": _text(rows, end),
    }


def _rows(seen: SeenScan, beam: int) -> list[dict[str, Any]]:
    """Return all echoes of a beam, the nearest first."""
    rows = [
        {
            "range": float(target.ranges[i]),
            "kind": target.kinds[i],
            "object": target.object,
            "material": target.material,
            "power": float(target.power[i]),
        }
        for target in seen.echoes or ()
        for i in (target.beams == beam).nonzero()[0].tolist()
    ]
    return sorted(rows, key=lambda row: row["range"])


def _end(rows: list[dict[str, Any]], reading: float | None) -> dict[str, Any]:
    """Return what the beam reads, and the kind of echo that this is."""
    if reading is None:
        return {"range": None, "kind": OUT_OF_RANGE}
    ends = [row for row in rows if row["kind"] in ENDS]
    near = (row for row in ends if math.isclose(row["range"], reading, abs_tol=0.02))
    row = next(near, ends[-1] if ends else None)
    return {"range": reading, "kind": "hit" if row is None else row["kind"]}


def _angle(seen: SeenScan, beam: int) -> float:
    """Return the angle of a beam, rad to the left of the scanner's front."""
    gaps = len(seen.scan.ranges) - 1
    return -seen.scan.fov / 2 + (beam * seen.scan.fov / gaps if gaps else 0.0)


def _text(rows: list[dict[str, Any]], end: dict[str, Any]) -> str:
    """Return the explanation as sentences, one a line."""
    lines = [
        f"{row['range']:.2f} m: {_WORDS.get(row['kind'], row['kind'])}"
        f" {row['object']} ({row['material']}), power {row['power']:.4f}"
        for row in rows
    ]
    reads = "nothing" if end["range"] is None else f"{end['range']:.2f} m"
    return "\n".join([*lines, f"reads {reads}"])
