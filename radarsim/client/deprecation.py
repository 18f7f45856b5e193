"""Warnings about old names, which stay for one version."""

import warnings


def warn_renamed(old: str, new: str) -> None:
    """Warn the caller's caller that a name has been replaced.

    >>> import pytest
    >>> with pytest.warns(DeprecationWarning, match="Client.link is deprecated"):
    ...     warn_renamed("Client.link", "Client.transport")
    """
    warnings.warn(
        f"{old} is deprecated, use {new}", category=DeprecationWarning, stacklevel=3
    )
