"""The words that tell reports apart, for who writes and for who reads them."""

from typing import Final, TypeAlias

from radarsim.protocol.reports import (
    EchoLine,
    Encoder,
    EncoderConf,
    GroundTruth,
    Ins,
    IntervalConf,
    Odometry,
    RangeScan,
    Tachometer,
    Touch,
    TouchConf,
)

VEHICLE: Final = "GroundVehicle"  # the type of a robot that drives
VEHICLES: Final = frozenset((VEHICLE, "LeggedRobot", "NauticVehicle", "AerialVehicle"))

Reading: TypeAlias = (
    RangeScan | EchoLine | GroundTruth | Ins | Odometry | Tachometer | Encoder | Touch
)
Settings: TypeAlias = IntervalConf | EncoderConf | TouchConf

READING_TYPES: Final[dict[type[Reading], str]] = {
    RangeScan: "RangeScanner",
    EchoLine: "Echoes",
    GroundTruth: "GroundTruth",
    Ins: "INS",
    Odometry: "Odometry",
    Tachometer: "Tachometer",
    Encoder: "Encoder",
    Touch: "Touch",
}
SETTING_KEYS: Final[dict[type[Settings], str]] = {
    IntervalConf: "ScanInterval",
    TouchConf: "Diameter",
    EncoderConf: "Resolution",
}
