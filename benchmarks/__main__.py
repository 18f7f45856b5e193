"""Measure the engine and the server: ``python -m benchmarks [GROUP...]``.

A group is a letter, such as ``a``; without one, all run, which takes a few minutes. It
needs the extras ``record`` and ``gym``.
"""

import sys
from collections.abc import Callable, Iterator
from typing import Final

from benchmarks import engine, hosts, servers
from benchmarks.timing import Row

GROUPS: Final[dict[str, tuple[str, tuple[Callable[[], Iterator[Row]], ...]]]] = {
    "a": (
        "a radar scan against one raw first-hit call on as many rays",
        (lambda: engine.scans_against_first_hits(2.0),),
    ),
    "c": ("scans per second, and threads", (lambda: engine.throughput(2.0),)),
    "d": (
        "what a scan costs as scenes and beams grow",
        (lambda: engine.growth(0.4),),
    ),
    "e": (
        "the server over loopback TCP",
        (lambda: servers.lateness(10.0), lambda: servers.capacity(2.0)),
    ),
    "f": ("start-up", (servers.start_up,)),
    "g": (
        "beams of many rays, against as many scans that draw one of these rays",
        (lambda: engine.beams_against_rays(1.0),),
    ),
    "h": ("mirrors, and leaves", (lambda: engine.mirrors_and_leaves(1.0),)),
    "i": ("clients that flood the server", (lambda: hosts.floods(200),)),
    "j": (
        "many driving robots, Host.step and take",
        (lambda: hosts.driving_robots(2.0), lambda: hosts.growth_of_robots(2.0)),
    ),
    "k": (
        "a map of one closed mesh, made ready for rays, against trimesh and embreex",
        (lambda: engine.mesh_maps(5.0),),
    ),
    "l": ("viewers of the commander", (lambda: servers.commander(10.0),)),
    "m": ("recording a server", (lambda: servers.recording(10.0),)),
    "n": ("environments for learning", (lambda: hosts.decisions(2.0),)),
    "o": (
        "a radar that turns, beside plain robots",
        (lambda: servers.turning_radar(10.0),),
    ),
    "p": (
        "a turn of an FMCW radar, against tracing its rays and FFTs",
        (lambda: engine.turns_of_a_radar(4.0),),
    ),
    "q": (
        "what a client receives, against float() of each range in it",
        (lambda: hosts.decoding(2.0),),
    ),
}


def main(letters: list[str]) -> None:
    """Run groups, and print their rows as they come."""
    if unknown := set(letters) - GROUPS.keys():
        sys.exit(f"unknown groups {sorted(unknown)}, expected some of {[*GROUPS]}")
    for letter in letters or GROUPS:
        title, steps = GROUPS[letter]
        print(f"\n({letter}) {title}")
        for step in steps:
            for row in step():
                print(row, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
