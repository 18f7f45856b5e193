"""How often refused connections are logged."""

import asyncio

import pytest

from radarsim.server.peer_connections import LOG_INTERVAL, RefusalLog


async def test_first_refusal_is_reported_and_the_others_are_counted(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = asyncio.get_running_loop()
    start = loop.time()
    refusals = RefusalLog("viewers")
    for number in range(1000):
        refusals.add(f"10.0.0.1:{number}", 64)
    monkeypatch.setattr(loop, "time", lambda: start + 2 * LOG_INTERVAL)
    for number in range(1000):
        refusals.add(f"10.0.0.2:{number}", 64)
    assert caplog.messages == [
        "10.0.0.1:0: refused: the limit is 64 viewers",
        "10.0.0.2:0: refused, like 999 others before: the limit is 64 viewers",
    ]
