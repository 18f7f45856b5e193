// Readings of sensors that do not cast rays: INS, odometry, encoders, tachometers, accelerometers and others.
//
// The state of a sensor is a structure of numbers in the row of its robot. Jobs produce the report of a robot: each job
// writes the numbers of an attribute, in the order of the line. Robots of the same class have their structures at the
// same positions in their rows, and share their jobs.
//
// An INS is dead reckoning that drifts with the distance driven and the angles turned. Its estimate starts at the true
// pose of the sensor. An update adds the true motion of the body since the previous update, with errors: for each
// coordinate the distance times a normal random number, for each angle the rotation times another random number.
// Readings between updates add the true motion without error.
//
// A tachometer measures the mean speed of wheels since its last reading, and their angles, without noise. An encoder
// counts ticks with an error that is a fraction of the total angle; the count restarts at 0 in every revolution.
//
// A velocity is the velocity of the body in the last tick. An acceleration is the change of velocity since the last
// reading, along the axes of the sensor at the time of the reading. Rates are the derivatives of roll, pitch and yaw,
// not the angular velocities about the axes of the body.
//
// Python draws several random numbers in advance, which are the same as if they were drawn one by one.
//
// Source: the sensors of the original server; its INS has a standard deviation of 5 % regardless of the settings.
#pragma once
#include "robot.hpp"

namespace radarsim {

constexpr double GRAVITY = 9.81;                // m/s2
constexpr double SEA_LEVEL = -111.0;            // m; height of the sea relative to the spawn, as in the original
constexpr double ENCODER_RESOLUTION = 0.01745;  // rad per tick
constexpr double TICKS_A_SECOND = 100.0, TICKS_A_MINUTE = 6000.0;
constexpr int64_t DRAWN_AHEAD = 16;             // updates of an INS, or readings of an encoder, with random numbers
constexpr double SHORTEST = 1e-6;               // s, least time between two readings for a new speed

// The numbers that a job writes, in the order of the enumeration: time, s; charge of the battery, s; whether the robot
// is touched; pose of the body; its yaw, rad; angles of the front and the rear axle, rad; heights above the spawn and
// above the sea, m; minutes since the spawn; x, y and yaw of wheel odometry; nothing (the INS drifts); estimated pose
// of an INS; speed of a left or right wheel, rad/s; angle of a left or right wheel, rad; ticks of an encoder;
// acceleration, 3 numbers; proper acceleration, 3 numbers; inertial measurement unit, 12 numbers; angle of a mission
// package's link.
ENUMERATION(Reading, int64_t, TIME, CHARGE, TOUCHED, BODY_POSE, HEADING, STEERING, ALTITUDES, MINUTES, WHEEL_POSE,
            DRIFT, INS_POSE, LEFT_SPEED, RIGHT_SPEED, LEFT_ANGLE, RIGHT_ANGLE, TICKS, ACCELERATION,
            PROPER_ACCELERATION, INERTIA, LINK_ANGLE)
struct Job {
    Reading kind;
    int64_t place; // index of the sensor's structure in the row of its robot
};
struct DueJobs { // jobs of a robot that are due: from first to before end
    int64_t slot, first, end;
};

struct Charge {
    double life, least; // duration of a full battery, and minimum charge, s
    double spawn_tick;
};
struct Ins {
    double estimate[6], bias[6]; // estimated pose, map frame, and mean errors
    double body[6];              // true pose of the body at the last update
    double sigma;                // standard deviation of errors
    double used;                 // number of updates whose random numbers are used
    double draws[6 * DRAWN_AHEAD];
};
struct Tachometer {
    double read_at; // time of the last reading, s
    double angles[2], speeds[2], zero[2]; // left and right wheels: values of the last reading, and zero angles
};
struct Encoder { // encoder of a wheel
    double side, zero, sign; // side 1 is right; zero is the angle at count 0; sign -1: forward counts down
    double noise, used;      // largest error as a fraction of the angle; number of used random numbers
    double draws[DRAWN_AHEAD];
};
struct Accelerometer {
    double axes[9]; // axes of the sensor in the body frame, row by row
    double read_at;    // time of the last reading, s
    double velocity[3], attitude[3], rates[3]; // values of the last reading
};
struct Link { // link of a mission package
    double from_angle, from_tick, to_angle, speed; // angle, rad, and tick at the command; target angle, rad; rad/s
};
ROW(Job, kind, place)
ROW(DueJobs, slot, first, end)
ROW(Charge, life, least, spawn_tick)
ROW(Ins, estimate, bias, body, sigma, used, draws)
ROW(Tachometer, read_at, angles, speeds, zero)
ROW(Encoder, side, zero, sign, noise, used, draws)
ROW(Accelerometer, axes, read_at, velocity, attitude, rates)
ROW(Link, from_angle, from_tick, to_angle, speed)

// Output of numbers, which are counted even if there is no room.
struct Numbers {
    Array<double> room;
    int64_t count;

    void add(double number) {
        if (count < room.size()) room[count] = number;
        count++;
    }
    void add(const double* numbers, int size) {
        for (int i = 0; i < size; i++) add(numbers[i]);
    }
};

// Return the motion along an axis, or the rotation by the smaller angle if the axis is an angle (3 to 5).
inline double measure_motion(double start, double end, int axis) {
    double motion = end - start;
    return axis < 3 || fabs(motion) <= M_PI ? motion : remainder(motion, 2 * M_PI);
}

inline void move_ins(Ins& ins, const double* body) {
    double square = 0.0;
    for (int axis = 0; axis < 3; axis++) square += (body[axis] - ins.body[axis]) * (body[axis] - ins.body[axis]);
    double distance = sqrt(square);
    const double* draws = &ins.draws[6 * (whole_of(ins.used) & (DRAWN_AHEAD - 1))];
    for (int axis = 0; axis < 6; axis++) {
        double motion = measure_motion(ins.body[axis], body[axis], axis);
        // Errors of all coordinates grow with the driven distance, errors of angles with the rotation.
        double scale = axis < 3 ? distance : motion;
        ins.estimate[axis] += motion + scale * (ins.bias[axis] + ins.sigma * draws[axis]);
        ins.body[axis] = body[axis];
    }
    ins.used += 1.0;
}

inline void read_ins(const Ins& ins, const double* body, Numbers& out) {
    for (int axis = 0; axis < 6; axis++) out.add(ins.estimate[axis] + measure_motion(ins.body[axis], body[axis], axis));
}

inline const Tachometer& measure_speeds(Tachometer& sensor, double time, const Robot& robot) {
    const double angles[] = {robot.left_angle, robot.right_angle}, elapsed = time - sensor.read_at;
    if (elapsed > SHORTEST) {
        for (int side = 0; side < 2; side++) {
            sensor.speeds[side] = (angles[side] - sensor.angles[side]) / elapsed;
            sensor.angles[side] = angles[side];
        }
        sensor.read_at = time;
    }
    return sensor;
}

inline double count_ticks(Encoder& encoder, const Robot& robot) {
    double error = -encoder.noise + 2 * encoder.noise * encoder.draws[whole_of(encoder.used) & (DRAWN_AHEAD - 1)];
    encoder.used += 1.0;
    double turned = ((encoder.side != 0.0 ? robot.right_angle : robot.left_angle) - encoder.zero) * (1 + error);
    return trunc(fmod(turned, 2 * M_PI) / ENCODER_RESOLUTION) * encoder.sign;
}

// Rotate a vector in a plane.
inline void turn(double angle, double& a, double& b) {
    double c = cos(angle), s = sin(angle), turned = c * a - s * b;
    b = s * a + c * b;
    a = turned;
}

// Write the acceleration along the axes of a sensor; for INERTIA also rates, their changes, and the attitude.
inline void read_acceleration(Accelerometer& sensor, double time, const Robot& robot, Reading kind, Numbers& out) {
    const double velocity[] = {robot.velocity_x, robot.velocity_y, robot.velocity_z};
    const double attitude[] = {robot.roll, robot.pitch, robot.yaw};
    double elapsed = time - sensor.read_at, felt[3] = {}; // components along, across and up
    bool is_new = elapsed > SHORTEST;
    if (is_new) {
        double more_x = (velocity[0] - sensor.velocity[0]) / elapsed;
        double more_y = (velocity[1] - sensor.velocity[1]) / elapsed;
        double c = cos(robot.yaw), s = sin(robot.yaw);
        felt[0] = c * more_x + s * more_y, felt[1] = c * more_y - s * more_x;
        felt[2] = (velocity[2] - sensor.velocity[2]) / elapsed;
        memcpy(sensor.velocity, velocity, sizeof(velocity));
        sensor.read_at = time;
    }
    felt[2] -= kind == Reading::PROPER_ACCELERATION ? GRAVITY : 0.0;
    if (robot.roll != 0.0 || robot.pitch != 0.0) {
        turn(robot.pitch, felt[0], felt[2]);
        turn(-robot.roll, felt[1], felt[2]);
    }
    for (int axis = 0; axis < 3; axis++) {
        const double* along = &sensor.axes[3 * axis];
        out.add(along[0] * felt[0] + along[1] * felt[1] + along[2] * felt[2]);
    }
    if (kind != Reading::INERTIA) return;
    double rates[3] = {}, changes[3] = {};
    for (int axis = 0; is_new && axis < 3; axis++) {
        double turned = attitude[axis] - sensor.attitude[axis];
        if (fabs(turned) > M_PI) turned -= copysign(2 * M_PI, turned);
        rates[axis] = turned / elapsed;
        changes[axis] = (rates[axis] - sensor.rates[axis]) / elapsed;
        sensor.attitude[axis] = attitude[axis];
        sensor.rates[axis] = rates[axis];
    }
    out.add(rates, 3);
    out.add(changes, 3);
    out.add(attitude, 3);
}

// Return the angle of a link, rad.
inline double link_angle(const Link& link, double ticks) {
    double reach = link.speed * (ticks - link.from_tick) / TICKS_A_SECOND;
    return link.from_angle + maximum(-reach, minimum(reach, link.to_angle - link.from_angle));
}
inline double angle_of_link(Array<const Link> link, double ticks) { return link_angle(link[0], ticks); }
BIND(angle_of_link, "1")

struct SensorTables { // rows and robots are indexed by slot
    Array<const Job> jobs;
    Array<double, 2> rows; // column 0: whether random numbers are used up; then the states of the sensors
    Array<const Robot> robots;
    Array<const Odometry> odometry;
};
LAYOUT(SensorTables, "j sn r m", jobs, rows, robots, odometry)

// Do a job. Returns whether the random numbers of a sensor are used up.
inline bool take_reading(const Job& job, double* row, double ticks, const Robot& robot, const SensorTables& tables,
                         Numbers& out) {
    void* place = row + job.place;
    const double body[] = {robot.x, robot.y, robot.body_z, robot.roll, robot.pitch, robot.yaw};
    double time = ticks / TICKS_A_SECOND;
    switch (job.kind) {
    case Reading::TIME: out.add(time); break;
    case Reading::CHARGE: {
        const Charge& charge = *static_cast<Charge*>(place);
        double elapsed = (ticks - charge.spawn_tick) / TICKS_A_SECOND;
        out.add(maximum(trunc(maximum(0.0, charge.life - elapsed)), charge.least));
        break;
    }
    case Reading::TOUCHED: out.add(robot.touched); break;
    case Reading::BODY_POSE: out.add(body, 6); break;
    case Reading::HEADING: out.add(robot.yaw); break;
    case Reading::STEERING:
        out.add(robot.front_steer);
        out.add(robot.rear_steer);
        break;
    case Reading::ALTITUDES: {
        double height = robot.body_z - row[job.place]; // above the spawn
        out.add(height);
        out.add(maximum(0.0, height - SEA_LEVEL));
        break;
    }
    case Reading::MINUTES: out.add(floor((ticks - row[job.place]) / TICKS_A_MINUTE)); break; // since the spawn
    case Reading::WHEEL_POSE: {
        int64_t number = whole_of(row[job.place]);
        if (number < 0 || number >= tables.odometry.size()) break;
        out.add(&tables.odometry[number].x, 3);
        break;
    }
    case Reading::DRIFT: {
        Ins& ins = *static_cast<Ins*>(place);
        move_ins(ins, body);
        return ins.used >= DRAWN_AHEAD;
    }
    case Reading::INS_POSE: read_ins(*static_cast<Ins*>(place), body, out); break;
    case Reading::LEFT_SPEED: out.add(measure_speeds(*static_cast<Tachometer*>(place), time, robot).speeds[0]); break;
    case Reading::RIGHT_SPEED: out.add(measure_speeds(*static_cast<Tachometer*>(place), time, robot).speeds[1]); break;
    case Reading::LEFT_ANGLE: out.add(robot.left_angle - static_cast<Tachometer*>(place)->zero[0]); break;
    case Reading::RIGHT_ANGLE: out.add(robot.right_angle - static_cast<Tachometer*>(place)->zero[1]); break;
    case Reading::TICKS: {
        Encoder& encoder = *static_cast<Encoder*>(place);
        out.add(count_ticks(encoder, robot));
        return encoder.used >= DRAWN_AHEAD;
    }
    case Reading::ACCELERATION:
    case Reading::PROPER_ACCELERATION:
    case Reading::INERTIA: read_acceleration(*static_cast<Accelerometer*>(place), time, robot, job.kind, out); break;
    case Reading::LINK_ANGLE: out.add(link_angle(*static_cast<Link*>(place), ticks)); break;
    }
    return false;
}

// The number of bytes that a job uses in the row of its robot, by kind, for all kinds up to LINK_ANGLE.
constexpr size_t ONE = sizeof(double), DRIFT = sizeof(Ins), SPEEDS = sizeof(Tachometer);
constexpr size_t INERTIA = sizeof(Accelerometer);
constexpr size_t USED[] = {0, sizeof(Charge), 0, 0, 0, 0, ONE, ONE, ONE, DRIFT, DRIFT, SPEEDS, SPEEDS, SPEEDS, SPEEDS,
                           sizeof(Encoder), INERTIA, INERTIA, INERTIA, sizeof(Link)};

// Whether jobs and robots are in the tables, and the structures of sensors are inside the rows.
inline bool are_due(Array<const DueJobs> due, const SensorTables& tables) {
    int64_t robots = tables.robots.size(), columns = tables.rows.shape[1];
    if (tables.rows.shape[0] < robots) robots = tables.rows.shape[0];
    for (const DueJobs& each : due)
        if (each.slot < 0 || each.slot >= robots || each.first < 0 || each.end > tables.jobs.size()) return false;
    for (const Job& job : tables.jobs) {
        if (job.kind < Reading::TIME || job.kind > Reading::LINK_ANGLE) return false;
        if (job.place < 0 || job.place > columns - int64_t(USED[int64_t(job.kind)] / ONE)) return false;
    }
    return columns > 0 || !due.size();
}

// Do the due jobs of robots, one after the other. Returns the number of robots whose random numbers are used up; -1 if
// the length of out is wrong, or jobs or robots are not in the tables.
inline int64_t take_readings(Array<const DueJobs> due, const SensorTables& tables, double ticks, Array<double> out) {
    if (!are_due(due, tables)) return -1;
    Numbers numbers = {out, 0};
    int64_t used_up = 0;
    for (const DueJobs& each : due) {
        const Robot& robot = tables.robots[each.slot];
        double* row = &tables.rows(each.slot, 0);
        for (int64_t job = each.first; job < each.end; job++)
            if (take_reading(tables.jobs[job], row, ticks, robot, tables, numbers)) row[0] = 1.0;
        used_up += row[0] != 0.0;
    }
    return numbers.count == out.size() ? used_up : -1;
}
BIND(take_readings, "d o")

} // namespace radarsim
