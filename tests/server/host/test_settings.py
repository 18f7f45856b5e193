"""Settings of scanners that clients change while they drive."""

import re
from collections.abc import Mapping
from typing import Any

import pytest
from host_client import DIALECTS, HostClient
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from radarsim.presets.sensor_settings import SensorSettings
from radarsim.protocol.dialect import COMPAT, Dialect
from radarsim.protocol.reports import RangeScan, decode_report
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.spawning import SPAWN_COOLDOWN
from radarsim.simulation.config import MOST_RAYS, MOST_RAYS_A_SECOND, SimulationConfig

INIT = b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n"
TWO_SCANNERS = INIT.replace(b"P3AT", b"P3AT_Compare")
ECHOES = b"SET {Type RangeScanner} {Opcode ECHOES} {Params true}\r\n"
DRIVE = b"DRIVE {Left 3} {Right 2}\r\n"


class RobotClient(HostClient):
    """A client with a robot."""

    def set(self, params: str, name: str = "lms200") -> list[str]:
        return self.send(
            b"SET {Type RangeScanner} {Name %b} {Opcode SETTING} {Params %b}\r\n"
            % (name.encode(), params.encode())
        )


def served(
    scene: Scene,
    own: Mapping[str, Any] | None = None,
    *,
    dialect: Dialect = COMPAT,
    init: bytes = INIT,
) -> RobotClient:
    """Serve a scene with settings of ``lms200``, and spawn a robot."""
    item_settings = {"lms200": own} if own else {}
    config = SimulationConfig(dialect, item_settings=item_settings)
    return RobotClient(Host(scene, config=config), init)


def scans_in(data: bytes, name: str = "lms200") -> list[RangeScan]:
    reports = [decode_report(line) for line in data.decode("ascii").splitlines()]
    return [r for r in reports if isinstance(r, RangeScan) and r.name == name]


def errors_in(data: bytes) -> list[str]:
    return re.findall(r"NFO {Error ([^{}]*)}\r\n", data.decode("ascii"))


@DIALECTS
@pytest.mark.parametrize(
    ("params", "own"),
    [
        ("side_offset_uu=50", {"side_offset_uu": 50}),
        (
            "penetration_power=0.5, max_range=7 return_mode=first",
            {"penetration_power": 0.5, "max_range": 7, "return_mode": "first"},
        ),
        (
            "ray_weights=1,5,1,ray_choice=together , side_offset_uu = 40",
            {"ray_weights": (1, 5, 1), "ray_choice": "together", "side_offset_uu": 40},
        ),
        ("fov_deg=90 resolution_deg=2", {"fov_deg": 90, "resolution_deg": 2}),
        ("penetration_power=.inf range_noise=0.05", None),
        ("sensor=sick", {"sensor": "sick"}),
    ],
)
def test_robot_scans_as_if_it_had_been_served_with_the_settings(
    foliage_room: Scene, dialect: Dialect, params: str, own: dict[str, Any] | None
) -> None:
    if own is None:
        own = {"penetration_power": float("inf"), "range_noise": 0.05}
    changed = served(foliage_room, dialect=dialect)
    configured = served(foliage_room, own, dialect=dialect)
    assert changed.set(params) == []
    for client in (changed, configured):
        client.send(DRIVE + ECHOES)
    asked = b"GETCONF {Type RangeScanner}\r\n"
    for ticks in (45, 5, 40):
        assert changed.read(ticks) == configured.read(ticks)
        for client in (changed, configured):
            client.send(asked)


def test_settings_act_on_the_next_scan_and_are_not_answered(
    foliage_room: Scene,
) -> None:
    client, silent = served(foliage_room), served(foliage_room)
    assert client.read(29) == silent.read(29)
    assert client.set("max_range=3") == []
    (scan,), (other,) = scans_in(client.read(1)), scans_in(silent.read(1))
    assert scan.ranges.max() == 3
    assert other.ranges.max() > 3
    assert client.set("max_range=80") == []
    assert client.read(60) == silent.read(60)  # the same rays were drawn


def test_settings_are_those_of_one_robot_until_its_next_init(
    foliage_room: Scene,
) -> None:
    host = Host(foliage_room)
    client = RobotClient(host, INIT)
    other = RobotClient(host, INIT.replace(b"1}", b"2}"))
    client.set("max_range=3")
    conf = b"GETCONF {Type RangeScanner}\r\n"
    for each in (client, other):
        each.send(conf)
    own, others = client.read(SPAWN_COOLDOWN), other.read(10)
    assert b"{MaxRange 3.0000}" in own
    assert max(scans_in(own)[-1].ranges) == 3
    assert b"{MaxRange 80.0000}" in others
    assert max(scans_in(others)[-1].ranges) > 3
    assert client.send(INIT + conf) == []
    again = client.read(20)
    assert b"{MaxRange 80.0000}" in again
    assert max(scans_in(again)[-1].ranges) > 3


def test_settings_without_a_name_are_those_of_all_range_scanners(
    foliage_room: Scene,
) -> None:
    client = served(foliage_room, init=TWO_SCANNERS)
    assert client.set("max_range=2", "") == []
    data = client.read(10)
    for name in ("lms200", "Hokuyo"):
        assert [scan.ranges.max() for scan in scans_in(data, name)] == [2]
    client.set("max_range=1", "HOKUYO")
    data = client.read(10)
    maxima = [scans_in(data, n)[0].ranges.max() for n in ("lms200", "Hokuyo")]
    assert maxima == [2, 1]


def test_scan_rate_counts_from_the_spawn(empty_room: Scene) -> None:
    client = served(empty_room)
    client.read(13)
    client.set("scan_rate_hz=20")
    data = client.read(20)
    assert [scan.time for scan in scans_in(data)] == [0.15, 0.2, 0.25, 0.3]
    assert data.count(b"STA ") == 2
    client.set("scan_rate_hz=4")
    assert [scan.time for scan in scans_in(client.read(60))] == [0.5, 0.75]
    client.send(b"SET {Type RangeScanner} {Opcode SCAN}\r\n")
    client.set("scan_rate_hz=5 max_range=2")
    (scan,) = scans_in(client.read(1))  # that was asked for
    assert (scan.time, scan.ranges.max()) == (0.94, 2)


def test_many_rates_one_after_the_other_leave_nothing_behind(empty_room: Scene) -> None:
    client, other = served(empty_room), served(empty_room)
    for rate in range(1, 100):
        client.set(f"scan_rate_hz={rate}")
        client.read(1)
    client.set("scan_rate_hz=null")
    other.read(99)
    assert client.read(1) != b""
    other.read(1)
    heard = [re.sub(rb"{Range .*?}", b"", each.read(60)) for each in (client, other)]
    assert heard[0] == heard[1]


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ("side_offset_uu=-5", ["side_offset_uu", "-5"]),
        ("side_ofset_uu=50", ["side_ofset_uu", "side_offset_uu"]),
        ("side_offset_uu", ["side_offset_uu", "KEY=VALUE"]),
        ("", ["KEY=VALUE"]),
        ("max_range=3 medium=sound", ["medium", "sound"]),
        ("sensor=sonic", ["sonic"]),
        ("sensor=[1,2]", ["sensor"]),
        ("max_range=[[[", ["max_range"]),
        ("max_range=0,5", ["max_range"]),
        ("max_range=1e999", ["max_range"]),
        ("return_mode=\x1b[2J", ["return_mode"]),
        ("a=1 " * 100, ["expected at most"]),
        (f"resolution_deg={180 / (MOST_RAYS + 1)}", ["rays", str(MOST_RAYS)]),
        ("side_mode=cone cone_rays=10000 beamwidth_az_deg=3", ["rays"]),
        ("scan_rate_hz=100 resolution_deg=0.25", [str(MOST_RAYS_A_SECOND)]),
        ("ray_choice=together resolution_deg=0.2 side_offset_uu=9", [str(MOST_RAYS)]),
    ],
)
def test_wrong_setting_is_answered_and_changes_nothing(
    foliage_room: Scene, params: str, words: list[str]
) -> None:
    client, silent = served(foliage_room), served(foliage_room)
    for each in (client, silent):
        each.send(DRIVE)
    assert client.set(params) == ["malformed SETTING"]
    data = client.read(40)
    (error,) = errors_in(data)
    for word in words:
        assert word in error
    assert re.sub(rb"NFO {Error .*\r\n", b"", data) == silent.read(40)


def test_clients_share_the_rays_that_they_add(
    foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit = "radarsim.simulation.config.MOST_EXTRA_RAYS"
    monkeypatch.setattr(limit, 3000)  # a robot has 1810 in a second
    host = Host(foliage_room)
    one = RobotClient(host, INIT)
    one.read(SPAWN_COOLDOWN)
    other = RobotClient(host, INIT.replace(b"1}", b"2}"))
    other.read(SPAWN_COOLDOWN)
    twice, same = "resolution_deg=0.5", "resolution_deg=1"

    def refusals(client: RobotClient, params: str) -> list[str]:
        client.set(params)
        return errors_in(client.read(2))

    assert refusals(one, twice) == []
    assert refusals(one, f"{twice} max_range=20") == []
    (error,) = refusals(other, twice)
    assert "1200" in error  # the rest
    assert refusals(other, "max_range=20") == []
    assert refusals(one, same) == []
    assert refusals(other, twice) == []
    assert refusals(one, twice)
    host.disconnect(other.number)
    assert refusals(one, twice) == []


def test_setting_of_what_is_no_scanner_is_answered(empty_room: Scene) -> None:
    client, stranger = served(empty_room), HostClient(Host(empty_room))
    setting = b"SET {Type RangeScanner} {Name x} {Opcode setting} {Params a=1}\r\n"
    for line in (setting, b"SET {Type INS} {Opcode SETTING} {Params a=1}\r\n"):
        assert len(client.send(line)) == 1
        assert len(errors_in(client.read(1))) == 1
    stranger.send(setting)
    (error,) = errors_in(stranger.read())
    assert "INIT" in error


def test_all_scanners_change_or_none(foliage_room: Scene) -> None:
    client = served(foliage_room, init=TWO_SCANNERS)
    silent = served(foliage_room, init=TWO_SCANNERS)
    # the other scanner has a wider field of view, and so too many beams
    assert client.set("resolution_deg=0.1", "") == ["malformed SETTING"]
    assert errors_in(client.read(1))
    silent.read(1)
    assert client.read(40) == silent.read(40)


def test_what_was_configured_may_be_kept(empty_room: Scene) -> None:
    client = served(empty_room, {"resolution_deg": 0.05, "scan_rate_hz": 20})
    assert client.set("side_offset_uu=50") == []
    assert client.set("resolution_deg=0.045") == ["malformed SETTING"]
    assert client.set("resolution_deg=0.06") == []


KEYS = st.sampled_from([*SensorSettings.model_fields, "sensor", "x", ""])
VALUES = st.one_of(
    st.floats().map(str),
    st.sampled_from(
        ["first", "true", "null", "cone", "drawn", "1,2,3", "[", "&a", "*a"]
    ),
    st.text("0123456789.,-+e []{}\"'#&*!|>%@`:abc", max_size=20),
)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(KEYS, VALUES), max_size=4), st.booleans())
@example([("max_range", "&a [*a,*a]")], False)
@example([("side_offset_uu", "50"), ("ray_choice", "together")], True)
def test_whatever_is_set_the_next_scan_comes(
    foliage_room: Scene, given_settings: list[tuple[str, str]], echoes: bool
) -> None:
    client = served(foliage_room)
    if echoes:
        client.send(ECHOES)
    client.set(" ".join(f"{key}={value}" for key, value in given_settings))
    client.send(b"SET {Type RangeScanner} {Opcode SCAN}\r\n")
    assert b"{Type RangeScanner}" in client.read(1)
