"""What a turn of an FMCW radar costs, against its rays and one FFT per direction."""

import time
from collections.abc import Iterator

import numpy as np
from scipy import fft

from radarsim.benchmark.timing import BenchmarkRow, compare
from radarsim.fmcw.windows import fft_length
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.sensors.range_scanner import load_sensor, sensor_pose

MAP = "foliage_room"
PLACE = (-8.0, 0.0, 0.0)
LIMIT = 4.0


def turns_of_a_radar(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure a turn, by the processor's time of tracing its rays and of the FFTs."""
    scene, radar = load_map(MAP), load_sensor("navtech_cts350x").fmcw
    pose, rng = sensor_pose(scene, PLACE), generator_for(0, "bench")
    settings, tracer = radar.settings, tracer_of(scene)
    _, rays = radar.aim(scene, pose, -1, range(settings.azimuths))
    signal = np.ones((settings.azimuths, fft_length(settings)), np.complex64)

    def trace_and_transform() -> None:
        tracer.trace(rays, events=True, incidence=True)
        fft.fft(signal, axis=1)

    result = compare(
        lambda: radar.spectrum(scene, pose, rng),
        trace_and_transform,
        seconds=seconds,
        clock=time.thread_time,
    )
    note = f"{result.subject * 1e3:.0f} ms against {result.reference * 1e3:.0f}"
    title = f"{settings.azimuths} x {settings.bins} bins in {MAP}"
    yield BenchmarkRow("p", title, result.ratio, "x", LIMIT, note)
