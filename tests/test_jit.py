from collections.abc import Callable
from typing import Any

import pytest

from radarsim.jit import njit_cached, njit_inline


@pytest.mark.parametrize("decorate", [njit_cached, njit_inline])
def test_what_cannot_be_kept_on_disk_runs_all_the_same(
    decorate: Callable[[Any], Any],
) -> None:
    # Numba knows no place to keep what is in no file, as in a folder nobody may write.
    found: dict[str, Any] = {}
    exec("def half(x):\n    return x / 2", found)
    assert decorate(found["half"])(3.0) == 1.5
