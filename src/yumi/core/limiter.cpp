// The limiters of both arms, with the state that they share, as library.py declares them for control/limiter.py,
// control/collisions.py and control/motion.py. No exception leaves, and nothing is allocated after the start.

#include "limiter_handle.hpp"
#include "fallback_thread.hpp"

using namespace core;

// Both arms.
struct CollisionsHandle {
    SharedByArms shared;
    ArmCollisionLimiter arms[2];

    explicit CollisionsHandle(const SharedByArms& settings) : shared(settings), arms{{shared, 0}, {shared, 1}} {
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

LimiterHandle* limiter_new(const Limiter::Settings* settings, const StateTable* table, CollisionsHandle* both,
                           std::int64_t arm) {
    try {
        return new LimiterHandle(*settings, *table, both ? &both->arms[arm] : nullptr);
    } catch (...) {  // no memory
        return nullptr;
    }
}

void limiter_delete(LimiterHandle* arm) { delete arm; }

LimiterExchange* limiter_exchange(LimiterHandle* arm) { return &arm->exchange; }

// Each arm knows where the other was measured last.
void limiter_pair(LimiterHandle* arm, LimiterHandle* other) {
    arm->limiter.pair(other->limiter);
    other->limiter.pair(arm->limiter);
}

// Check a state: 0 where no reply is safe, 1 where the state is as it was reported, 2 where
// something in it was replaced.
std::int64_t limiter_check(LimiterHandle* arm, const ArmState* state) {
    return arm->act([&]() -> std::int64_t {
        if (!arm->check(*state)) return 0;
        return std::memcmp(state, &arm->exchange.state, sizeof *state) == 0 ? 1 : 2;
    });
}

// Limit the command for the state that was checked; without a desired one hold.
std::int64_t limiter_limit(LimiterHandle* arm, const ArmCommand* desired) {
    return arm->act([&]() -> std::int64_t {
        arm->limit(desired, false);
        return 0;
    });
}

// The command where no reply is safe.
std::int64_t limiter_repeat(LimiterHandle* arm) {
    return arm->act([&]() -> std::int64_t {
        arm->exchange.command = arm->limiter.repeat(arm->exchange.state);
        return 0;
    });
}

// After the reply to a state; null: to the one that was checked.
std::int64_t limiter_observe(LimiterHandle* arm, const ArmState* state) {
    return arm->act([&]() -> std::int64_t {
        if (state) arm->exchange.state = *state;
        arm->observe();
        return 0;
    });
}

// No datagram arrives, which is the event.
std::int64_t limiter_lose(LimiterHandle* arm, std::int64_t event) {
    return arm->act([&]() -> std::int64_t {
        arm->limiter.lose(Event(event));
        return 0;
    });
}

// An event, for tests.
std::int64_t limiter_go(LimiterHandle* arm, std::int64_t event) {
    return arm->act([&]() -> std::int64_t {
        arm->limiter.go(Event(event));
        return 0;
    });
}

void limiter_scale_speed(LimiterHandle* arm, double scale) {
    const Guard guard(lock);
    arm->limiter.scale_speed(scale);
}

// ---- an arm of the control loop

// With the descriptor of its socket, -1 where Python reads and sends.
ArmHandle* arm_new(LimiterHandle* limiter, SessionHandle* session, std::int64_t socket) {
    try {
        return new ArmHandle(*limiter, *session, int(socket));
    } catch (...) {  // no memory
        return nullptr;
    }
}

void arm_delete(ArmHandle* arm) { delete arm; }

std::int64_t arm_receive(ArmHandle* arm, double now) {
    return arm->limiter.act_for_python([&] { return arm->receive(now); });
}

std::int64_t arm_accept(ArmHandle* arm, const char* datagram, std::int64_t size, double now, bool is_first, bool is_last) {
    return arm->limiter.act_for_python(
        [&] { return arm->accept(datagram, std::size_t(size), now, is_first, is_last); });
}

// 0 where the fallback thread has answered.
std::int64_t arm_reply(ArmHandle* arm, const ArmCommand* desired, bool sends) {
    return arm->limiter.act_for_python([&]() -> std::int64_t { return arm->reply(desired, sends); });
}

std::int64_t arm_settle(ArmHandle* arm) {
    return arm->limiter.act_for_python([&]() -> std::int64_t {
        arm->settle();
        return 0;
    });
}

// As BRAKED in library.py, MOST_BRAKED at most; how many.
std::int64_t arm_take_braked(ArmHandle* arm, BrakedCycle* cycles) {
    return arm->limiter.act_for_python([&] { return arm->take_braked(cycles); });
}

// ---- the thread that answers while Python does not

FallbackThread* fallback_thread_new() {
    try {
        return new FallbackThread();
    } catch (...) {  // no memory, no thread or no descriptor
        return nullptr;
    }
}

// Before the thread begins.
void fallback_thread_add(FallbackThread* thread, ArmHandle* arm) { thread->add(*arm); }

bool fallback_thread_start(FallbackThread* thread) { return thread->start(); }

// Ends the thread, and waits for its end.
void fallback_thread_delete(FallbackThread* thread) { delete thread; }

void fallback_thread_note_busy(FallbackThread* thread) { thread->note_busy(); }

void fallback_thread_note_waiting(FallbackThread* thread) { thread->note_waiting(); }

// ---- both arms

CollisionsHandle* arm_collisions_new(collision::Limiter* limiter, std::int64_t distances, double gain) {
    try {
        return new CollisionsHandle({limiter, distances, gain});
    } catch (...) {  // no memory
        return nullptr;
    }
}

void arm_collisions_delete(CollisionsHandle* both) { delete both; }

// Other margins are kept from now on.
void arm_collisions_note_permission(CollisionsHandle* both) {
    const Guard guard(lock);
    ++both->shared.permission;
    for (ArmCollisionLimiter& arm : both->arms) arm.forget_boundaries();
}

bool arm_collisions_begin_cycle(CollisionsHandle* both, std::int64_t arm, const ArmCommand* desired,
                                const double* measured, double dt) {
    const Guard guard(lock);
    return both->arms[arm].begin_cycle(desired, values_at(measured), dt);
}

bool arm_collisions_accepts(CollisionsHandle* both, std::int64_t arm, const double* planned, const double* sent,
                            const double* robot, bool feeds_forward) {
    const Guard guard(lock);
    return both->arms[arm].accepts(values_at(planned), *given(sent), given(robot), feeds_forward);
}

void arm_collisions_note_sent(CollisionsHandle* both, std::int64_t arm, const double* planned, const double* sent,
                              const double* robot) {
    const Guard guard(lock);
    both->arms[arm].note_sent(values_at(planned), *given(sent), given(robot));
}

bool arm_collisions_steer(CollisionsHandle* both, std::int64_t arm, ArmCommand* desired) {
    const Guard guard(lock);
    return both->arms[arm].steer(*desired);
}

void arm_collisions_lose_connection(CollisionsHandle* both, std::int64_t arm) {
    const Guard guard(lock);
    both->arms[arm].lose_connection();
}

void arm_collisions_note_measured(CollisionsHandle* both, std::int64_t arm, const double* position) {
    const Guard guard(lock);
    both->arms[arm].note_measured(values_at(position));
}

// What limits an arm in this cycle; whether anything does.
bool arm_collisions_limited(const CollisionsHandle* both, std::int64_t arm, Limited* limited) {
    const Guard guard(lock);
    const std::optional<Limited>& found = both->arms[arm].limited;
    if (found) *limited = *found;
    return found.has_value();
}

// As many distances may be calculated for an arm in a cycle from now on.
void arm_collisions_limit_distances(CollisionsHandle* both, std::int64_t most) {
    const Guard guard(lock);
    both->shared.distances = most;
}

// Whether an arm is held since it came no nearer to where it is commanded.
bool arm_collisions_is_held(const CollisionsHandle* both, std::int64_t arm) {
    const Guard guard(lock);
    return both->arms[arm].is_held();
}

// How often paths of an arm were compared, for tests.
std::int64_t arm_collisions_decisions(const CollisionsHandle* both, std::int64_t arm) {
    const Guard guard(lock);
    return both->arms[arm].decisions;
}

// How the command sent last moves an arm.
const collision::Motion* arm_collisions_motion(const CollisionsHandle* both, std::int64_t arm) {
    const Guard guard(lock);
    return &both->arms[arm].motion;
}

// ---- what Python declares, too

// The sizes of what crosses, in the order of SIZES in library.py.
void core_sizes(std::int64_t* sizes) {
    for (std::size_t size : {sizeof(ArmState), sizeof(ArmCommand), sizeof(Limiter::Settings), sizeof(StateTable),
                             sizeof(LimiterExchange), sizeof(Limited), sizeof(collision::Motion), sizeof(Setpoint),
                             sizeof(JointLimits), sizeof(JointReport), sizeof(Unreadable), sizeof(SessionValues),
                             sizeof(ArmExchange), sizeof(BrakedCycle) * ArmHandle::MOST_BRAKED})
        *sizes++ = std::int64_t(size);
}

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

void motion_ramp_speed(double goal, double last, double rate, double top, double acceleration, double jerk, double dt,
                       Ramp* ramp) {
    *ramp = ramp_speed(goal, {last, rate}, top, acceleration, jerk, dt);
}

double motion_speed_to_stop(double room, double acceleration, double jerk) {
    return speed_to_stop(room, acceleration, jerk);
}

void motion_braking_path(double velocity, double acceleration, double top, double jerk, BrakingPath* path) {
    *path = braking_path(velocity, acceleration, top, jerk);
}

}  // extern "C"
