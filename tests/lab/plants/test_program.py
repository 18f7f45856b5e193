"""The program that writes the mesh files of plants."""

import re
import sys
from pathlib import Path

import pytest

from radarsim import shipped_maps
from radarsim.generators.plants.plant import plant_files
from radarsim.lab import plants as program


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    words = [str(argument) for argument in arguments]
    monkeypatch.setattr(sys, "argv", ["radarsim.lab.plants", *words])
    with pytest.raises(SystemExit) as end:
        program.main()
    return int(end.value.code or 0)


def test_program_writes_all_files_of_a_seed(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    folder = tmp_path / "new" / "meshes"
    assert run(monkeypatch, folder, "--seed", 3) == 0
    for name, content in plant_files(3).items():
        assert (folder / name).read_bytes() == content
    assert capsys.readouterr().out.count("bytes\n") == 5


# Few rays give nearly the same; the map has the values of the default number.
@pytest.mark.parametrize(
    ("rays", "accuracy"),
    [(100, 0.03), pytest.param(1600, 5e-3, marks=pytest.mark.slow)],
)
def test_program_prints_the_loss_of_foliage_and_draws_it(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    rays: int,
    accuracy: float,
) -> None:
    picture = tmp_path / "shapes.png"
    options = ("--figure", picture, "--rays", rays)
    assert run(monkeypatch, tmp_path / "out", *options) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    output = capsys.readouterr().out
    text = shipped_maps()["forest_edge"].read_text()
    for shape, word in (
        ("ball", "takes"),
        ("cloud", "takes"),
        ("leaves", "each takes"),
    ):
        (line,) = (line for line in output.splitlines() if f"{shape}, {word}" in line)
        number = float(line.split(f"{word} ")[1].split()[0].strip(":"))
        assert f"foliage_{shape}: {{" in text
        key = "sheet_loss" if shape == "leaves" else "density"
        found = re.search(rf"foliage_{shape}: {{.*\b{key}: ([0-9.]+)", text)
        assert found is not None
        shipped = found[1]
        assert number == pytest.approx(float(shipped), rel=accuracy)


def test_folder_that_cannot_be_created_is_reported(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("")
    assert run(monkeypatch, tmp_path / "file") == 2
    assert "cannot write" in capsys.readouterr().err
