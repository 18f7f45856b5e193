import math

from radarsim.geometry import Pose2
from radarsim.navigation.boundary_policy import Landmark


def test_it_is_passed_once_on_a_way_beside_it() -> None:
    mark = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    path = [Pose2(1.4, y / 10) for y in range(30)]
    passed = [pose.y for pose in path if mark.passed(pose)]
    assert passed == [1.0]


def test_against_its_direction_it_is_not_passed_onward() -> None:
    path = [Pose2(1.4, y / 10) for y in reversed(range(30))]
    onward = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    assert not any(onward.passed(pose) for pose in path)
    back = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    assert sum([back.passed(pose, onward=False) for pose in path]) == 1


def test_a_way_too_far_beside_does_not_count() -> None:
    mark = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    assert not any(mark.passed(Pose2(1.8, y / 10)) for y in range(30))


def test_standing_on_it_is_not_passing() -> None:
    mark = Landmark(Pose2(1.0, 1.0), 0.0, max_offset=0.7)
    assert not any(mark.passed(Pose2(1.0, 1.0)) for _ in range(5))
