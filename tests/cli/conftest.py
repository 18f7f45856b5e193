from collections.abc import Callable

import pytest
from commands import Run, run_in_process

RunCommand = Callable[..., Run]


@pytest.fixture(scope="session")
def radarsim() -> RunCommand:
    """Return the function that runs a command in this process."""
    return run_in_process
