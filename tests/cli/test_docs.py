import re
import sys

import pytest
from commands import run_in_process as radarsim

from radarsim.cli import first_steps as module
from radarsim.cli.first_steps import FOLDER


def test_topics_are_listed_without_a_topic() -> None:
    run = radarsim("docs")
    assert run.code == 0
    for page in FOLDER.glob("*.md"):
        assert page.stem == "index" or f"[{page.stem}]({page.name})" in run.text


def test_page_is_plain_markdown_in_a_pipe() -> None:
    run = radarsim("docs", "radar")
    assert run.out == (FOLDER / "radar.md").read_bytes()


def test_page_is_rendered_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr("pydoc.pager", print)
    module.docs("maps")
    text = capsys.readouterr().out
    assert "Your first map" in text
    assert "## " not in text  # headings are rendered
    assert "<!--" not in text
    assert ".readme/" not in text  # a terminal shows no pictures
    assert "radarsim docs navigation" in text  # what a link means here


@pytest.mark.parametrize("page", sorted(page.stem for page in FOLDER.glob("*.md")))
def test_terminal_shows_no_links_to_files_and_no_long_lines(
    page: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr("pydoc.pager", print)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")
    module.docs(page)
    text = capsys.readouterr().out
    assert not re.search(r"\((#|[\w./]*\.(md|ipynb|py))", text)
    assert not re.search(r"\x1b\[(\d+;)*[349][0-8][;m]", text)  # colours
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    assert max(len(line) for line in plain.splitlines()) <= 100
