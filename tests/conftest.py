"""Scenes that many tests look at; they are read once, and nothing changes them."""

import hashlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

import pytest
from hypothesis import HealthCheck, settings

from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene

# Machines are shared and noisy: a slow example is not a wrong one.
settings.register_profile(
    "radarsim",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=os.environ.get("CI") == "true",
)
settings.load_profile("radarsim")

# Tests, and modules with examples, that together reach every branch of the protocol and
# the host.
MEASURED = (
    "radarsim/server/host",
    "radarsim/protocol",
    "tests/client",
    "tests/dialogues",
    "tests/server/host",
    "tests/protocol",
    "tests/addons/fmcw/test_rotation_schedule",
    "tests/test_exports",
)

# Packages of the extra ``dev`` alone, whose tests are skipped where one is missing. In
# CI none may be.
OPTIONAL = (
    *("distributed", "imageio_ffmpeg", "itur", "kiss_icp", "nbclient", "nbformat"),
    *("pandas", "playwright", "pyarrow", "roslibpy", "xarray"),
)

# In the background of a shell script interrupts are ignored, by whom we start as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--sample",
        type=float,
        default=1.0,
        metavar="SHARE",
        help="Run only about this share of the slow tests, which their names decide.",
    )


def _missing(text: str) -> str | None:
    """Return why a test is skipped, if an error says that it lacks a package."""
    found = re.search(r"No module named '(\w+)", text)
    if found is None or found[1] not in OPTIONAL or os.environ.get("CI") == "true":
        return None
    return f"{found[1]} is not installed"


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if report.failed and (reason := _missing(str(report.longrepr))):
        report.outcome = "skipped"
        report.longrepr = (str(collector.path), 1, reason)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[
    None, pytest.TestReport, pytest.TestReport
]:
    report = yield
    if report.failed and (reason := _missing(str(report.longrepr))):
        report.outcome = "skipped"
        report.longrepr = (report.location[0], report.location[1] or 1, reason)
    return report


def pytest_sessionstart(session: pytest.Session) -> None:
    """Let workers that run failed tests again count them without a delay.

    The plugin writes twice before it reads. The second write would wait 40 ms for the
    acknowledgement of the first: in each test, which is minutes in all.
    """
    counter = getattr(session.config, "failures_db", None)
    if sock := getattr(counter, "sock", None):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _place(name: str) -> float:
    """Return a number from 0 to 1 that a name alone decides."""
    digest = hashlib.blake2b(name.encode(), digest_size=4).digest()
    return int.from_bytes(digest, "big") / 2**32


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Deselect the slow tests that are not in the sample.

    Other tests do not decide whether a test is in it: a new test does not bring
    others into the sample that have not been run for long.
    """
    share = config.getoption("--sample")
    marks = {item: item.get_closest_marker("slow") for item in items}
    places = {(): None, ("alone",): 1.0, ("sampled",): 0.0}
    left_out = set()
    for item, mark in marks.items():
        if mark is not None and share < 1:
            place = places[mark.args]
            if (_place(item.nodeid) if place is None else place) >= share:
                left_out.add(item)
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


@contextmanager
def _without_tracing() -> Iterator[None]:
    """Suspend coverage in this thread, in new threads and in new processes."""
    tracers = sys.gettrace(), threading.gettrace()
    settings = {k: v for k, v in os.environ.items() if k.startswith("COVERAGE_")}
    for name in settings:
        del os.environ[name]
    sys.settrace(None)
    threading.settrace(None)
    try:
        yield
    finally:
        sys.settrace(tracers[0])
        threading.settrace(tracers[1])
        os.environ.update(settings)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, bool, bool]:
    """Measure coverage only in tests that are meant to reach every branch.

    Measuring slows down the others, and takes up to twice their time.
    """
    path = item.path.relative_to(item.config.rootpath).as_posix()
    if path.startswith(MEASURED) and not item.get_closest_marker("slow"):
        return (yield)
    with _without_tracing():
        return (yield)


@pytest.fixture(scope="session", autouse=True)
def _default_hangup() -> Iterator[None]:
    """Let SIGHUP end programs also where ``nohup`` has started the tests."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="session")
def display() -> Iterator[dict[str, str]]:
    """Return environment variables for windows of Tk on a virtual display.

    Tests of windows fail in CI without the programs for them, and skip elsewhere.
    """
    reason = ""
    if shutil.which("Xvfb") is None:
        reason = "no virtual display for windows: Xvfb is not installed"
    elif find_spec("_tkinter") is None:
        reason = "no toolkit for windows: this Python has no tkinter"
    if reason and os.environ.get("CI") == "true":
        pytest.fail(reason)
    if reason:
        pytest.skip(reason)
    reading, writing = os.pipe()
    # At this size in whole mm a window has as many pixels as the picture in a file.
    words = ["Xvfb", "-displayfd", str(writing), "-dpi", "96"]
    with (
        subprocess.Popen(
            [*words, "-screen", "0", "1440x960x24", "-nolisten", "tcp"],
            pass_fds=[writing],
            stderr=subprocess.DEVNULL,
        ) as server,
        os.fdopen(reading) as numbers,
    ):
        os.close(writing)
        number = numbers.readline().strip()  # empty if it has ended
        assert number, "Xvfb found no free display"
        yield {"DISPLAY": f":{number}", "MPLBACKEND": "tkagg"}
        server.terminate()


@pytest.fixture(scope="session")
def empty_room() -> Scene:
    return load_map("empty_room")


@pytest.fixture(scope="session")
def foliage_room() -> Scene:
    return load_map("foliage_room")


@pytest.fixture(scope="session")
def smoke_room() -> Scene:
    return load_map("smoke_room")
