"""The command line: data on stdout, everything else on stderr.

Exit codes: 0 done, 1 failed, 2 usage, 130 interrupted, 0 after SIGTERM.
"""

from radarsim.cli.commands import app, main

__all__ = ["app", "main"]
