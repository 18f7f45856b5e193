import math
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from annotated_types import Ge, Gt, Le, Len, Lt
from hypothesis import given
from hypothesis import strategies as st
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

from radarsim.yaml_reader import (
    MAX_BYTES,
    MAX_DEPTH,
    MAX_VALUES,
    UnreadableYaml,
    compose,
    parse_plain,
    parse_yaml,
    read_yaml,
)

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
        ((), False, "r.yaml:1:1"),
        (("robot",), False, "r.yaml:2:3"),
        (("robot",), True, "r.yaml:1:1"),
        (("robot", "name"), True, "r.yaml:2:3"),
        (("robot", "items", 0, "fov"), False, "r.yaml:4:26"),
        (("robot", "items", 1), True, "r.yaml:5:7"),
        (("robot", "mass"), False, "r.yaml:2:3"),
        (("robot", "items", 7), False, "r.yaml:4:5"),
        (("robot", "name", "x"), False, "r.yaml:2:9"),
    ],
)
def test_every_key_path_has_a_place(
    keys: tuple[str | int, ...], of_key: bool, place: str
) -> None:
    assert FILE.place(keys, of_key=of_key) == place


def test_problem_has_place_and_keys() -> None:
    problem = FILE.problem(("robot", "items", 0, "fov"), "too wide")
    assert problem == "r.yaml:4:26: robot.items.0.fov: too wide"
    assert FILE.problem((), "too short") == "r.yaml:1:1: too short"


def test_problems_of_the_text_are_sorted_by_place() -> None:
    file = parse_yaml(Path("r.yaml"), "a: {b: .nan}\na: !x 1\n")
    assert file.problems == (
        "r.yaml:1:8: a.b: '.nan', expected a finite number",
        "r.yaml:2:1: a: duplicate key, first in line 1",
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
        ("switch: 1", "1:9: o.switch: 1, expected true or false"),
        ("low: -1", "1:6: o.low: -1, expected at least 0"),
        ("low: 9", "1:6: o.low: 9, expected less than 9"),
        ("high: 0", "1:7: o.high: 0, expected more than 0"),
        ("high: 9.5", "1:7: o.high: 9.5, expected at most 9"),
        ("pair: [1, 2, 3]", "1:7: o.pair: [1, 2, 3], expected 2 entries"),
        ("pair: [1, x]", "1:11: o.pair.1: 'x', expected a number"),
        ("pair: 1", "1:7: o.pair: 1, expected a list"),
        ("word: 1", "1:7: o.word: 1, expected text"),
        ("choice: c", "1:9: o.choice: 'c', expected 'a' or 'b'"),
        ("table: {k: v}", "1:12: o.table.k: 'v', expected a whole number"),
        ("inner: 1", "1:8: o.inner: 1, expected keys with values"),
        ("inner: {y: 1}", "1:9: o.inner.y: unknown key"),
        ("odd: 2", "1:6: o.odd: 2, expected an odd number"),
        ("odd: x", "1:6: o.odd: 'x', expected a whole number"),
        ("colour: 1", "1:1: o.colour: unknown key, expected one of ['a']"),
    ],
)
def test_validation_problems_have_value_and_expectation(
    line: str, message: str
) -> None:
    data = parse_yaml(Path("r.yaml"), f"{line}\nneeded: 1\n")
    file = parse_yaml(Path("r.yaml"), "o:\n  " + f"{line}\n  needed: 1\n")
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(data.data)
    row, column, rest = message.split(":", 2)
    expected = f"r.yaml:{int(row) + 1}:{int(column) + 2}:{rest}"
    assert file.validation_problems(caught.value, ("o",), known=["a"]) == [expected]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("low: 1\n", "1:1: needed: missing"),  # the place of the dict that lacks it
        (f"needed: {'x' * 200}", f"1:9: needed: '{'x' * 79}, expected a whole number"),
    ],
    ids=["missing key", "long value"],
)
def test_problems_of_a_file_without_other_keys(text: str, problem: str) -> None:
    file = parse_yaml(Path("r.yaml"), text)
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(file.data)
    assert file.validation_problems(caught.value) == [f"r.yaml:{problem}"]


def test_file_is_utf_8_with_or_without_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    for encoding in ("utf-8", "utf-8-sig"):
        path.write_text("name: Büsche\n", encoding=encoding)
        assert read_yaml(path).data == {"name": "Büsche"}


def test_invalid_utf_8_has_a_place(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_bytes(b"a: 1\nb: \xff\n")
    file = read_yaml(path)
    message = "bytes that are not text, expected UTF-8"
    assert (file.data, file.problems) == (None, (f"{path}:2:4: {message}",))


def test_too_large_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_bytes(b"#" * (MAX_BYTES + 1))
    assert read_yaml(path).problems == (f"{path}:1:1: more than {MAX_BYTES} bytes",)


def test_invalid_yaml_is_one_problem() -> None:
    file = parse_yaml(Path("r.yaml"), "a: [1\n")
    expected = "not YAML: did not find expected ',' or ']'"
    assert (file.data, file.problems) == (None, (f"r.yaml:2:1: {expected}",))
    assert file.place(("a", 0)) == "r.yaml:2:1"


def problems(text: str) -> list[tuple[tuple[int, int], tuple[str | int, ...], str]]:
    return compose(text)[2]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("12:30", "12:30"),
        ("on", "on"),
        ("true", True),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ('"true"', "true"),
        ("|\n  1\n", "1\n"),
        ("2026-01-02", "2026-01-02"),
        ("<<: {a: 1}", {"<<": {"a": 1}}),
        ("1: x", {"1": "x"}),
        ("{radius: 0,1}", {"radius": 0, "1": None}),
        ("a: &x [1]\nb: *x", {"a": [1], "b": [1]}),
        ("# nothing", None),
    ],
)
def test_scalars_follow_the_core_schema(text: str, value: Any) -> None:
    result, _, found = compose(text)
    assert (found, result, type(result)) == ([], value, type(value))


@pytest.mark.parametrize(
    ("text", "position", "keys", "message"),
    [
        ("a: 1\nb: 2\na: 3", (3, 1), ("a",), "duplicate key, first in line 1"),
        (
            "a: {b: !!python/object:os.system 3}",
            (1, 8),
            ("a", "b"),
            "tag 'tag:yaml.org,2002:python/object:os.system', expected none",
        ),
        ("- !x {}", (1, 3), (0,), "tag '!x', expected none"),
        ("-.Inf", (1, 1), (), "'-.Inf', expected a finite number"),
        ("a: 1e400", (1, 4), ("a",), "'1e400', expected a finite number"),
        ("9" * 500, (1, 1), (), "'" + "9" * 79 + ", expected a finite number"),
        ("a: {[x]: 3}", (1, 5), ("a",), "a key that is not text, expected a name"),
    ],
)
def test_refused_node_has_position_and_keys(
    text: str, position: tuple[int, int], keys: tuple[str | int, ...], message: str
) -> None:
    assert problems(text) == [(position, keys, message)]


def test_problem_inside_of_a_key_has_position_and_keys() -> None:
    assert problems("a: {? [!x y] : 3}") == [
        ((1, 8), ("a", "?", 0), "tag '!x', expected none"),
        ((1, 7), ("a",), "a key that is not text, expected a name"),
    ]


def test_all_problems_are_found_and_reading_continues() -> None:
    data, _, found = compose("a: .nan\na: !x 1\nb: !y 2\n")
    assert [position[0] for position, *_ in found] == [1, 2, 2, 3]
    assert data == {"a": 1.0, "b": 2}


@pytest.mark.parametrize(
    ("text", "position", "message"),
    [
        ("a: b: c", (1, 5), "not YAML: mapping values are not allowed in this context"),
        ("a: [1", (1, 6), "not YAML: did not find expected ',' or ']'"),
        ("\ta: 1", (1, 1), "not YAML: a tab, expected spaces"),
        ("b: ü\na:\n  -\tb: 1", (3, 4), "not YAML: a tab, expected spaces"),
        ("a: 1\nb: \0", (2, 4), "not YAML: character '\\x00'"),
        (
            "a: 1\n---\n",
            (2, 1),
            "not YAML: expected a single document in the stream,"
            " but found another document",
        ),
        ("a: *b", (1, 4), "not YAML: found undefined alias"),
        ("a: &b [*b]", (1, 4), "more than 32 levels of nesting"),
        ("[" * 50, (1, MAX_DEPTH + 1), "more than 32 levels of nesting"),
        ("? " * 3000 + "a", (1, 2 * MAX_DEPTH + 1), "more than 32 levels of nesting"),
        (
            # libyaml of PyYAML 6.0.4 looks ahead, and refuses more than 1000 itself
            "{" * 900 + "a: 1" + "}: 1" * 899 + "}",
            (1, MAX_DEPTH + 1),
            "more than 32 levels of nesting",
        ),
    ],
)
def test_unreadable_text_has_a_position(
    text: str, position: tuple[int, int], message: str
) -> None:
    with pytest.raises(UnreadableYaml) as caught:
        compose(text)
    assert (caught.value.position, caught.value.message) == (position, message)


def test_number_of_expanded_values_is_limited() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    with pytest.raises(UnreadableYaml, match=f"more than {MAX_VALUES} values"):
        compose("\n".join(lines))


def test_depth_of_expanded_aliases_is_limited() -> None:
    lines = ["a0: &a0 [x]"]
    lines += [f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 2000)]
    with pytest.raises(UnreadableYaml, match="more than 32 levels of nesting"):
        compose("\n".join(lines))


def test_plain_text_may_have_infinite_numbers_but_no_problems() -> None:
    assert parse_plain("[.inf, -.Inf, 3]") == [math.inf, -math.inf, 3]
    assert repr(parse_plain(".nan")) == "nan"
    for text in ("a: 1\na: 2", "!x 1", "[1"):
        with pytest.raises(ValueError, match=r"duplicate|tag|not YAML"):
            parse_plain(text)


@given(st.text(alphabet="ab:-[]{}&*!|>'\"#%@?,\n \t01.", max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    with suppress(UnreadableYaml):
        compose(text)
