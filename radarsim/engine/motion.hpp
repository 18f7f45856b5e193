// Moves all robots for a time step: wheel motion, circular arcs, and collisions with walls and other robots.
//
// A move without collision is executed unchanged. If the new pose penetrates a wall or a robot, it is pushed out along
// the shortest direction, so the robot slides. If that fails, the robot turns on the spot, and if that is blocked too,
// it stays. Every pose of a robot is free of collisions, so a robot can always back out of a contact.
//
// Rule 1: in a move no point of the robot travels farther than its sweep. So once the gap to the nearest wall is known,
// walls need not be checked until the sum of sweeps reaches it. This makes moves on open floor cheap.
// Rule 2: a move displaces the centre by at most max_displacement_ratio sweeps. So other robots need not be checked
// until the displacements of all robots can have used up the gap.
//
// Robots near a position are found by a spatial hash of square cells, so the floor may have any size. Robots are
// entered once per step, and the search radius includes the distance that robots can move during the step.
//
// Robots move one after the other in the order of spawning. A robot collides with the new poses of the robots before
// it, and with the old poses of the robots after it.
//
// The kinematics are skid steering with the speeds of the left and right wheels, plus the sideslip angle between
// heading and motion for robots with a steering axle. Wheels reach their set-points immediately: the set-point of a
// tick is the speed during that tick.
#pragma once
#include "walls.hpp"

namespace radarsim::robots {

constexpr double ROBOT_RANGE = 4.0; // m, maximum gap between the circles of two robots that find each other
constexpr double MIN_CELL = 2.0;    // m
constexpr double CELLS_IN_REACH = 3.0;
constexpr double FARTHEST_CELL = 1e15;
constexpr double CONTACT_GAP = 1e-3;   // m, remaining gap between a robot and an obstacle after a collision
constexpr double TOUCH_RANGE = 2e-3;   // m; closer obstacles touch the robot
constexpr double OUTLINE_RANGE = 0.1;  // m; gap between the circles of robots below which outlines are compared
constexpr int MAX_PUSHES = 8;          // in a wedge two walls alternate; more pushes would not leave it either

struct Surroundings { // the robots and the walls with which they can collide
    Array<Robot> robots;
    Array<const int64_t> order; // slots of all robots, in the order in which they move
    Array<Odometry> odometry;
    const Walls* walls;
    Array<LineSegment> lines;             // memory for the lines near a robot: all walls, and four for each robot
    double margin;                 // m; a smaller gap counts as contact
    double wall_range;             // m; walls up to this distance from the robot's circle are found
    double max_displacement_ratio; // maximum displacement of the centre in a move, divided by the sweep
};
LAYOUT(Surroundings, "t r o l", robots, order, odometry, walls, lines, margin, wall_range, max_displacement_ratio)

// Return the index of a cell along an axis, limited to the farthest cell.
inline int64_t cell_at(double place, double cell) {
    return int64_t(floor(minimum(maximum(-FARTHEST_CELL, place / cell), FARTHEST_CELL)));
}

// A spatial hash of robots by cell.
class RobotGrid {
  public:
    RobotGrid(Array<Robot> robots, Array<const int64_t> order)
        : robots_(robots), order_(order), buckets_(1), places_(order.size()), heads_(2 * order.size() + 1) {
        while (buckets_ <= order.size()) buckets_ *= 2;
    }

    // Enter all robots at their poses; the entries are valid while robots move for up to dt s.
    void enter(double dt) {
        double radius = 0.0, speed = 0.0;
        for (int64_t slot : order_) {
            radius = maximum(radius, robots_[slot].radius);
            speed = maximum(speed, robots_[slot].top_speed);
        }
        reach_ = ROBOT_RANGE + radius + speed * dt; // robots may move before they are searched
        cell_ = maximum(MIN_CELL, reach_ / CELLS_IN_REACH);
        max_speed_ = speed;
        memset(heads_.data(), 0, sizeof(int64_t) * buckets_);
        for (int64_t i = 0; i < order_.size(); i++) {
            const Robot& robot = robots_[order_[i]];
            int64_t column = cell_at(robot.x, cell_), row = cell_at(robot.y, cell_);
            int64_t& head = heads_[bucket_of(column, row)];
            places_[i] = {column, row, head};
            head = i + 1;
        }
    }

    // Call a function with each robot whose circle may be within ROBOT_RANGE of a circle around a pose.
    template <typename F> void visit_near(const Pose2& pose, double radius, F visit) const {
        double reach = radius + reach_;
        int64_t left = cell_at(pose.x - reach, cell_), right = cell_at(pose.x + reach, cell_);
        int64_t low = cell_at(pose.y - reach, cell_), high = cell_at(pose.y + reach, cell_);
        for (int64_t row = low; row <= high; row++)
            for (int64_t column = left; column <= right; column++)
                for (int64_t next = heads_[bucket_of(column, row)]; next; next = places_[next - 1].next) {
                    const Place& place = places_[next - 1];
                    // Two cells may share a bucket.
                    if (place.column == column && place.row == row) visit(robots_[order_[next - 1]]);
                }
    }

    double max_speed() const { return max_speed_; }

  private:
    struct Place {
        int64_t column, row;
        int64_t next; // index in the order of the next robot in the same bucket, plus 1; 0 for none
    };

    // Hash a cell; two large primes distribute neighbouring cells.
    int64_t bucket_of(int64_t column, int64_t row) const {
        return (uint64_t(column) * 73856093 ^ uint64_t(row) * 19349663) & (buckets_ - 1);
    }

    Array<Robot> robots_;
    Array<const int64_t> order_;
    int64_t buckets_; // a power of two
    Buffer<Place> places_;
    Buffer<int64_t> heads_; // first robot of each bucket, as in Place::next
    double cell_ = MIN_CELL, reach_ = 0.0, max_speed_ = 0.0;
};

// Moves a robot without collision with the walls and robots near it.
class Mover {
  public:
    Mover(const Surroundings& around, const RobotGrid& grid, Robot& robot)
        : around_(around), grid_(grid), robot_(robot) {}

    // Return the pose that the robot reaches when it moves towards a wanted pose. No point of the robot travels farther
    // than the sweep, which must be a fraction of its width, so that it cannot pass through obstacles.
    Pose2 avoid_collision(const Pose2& wanted, double sweep) {
        find_lines(wanted);
        double gap = contact(wanted).gap;
        note_gaps(gap, 0.0);
        robot_.blocked = gap <= around_.margin;
        if (gap > around_.margin) return wanted;
        Pose2 start = robot_.pose(), reached = avoid(wanted, sweep);
        if (fabs(reached.x - start.x) + fabs(reached.y - start.y) + fabs(reached.yaw - start.yaw) < 1e-9) {
            reached = start; // equal except for rounding errors
            // The move is stored only if walls blocked it, since a robot in the way may move on.
            bool by_walls = lines_.size() == walls_;
            const double moves[6] = {by_walls ? start.x : NOT_A_NUMBER, by_walls ? start.y : NOT_A_NUMBER,
                                     by_walls ? start.yaw : NOT_A_NUMBER, wanted.x, wanted.y, wanted.yaw};
            memcpy(robot_.rejected, moves, sizeof(moves));
        }
        // Lines were searched around the wanted pose, so the searched range around the reached pose is smaller by the
        // distance between the two poses.
        note_gaps(contact(reached).gap, hypot(reached.x - wanted.x, reached.y - wanted.y));
        return reached;
    }

    // Whether a wall or robot is within TOUCH_RANGE.
    bool is_touching() {
        if (minimum(robot_.wall_gap, robot_.robot_gap) > TOUCH_RANGE) return false;
        find_lines(robot_.pose());
        double gap = contact(robot_.pose()).gap;
        note_gaps(gap, 0.0);
        return gap <= TOUCH_RANGE;
    }

  private:
    Contact contact(const Pose2& pose) const {
        return find_contact({lines_.data, {lines_.size()}}, pose, robot_.half_length, robot_.half_width);
    }

    // Update the known gaps with the gap to the lines that were found around a pose offset m away.
    void note_gaps(double gap, double offset) {
        robot_.wall_gap = minimum(gap, around_.wall_range - offset);
        if (lines_.size() > walls_) robot_.robot_gap = minimum(gap, robot_.robot_gap);
    }

    // Find the lines near a pose, walls first, then outlines of robots. More distant robots limit the gap to robots.
    void find_lines(const Pose2& pose) {
        const Walls& walls = *around_.walls;
        double radius = robot_.radius, nearest = ROBOT_RANGE;
        walls_ = find_walls(walls, robot_.floor, pose.x, pose.y, radius + around_.wall_range, around_.lines);
        lines_ = {around_.lines.data, {walls_}};
        grid_.visit_near(pose, radius, [&](const Robot& other) {
            if (&other == &robot_) return;
            double gap = hypot(other.x - pose.x, other.y - pose.y) - (other.radius + radius);
            // A robot may fly over another robot, and descend next to that robot later.
            bool is_level = other.bottom < robot_.top && robot_.bottom < other.top;
            if (gap < OUTLINE_RANGE && is_level) add_outline(other, double(walls.lines.size()) + 4 * other.number);
            else nearest = minimum(nearest, gap);
        });
        robot_.robot_gap = nearest;
    }

    // Add the four sides of another robot, with ranks above the ranks of all walls.
    void add_outline(const Robot& other, double rank) {
        // The sides are computed from the pose only when needed, since most robots are far from others.
        double length = other.half_length, width = other.half_width, c = cos(other.yaw), s = sin(other.yaw);
        double x = length * c - width * s + other.x, y = length * s + width * c + other.y;
        for (int side = 0; side < 4; side++) {
            if (side % 2 == 0) length = -length;
            else width = -width;
            double next_x = length * c - width * s + other.x, next_y = length * s + width * c + other.y;
            lines_.data[lines_.shape[0]++] = {(x + next_x) / 2, (y + next_y) / 2, (next_x - x) / 2, (next_y - y) / 2,
                                              rank + side};
            x = next_x, y = next_y;
        }
    }

    // Return a pose without collision in place of a wanted pose with a collision.
    Pose2 avoid(const Pose2& wanted, double sweep) const {
        Pose2 start = robot_.pose();
        double start_gap = contact(start).gap;
        // A robot closer than CONTACT_GAP keeps sliding and is not pushed back.
        double clearance = maximum(2 * around_.margin, minimum(CONTACT_GAP, start_gap));
        // The second attempt is without rotation, since next to a wall the rotation may cause the collision.
        const double yaws[2] = {wanted.yaw, start.yaw};
        for (double yaw : yaws) {
            Pose2 freed = {wanted.x, wanted.y, yaw};
            if (push_out(freed, clearance) &&
                hypot(freed.x - start.x, freed.y - start.y) <= around_.max_displacement_ratio * sweep)
                return freed;
        }
        Pose2 turned = {start.x, start.y, wanted.yaw};
        if (contact(turned).gap > around_.margin) return turned;
        // A robot that was spawned inside an obstacle may leave it.
        return contact(wanted).gap > start_gap ? wanted : start;
    }

    // Push a pose out of all lines; returns whether the pose is free then.
    bool push_out(Pose2& pose, double clearance) const {
        for (int i = 0; i < MAX_PUSHES; i++) {
            Contact found = contact(pose);
            if (found.gap > around_.margin) return true;
            double push = clearance - found.gap;
            pose.x += push * found.away_x;
            pose.y += push * found.away_y;
        }
        return false;
    }

    const Surroundings& around_;
    const RobotGrid& grid_;
    Robot& robot_;
    Array<LineSegment> lines_ = {}; // the lines near the robot; walls come first
    int64_t walls_ = 0;      // number of walls in lines_
};

constexpr double MAX_SWEEP = 0.05;  // m; longer moves are split, so that robots do not jump over obstacles
constexpr double MAX_PARTS = 1e6;  // maximum number of parts of a move; faster moves are not split
constexpr int64_t MAX_STEPS = 1 << 20; // maximum number of steps in a call, since calls cannot be interrupted
constexpr double TOUCH_UNKNOWN = -1.0; // value of Robot::touched before it is computed

// Return the length of the chord of an arc divided by the length of the arc, for half of the arc's angle.
inline double chord_ratio(double half) { return half != 0.0 ? sin(half) / half : 1.0; }

// The kinematics of a robot for constant speeds of the wheels.
struct Motion {
    double left, right; // speeds of the left and right wheels along the heading, m/s
    double aside;    // speed to the left, m/s
    double track;    // m between left and right wheels; wider than the real track if wheels slip sideways in a turn
    double sideslip; // angle from the heading to the motion of the centre, rad

    // Divide a time step into parts of equal duration, and return the pose after one of them; the arc is exact.
    Pose2 advance(const Pose2& pose, double dt, double parts) const {
        // The y axis points left, so faster right wheels turn the robot counter-clockwise.
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

// Return an upper bound of the speed of all points of a robot, m/s; radius is their largest distance from the centre.
inline double sweep_rate(double left, double right, double track, double radius, double sideslip) {
    double turn = fabs(right - left) / track, speed = fabs(left + right) / 2;
    if (sideslip != 0.0) speed /= cos(sideslip);
    return speed + turn * radius;
}
BIND(sweep_rate, "")

inline bool is_rejected(const Robot& robot, const Pose2& wanted) {
    const double* move = robot.rejected;
    return robot.x == move[0] && robot.y == move[1] && robot.yaw == move[2] && wanted.x == move[3] &&
           wanted.y == move[4] && wanted.yaw == move[5];
}

// Move a robot towards a wanted pose, as far as obstacles permit.
inline void move(const Surroundings& around, const RobotGrid& grid, Robot& robot, Pose2 wanted, double sweep,
                 double dt) {
    robot.wall_gap -= sweep;
    robot.robot_gap -= sweep + grid.max_speed() * dt;
    // No collision is possible until the gaps are used up (rules 1 and 2). Most moves return here; a search for walls
    // in each move would double the time of a step (row j of the benchmarks).
    bool robots_are_far = robot.robot_gap > around.margin;
    if (robots_are_far && robot.wall_gap > around.margin) {
        robot.blocked = false;
    } else if (robots_are_far && is_rejected(robot, wanted)) {
        robot.blocked = true; // the robot still pushes against the same wall, so no search is needed
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
        // Other robots may approach, so the next move measures the gap again.
        robot.robot_gap = robot.velocity_x = robot.velocity_y = 0.0;
        return;
    }
    // Wheels also turn while the robot is blocked, since the motors are stronger than the grip. So wheel odometry
    // drifts at obstacles, as in the original.
    robot.left_angle += left * dt;
    robot.right_angle += right * dt;
    left *= robot.wheel_radius;
    right *= robot.wheel_radius;
    Motion motion = {left, right, aside, robot.track, robot.sideslip};
    double sweep = (sweep_rate(left, right, robot.track, robot.radius, robot.sideslip) + fabs(aside)) * dt;
    // A tick of 10 ms has a single part, unless a point of the robot is faster than 5 m/s. Without obstacles, splitting
    // does not change the result, since arcs are exact.
    double parts = ceil(sweep / MAX_SWEEP), x = robot.x, y = robot.y;
    if (!(parts >= 1.0 && parts <= MAX_PARTS)) parts = 1.0;
    for (double part = 0.0; part < parts; part++)
        move(around, grid, robot, motion.advance(robot.pose(), dt, parts), sweep / parts, dt / parts);
    robot.velocity_x = (robot.x - x) / dt;
    robot.velocity_y = (robot.y - y) / dt;
}

// Advance odometry to the current angles of the wheels. The motion since the last step is a circular arc, which is
// exact if the wheel speeds were constant.
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

// Move robots for a time step in the given order, and advance all odometry.
inline void drive_once(const Surroundings& around, RobotGrid& grid, Array<const int64_t> order, double dt) {
    grid.enter(dt);
    for (int64_t slot : order) drive_robot(around, grid, around.robots[slot], dt);
    for (Odometry& row : around.odometry)
        if (row.slot >= 0.0) integrate_odometry(row, around.robots[int64_t(row.slot)]);
}

// Set for each robot whether it was blocked in its last move or touches an obstacle.
inline void find_touched_in(const Surroundings& around, RobotGrid& grid, Array<const int64_t> slots) {
    grid.enter(0.0);
    for (int64_t slot : slots) {
        Robot& robot = around.robots[slot];
        if (robot.touched == TOUCH_UNKNOWN)
            robot.touched = robot.blocked != 0.0 || Mover(around, grid, robot).is_touching();
    }
}

// Whether all slots are in the table of robots, and the array of lines is long enough.
inline bool are_valid(const Surroundings& around, Array<const int64_t> slots) {
    int64_t rows = around.robots.size();
    if (slots.size() > rows) return false; // each robot may occur once, since the array has room for its four sides
    if (around.lines.size() < around.walls->lines.size() + 4 * rows) return false;
    for (int64_t slot : slots)
        if (slot < 0 || slot >= rows) return false;
    for (const Odometry& row : around.odometry)
        if (!(row.slot < double(rows))) return false;
    return true;
}

// Move all robots for a time step. This and the following functions return whether the arguments are valid.
inline bool drive_robots(const Surroundings& around, double dt) {
    if (!are_valid(around, around.order)) return false;
    RobotGrid grid(around.robots, around.order);
    drive_once(around, grid, around.order, dt);
    return true;
}
BIND(drive_robots, "")

// Set for the robots of some slots whether they were blocked in their last move or touch an obstacle.
inline bool find_touched(const Surroundings& around, Array<const int64_t> slots) {
    if (!are_valid(around, around.order) || !are_valid(around, slots)) return false;
    RobotGrid grid(around.robots, around.order);
    find_touched_in(around, grid, slots);
    return true;
}
BIND(find_touched, "s")

// Move some robots for several time steps, as if no other robots existed. If together is false, each robot moves as if
// it were alone. Sets touched for robots that touch an obstacle after any step.
inline bool drive_on(const Surroundings& around, Array<const int64_t> slots, double dt, int64_t steps, bool together,
                     Array<bool> touched) {
    if (!are_valid(around, slots) || steps > MAX_STEPS) return false;
    int64_t count = together ? slots.size() : 1;
    for (int64_t first = 0; first < slots.size(); first += count) {
        Array<const int64_t> order = {slots.data + first, {count}};
        RobotGrid grid(around.robots, order);
        for (int64_t step = 0; step < steps; step++) {
            drive_once(around, grid, order, dt);
            find_touched_in(around, grid, order);
            for (int64_t i = 0; i < count; i++) touched[first + i] |= around.robots[order[i]].touched == 1.0;
        }
    }
    return true;
}
BIND(drive_on, "r r")

} // namespace radarsim::robots
