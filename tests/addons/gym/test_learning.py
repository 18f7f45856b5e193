"""The trainer of the manual learns to drive to its goals."""

import runpy
from pathlib import Path

import pytest
from documents import MANUAL, snippets_of


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_policy_reaches_eight_of_ten_goals(seed: int, tmp_path: Path) -> None:
    page = MANUAL / "learning.md"
    trainer = next(s for s in snippets_of(page) if s.file_name == "train.py")
    script = tmp_path / "train.py"
    script.write_text(trainer.text, encoding="utf-8")
    functions = runpy.run_path(str(script))
    policy = functions["train"](seed)
    assert functions["count_reached"](policy, seed=10_000 + seed) >= 8
