"""A tap in the foreground, until a signal ends it."""

from collections.abc import Callable

from radarsim.foreground import exit_code_of_signal
from radarsim.tap.tap import Tap


async def forward_until_signal(
    tap: Tap,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
) -> int:
    """Forward until Ctrl-C, or until asked to terminate.

    Args:
        tap: To be started; stopped when this returns.
        address: To listen on.
        port: 0 for a free one.
        announce: Told the address as soon as clients can connect.

    Returns:
        The exit code of a program that does nothing else: 130 after an interrupt, 0
        after a request to terminate.

    Raises:
        ServerError: If it cannot listen.
    """
    with exit_code_of_signal() as ended:
        try:
            await tap.start(address, port)
            announce(tap.address)
            return await ended
        finally:
            await tap.stop()
