"""The core without autonomy, add-ons and sweeps, and without the packages they need."""

import os
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import radarsim

PACKAGE = Path(radarsim.__file__).parent
TESTS = Path(__file__).parent
OTHERS = ("autonomy", "addons", "sweep")
# Imported before anything else, it hides the extras, which may be installed.
SITE = """
import sys
for name in (
    "cyclonedds", "distributed", "gymnasium", "imageio_ffmpeg", "mcap", "pandas",
    "pettingzoo", "pyarrow", "rosbags", "xarray",
):
    sys.modules[name] = None
"""
INIT = b"INIT {ClassName USARBot.P3AT_Radar360} {Location -7.8,0,0.2}\r\n"
HERE = ("--sensor", "radar", "--start", "RobotStart1")
TIMEOUT = 240  # s that a busy machine may need
WITHOUT_ADDONS = """
import importlib

import radarsim
from radarsim import plugins
from radarsim.presets.robots import load_robot
from radarsim.simulation.config import SimulationConfig

print(plugins.names("radarsim.items"), radarsim.load_sensor("radar").name)
for wanted in (
    lambda: radarsim.load_sensor("navtech_cts350x", detector="ca"),
    lambda: SimulationConfig().check_scanners(load_robot("P3AT_Navtech")),
    lambda: radarsim.load_sensor("navtech_cts350x").fmcw,
    lambda: radarsim.evaluate,
    lambda: radarsim.load_recording,
    lambda: importlib.import_module("radarsim.gym"),
    lambda: radarsim.simulate("empty_room").record("run"),
    lambda: radarsim.simulate("empty_room").spawn().request_spectra(),
):
    try:
        wanted()
    except radarsim.RadarsimError as error:
        print(error)
"""
FIXTURES = ("usarsim_server", "usarsim_client", "usarsim_map")  # of an add-on
FOLDERS = (
    *("protocol", "scene", "presets", "raycast", "sensors", "robots", "simulation"),
    *("server", "local", "plotting", "client"),
)


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder that has the core, its maps and nothing else."""
    folder = tmp_path_factory.mktemp("core")
    unwanted = shutil.ignore_patterns(*OTHERS)
    shutil.copytree(PACKAGE, folder / "radarsim", ignore=unwanted)
    maps = PACKAGE.parent / "maps"
    if maps.is_dir():  # not where the package is installed: it has its own
        shutil.copytree(maps, folder / "maps")
    (folder / "sitecustomize.py").write_text(SITE)
    return folder


def environment(core: Path) -> dict[str, str]:
    known = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")}
    return {**known, "PYTHONPATH": str(core), "COLUMNS": "80"}


def run(
    core: Path, *words: str, timeout: float = TIMEOUT
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        (sys.executable, "-m", *words),
        cwd=core,
        env=environment(core),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("scan", "foliage_room", *HERE, "--format", "csv"), "scan,beam,angle,range"),
        (("explain", "foliage_room", *HERE, "--beam", "92"), "radar, beam 92 at"),
        (("check", "foliage_room"), "RobotStart1"),
        (("drive", "--help"), "Drive a robot from the keyboard"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_commands_of_the_core_run(
    core: Path, words: tuple[str, ...], message: str
) -> None:
    done = run(core, "radarsim", *words)
    assert done.returncode == 0, done.stderr
    assert message in done.stdout


def test_help_lists_the_commands_of_the_core_alone(core: Path) -> None:
    shown = run(core, "radarsim", "--help").stdout
    listed = {line.split()[0] for line in shown.splitlines() if line[2:3].isalpha()}
    assert {"serve", "drive", "scan", "explain", "check", "docs"} <= listed
    assert listed.isdisjoint({"navigate", "map", "ros", "commander", "sweep"})


def test_option_of_an_absent_part_names_the_part(core: Path) -> None:
    done = run(core, "radarsim", "serve", "empty_room", "--web", "0")
    assert done.returncode == 2
    assert done.stderr == (
        "radarsim: --web: radarsim.addons.web.cli is not installed\n"
    )


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("navigate", "radarsim.autonomy"),
        ("ros", "radarsim.addons"),
        ("sweep", "radarsim.sweep"),
    ],
)
def test_command_of_an_absent_part_is_reported_in_one_line(
    core: Path, name: str, part: str
) -> None:
    done = run(core, "radarsim", name, "foliage_room")
    assert done.returncode == 1
    assert done.stderr == f"radarsim: {name}: {part} is not installed\n"


def test_missing_add_on_is_named_where_it_is_needed(core: Path) -> None:
    command = (sys.executable, "-c", WITHOUT_ADDONS)
    printed = subprocess.check_output(
        command, text=True, cwd=core, env=environment(core)
    )
    needs = "sensor navtech_cts350x: detector 'ca' needs radarsim.addons.fmcw, which is"
    assert printed.splitlines() == [
        "[] radar",
        f"{needs} not installed",
        f"{needs} not installed",
        "radarsim.addons.fmcw is not installed",
        "radarsim.autonomy.evaluation is not installed",
        "radarsim.addons is not installed",
        "radarsim.addons is not installed",
        "radarsim.addons.recording is not installed",
        "radarsim.addons.fmcw is not installed",
    ]


def test_server_sends_scans(core: Path) -> None:
    words = ("radarsim", "serve", "foliage_room", "--port", "0")
    with subprocess.Popen(
        (sys.executable, "-m", *words),
        cwd=core,
        env=environment(core),
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        port = int(process.stdout.readline().rpartition(":")[2])
        with (
            socket.create_connection(("127.0.0.1", port), TIMEOUT) as client,
            client.makefile("rb") as lines,
        ):
            client.sendall(INIT)
            scan = next(s for s in lines if s.startswith(b"SEN") and b"Range" in s)
        process.terminate()
    assert scan.count(b",") > 90


@pytest.mark.slow("alone")
@pytest.mark.timeout(3600)
def test_tests_of_the_core_pass(core: Path) -> None:
    unwanted = shutil.ignore_patterns("__pycache__")
    for name in (*FOLDERS, "support", "conftest.py"):
        source = TESTS / name
        if source.is_dir():
            shutil.copytree(source, core / "tests" / name, ignore=unwanted)
        else:
            shutil.copy(source, core / "tests")
    # Not tests that use other parts or their fixtures, or removed ones.
    unfit = "|".join((*(rf"radarsim\.{name}" for name in OTHERS), *FIXTURES))
    files = sorted(
        (core / "tests").rglob("*.py"), key=lambda f: "support" not in f.parts
    )
    for _ in range(2):  # support uses support
        for file in files:
            if file.exists() and re.search(rf"\b({unfit})\b", file.read_text("utf-8")):
                file.unlink()
                unfit += f"|from {file.stem} import"
    shutil.copy(PACKAGE.parent / "pyproject.toml", core)
    # FMCW radars, and the robot that carries one, are of an add-on.
    without_fmcw = "not Navtech and not of_a_detector"
    words = ("-q", "-p", "no:cacheprovider", "-p", "no:radarsim", "-k", without_fmcw)
    folders = [f"tests/{name}" for name in FOLDERS]
    done = run(core, "pytest", *words, *folders, timeout=3600)
    assert done.returncode == 0, done.stdout[-5000:]
