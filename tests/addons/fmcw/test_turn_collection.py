"""The spectra of a robot in a loop of one's own: whole turns of its radar."""

import numpy as np
import pytest

import radarsim
from radarsim.addons.fmcw.rotation_schedule import antennas_of
from radarsim.errors import ClientError
from radarsim.scene.scene import Scene
from radarsim.simulation.simulation import Simulation


def test_spectrum_joins_what_the_antenna_receives(foliage_room: Scene) -> None:
    sim = radarsim.simulate(foliage_room)
    robot = sim.spawn("P3AT_Navtech", start="RobotStart1")
    robot.request_spectra()
    rows: list[np.ndarray] = []

    def listen(simulation: Simulation) -> None:
        (antenna,) = antennas_of(simulation).of(simulation.vehicles[0])
        antenna.observers.append(lambda sector, _: rows.extend(sector.spectrum.power))

    sim.call(listen)
    sim.step(0.6)
    spectrum = robot.spectrum()
    settings = radarsim.load_sensor("navtech_cts350x").fmcw.settings
    assert spectrum.power.shape == (settings.azimuths, settings.bins)
    assert spectrum.echo_power.shape == spectrum.power.shape
    step = 2 * np.pi / settings.azimuths
    np.testing.assert_allclose(spectrum.angles, -step * np.arange(settings.azimuths))
    whole = len(rows) // settings.azimuths * settings.azimuths
    newest = np.array(rows[whole - settings.azimuths : whole])
    assert np.array_equal(spectrum.power, newest)


@pytest.mark.parametrize(
    ("robot", "scanner", "text"),
    [
        ("P3AT", None, "has no FMCW radar"),
        ("P3AT_Navtech", "Navtec", "did you mean 'Navtech'"),
        ("P3AT_Navtech", "lms200", "expected one of"),
    ],
)
def test_other_scanners_have_no_spectra(
    foliage_room: Scene, robot: str, scanner: str | None, text: str
) -> None:
    spawned = radarsim.simulate(foliage_room).spawn(robot)
    with pytest.raises(ClientError, match=text):
        spawned.request_spectra(scanner)


def test_turn_that_is_not_complete_is_no_spectrum(foliage_room: Scene) -> None:
    sim = radarsim.simulate(foliage_room)
    robot = sim.spawn("P3AT_Navtech")
    with pytest.raises(ClientError, match="request_spectra"):
        robot.spectrum("Navtech")
    robot.request_spectra("navtech")
    sim.step(0.3)  # the first turn is not received
    with pytest.raises(ClientError, match="s before"):
        robot.spectrum("Navtech")
    sim.step(0.5)
    assert robot.spectrum("Navtech").power.max() > 0
