from math import pi, radians

import numpy as np
import pytest

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import Link
from radarsim.protocol import packages, reports
from radarsim.protocol.dialect import UDK

RESTING = Pose3(4.5, -1.9, 0.146, yaw=-pi / 2)  # 1.57 to the right on the wire
CAMERA_LINK = Link(max_speed=1.571, max_torque=20, min_angle=-0.16, max_angle=0.4)


def sick(ranges: list[float]) -> reports.RangeScan:
    return reports.RangeScan(31.2, "lms200", 0.01745, 3.14159, np.array(ranges))


UDK_LINES: dict[str, tuple[reports.Report, str]] = {
    "greeting": (
        reports.Greeting("DM-Test"),
        "NFO {Gametype BotDeathMatch} {Level DM-Test} {TimeLimit 20}",
    ),
    "start poses": (
        reports.StartPoses(
            (
                ("PlayerStart_0", Pose3(4.5, -1.9, 0.5)),
                ("Robot1", Pose3(3.63, -10.8, 0.18, yaw=1.59)),
            )
        ),
        "NFO {StartPoses 2} {PlayerStart_0 4.5000,1.9000,-0.5000 "
        "0.0000,0.0000,0.0000 Robot1 3.6300,10.8000,-0.1800 0.0000,0.0000,-1.5900}",
    ),
    "status with light and an empty battery": (
        reports.Status(31.1, 0, light=True),
        "STA {Time 31.1000} {Battery 0} {Type GroundVehicle} {LightToggle True} "
        "{LightIntensity 100} {FrontSteer 0} {RearSteer 0}",
    ),
    "inertial measurement unit": (
        reports.Imu(
            1.5, "IMU", (0.25, -1.5, 0), (0, 0, 0.5), (0, 0, -0.125), (0, 0, 3.5)
        ),
        "SEN {Time 1.5000} {Type IMU} {Name IMU} "
        "{XYZAcceleration 0.2500,1.5000,0.0000} "
        "{AngularVel 0.0000,0.0000,-0.5000} {AngularAccel 0.0000,0.0000,0.1250} "
        "{Rotation 0.0000,0.0000,2.7831}",
    ),
    "accelerations": (
        reports.Acceleration(1.5, "A", (0.29999, -1.5, 0)),
        "SEN {Time 1.5000} {Type Accel} {Name A} {Acceleration 0.2999,1.5000,0.0000}",
    ),
    "links of an actuator": (
        packages.PackageState(45.14, "CameraPanTilt", ((0.0, -20.0), (-0.16, -20.0))),
        "ASTA {Time 45.1400} {Name CameraPanTilt} {Link 1} {Value 0.0000} "
        "{Link 2} {Value -0.1600}",
    ),
    "what links can do": (
        packages.PackageConf(
            "MisPkg",
            (
                (
                    "Cam",
                    (CAMERA_LINK,),
                ),
            ),
        ),
        "CONF {Type MisPkg} {Name Cam} {Link 1} {JointType Revolute} "
        "{MaxRotationSpeed 1.5710} {MaxTorque 20.0000} {MinRange -0.1600} "
        "{MaxRange 0.4000}",
    ),
    "what links of actuators can do": (
        packages.PackageConf(
            "Actuator",
            (
                (
                    "Cam",
                    (CAMERA_LINK,),
                ),
                (
                    "Arm",
                    (
                        Link(
                            max_speed=1.571,
                            max_torque=4,
                            min_angle=-2.086,
                            max_angle=2.086,
                        ),
                    ),
                ),
            ),
        ),
        "CONF {Type Actuator} {Name Cam} {Link 1} {JointType Revolute} "
        "{MaxTorque 20.0000} {MinValue -0.1600} {MaxValue 0.4000} {Name Arm} {Link 1} "
        "{JointType Revolute} {MaxTorque 4.0000} {MinValue -2.0860} {MaxValue 2.0860}",
    ),
    "where links of an actuator are": (
        packages.PackageGeo("Actuator", (("Cam", (Pose3(1, 2, 3),)),), "Kenaf"),
        "GEO {Type Actuator} {Name Cam} {Location 1.00,-2.00,-3.00} "
        "{Orientation 0.00,0.00,0.00} {Mount Kenaf} {Link 1} {Parent -1} "
        "{Location 1.00,-2.00,-3.00} {Orientation 0.00,0.00,0.00}",
    ),
    "scan": (
        sick([2.199, 2.3, 1.15, 20.0]),
        "SEN {Time 31.2000} {Type RangeScanner} {Name lms200} {Resolution 0.0174} "
        "{FOV 3.1414} {Range 2.19,2.29,1.14,20.00}",
    ),
    "scan of whole degrees": (
        reports.RangeScan(31.2, "lms200", radians(1), pi, np.array([2.0])),
        "SEN {Time 31.2000} {Type RangeScanner} {Name lms200} {Resolution 0.0174} "
        "{FOV 3.1414} {Range 2.00}",
    ),
    "echoes, ranges cut off and shares rounded": (
        reports.EchoLine(
            31.2,
            "lms200",
            2,
            3,
            reports.TargetEchoes(
                object="cloud",
                material="smoke",
                density=0.0,
                transparency=1.0,
                laser_passes=True,
                robot_passes=True,
                beams=np.array([0, 180]),
                ranges=np.array([2.3, 19.999]),
                kinds=("leave", "sheet"),
                power=np.array([0.99996, 0.5]),
                strength=np.array([0.0, 0.12345]),
            ),
        ),
        "SEN {Time 31.2000} {Type Echoes} {Name lms200} {Line 2} {Lines 3} "
        "{Object cloud} {Material smoke} {Density 0.0000} {Transparency 1.0000} "
        "{LaserPasses True} {RobotPasses True} "
        "{Echoes 0,2.29,Leave,1.0000,0.0000 180,19.99,Sheet,0.5000,0.1235}",
    ),
    "no targets": (
        reports.RadarTargets(
            31.2, "Navtech", 0, 0, np.zeros(0, np.int64), *[np.zeros(0)] * 2
        ),
        "SEN {Time 31.2000} {Type RadarTargets} {Name Navtech} {Line 0} {Lines 0}",
    ),
    "ground truth": (
        reports.GroundTruth(31.1, "GndTruth", RESTING),
        "SEN {Time 31.1000} {Type GroundTruth} {Name GndTruth} "
        "{Location 4.500,1.900,-0.146} {Orientation 0.000,0.000,1.570}",
    ),
    "INS to the left counts on from a full turn": (
        reports.Ins(31.2, "InsTest", Pose3(4.5, -1.9, 0.4, yaw=pi / 2)),
        "SEN {Type INS} {Name InsTest} {Location 4.50,1.90,-0.40} "
        "{Orientation 0.00,0.00,4.71}",
    ),
    "odometry": (
        reports.Odometry(31.2, "Odometer", Pose2(1.0, 2.0, -0.5)),
        "SEN {Time 31.2000} {Type Odometry} {Name Odometer} "
        "{Pose 1.0000,-2.0000,0.5000}",
    ),
    "sonar": (
        reports.Sonar(31.1, (("F1", 2.3),)),
        "SEN {Time 31.1000} {Type Sonar} {Name F1} {Range 2.2999}",
    ),
    "GPS": (
        reports.Gps(31.1, "GPS", (39.5, -77.25), 11),
        "SEN {Time 31.1000} {Type GPS} {Name GPS} {Latitude 39,30.0000,N} "
        "{Longitude 77,15.0000,W} {Fix 1} {Satellites 11}",
    ),
    "touch": (
        reports.Touch(31.1, "Touch", touched=False),
        "SEN {Time 31.1000} {Type Touch} {Name Touch} {Touch False}",
    ),
    "two mounts": (
        reports.ItemGeo(
            "Encoder", (("W1", Pose3(0, 0, 0)), ("W2", Pose3(0, 0, 0))), "P3AT"
        ),
        "GEO {Type Encoder} {Name W1} {Location 0.00,0.00,0.00} "
        "{Orientation 0.00,0.00,0.00}{Mount P3AT} {Name W2} "
        "{Location 0.00,0.00,0.00} {Orientation 0.00,0.00,0.00}{Mount P3AT}",
    ),
}


@pytest.mark.parametrize(("report", "line"), UDK_LINES.values(), ids=UDK_LINES)
def test_reports_are_encoded_in_the_udk_dialect(
    report: reports.Report, line: str
) -> None:
    assert report.encode(UDK) == line
