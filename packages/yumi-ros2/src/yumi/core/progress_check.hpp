// The progress check: an arm that is limited and comes no nearer to where it is commanded is held.
//
// Two arms that are pushed at each other each slide along a boundary that the other one moves, for ever. So an arm that
// is limited has to come nearer in joint space, or it holds until it is commanded something else, or what limits it has
// changed. If the other arm is limited itself, it has to move twice as far each time that trying again was of no use;
// so both come to rest.

#pragma once

#include <optional>

#include "joints.hpp"

namespace core {

// The parts that must not come nearer to each other, by their numbers in the model, and how near they are [m].
struct Limited {
    std::int64_t part = -1, other = -1;
    std::int64_t is_stale = 0;  // whether the other arm is neither heard nor was read since
    double distance = 0.0;
};

// What an arm is limited by, besides what stands still.
struct Surroundings {
    std::optional<Values> position;  // that the other arm is sent to; none of one that is unknown
    // Whether the other arm is heard, was read from the controller, and may not have come to where it was sent.
    bool is_heard = false, is_read = false, coasts = false;
    std::int64_t permission = 0;  // which margins are kept
    bool is_limited = false;      // whether the other arm is limited itself
};

class ProgressCheck {
public:
    std::optional<Limited> limited;  // what limits an arm that is held

    // Whether it has been limited since it came nearer to where it is commanded.
    bool is_limited() const { return limited_for_ > 0.0 || held_by_; }

    // Whether the arm is to hold whatever is desired; in every cycle. `measured` is where it is, `sent` the position it
    // was sent last, `dt` the time since the cycle before, `by` what limited it in that cycle, unless it was too fast
    // to be led along a boundary.
    bool holds(const ArmCommand* desired, const Values& measured, const Values& sent, double dt,
               const std::optional<Limited>& by, const Surroundings& now) {
        const double far = desired ? distance(desired->position, sent) : INF;
        if (!desired || !is_same(*desired, measured)) {
            begin(desired, measured, far);
            return false;
        }
        if (held_by_) {
            if (!have_changed(*held_by_, now)) return true;
            held_by_.reset(), limited.reset();
            limited_for_ = 0.0;
            return false;
        }
        if (far < nearest_ - std::min(NEARER, NEARER_SHARE * nearest_)) {
            begin(desired, measured, far);
        } else if (by) {
            limited_for_ += dt;
            if (limited_for_ > LIMITED_FOR) {
                held_by_ = now, limited = by;
                desired_ = *desired, measured_ = measured;
            }
        }
        return held_by_.has_value();
    }

private:
    // [s] an arm may be limited without getting nearer to where it is commanded
    static constexpr double LIMITED_FOR = 0.15;
    static constexpr double NEARER = 1e-3;        // [rad] by less it is no nearer
    static constexpr double NEARER_SHARE = 0.1;   // nor by less than this share of what is left
    static constexpr double SAME = 5e-4;          // [rad] a position desired that changes by less is the same
    // a proportional controller's changes with the arm itself, by a share less
    static constexpr double OWN = 0.5;
    static constexpr double SAME_SPEED = 1e-2;    // [rad/s]
    // [rad] when the other arm has moved by this, an arm that is held tries again
    static constexpr double ELSEWHERE = 0.02;

    void begin(const ArmCommand* desired, const Values& measured, double far) {
        desired_ = desired ? std::optional<ArmCommand>(*desired) : std::nullopt;
        measured_ = measured, nearest_ = far;
        held_by_.reset(), limited.reset();
        limited_for_ = 0.0, elsewhere_ = ELSEWHERE;
    }

    // Whether what holds the arm has changed by so much that it tries again.
    bool have_changed(const Surroundings& before, const Surroundings& now) {
        if (before.is_heard != now.is_heard || before.is_read != now.is_read || before.coasts != now.coasts ||
            before.permission != now.permission) {
            elsewhere_ = ELSEWHERE;
            return true;
        }
        if (!before.position || !now.position) return before.position.has_value() != now.position.has_value();
        if (*before.position == *now.position) return false;
        if (!now.is_limited) elsewhere_ = ELSEWHERE;  // it goes where it wants to: it is not pushed away by this one
        if (distance(*before.position, *now.position) <= elsewhere_) return false;
        elsewhere_ *= 2.0;
        return true;
    }

    // Whether the arm is commanded the same as before, but for noise and for what its own motion makes of it.
    bool is_same(const ArmCommand& desired, const Values& measured) const {
        if (!desired_) return false;
        const double moved = distance(measured, measured_);
        return distance(desired.velocity, desired_->velocity) <= SAME_SPEED &&
               distance(desired.position, desired_->position) <= SAME + OWN * moved;
    }

    std::optional<Surroundings> held_by_;  // as they were when it was held
    std::optional<ArmCommand> desired_;
    Values measured_{};           // where it was when it was commanded that
    double nearest_ = INF;        // [rad] how near it was sent to the position desired since
    double limited_for_ = 0.0;    // [s] without getting nearer than that
    double elsewhere_ = ELSEWHERE;
};

}  // namespace core
