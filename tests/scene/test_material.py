import pytest

from radarsim.scene.material import Material


@pytest.mark.parametrize(
    ("material", "penetrable"),
    [
        pytest.param(Material("concrete"), False, id="opaque"),
        pytest.param(Material("foliage", density=0.7), True, id="to the radar"),
        pytest.param(Material("glass", laser_density=0.0), True, id="to the laser"),
    ],
)
def test_penetrable_is_what_radar_or_laser_enters(
    material: Material, penetrable: bool
) -> None:
    assert material.penetrable is penetrable
