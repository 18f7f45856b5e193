"""``radarsim compile``: compile everything now, so that no later start has to."""

import sys
from collections.abc import Iterator
from contextlib import nullcontext

from radarsim import plugins
from radarsim.cli.compile_progress import compile_progress, with_bar
from radarsim.cli.output import print_lines
from radarsim.errors import RadarsimError, describe_os_error
from radarsim.kernel_cache import SUFFIX, cache_folder, compilation, mark_complete


def compile_kernels() -> None:
    """Compile everything now, so that no later start has to.

    For images of containers, runs of tests on fresh machines, and clusters. Prints the
    folder of the compiled code: it may be kept or copied to machines with the same
    processor and the same versions of radarsim, numba and numpy.

    Raises:
        RadarsimError: If the code cannot be kept.
    """
    folder = cache_folder()
    if folder is None:
        text = "no folder for compiled code can be used, set NUMBA_CACHE_DIR to one"
        raise RadarsimError(text)
    names = plugins.names(plugins.KERNELS)
    # On a terminal the bar tells how far it is, else there is a line for each part.
    with nullcontext() if sys.stderr.isatty() else compile_progress():
        for _ in with_bar(_compile_each(names), "compiled", len(names)):
            pass
    if compilation.unsaved is not None:
        why = describe_os_error(compilation.unsaved)
        raise RadarsimError(f"compiled code cannot be kept in {folder}: {why}")
    mark_complete()
    sizes = [path.stat().st_size for path in folder.rglob(f"*{SUFFIX}")]
    print_lines([f"{folder}: {len(sizes)} functions, {sum(sizes) / 1e6:.1f} MB"])


def _compile_each(names: list[str]) -> Iterator[str]:
    for name in names:
        plugins.load(plugins.KERNELS, name)()
        yield name
