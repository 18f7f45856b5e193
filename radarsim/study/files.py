"""The files of the study: the log of its runs, one table, one figure and one page."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from radarsim import __version__
from radarsim.atomic_write import write_atomically
from radarsim.evaluation.result_log import read_log
from radarsim.navigation.options import Algorithm
from radarsim.plotting.rendering import render
from radarsim.study.chart import draw_study
from radarsim.study.findings import headline, summary_sentences
from radarsim.study.page import render_study
from radarsim.study.results import summarise
from radarsim.study.tasks import StudyTask

LOG: Final = "runs.jsonl"
TABLE: Final = "runs.csv"
FIGURE: Final = "radar_vs_laser.png"
PAGE: Final = "index.html"
_KEYS: Final = ("version", "seed", "map", "sensor", "method", "outcome")
_COLUMNS: Final = (
    *("seed", "map", "sensor", "method", "expected", "outcome", "collisions"),
    *("path_length", "shortest_path", "time", "reachable_coverage"),
    *("hidden_coverage", "within_two_cells", "note"),
)

Row = dict[str, Any]


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
    page = render_study(
        summaries,
        sentences,
        figure=FIGURE,
        headline=headline(summaries),
        algorithm=algorithm.value,
        seeds=seeds,
    )
    write_atomically(
        {
            folder / TABLE: _table(rows).encode(),
            folder / FIGURE: render(draw_study(summaries)),
            folder / PAGE: page.encode(),
        }
    )
    return sentences


def _table(rows: Sequence[Row]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(
        text, _COLUMNS, extrasaction="ignore", lineterminator="\n", restval=""
    )
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
