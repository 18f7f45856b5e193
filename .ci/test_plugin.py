"""What a suite of a stranger finds after it has installed the wheel."""

import pytest


@pytest.mark.usarsim(map="foliage_room", seed=1)
def test_the_fixtures_are_there(usarsim_client):
    assert "{Level DM-FoliageRoom}" in usarsim_client.read_line()
    usarsim_client.send("INIT {ClassName USARBot.P3AT} {Start RobotStart1}")
    line = usarsim_client.read_until("SEN", "{Type RangeScanner}")
    assert line.count(",") == 180
