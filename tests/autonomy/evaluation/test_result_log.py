"""Logs of results survive a kill, and what is no log is refused."""

from pathlib import Path

import pytest

from radarsim.autonomy.evaluation.task_runner import opened_log, read_log


def test_line_of_a_killed_run_is_left_out_and_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    assert read_log(file, ["a"], "a result") == []
    with opened_log(file) as add:
        add({"a": 1})
    file.write_text(file.read_text() + '{"a": 2, "b"')
    assert read_log(file, ["a"], "a result") == [{"a": 1}]
    with opened_log(file) as add:
        add({"a": 3})
    assert read_log(file, ["a"], "a result") == [{"a": 1}, {"a": 3}]


@pytest.mark.parametrize("text", ["hello\n", "[1]\n", '{"b": 1}\n', "\xff\n"])
def test_other_file_is_refused_with_its_first_line_that_is_none(
    tmp_path: Path, text: str
) -> None:
    file = tmp_path / "notes.txt"
    file.write_bytes(b'{"a": 1}\n' + text.encode("latin1"))
    with pytest.raises(ValueError, match=r"notes\.txt:2: expected a result"):
        read_log(file, ["a"], "a result")


def test_without_a_file_nothing_is_written() -> None:
    with opened_log(None) as add:
        add({"a": 1})
