"""Lines as clients in the field write them."""

import pytest

from radarsim.protocol import commands
from radarsim.protocol.dialect import COMPAT
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.packages import LinkOrder

ZERO = (0.0, 0.0, 0.0)


def camera(*angles: float) -> commands.MovePackage:
    """Return the command that turns the camera."""
    name = "CameraPanTilt"
    orders = [LinkOrder(name, link, angle) for link, angle in enumerate(angles, 1)]
    return commands.MovePackage(name, tuple(orders))


CLIENT_LINES: dict[str, tuple[bytes, list[commands.Command]]] = {
    "UsarCommander: INIT with a blank at its end": (
        b"INIT {ClassName USARBot.P3AT} {Name Rob} {Location 4.5,1.9,1.8} "
        b"{Rotation 0,0,1.57} \r\n",
        [commands.Init("P3AT", "Rob", None, (4.5, -1.9, -1.8), (0.0, 0.0, -1.57))],
    ),
    "UsarCommander: robot first": (
        b"GETGEO {Type Robot} {Name Rob}\r\nGETCONF {Type Robot} {Name Rob}\r\n",
        [commands.GetGeo("Robot", "Rob"), commands.GetConf("Robot", "Rob")],
    ),
    "UsarCommander: in the air": (
        b"DRIVE {AltitudeVelocity 0} {LinearVelocity 1} {LateralVelocity 2} "
        b"{RotationalVelocity 0} {Normalized False}\r\n",
        [
            commands.Drive(
                normalized=False,
                altitude=0.0,
                linear=1.0,
                lateral=-2.0,
                rotational=0.0,
            )
        ],
    ),
    "ROS node: burst at connect": (
        b"GETSTARTPOSES\r\nINIT {Classname USARBot.P3AT} {Name R1} "
        b"{Start RobotStart1}\r\nGETCONF {Type RFID}\r\nGETGEO {Type RFID}\r\n",
        [
            commands.GetStartPoses(),
            commands.Init("P3AT", "R1", "RobotStart1"),
            commands.GetConf("RFID"),
            commands.GetGeo("RFID"),
        ],
    ),
    "ROS node: a start that is no name": (
        b"INIT {Classname USARBot.P3AT} {Name R1} {Start 0,0,0.8}\r\n",
        [commands.Init("P3AT", "R1", "0,0,0.8")],
    ),
    "Player: vectors with blanks": (
        b"INIT {ClassName USARBot.P2AT} {Name p2} "
        b"{Location 1.500000 1.000000 0.200000} "
        b"{Rotation 0.000000 0.000000 0.000000}\r\n",
        [commands.Init("P2AT", "p2", None, (1.5, -1.0, -0.2), ZERO)],
    ),
    "Player: LF CR and no names": (
        b"GETCONF {Type Robot}\n\rGETGEO {Type Robot}\n\r"
        b"GETGEO {Type RangeScanner}\n\rGETCONF {Type RangeScanner}\n\r",
        [
            commands.GetConf("Robot"),
            commands.GetGeo("Robot"),
            commands.GetGeo("RangeScanner"),
            commands.GetConf("RangeScanner"),
        ],
    ),
    "Player: reset with a blank at its end": (
        b"SET {Type Odometry} {Name Odometry} {Opcode RESET} \r\n",
        [commands.SetItem("Odometry", "Odometry", "RESET")],
    ),
    "Java controller: Spanish locale": (
        b"INIT {ClassName USARBot.P2AT} {Name 1} "
        b"{Location 47,169998 -55,700001 -2,250000} "
        b"{Rotation 0,000000 0,000000 0,000000}\r\n",
        [commands.Init("P2AT", "1", None, (47.169998, 55.700001, 2.25), ZERO)],
    ),
    "MATLAB toolbox: flip only": (
        b"DRIVE {Flip True}\r\n",
        [commands.Drive(flip=True)],
    ),
    "Iridium: car": (
        b"DRIVE {Speed 1.50} {FrontSteer 0.10} {RearSteer -0.25}\r\n",
        [commands.Drive(speed=1.5, front_steer=-0.1, rear_steer=0.25)],
    ),
    "MATLAB toolbox: camera": (
        b"MISPKG {Name CameraPanTilt} {Link 1} {Value 0.1} {Order 0} {Link 2} "
        b"{Value 0.1} {Order 0}\r\n",
        [camera(0.1, 0.1)],
    ),
    "C# in Dutch": (b"DRIVE {Left -0,5} {Right 0,5}\r\n", [commands.Drive(-0.5, 0.5)]),
    "Python client: leading points": (
        b"INIT {ClassName USARBot.KR6} {Location .4, .4, 1.8}\r\n",
        [commands.Init("KR6", None, None, (0.4, -0.4, -1.8))],
    ),
    "Python client: percent": (
        b"DRIVE {Left 20} {Right 10} {Normalized true}\r\n",
        [commands.Drive(20.0, 10.0, normalized=True)],
    ),
    "Python client: shouting": (
        b"DRIVE {LEFT -1.0} {RIGHT 1.0}\r\n",
        [commands.Drive(-1.0, 1.0)],
    ),
    "Python client: commas of both kinds": (
        b"INIT {ClassName USARBot.P2DX} {Location 0,0000, 0,0000, 0,0000}\r\n",
        [commands.Init("P2DX", None, None, ZERO)],
    ),
}


@pytest.mark.parametrize(
    ("stream", "expected"), CLIENT_LINES.values(), ids=CLIENT_LINES
)
def test_lines_of_real_clients_are_parsed(
    stream: bytes, expected: list[commands.Command]
) -> None:
    parsed = [
        commands.parse_command(line, COMPAT)[0] for line in LineBuffer().feed(stream)
    ]
    assert parsed == expected
