import json
from typing import Any

import pytest

from radarsim.addons.web.requests import BadRequest, parse_request


@pytest.mark.parametrize(
    "message",
    [
        {"op": "select", "robot": None},
        {"op": "spawn", "class": "USARBot.P3AT", "name": "a b", "start": "RobotStart1"},
        {"op": "stop", "robot": "R1"},
    ],
)
def test_requests_are_read(message: dict[str, Any]) -> None:
    request = parse_request(json.dumps(message))
    sent = json.loads(request.model_dump_json(by_alias=True, exclude_unset=True))
    assert sent == message


@pytest.mark.parametrize(
    ("message", "text"),
    [
        pytest.param("", "JSON", id="nothing"),
        pytest.param("[]", "message", id="no object"),
        pytest.param("{}", "op", id="no op"),
        pytest.param('{"op": "drvie"}', "did you mean 'drive'", id="unknown op"),
        pytest.param('{"op": "stop", "more": 1}', "more", id="unknown key"),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": 1.1, "w": 0}', "v", id="too fast"
        ),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": NaN, "w": 0}', "v", id="no number"
        ),
        pytest.param(
            '{"op": "spawn", "class": "P3AT", "name": "a\\nINIT"}', "name", id="line"
        ),
        pytest.param('{"op": "spawn", "class": "a b"}', "class", id="class"),
        pytest.param(
            '{"op": "spawn", "class": "P3AT", "pose": [1, 2]}', "pose", id="pose"
        ),
        pytest.param('{"op": "hello", "token": "\\ud800"}', "JSON", id="half a letter"),
        pytest.param("[" * 4000, "JSON", id="deep"),
    ],
)
def test_what_is_wrong_is_told(message: str, text: str) -> None:
    with pytest.raises(BadRequest, match=text):
        parse_request(message)
