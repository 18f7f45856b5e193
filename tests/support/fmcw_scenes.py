"""Small scenes and radars for the tests of spectra."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarsim.addons.fmcw.antenna import Viewpoints, fixed_viewpoints
from radarsim.addons.fmcw.beat_signal import NumberedStreams, Power, Tones, beat_rows
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.radar_equation import noise_power, radar_constant
from radarsim.addons.fmcw.turn_echoes import Echoes
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.presets.sensors import load_settings
from radarsim.rng import fixed_number, generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box, cylinder

HARD = Material("hard")  # gamma of -10 dB
LEAVES = Material("leaves", density=0.0, radar_db=(2.37, 3.31, 3.5))
EYE = Pose3(0.0, 0.0, 1.0)

# A symmetric beam, and nothing but echoes and noise.
PLAIN = FmcwSettings(
    carrier_ghz=76.5,
    bandwidth_mhz=863,
    azimuths=400,
    bins=3768,
    bin_size=0.0438,
    rotation_hz=4,
    transmit_dbm=10,
    noise_figure_db=15,
    loss_db=3,
    beamwidth_az_deg=1.8,
    beamwidth_el_deg=4,
    sidelobe_db=-300,
)


def radar(**changes: Any) -> FmcwRadar:
    """Return a plain radar with some settings changed."""
    settings = FmcwSettings.model_validate({**PLAIN.model_dump(), **changes})
    return FmcwRadar("plain", settings, load_settings("navtech_cts350x"))


def scene_of(*parts: Part) -> Scene:
    return Scene("test", "Test", parts)


def block(
    size: tuple[float, float, float],
    centre: tuple[float, float, float],
    material: Material = HARD,
) -> Part:
    vertices, faces = box(*size)
    return Part("block", material, vertices + np.array(centre), faces)


def wall_at(distance: float, material: Material = HARD) -> Scene:
    """Return a wall that fills the beam straight ahead of ``EYE``."""
    return scene_of(block((0.2, 400, 200), (distance + 0.1, 0, 0), material))


def pole_at(distance: float, azimuth_deg: float, radius: float, height: float) -> Part:
    """Return an upright pole around the height of ``EYE``, clockwise from ahead."""
    vertices, faces = cylinder(radius, height)
    azimuth = math.radians(azimuth_deg)
    place = distance * np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])
    return Part("pole", HARD, vertices + place + [0, 0, EYE.z], faces)


def echo_power(which: FmcwRadar, scene: Scene, pose: Pose3 = EYE) -> Floats:
    """Return the mean power of each direction and bin, W."""
    mean = echoes_of(which, scene, fixed_viewpoints(pose, which.times(0))).power
    return np.asarray(mean, np.float64) * noise_power(which.settings)


def echoes_of(
    which: FmcwRadar, scene: Scene, view: Viewpoints, seed: int = 0
) -> Echoes:
    """Return the echoes of all directions, in units of the noise."""
    rows, turn = range(which.settings.azimuths), which.new_turn(scene)
    key = fixed_number(generator_for(seed))
    which.add_echoes(turn, scene, view, rows, key)
    found = turn.rows(0, rows.stop, turn, turn)
    which.add_sidelobes(found, turn, rows, view, key)
    return found


def beat_spectrum(
    settings: FmcwSettings, field: Power, tones: Tones, rng: np.random.Generator
) -> Power:
    """Return the power in each bin of a turn, (A, B), in units of the noise."""
    return beat_rows(settings, 0, field, tones, NumberedStreams(rng))


def db(ratio: Any) -> Any:
    return 10 * np.log10(ratio)


def dbm(power: Any) -> Any:
    return 10 * np.log10(power) + 30


def no_echoes(settings: FmcwSettings) -> Power:
    """Return the amplitudes of a turn without any."""
    return np.zeros((settings.azimuths, 2 * settings.bins), np.float32)


def correlation(first: NDArray[Any], second: NDArray[Any]) -> float:
    """Return the correlation of two arrays."""
    return float(np.corrcoef(first.ravel(), second.ravel())[0, 1])


def received_power(settings: FmcwSettings, rcs: ArrayLike, ranges: ArrayLike) -> Floats:
    """Return the power from points in the middle of the beam, W."""
    sections, distances = np.asarray(rcs), np.asarray(ranges, np.float64)
    return np.asarray(radar_constant(settings) * sections / distances**4)
