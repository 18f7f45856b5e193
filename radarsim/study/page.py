"""The page of the study: its summary, the figure, and a table for each map."""

from collections.abc import Sequence
from html import escape
from typing import Final

from radarsim import __version__
from radarsim.figures.page import GENERATOR
from radarsim.figures.page_style import STYLE
from radarsim.study.findings import percent, percent_interval, ratio, successes
from radarsim.study.results import TITLES, Summaries, Summary, kinds_of
from radarsim.study.statistics import Estimate
from radarsim.study.tasks import BEAMS, DRIVING_TIME, MAPPED, MAPPING_TIME, SENSORS

TITLE: Final = "Radar against lasers: who finds the way, and who maps what"
_TABLE_STYLE: Final = """
  main { max-width: 60rem; margin: 0 auto; }
  table { border-collapse: collapse; margin: .5rem 0 2rem; font-size: .92rem; }
  th, td { padding: .25rem .8rem .25rem 0; text-align: right; white-space: nowrap;
           border-bottom: 1px solid var(--line); }
  th:first-child { text-align: left; }
  td small { color: var(--quiet); }
  div.wide { overflow-x: auto; }
"""
_INTERVALS: Final = (
    "Intervals are of 95 %: Wilson's for shares of runs, Student's t for means."
)
_NO_INTERVALS: Final = "There are no intervals: each sensor ran once on each map."
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


def render_study(
    summaries: Summaries,
    sentences: Sequence[str],
    *,
    figure: str,
    headline: str,
    algorithm: str,
    seeds: int,
) -> str:
    """Return the page as HTML.

    Args:
        summaries: The runs of each sensor on each kind of map.
        sentences: The summary; names in backquotes are code.
        figure: Name of the figure's file.
        headline: What the figure shows, in words.
        algorithm: Algorithm of the drives.
        seeds: Number of seeds.
    """
    kinds = kinds_of(summaries)
    said = escape(" ".join(headline.split()))
    items = "".join(f"<li>{_marked(text)}</li>\n" for text in sentences)
    tables = "".join(_section(summaries, map_) for map_ in kinds)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{GENERATOR}
<title>{TITLE}</title>
<style>{STYLE}{_TABLE_STYLE}</style>
</head>
<body>
<main>
<h1>{TITLE}</h1>
<ul>
{items}</ul>
<p class="picture"><img src="{figure}" alt="{said}"></p>
<h2>How</h2>
<p>Maps of {_counted(len(kinds), "kind")}, each drawn anew for
{_counted(seeds, "seed")}; every sensor runs on the same maps.
All sensors look all the way round, with a beam every {BEAMS["resolution_deg"]}°.
The robot, a P3AT, drives to a goal with <code>{escape(algorithm)}</code> for at most
{DRIVING_TIME:g} s{_exploring(kinds)}. It keeps the safety distance that
<code>radarsim navigate</code> chooses for the sensor when it asks
for echoes: 0.5 m with each of the four.</p>
<p>A verdict is right if the robot reaches the goal, or tells that there is no path
where a disc as wide as its diagonal finds none. A passage that is wide enough for the
robot, but not for its safety distance, therefore gives a false "no path".
{_INTERVALS if seeds > 1 else _NO_INTERVALS}</p>
{tables}<p>Made by radarsim {__version__}. Runs are rows of <code>runs.csv</code>.</p>
</main>
</body>
</html>
"""


def _counted(count: int, name: str) -> str:
    return f"{count} {name}" + "s" * (count != 1)


def _exploring(kinds: Sequence[str]) -> str:
    """Return where robots explore; empty if nowhere."""
    mapped = [kind for kind in kinds if kind in MAPPED]
    if not mapped:
        return ""
    where = f"{_counted(len(mapped), 'kind')} of maps with walls around"
    return f", and explores for {MAPPING_TIME:g} s in the {where}"


def _section(summaries: Summaries, map_: str) -> str:
    rows = "".join(_row(summaries[map_, sensor], map_) for sensor in SENSORS)
    known = "".join(f"<th>{name}</th>" for name in _known_columns(map_))
    title = TITLES[map_]
    return (
        f'<h2 id="{map_}">{title[0].upper()}{title[1:]}</h2>\n<p>{_ABOUT[map_]}</p>\n'
        '<div class="wide"><table>\n<tr><th>sensor</th><th>right verdicts</th>'
        "<th>false no path</th><th>no verdict</th><th>touches</th>"
        f"<th>path by shortest</th>{known}</tr>\n{rows}</table></div>\n"
    )


def _known_columns(map_: str) -> tuple[str, ...]:
    if map_ not in MAPPED:
        return ()
    hidden = ("hidden floor",) if map_ == "hidden_room" else ()
    return ("reachable floor", *hidden, "walls in place")


def _row(summary: Summary, map_: str) -> str:
    known: list[Estimate | None] = []
    if map_ in MAPPED:
        known = [summary.reachable, summary.walls]
        if map_ == "hidden_room":
            known.insert(1, summary.hidden)
    right = f"{successes(summary.success)}{_interval(summary.success)}"
    counts = (summary.false_no_path, summary.failed, summary.touches)
    cells = [
        right,
        *map(str, counts),
        ratio(summary.detour) or "-",
        *(
            "-" if each is None else f"{percent(each)}{_interval(each)}"
            for each in known
        ),
    ]
    columns = "".join(f"<td>{cell}</td>" for cell in cells)
    return f"<tr><th>{summary.sensor}</th>{columns}</tr>\n"


def _interval(estimate: Estimate) -> str:
    text = percent_interval(estimate)
    return f" <small>{text}</small>" if text else ""


def _marked(text: str) -> str:
    """Return text as HTML, with what is in backquotes as code."""
    parts = escape(text, quote=False).split("`")
    return "".join(
        f"<code>{part}</code>" if number % 2 else part
        for number, part in enumerate(parts)
    )
