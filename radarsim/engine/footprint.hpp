// The distance between a robot's rectangle and lines, and the direction out; see footprint.py for the theory.
#pragma once
#include "robot.hpp"

namespace radarsim::robots {

struct LineSegment {
    double middle_x, middle_y; // m, map frame
    double half_x, half_y;     // vector from the middle to the second end, m
    double rank;               // of lines at the same distance the one of lowest rank counts
};
LAYOUT(LineSegment, "", middle_x, middle_y, half_x, half_y, rank)

struct Contact {
    double gap;            // lower bound of the distance to a line, m; negative, minus the depth, if it reaches in
    double away_x, away_y; // unit vector along which the gap grows, map frame
};
LAYOUT(Contact, "", gap, away_x, away_y)

inline Contact find_contact(Array<const LineSegment> lines, const Pose2& pose, double half_length, double half_width) {
    double c = cos(pose.yaw), s = sin(pose.yaw), rank = 0.0;
    Contact contact = {INFINITE, 0.0, 0.0};
    for (const LineSegment& line : lines) {
        double dx = line.middle_x - pose.x, dy = line.middle_y - pose.y;
        double middle_x = dx * c + dy * s, middle_y = dy * c - dx * s;
        double half_x = line.half_x * c + line.half_y * s, half_y = line.half_y * c - line.half_x * s;
        double along_x = fabs(middle_x) - fabs(half_x) - half_length;
        double along_y = fabs(middle_y) - fabs(half_y) - half_width;
        // Spares the normal and its square root, as the gap is the largest of the three: row j of the benchmarks.
        if (most(along_x, along_y) > contact.gap) continue;
        double across = fabs(middle_x * half_y - middle_y * half_x);
        across -= half_length * fabs(half_y) + half_width * fabs(half_x);
        double length = hypot(half_x, half_y);
        across /= length;
        double gap = most(along_x, along_y, across);
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

// The contacts of a rectangle at several poses: x, y and yaw.
inline void find_contacts(Array<const LineSegment> lines, Array<const Vector> poses, double half_length,
                          double half_width, Array<Contact> contacts) {
    for (int64_t i = 0; i < poses.size(); i++)
        contacts[i] = find_contact(lines, {poses[i][0], poses[i][1], poses[i][2]}, half_length, half_width);
}
DOOR(find_contacts, "l p p")

} // namespace radarsim::robots
