// Seven joints of an arm: their values, what the robot reports of them and what it is sent. SI units, chain order.

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

namespace core {

constexpr int JOINTS = 7;
constexpr double INF = std::numeric_limits<double>::infinity();
constexpr double CYCLE = 0.004032;  // [s] of the robot's motion control; as in robot/joints.py
constexpr int SERVO_CYCLES = 4;     // a robot's report is so far behind its plan; as in control/motion/robot_response.py
constexpr double EGM_GAIN = 5.0;    // [1/s] of the robot's position loop; as in control/motion/robot_response.py

using Values = std::array<double, JOINTS>;

// The values that a function has of the joints' numbers.
template <typename Of>
Values values_of(Of of) {
    Values values;
    for (int i = 0; i < JOINTS; ++i) values[i] = of(i);
    return values;
}

// Whether something is so of all joints' numbers.
template <typename Is>
bool all_joints(Is is) {
    for (int i = 0; i < JOINTS; ++i)
        if (!is(i)) return false;
    return true;
}

inline Values added(const Values& a, double factor, const Values& b) {
    return values_of([&](int i) { return a[i] + factor * b[i]; });
}

inline Values rate_of(const Values& now, const Values& before, double dt) {
    return values_of([&](int i) { return (now[i] - before[i]) / dt; });
}

// A value that is at most so far from zero.
inline double bounded(double value, double most) { return std::max(-most, std::min(most, value)); }

inline double length(const Values& values) {
    double sum = 0.0;
    for (double each : values) sum += each * each;
    return std::sqrt(sum);
}

inline double distance(const Values& a, const Values& b) { return length(added(a, -1.0, b)); }

// By the joint that has most of it.
inline double largest(const Values& values) {
    double most = 0.0;
    for (double each : values) most = std::max(most, std::abs(each));
    return most;
}

inline double largest_difference(const Values& a, const Values& b) { return largest(added(a, -1.0, b)); }

// What the joints may do; as JointLimits in robot/joints.py.
struct JointLimits {
    Values lower, upper, velocity, acceleration, jerk;

    // The same joints, none faster than this share of its speed.
    JointLimits slower(double scale) const {
        JointLimits limits = *this;
        for (double& each : limits.velocity) each *= scale;
        return limits;
    }
    // Whether all joints are in range.
    bool contain(const Values& position) const {
        return all_joints([&](int i) { return lower[i] <= position[i] && position[i] <= upper[i]; });
    }
    // Cut at the range; joints that were outside `last` may come back but not go further.
    Values inside(const Values& position, const Values& last) const {
        return values_of([&](int i) {
            return std::max(std::min(lower[i], last[i]), std::min(std::max(upper[i], last[i]), position[i]));
        });
    }
};

// Where the joints are at one moment, and how they move.
struct Setpoint {
    Values position{}, velocity{}, acceleration{};

    bool operator==(const Setpoint& other) const {
        return position == other.position && velocity == other.velocity && acceleration == other.acceleration;
    }
};

// One arm as the robot reported it in one datagram; as ArmState in robot/joints.py.
struct ArmState {
    double time = 0.0, dt = 0.0;  // by our clock, and the robot's time since the state before
    std::int64_t session = 0;
    Values position{}, velocity{}, planned{};
    std::int64_t is_running = 0;
};

// The references in one datagram to an arm; a speed that is not fed forward is zero.
struct ArmCommand {
    Values position{}, velocity{};
    std::int64_t has_velocity = 0;

    bool operator==(const ArmCommand& other) const {
        return position == other.position && velocity == other.velocity;
    }
    bool is_finite() const {
        double sum = 0.0;
        for (int i = 0; i < JOINTS; ++i) sum += position[i] + velocity[i];
        return std::isfinite(sum);
    }
};

}  // namespace core
