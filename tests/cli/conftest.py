from collections.abc import Callable

import pytest
from commands import Run, run_in_process

Command = Callable[..., Run]


@pytest.fixture(scope="session")
def radarsim() -> Command:
    """Return the function that runs a command in this process."""
    return run_in_process
