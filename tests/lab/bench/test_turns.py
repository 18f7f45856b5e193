from radarsim.lab.bench.addons import turns_of_a_radar


def test_turn_is_measured_against_its_rays_and_transforms() -> None:
    (row,) = turns_of_a_radar(0.01)
    assert row.name == "400 x 3768 bins in foliage_room"
    assert row.value > 1
    assert row.limit == 5
