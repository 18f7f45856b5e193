"""Command line of radarsim: data goes to stdout, everything else to stderr.

The exit code is 0 after success, 1 after a failure, 2 after wrong usage, 129 after
SIGHUP, 130 after SIGINT, 141 if stdout was closed, and 143 after SIGTERM before the
work was done. Commands that run until they are stopped exit with 0 after SIGTERM.
"""

import os
import signal

__all__ = ["main"]


def main() -> None:
    """Run a command and exit with its code."""
    # The handler is set before the slow imports, since Ctrl-C during an import would
    # print a traceback. A signal that the parent process ignores stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    # Commands write pictures without a window. Matplotlib cannot be imported if this
    # variable names a missing backend, such as the backend of another environment.
    os.environ["MPLBACKEND"] = "agg"
    from radarsim.processes import (
        TERMINATED,
        exit_immediately_on_signals,
        set_exit_code_of_sigterm,
    )

    set_exit_code_of_sigterm(TERMINATED)
    with exit_immediately_on_signals():
        from radarsim.cli import app

        app.main()
