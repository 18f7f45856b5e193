from pathlib import Path
from typing import Annotated, Literal

import pytest
from annotated_types import Ge, Gt, Le, Len, Lt
from pydantic import (
    BaseModel,
    ConfigDict,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    ValidationError,
    field_validator,
)

from radarsim.yaml_reader import MAX_BYTES, parse_yaml, read_yaml

TEXT = """\
robot:
  name: P3AT
  items:
    - {type: Radar, fov: 180}
    - type: Laser
"""
FILE = parse_yaml(Path("r.yaml"), TEXT)


@pytest.mark.parametrize(
    ("keys", "of_key", "place"),
    [
        pytest.param((), False, "r.yaml:1:1", id="the whole"),
        pytest.param(("robot",), False, "r.yaml:2:3", id="a map's first key"),
        pytest.param(("robot",), True, "r.yaml:1:1", id="the key of a map"),
        pytest.param(("robot", "name"), False, "r.yaml:2:9", id="a value"),
        pytest.param(("robot", "name"), True, "r.yaml:2:3", id="its key"),
        pytest.param(
            ("robot", "items", 0, "fov"), False, "r.yaml:4:26", id="in a list"
        ),
        pytest.param(
            ("robot", "items", 1), True, "r.yaml:5:7", id="an index is no key"
        ),
        pytest.param(("robot", "mass"), False, "r.yaml:2:3", id="missing key"),
        pytest.param(("robot", "mass"), True, "r.yaml:2:3", id="missing key as key"),
        pytest.param(("robot", "items", 7), False, "r.yaml:4:5", id="missing index"),
        pytest.param(("robot", "items", "x"), False, "r.yaml:4:5", id="key in a list"),
        pytest.param(("robot", "name", "x"), False, "r.yaml:2:9", id="key in a text"),
    ],
)
def test_every_key_path_has_a_place(
    keys: tuple[str | int, ...], of_key: bool, place: str
) -> None:
    assert FILE.place(keys, of_key=of_key) == place


def test_a_problem_names_place_and_keys() -> None:
    problem = FILE.problem(("robot", "items", 0, "fov"), "too wide")
    assert problem == "r.yaml:4:26: robot.items.0.fov: too wide"
    assert FILE.problem((), "too short") == "r.yaml:1:1: too short"


def test_problems_of_the_text_are_sorted_by_place() -> None:
    file = parse_yaml(Path("r.yaml"), "a: {b: .nan}\na: !x 1\n")
    assert file.problems == (
        "r.yaml:1:8: a.b: '.nan', expected a finite number",
        "r.yaml:2:1: a: key stands twice, first in line 1",
        "r.yaml:2:4: a: tag '!x', expected none",
    )


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    x: StrictInt = 0


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")
    switch: StrictBool = False
    low: Annotated[StrictFloat, Ge(0), Lt(9)] = 0
    high: Annotated[StrictFloat, Gt(0), Le(9)] = 1
    pair: Annotated[list[StrictFloat], Len(2, 2)] = [0, 0]
    word: StrictStr = ""
    choice: Literal["a", "b"] = "a"
    table: dict[StrictStr, StrictInt] = {}
    inner: Inner = Inner()
    odd: int = 1
    needed: StrictInt

    @field_validator("odd")
    @classmethod
    def is_odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"{value}, expected an odd number")
        return value


@pytest.mark.parametrize(
    ("line", "message"),
    [
        pytest.param("switch: 1", "1:9: o.switch: 1, expected true or false"),
        pytest.param("low: -1", "1:6: o.low: -1, expected at least 0"),
        pytest.param("low: 9", "1:6: o.low: 9, expected less than 9"),
        pytest.param("high: 0", "1:7: o.high: 0, expected more than 0"),
        pytest.param("high: 9.5", "1:7: o.high: 9.5, expected at most 9"),
        pytest.param("high: abc", "1:7: o.high: 'abc', expected a number"),
        pytest.param("pair: [1]", "1:7: o.pair: [1], expected 2 entries"),
        pytest.param("pair: [1, 2, 3]", "1:7: o.pair: [1, 2, 3], expected 2 entries"),
        pytest.param("pair: [1, x]", "1:11: o.pair.1: 'x', expected a number"),
        pytest.param("pair: 1", "1:7: o.pair: 1, expected a list"),
        pytest.param("word: 1", "1:7: o.word: 1, expected text"),
        pytest.param("choice: c", "1:9: o.choice: 'c', expected 'a' or 'b'"),
        pytest.param("table: 1", "1:8: o.table: 1, expected keys with values"),
        pytest.param("table: {k: v}", "1:12: o.table.k: 'v', expected a whole number"),
        pytest.param("inner: 1", "1:8: o.inner: 1, expected keys with values"),
        pytest.param("inner: {y: 1}", "1:9: o.inner.y: unknown key"),
        pytest.param("odd: 2", "1:6: o.odd: 2, expected an odd number"),
        pytest.param(
            "odd: x",
            "1:6: o.odd: 'x', Input should be a valid integer,"
            " unable to parse string as an integer",
        ),
        pytest.param("colour: 1", "1:1: o.colour: unknown key, expected one of ['a']"),
    ],
)
def test_refusals_say_what_came_and_what_was_expected(line: str, message: str) -> None:
    data = parse_yaml(Path("r.yaml"), f"{line}\nneeded: 1\n")
    file = parse_yaml(Path("r.yaml"), "o:\n  " + f"{line}\n  needed: 1\n")
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(data.data)
    row, column, rest = message.split(":", 2)
    expected = f"r.yaml:{int(row) + 1}:{int(column) + 2}:{rest}"
    assert file.validation_problems(caught.value, ("o",), known=["a"]) == [expected]


def test_a_missing_key_points_at_what_lacks_it() -> None:
    file = parse_yaml(Path("r.yaml"), "low: 1\n")
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(file.data)
    assert file.validation_problems(caught.value) == ["r.yaml:1:1: needed: missing"]


def test_what_came_is_cut_to_80_characters() -> None:
    file = parse_yaml(Path("r.yaml"), f"needed: {'x' * 200}\n")
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(file.data)
    shown = "'" + "x" * 79
    assert file.validation_problems(caught.value) == [
        f"r.yaml:1:9: needed: {shown}, expected a whole number"
    ]


def test_a_file_is_utf_8_with_or_without_a_mark(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    for encoding in ("utf-8", "utf-8-sig"):
        path.write_text("name: Büsche\n", encoding=encoding)
        assert read_yaml(path).data == {"name": "Büsche"}


def test_bytes_that_are_no_text_have_a_place(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_bytes(b"a: 1\nb: \xff\n")
    file = read_yaml(path)
    message = "bytes that are no text, expected UTF-8"
    assert (file.data, file.problems) == (None, (f"{path}:2:4: {message}",))


def test_a_file_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_bytes(b"#" * (MAX_BYTES + 1))
    assert read_yaml(path).problems == (f"{path}:1:1: more than {MAX_BYTES} bytes",)


def test_text_that_is_no_yaml_is_one_problem() -> None:
    file = parse_yaml(Path("r.yaml"), "a: [1\n")
    expected = "not YAML: expected ',' or ']', but got '<stream end>'"
    assert (file.data, file.problems) == (None, (f"r.yaml:2:1: {expected}",))
    assert file.place(("a", 0)) == "r.yaml:2:1"
