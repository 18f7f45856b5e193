"""Command line of radarsim: data on stdout, everything else on stderr.

Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted. After SIGTERM it is 0 for
commands that run until they are stopped, and 143 for those whose work is unfinished.
"""

from radarsim.signal_handlers import exit_immediately_on_signals

__all__ = ["main"]


def main() -> None:
    """Run a command and exit with its code."""
    with exit_immediately_on_signals():
        from radarsim.cli import app
    app.main()
