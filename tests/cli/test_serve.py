from collections.abc import Callable
from typing import Any

import pytest
import typer

from radarsim.cli.options import read_item_settings

Command = Callable[..., Any]


def test_settings_are_grouped_by_item() -> None:
    texts = ["lms200.max_range=20", "InsTest.sigma=0", "lms200.side_offset_uu=0"]
    assert read_item_settings(texts) == {
        "lms200": {"max_range": 20, "side_offset_uu": 0},
        "InsTest": {"sigma": 0},
    }


@pytest.mark.parametrize("text", ["max_range=20", ".max_range=20", "lms200.=2", "a.b"])
def test_setting_without_item_key_or_value_is_a_usage_error(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="expected"):
        read_item_settings([text])


@pytest.mark.parametrize(
    ("options", "text"),
    [
        pytest.param(["--set", "lms300.max_range=2"], "'lms300'", id="item"),
        pytest.param(["--set", "lms200.max_rnge=2"], "max_rnge", id="setting"),
        pytest.param(["--set", "InsTest.sigma=-1"], "sigma", id="value"),
        pytest.param(["--set", "Odometer.sigma=1"], "Odometer", id="no settings"),
        pytest.param(["--speed", "0"], "expected above 0", id="speed zero"),
        pytest.param(["--speed", "inf"], "expected above 0", id="speed infinite"),
        pytest.param(["--port", "70000"], "--port", id="port"),
        pytest.param(["--seed", "-1"], "--seed", id="seed"),
        pytest.param(["--dialect", "klingon"], "klingon", id="dialect"),
    ],
)
def test_wrong_option_is_a_usage_error(
    radarsim: Command, options: list[str], text: str
) -> None:
    run = radarsim("serve", "empty_room", *options)
    assert run.code == 2
    assert text in run.err


def test_foreign_address_is_an_error_in_one_line(radarsim: Command) -> None:
    run = radarsim("serve", "empty_room", "--host", "192.0.2.1", "--port", "0")
    assert run.code == 1
    assert run.err.startswith("radarsim: cannot listen on 192.0.2.1:0: ")
    assert run.err.count("\n") == 1
