"""Every code block of the README and the manual runs, and every link resolves."""

import os
import re
import runpy
import shlex
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from subprocess import check_output
from typing import Any

import pytest
import yaml
from commands import Run, run_in_process
from documents import MANUAL, PAGES, ROOT, Snippet, anchors_of, links_of, snippets_of
from windows import run_with

import radarsim

# Imported before suites run, which forget the modules that they have imported: objects
# replaced below would be those of another copy, and antennas those of another class.
from radarsim.addons.fmcw import rotation_schedule as _antennas  # noqa: F401
from radarsim.cli.app import app
from radarsim.scene.map_file import load_variants
from radarsim.server import tcp_server
from radarsim.simulation.map_warnings import occupied_starts, trial_warnings

pytest_plugins = ["pytester"]

TUTORIAL = MANUAL / "tutorial.md"
SNIPPETS = [snippet for page in PAGES for snippet in snippets_of(page)]
LANGUAGES = {"sh", "console", "python", "suite", "yaml", "text"}


def cases(*languages: str) -> list[Any]:
    """Give each block of these languages a test, with the marks that it asks for."""
    found = []
    for snippet in SNIPPETS:
        if snippet.language not in languages or "skip" in snippet.flags:
            continue
        if snippet.page == TUTORIAL and snippet.language == "python":
            continue  # its programs need each other, and run below
        marks = [pytest.mark.slow] if "slow" in snippet.flags else []
        if snippet.served_map:
            marks.append(pytest.mark.usarsim(map=snippet.served_map, speed=5))
        found.append(pytest.param(snippet, id=snippet.name, marks=marks))
    return found


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to a folder that looks like a checkout to the commands in it."""
    (tmp_path / "maps").symlink_to(ROOT / "maps")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def prepare(snippet: Snippet, request: pytest.FixtureRequest) -> int | None:
    """Write the files that its page names, and start the server that it needs."""
    for other in snippets_of(snippet.page):
        if other.file_name:
            Path(other.file_name).write_text(other.text, encoding="utf-8")
    if snippet.served_map is None:
        return None
    port: int = request.getfixturevalue("usarsim_server").port
    return port


@pytest.mark.parametrize("snippet", cases("python"))
def test_python_runs(
    snippet: Snippet, folder: Path, request: pytest.FixtureRequest
) -> None:
    port = prepare(snippet, request)
    script = folder / "snippet.py"
    script.write_text(snippet.text.replace("3000", str(port)), encoding="utf-8")
    runpy.run_path(str(script), run_name="__main__")


def test_program_with_a_window_runs(display: dict[str, str]) -> None:
    (program,) = (each.text for each in SNIPPETS if "sim.show()" in each.text)
    assert run_with(display, program) == []


@pytest.mark.slow  # the notebook, which has the same programs, is in every sample
@pytest.mark.timeout(1200)  # a busy machine takes minutes
def test_programs_of_the_tutorial_print_what_it_says(tmp_path: Path) -> None:
    """In an empty folder, one after the other, as a reader runs them."""
    environment = {**os.environ, "MPLBACKEND": "agg"}
    said: list[str] = []
    programs = 0
    for snippet in snippets_of(TUTORIAL):
        if snippet.language == "text":
            assert set(snippet.text.splitlines()) <= set(said)
        elif snippet.language in {"python", "yaml"}:
            assert snippet.file_name, "a block without a comment that names its file"
            (tmp_path / snippet.file_name).write_text(snippet.text, encoding="utf-8")
            if snippet.language == "python":
                command = [sys.executable, snippet.file_name]
                said = check_output(
                    command, cwd=tmp_path, env=environment, text=True
                ).splitlines()
                programs += 1
    assert programs == 9
    assert {"see.png", "judge.png", "noise.png"} <= {f.name for f in tmp_path.iterdir()}


@pytest.mark.parametrize("snippet", cases("suite"))
def test_suites_pass(snippet: Snippet, pytester: pytest.Pytester) -> None:
    for other in SNIPPETS:
        if other.language == "yaml" and other.file_name:
            Path(other.file_name).write_text(other.text, encoding="utf-8")
    assert snippet.file_name, "a module without a comment that names its file"
    pytester.makepyfile(**{Path(snippet.file_name).stem: snippet.text})
    if snippet.file_name == "conftest.py":
        pytester.makepyfile(
            "def test_map(usarsim_map, usarsim_client):\n"
            "    assert usarsim_map.stem in usarsim_client.read_line()\n"
        )
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function\n")
    result = pytester.runpytest_inprocess("-p", "no:randomly", "-p", "no:cacheprovider")
    assert result.ret == 0


@pytest.mark.parametrize("snippet", cases("sh", "console"))
@pytest.mark.usefixtures("folder")
def test_commands_run(
    snippet: Snippet,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def do_not_serve(*_: object) -> int:
        return 0

    monkeypatch.setattr(tcp_server, "serve", do_not_serve)
    port = prepare(snippet, request)
    for command, output in commands_of(snippet):
        words = shlex.split(command)
        if "parse" in snippet.flags or words[1] == "drive":
            parse(words[1:])
            continue
        run = execute(words[1:], port)
        assert run.code == 0, (command, run.err)
        said = [*run.text.splitlines(), *run.err.splitlines()]
        if "slow" in snippet.flags:  # its numbers are of one machine
            assert set(labels(output)) <= set(labels(said))
        else:
            assert [line for line in output if line not in said] == []


def commands_of(snippet: Snippet) -> Iterator[tuple[str, list[str]]]:
    """Return the program's commands of a block, each with the lines that it prints."""
    if snippet.language == "sh":
        lines = snippet.text.replace("\\\n", " ").splitlines()
        for line in lines:
            command = line.rpartition("&& ")[2].removeprefix(".venv/bin/")
            if command and not command.startswith("#"):
                assert command.startswith("radarsim "), command
                yield command, []
        return
    for part in re.split(r"^\$ ", snippet.text, flags=re.MULTILINE)[1:]:
        command, *output = part.splitlines()
        yield command, [line for line in output if line.strip() not in {"", "..."}]


def execute(words: list[str], port: int | None) -> Run:
    """Run a command; what follows ``>`` is a file for its output."""
    words, target = (words[:-2], words[-1]) if ">" in words else (words, None)
    if port is not None:
        own = [word.replace(":3000", f":{port}") for word in words]
        words = own if own != words else [*words, "--port", str(port)]
    run = run_in_process(*words)
    if target:
        Path(target).write_bytes(run.out)
    return run


def parse(words: list[str]) -> None:
    """Check that a command and its options exist, and its values are possible."""
    with app.make_context("radarsim", words[:1]) as context:
        _, command, _ = app.resolve_command(context, words[:1])
        assert command is not None
        command.make_context(words[0], words[1:], parent=context)


def labels(lines: Iterable[str]) -> list[str]:
    """Return the words of lines, without their numbers."""
    return [" ".join(re.findall(r"[a-z]{2,}", line)[:2]) for line in lines]


@pytest.mark.parametrize("snippet", cases("yaml"))
def test_maps_are_right(snippet: Snippet, folder: Path) -> None:
    if "fragment" in snippet.flags:
        yaml.safe_load(snippet.text)
        return
    assert snippet.file_name, "a map without a comment that names its file"
    path = folder / snippet.file_name
    path.write_text(snippet.text, encoding="utf-8")
    scene, *_ = load_variants(str(path))
    assert scene.starts
    assert occupied_starts(scene) == []
    assert trial_warnings(scene) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_code_blocks_have_languages_that_are_tested(page: Path) -> None:
    assert {each.language for each in snippets_of(page)} <= LANGUAGES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for link in links_of(page):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.is_file(), link
        assert not anchor or anchor in anchors_of(target), link


def test_index_links_to_every_page_and_readme_to_the_index() -> None:
    names = {page.name for page in MANUAL.glob("*.md")}
    listed = {link.partition("#")[0] for link in links_of(MANUAL / "index.md")}
    assert listed == names - {"index.md"}
    assert "index.md" in {Path(link).name for link in links_of(ROOT / "README.md")}


def test_readme_is_read_in_some_minutes() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 170
    assert len(text.split()) <= 1100


def test_one_sentence_says_what_radarsim_is() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    sentence = project["project"]["description"]
    texts = [(ROOT / "README.md").read_text("utf-8"), radarsim.__doc__ or ""]
    texts += [(MANUAL / "index.md").read_text("utf-8"), execute(["--help"], None).text]
    for text in texts:
        assert sentence in " ".join(text.split())


def test_commands_page_lists_every_command() -> None:
    text = (MANUAL / "commands.md").read_text(encoding="utf-8")
    for name in app.entries:
        assert f"| `radarsim {name}" in text, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_that_a_text_names_exist(page: Path) -> None:
    named = re.findall(r"`radarsim ([a-z]+)", page.read_text(encoding="utf-8"))
    assert set(named) <= set(app.entries)


def test_readme_has_the_commands_that_ci_runs() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in ("serve", "test"):
        block = text.partition(f"<!-- command: {name} -->\n")[2].partition("```sh\n")[2]
        assert " && " in block.partition("```")[0]
