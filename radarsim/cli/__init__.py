"""The command line: data on stdout, everything else on stderr.

Exit codes: 0 done, 1 failed, 2 usage, 130 interrupted; after SIGTERM 0 for what serves,
143 for what has not done its work.
"""

from radarsim.cli.app import app, main

__all__ = ["app", "main"]
