// The limiter of each arm, and what both know of each other: what library.py declares for control/limiter.py,
// control/collisions.py and control/motion.py. No exception leaves, and nothing is allocated after the start.

#include "limiter.hpp"

using namespace core;

namespace {

// What crosses between an arm's limiter and Python; as Exchange in library.py.
struct Exchange {
    ArmState state;       // as the robot reports it; then as it was checked
    ArmCommand command;   // desired; then sent
    std::int64_t limiter_state = NO_SESSION;
    std::int64_t forbidden = -1;  // the event that the table forbids in this state
    std::int64_t is_implausible = 0, are_references_ignored = 0;  // why the arm holds whatever is desired
    std::int64_t is_at_rest = 1, must_settle = 0, is_other_arm = 0;
    Values implausible_position{};
    LimiterCounters counters;
};

}  // namespace

struct ArmLimiter {
    Exchange exchange;
    Limiter limiter;

    ArmLimiter(const Limiter::Settings& settings, const StateTable& table, ArmCollisionLimiter* collisions)
        : limiter(settings, table, collisions) {}

    // Act, and show what has become of the limiter; -1 where the table forbids that, and the result else.
    template <typename Act>
    std::int64_t act(Act action) {
        std::int64_t result = -1;
        try {
            result = action();
        } catch (const ForbiddenTransition& forbidden) {
            exchange.forbidden = forbidden.event;
        } catch (...) {  // no memory: nothing here allocates
        }
        const SentMotion& motion = limiter.motion();
        const FeedbackCheck& feedback = limiter.feedback();
        exchange.limiter_state = limiter.state();
        exchange.is_implausible = feedback.is_lost();
        exchange.are_references_ignored = limiter.are_references_ignored();
        exchange.is_at_rest = motion.is_at_rest;
        exchange.must_settle = motion.must_settle;
        exchange.is_other_arm = feedback.is_other_arm;
        exchange.implausible_position = feedback.position;
        exchange.counters = motion.counters;
        return result;
    }
};

// Both arms.
struct ArmsLimiter {
    ArmsApart both;
    ArmCollisionLimiter arms[2];

    explicit ArmsLimiter(const ArmsApart& its) : both(its), arms{{both, 0}, {both, 1}} {
        arms[0].other = &arms[1], arms[1].other = &arms[0];
    }
};

namespace {

const Setpoint* given(const double* values) { return reinterpret_cast<const Setpoint*>(values); }

Values values_at(const double* values) {
    Values copied;
    std::copy(values, values + JOINTS, copied.begin());
    return copied;
}

}  // namespace

extern "C" {

// ---- the limiter of an arm

ArmLimiter* limiter_new(const Limiter::Settings* settings, const StateTable* table, ArmsLimiter* both, std::int64_t arm) {
    try {
        return new ArmLimiter(*settings, *table, both ? &both->arms[arm] : nullptr);
    } catch (...) {  // no memory
        return nullptr;
    }
}

void limiter_delete(ArmLimiter* arm) { delete arm; }

Exchange* limiter_exchange(ArmLimiter* arm) { return &arm->exchange; }

// Each arm knows where the other was measured last.
void limiter_pair(ArmLimiter* arm, ArmLimiter* other) {
    arm->limiter.pair(other->limiter);
    other->limiter.pair(arm->limiter);
}

// Check the state: 0 where no reply is safe, 1 where it is as it was reported, 2 where something in it was replaced.
std::int64_t limiter_check(ArmLimiter* arm) {
    return arm->act([&]() -> std::int64_t {
        const ArmState reported = arm->exchange.state;
        if (!arm->limiter.check(arm->exchange.state)) return 0;
        return std::memcmp(&reported, &arm->exchange.state, sizeof reported) == 0 ? 1 : 2;
    });
}

// Limit the command for the state that was checked; without a desired one hold. Whether the position is the desired one.
std::int64_t limiter_limit(ArmLimiter* arm, bool has_desired) {
    return arm->act([&]() -> std::int64_t {
        const ArmCommand desired = arm->exchange.command;
        arm->exchange.command = arm->limiter.limit(arm->exchange.state, has_desired ? &desired : nullptr);
        return has_desired && arm->exchange.command.position == desired.position;
    });
}

// The command where no reply is safe.
std::int64_t limiter_repeat(ArmLimiter* arm) {
    return arm->act([&]() -> std::int64_t {
        arm->exchange.command = arm->limiter.repeat(arm->exchange.state);
        return 0;
    });
}

// After the reply to the state.
std::int64_t limiter_observe(ArmLimiter* arm) {
    return arm->act([&]() -> std::int64_t {
        arm->limiter.observe(arm->exchange.state);
        return 0;
    });
}

// No datagram arrives, which is the event.
std::int64_t limiter_lose(ArmLimiter* arm, std::int64_t event) {
    return arm->act([&]() -> std::int64_t {
        arm->limiter.lose(Event(event));
        return 0;
    });
}

// An event, for tests.
std::int64_t limiter_go(ArmLimiter* arm, std::int64_t event) {
    return arm->act([&]() -> std::int64_t {
        arm->limiter.go(Event(event));
        return 0;
    });
}

void limiter_scale_speed(ArmLimiter* arm, double scale) { arm->limiter.scale_speed(scale); }

// ---- both arms

ArmsLimiter* arms_new(collision::Limiter* limiter, std::int64_t distances, double gain) {
    try {
        return new ArmsLimiter({limiter, distances, gain});
    } catch (...) {  // no memory
        return nullptr;
    }
}

void arms_delete(ArmsLimiter* both) { delete both; }

// Other margins are kept from now on.
void arms_note_permission(ArmsLimiter* both) {
    ++both->both.permission;
    for (ArmCollisionLimiter& arm : both->arms) arm.forget_boundaries();
}

bool arms_begin_cycle(ArmsLimiter* both, std::int64_t arm, const ArmCommand* desired, const double* measured, double dt) {
    return both->arms[arm].begin_cycle(desired, values_at(measured), dt);
}

bool arms_accepts(ArmsLimiter* both, std::int64_t arm, const double* planned, const double* sent, const double* robot,
                  bool feeds_forward) {
    return both->arms[arm].accepts(values_at(planned), *given(sent), given(robot), feeds_forward);
}

void arms_note_sent(ArmsLimiter* both, std::int64_t arm, const double* planned, const double* sent, const double* robot) {
    both->arms[arm].note_sent(values_at(planned), *given(sent), given(robot));
}

bool arms_steer(ArmsLimiter* both, std::int64_t arm, ArmCommand* desired) { return both->arms[arm].steer(*desired); }

void arms_lose_connection(ArmsLimiter* both, std::int64_t arm) { both->arms[arm].lose_connection(); }

void arms_note_measured(ArmsLimiter* both, std::int64_t arm, const double* position) {
    both->arms[arm].note_measured(values_at(position));
}

// What limits an arm in this cycle; whether anything does.
bool arms_limited(const ArmsLimiter* both, std::int64_t arm, Limited* limited) {
    const std::optional<Limited>& found = both->arms[arm].limited;
    if (found) *limited = *found;
    return found.has_value();
}

// As many distances may be calculated for an arm in a cycle from now on.
void arms_limit_distances(ArmsLimiter* both, std::int64_t most) { both->both.distances = most; }

// Whether an arm is held since it came no nearer to where it is commanded.
bool arms_is_held(const ArmsLimiter* both, std::int64_t arm) { return both->arms[arm].is_held(); }

// How often paths of an arm were compared, for tests.
std::int64_t arms_decisions(const ArmsLimiter* both, std::int64_t arm) { return both->arms[arm].decisions; }

// How the command sent last moves an arm.
const collision::Motion* arms_motion(const ArmsLimiter* both, std::int64_t arm) { return &both->arms[arm].motion; }

// ---- motion

bool motion_step_towards(const JointLimits* limits, const Setpoint* now, const Setpoint* goal, double dt,
                         const bool* enabled, Setpoint* reached) {
    Flags flags;
    std::copy(enabled, enabled + JOINTS, flags.begin());
    return step_towards(*now, *goal, *limits, dt, flags, *reached);
}

void motion_step_to_rest(const JointLimits* limits, const Setpoint* now, double dt, const bool* enabled, Setpoint* after) {
    Flags flags;
    std::copy(enabled, enabled + JOINTS, flags.begin());
    *after = step_to_rest(*now, *limits, dt, flags);
}

void motion_braking_path(double velocity, double acceleration, double top, double jerk, BrakingPath* path) {
    *path = braking_path(velocity, acceleration, top, jerk);
}

}  // extern "C"
