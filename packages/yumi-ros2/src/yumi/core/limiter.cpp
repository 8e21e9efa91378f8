// The C interface of the limiters, both arms and the fallback thread, as library.py declares it for
// control/limiter.py, control/collisions.py, control/motion/joint_steps.py and driver/egm_arm.py.
// No exception leaves, and nothing is allocated after the start.

#include "limiter_handle.hpp"
#include "fallback_thread.hpp"

using namespace core;

extern "C" {

// ---- the limiter of an arm

LimiterHandle* limiter_new(const Limiter::Settings* settings, const StateTable* table, CollisionsHandle* both,
                           std::int64_t arm) {
    return made<LimiterHandle>(*settings, *table, both ? &both->arms[arm] : nullptr);
}

void limiter_delete(LimiterHandle* arm) { delete arm; }

void limiter_pair(LimiterHandle* arm, LimiterHandle* other) { arm->limiter.pair(other->limiter); }

// No datagram arrives, which is the event.
std::int64_t limiter_lose(LimiterHandle* arm, std::int64_t event) {
    return arm->act([&]() -> std::int64_t {
        arm->limiter.lose(Event(event));
        return 0;
    });
}

void limiter_scale_speed(LimiterHandle* arm, double scale) {
    const Guard guard(lock);
    arm->limiter.scale_speed(scale);
}

// ---- an arm of the control loop

// With the descriptor of its socket, -1 where Python reads and sends.
ArmHandle* arm_new(LimiterHandle* limiter, Session* session, std::int64_t socket) {
    return made<ArmHandle>(*limiter, *session, int(socket));
}

void arm_delete(ArmHandle* arm) { delete arm; }

std::int64_t arm_receive(ArmHandle* arm, double now) {
    return arm->act_for_python([&] { return arm->receive(now); });
}

std::int64_t arm_accept(ArmHandle* arm, const char* datagram, std::int64_t size, double now, bool is_first,
                        bool is_last) {
    return arm->act_for_python(
        [&] { return arm->accept(datagram, std::size_t(size), now, is_first, is_last); });
}

// What answers the next datagram while Python waits for it; null: Python does.
void arm_prepare(ArmHandle* arm, const Sampled* sampled) {
    const Guard guard(lock);
    arm->prepared = sampled ? std::optional<Sampled>(*sampled) : std::nullopt;
}

// 0 where the fallback thread has answered.
std::int64_t arm_reply(ArmHandle* arm, const ArmCommand* desired, bool sends) {
    return arm->act_for_python([&]() -> std::int64_t { return arm->reply(desired, sends); });
}

std::int64_t arm_settle(ArmHandle* arm) {
    return arm->act_for_python([&]() -> std::int64_t {
        arm->settle();
        return 0;
    });
}

// As BRAKED in library.py, MOST_BRAKED at most; how many.
std::int64_t arm_take_braked(ArmHandle* arm, BrakedCycle* cycles) {
    return arm->act_for_python([&] { return arm->take_braked(cycles); });
}

// ---- the thread that answers while Python does not

FallbackThread* fallback_thread_new() { return made<FallbackThread>(); }

// Before the thread begins.
void fallback_thread_add(FallbackThread* thread, ArmHandle* arm) { thread->add(*arm); }

bool fallback_thread_start(FallbackThread* thread) { return thread->start(); }

// Ends the thread, and waits for its end.
void fallback_thread_delete(FallbackThread* thread) { delete thread; }

// As FallbackThread::wait; the one function that is called without Python's lock.
std::int64_t fallback_thread_wait(FallbackThread* thread, std::int64_t other, std::int64_t milliseconds) {
    return thread->wait(int(other), int(milliseconds));
}

// ---- both arms

CollisionsHandle* arm_collisions_new(collision::Limiter* limiter, std::int64_t distances, double gain) {
    return made<CollisionsHandle>(SharedByArms{limiter, distances, gain});
}

void arm_collisions_delete(CollisionsHandle* both) { delete both; }

// As collisions_permit.
void arm_collisions_permit(CollisionsHandle* both, const double* margins) {
    const Guard guard(lock);
    collisions_permit(both->shared.limiter, margins);
    both->note_permission();
}

bool arm_collisions_accepts(CollisionsHandle* both, std::int64_t arm, const Values* planned, const Setpoint* sent,
                            const Setpoint* robot, bool feeds_forward) {
    const Guard guard(lock);
    both->arms[arm].begin_cycle(nullptr, {}, 0.0);
    return both->arms[arm].accepts(*planned, *sent, robot ? std::optional(*robot) : std::nullopt, feeds_forward);
}

void arm_collisions_note_sent(CollisionsHandle* both, std::int64_t arm, const Values* planned, const Setpoint* sent,
                              const Setpoint* robot) {
    const Guard guard(lock);
    both->arms[arm].note_sent(*planned, *sent, robot ? std::optional(*robot) : std::nullopt);
}

void arm_collisions_note_measured(CollisionsHandle* both, std::int64_t arm, const Values* position) {
    const Guard guard(lock);
    both->arms[arm].note_measured(*position);
}

// What limits an arm in this cycle; whether anything does.
bool arm_collisions_limited(const CollisionsHandle* both, std::int64_t arm, Limited* limited) {
    const Guard guard(lock);
    const std::optional<Limited>& found = both->arms[arm].limited;
    if (found) *limited = *found;
    return found.has_value();
}

// ---- what Python declares, too

// The sizes of what crosses, in the order of SIZES in library.py.
void core_sizes(std::int64_t* sizes) {
    for (std::size_t size : {sizeof(ArmState), sizeof(ArmCommand), sizeof(Limiter::Settings), sizeof(StateTable),
                             sizeof(LimiterExchange), sizeof(Limited), sizeof(collision::Motion), sizeof(Setpoint),
                             sizeof(JointLimits), sizeof(JointReport), sizeof(Unreadable), sizeof(SessionValues),
                             sizeof(ArmExchange), sizeof(BrakedCycle) * ArmHandle::MOST_BRAKED, sizeof(Sampled),
                             sizeof(SharedGoal)})
        *sizes++ = std::int64_t(size);
}

// ---- motion

bool motion_step_towards(const JointLimits* limits, const Setpoint* now, const Setpoint* goal, double dt,
                         const Flags* enabled, Setpoint* reached) {
    return step_towards(*now, *goal, *limits, dt, *enabled, *reached);
}

void motion_step_to_rest(const JointLimits* limits, const Setpoint* now, double dt, const Flags* enabled,
                         Setpoint* after) {
    *after = step_to_rest(*now, *limits, dt, *enabled);
}

void motion_ramp_speed(double goal, double last, double rate, double top, double acceleration, double jerk, double dt,
                       Ramp* ramp) {
    *ramp = ramp_speed(goal, {last, rate}, top, acceleration, jerk, dt);
}

double motion_speed_to_stop(double room, double acceleration, double jerk) {
    return speed_to_stop(room, acceleration, jerk);
}

// How far a joint gets backwards and forwards from where it is, and where it rests.
void motion_braking_path(double velocity, double acceleration, double top, double jerk, double* path) {
    const Braking braking(0.0, velocity, acceleration, top, jerk);
    path[0] = path[1] = 0.0, path[2] = braking.end();
    braking.extend(path[0], path[1]);
}

}  // extern "C"
