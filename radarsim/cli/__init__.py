"""Command line of radarsim: data on stdout, everything else on stderr.

Exit codes: 0 done, 1 failed, 2 wrong usage, 129 hung up, 130 interrupted, 141 stdout
was closed, 143 told to end by SIGTERM before the work was done. Commands that run until
they are stopped are done then.
"""

from radarsim.processes import (
    TERMINATED,
    exit_immediately_on_signals,
    set_exit_code_of_sigterm,
)

__all__ = ["main"]


def main() -> None:
    """Run a command and exit with its code."""
    set_exit_code_of_sigterm(TERMINATED)
    with exit_immediately_on_signals():
        from radarsim.cli import app

        app.main()
