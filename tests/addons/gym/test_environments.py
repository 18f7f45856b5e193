"""Environments of Gymnasium and PettingZoo keep their rules and the simulation's."""

import math
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from pettingzoo.test import parallel_api_test, parallel_seed_test

from radarsim.addons.gym import GoToEnv, ParallelEnv, Transition, VectorEnv
from radarsim.errors import RadarsimError
from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import load_robot
from radarsim.scene.scene import Scene
from radarsim.simulation.simulation import Simulation

FAST: dict[str, Any] = {"sensor_settings": {"fov_deg": 20}}  # 21 beams
ACROSS: dict[str, Any] = {"start": (-3.0, 0.0, 0.0), "goal": (3.0, 0.0)}

CLOSED_MAP = """
version: 1
objects:
  - {name: floor, box: [12, 12, 0.2], position: [0, 0, -0.1], material: concrete}
  - {name: north, box: [10, 0.2, 2], position: [0, 3, 1], material: concrete}
  - {name: south, box: [10, 0.2, 2], position: [0, -3, 1], material: concrete}
  - {name: east, box: [0.2, 6, 2], position: [5, 0, 1], material: concrete}
  - {name: west, box: [0.2, 6, 2], position: [-5, 0, 1], material: concrete}
  - {name: middle, box: [0.2, 6, 2], position: [0, 0, 1], material: concrete}
starts:
  - {name: RobotStart1, position: [-2.5, 0, 0]}
"""


@pytest.fixture
def two_rooms(tmp_path: Path) -> str:
    """A room with a start, and one next to it to which no way leads."""
    path = tmp_path / "two_rooms.yaml"
    path.write_text(CLOSED_MAP, encoding="utf-8")
    return str(path)


def actions_of(count: int, robots: int = 1, seed: int = 5) -> Any:
    """Draw actions that mostly drive forward, (count, robots, 2)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.3, 1.0, (count, robots, 2)).astype(np.float32)


@pytest.mark.parametrize("name", ["GoTo-v0", "Hedge-v0", "Smoke-v0"])
def test_registered_environments_keep_the_rules_of_gymnasium(name: str) -> None:
    env = gymnasium.make(f"radarsim.gym:radarsim/{name}", **FAST)
    check_env(
        env.unwrapped, skip_render_check=True
    )  # for which ``human`` needs a display


def test_power_and_rays_are_observed_where_wanted(foliage_room: Scene) -> None:
    settings: dict[str, Any] = {
        "map": foliage_room,
        "start": (-1.5, 1.0, 0.0),
        "goal": (3.0, 0.0),
        "sensor_settings": {"fov_deg": 90, "penetration_power": 2.0},
    }
    made = gymnasium.make(
        "radarsim.gym:radarsim/GoTo-v0",
        beam_values=("power", "rays"),
        **settings,
    )
    env: Any = made.unwrapped
    check_env(env, skip_render_check=True)
    seen, _ = env.reset(seed=4)
    plain, _ = GoToEnv(**settings).reset(seed=4)
    assert seen.keys() - plain.keys() == {"power", "rays"}
    for name, values in plain.items():
        np.testing.assert_array_equal(values, seen[name])
    pose = load_robot("P3AT").scanner_pose(Pose3(-1.5, 1.0, 0.0))
    scan = env.task.arena.scanner.scan(foliage_room, pose, np_random(4)[0])
    np.testing.assert_array_equal(seen["rays"], scan.rays)
    echoes = scan.echoes  # the last of each beam
    left = np.zeros(91)
    left[echoes.beams] = echoes.power / 2
    np.testing.assert_allclose(seen["power"], left, rtol=1e-6)
    assert {-1.0, 0.0, 1.0} == {*seen["rays"].tolist()}
    assert (left == 0).any()
    assert ((left > 0) & (left < 1)).any()


def test_beams_of_two_robots_are_read_as_those_of_one() -> None:
    settings: dict[str, Any] = {"beam_values": ["rays", "power"], **FAST}
    parallel = ParallelEnv(2, map="foliage_room", **settings)
    seen, _ = parallel.reset(seed=2)
    assert parallel.observation_space("robot_0").contains(seen["robot_0"])
    laser = GoToEnv(robot="P3AT_SICK", **settings)
    read, _ = laser.reset(seed=2)
    assert not read["rays"].any()
    assert {*read["power"].tolist()} <= {0.0, 1.0}


def test_robot_moves_as_in_the_simulation(foliage_room: Scene) -> None:
    env = GoToEnv(map=foliage_room, start=(-1.5, 1.0, 0.0), goal=(8.0, 0.0), **FAST)
    env.reset(seed=1)
    simulation = Simulation(foliage_room)
    vehicle = simulation.spawn("R1", load_robot("P3AT"), Pose2(-1.5, 1.0, 0.0))
    assert vehicle is not None
    spin = vehicle.robot.wheel_drive.max_spin
    touched = []
    for (action,) in actions_of(60):
        *_, info = env.step(action)
        vehicle.robot.drive(*(float(a) * spin for a in action))
        for _ in range(10):
            simulation.step()
        pose = vehicle.robot.pose
        assert info["pose"].tolist() == [pose.x, pose.y, pose.yaw]
        touched.append(info["touched"])
    assert any(touched)
    assert not touched[0]


def test_more_robots_and_other_maps_change_nothing_for_a_robot() -> None:
    maps = ["empty_room", "foliage_room"]
    few = VectorEnv(2, map=maps, **FAST)
    many = VectorEnv(5, map=maps, **FAST)
    few.reset(seed=9), many.reset(seed=9)
    for action in actions_of(20, 5):
        seen, _, _, _, infos = few.step(action[:2])
        seen_of_many, _, _, _, infos_of_many = many.step(action)
        np.testing.assert_array_equal(seen["ranges"], seen_of_many["ranges"][:2])
        np.testing.assert_array_equal(infos["pose"], infos_of_many["pose"][:2])


@pytest.mark.parametrize("beam_values", [(), ("power",)])
def test_some_of_many_robots_on_other_maps_are_reset(
    beam_values: tuple[str, ...],
) -> None:
    settings: dict[str, Any] = {"max_steps": 7, "beam_values": beam_values, **FAST}
    maps = ["empty_room", "foliage_room", "empty_room"]
    together = VectorEnv(3, map=maps, **settings)
    alone = SyncVectorEnv(
        [partial(GoToEnv, map=map_, **settings) for map_ in maps],
        autoreset_mode=AutoresetMode.NEXT_STEP,
    )
    masks = np.random.default_rng(3).uniform(size=(25, 3)) < 0.3
    together.reset(seed=4), alone.reset(seed=4)
    for action, mask in zip(actions_of(25, 3), masks, strict=True):
        np.testing.assert_equal(together.step(action), alone.step(action))
        if mask.any():
            found: Any = together.reset(options={"reset_mask": mask, "goal": (1, 2)})
            # Gymnasium takes the mask out of the options.
            options = {"reset_mask": mask.copy(), "goal": (1, 2)}
            np.testing.assert_equal(found, alone.reset(options=options))
            np.testing.assert_array_equal(found[1]["_pose"], mask)
    found = together.reset(seed=[7, 8, 9], options={"reset_mask": masks[0] | True})
    np.testing.assert_equal(found, alone.reset(seed=[7, 8, 9]))


@pytest.mark.parametrize(
    "mask", [[True], np.ones(2), np.zeros(2, bool), np.ones((2, 1), bool), None]
)
def test_wrong_masks_are_reported(mask: Any) -> None:
    envs = VectorEnv(2, **FAST)
    envs.reset()
    with pytest.raises(
        ValueError, match=r"reset_mask of shape .*, expected shape \(2,"
    ):
        envs.reset(options={"reset_mask": mask})


def test_step_before_reset_is_an_error() -> None:
    single, vector = GoToEnv(**FAST), VectorEnv(2, map=["empty_room"] * 2, **FAST)
    ahead = np.ones(2, np.float32)
    with pytest.raises(ResetNeeded, match="called before reset"):
        single.step(ahead)
    with pytest.raises(ResetNeeded, match="called before reset"):
        vector.step(np.ones((2, 2), np.float32))
    with pytest.raises(ResetNeeded, match="before the first reset of all"):
        vector.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded, match="called before reset"):
        ParallelEnv(2, **FAST).step({"robot_0": ahead, "robot_1": ahead})
    vector.reset(options={"reset_mask": np.array([True, True])})
    vector.step(np.ones((2, 2), np.float32))


@pytest.mark.parametrize("shape", [(), (3,), (1, 2)])
def test_actions_of_another_shape_are_an_error(shape: tuple[int, ...]) -> None:
    action = np.ones(shape, np.float32)
    single, vector = GoToEnv(**FAST), VectorEnv(3, **FAST)
    parallel = ParallelEnv(1, **FAST)
    for env in (single, vector, parallel):
        env.reset()
    with pytest.raises(ValueError, match=r"action of shape .*, expected \(2,\)"):
        single.step(action)
    with pytest.raises(ValueError, match=r"action of shape .*, expected \(2,\)"):
        parallel.step({"robot_0": action})
    with pytest.raises(ValueError, match=r"shape .*, expected \(3, 2\)"):
        vector.step(action)


def test_pictures_of_many_robots_are_those_of_each_alone() -> None:
    settings: dict[str, Any] = {"render_mode": "rgb_array", **FAST}
    maps = ["empty_room", "foliage_room"]
    many = gymnasium.make_vec(
        "radarsim.gym:radarsim/GoTo-v0", num_envs=3, map=maps, **settings
    )
    many.reset(seed=1)
    many.step(np.ones((3, 2), np.float32))
    pictures = many.render()
    assert pictures is not None
    for i, picture in enumerate(pictures):
        alone = GoToEnv(map=maps[i % 2], **settings)
        alone.reset(seed=1 + i)
        alone.step(np.ones(2, np.float32))
        np.testing.assert_array_equal(picture, alone.render())
    assert len(pictures) == 3
    assert VectorEnv(2, **FAST).render() is None
    with pytest.raises(ValueError, match="'human', expected rgb_array or None"):
        VectorEnv(2, render_mode="human", **FAST)


def test_episode_ends_at_the_goal() -> None:
    env = GoToEnv(start=(-3.0, 0.0, 0.0), goal=(-1.0, 0.0), **FAST)
    _, info = env.reset(seed=1)
    distance, rewards = info["distance"], []
    assert distance == pytest.approx(2.0)
    terminated = truncated = False
    while not (terminated or truncated):
        _, reward, terminated, truncated, info = env.step(np.ones(2, np.float32))
        rewards.append(reward)
    assert terminated
    assert info["distance"] <= 0.5
    assert sum(rewards) == pytest.approx(distance - info["distance"] + 10.0)


def test_observation_is_what_can_be_computed_by_hand(empty_room: Scene) -> None:
    env = GoToEnv(map=empty_room, start=(-3.0, 0.0, 0.0), goal=(-3.0, 4.0), **FAST)
    seen, _ = env.reset(seed=1)
    np.testing.assert_allclose(seen["goal"], [4 / 20, 0.0, 1.0], atol=1e-6)
    np.testing.assert_array_equal(seen["speeds"], [0.0, 0.0])
    seen, *_ = env.step(np.array([1.0, 1.0], np.float32))
    np.testing.assert_allclose(seen["speeds"], [1.0, 0.0], atol=1e-6)
    seen, *_ = env.step(np.array([-0.5, 0.5], np.float32))
    np.testing.assert_allclose(seen["speeds"], [0.0, 0.5], atol=1e-6)


def test_collision_is_reported_and_may_end_the_episode() -> None:
    ahead = np.ones(2, np.float32)
    for ends in (False, True):
        env = GoToEnv(**ACROSS, ends_at_collision=ends, max_steps=300, **FAST)
        env.reset(seed=1, options={"goal": (-3.0, 4.0)})
        terminated = truncated = False
        touched = []
        while not (terminated or truncated):
            _, _, terminated, truncated, info = env.step(ahead)
            touched.append(info["touched"])
        assert touched[-1]
        assert terminated is ends
        assert touched.count(True) == 1 or not ends


def test_reward_is_ones_own() -> None:
    def cost(transition: Transition) -> Any:
        return -np.abs(transition.actions).sum(axis=1)

    env = GoToEnv(**ACROSS, reward=cost, **FAST)
    env.reset(seed=1)
    assert env.step(np.array([0.5, -0.25], np.float32))[1] == pytest.approx(-0.75)


def test_random_places_are_free_and_can_be_reached(two_rooms: str) -> None:
    env = VectorEnv(100, map=two_rooms, **FAST)
    _, infos = env.reset(seed=3)
    x, y, _ = infos["pose"].T
    radius = math.hypot(0.5, 0.4) / 2
    assert (x > -4.9 + radius).all()
    assert (x < -0.1 - radius).all()
    assert (np.abs(y) < 2.9 - radius).all()
    assert (infos["distance"] >= 1.0).all()
    *_, infos = env.step(np.zeros((100, 2), np.float32))
    assert not infos["touched"].any()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"map": "nowhere"}, "nowhere"),
        ({"scanner": "eyes"}, "eyes"),
        ({"start": "Elsewhere"}, "Elsewhere"),
        ({"start": (1.0, 2.0)}, "x, y and yaw"),
        ({"start": (50.0, 0.0, math.nan)}, "finite"),
        ({"goal": "Elsewhere"}, "Elsewhere"),
        ({"goal": "map", "map": "empty_room"}, "no trial"),
        ({"decision_period": 0.0}, "period"),
        ({"decision_period": 20_000.0}, "period"),
        ({"robot": "Sedan"}, "has car-like steering"),
        ({"max_steps": 0}, "max_steps"),
        ({"beam_values": ["colour"]}, "beam_values"),
        ({"render_mode": "ansi"}, "'ansi', expected rgb_array, human or None"),
    ],
)
def test_wrong_settings_are_reported(settings: dict[str, Any], words: str) -> None:
    with pytest.raises((ValueError, RadarsimError), match=words):
        GoToEnv(**settings)


def test_wrong_options_and_actions_are_reported() -> None:
    env = GoToEnv(**ACROSS, **FAST)
    with pytest.raises(ValueError, match="x and y"):
        env.reset(options={"goal": (1.0, 1.0, 0.0)})
    env.reset()
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match="finite"):
            env.step(np.array([wrong, 0.0], np.float32))
    with pytest.raises(TypeError, match="colour"):
        GoToEnv(colour="red")


def test_picture_shows_robot_and_goal() -> None:
    env = GoToEnv(**ACROSS, render_mode="rgb_array", **FAST)
    env.reset(seed=1)
    first = env.render()
    assert first is not None
    assert first.shape[2] == 3
    env.reset(options={"start": (-3.0, 2.0, 0.0)})
    second = env.render()
    assert second is not None
    env.reset(options={"start": (-3.0, 0.0, 0.0)})
    assert not np.array_equal(second, first)
    np.testing.assert_array_equal(env.render(), first)


@pytest.mark.filterwarnings("ignore")  # of PettingZoo's own tests
def test_several_robots_keep_the_rules_of_pettingzoo() -> None:
    def create() -> ParallelEnv:
        return ParallelEnv(3, max_steps=20, **FAST)

    parallel_api_test(create(), num_cycles=50)
    parallel_seed_test(create, num_cycles=20)


def test_robots_meet_in_the_parallel_environment_only() -> None:
    settings: dict[str, Any] = {"map": "empty_room", "goal": (0.0, 3.0), **FAST}
    parallel = ParallelEnv(2, **settings)
    parallel.reset(seed=1)
    for row, pose in enumerate([Pose2(-0.6, 0.0, 0.0), Pose2(0.6, 0.0, math.pi)]):
        parallel.task.arena.place(row, pose)
    ahead = np.ones(2, np.float32)
    for _ in range(20):
        seen, *_, infos = parallel.step(dict.fromkeys(parallel.agents, ahead))
    assert all(info["touched"] for info in infos.values())
    assert infos["robot_0"]["pose"][0] < infos["robot_1"]["pose"][0]
    nearest = 0.5 / 80  # of the maximum range
    assert seen["robot_0"]["ranges"].min() < nearest
    vector = VectorEnv(2, start=(-0.6, 0.0, 0.0), **settings)
    observations, _ = vector.reset(seed=1)
    assert observations["ranges"].min() > nearest
    *_, infos_of_vector = vector.step(np.zeros((2, 2), np.float32))
    assert not infos_of_vector["touched"].any()
