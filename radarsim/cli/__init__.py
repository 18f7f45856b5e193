"""Command line of radarsim: data on stdout, everything else on stderr.

Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted. After SIGTERM it is 0 for
commands that run until they are stopped, and 143 for those whose work is unfinished.
"""

from radarsim.cli.app import main

__all__ = ["main"]
