// Jerk-limited motion of joints, one step at a time; whole motions of a joint that brakes in closed form.
//
// Steps are planned by Ruckig, whose headers and library come with its wheel.

#pragma once

#include <ruckig/ruckig.hpp>

#include "braking.hpp"

namespace core {

using Flags = std::array<bool, JOINTS>;

inline bool has_any(const Flags& flags) {
    return std::any_of(flags.begin(), flags.end(), [](bool flag) { return flag; });
}

// By how much a joint's speed still changes while its acceleration is taken back to zero, at least 0.
inline double speed_to_come(double acceleration, double jerk) { return acceleration * acceleration / (2.0 * jerk); }

// How fast a joint may be that has `room` to stop in: the inverse of the way it needs at most, v/2 * (v/a + 3a/j),
// since its acceleration may have to be turned round first.
inline double speed_to_stop(double room, double acceleration, double jerk) {
    if (room <= 0.0) return 0.0;
    const double slow = 3.0 * acceleration / jerk;
    return 0.5 * acceleration * (std::sqrt(slow * slow + 8.0 * room / acceleration) - slow);
}

// A speed, and its rate of change.
struct Ramp {
    double speed, rate;
};

// The next speed after `dt` on the way from `last` to `goal`: see ramp_speed in joint_steps.py.
inline Ramp ramp_speed(double goal, const Ramp& last, double top, double acceleration, double jerk, double dt) {
    // a speed at a limit is not refused for the last digits of the planned position
    constexpr double ROUNDING = 1.0 + 1e-3;
    double change = (goal - last.speed) / dt;
    const double rises = goal * change > 0.0 ? speed_to_come(change, jerk) : 0.0;
    if (std::abs(goal) + rises <= top * ROUNDING && std::abs(change) <= acceleration * ROUNDING &&
        std::abs(change - last.rate) <= jerk * dt * ROUNDING &&
        (goal != 0.0 || std::abs(change) <= jerk * dt))  // at rest the change of speed has to end, too
        return {goal, change};
    if (std::isnan(goal)) goal = 0.0;
    const double missing = bounded(goal, top) - last.speed, half = 0.5 * jerk * dt;
    // As hard as it can still be taken back, at the jerk, when the speed is reached.
    const double ease = std::sqrt(2.0 * jerk * std::abs(missing) + half * half) - half;
    const double aim = std::copysign(std::min({acceleration, ease, std::abs(missing) / dt}), missing);
    change = std::max(last.rate - jerk * dt, std::min(last.rate + jerk * dt, aim));
    return {last.speed + change * dt, change};
}

// Where the joints are after `dt` of a plan; false if none was found.
inline bool plan_step(const ruckig::InputParameter<JOINTS>& plan, double dt, Setpoint& after) {
    ruckig::Ruckig<JOINTS> generator;  // a new one for each plan keeps no state between plans
    ruckig::Trajectory<JOINTS> planned;
    const ruckig::Result result = generator.calculate(plan, planned);
    if (result != ruckig::Result::Working && result != ruckig::Result::Finished) return false;
    planned.at_time(dt, after.position, after.velocity, after.acceleration);
    return true;
}

// Where the `enabled` joints are after `dt` on their quickest ways to their goals; false if none was found.
//
// Each joint moves for itself. Ruckig plans to a goal at rest; so the way is planned as seen from an observer that
// moves with the goal, at constant acceleration, and the joint's limits are shifted by the goal's motion. A goal that
// moves is thereby caught up with and followed without lag, which a goal at rest in every cycle would not give. The
// goals are those at the end of the step, slower and weaker than the limits.
inline bool step_towards(const Setpoint& now, const Setpoint& goal, const JointLimits& limits, double dt,
                         const Flags& enabled, Setpoint& reached) {
    ruckig::InputParameter<JOINTS> plan;
    plan.synchronization = ruckig::Synchronization::None;
    plan.enabled = enabled;
    plan.target_position = Values{};
    plan.min_velocity = Values{};
    plan.min_acceleration = Values{};
    for (int i = 0; i < JOINTS; ++i) {
        const double speed = goal.velocity[i], rate = goal.acceleration[i];
        plan.current_position[i] = now.position[i] - (goal.position[i] - dt * (speed - 0.5 * dt * rate));
        plan.current_velocity[i] = now.velocity[i] - (speed - dt * rate);
        plan.current_acceleration[i] = now.acceleration[i] - rate;
        plan.max_velocity[i] = limits.velocity[i] - speed;
        (*plan.min_velocity)[i] = -limits.velocity[i] - speed;
        plan.max_acceleration[i] = limits.acceleration[i] - rate;
        (*plan.min_acceleration)[i] = -limits.acceleration[i] - rate;
    }
    plan.max_jerk = limits.jerk;
    Setpoint ahead;
    if (!plan_step(plan, dt, ahead)) return false;
    reached = {added(goal.position, 1.0, ahead.position), added(goal.velocity, 1.0, ahead.velocity),
               added(goal.acceleration, 1.0, ahead.acceleration)};
    return true;
}

// Where the `enabled` joints are after `dt` of braking as hard as they may.
inline Setpoint step_to_rest(const Setpoint& now, const JointLimits& limits, double dt, const Flags& enabled) {
    ruckig::InputParameter<JOINTS> plan;
    plan.control_interface = ruckig::ControlInterface::Velocity;
    plan.synchronization = ruckig::Synchronization::None;  // a joint that needs longer does not make others wait
    plan.enabled = enabled;
    plan.current_position = now.position;
    plan.current_velocity = now.velocity;
    plan.current_acceleration = now.acceleration;
    plan.target_position = Values{};
    plan.max_velocity = limits.velocity;
    plan.max_acceleration = limits.acceleration;
    plan.max_jerk = limits.jerk;
    Setpoint after;
    if (plan_step(plan, dt, after)) return after;
    // Without a plan: at the highest acceleration, whatever the jerk.
    for (int i = 0; i < JOINTS; ++i) {
        const double speed = std::max(0.0, std::abs(now.velocity[i]) - limits.acceleration[i] * dt);
        after.velocity[i] = std::copysign(speed, now.velocity[i]);
        after.position[i] = now.position[i] + 0.5 * (now.velocity[i] + after.velocity[i]) * dt;
    }
    return after;
}

}  // namespace core
