// The tables of robots and of their odometry, and the distance between a robot's rectangle and lines (see
// footprint.py). Integers and booleans in the tables are also stored as doubles.
#pragma once
#include "bindings.hpp"

namespace radarsim {

struct Pose2 {
    double x, y, yaw; // m, rad, map frame
};

struct Robot {
    double x, y, yaw;               // pose on the floor, m, rad, map frame
    double left_spin, right_spin;   // speeds of the wheels, rad/s
    double left_angle, right_angle; // angles by which the wheels turned forward since the spawn, rad
    double blocked;                 // whether the last move did not end at the wanted pose
    double wall_gap, robot_gap;     // lower bounds of the distances to walls and to other robots, m
    double rejected[6];             // start and wanted pose of the last move that walls blocked, nan if none
    double bottom, top;             // z of the floor and of the top of the robot, m
    double half_length, half_width, radius; // half sides of the rectangle, and radius of the circle around it, m
    double track, wheel_radius;             // m
    double top_speed;                       // highest speed of the centre, including pushes, m/s
    double floor;                           // number of the floor
    double number;                          // number of the robot in the order of spawning, from 1
    double touched;                         // whether it was blocked or touches an obstacle; -1 if not computed yet
    double body_z;                          // z of the body frame, m
    double sideslip;                // angle from heading to motion of the centre, rad; 0 without steering axle
    double front_steer, rear_steer; // steering angles of the front and the rear axle, rad
    double velocity_x, velocity_y, velocity_z;     // of the centre in the last step, including pushes, m/s, map frame
    double aside, climb;                           // speeds of a flying robot to its left and upwards, m/s
    double roll, pitch, roll_wanted, pitch_wanted; // attitude, and set-points of the attitude, rad

    Pose2 pose() const { return {x, y, yaw}; }
};
ROW(Robot, x, y, yaw, left_spin, right_spin, left_angle, right_angle, blocked, wall_gap, robot_gap, rejected,
       bottom, top, half_length, half_width, radius, track, wheel_radius, top_speed, floor, number, touched, body_z,
       sideslip, front_steer, rear_steer, velocity_x, velocity_y, velocity_z, aside, climb, roll, pitch, roll_wanted,
       pitch_wanted)

struct Odometry {
    double slot;                    // slot of the robot; -1 for an unused row
    double separation;              // distance between the left and right wheels, m
    double x, y, yaw;               // pose since the reset, m, rad, not wrapped
    double left_angle, right_angle; // angles of the wheels at this pose, rad
};
ROW(Odometry, slot, separation, x, y, yaw, left_angle, right_angle)

} // namespace radarsim

namespace radarsim::robots {

struct LineSegment {
    double middle_x, middle_y; // m, map frame
    double half_x, half_y;     // vector from the middle to the second end, m
    double rank;               // if lines have the same distance, the line with the lowest rank counts
};
ROW(LineSegment, middle_x, middle_y, half_x, half_y, rank)

struct Contact {
    double gap;            // lower bound of the distance to a line, m; minus the depth if the line penetrates the robot
    double away_x, away_y; // unit vector along which the gap grows, map frame
};
ROW(Contact, gap, away_x, away_y)

inline Contact find_contact(Array<const LineSegment> lines, const Pose2& pose, double half_length, double half_width) {
    double c = cos(pose.yaw), s = sin(pose.yaw), rank = 0.0;
    Contact contact = {INFINITE, 0.0, 0.0};
    for (const LineSegment& line : lines) {
        double dx = line.middle_x - pose.x, dy = line.middle_y - pose.y;
        double middle_x = dx * c + dy * s, middle_y = dy * c - dx * s;
        double half_x = line.half_x * c + line.half_y * s, half_y = line.half_y * c - line.half_x * s;
        double along_x = fabs(middle_x) - fabs(half_x) - half_length;
        double along_y = fabs(middle_y) - fabs(half_y) - half_width;
        // The gap is the maximum of three distances, so the third, with its square root, need not be computed if one of
        // the others is already too large (row j of the benchmarks).
        if (maximum(along_x, along_y) > contact.gap) continue;
        double across = fabs(middle_x * half_y - middle_y * half_x);
        across -= half_length * fabs(half_y) + half_width * fabs(half_x);
        double length = hypot(half_x, half_y);
        across /= length;
        double gap = maximum(along_x, along_y, across);
        if (!(gap < contact.gap || (gap == contact.gap && line.rank < rank))) continue;
        double axis_x = 1.0, axis_y = 0.0;
        if (along_x < gap && along_y == gap) axis_x = 0.0, axis_y = 1.0;
        else if (along_x < gap) axis_x = half_y / length, axis_y = -half_x / length; // to the right of the line
        if (axis_x * middle_x + axis_y * middle_y > 0) axis_x = -axis_x, axis_y = -axis_y;
        contact = {gap, c * axis_x - s * axis_y, s * axis_x + c * axis_y};
        rank = line.rank;
    }
    return contact;
}

// Find the contact of a rectangle at each of several poses: x, y and yaw.
inline void find_contacts(Array<const LineSegment> lines, Array<const Vector> poses, double half_length,
                          double half_width, Array<Contact> contacts) {
    for (int64_t i = 0; i < poses.size(); i++)
        contacts[i] = find_contact(lines, {poses[i][0], poses[i][1], poses[i][2]}, half_length, half_width);
}
BIND(find_contacts, "l p p")

} // namespace radarsim::robots
