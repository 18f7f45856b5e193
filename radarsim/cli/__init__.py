"""Command line of radarsim: data on stdout, everything else on stderr.

Exit codes: 0 done, 1 failed, 2 wrong usage, 129 hung up, 130 interrupted, 141 stdout
was closed, 143 ended by SIGTERM before the work was done. Commands that run until
they are stopped are done then.
"""

import os
import signal

__all__ = ["main"]


def main() -> None:
    """Run a command and exit with its code."""
    # Before the first import that takes some time, in which Ctrl-C would end in a
    # traceback. A signal that the parent process ignores stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    # Pictures need no window. Matplotlib cannot be imported if the variable names a
    # backend that is absent, such as that of another environment's notebook.
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
