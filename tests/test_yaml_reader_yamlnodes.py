from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.yaml_reader import MAX_DEPTH, MAX_VALUES, Unreadable, read_nodes


def read(text: str) -> Any:
    root, found = read_nodes(text)
    assert found == []
    return root.plain()


def problems(text: str) -> list[tuple[tuple[int, int], tuple[str | int, ...], str]]:
    return [(each.place, each.path, each.message) for each in read_nodes(text)[1]]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        pytest.param("1", 1, id="whole number"),
        pytest.param("-12", -12, id="negative"),
        pytest.param("010", 10, id="leading zero is decimal"),
        pytest.param("0o17", 15, id="octal"),
        pytest.param("0x1F", 31, id="hexadecimal"),
        pytest.param("1e-3", 0.001, id="exponent without a dot"),
        pytest.param(".5", 0.5, id="no digit before the dot"),
        pytest.param("5.", 5.0, id="no digit after the dot"),
        pytest.param("12:30", "12:30", id="no base 60"),
        pytest.param("1_000", "1_000", id="no underscores"),
        pytest.param("on", "on", id="on is text"),
        pytest.param("NO", "NO", id="NO is text"),
        pytest.param("true", True, id="true"),
        pytest.param("False", False, id="false"),
        pytest.param("~", None, id="null"),
        pytest.param("", None, id="nothing"),
        pytest.param("'1'", "1", id="quoted is text"),
        pytest.param('"true"', "true", id="quoted truth is text"),
        pytest.param("|\n  1\n", "1\n", id="a block is text"),
        pytest.param("2026-01-02", "2026-01-02", id="no dates"),
        pytest.param("<<: {a: 1}", {"<<": {"a": 1}}, id="no merging"),
        pytest.param("1: x", {"1": "x"}, id="keys are text"),
        pytest.param("{radius: 0,1}", {"radius": 0, "1": None}, id="decimal comma"),
        pytest.param("a: &x [1]\nb: *x", {"a": [1], "b": [1]}, id="alias"),
        pytest.param("# nothing", None, id="a comment"),
    ],
)
def test_scalars_follow_the_core_schema(text: str, value: Any) -> None:
    result = read(text)
    assert (result, type(result)) == (value, type(value))


@pytest.mark.parametrize(
    ("text", "place", "path", "message"),
    [
        pytest.param(
            "a: 1\nb: 2\na: 3", (3, 1), ("a",), "key stands twice, first in line 1"
        ),
        pytest.param(
            "a: {b: !!python/object:os.system 3}",
            (1, 8),
            ("a", "b"),
            "tag 'tag:yaml.org,2002:python/object:os.system', expected none",
            id="tag on a scalar",
        ),
        pytest.param("- !x {}", (1, 3), (0,), "tag '!x', expected none", id="on a map"),
        pytest.param("[.nan]", (1, 2), (0,), "'.nan', expected a finite number"),
        pytest.param("-.Inf", (1, 1), (), "'-.Inf', expected a finite number"),
        pytest.param("a: 1e400", (1, 4), ("a",), "'1e400', expected a finite number"),
        pytest.param(
            "9" * 500,
            (1, 1),
            (),
            "'" + "9" * 79 + ", expected a finite number",
            id="500 digits",
        ),
        pytest.param(
            "a: *b", (1, 4), ("a",), "alias 'b', expected an anchor before it"
        ),
        pytest.param(
            "a: &b [*b]",
            (1, 8),
            ("a", 0),
            "alias 'b', expected an anchor before it",
            id="alias inside of itself",
        ),
        pytest.param(
            "? [x]\n: 3",
            (1, 3),
            (),
            "a key that is no plain text, expected a name",
            id="list as key",
        ),
        pytest.param(
            "a: {[x]: 3}",
            (1, 5),
            ("a",),
            "a key that is no plain text, expected a name",
            id="list as an inner key",
        ),
    ],
)
def test_what_is_refused_has_its_place(
    text: str, place: tuple[int, int], path: tuple[str | int, ...], message: str
) -> None:
    assert problems(text) == [(place, path, message)]


def test_what_is_wrong_inside_of_a_key_has_its_place() -> None:
    assert problems("a: {? [!x y] : 3}") == [
        ((1, 8), ("a", "?", 0), "tag '!x', expected none"),
        ((1, 7), ("a",), "a key that is no plain text, expected a name"),
    ]


def test_all_problems_are_found_and_reading_goes_on() -> None:
    root, found = read_nodes("a: .nan\na: !x 1\nb: !y 2\n")
    assert [each.place[0] for each in found] == [1, 2, 2, 3]
    assert root.plain() == {"a": 1.0, "b": 2}


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        pytest.param(
            "a: b: c", (1, 5), "not YAML: mapping values are not allowed here"
        ),
        pytest.param(
            "a: [1",
            (1, 6),
            "not YAML: expected ',' or ']', but got '<stream end>'",
            id="open bracket",
        ),
        pytest.param("a: 1\nb: \0", (2, 4), "not YAML: character '\\x00'", id="NUL"),
        pytest.param("a: 1\n---\n", (2, 1), "a second document, expected one"),
        pytest.param(
            "[" * 50, (1, MAX_DEPTH + 2), "more than 32 levels", id="deep nesting"
        ),
        pytest.param(
            "? " * 3000 + "a",
            (1, 2 * MAX_DEPTH + 3),
            "more than 32 levels",
            id="keys of keys",
        ),
        pytest.param(
            "{" * 3000 + "a: 1" + "}: 1" * 2999 + "}",
            (1, MAX_DEPTH + 2),
            "more than 32 levels",
            id="maps as keys of maps",
        ),
    ],
)
def test_what_cannot_be_read_has_its_place(
    text: str, place: tuple[int, int], message: str
) -> None:
    with pytest.raises(Unreadable) as caught:
        read_nodes(text)
    assert (caught.value.place, caught.value.message) == (place, message)


def test_aliases_cannot_multiply() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    with pytest.raises(Unreadable, match=f"more than {MAX_VALUES} values"):
        read_nodes("\n".join(lines))


def test_aliases_cannot_pile_up_depth() -> None:
    lines = ["a0: &a0 [x]"]
    lines += [f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 2000)]
    with pytest.raises(Unreadable, match="more than 32 levels"):
        read_nodes("\n".join(lines))


@given(st.text(alphabet="ab:-[]{}&*!|>'\"#%@?,\n \t01.", max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    with suppress(Unreadable):
        read_nodes(text)[0].plain()
