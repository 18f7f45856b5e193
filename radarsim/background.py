"""A thread for work whose results are needed later."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class BackgroundThread:
    """Runs functions one after the other, beside the thread that asks for them.

    The thread is there from the first function on. It ends when nobody needs it any
    more, or with the process.
    """

    def __init__(self) -> None:
        """Start nothing yet."""
        self._pool: ThreadPoolExecutor | None = None

    def submit(
        self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[T]:
        """Run a function after those that were given before.

        Returns:
            Waits for what the function returns, or raises.
        """
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "radarsim-background")
        return self._pool.submit(function, *args, **kwargs)
