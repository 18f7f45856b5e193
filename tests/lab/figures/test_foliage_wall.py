"""What figures 6 to 10 count in the test map, as laws."""

import numpy as np
import pytest

from radarsim.lab.figures.figure import ScanSpec, hit_points, load_scene
from radarsim.lab.figures.foliage_wall import (
    STEP,
    Counts,
    bush_parts,
    count_changes,
    count_ends,
    count_moved,
    count_over_grid,
    far_side,
    hidden_parts,
    hokuyo,
    radar,
)
from radarsim.plotting.sight import BeamEnd, find_sight

ROOM = load_scene("foliage_room")


def counts_of(shot: ScanSpec) -> Counts:
    (scan,) = shot.take()
    return count_ends(shot.scene, scan)


def test_bushes_lie_between_the_start_and_the_far_side() -> None:
    assert len(bush_parts(ROOM)) == 7
    assert far_side(ROOM) == pytest.approx(1.7, abs=0.01)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_hokuyo_sees_nothing_behind_the_bushes(seed: int) -> None:
    counts = counts_of(hokuyo(seed))
    assert counts.behind == 0
    assert counts.objects == ()
    assert counts.inside > 50
    assert count_over_grid(hokuyo(seed))[1:] == (108 * 228, 0)


@pytest.mark.parametrize("offset", [0, 50, 100])
def test_radar_sees_through_edges_of_bushes_but_not_through_centres(
    offset: int,
) -> None:
    counts = counts_of(radar(0, offset))
    assert counts.behind > 0
    assert "east_wall" in counts.objects
    assert counts.inside > counts.behind


def test_count_behind_the_bushes_matches_an_independent_count() -> None:
    (scan,) = radar(0, 0).take()
    behind = hit_points(scan)[:, 0] > 1.7
    assert counts_of(radar(0, 0)).behind == behind.sum()
    foliage = [bush.object_name for bush in bush_parts(ROOM)]
    targets = scan.echoes.targets
    names = [targets[part].object for part in scan.echoes.parts.tolist()]
    assert counts_of(radar(0, 0)).inside == sum(name in foliage for name in names)


@pytest.mark.parametrize("offset", [0, 25, 100])
def test_beams_that_end_behind_are_those_that_see_through(offset: int) -> None:
    (scan,) = radar(0, offset).take()
    assert (
        counts_of(radar(0, offset)).behind
        == (find_sight(ROOM, scan).ends == BeamEnd.THROUGH).sum()
    )


def test_noise_grows_with_the_offset() -> None:
    moved, spread = {}, {}
    for offset in (0, 50, 100):
        (scan,) = radar(0, offset).take()
        moved[offset] = count_moved(scan, 0)
        shot = radar(0, offset)
        many = ScanSpec(shot.map, shot.sensor, 0, shot.settings, count=10)
        scans = many.take()
        spread[offset] = sum(count_changes(ROOM, scans))
        ranges = np.array([one.ranges for one in scans])
        assert spread[offset] == (np.ptp(ranges, axis=0) > STEP).sum()
    assert moved[0] == spread[0] == 0
    assert 0 < moved[50] < moved[100]
    assert 0 < spread[50] < spread[100]


def test_changing_beams_ahead_meet_bushes_and_those_aside_meet_walls() -> None:
    shot = radar(0, 100)
    scans = ScanSpec(shot.map, shot.sensor, 0, shot.settings, count=10).take()
    changes = count_changes(ROOM, scans)
    assert min(changes) > 0
    aside = np.abs(np.degrees(scans[0].angles))
    assert changes.jumping + changes.deep <= (aside < 42).sum()
    assert changes.slanting <= (aside > 36).sum()
    assert count_changes(ROOM, scans[:1] * 2) == (0, 0, 0)


def test_four_objects_are_behind_the_bushes() -> None:
    names = {part.object_name for part in hidden_parts(ROOM)}
    assert names == {"crate_low", "crate_high", "cabinet", "pole"}
