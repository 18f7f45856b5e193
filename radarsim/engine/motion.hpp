// Drive all robots for a step: wheels, arcs and collisions.
//
// Robots move one after the other, in the order of spawning, so that a robot meets those before it where they have
// gone and those after it where they still are.
//
// The kinematics are those of skid steering, from the speeds of the left and right wheels, and an angle between
// heading and motion that robots with a steering axle have. Wheels reach their set-points at once: the set-point of a
// tick is the speed during that tick.
#pragma once
#include "collision.hpp"

namespace radarsim::robots {

constexpr double MAX_SWEEP = 0.05;  // m; a longer step is split, not to jump over obstacles
constexpr double MAX_PARTS = 1e6;  // a robot that would be faster gets anywhere
constexpr int64_t MAX_STEPS = 1 << 20; // in one call, which nothing interrupts
constexpr double TOUCH_UNKNOWN = -1.0; // of Robot::touched

// An angle, rad, wrapped to (-pi, pi].
inline double wrap_angle(double angle) {
    if (fabs(angle) < M_PI) return angle; // remainder takes as long as all else of a move
    double wrapped = remainder(angle, 2 * M_PI);
    return wrapped <= -M_PI ? M_PI : wrapped;
}

// The chord of an arc by its length, from half the turn; it points half the turn off the heading at its start.
inline double chord_ratio(double half) { return half != 0.0 ? sin(half) / half : 1.0; }

// The speeds of the left and the right wheels over ground, m/s, and how they move a robot.
struct Motion {
    double left, right;
    double aside;    // speed to the left, m/s
    double track;    // m between the wheel pairs; wider than the real one if the wheels slip sideways in a turn
    double sideslip; // angle from the heading to the motion of the centre, rad, whose part along the heading left and
                     // right are

    // The pose at the end of an exact arc, divided into parts of equal time.
    Pose2 advance(const Pose2& pose, double dt, double parts) const {
        // y points left, so faster right wheels turn the robot counter-clockwise
        double turn = (right - left) / track * (dt / parts), half = turn / 2;
        double chord = (left + right) / 2 * (dt / parts) * chord_ratio(half), direction = pose.yaw + half;
        if (sideslip != 0.0) {
            chord /= cos(sideslip);
            direction += sideslip;
        }
        Pose2 end = {pose.x + chord * cos(direction), pose.y + chord * sin(direction), wrap_angle(pose.yaw + turn)};
        if (aside == 0.0) return end;
        half = (right - left) / track * dt / parts / 2;
        chord = aside * dt / parts * chord_ratio(half);
        return {end.x - chord * sin(pose.yaw + half), end.y + chord * cos(pose.yaw + half), end.yaw};
    }
};

// An upper bound of the speed of a robot's fastest point, m/s; radius is the distance of the farthest from the centre.
inline double sweep_rate(double left, double right, double track, double radius, double sideslip) {
    double turn = fabs(right - left) / track, speed = fabs(left + right) / 2;
    if (sideslip != 0.0) speed /= cos(sideslip);
    return speed + turn * radius;
}
DOOR(sweep_rate, "")

inline bool is_rejected(const Robot& robot, const Pose2& wanted) {
    const double* move = robot.rejected;
    return robot.x == move[0] && robot.y == move[1] && robot.yaw == move[2] && wanted.x == move[3] &&
           wanted.y == move[4] && wanted.yaw == move[5];
}

// Move a robot towards a pose, as far as it is free.
inline void move(const Surroundings& around, const RobotGrid& grid, Robot& robot, Pose2 wanted, double sweep,
                 double dt) {
    robot.wall_gap -= sweep;
    robot.robot_gap -= sweep + grid.max_speed() * dt;
    // Nothing can be in reach before the gaps are used up (rules 1 and 2 of collisions). Most moves end here. With a
    // look for walls in each, a step would take twice as long: row j of the benchmarks.
    bool robots_are_far = robot.robot_gap > around.margin;
    if (robots_are_far && robot.wall_gap > around.margin) {
        robot.blocked = false;
    } else if (robots_are_far && is_rejected(robot, wanted)) {
        robot.blocked = true; // still pushing against the same wall: it need not be looked at again
        return;
    } else {
        wanted = Mover(around, grid, robot).avoid_collision(wanted, sweep);
    }
    robot.x = wanted.x, robot.y = wanted.y, robot.yaw = wanted.yaw;
}

inline void drive_robot(const Surroundings& around, const RobotGrid& grid, Robot& robot, double dt) {
    robot.touched = TOUCH_UNKNOWN;
    double left = robot.left_spin, right = robot.right_spin, aside = robot.aside;
    if (left == 0.0 && right == 0.0 && aside == 0.0) {
        // Others may approach meanwhile: the next move measures the gap anew.
        robot.robot_gap = robot.velocity_x = robot.velocity_y = 0.0;
        return;
    }
    // Also while something blocks the robot: its motors are stronger than its grip, so that wheel odometry drifts
    // there as it does on the original.
    robot.left_angle += left * dt;
    robot.right_angle += right * dt;
    left *= robot.wheel_radius;
    right *= robot.wheel_radius;
    Motion motion = {left, right, aside, robot.track, robot.sideslip};
    double sweep = (sweep_rate(left, right, robot.track, robot.radius, robot.sideslip) + fabs(aside)) * dt;
    // In ticks of 10 ms that is one part, unless a point of the robot is faster than 5 m/s. Splitting changes nothing,
    // as arcs are exact.
    double parts = ceil(sweep / MAX_SWEEP), x = robot.x, y = robot.y;
    if (!(parts >= 1.0 && parts <= MAX_PARTS)) parts = 1.0;
    for (double part = 0.0; part < parts; part++)
        move(around, grid, robot, motion.advance(robot.pose(), dt, parts), sweep / parts, dt / parts);
    robot.velocity_x = (robot.x - x) / dt;
    robot.velocity_y = (robot.y - y) / dt;
}

// Advance odometry to the present angles of the wheels. The motion since the last step is one circular arc, which is
// exact as long as the wheel speeds are constant in between.
inline void integrate_odometry(Odometry& odometry, const Robot& robot) {
    double left_turn = robot.left_angle - odometry.left_angle, right_turn = robot.right_angle - odometry.right_angle;
    if (left_turn == 0.0 && right_turn == 0.0) return;
    double left = robot.wheel_radius * left_turn, right = robot.wheel_radius * right_turn;
    double turn = (right - left) / odometry.separation, half = turn / 2, heading = odometry.yaw + half;
    double chord = (left + right) / 2 * chord_ratio(half);
    odometry.x += chord * cos(heading);
    odometry.y += chord * sin(heading);
    odometry.yaw += turn;
    odometry.left_angle = robot.left_angle;
    odometry.right_angle = robot.right_angle;
}

// Drive robots in a given order.
inline void drive_once(const Surroundings& around, RobotGrid& grid, Array<const int64_t> order, double dt) {
    grid.enter(dt);
    for (int64_t slot : order) drive_robot(around, grid, around.robots[slot], dt);
    for (Odometry& row : around.odometry)
        if (row.slot >= 0.0) integrate_odometry(row, around.robots[int64_t(row.slot)]);
}

// Find which robots were blocked in their last move, or touch something.
inline void find_touched_in(const Surroundings& around, RobotGrid& grid, Array<const int64_t> slots) {
    grid.enter(0.0);
    for (int64_t slot : slots) {
        Robot& robot = around.robots[slot];
        if (robot.touched == TOUCH_UNKNOWN)
            robot.touched = robot.blocked != 0.0 || Mover(around, grid, robot).is_touching();
    }
}

// Whether slots are in the table of robots, and there is room for all lines.
inline bool are_valid(const Surroundings& around, Array<const int64_t> slots) {
    int64_t rows = around.robots.size();
    if (slots.size() > rows) return false; // each robot comes once, so that there is room for its sides
    if (around.lines.size() < around.walls->lines.size() + 4 * rows) return false;
    for (int64_t slot : slots)
        if (slot < 0 || slot >= rows) return false;
    for (const Odometry& row : around.odometry)
        if (!(row.slot < double(rows))) return false;
    return true;
}

// Drive all robots for a time step; returns whether the arguments are valid, as the following functions.
inline bool drive_robots(const Surroundings& around, double dt) {
    if (!are_valid(around, around.order)) return false;
    RobotGrid grid(around.robots, around.order);
    drive_once(around, grid, around.order, dt);
    return true;
}
DOOR(drive_robots, "")

// Find which robots of some slots were blocked in their last move, or touch something.
inline bool find_touched(const Surroundings& around, Array<const int64_t> slots) {
    if (!are_valid(around, around.order) || !are_valid(around, slots)) return false;
    RobotGrid grid(around.robots, around.order);
    find_touched_in(around, grid, slots);
    return true;
}
DOOR(find_touched, "s")

// Drive some robots for several time steps as if there were no others, and note which are touched after any step.
inline bool drive_on(const Surroundings& around, Array<const int64_t> order, double dt, int64_t steps,
                     Array<bool> touched) {
    if (!are_valid(around, order) || steps > MAX_STEPS) return false;
    RobotGrid grid(around.robots, order);
    for (int64_t step = 0; step < steps; step++) {
        drive_once(around, grid, order, dt);
        find_touched_in(around, grid, order);
        for (int64_t i = 0; i < order.size(); i++) touched[i] |= around.robots[order[i]].touched == 1.0;
    }
    return true;
}
DOOR(drive_on, "r r")

// The same as if none of them met any other.
inline bool drive_each_alone(const Surroundings& around, Array<const int64_t> order, double dt, int64_t steps,
                             Array<bool> touched) {
    for (int64_t i = 0; i < order.size(); i++)
        if (!drive_on(around, {order.data + i, {1}}, dt, steps, {touched.data + i, {1}})) return false;
    return true;
}
DOOR(drive_each_alone, "r r")

} // namespace radarsim::robots
