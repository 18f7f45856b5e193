"""Dialogues of world controllers, which create and move crates, in clients' bytes."""

import re
from dataclasses import replace

import pytest
from wire import Wire

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.reports import CrateStates, decode_report
from radarsim.scene.scene import Crate, Scene
from radarsim.server.host import Host

CONTROLLER = (
    "INIT {ClassName USARBotAPI.WorldController} {Location 0, 0, 0} {Rotation 0, 0, 0}"
)
# As Iridium and a NIST program write them.
CREATE = (
    "CONTROL {Type Create} {ClassName WCCrate} {Name crate1} "
    "{Location 2.0000, 1.0000, 0.0000} {Rotation 0.0000, 0.0000, 0.0000} "
    "{Scale 1.0000, 2.0000, 1.5000} {Physics RigidBody}"
)
CREATE_FOO = (
    "CONTROL {Type Create}{ClassName WCCrate}{Name foo}{Location 1.500000, -3.000000, "
    "-1.000000}{Rotation 0.000000, 0.000000 0.500000}{Scale 1, 1, 1}"
    "{Physics None}{Permanent true}"
)
STATES = (
    "STA {Name crate1} {Size 1.0000,2.0000,1.5000} "
    "{Location 2.0000,1.0000,-0.7500} {Rotation 0.0000,0.0000,0.0000} "
    "{Name foo} {Size 1.0000,1.0000,1.0000} {Location 1.5000,-3.0000,-1.0000} "
    "{Rotation 0.0000,0.0000,0.5000}"
)


class Second:
    """A second client, which drives a robot."""

    def __init__(self, host: Host, *lines: str) -> None:
        self.host, self.number = host, host.connect()
        host.take(self.number)
        self.send(*lines)

    def send(self, *lines: str) -> None:
        for line in lines:
            self.host.receive(self.number, f"{line}\r\n".encode())

    @property
    def scan(self) -> list[float]:
        """The ranges of a scan, from the right."""
        for _ in range(20):
            self.host.step()
            lines = self.host.take(self.number).decode().splitlines()
            for line in lines:
                found = re.search(r"{Name lms200}.*{Range ([^}]*)}", line)
                if found:
                    return [float(text) for text in found[1].split(",")]
        raise AssertionError("no scan")


def ask(wire: Wire, line: str = "CONTROL {Type GetSTA}") -> list[str]:
    """Send a line, and return what comes at once."""
    found = wire.host.receive(wire.number, f"{line}\r\n".encode())
    wire.news += [each.text for each in found]
    return wire.host.take(wire.number).decode().splitlines()


def places(wire: Wire) -> dict[str, tuple[float, ...]]:
    """Return x, y, z and yaw of all crates."""
    lines = ask(wire)
    found = decode_report(lines[0]) if lines else CrateStates(())
    assert isinstance(found, CrateStates)
    return {
        name: (*pose.position().tolist(), pose.yaw) for name, _, pose in found.crates
    }


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_controller_creates_lists_moves_and_removes(
    empty_room: Scene, dialect: Dialect
) -> None:
    wire = Wire(empty_room, dialect)
    wire.send(CONTROLLER)
    assert ask(wire) == []  # no line is empty
    wire.send(CREATE, CREATE_FOO)
    assert ask(wire) == [STATES]
    both = STATES.replace("{Name foo}", "|{Name foo}").split(" |")
    assert ask(wire, "CONTROL {Type GetSTA} {Name CRATE1}") == both[:1]
    assert ask(wire, "CONTROL {Type GetSTA} {ClassName WCBox}") == []
    states = decode_report(STATES)
    assert isinstance(states, CrateStates)
    assert states.crates[1] == ("foo", (1, 1, 1), Pose3(1.5, 3.0, 1.0, yaw=-0.5))
    wire.send(
        "CONTROL {Type RelMove} {Name foo} {Location 1,0,-1} {Rotation 0,0,0.25}",
        "CONTROL {Type AbsMove} {Name crate1} {Location -3,-2,-9} {Rotation 0,0,1}",
    )
    expected = {"crate1": (-3, 2, 0.75, -1), "foo": (2.5, 3, 2, -0.75)}
    assert places(wire) == {
        name: pytest.approx(place, abs=2e-4) for name, place in expected.items()
    }
    wire.send("CONTROL {Type Kill} {Name Foo}")
    assert [*places(wire)] == ["crate1"]
    assert wire.wait(1) == []  # it has no robot
    assert wire.news == []


def test_crates_are_seen_and_stop_robots(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send(CONTROLLER)
    rover = Second(wire.host, "INIT {ClassName USARBot.P3AT} {Location -2,0,0}")
    middle = rover.scan[90]
    assert middle == pytest.approx(10.4 + 2 - 0.2085, abs=0.1)
    wire.send(CREATE.replace("2.0000, 1.0000, 0.0000", "2.0000, 0.0000, 0.0000"))
    near = 2 - 0.5 + 2 - 0.2085
    assert rover.scan[90] == pytest.approx(near, abs=0.1)
    rover.send("DRIVE {Left 8} {Right 8}")
    wire.wait(6)
    (vehicle,) = wire.host.simulation.vehicles
    assert vehicle.robot.pose.x == pytest.approx(1.5 - 0.276, abs=0.002)
    assert vehicle.robot.touched
    rover.send("SET {Type RangeScanner} {Opcode ECHOES} {Params true}")
    wire.wait(0.2)
    lines = wire.host.take(rover.number).decode()
    assert "{Object crate1} {Material robot}" in lines
    wire.send("CONTROL {Type RelMove} {Name crate1} {Location 0,5,0}")
    wire.wait(1)
    assert vehicle.robot.pose.x > 1.8
    assert wire.news == []


def test_crates_cannot_be_put_into_robots_or_each_other(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send(CONTROLLER, CREATE, CREATE_FOO)
    Second(wire.host, "INIT {ClassName USARBot.P3AT} {Name R1} {Location -2,0,0}")
    move = "CONTROL {Type AbsMove} {Name foo} {Location"
    wire.send(f"{move} -2.7,0,-0.5}}", f"{move} 2,2.2,-1}}", f"{move} -2,0,-0.9}}")
    expected = "expected a free place"
    assert wire.news == [
        f"CONTROL AbsMove to a place occupied by ['R1'], {expected}",
        f"CONTROL AbsMove to a place occupied by ['crate1'], {expected}",
        f"CONTROL AbsMove to a place occupied by ['R1'], {expected}",
    ]
    assert places(wire)["foo"][:3] == (1.5, 3.0, 1.0)
    wire.send(f"{move} -2,0,-1.2}}")  # over the robot, which is .46 m high
    assert places(wire)["foo"][:3] == (-2.0, 0.0, 1.2)
    wire.send(CREATE.replace("crate1", "crate2"))
    assert wire.news[3:] == [
        f"CONTROL Create to a place occupied by ['crate1'], {expected}"
    ]


def test_crates_leave_with_their_controller_unless_they_are_permanent(
    empty_room: Scene,
) -> None:
    wire = Wire(empty_room)
    first = Second(wire.host, CONTROLLER, CREATE, CREATE_FOO)
    wire.send(CONTROLLER)
    assert [*places(wire)] == ["crate1", "foo"]
    wire.host.disconnect(first.number)
    assert [*places(wire)] == ["foo"]
    wire.send(CREATE, "CONTROL {Type KillAll}")
    assert [*places(wire)] == ["foo"]
    wire.send(CREATE)
    wire.send("CONTROL {Type KillAll} {MinPos 5,5,-5} {MaxPos 9,9,5}")
    assert [*places(wire)] == ["foo", "crate1"]
    wire.send("CONTROL {Type KillAll} {MinPos 3,3,5} {MaxPos 1,0,-5}")
    assert [*places(wire)] == ["foo"]
    wire.send(CREATE)
    assert [*places(wire)] == ["foo", "crate1"]
    # Who drives a robot controls nothing any more.
    wire.wait(0.1)
    wire.send("INIT {ClassName USARBot.P3AT} {Name R1}", "CONTROL {Type GetSTA}")
    assert wire.news == [
        "CONTROL by a client that is not a controller, expected INIT of WorldController"
    ]
    assert [each.crate.name for each in wire.host.simulation.crates] == ["foo"]


CREATED = "CONTROL {Type Create} {ClassName WCCrate} {Name c}"


@pytest.mark.parametrize(
    ("line", "news"),
    [
        (CREATE.replace("crate1", "Foo"), "CONTROL Create 'Foo', expected a new name"),
        (
            CREATED.replace("WCCrate", "WCBox"),
            "not supported: CONTROL Create of 'WCBox', expected WCCrate",
        ),
        (
            f"{CREATED} {{Scale 1,1,99}}",
            "CONTROL Create of 1 x 1 x 99 m, expected 0.05",
        ),
        (f"{CREATED} {{Start Nowhere}}", "CONTROL Create at start 'Nowhere', expected"),
        ("CONTROL {Type Kill} {Name bar}", "CONTROL Kill of 'bar', expected one of"),
        (
            "CONTROL {Type RelMove} {Name foo} {Location 9999,0,0}",
            "CONTROL RelMove to (10000.5, 3, 1) m, expected at most 10000 m",
        ),
        ("CONTROL {Type AbsMove} {Name foo} {Location 1e5,0,0}", "'1e5', expected at"),
        (
            "CONTROL {Type Dance}",
            "CONTROL Type: 'Dance', expected one of ['Create', 'Kill', ",
        ),
        ("CONTROL", "'CONTROL', expected a field '{Type ...}'"),
        (
            "CONTROL {Type rotate} {Name foo} {Speed 0,0,1}",
            "CONTROL Type: 'rotate' (did you mean 'Create'?), expected one of",
        ),
        (f"{CREATED} {{Colour red}}", "CONTROL field 'Colour', expected one of"),
    ],
)
def test_what_has_no_effect_is_logged(empty_room: Scene, line: str, news: str) -> None:
    wire = Wire(empty_room)
    wire.send(CONTROLLER, CREATE_FOO)
    before = places(wire)
    wire.send(line)
    assert len(wire.news) == 1
    assert news in wire.news[0]
    assert places(wire).items() >= before.items()


def test_crates_stand_at_starts_and_are_not_too_many(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send(CONTROLLER)
    (start,) = [each for each in empty_room.starts if each.name == "RobotStart1"]
    create = "CONTROL {Type Create} {ClassName WCCrate} {Name 0} {Start robotstart1}"
    wire.send(f"{create} {{Scale 0,0,0}} {{Material red}}")
    x, y, z = start.pose.position().tolist()
    assert places(wire)["0"][:3] == (x, y, z + 0.5)
    for number in range(1, 21):
        wire.send(
            CREATED.replace("Name c", f"Name {number}")
            + f"{{Location 0,0,{-2 * number}}}"
        )
    assert len(places(wire)) == 20
    assert len(ask(wire)[0]) < 4093
    assert wire.news == [
        "CONTROL Create '20', expected a new name, and at most 20 crates"
    ]


def test_crates_are_found_by_names_that_were_cut(empty_room: Scene) -> None:
    wire, name = Wire(empty_room), "x" * 70
    wire.send(CONTROLLER, CREATE.replace("crate1", name))
    assert [*places(wire)] == [name[:64]]
    assert len(ask(wire, f"CONTROL {{Type GetSTA}} {{Name {name}}}")) == 1
    wire.send(f"CONTROL {{Type Kill}} {{Name {name}}}")
    assert places(wire) == {}
    assert wire.news == []


def test_longest_names_and_places_fit_into_one_line() -> None:
    crate = ("x" * 64, (10.0, 10.0, 10.0), Pose3(-1e4, -1e4, 1e4, yaw=3.1))
    for dialect in (COMPAT, UDK):
        assert len(CrateStates((crate,) * 20).encode(dialect)) < 4093


def test_crates_of_the_map_are_there_and_can_be_moved(empty_room: Scene) -> None:
    crates = (
        Crate("Box", (1, 1, 1), (2, 0, 0.5)),
        Crate("Top", (1, 1, 1), (2, 0, 1.5)),
    )
    wire = Wire(replace(empty_room, crates=crates))
    rover = Second(wire.host, "INIT {ClassName USARBot.P3AT} {Location 0,0,0}")
    assert rover.scan[90] == pytest.approx(1.5 - 0.2085, abs=0.1)
    wire.send(CONTROLLER, "CONTROL {Type KillAll}")
    assert [*places(wire)] == ["Box", "Top"]
    wire.send("CONTROL {Type AbsMove} {Name box} {Location 3,0,-0.5}")
    assert rover.scan[90] == pytest.approx(2.5 - 0.2085, abs=0.1)
    wire.send("CONTROL {Type Kill} {Name box}")
    assert rover.scan[90] > 9
    assert wire.news == []


@pytest.mark.parametrize(
    "line",
    [
        "STA {Name a} {Size 1,1,1}",
        "STA {Size 1,1,1} {Name a} {Location 0,0,0} {Rotation 0,0,0}",
    ],
)
def test_states_without_all_fields_are_malformed(line: str) -> None:
    with pytest.raises(MalformedMessage, match="expected Name, Size, Location"):
        decode_report(line)
