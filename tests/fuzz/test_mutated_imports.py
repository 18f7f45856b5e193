"""Changed glTF and SDF files become maps, or errors of the package."""

import resource
from pathlib import Path

import pytest
from mutated_files import outcomes

pytestmark = pytest.mark.slow

COUNT = 400
MAX_GROWTH = 2**20  # KiB: 1 GiB


def test_changed_files_are_imported_or_refused(tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    counts = outcomes(tmp_path, range(COUNT))
    growth = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert counts.total() == COUNT
    assert growth < MAX_GROWTH
    for kind in ("gltf", "sdf"):  # both outcomes, else the changes are too strong
        assert counts[f"{kind}: refused"] > COUNT / 50
        assert counts[f"{kind}: a map"] > COUNT / 50
