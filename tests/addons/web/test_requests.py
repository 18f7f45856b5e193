import json
from typing import Any

import pytest

from radarsim.addons.web import requests
from radarsim.addons.web.requests import BadRequest, parse_request

VALID: list[dict[str, Any]] = [
    {"op": "hello", "token": "x"},
    {"op": "select", "robot": "R1"},
    {"op": "select", "robot": None},
    {"op": "spawn", "class": "P3AT"},
    {"op": "spawn", "class": "USARBot.P3AT", "name": "a b", "start": "RobotStart1"},
    {"op": "spawn", "class": "P3AT", "pose": [1, 2.5, -0.1]},
    {"op": "remove", "robot": "R1"},
    {"op": "drive", "robot": "R1", "v": 1, "w": -0.5, "seq": 3},
    {"op": "stop"},
    {"op": "stop", "robot": "R1"},
    {
        "op": "setting",
        "robot": "R1",
        "scanner": "lms200",
        "key": "max_range",
        "value": 5,
    },
    {"op": "goto", "robot": "R1", "algorithm": "bug2", "goal": [1, 2]},
    {"op": "explore", "robot": "R1", "strategy": "auto"},
    {"op": "map", "robot": "R1", "on": True},
    {"op": "map", "robot": "R1", "on": True, "colours": "material"},
    {"op": "cancel", "task": 3},
    {"op": "explain", "robot": "R1", "scanner": "lms200", "beam": 92, "t": 1.5},
    {"op": "record", "on": False},
    {"op": "triangles"},
    {"op": "ack", "t": 1},
]


@pytest.mark.parametrize("message", VALID, ids=lambda message: message["op"])
def test_requests_are_read(message: dict[str, Any]) -> None:
    request = parse_request(json.dumps(message))
    assert isinstance(request, requests.Request)
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
        pytest.param('{"op": "drive", "robot": "R1", "v": 1}', "w", id="missing"),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": 1.1, "w": 0}', "v", id="too fast"
        ),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": NaN, "w": 0}', "v", id="no number"
        ),
        pytest.param(
            '{"op": "drive", "robot": "R1", "v": "1", "w": 0}', "v", id="a text"
        ),
        pytest.param('{"op": "drive", "robot": 1, "v": 1, "w": 0}', "robot", id="type"),
        pytest.param(
            '{"op": "spawn", "class": "P3AT", "name": "{a}"}', "name", id="braces"
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
