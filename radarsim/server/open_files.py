"""How many files a process may have open at once; each connection is one."""

from contextlib import suppress


def raise_file_limit(count: int) -> int:
    """Let this process have so many files open, as far as the system permits.

    The limit is never lowered.

    Args:
        count: Number of files and sockets.

    Returns:
        How many of ``count`` it may have open.
    """
    try:
        import resource  # noqa: PLC0415 - Windows does not have it, nor such a limit
    except ImportError:
        return count
    limit, ceiling = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit == resource.RLIM_INFINITY:
        return count
    wanted = count if ceiling == resource.RLIM_INFINITY else min(count, ceiling)
    if limit < wanted:
        with suppress(ValueError, OSError):  # macOS permits less than it says
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, ceiling))
            limit = wanted
    return min(count, limit)
