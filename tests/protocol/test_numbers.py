import math
import re
import struct
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage
from radarsim.protocol.line_template import NumberFormat, Rounding
from radarsim.protocol.message import parse_flag, parse_number, parse_numbers

WRITABLE = st.floats(-2e9, 2e9) | st.floats(-1e-3, 1e-3) | st.floats(-100, 100)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        pytest.param("-0,5", -0.5, id="decimal comma"),
        pytest.param(".4", 0.4, id="leading point"),
        pytest.param("4.", 4.0, id="trailing point"),
        pytest.param("+1", 1.0, id="plus"),
        pytest.param(" 2.695418 ", 2.695418, id="blanks"),
        pytest.param("1E-05", 1e-5, id="exponent, .NET"),
        pytest.param("2147483648", 2.0**31, id="the largest"),
        pytest.param("1e-400", 0.0, id="too small to matter"),
    ],
)
def test_numbers_are_parsed_in_every_locale(text: str, value: float) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", ".", ",", "-", "abc", "nan", "NaN", "inf", "-Infinity", "1_0"),
        *("0x10", "1,000.5", "1.2.3", "1 2", "--1", "1e", "e5", "1f", "{1"),
        *("\0", "1\0", "\u00b2"),
    ],
)
def test_text_that_is_not_a_number_is_malformed(text: str) -> None:
    with pytest.raises(MalformedMessage, match=r", expected a number$"):
        parse_number(text)


@pytest.mark.parametrize("text", ["-1e400", "1e10"])
def test_number_out_of_range_is_malformed(text: str) -> None:
    with pytest.raises(MalformedMessage, match=r", expected at most 2\.14748e\+09$"):
        parse_number(text)


def test_error_truncates_a_long_text() -> None:
    with pytest.raises(MalformedMessage, match=f"^'{'x' * 80}', expected a number$"):
        parse_number("x" * 5000)


@given(text=st.text(max_size=12) | st.from_regex(r"[-+.,0-9eE]{1,9}", fullmatch=True))
def test_any_text_is_a_finite_number_or_malformed(text: str) -> None:
    try:
        value = parse_number(text)
    except MalformedMessage:
        return
    assert abs(value) <= 2**31


@pytest.mark.parametrize(
    ("text", "values"),
    [
        pytest.param("4.5,1.9,1.8", (4.5, 1.9, 1.8), id="commas"),
        pytest.param("4.5 1.9 1.8", (4.5, 1.9, 1.8), id="blanks"),
        pytest.param("  4.5   1.9\t1.8 ", (4.5, 1.9, 1.8), id="many blanks"),
        pytest.param("4.5 , 1.9 , 1.8", (4.5, 1.9, 1.8), id="blanks around commas"),
        pytest.param("47,17 -55,70 -2,25", (47.17, -55.7, -2.25), id="decimal commas"),
        pytest.param("0,0000, 0,0000, 1,5", (0, 0, 1.5), id="all kinds of commas"),
    ],
)
def test_vectors_are_parsed_with_any_separator(
    text: str, values: tuple[float, float, float]
) -> None:
    assert parse_numbers(text, 3) == values


@pytest.mark.parametrize("text", ["", "1", "1,2", "1 2", "1,2,3,4", "1 2 3 4", "1,2,"])
def test_vector_of_wrong_length_is_malformed(text: str) -> None:
    with pytest.raises(MalformedMessage, match=r"expected (3 numbers|a number)$"):
        parse_numbers(text, 3)


@pytest.mark.parametrize(
    "text", ["1,nan,2", "1 abc 2", "1,,2", "1,2,1e400", "1 2 3,,,"]
)
def test_vector_with_a_bad_number_is_malformed(text: str) -> None:
    with pytest.raises(MalformedMessage):
        parse_numbers(text, 3)


@given(
    values=st.tuples(*[st.floats(-1e6, 1e6).map(lambda x: round(x, 4))] * 3),
    form=st.sampled_from(
        [(",", "."), (", ", "."), (" ", "."), (" ", ","), (", ", ",")]
    ),
)
def test_vector_is_the_same_in_all_forms(
    values: tuple[float, float, float], form: tuple[str, str]
) -> None:
    between, point = form
    text = between.join(f"{value:.4f}".replace(".", point) for value in values)
    assert parse_numbers(text, 3) == values


def test_only_the_word_true_is_true() -> None:
    texts = ["true", "True", "TRUE", "false", "1", "yes", ""]
    assert [parse_flag(text) for text in texts] == [True] * 3 + [False] * 4


@given(value=WRITABLE, decimals=st.integers(1, 6))
def test_rounded_numbers_are_the_nearest_and_have_no_negative_zero(
    value: float, decimals: int
) -> None:
    text = NumberFormat(decimals).format(value)
    assert re.fullmatch(rf"-?[0-9]+\.[0-9]{{{decimals}}}", text)
    assert not re.fullmatch(r"-[0.]+", text)
    assert abs(Fraction(text) - Fraction(value)) * 2 <= Fraction(1, 10**decimals)


def to_float32(value: Fraction | float) -> Fraction:
    return Fraction(struct.unpack("<f", struct.pack("<f", float(value)))[0])


@given(value=WRITABLE, decimals=st.sampled_from([2, 3, 4]))
@example(value=1.3, decimals=4)
@example(value=0.99999994, decimals=4)
def test_truncated_numbers_follow_float32_arithmetic(
    value: float, decimals: int
) -> None:
    single = to_float32(value)
    size = abs(single)
    part = to_float32(to_float32(size - int(size)) * 10**decimals)
    sign = "-" if single < 0 else ""
    expected = f"{sign}{int(size)}.{int(part):0{decimals}d}"
    assert NumberFormat(decimals, Rounding.TRUNCATED).format(value) == expected


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        pytest.param(1.3, 4, "1.2999", id="top speed of a wheel"),
        pytest.param(2.3, 2, "2.29", id="range"),
        pytest.param(-1e-6, 3, "-0.000", id="tiny negative"),
        pytest.param(-0.0, 4, "0.0000", id="negative zero"),
    ],
)
def test_truncated_numbers_match_usarsim(
    value: float, decimals: int, text: str
) -> None:
    assert NumberFormat(decimals, Rounding.TRUNCATED).format(value) == text


@pytest.mark.parametrize("rule", list(Rounding))
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 2.0**31])
def test_numbers_out_of_range_are_clipped(rule: Rounding, value: float) -> None:
    with pytest.warns(RuntimeWarning, match="was clipped"):
        text = NumberFormat(2, rule).format(value)
    largest = "2147483520.00"
    signed = f"-{largest}" if value < 0 else largest
    assert text == ("0.00" if math.isnan(value) else signed)
