"""Sweeps on a dask cluster that runs already, here or on other machines."""

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any, Final

from radarsim import __version__
from radarsim.errors import SweepError
from radarsim.optional_packages import import_optional
from radarsim.scene.scene import Scene
from radarsim.sweep.tasks import prepare_worker

EXTRA: Final = "cluster"
_CONNECTING: Final = 30  # s


@contextmanager
def cluster_executor(
    address: str, scenes: Mapping[str, Scene]
) -> Iterator[tuple[Executor, int]]:
    """Connect to a cluster, and give its workers the maps of a sweep.

    Workers that join later get them as well.

    Args:
        address: Address of its scheduler, such as ``tcp://10.0.0.1:8786``.
        scenes: From ``load_scenes``.

    Yields:
        An executor, and the number of threads of all workers.

    Raises:
        MissingPackage: If distributed is not installed.
        SweepError: If there is no such cluster, or it has no workers, or one of them
            has another version of radarsim, or none at all.
    """
    distributed = import_optional("distributed", EXTRA)
    try:
        client = distributed.Client(address, timeout=_CONNECTING)
    except (OSError, ValueError, TimeoutError) as error:
        raise SweepError(f"--scheduler {address}: {error}") from error
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise SweepError(f"--scheduler {address}: no workers, expected some")
        _prepare(distributed, client, scenes)
        yield client.get_executor(pure=False), threads


def _prepare(distributed: Any, client: Any, scenes: Mapping[str, Scene]) -> None:
    """Prepare all workers, and those that will join."""

    class Preparation(distributed.WorkerPlugin):  # type: ignore[misc]
        name = "radarsim-sweep"

        def setup(self, worker: Any) -> None:
            del worker
            prepare_worker(__version__, scenes)

    try:
        client.register_plugin(Preparation())
    except SweepError:
        raise
    except Exception as error:  # whatever keeps a worker from importing radarsim
        text = f"a worker cannot run radarsim: {error}"
        raise SweepError(text) from error
