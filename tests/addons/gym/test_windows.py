"""The render mode ``human`` opens windows that follow the robots."""

from windows import run_with

CHECK = """
import warnings
import gymnasium
from gymnasium.utils.env_checker import check_env

warnings.simplefilter("error")
env = gymnasium.make("radarsim.gym:radarsim/GoTo-v0", sensor_settings={"fov_deg": 20})
check_env(env.unwrapped)  # in all render modes
print(pyplot.get_fignums(), gymnasium.make("radarsim/Smoke-v0").spec.id)
"""
FOLLOW = """
import numpy as np
from radarsim.gym import GoToEnv, ParallelEnv

def as_array(image):
    return np.asarray(image.convert("RGB"), float)

ahead = np.ones(2, np.float32)
for make, act in (
    (GoToEnv, lambda env: env.step(ahead)),
    (ParallelEnv, lambda env: env.step(dict.fromkeys(env.agents, ahead))),
):
    env, other = (make(render_mode=mode) for mode in ("human", "rgb_array"))
    shown = []
    env.reset(seed=1), other.reset(seed=1)
    for _ in range(5):
        act(env), act(other)
        picture = other.render()
        shown.append(as_array(grab(*picture.shape[1::-1])))
        print(np.abs(shown[-1] - picture).mean() < 0.05, env.render())
    print(np.array_equal(shown[0], shown[-1]), pyplot.get_fignums())
    close(1)
    act(env), act(env)
    print(pyplot.get_fignums())
    env.close()
    env = make(render_mode="human")
    env.close()
    print(pyplot.get_fignums())
"""
MAKE = "from radarsim.gym import GoToEnv; GoToEnv(render_mode='human')"


def test_windows_keep_the_rules_of_gymnasium(display: dict[str, str]) -> None:
    assert run_with(display, CHECK) == ["[] radarsim/Smoke-v0"]


def test_window_shows_the_pictures_of_each_step_until_it_is_closed(
    display: dict[str, str],
) -> None:
    each = [*["True None"] * 5, "False [1]", "[]", "[]"]
    assert run_with(display, FOLLOW) == [*each, *each]


def test_error_says_what_to_do_without_a_display() -> None:
    (line,) = run_with({}, MAKE)
    assert line.startswith("radarsim.errors.RadarsimError: ")
    assert line.endswith('without a window use render_mode="rgb_array"')
