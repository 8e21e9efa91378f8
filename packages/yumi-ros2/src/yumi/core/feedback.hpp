// The feedback check: whether the feedback of an arm can be true.
//
// That is decided by physics, not by the protocol, which does not prove it
// (docs/explanation/decisions/0014-feedback-is-doubted.md): have the joints' highest speeds led the arm there?

#pragma once

#include <optional>

#include "joints.hpp"

namespace core {

// [s] by what a joint moves meanwhile a measured position may be behind the planned one
constexpr double LONGEST = 0.1;

class FeedbackCheck {
public:
    static constexpr int DOUBTED = 5;  // implausible positions in a row, after which the arm holds
    static constexpr int LOST = 20;    // after so many the feedback is lost, as after 80 ms without a datagram

    // For joints of these limits, of an arm that moves at most at `speeds`, whatever our limits are: RAPID may have
    // moved it. Where the other arm was measured last is read from `other`, where that is known.
    FeedbackCheck(const JointLimits& limits, const Values& speeds) : limits_(limits), speeds_(speeds) {}

    int in_a_row = 0;              // states that no arm can have reached, since the last plausible one
    Values position{};             // the implausible position that came last
    bool is_other_arm = false;     // whether that is where the other arm is: their datagrams were exchanged
    const std::optional<Values>* other = nullptr;

    // Whether so many states in a row were implausible that the arm is not known to be anywhere.
    bool is_lost() const { return in_a_row >= LOST; }

    // Whether an arm can be there at the begin of a session, that was sent to the position `sent`. It may have been
    // moved to where the other one is since the last plausible state, but not in a doubt.
    bool is_start(const ArmState& state, const Values& sent) const {
        const bool is_inside = all_joints([&](int i) {
            return limits_.lower[i] - OUTSIDE <= state.position[i] && state.position[i] <= limits_.upper[i] + OUTSIDE;
        });
        const bool is_exchanged = in_a_row > 0 && is_of_other_arm(state);
        return is_inside && is_near_plan(state) && !is_exchanged && (!last_ || can_reach(*last_, state, sent, INF));
    }

    // Whether the arm can be where `state` says, and plan to be where it says, after the last plausible state. While
    // the robot may follow, it may have gone to the position `sent` last. In doubt a robot that follows can be on this
    // way only. An arm that does not, with its motors off, may have been moved by hand: then its time since the last
    // plausible state explains it.
    bool is_plausible(const ArmState& state, const Values& sent) const {
        if (!last_) return false;  // a session begins with a plausible state
        if (in_a_row && (is_of_other_arm(state) || !is_near_plan(state))) return false;
        // so nothing but what is sent has moved it
        const bool is_led = in_a_row && state.is_running && last_->is_running;
        return can_reach(*last_, state, sent, is_led ? FOLLOWED : INF);
    }

    // `state` is plausible; its velocity is corrected where it was that from or to a false position.
    ArmState accept(ArmState state) {
        if (in_a_row && last_) {
            const double passed = std::max(state.dt, state.time - last_->time);
            state.velocity = passed > 0.0 ? rate_of(state.position, last_->position, passed) : Values{};
        }
        in_a_row = 0;
        last_ = state;
        return state;
    }

    // `state` is implausible; the last plausible position in place of it, or itself before the first.
    ArmState reject(const ArmState& state) {
        ++in_a_row;
        position = state.position, is_other_arm = is_of_other_arm(state);
        ArmState last = last_ ? *last_ : state;
        last.time = state.time, last.dt = state.dt, last.session = state.session;
        return last;
    }

private:
    // [rad] out of its range a joint may stand: its first command is the end of the range, so near that the robot does
    // not jump there
    static constexpr double OUTSIDE = 0.01;
    // [s] a robot that follows is on the way to what was sent, or was by so much longer on the way before
    static constexpr double FOLLOWED = 2.0 * CYCLE;
    // [rad] over all joints: a position as near to the other arm's is the other's
    static constexpr double EXCHANGED = 0.5;
    // [rad] a measured position may differ by from what a joint's speed explains
    static constexpr double MARGIN = 0.02;

    // Whether a position is near where the other arm was measured, and nearer than to where this one was.
    bool is_of_other_arm(const ArmState& state) const {
        const double own = last_ ? distance(state.position, last_->position) : INF;
        return other && *other && distance(state.position, **other) < std::min(EXCHANGED, own);
    }

    // Whether the measured position is one that a servo has on the way to the planned one.
    bool is_near_plan(const ArmState& state) const {
        return all_joints([&](int i) {
            return std::abs(state.planned[i] - state.position[i]) <= speeds_[i] * LONGEST + MARGIN;
        });
    }

    // Whether the joints' speeds explain the way from `last`, or from there to `sent`, in the time between. The robot's
    // clock and ours may differ by what a network delays.
    bool can_reach(const ArmState& last, const ArmState& state, const Values& sent, double longest) const {
        const double time = std::min(std::max(state.dt, state.time - last.time), longest);
        auto is_reached = [&](const Values& before, const Values& after) {
            return all_joints([&](int i) {
                const double room = speeds_[i] * time + MARGIN;
                return std::min(before[i], sent[i]) - room <= after[i] && after[i] <= std::max(before[i], sent[i]) + room;
            });
        };
        return is_reached(last.position, state.position) && is_reached(last.planned, state.planned);
    }

    JointLimits limits_;
    Values speeds_;
    std::optional<ArmState> last_;  // the last plausible state
};

}  // namespace core
