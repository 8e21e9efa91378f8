// The reference monitor: which of our references a robot follows; often a firewall drops our outgoing datagrams.
//
// The robot's plan shows that, whatever the protocol claims (docs/explanation/decisions/0014-feedback-is-doubted.md,
// docs/explanation/decisions/0049-lost-commands-wait.md): it is the integral of speeds that our references make
// (reference/egm.md §6.1). How it has moved shows which command moved it, and whether it moves at all although it is
// led.

#pragma once

#include <optional>

#include "feedback.hpp"

namespace core {

class ReferenceMonitor {
public:
    // Of a robot whose position loop has this gain, whose joints do not exceed these speeds under EGM, which sends a
    // state each `period`, and filters its speed with this bandwidth [Hz], 0 for none.
    ReferenceMonitor(double gain, const Values& fastest, double period, double bandwidth)
        : gain_(gain), fastest_(fastest), period_(period), bandwidth_(bandwidth) {}

    bool are_ignored = false;  // whether the plan stood still although references led it, and has not moved since

    // The command that moves the robot, as its plan shows; the oldest of those that are alike.
    const ArmCommand& followed() const { return commands_[0]; }

    // Whether the robot goes on by one command although it was sent others since.
    bool is_repeating() const { return repeated_ >= LOST_AFTER - 1 + latency_; }

    // Compare from here on, as nothing is known.
    void begin(const ArmState& state) {
        are_ignored = false;
        compare_from(state);
        forget_commands();
    }
    // Which command moves the robot is not known any more: its positions could not be believed for a while.
    void forget_commands() {
        commands_[0] = sent_;
        count_ = 1, furthest_ = 0, repeated_ = 0;
    }
    // A session begins with this command.
    void begin(const ArmState& state, const ArmCommand& sent) {
        sent_ = sent;
        begin(state);
    }

    // With each state, before its reply: which of the commands so far has moved the plan to where it is now. None where
    // what the robot reports is not plausible, or it does not follow.
    void compare(const ArmState* state) {
        const std::optional<ArmState> last = seen_;
        seen_ = state ? std::optional<ArmState>(*state) : std::nullopt;
        const bool has_moved = state && last && state->dt > 0.0;
        const Values shown = has_moved ? rate_of(state->planned, last->planned, state->dt) : Values{};
        if (!has_moved || count_ == 1 || last->session != state->session) {
            doubt();
            if (has_moved) moved_ = shown;
            return;
        }
        const Values moved = unfiltered(shown, state->dt);
        if (share_of_fastest(speeds(*last, commands_[0])) > 1.0) return;  // as slowed as all that follow: they look alike
        double differences[REMEMBERED], closest = INF;
        for (int i = 0; i < count_; ++i) {
            differences[i] = distance(slowed(speeds(*last, commands_[i])), moved);
            closest = i ? std::min(closest, differences[i]) : differences[i];
        }
        // false feedback, or a robot that moves otherwise
        if (!(closest <= EXPLAINED + EXPLAINED_SHARE * length(moved))) {
            doubt();
            return;
        }
        int first = -1, newest = 0, alike = 0;
        for (int i = 0; i < count_; ++i) {
            if (!(differences[i] <= closest + SAME_SPEED)) continue;
            if (first < 0) first = i;
            newest = i, ++alike;
        }
        const int further = newest - furthest_;
        if (further > 0) {
            if (further <= NEXT && !is_repeating()) {  // the robot goes on along the commands, however late
                const double late = std::min(count_ - 1 - newest, LATEST);
                latency_ = std::max({late, latency_ - FORGETTING, 1.0});
            }
            furthest_ = newest, repeated_ = 0;
        } else {  // also where the plan looks again as an older command made it
            repeated_ = furthest_ < count_ - 1 ? repeated_ + 1 : 0;
        }
        // Where a motion turns round, commands before and after are alike; where all are, it is slow or at rest.
        const bool are_all = alike == count_;
        forget(are_all ? 1 : 0, are_all ? count_ - 1 : first);
    }

    // Whether the robot misses commands that change a joint's speed by more than `changes`.
    bool are_lost(const Values& changes) const {
        if (!is_repeating()) return false;
        const ArmCommand &old = commands_[0], &newest = commands_[count_ - 1];
        return !all_joints([&](int i) {
            const double change = gain_ * (newest.position[i] - old.position[i]) + newest.velocity[i] - old.velocity[i];
            return !(std::abs(change) > changes[i]);
        });
    }

    // After the reply `sent` to `state`; the robot's plan does not show it yet, but the one before. A state is valid
    // where the robot follows, and it is plausible; a command is at rest that leads nowhere, and waits since newer ones
    // than that which moves the robot were lost.
    void observe(const ArmState& state, const ArmCommand& sent, bool is_valid, bool is_at_rest, bool is_waiting) {
        const ArmCommand before = sent_;
        sent_ = sent, last_ = state;
        acting_[0] = acting_[1], acting_[1] = before;
        if (!(sent == commands_[count_ - 1])) {
            if (count_ == REMEMBERED) forget(1, 2);
            commands_[count_++] = sent;
        }
        if (!is_valid || (is_at_rest && !are_ignored)) return compare_from(state);
        if (are_ignored) {
            if (distance(state.planned, plan_) > MOTION) begin(state);
            return;
        }
        const double dt = std::min(state.dt, LONGEST);
        due_ = added(due_, dt, speeds(state, before));
        due_for_ += dt;
        if (due_for_ < IGNORED_AFTER) return;
        const double due = length(due_), moved = distance(state.planned, plan_);
        // A command that waits may lead nowhere; then a plan that stands shows it.
        const bool stands = is_waiting && repeated_ * dt >= IGNORED_AFTER && moved < MOTION;
        are_ignored = stands || (due >= DUE && moved < FOLLOWED * due);
        if (!are_ignored) compare_from(state);
    }

    // Whether there was a reply; then `state` gets the positions of a robot that followed what it was sent until then.
    // The replies before the last one move the robot at first.
    bool expect(ArmState& state) const {
        if (!last_) return false;
        ArmState robot = *last_;
        double left = std::min(state.time - last_->time, LONGEST);
        for (int i = 0; left > 1e-9; ++i) {
            const double dt = std::min(left, period_);
            left -= dt;
            const Values speed = speeds(robot, i < 2 ? acting_[i] : sent_);
            // What is reported comes to where the plan is now, from how fast it is by now: a servo that only brakes
            // with its plan some cycles later goes on further than the rest of the way shows.
            constexpr double BEHIND = SERVO_CYCLES * CYCLE;
            const Values change = added(added(robot.planned, -1.0, robot.position), -BEHIND, robot.velocity);
            robot.velocity = added(robot.velocity, 2.0 * dt / (BEHIND * (BEHIND + dt)), change);
            robot.position = added(robot.position, dt, robot.velocity);
            robot.planned = added(robot.planned, dt, speed);
        }
        state.planned = robot.planned, state.position = robot.position, state.velocity = robot.velocity;
        return true;
    }

    // How fast a robot moves that follows `sent`.
    Values speeds(const ArmState& state, const ArmCommand& sent) const {
        return values_of(
            [&](int i) { return gain_ * (sent.position[i] - state.position[i]) + sent.velocity[i]; });
    }

private:
    // [s] a robot whose plan stands still for so long although references lead it ignores them; what begins meanwhile
    // is judged by the next time
    static constexpr double IGNORED_AFTER = 0.12;
    static constexpr double MOTION = 1e-4;     // [rad] over all joints: a plan that moves
    static constexpr double DUE = 5e-3;        // [rad] of motion that should have been; an arm at rest is led by less
    // of it a robot has moved at least which follows: little, in a slow ramp-in
    static constexpr double FOLLOWED = 0.002;
    static constexpr int LOST_AFTER = 3;       // cycles in which one command moves the robot, the later ones are lost
    static constexpr double EXPLAINED = 0.05, EXPLAINED_SHARE = 0.02;  // [rad/s] over all joints, and of the speed
    static constexpr int LATEST = 25;          // of the commands that are usually on their way: the most
    static constexpr double FORGETTING = 0.02;  // and by how much fewer a cycle
    static constexpr int NEXT = 2;             // commands further a robot goes in a cycle if none is lost, at most
    static constexpr int REMEMBERED = 40;      // commands: the first of them, and the newest
    // [rad/s] over all joints: what two commands make of the plan is the same
    static constexpr double SAME_SPEED = 2e-3;

    // A state shows nothing: what was not shown before begins anew, and what was shown stays.
    void doubt() {
        if (!is_repeating()) repeated_ = 0;
    }

    // The commands from one to another are none of those that may move the robot.
    void forget(int from, int to) {
        std::copy(commands_ + to, commands_ + count_, commands_ + from);
        count_ -= to - from;
        furthest_ = std::max(0, furthest_ - (to - from));
    }

    // The speed that the robot's filter made `moved` of.
    Values unfiltered(const Values& moved, double dt) {
        const Values before = moved_;
        moved_ = moved;
        if (bandwidth_ <= 0.0) return moved;
        const double share = -std::expm1(-2.0 * M_PI * bandwidth_ * dt);
        return values_of([&](int i) { return before[i] + (moved[i] - before[i]) / share; });
    }

    double share_of_fastest(const Values& speed) const {
        return largest(values_of([&](int i) { return speed[i] / fastest_[i]; }));
    }

    // The speeds of joints that are slowed together where one asks for more than its highest speed.
    Values slowed(const Values& speed) const {
        const double most = share_of_fastest(speed);
        if (most <= 1.0) return speed;
        return values_of([&](int i) { return speed[i] / most; });
    }

    void compare_from(const ArmState& state) { plan_ = state.planned, due_ = {}, due_for_ = 0.0; }

    double gain_;
    Values fastest_;
    double period_, bandwidth_;
    Values moved_{};                  // how the plan moved before the newest state [rad/s]
    ArmCommand sent_;                 // what the robot's plan can show by now
    ArmCommand commands_[REMEMBERED];  // the one that its plan has shown, then those that it has not shown yet
    int count_ = 1;
    int furthest_ = 0;                // which of them is the newest that the plan has shown
    int repeated_ = 0;                // for so many cycles in a row it has shown no newer one, although there are
    double latency_ = 1.0;            // how many newer ones there are usually
    std::optional<ArmState> seen_;    // the state before this one
    std::optional<ArmState> last_;    // what was replied to last
    ArmCommand acting_[2];            // what moves the robot from there to its next states, before the last
    Values plan_{}, due_{};           // where the robot planned to be some time ago; how far it has been led since
    double due_for_ = 0.0;            // how long ago that was
};

}  // namespace core
