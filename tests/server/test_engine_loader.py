"""How a server that listens already gets its engine."""

import asyncio
import gc
import logging
import threading

import pytest
from peers import wait_until

from radarsim.errors import EngineError, ServerError
from radarsim.scene.scene import Scene
from radarsim.server import engine_loader as module
from radarsim.server.engine_loader import CompilerProcess, EngineLoader
from radarsim.server.host import Host
from radarsim.simulation.simulation import Simulation


class Compiler(CompilerProcess):
    """Stands for the process that compiles."""

    def __init__(self) -> None:
        super().__init__()
        self.runs = 0
        self.stopped = threading.Event()

    def run(self) -> None:
        self.runs += 1

    def stop(self) -> None:
        self.stopped.set()


class Killed(Compiler):
    def run(self) -> None:
        super().run()
        raise ServerError("ended by SIGKILL")


class Slow(Compiler):
    def run(self) -> None:
        super().run()
        self.stopped.wait()
        raise ServerError("it was stopped")


@pytest.fixture
def host(empty_room: Scene) -> Host:
    return Host(empty_room, begins=False)


@pytest.fixture
def cold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "is_complete", lambda: False)


async def test_nothing_is_compiled_where_all_is_cached(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "is_complete", lambda: True)
    compiler = Compiler()
    loader = EngineLoader(host, compiler)
    simulation = await loader.load()
    assert (simulation.scene, compiler.runs) == (host.scene, 0)


@pytest.mark.usefixtures("cold")
async def test_process_compiles_what_is_not_cached(host: Host) -> None:
    compiler = Compiler()
    assert isinstance(await EngineLoader(host, compiler).load(), Simulation)
    assert compiler.runs == 1


@pytest.mark.usefixtures("cold")
async def test_without_a_cache_no_process_is_started(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "cache_folder", lambda: None)
    compiler = Compiler()
    assert isinstance(await EngineLoader(host, compiler).load(), Simulation)
    assert compiler.runs == 0


@pytest.mark.usefixtures("cold")
async def test_server_compiles_if_the_process_has_failed(
    host: Host, caplog: pytest.LogCaptureFixture
) -> None:
    assert isinstance(await EngineLoader(host, Killed()).load(), Simulation)
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert "ended by SIGKILL" in record.getMessage()


@pytest.mark.usefixtures("cold")
async def test_stop_ends_the_process_and_the_thread(host: Host) -> None:
    compiler = Slow()
    loader = EngineLoader(host, compiler)
    assert not loader.is_running
    loading = asyncio.create_task(loader.load())
    await wait_until(lambda: compiler.runs == 1)
    assert loader.is_running
    loader.stop()
    with pytest.raises(ServerError, match="stopped"):
        await loading
    await wait_until(lambda: not loader.is_running)


@pytest.mark.usefixtures("cold")
async def test_loading_can_be_given_up(host: Host) -> None:
    compiler = Slow()
    loader = EngineLoader(host, compiler)
    loading = asyncio.create_task(loader.load())
    await wait_until(lambda: compiler.runs == 1)
    loading.cancel()
    with pytest.raises(asyncio.CancelledError):
        await loading
    loader.stop()
    await wait_until(lambda: not loader.is_running)
    await asyncio.sleep(0)


async def test_error_of_the_engine_is_raised(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> Simulation:
        raise EngineError("Embree cannot be loaded")

    monkeypatch.setattr(host, "make_simulation", fail)
    with pytest.raises(EngineError, match="Embree"):
        await EngineLoader(host, Compiler()).load()


async def test_garbage_collections_skip_what_the_engine_is_made_of(host: Host) -> None:
    gc.unfreeze()
    try:
        await EngineLoader(host, Compiler()).load()
        assert gc.get_freeze_count() > 10_000
    finally:
        gc.unfreeze()
