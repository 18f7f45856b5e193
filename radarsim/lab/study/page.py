"""The page of the study: its summary, the figure, and a table for each map.

Beside it the study writes the log of its runs, one table and one figure.
"""

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from radarsim import __version__
from radarsim.autonomy.evaluation.estimates import Estimate
from radarsim.autonomy.evaluation.task_runner import read_log
from radarsim.autonomy.evaluation.trials import GOAL_TOLERANCE
from radarsim.autonomy.mapping.occupancy_grid import RESOLUTION
from radarsim.autonomy.navigation.algorithms import ROBOT_RADIUS, Algorithm
from radarsim.autonomy.navigation.plans import TOLERANCE
from radarsim.files import PAGE_MARK, write_atomically
from radarsim.lab.study.findings import (
    draw_study,
    headline,
    number_text,
    percent,
    percent_interval,
    successes,
    summary_sentences,
)
from radarsim.lab.study.maps import (
    BEAMS,
    DRIVING_TIME,
    MAPPED,
    MAPPING_TIME,
    SENSORS,
    StudyTask,
)
from radarsim.lab.study.results import (
    TITLES,
    Summaries,
    Summary,
    bare_title,
    kinds_of,
    summarise,
)
from radarsim.lab.study.style import STYLE
from radarsim.plotting.style import render

TITLE: Final = "Radar against lasers: who finds the way, and who maps what"
_TABLE_STYLE: Final = """
  main { max-width: 60rem; margin: 0 auto; }
  table { border-collapse: collapse; margin: .5rem 0; font-size: .92rem; }
  th, td { padding: .25rem .8rem .25rem 0; text-align: right;
           vertical-align: bottom; border-bottom: 1px solid var(--line); }
  td, th:first-child { white-space: nowrap; }
  th:first-child { text-align: left; }
  h2 { margin-top: 2rem; }
  code { padding: 0 .2rem; background: var(--code); border-radius: .2rem; }
  p.answer, dt { font-weight: bold; }
  td small { color: var(--quiet); }
  div.wide { overflow-x: auto; }
"""
_INTERVALS: Final = (
    "Intervals are of 95 %: Wilson's for shares of runs, Student's t for means; those"
    " of shares are cut at 0 and at 100 %. Where all values are equal, a mean has none."
)
_NO_INTERVALS: Final = "There are no intervals: each sensor ran once on each map."
_QUESTION: Final = (
    "Does a radar that sees through foliage and smoke find its way, and map, better"
    " than a laser?"
)
_MODELS: Final = (
    "What smoke and bushes do to each sensor is assumed by the simulator, not measured,"
    " and what the page tells of them follows from that. Foliage stops every laser at"
    " the first leaf; the last echo of a real one may come through a gap between leaves"
    " and from behind. All but the Hokuyo reach 80 m."
)
_ALGORITHMS: Final = {
    "planned": "draws what it sees into a grid and takes the cheapest path over it to"
    " the goal, planned again twice a second",
}
_NOTHING: Final = "-"
_ABOUT: Final = {
    "smoke_corridor": "Smoke fills a corridor from wall to wall for 3 to 5 m. The robot"
    " can drive through it.",
    "hidden_room": "Bushes divide a room from wall to wall. The robot cannot pass, so"
    ' "no path" is the right verdict; what lies behind them can only be seen.',
    "dead_end": "A hedge crosses a yard. Behind the nearer one of its two gaps is a"
    " pocket of hedge that leads nowhere.",
    "thin_bushes": "Bushes and hedges that a radar looks through. In some maps the goal"
    " is fenced in.",
    "forest": "Trunks of 10 to 50 cm. In some maps the goal is fenced in.",
    "office": "Six rooms with doors of all widths, some of them too narrow.",
}
LOG: Final = "runs.jsonl"
TABLE: Final = "runs.csv"
FIGURE: Final = "radar_vs_laser.png"
PAGE: Final = "index.html"
_KEYS: Final = ("version", "seed", "map", "sensor", "method", "outcome")
_COLUMNS: Final = (
    "seed",
    "map",
    "sensor",
    "method",
    "expected",
    "outcome",
    "collisions",
    "path_length",
    "shortest_path",
    "time",
    "reachable_coverage",
    "hidden_coverage",
    "within_two_cells",
    "note",
)
Row = dict[str, Any]


def _how(kinds: Sequence[str], algorithm: str, seeds: int) -> str:
    """Return as HTML what runs, and what is measured."""
    drives = f"<code>{escape(algorithm)}</code>"
    if algorithm in _ALGORITHMS:
        drives += f", which {_ALGORITHMS[algorithm]}"
    explores = shares = ""
    sensors = "".join(
        f"<dt>{name}</dt><dd>{_marked(sensor.about)}</dd>\n"
        for name, sensor in SENSORS.items()
    )
    if mapped := [kind for kind in kinds if kind in MAPPED]:
        where = " and ".join(f"in the {bare_title(kind)}" for kind in mapped)
        explores = f". I{where[1:]} it also explores, for {MAPPING_TIME:g} s"
        shares = (
            "Reachable floor is the mapped share of the floor that the robot can get"
            " to, hidden floor that of the floor where it would fit, but that it"
            " cannot get to. Obstacles in place are the share of the cells mapped as"
            f" obstacles, bushes too, that lie within two cells ({2 * RESOLUTION:g} m)"
            " of a true one.\n"
        )
    return f"""<p>Maps of {_counted(len(kinds), "kind")}, each drawn anew for
{_counted(seeds, "seed")}; every sensor runs on the same maps.
All sensors look all the way round, with a beam every {BEAMS["resolution_deg"]}°.</p>
<dl>
{sensors}</dl>
<p>{_MODELS}</p>
<p>The robot, a P3AT, drives to a goal with {drives}, for at most
{DRIVING_TIME:g} s{explores}. Unless it is told otherwise above, it asks its scanner for
echoes: not only how far each beam gets, but everything that it meets on the way. What
blocks a robot then counts where a beam first meets it, even if the beam goes on. The
robot keeps 0.5 m from its centre to what it senses, with every sensor; along planned
paths it keeps less, and drives slowly, where only its hull fits in.</p>
<p>A verdict is right if the robot reaches the goal, or tells that there is no path
where there is none for a disc of {ROBOT_RADIUS:g} m radius, half the robot's diagonal.
A passage that is wide enough for the disc, but not for what the robot keeps, therefore
gives a false "no path". A drive has no verdict if the robot would not start, because
something seems to be too near, if it gets stuck, or if its time is up. Each time that
the robot begins to touch something is a touch, in explorations too; a drive that
touches something is not right.</p>
<p>Path / shortest path is of the drives that arrived; n is their number where it
is not that of the seeds. The shortest path is that of the disc. The factor may be a
little below 1, because a drive ends when the robot is within {TOLERANCE:g} m of the
goal by the inertial sensor, which drifts; up to {GOAL_TOLERANCE:g} m in truth count.
Less the radar's: the mean difference to the radar's factor on the same map, where both
arrived. Time is simulated, of the drives that arrived.
{shares}{_INTERVALS if seeds > 1 else _NO_INTERVALS}</p>
"""


def _counted(count: int, name: str) -> str:
    return f"{count} {name}" + "s" * (count != 1)


def _section(summaries: Summaries, map_: str) -> str:
    each = [summaries[map_, sensor] for sensor in SENSORS]
    columns = [
        (name, cells)
        for name, cells in _columns(each, map_).items()
        if any(cell != _NOTHING for cell in cells)
    ]
    head = "".join(f"<th>{name}</th>" for name, _ in columns)
    lines = zip(*(cells for _, cells in columns), strict=True)
    rows = "".join(
        f"<tr><th>{sensor}</th>{''.join(f'<td>{cell}</td>' for cell in line)}</tr>\n"
        for sensor, line in zip(SENSORS, lines, strict=True)
    )
    title = TITLES[map_]
    notes = " ".join(_notes(each))
    return (
        f'<h2 id="{map_}">{title[0].upper()}{title[1:]}</h2>\n<p>{_ABOUT[map_]}</p>\n'
        f'<div class="wide"><table>\n<tr><th>sensor</th>{head}</tr>\n{rows}</table>'
        f"</div>\n" + f"<p>{escape(notes)}</p>\n" * bool(notes)
    )


def _columns(summaries: Sequence[Summary], map_: str) -> dict[str, list[str]]:
    """Return the cells below each heading, a cell for each sensor."""
    columns = {
        "right verdicts": [_share(each.success, successes) for each in summaries],
        'false "no path"': [str(each.false_no_path) for each in summaries],
        "no verdict": [str(each.failed) for each in summaries],
        "touches": [str(each.touches) for each in summaries],
        "path / shortest path": [_mean(each.detour, each) for each in summaries],
        "less the radar's": [
            _mean(each.detour_difference, each, "{:+z.2f}") for each in summaries
        ],
        "time": [
            _NOTHING if each.time is None else f"{each.time.value:.0f} s"
            for each in summaries
        ],
    }
    if map_ in MAPPED:
        columns["reachable floor"] = [_share(each.reachable) for each in summaries]
        if map_ == "hidden_room":
            columns["hidden floor"] = [_share(each.hidden) for each in summaries]
        columns["obstacles in place"] = [_share(each.in_place) for each in summaries]
    return columns


def _notes(summaries: Sequence[Summary]) -> Iterator[str]:
    """Yield what the table of a kind of maps does not tell: how runs ended."""
    failed = [
        f"{each.sensor} "
        + " and ".join(
            f"{reason} in {_counted(count, 'drive')}"
            for reason, count in sorted(each.failures.items())
        )
        for each in summaries
        if each.failures
    ]
    if failed:
        yield f"No verdict: {', '.join(failed)}."
    late = [
        f"{each.sensor} {each.timed_out} of {each.explorations}"
        for each in summaries
        if each.timed_out
    ]
    if late:
        yield f"Explorations that ended at the time limit: {', '.join(late)}."
    # Only where all sensors were shut in: then the map is the reason, and no sensor.
    for seed in sorted(set.intersection(*(set(each.shut_in) for each in summaries))):
        shares = sorted({f"{100 * e.shut_in[seed]:.0f}" for e in summaries}, key=int)
        mapped = " to ".join(dict.fromkeys((shares[0], shares[-1])))
        yield (
            f"In the map of seed {seed} no robot leaves the room where it starts, whose"
            " door is wide enough for the disc, but not for the safety distance:"
            f" {mapped} % of the floor are mapped, and that"
            " makes the intervals of the reachable floor wide."
        )


def _share(
    estimate: Estimate | None, write: Callable[[Estimate], str] = percent
) -> str:
    if estimate is None:
        return _NOTHING
    interval = percent_interval(estimate)
    return write(estimate) + (f" <small>{interval}</small>" if interval else "")


def _mean(estimate: Estimate | None, summary: Summary, form: str = "{:.2f}") -> str:
    value, blank, rest = number_text(estimate, summary, form).partition(" ")
    return f"{value}{blank}<small>{rest}</small>" if rest else value or _NOTHING


def _marked(text: str) -> str:
    """Return text as HTML, with what is in backquotes as code."""
    parts = escape(text, quote=False).split("`")
    return "".join(
        f"<code>{part}</code>" if number % 2 else part
        for number, part in enumerate(parts)
    )


def read_runs(folder: Path) -> dict[StudyTask, Row]:
    """Read the runs that a study has made before.

    Raises:
        OSError: If the log cannot be read.
        ValueError: If it is none, or is of another version of radarsim.
    """
    log = folder / LOG
    rows = read_log(log, _KEYS, "a run of a study")
    for number, row in enumerate(rows, 1):
        if row["version"] != __version__:
            raise ValueError(
                f"{log}:{number}: a run of radarsim {row['version']!r}, expected"
                f" {__version__}; choose another folder"
            )
    return {
        StudyTask(row["seed"], row["map"], row["sensor"], row["method"]): row
        for row in rows
    }


def write_study(
    folder: Path, rows: Sequence[Row], *, algorithm: Algorithm, seeds: int
) -> list[str]:
    """Write table, figure and page; the same runs give the same bytes.

    Args:
        folder: The folder.
        rows: All runs, in the order of their tasks.
        algorithm: Algorithm of the drives.
        seeds: Number of seeds.

    Returns:
        The summary in sentences.

    Raises:
        OSError: If a file cannot be written.
    """
    summaries = summarise(rows)
    sentences = summary_sentences(summaries)
    table = io.StringIO()
    # Rows of drives and of explorations have different keys.
    writer = csv.DictWriter(
        table, _COLUMNS, extrasaction="ignore", lineterminator="\n", restval=""
    )
    writer.writeheader()
    writer.writerows(rows)
    kinds = kinds_of(summaries)
    answer = escape(headline(summaries))
    items = "".join(f"<li>{escape(text)}</li>\n" for text in sentences)
    tables = "".join(_section(summaries, map_) for map_ in kinds)
    page = f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{PAGE_MARK}
<title>{TITLE}</title>
<style>{STYLE}{_TABLE_STYLE}</style>
</head>
<body>
<main>
<h1>{TITLE}</h1>
<p>{_QUESTION}</p>
<p class="answer">{answer}.</p>
<ul>
{items}</ul>
<p class="picture"><img src="{FIGURE}" alt="{answer}"></p>
<h2>How</h2>
{_how(kinds, algorithm.value, seeds)}{tables}<p>Made by radarsim {__version__}.
Runs are rows of <code>{TABLE}</code>.</p>
</main>
</body>
</html>
"""
    # The page comes last, as it names the other two.
    write_atomically(
        {
            folder / TABLE: table.getvalue().encode(),
            folder / FIGURE: render(draw_study(summaries)),
            folder / PAGE: page.encode(),
        }
    )
    return sentences
