"""How many processors a process may use."""

import os


def process_cpu_count() -> int:
    """Return the number of processors that this process may use, at least 1."""
    # `os.process_cpu_count` of Python 3.13 does the same.
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
