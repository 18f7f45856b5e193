from math import nan, pi, radians

import numpy as np
import pytest

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import Link
from radarsim.protocol import packages, reports, rescue
from radarsim.protocol.dialect import COMPAT, UDK
from radarsim.protocol.fields import ItemReport, LineReport, SensorReport
from radarsim.protocol.watch import RobotChoice

LASER = Pose3(0.2085, 0.0, 0.2)


COMPAT_LINES: dict[str, tuple[reports.Report, str]] = {
    "greeting": (
        reports.Greeting("DM-Test"),
        "NFO {Gametype BotDeathMatch} {Level DM-Test} {TimeLimit 0}",
    ),
    "start poses": (
        reports.StartPoses(
            (
                ("RobotStart1", Pose3(4.5, -1.9, -1.8)),
                ("RobotStart2", Pose3(1.0, -2.0, -1.8, yaw=-1.57)),
            )
        ),
        "NFO {StartPoses 2} {RobotStart1 4.50,1.90,1.80 0.00,0.00,0.00 "
        "RobotStart2 1.00,2.00,1.80 0.00,0.00,1.57}",
    ),
    "no start poses": (reports.StartPoses(()), "NFO {StartPoses 0}"),
    "status": (
        reports.Status(10.2, 3590, light=False),
        "STA {Type GroundVehicle} {Time 10.20} {FrontSteer 0.0000} "
        "{RearSteer 0.0000} {LightToggle False} {LightIntensity 0} {Battery 3590} "
        "{View -1}",
    ),
    "inertial measurement unit": (
        reports.Imu(
            1.5, "IMU", (0.25, -1.5, 0), (0, 0, 0.5), (0, 0, -0.125), (0, 0, 3.5)
        ),
        "SEN {Time 1.50} {Type IMU} {Name IMU} {XYZAcceleration 0.2500,1.5000,0.0000} "
        "{AngularVel 0.0000,0.0000,-0.5000} {AngularAccel 0.0000,0.0000,0.1250} "
        "{Rotation 0.0000,0.0000,2.7832}",
    ),
    "accelerations": (
        reports.Acceleration(1.5, "A", (0.29999, -1.5, 0)),
        "SEN {Time 1.50} {Type Accel} {Name A} {Acceleration 0.3000,1.5000,0.0000}",
    ),
    "accelerations with gravity": (
        reports.ProperAcceleration(1.5, "Accelerometer", (0, 0, -9.81)),
        "SEN {Time 1.50} {Type AcceleroMeter} {Name Accelerometer} "
        "{ProperAcceleration 0.0000,0.0000,9.8100}",
    ),
    "heights": (
        reports.Altitude(1.5, "Altitude", -0.25, 110.75),
        "SEN {Time 1.50} {Type AltitudeSensor} {Name Altitude} "
        "{relativeAltitude -0.2500} {absoluteAltitude 110.7500}",
    ),
    "compass": (
        reports.Compass(1.5, "Compass", 3.5),
        "SEN {Time 1.50} {Type MagneticCompass} {Name Compass} {MagneticAngle 2.7832}",
    ),
    "minutes": (
        reports.MissionTime(63.5, "Time", 1),
        "SEN {Time 63.50} {Type MissionTime} {Name Time} {Minutes 1}",
    ),
    "links of a camera, as recorded": (
        packages.PackageState(45.14, "CameraPanTilt", ((0.0, -20.0), (-0.16, -20.0))),
        "MISSTA {Time 45.14} {Name CameraPanTilt} {Link 1} {Value 0.0000} "
        "{Torque -20.00} {Link 2} {Value -0.1600} {Torque -20.00}",
    ),
    "what links can do": (
        packages.PackageConf(
            "MisPkg",
            (
                (
                    "Cam",
                    (
                        Link(
                            max_speed=0.17,
                            max_torque=20,
                            min_angle=-0.16,
                            max_angle=0.4,
                        ),
                    ),
                ),
            ),
        ),
        "CONF {Type MisPkg} {Name Cam} {Link 1} {JointType Revolute} "
        "{MaxSpeed 0.1700} {MaxTorque 20.0000} {MinRange -0.1600} {MaxRange 0.4000}",
    ),
    "where links are": (
        packages.PackageGeo("MisPkg", (("Cam", (LASER, LASER)),), ""),
        "GEO {Type MisPkg} {Name Cam} {Link 1} {ParentLink -1} "
        "{Location 0.2085,0.0000,-0.2000} {Orientation 0.0000,0.0000,0.0000} "
        "{Link 2} {ParentLink 1} {Location 0.2085,0.0000,-0.2000} "
        "{Orientation 0.0000,0.0000,0.0000}",
    ),
    "crates": (
        reports.CrateStates(
            (("Box 1", (1.0, 2.0, 0.5), Pose3(-3.0, 2.0, 0.25, yaw=1.5)),)
        ),
        "STA {Name Box 1} {Size 1.0000,2.0000,0.5000} "
        "{Location -3.0000,-2.0000,-0.2500} {Rotation 0.0000,0.0000,-1.5000}",
    ),
    "status of a car": (
        reports.Status(10.2, 3590, light=False, steering=(0.25, -0.1)),
        "STA {Type GroundVehicle} {Time 10.20} {FrontSteer -0.2500} "
        "{RearSteer 0.1000} {LightToggle False} {LightIntensity 0} {Battery 3590} "
        "{View -1}",
    ),
    "status of a drone": (
        reports.AerialStatus(10.2, 3590, light=False),
        "STA {Type AerialVehicle} {Time 10.20} {LightToggle False} "
        "{LightIntensity 0} {Battery 3590} {View -1}",
    ),
    "shape of a drone": (
        reports.AerialGeo("AirRobot", (1.0, 1.0, 0.24), (0, 0, 0)),
        "GEO {Type AerialVehicle} {Name AirRobot} {Dimensions 1.0000,1.0000,0.2400} "
        "{COG 0.0000,0.0000,0.0000}",
    ),
    "abilities of a drone": (
        reports.AerialConf("AirRobot", 1.0, 2.0),
        "CONF {Type AerialVehicle} {Name AirRobot} {Mass 1.0000} {MaxSpeed 2.0000}",
    ),
    "status with light and an empty battery, which never reads 0": (
        reports.Status(10.2, 0, light=True),
        "STA {Type GroundVehicle} {Time 10.20} {FrontSteer 0.0000} "
        "{RearSteer 0.0000} {LightToggle True} {LightIntensity 100} {Battery 1} "
        "{View -1}",
    ),
    "scan": (
        reports.RangeScan(
            10.2, "lms200", radians(1), pi, np.array([2.195, 2.204, 0.0, -1e-9, 80])
        ),
        "SEN {Time 10.20} {Type RangeScanner} {Name lms200} {Resolution 0.017453} "
        "{FOV 3.141593} {Range 2.19,2.20,0.00,0.00,80.00}",
    ),
    "echoes of a bush": (
        reports.EchoLine(
            10.2,
            "lms200",
            1,
            15,
            reports.TargetEchoes(
                object="bush_4",
                material="foliage",
                density=0.7,
                transparency=0.3,
                laser_passes=False,
                robot_passes=False,
                beams=np.array([92, 92]),
                ranges=np.array([7.5416, 8.9702]),
                kinds=("enter", "spent"),
                power=np.array([1.0, 0.0]),
                strength=np.array([0.99995, 0.0]),
            ),
        ),
        "SEN {Time 10.20} {Type Echoes} {Name lms200} {Line 1} {Lines 15} "
        "{Object bush_4} {Material foliage} {Density 0.7000} {Transparency 0.3000} "
        "{LaserPasses False} {RobotPasses False} "
        "{Echoes 92,7.54,Enter,1.0000,1.0000 92,8.97,Spent,0.0000,0.0000}",
    ),
    "no echoes": (
        reports.EchoLine(10.2, "lms200", 0, 0, None),
        "SEN {Time 10.20} {Type Echoes} {Name lms200} {Line 0} {Lines 0}",
    ),
    "targets of a turn": (
        reports.RadarTargets(
            *(10.2, "Navtech", 2, 3),
            *(np.array([92, 93]), np.array([7.546, 120.0]), np.array([-58.25, -99.5])),
        ),
        "SEN {Time 10.20} {Type RadarTargets} {Name Navtech} {Line 2} {Lines 3} "
        "{Targets 92,7.55,-58.25 93,120.00,-99.50}",
    ),
    "ground truth": (
        reports.GroundTruth(10.2, "GndTruth", Pose3(4.5, -1.9, 0.146, yaw=-pi / 2)),
        "SEN {Time 10.20} {Type GroundTruth} {Name GndTruth} "
        "{Location 4.5000,1.9000,-0.1460} {Orientation 0.0000,0.0000,1.5708}",
    ),
    "ground truth that turned many times": (
        reports.GroundTruth(10.2, "GndTruth", Pose3(0, 0, 0, -1e-9, -1e-9, 7 * pi)),
        "SEN {Time 10.20} {Type GroundTruth} {Name GndTruth} "
        "{Location 0.0000,0.0000,0.0000} {Orientation 0.0000,0.0000,3.1416}",
    ),
    "INS": (
        reports.Ins(10.2, "InsTest", Pose3(4.5, -1.9, 0.346, yaw=pi / 2)),
        "SEN {Time 10.20} {Type INS} {Name InsTest} "
        "{Location 4.5000,1.9000,-0.3460} {Orientation 0.0000,0.0000,-1.5708}",
    ),
    "odometry, which is not wrapped": (
        reports.Odometry(10.2, "Odometer", Pose2(1.0, 2.0, -7.5)),
        "SEN {Time 10.20} {Type Odometry} {Name Odometer} {Pose 1.0000,-2.0000,7.5000}",
    ),
    "tachometer": (
        reports.Tachometer(
            10.2, "TachTest", (0.99984, -1, 0.8, 0.8), (3.3132, 0, 0, -0.5)
        ),
        "SEN {Time 10.20} {Type Tachometer} {Name TachTest} "
        "{Vel 0.9998,-1.0000,0.8000,0.8000} {Pos 3.3132,0.0000,0.0000,-0.5000}",
    ),
    "two wheels of one encoder": (
        reports.Encoder(10.2, (("W1", 0), ("W2", 3))),
        "SEN {Time 10.20} {Type Encoder} {Name W1} {Tick 0} {Name W2} {Tick 3}",
    ),
    "sonars": (
        reports.Sonar(10.2, (("F1", 4.46904), ("R8", 5.0))),
        "SEN {Time 10.20} {Type Sonar} {Name F1 Range 4.4690} {Name R8 Range 5.0000}",
    ),
    "GPS in the north and the west": (
        reports.Gps(10.2, "GPS", (39 + 8.0273 / 60, -77 - 12.998 / 60), 11),
        "SEN {Time 10.20} {Type GPS} {Name GPS} {Latitude 39,8.0273,N} "
        "{Longitude 77,12.9980,W} {Fix 1} {Satellites 11}",
    ),
    "GPS a hair south of a whole degree, and east": (
        reports.Gps(10.2, "GPS", (-0.9999999999, 151.2), 4),
        "SEN {Time 10.20} {Type GPS} {Name GPS} {Latitude 1,0.0000,S} "
        "{Longitude 151,12.0000,E} {Fix 1} {Satellites 4}",
    ),
    "GPS at the equator, which is north": (
        reports.Gps(10.2, "GPS", (-1e-9, 0.0), 4),
        "SEN {Time 10.20} {Type GPS} {Name GPS} {Latitude 0,0.0000,N} "
        "{Longitude 0,0.0000,E} {Fix 1} {Satellites 4}",
    ),
    "GPS without a fix": (
        reports.Gps(10.2, "GPS", None, 3),
        "SEN {Time 10.20} {Type GPS} {Name GPS} {Fix 0} {Satellites 3}",
    ),
    "touch": (
        reports.Touch(10.2, "Touch", touched=True),
        "SEN {Time 10.20} {Type Touch} {Name Touch Touch True}",
    ),
    "shape of the robot": (
        reports.RobotGeo("P3AT", (0.552, 0.497, 0.46), (0, 0, 0), 0.098, 0.36, 0.248),
        "GEO {Type GroundVehicle} {Name P3AT} {Dimensions 0.5520,0.4970,0.4600} "
        "{COG 0.0000,0.0000,0.0000} {WheelRadius 0.0980} {WheelSeparation 0.3600} "
        "{WheelBase 0.2480}",
    ),
    "abilities of a car": (
        reports.RobotConf("Hummer", 2360, 14.7655, 50000, (0.4363, 0)),
        "CONF {Type GroundVehicle} {Name Hummer} {SteeringType AckermanSteered} "
        "{Mass 2360.0000} {MaxSpeed 14.7655} {MaxTorque 50000.0000} "
        "{MaxFrontSteer 0.4363} {MaxRearSteer 0.0000}",
    ),
    "two mounts": (
        reports.ItemGeo(
            "RangeScanner",
            (("lms200", LASER), ("Hokuyo", Pose3(0.1, 0.2, 0.3, 0.4, 0.5, 0.6))),
            "P3AT_Compare",
        ),
        "GEO {Type RangeScanner} {Name lms200 Location 0.2085,0.0000,-0.2000 "
        "Orientation 0.0000,0.0000,0.0000 Mount HARD} {Name Hokuyo Location "
        "0.1000,-0.2000,-0.3000 Orientation 0.4000,-0.5000,-0.6000 Mount HARD}",
    ),
    "settings of scanners": (
        reports.ScannerConf(
            "RangeScanner",
            (
                ("lms200", 80, 0.2, radians(1), pi),
                ("Hokuyo", 4, 0.02, 0.0184086914, 4.189),
            ),
        ),
        "CONF {Type RangeScanner} {Name lms200} {MaxRange 80.0000} "
        "{MinRange 0.2000} {Resolution 0.017453} {Fov 3.141593} {Name Hokuyo} "
        "{MaxRange 4.0000} {MinRange 0.0200} {Resolution 0.018409} {Fov 4.189000}",
    ),
    "settings of sonars": (
        reports.SonarConf(
            "Sonar", (("F1", 5, 0.1, radians(20), 0.2), ("R8", 4, 0, 0.3, nan))
        ),
        "CONF {Type Sonar} {Name F1} {MaxRange 5.0000} {MinRange 0.1000} "
        "{BeamAngle 0.349066} {Name R8} {MaxRange 4.0000} {MinRange 0.0000} "
        "{BeamAngle 0.300000}",
    ),
    "settings of ground truth": (
        reports.IntervalConf("GroundTruth", (("GndTruth", 0.1),)),
        "CONF {Type GroundTruth} {Name GndTruth} {ScanInterval 0.1000}",
    ),
    "settings of encoders": (
        reports.EncoderConf("Encoder", (("W1", 0.01745), ("W2", 0.01745))),
        "CONF {Type Encoder} {Name W1} {Resolution 0.017450} {Name W2} "
        "{Resolution 0.017450}",
    ),
    "settings of touch": (
        reports.TouchConf("Touch", (("Touch", 0.01),)),
        "CONF {Type Touch} {Name Touch} {Diameter 0.0100}",
    ),
    "settings of cameras": (
        reports.CameraConf(
            "Camera",
            (
                reports.CameraLimits(
                    "Camera", (0, 0), (160, 120), (1.4, 0.35, 2.1, 0.7)
                ),
                reports.CameraLimits(
                    "Camera2", (160, 0), (160, 120), (1.4, 0.35, 2.1, 1.4)
                ),
            ),
        ),
        "CONF {Type Camera} {Name Camera} {TextureOffsetX 0} {TextureOffsetY 0} "
        "{TextureResolutionX 160} {TextureResolutionY 120} {CameraDefFov 1.4000} "
        "{CameraMinFov 0.3500} {CameraMaxFov 2.1000} {CameraFov 0.7000} "
        "{Name Camera2} {TextureOffsetX 160} {TextureOffsetY 0} "
        "{TextureResolutionX 160} {TextureResolutionY 120} {CameraDefFov 1.4000} "
        "{CameraMinFov 0.3500} {CameraMaxFov 2.1000} {CameraFov 1.4000}",
    ),
    "no items": (reports.NameConf("MisPkg", ()), "CONF {Type MisPkg}"),
    "parts of a victim": (
        rescue.VictimParts(
            1.5,
            "VictSensor",
            (
                rescue.Sighting("Leg", (2.05, -0.33, -0.46)),
                rescue.Sighting("Arm", (2.5, -0.44, 0)),
            ),
        ),
        "SEN {Time 1.50} {Type VictSensor} {Name VictSensor} {PartName Leg} "
        "{Location 2.0500,0.3300,0.4600} {PartName Arm} "
        "{Location 2.5000,0.4400,0.0000}",
    ),
    "no victims": (
        rescue.VictimParts(1.5, "VictSensor", ()),
        "SEN {Time 1.50} {Type VictSensor} {Name VictSensor} {Status NoVictims}",
    ),
    "tags": (
        rescue.RfidTags(1.5, "RFID", (rescue.Sighting("118", (-0.5, 0.25, -0.04)),)),
        "SEN {Time 1.50} {Type RFID} {Name RFID} {ID 118} "
        "{Location -0.5000,-0.2500,0.0400}",
    ),
    "motion": (
        rescue.HumanMotion(1.5, "HMD", 0.25),
        "SEN {Time 1.50} {Type HumanMotion} {Name HMD} {Prob  0.2500}",
    ),
    "sound": (
        rescue.Sound(1.5, "Sound", 54.0, 2.0),
        "SEN {Time 1.50} {Type Sound} {Name Sound} {Loudness 54.0000} "
        "{Duration 2.0000}",
    ),
    "gas": (
        rescue.GasDensity(1.5, "CO2", "CO2", 0.01),
        "SEN {Time 1.50} {Type CO2Sensor} {Name CO2} {Gas CO2} {Density 0.0100}",
    ),
    "robot": (reports.RobotJoined("R{1", "P3AT"), "NFO {Joined R?1} {ClassName P3AT}"),
    "answer to a watcher": (
        reports.Watching(RobotChoice(("R1", "R 2")), RobotChoice(None)),
        "NFO {Watching R1,R 2} {Echoes All}",
    ),
    "robot that has left": (reports.RobotLeft("R1"), "NFO {Left R1}"),
    "time of a tick": (reports.ClockTick(14.2), "NFO {Clock 14.20}"),
    "error": (reports.CommandError("a\n'{b}'"), "NFO {Error a '?b?'}"),
    "copy": (
        reports.WatchedLine("R1", "STA {Time 1.00}", None),
        "SEE {Robot R1} STA {Time 1.00}",
    ),
}


@pytest.mark.parametrize(("report", "line"), COMPAT_LINES.values(), ids=COMPAT_LINES)
def test_reports_are_encoded_in_the_compat_dialect(
    report: reports.Report, line: str
) -> None:
    assert report.encode(COMPAT) == line
    # Its report writes the same line; a little more than pi is read as -pi.
    read = reports.decode_report(line)
    if isinstance(
        report, (packages.PackageConf, packages.PackageGeo, reports.CameraConf)
    ):
        assert read is None  # no client needs them
        return
    assert read is not None
    assert read.encode(COMPAT) == line or "3.1416" in line


@pytest.mark.parametrize(
    ("report", "line"),
    [
        pytest.param(
            reports.Encoder(10.2, (("ECLeft", -24), ("ECRight", 3))),
            "SEN {Type Encoder} {Name ECLeft Tick -24} {Name ECRight Tick 3}",
            id="encoders",
        ),
        pytest.param(
            reports.Odometry(10.2, "Odometry", Pose2(1.0, 2.0, 0.5)),
            "SEN {Type Odometry} {Name Odometry} {Pose 1.0000,-2.0000,-0.5000}",
            id="odometry",
        ),
        pytest.param(
            reports.Touch(10.2, "Bumper", touched=False),
            "SEN {Time 10.20} {Type Touch} {Name Bumper Touch False}",
            id="touch, as of all robots",
        ),
    ],
)
def test_robots_of_ut2004_report_as_its_servers_did(
    report: reports.Report, line: str
) -> None:
    assert report.encode(COMPAT.of_generation("ut2004")) == line
    assert COMPAT.of_generation("udk") is COMPAT
    assert UDK.of_generation("ut2004") is UDK


def test_every_kind_of_report_has_a_line_above() -> None:
    classes = [each for each in vars(reports).values() if isinstance(each, type)]
    kinds = {each for each in classes if hasattr(each, "decode")}
    bases = {LineReport, SensorReport, ItemReport, reports.ItemConf}
    assert {type(report) for report, _ in COMPAT_LINES.values()} == kinds - bases
