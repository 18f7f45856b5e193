from pathlib import Path

import pytest

from radarsim.errors import MapError
from radarsim.scene.map_file import load_map, load_variants
from radarsim.scene.scene import GPS_ORIGIN

pytestmark = pytest.mark.usefixtures("mesh_folder")


def write(line: str) -> None:
    Path("m.yaml").write_text(f"version: 1\n{line}\nvariants:\n  wet: {{air: }}\n")


def test_map_may_have_a_place_on_the_globe() -> None:
    write("gps_origin_deg: [52.3559, 4.9553]")
    assert [s.gps_origin for s in load_variants("m.yaml")] == [(52.3559, 4.9553)] * 2


def test_place_is_that_of_the_original_server_by_default() -> None:
    write("level: DM-Here")
    assert load_map("m.yaml").gps_origin == GPS_ORIGIN
    assert pytest.approx((39.13379, -77.21663), abs=1e-5) == GPS_ORIGIN


@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        pytest.param("[90, 0]", "2:18: gps_origin_deg.0: 90, expected at most 89"),
        pytest.param("[0, 181]", "2:21: gps_origin_deg.1: 181, expected at most 180"),
    ],
)
def test_problem_of_the_place_is_reported_with_what_was_expected(
    origin: str, expected: str
) -> None:
    write(f"gps_origin_deg: {origin}")
    with pytest.raises(MapError) as caught:
        load_map("m.yaml")
    (problem,) = caught.value.problems
    assert problem.startswith(f"m.yaml:{expected}")
