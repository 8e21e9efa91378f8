// The feed-forward limiter: the next speed that is fed forward to one arm, within what its joints may do.

#pragma once

#include <optional>

#include "motion.hpp"

namespace core {

// Where a robot will report to be `later`: it is on the way to its plan.
inline Values reported(const ArmState& state, double later) {
    const double share = std::min(1.0, later / (SERVO_CYCLES * CYCLE));
    return added(state.position, share, added(state.planned, -1.0, state.position));
}

// The speeds fed forward to an arm so far, and how the arm moves by now.
struct FedForward {
    // What a robot was seen to make of the positions it was sent: the state replied to last, the position reference
    // that the robot had then, and the one before that.
    struct Seen {
        ArmState state;
        Values position{}, before{};
    };

    Values velocity{};           // sent last
    bool is_bounded = false;     // whether it is less than was desired
    // how the robot will move when it takes the last command; none where nothing is fed, and the speed is zero
    std::optional<Setpoint> robot;
    std::optional<Seen> seen;       // what a speed sets in upon; none before the first reply

    // After the reply to `state`, when the robot got this position reference.
    void observe(const ArmState& state, const Values& position) {
        const Values before = seen ? seen->position : position;
        seen = Seen{state, position, before};
    }
};

// A robot in EGM plans to move at k * (position reference - reported position) + speed reference, and uses a command a
// cycle after it was taken (reference/egm.md §6.1). Each of the two may be within the limits and their sum not: a
// position that runs ahead already asks for a speed. So the sum is what is kept within the joints' velocity,
// acceleration and jerk, and able to stop before the end of their ranges; a sum that is smooth passes unchanged.
// Nothing is kept here between two steps.
class FeedForwardLimiter {
public:
    // Of a robot whose position loop has this gain, 0 where it follows speeds only, and that sends a state each
    // `period`.
    FeedForwardLimiter(const JointLimits& limits, double gain, double period)
        : limits_(limits), gain_(gain), used_after_(period + CYCLE) {}

    // With the speed that may be fed forward next to `desired`, beside this position reference, which is limited
    // already. The last commands are not in the robot's state yet; `dt` has passed since the last one.
    FedForward step(const FedForward& fed, const ArmState& state, const Values& position, const Values& desired,
                    bool has_desired, double dt) const {
        if (!has_desired && !fed.robot) return fed;
        FedForward next;
        next.seen = fed.seen;
        Setpoint robot = fed.robot ? *fed.robot : begin(fed, state, dt);
        double predicted = used_after_;
        if (fed.seen) {
            const Values moved = added(state.planned, -1.0, fed.seen->state.planned);
            if (largest(added(moved, -dt, robot.velocity)) > UNEXPECTED) {
                predicted = 0.0;
                const FedForward resumed = resume(fed, state, fed.seen->position);
                if (resumed.robot) robot = *resumed.robot;
                next.seen = resumed.seen;
            }
        }
        Setpoint after;
        const Values then = reported(state, used_after_);
        double most_moved = largest(fed.velocity);
        for (int i = 0; i < JOINTS; ++i) {
            const double most = limits_.velocity[i], top = limits_.acceleration[i], jerk = limits_.jerk[i];
            const double place = state.planned[i] + robot.velocity[i] * predicted;  // the robot will plan to be by then
            const double lead = gain_ * (position[i] - then[i]);
            const double goal = lead + bounded(desired[i], most);
            const double room = goal > 0.0 ? limits_.upper[i] - place : place - limits_.lower[i];
            const double highest = std::min(most, speed_to_stop(room, top, jerk));
            const Ramp last{robot.velocity[i], robot.acceleration[i]};
            const Ramp total = ramp_speed(goal, last, highest, EXACT * top, jerk, dt);
            next.is_bounded = next.is_bounded || total.speed != goal;
            after.position[i] = place;
            after.velocity[i] = total.speed;
            after.acceleration[i] = total.rate;
            next.velocity[i] = total.speed - lead;
        }
        most_moved = std::max(most_moved, largest(next.velocity));
        if (!has_desired && !next.is_bounded && most_moved < REST)
            next.velocity = {};
        else
            next.robot = after;
        return next;
    }

    // Going on from the motion of a robot that repeated the last command, with this position reference, for a while.
    FedForward resume(const FedForward& fed, const ArmState& state, const Values& position) const {
        FedForward next = fed;
        if (fed.robot) {
            const Values speeds = added(led(position, reported(state, CYCLE)), 1.0, fed.velocity);
            next.robot = Setpoint{fed.robot->position, speeds, {}};
        } else if (fed.seen) {
            // A speed that sets in now must not take the way since the last known state for the motion of one cycle.
            next.seen = FedForward::Seen{state, position, position};
        }
        return next;
    }

    // Coming to the motion of a robot that does not follow the last commands, whose joints have these speeds: within
    // some cycles, as it may follow them all the same, and its reports be late.
    FedForward follow(const FedForward& fed, const Values& speeds, double dt) const {
        FedForward next = fed;
        if (!fed.robot) return next;
        const Values& old = fed.robot->velocity;
        next.robot = Setpoint{fed.robot->position, {}, {}};
        next.robot->velocity = values_of([&](int i) {
            const double most = CORRECTED * limits_.acceleration[i] * dt;
            return std::max(old[i] - most, std::min(old[i] + most, speeds[i]));
        });
        return next;
    }

    // The speed that keeps the robot from following a position reference.
    Values against(const ArmState& state, const Values& position) const {
        return added({}, -1.0, led(position, reported(state, used_after_)));
    }

private:
    static constexpr double CORRECTED = 1.5;  // times a joint's acceleration
    // of an acceleration: where the robot will report to be is not predicted better
    static constexpr double EXACT = 0.995;
    // [rad/s] slower than this, in two cycles one after the other, is no motion
    static constexpr double REST = 1e-6;
    static constexpr double UNEXPECTED = 0.02;  // [rad] of a plan, which the robot's own cap on speeds does not explain

    // The motion that the position references before made, upon which a speed sets in.
    Setpoint begin(const FedForward& fed, const ArmState& state, double dt) const {
        Setpoint robot;
        if (!fed.seen) return robot;
        robot.velocity = led(fed.seen->position, reported(state, CYCLE));
        const Values before = led(fed.seen->before, reported(fed.seen->state, CYCLE));
        robot.acceleration = values_of(
            [&](int i) { return bounded((robot.velocity[i] - before[i]) / dt, limits_.acceleration[i]); });
        return robot;
    }

    // How fast a robot that reports to be there sets out towards a position reference.
    Values led(const Values& position, const Values& from) const {
        return values_of([&](int i) { return gain_ * (position[i] - from[i]); });
    }

    JointLimits limits_;
    double gain_, used_after_;  // from a state to the use of its reply: a period and a robot's cycle
};

}  // namespace core
