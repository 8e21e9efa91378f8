// The position limiter: the next position that one arm is sent, within what its joints may do.

#pragma once

#include "motion.hpp"

namespace core {

// The positions that an arm was sent so far, as far as the next one depends on them.
struct PositionMotion {
    Setpoint sent;           // the last one, with differences of positions, which a robot can make of them
    Setpoint goal;           // the position desired, with differences of its own
    double step_time = 0.0;  // of the last step
    // Of the joints whose last step was planned: how they move at its end, from which the plan goes on.
    Flags planned{};
    Values planned_velocity{}, planned_acceleration{};
    Flags chasing{};  // those of them that do not yet move as their goal does

    static PositionMotion resting_at(const Values& position) {
        PositionMotion motion;
        motion.sent.position = motion.goal.position = position;
        return motion;
    }

    // How the joints move `after` the middle of the last step: where only differences are known, they are of that time.
    Setpoint moving(double after) const {
        Setpoint now = sent;
        for (int i = 0; i < JOINTS; ++i) {
            now.velocity[i] = planned[i] ? planned_velocity[i] : sent.velocity[i] + after * sent.acceleration[i];
            if (planned[i]) now.acceleration[i] = planned_acceleration[i];
        }
        return now;
    }
    // The position sent last, with velocity and acceleration as they are at the end of its step.
    Setpoint moving() const { return moving(0.5 * step_time); }

    // Whether no joint has moved with the last step, nor with the one before it: one alone may be short because a joint
    // turns round, and to stop there would be a jerk.
    bool stands(double dt) const {
        constexpr double STANDS = 1e-6;  // [rad] a command that moves less in a cycle stands
        return length(sent.velocity) * dt < STANDS && length(sent.acceleration) * dt * dt < STANDS;
    }
};

// No joint exceeds its speed, acceleration or jerk, and none gets so fast that it could not stop before the end of its
// range. What is smooth enough passes unchanged; what is not is approached as fast as the limits allow. Nothing is kept
// here between two steps.
class PositionLimiter {
public:
    explicit PositionLimiter(const JointLimits& limits) : limits_(limits) {}

    // To `desired` itself, and true, if a step there is smooth enough; else to the next position towards it within the
    // limits. Each joint for itself: one whose own step is smooth enough takes it. A goal that moves is caught up with.
    // The joints may move for `dt`; `elapsed` has gone by since the position that was desired before, which is longer
    // than `dt` after a gap.
    bool step(const PositionMotion& motion, const Values& desired, double dt, double elapsed,
              PositionMotion& next) const {
        const Setpoint step = step_to(motion, desired, dt);
        Flags is_late;
        for (int i = 0; i < JOINTS; ++i) is_late[i] = !is_smooth(motion, i, step, dt);
        if (!has_any(is_late)) {
            next = PositionMotion{};
            next.sent = next.goal = step;
            next.step_time = dt;
            return true;
        }
        Setpoint goal, planned;
        const Setpoint moved_goal = motion_of_goal(motion, desired, dt, elapsed, goal);
        const Setpoint now = motion.moving(0.5 * dt);
        const bool is_found = step_towards(now, goal, limits_, dt, is_late, planned);
        if (!is_found) planned = goal;
        Flags must_brake{};
        for (int i = 0; i < JOINTS; ++i)
            must_brake[i] = is_late[i] && !(is_found && is_safe(i, planned.position[i], planned.velocity[i],
                                                                 planned.acceleration[i]));
        // A joint that is not late takes its step; braking is possible from any state that is safe.
        const Setpoint brake = has_any(must_brake) ? step_to_rest(now, limits_, dt, must_brake) : planned;
        PositionMotion result;
        Values position;
        for (int i = 0; i < JOINTS; ++i) {
            const Setpoint& source = must_brake[i] ? brake : is_late[i] ? planned : goal;
            position[i] = source.position[i];
            if (!is_late[i]) continue;
            result.planned[i] = true;
            result.planned_velocity[i] = source.velocity[i];
            result.planned_acceleration[i] = source.acceleration[i];
            // A joint has arrived when what is left of the way is less than half a step may change.
            const double change = 0.5 * limits_.jerk[i] * dt;
            result.chasing[i] = std::abs(position[i] - goal.position[i]) >= change * dt * dt ||
                                std::abs(source.velocity[i] - goal.velocity[i]) >= change * dt ||
                                std::abs(source.acceleration[i] - goal.acceleration[i]) >= change;
        }
        // The last resort, should the way to a target lead past the end of the range, or further away from it.
        result.sent = step_to(motion, limits_.inside(position, motion.sent.position), dt);
        result.goal = moved_goal;
        result.step_time = dt;
        next = result;
        return false;
    }

    // To the next position of joints that all brake as hard as they may, for `dt`.
    PositionMotion brake(const PositionMotion& motion, double dt) const {
        PositionMotion next;
        next.planned.fill(true);
        const Setpoint rest = step_to_rest(motion.moving(), limits_, dt, next.planned);
        next.sent = next.goal = step_to(motion, limits_.inside(rest.position, motion.sent.position), dt);
        next.step_time = dt;
        next.planned_velocity = rest.velocity;
        next.planned_acceleration = rest.acceleration;
        return next;
    }

    // Where the motion so far comes to rest that brakes as hard as it may, within the range.
    Values place_to_stop(const PositionMotion& motion) const {
        const Setpoint& sent = motion.sent;
        const Values ends = values_of([&](int i) {
            const double top = limits_.acceleration[i], jerk = limits_.jerk[i];
            return Braking(sent.position[i], sent.velocity[i], sent.acceleration[i], top, jerk).end();
        });
        return limits_.inside(ends, sent.position);
    }

private:
    // a command that uses a limit fully is not refused for its last digit
    static constexpr double ROUNDING = 1.0 + 1e-6;
    static constexpr double CLOSE = 1e-9;           // [rad] a joint may come to rest at the end of its range
    // a goal nearly as fast, or as strong, as the joint cannot be caught up with
    static constexpr double FOLLOWABLE = 0.96;

    // The step from the last position to this one: velocity and acceleration as differences.
    static Setpoint step_to(const PositionMotion& motion, const Values& position, double dt) {
        const Values velocity = rate_of(position, motion.sent.position, dt);
        return {position, velocity, rate_of(velocity, motion.sent.velocity, dt)};
    }

    // Whether a joint may take this step, and go on from there.
    bool is_smooth(const PositionMotion& motion, int i, const Setpoint& step, double dt) const {
        const double acceleration = step.acceleration[i];
        return !motion.chasing[i] && std::abs(step.velocity[i]) <= limits_.velocity[i] * ROUNDING &&
               std::abs(acceleration) <= limits_.acceleration[i] * ROUNDING &&
               std::abs(acceleration - motion.sent.acceleration[i]) <= limits_.jerk[i] * dt * ROUNDING &&
               is_safe(i, step.position[i], step.velocity[i] + 0.5 * acceleration * dt, acceleration);
    }

    // Whether a joint that moves like this can still keep its speed, and brake before the end of its range.
    bool is_safe(int i, double position, double velocity, double acceleration) const {
        const double top = limits_.acceleration[i], jerk = limits_.jerk[i];
        const double speed = std::abs(velocity), change = speed_to_come(acceleration, jerk);
        if (speed + (velocity * acceleration > 0.0 ? change : 0.0) > limits_.velocity[i] * ROUNDING) return false;
        // Nearly always it has more room than it could need, whatever its acceleration: see speed_to_stop.
        const double low = limits_.lower[i] - CLOSE, high = limits_.upper[i] + CLOSE, fastest = speed + change;
        if (0.5 * fastest * (fastest / top + 3.0 * top / jerk) < std::min(position - low, high - position)) return true;
        double lowest = 0.0, highest = 0.0;
        Braking(0.0, velocity, acceleration, top, jerk).extend(lowest, highest);
        return (lowest == 0.0 || position + lowest >= low) && (highest == 0.0 || position + highest <= high);
    }

    // The goals at the end of the step, with their motion, and in `goal` with that of it which a joint can make use of.
    // A goal that cannot be followed counts as resting; one whose last two steps contradict each other has no
    // acceleration: that is noise, a stream with uneven steps, or a jump.
    Setpoint motion_of_goal(const PositionMotion& motion, const Values& desired, double dt, double elapsed,
                            Setpoint& goal) const {
        const Setpoint& last = motion.goal;
        const Values velocity = rate_of(desired, last.position, elapsed);
        const Values acceleration = rate_of(velocity, last.velocity, elapsed);
        goal = {desired, {}, {}};
        for (int i = 0; i < JOINTS; ++i) {
            const double speed = velocity[i], rate = acceleration[i];
            const double top = limits_.acceleration[i], jerk = limits_.jerk[i];
            const double most = FOLLOWABLE * limits_.velocity[i];
            // A jump is no motion. Towards the end of its range a joint must still be able to brake after its goal, as
            // its jerk and the length of a step allow.
            const double end = speed > 0.0 ? limits_.upper[i] : limits_.lower[i];
            const double room = (end - last.position[i]) * std::copysign(1.0, speed);
            const double path = std::abs(speed) * (std::abs(speed) / top + 2.0 * top / jerk + 2.0 * dt);
            if (std::abs(speed) > most || path >= room) continue;
            goal.velocity[i] = speed;
            if (std::abs(rate) <= FOLLOWABLE * top && std::abs(rate - last.acceleration[i]) <= jerk * elapsed) {
                goal.velocity[i] = std::max(-most, std::min(most, speed + 0.5 * rate * dt));
                goal.acceleration[i] = rate;
            }
        }
        return {desired, velocity, acceleration};
    }

    JointLimits limits_;
};

}  // namespace core
