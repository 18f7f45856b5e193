"""Robots of USARSim for UDK become robot classes."""

from pathlib import Path

import pytest
from commands import run_in_process

from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.errors import PresetError
from radarsim.presets.robots import RobotModel, load_robot, read_robot
from radarsim.protocol.dialect import UDK
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

SICK = (
    "AddParts=(ItemClass=class'USARSensor.SICK',ItemName=\"lms200\","
    "Position=(X=0.2085,Y=0.0,Z=-0.2),Direction=(X=0.0,Y=0.0,Z=0.0))"
)
P3AT = f"""; Parts of the robot
[USARBot.P3AT]
AddParts=(ItemClass=class'USARSensor.GroundTruth',ItemName="GndTruth")
AddParts=(ItemClass=class'USARSensor.INS', ItemName="InsTest", Position=(Z=-0.2))
{SICK} ; the laser
AddParts=(ItemClass=class'USARSensor.USARCamera',ItemName="Camera",Position=(X=0.1))
AddParts=(ItemClass=class'USARSensor.Tachometer',ItemName="TachTest")
;AddParts=(ItemClass=class'USARSensor.Odometry',ItemName="Odometer")
"""
# What the original answers to clients.
GEO = (
    "GEO {Type GroundVehicle} {Name P3AT} {Dimensions 0.2480,0.3600,0.0000}"
    " {COG 0.0000,0.0000,0.0000} {WheelRadius 0.0980} {WheelSeparation 0.3600}"
    " {WheelBase 0.2480}"
)
CONF = (
    "CONF {Name P3AT} {Type GroundVehicle} {SteeringType SkidSteered} {Mass 11.9000}"
    " {MaxSpeed 1.2999} {MaxTorque 50000.0000} {MaxFrontSteer 0} {MaxRearSteer 0}"
)
SCANNER_GEO = (
    "GEO {Type RangeScanner} {Name lms200} {Location 0.21,0.00,-0.20}"
    " {Orientation 0.00,0.00,0.00}{Mount P3AT}"
)
WRONG: dict[str, str | bytes] = {
    "no section": SICK,
    "no parts": "[USARBot.P3AT]\nbDebug=true\n",
    "two classes": f"[USARBot.P3AT]\n{SICK}\n[USARBot.P2AT]\n{SICK}\n",
    "no value": "[USARBot.P3AT]\nAddParts\n",
    "no parentheses": "[USARBot.P3AT]\nAddParts=SICK\n",
    "open": f"[USARBot.P3AT]\n{SICK[:-1]}\n",
    "closed twice": f"[USARBot.P3AT]\n{SICK})\n",
    "word": f"[USARBot.P3AT]\n{SICK.replace('0.2085', 'far')}\n",
    "infinite": f"[USARBot.P3AT]\n{SICK.replace('0.2085', '1e999')}\n",
    "no vector": f"[USARBot.P3AT]\n{SICK.replace('(X=0.2085,Y=0.0,Z=-0.2)', '3')}\n",
    "deep": "[USARBot.P3AT]\nAddParts=" + "(A=" * 5000 + "\n",
    "same name": f"[USARBot.P3AT]\n{SICK}\n{SICK}\n",
    "no name": f"[USARBot.P3AT]\n{SICK.replace('lms200', '1 2')}\n",
    "no class name": f"[USARBot.1]\n{SICK}\n",
    "half a letter": b"\xff\xfe[",
    "no text": b"\xfc\0\1",
}


def imported(tmp_path: Path, content: bytes = P3AT.encode()) -> RobotModel:
    path, out = tmp_path / "UDKUSAR.ini", tmp_path / "robot.yaml"
    path.write_bytes(content)
    out.unlink(missing_ok=True)
    done = run_in_process("import", str(path), "-o", str(out))
    assert done.code == 0, done.err
    return read_robot(out)


def test_class_answers_as_the_original(tmp_path: Path, foliage_room: Scene) -> None:
    config = SimulationConfig(UDK, robots=(imported(tmp_path),))
    host = Host(foliage_room, config=config)
    client = host.connect()
    host.receive(client, b"INIT {ClassName USARBot.P3AT} {Name R} {Location 0,0,0}\r\n")
    host.receive(
        client,
        b"GETGEO {Type Robot}\r\nGETCONF {Type Robot}\r\n"
        b"GETGEO {Type RangeScanner} {Name lms200}\r\n",
    )
    for _ in range(5):
        host.step()
    lines = host.take(client).decode().splitlines()
    assert {GEO, CONF, SCANNER_GEO} <= set(lines)
    assert not [line for line in lines if "Odometer" in line]


def test_axes_become_those_of_the_robot(tmp_path: Path) -> None:
    text = P3AT.replace("(X=0.0,Y=0.0,Z=0.0)", "(X=0,Y=0.5235987756,Z=1.5707963268)")
    (scanner,) = imported(tmp_path, text.encode()).items_of("RangeScanner")
    assert scanner.position == (0.2085, 0.0, 0.2)
    assert scanner.rotation_deg == pytest.approx((0, -30, -90))


def test_omissions_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.ini"
    path.write_text(P3AT.replace("P3AT", "Tarantula") + "MaxSpeed=3\n")
    words = ("import", str(path), "-o", str(tmp_path / "b.yaml"))
    printed = run_in_process(*words).text.splitlines()
    assert printed == [
        f"{path}:1: Tarantula has the size and wheels of a P3AT",
        f"{path}:6: a part of class 'USARCamera' is left out",
        f"{path}:9: the key 'MaxSpeed' is ignored",
    ]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
def test_text_may_be_in_another_encoding(tmp_path: Path, encoding: str) -> None:
    model = imported(tmp_path)
    text = f"; Roboter für Übungen\n{P3AT}".replace("\n", "\r\n")
    mark = b"\xfe\xff" * (encoding == "utf-16-be")
    assert imported(tmp_path, mark + text.encode(encoding)) == model


@pytest.mark.parametrize("name", WRONG)
def test_wrong_file_is_reported_with_its_line(name: str, tmp_path: Path) -> None:
    path, out = tmp_path / "a.ini", tmp_path / "b.yaml"
    content = WRONG[name]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    done = run_in_process("import", str(path), "-o", str(out))
    assert (done.code, out.exists()) == (1, False)
    assert done.err.count("\n") == 1
    assert done.err.startswith(f"radarsim: {path}:")


def test_recordings_know_the_classes(tmp_path: Path) -> None:
    info = RecordingInfo(version="1", robots=(imported(tmp_path),))
    assert RecordingInfo.from_text(info.to_text()) == info


def test_class_is_based_on_a_file_beside_it_or_a_shipped_one(tmp_path: Path) -> None:
    (tmp_path / "P3AT.yaml").write_text("based_on: P3AT\nname: P3AT\nmass: 20\n")
    (tmp_path / "Big.yaml").write_text("based_on: P3AT\nname: Big\nlength: 0.9\n")
    big = read_robot(tmp_path / "Big.yaml")
    assert (big.mass, big.length, big.width) == (20, 0.9, load_robot("P3AT").width)
    (tmp_path / "Big.yaml").write_text("based_on: ../other\nname: Big\n")
    with pytest.raises(PresetError, match=r"'\.\./other', expected one of"):
        read_robot(tmp_path / "Big.yaml")


def test_class_with_an_unknown_sensor_is_refused(tmp_path: Path) -> None:
    model = imported(tmp_path)
    items = [i.model_copy(update={"sensor": "none"}) for i in model.items if i.sensor]
    config = SimulationConfig(robots=(model.model_copy(update={"items": items}),))
    with pytest.raises(PresetError, match="'none', expected one of"):
        config.check()
