// The table of robots, and that of their odometry. Whole numbers and truth values are doubles too.
#pragma once
#include "door.hpp"

namespace radarsim {

struct Pose2 {
    double x, y, yaw; // m, rad, map frame
};

struct Robot {
    double x, y, yaw;               // pose on the floor, m, rad, map frame
    double left_spin, right_spin;   // speeds of the wheels, rad/s
    double left_angle, right_angle; // that the wheels turned forward since the spawn, rad
    double blocked;                 // whether the last move did not end at the wanted pose
    double wall_gap, robot_gap;     // m: no wall is closer, no other robot is closer
    double rejected[6];             // start and wanted pose of the last move that walls forbade, nan if none
    double bottom, top;             // z of the floor and of the top, m
    double half_length, half_width, radius; // radius around all, m
    double track, wheel_radius;             // m
    double top_speed;                       // highest speed of the centre, pushes included, m/s
    double floor;                           // its number
    double number;                          // counts the robots in the order of spawning, from 1 on
    double touched;                         // whether it was blocked or touches something; -1 until that is asked for
    double body_z;                          // z of the body frame, m
    double sideslip;                // angle between the heading and the motion of the centre, rad; 0 without an axle
    double front_steer, rear_steer; // angles of the wheels of such axles, rad
    double velocity_x, velocity_y, velocity_z;     // of the centre in the last step, pushes included, m/s, map frame
    double aside, climb;                           // of a robot that flies: speed to its left and upwards, m/s
    double roll, pitch, roll_wanted, pitch_wanted; // how far it tilts, and how far it is to tilt, rad

    Pose2 pose() const { return {x, y, yaw}; }
};
LAYOUT(Robot, "", x, y, yaw, left_spin, right_spin, left_angle, right_angle, blocked, wall_gap, robot_gap, rejected,
       bottom, top, half_length, half_width, radius, track, wheel_radius, top_speed, floor, number, touched, body_z,
       sideslip, front_steer, rear_steer, velocity_x, velocity_y, velocity_z, aside, climb, roll, pitch, roll_wanted,
       pitch_wanted)

struct Odometry {
    double slot;                    // of the robot; -1 of a row without odometry
    double separation;              // distance between the left and right wheels, m
    double x, y, yaw;               // pose since the reset, m, rad, not wrapped
    double left_angle, right_angle; // of the wheels at the pose, rad
};
LAYOUT(Odometry, "", slot, separation, x, y, yaw, left_angle, right_angle)

} // namespace radarsim
