// The limiter: the last step before the network. No command leaves that a robot must never get.
//
// The limiter refuses what is not a number, keeps positions inside the joint limits, and lets the command move only as
// fast, and change its motion only as quickly, as the joints may, measured from the command sent before. To hold means
// to come to rest, then to repeat the last command, not the measured position, which creeps under load.
//
// It does not trust the session. Whatever a datagram says, as long as the robot may be following earlier commands the
// next one goes on from the last. What the feedback is worth is decided in feedback.hpp, which commands the robot
// follows in references.hpp (docs/explanation/decisions/0014-feedback-is-doubted.md).
//
// What is done with the arm follows from one state, and the table of control/limiter_state.py. How fast positions
// change is limited in position_limiter.hpp, the speeds sent with them in feed_forward_limiter.hpp, both within the
// factor of control/speed_scale.py.

#pragma once

#include <utility>

#include "arm_collisions.hpp"
#include "feed_forward_limiter.hpp"
#include "limiter_state.hpp"
#include "position_delay.hpp"
#include "position_limiter.hpp"
#include "references.hpp"

namespace core {

// Cycles in which the limiter changed something; as LimiterCounters in control/counters.py.
struct LimiterCounters {
    std::int64_t refused = 0, position_limited = 0, slowed = 0, implausible = 0, kept_apart = 0;
    std::int64_t feedforward_withheld = 0, unanswered = 0;
};

// What one arm was sent so far, as far as the next command depends on it.
struct SentMotion {
    PositionMotion positions;
    FedForward speeds;
    bool is_at_rest = true;    // whether the command stands, and does not lead the robot any more
    // whether the arm is held until its command is back where the arm is, whatever is desired
    bool must_settle = false;
    double held_for = 0.0;     // for how long the arm is held, and nothing else was desired
    // The positions between which an arm that holds may come to rest; none while it does not hold.
    std::optional<std::array<Values, 2>> stop_within;
    std::optional<Values> stop_at;  // where the arm holds while its feedback is implausible; none while it is not
    // whether nothing but braking kept the arms apart, and no command beside a boundary did since
    bool was_refused = false;
    LimiterCounters counters;

    ArmCommand command() const { return {positions.sent.position, speeds.velocity, speeds.robot.has_value()}; }
};

class Limiter {
public:
    // What an arm and its robot are.
    struct Settings {
        JointLimits limits;   // of the joints
        Values speeds;        // of the arm itself, whatever the limits are
        // between two states of the arm; no command moves further than the joints may within it, in which the robot
        // takes a command, however long ago the one before was
        double period;
        double gain;          // of the robot's position loop
        double bandwidth;     // of the robot's low-pass filter on the speed [Hz]; 0 is none
    };

    Limiter(const Settings& settings, const StateTable& table, ArmCollisionLimiter* collisions)
        : table_(table), limits_(settings.limits), period_(settings.period), gain_(settings.gain),
          following_(FOLLOWING_TIME / (gain_ > 0.0 ? gain_ : EGM_GAIN)), position_limiter_(limits_),
          feed_forward_limiter_(limits_, gain_, period_), feedback_(limits_, settings.speeds),
          references_(gain_, limits_.velocity, period_, settings.bandwidth), collisions_(collisions) {
        for (int i = 0; i < JOINTS; ++i) taken_at_once_[i] = TAKEN_AT_ONCE * limits_.acceleration[i] * period_;
        std::fill(scales_, scales_ + SCALES, 1.0);
    }
    Limiter(const Limiter&) = delete;

    State state() const { return state_; }
    const SentMotion& motion() const { return motion_; }
    const FeedbackCheck& feedback() const { return feedback_; }
    bool are_references_ignored() const { return references_.are_ignored; }

    // Each arm knows where the other was measured last.
    void pair(Limiter& other) { feedback_.other = &other.measured_, other.feedback_.other = &measured_; }

    // To the state that follows on an event, before anything else changes.
    void go(Event event) {
        const int next = table_.next[state_][event];
        if (next < 0) throw ForbiddenTransition{event};
        state_ = State(next);
        if (table_.settles[state_]) motion_.must_settle = true;
    }

    // No datagram of the arm arrives: the other arm keeps clear of where this one may go. At CONNECTION_LOST none has
    // arrived for so long that the arm's controllers are deactivated.
    void lose(Event event) {
        go(event);
        candidate_.reset();
        if (collisions_) collisions_->lose_connection();
    }

    // Move no joint faster than `scale` times its limit: speeds from the next command on, positions later.
    void scale_speed(double scale) {
        scale_ = scale;
        feed_forward_limiter_ = FeedForwardLimiter(limits_.slower(scale), gain_, period_);
    }

    // Whether a reply is safe, else it is open whether the robot still follows, or where it is. A position that no arm
    // can have reached is replaced by the last plausible one, and the plan by where the references lead it, as long as
    // it is in doubt. To be called before `limit`, which takes what this makes of the state.
    bool check(ArmState& state) {
        const ArmState reported = state;
        bool is_safe = true;
        if (state.session != session_) {
            is_safe = enter(state);
        } else if (feedback_.is_plausible(state, last_position())) {
            accept(state);
        } else {
            // A plan that seemed to stand would hide that the lead becomes less as the robot goes on.
            ++motion_.counters.implausible;
            state = feedback_.reject(state);
            references_.expect(state);
            if (feedback_.is_lost())
                go(FEEDBACK_LOST);
            else if (feedback_.in_a_row >= FeedbackCheck::DOUBTED)
                go(FEEDBACK_DOUBTED);
        }
        if (is_safe && reported.dt <= 0.0 && !reported.is_running &&
            distance(last_position(), reported.planned) >= SLIGHT_LEAD) {
            // After a silence, of a robot that does not follow: were it to begin by now, it would take the lead at
            // once.
            rest();
            is_safe = false;
        }
        // What is expected in place of a false position is of the session before.
        if (state_ == BEGINNING && feedback_.in_a_row) is_safe = false;
        // Else the plan may be the expected one.
        const bool is_followed = is_safe && reported.is_running && !feedback_.in_a_row;
        references_.compare(is_followed ? &state : nullptr);
        return is_safe;
    }

    // The command to send, next to `desired`; null holds.
    //
    // The first command of a session in which the robot does not follow yet equals the measured position: a robot that
    // begins to follow finds no step. So do the commands while the robot does not follow, once they have come there.
    //
    // Where no controller has answered in time the arm holds, too, but has not to settle before it goes on.
    ArmCommand limit(const ArmState& state, const ArmCommand* desired, bool is_unanswered = false) {
        is_unanswered_ = is_unanswered;
        motion_.counters.unanswered += is_unanswered;
        const bool is_accepted = limit_within(state, desired);
        if (collisions_ && !is_accepted)
            collisions_->note_sent(state.planned, motion_.positions.moving(), motion_.speeds.robot);
        return motion_.command();
    }

    // After the reply to `state`: what the next one depends on.
    void observe(const ArmState& state) {
        motion_.speeds.observe(state, last_position());
        scale_positions();
        const bool is_valid = state.is_running && !feedback_.in_a_row;
        references_.observe(state, motion_.command(), is_valid, motion_.is_at_rest, state_ == WAITING);
        measured_ = state.position;
    }

private:
    static constexpr double HOP = 1e-3;            // [rad] beside something an arm goes by so much at once
    static constexpr double HOPS = 0.1;            // [rad/s] while it is slower than this
    static constexpr double FEEDBACK_DELAY = 0.050;  // [s] the measured speed may be behind the robot's own, at most
    // Time constants of the robot's position loop after which it stands where its references lead it: what is left is
    // less than a hundredth of the lead. Until then a new session does not mean that the last command is of no effect.
    static constexpr double FOLLOWING_TIME = 5.0;
    static constexpr double TAKEN_AT_ONCE = 0.75;  // of what a joint's speed may change in a cycle
    static constexpr double LATE = 1.25;           // periods: the robot has repeated the last command meanwhile
    // of a period: nothing follows from how far something moved meanwhile
    static constexpr double NO_TIME = 0.1;
    static constexpr double NO_LEAD = 1e-4;        // [rad] less than the joints' resolution
    static constexpr double SLIGHT_LEAD = 0.01;    // [rad] a lead that a robot may follow at once
    // [rad] the lead that shows whether a robot that ignored them follows again
    static constexpr double PROBE = 1e-3;
    static constexpr double SETTLING_TIME = 1.0;   // [s] after which a command that is back settles no further
    static constexpr double NEAR = 0.02;           // [rad] as near as a measured position is known
    // [rad] a command that follows the noise of an arm that stands moves less in a cycle
    static constexpr double CREEPS = 2e-5;
    // positions are sent later than the speeds that go with them, by cycles
    static constexpr int SCALES = SERVO_CYCLES + 2;

    const Values& last_position() const { return motion_.positions.sent.position; }

    // Positions are sent later than the speeds that go with them, so their limits come down later, too.
    void scale_positions() {
        std::copy(scales_ + 1, scales_ + SCALES, scales_);
        scales_[SCALES - 1] = scale_;
        position_limiter_ = PositionLimiter(limits_.slower(*std::max_element(scales_, scales_ + SCALES)));
    }

    // A session begins, where the robot is; as long as it may follow the last command, only from there on. Until then a
    // command that leads it is not answered: a robot without a reply keeps its last reference.
    bool enter(ArmState& state) {
        const ArmCommand last = motion_.command();
        if (!feedback_.is_start(state, last.position)) {
            ++motion_.counters.implausible;
            feedback_.reject(state);
            candidate_.reset();
            go(SESSION_ELSEWHERE);
            return false;
        }
        const bool may_follow = state.time - sent_at_ < following_;
        // A speed that was sent with it may keep the robot away from where it was sent.
        auto leads = [&](const auto& at) { return largest(references_.speeds(at, last)) >= SLIGHT_LEAD * EGM_GAIN; };
        // One datagram may be late: the one before has to show the same, but for a robot that was sent nothing yet.
        const std::optional<ArmState> before = std::exchange(candidate_, state);
        const bool is_second = before && before->session == state.session;
        const bool is_shown = is_second && (may_follow ? !leads(state) && !leads(*before)
                                                       : distance(state.position, before->position) < SLIGHT_LEAD);
        if (sent_at_ > -INF && !is_shown) {
            accept(state);
            go(SESSION_LED);
            return false;
        }
        go(may_follow ? SESSION_CONTINUED : SESSION_NEW);
        session_ = state.session;
        motion_.stop_within.reset();
        delay_.clear();
        references_.begin(state);
        state.dt = 0.0;  // nothing was sent since the last command
        accept(state);
        return true;
    }

    void accept(ArmState& state) {
        if (feedback_.in_a_row) {
            if (feedback_.in_a_row >= FeedbackCheck::DOUBTED) references_.forget_commands();
            resume(state);
            motion_.stop_within.reset(), motion_.stop_at.reset();
            // The command is not where the robot is.
            if (distance(last_position(), state.planned) >= SLIGHT_LEAD) motion_.is_at_rest = false;
        }
        state = feedback_.accept(state);
    }

    // Begin with the first command: where the robot is, at most at the end of its range.
    void begin(const ArmState& state) {
        const Values position = limits_.inside(state.position, limits_.lower);
        motion_.positions = PositionMotion::resting_at(position);
        motion_.speeds = FedForward{};
        motion_.is_at_rest = true, motion_.must_settle = false;
        motion_.stop_within.reset();
        references_.begin(state, motion_.command());
    }

    // Go on with the motion for a state that was checked; whether the collision limiter has accepted it.
    bool limit_within(const ArmState& state, const ArmCommand* desired) {
        sent_at_ = state.time, candidate_.reset();
        if (state_ == BEGINNING) {
            begin(state);
            go(FIRST_SENT);
            return false;
        }
        if (state.dt <= 0.0) rest();  // without datagrams the command has stood still
        if (!(0.0 < state.dt && state.dt <= LATE * period_)) resume(state);
        const double dt = std::min(state.dt, period_);
        if (dt < NO_TIME * period_) return false;
        const bool is_doubted = feedback_.in_a_row >= FeedbackCheck::DOUBTED;
        if (is_doubted || !state.is_running) {
            if (!is_doubted) go(NOT_FOLLOWING);
            delay_.clear();
            come_to(state, dt);
            return false;
        }
        return follow(state, desired, dt);
    }

    // Go on with a robot that follows, and whose position is believed; returns what `limit_within` does.
    bool follow(const ArmState& state, const ArmCommand* desired, double dt) {
        ArmCommand delayed;
        if (!desired || gain_ == 0.0 || !desired->is_finite()) {
            delay_.clear();
        } else {
            delayed = delay_.next(*desired, state.dt, last_position());
            desired = &delayed;
        }
        const bool was_waiting = state_ == WAITING;
        go(event(state, desired));
        if (state_ == WAITING) {
            if (!was_waiting) rest();  // to brake would lead it on by what it does not follow
            delayed = place_to_wait();
            desired = &delayed;
            const Values speeds = references_.speeds(state, references_.followed());
            motion_.speeds = feed_forward_limiter_.follow(motion_.speeds, speeds, dt);
        } else if (state_ != State::FOLLOWING) {
            desired = nullptr;
        }
        const bool is_accepted = collisions_ && step_apart(state, desired, dt);
        if (!collisions_) motion_ = step(motion_, state, desired, dt);
        if (state_ == SETTLING && !motion_.must_settle) go(BACK);
        return is_accepted;
    }

    // What a cycle brings of such a robot, and of what is desired.
    Event event(const ArmState& state, const ArmCommand* desired) {
        if (references_.are_ignored) return IGNORING;
        if (state_ == WAITING ? references_.is_repeating() : references_.are_lost(taken_at_once_)) return REPEATING;
        if (is_unanswered_ && !motion_.must_settle) return UNANSWERED;
        if (!desired || motion_.must_settle) return UNDESIRED;
        const bool is_finite = desired->is_finite(), is_usable = is_finite && is_near(state);
        motion_.counters.refused += !is_finite;
        motion_.counters.slowed += is_finite && !is_usable;
        return is_usable ? DESIRED : UNUSABLE;
    }

    // Go on from rest.
    void rest() { motion_.positions = PositionMotion::resting_at(last_position()); }

    // Go on with a robot that repeated the last command for a while.
    void resume(const ArmState& state) {
        motion_.speeds = feed_forward_limiter_.resume(motion_.speeds, state, last_position());
    }

    // Where a command waits: as near to the one that the robot follows as it may set out to at once.
    ArmCommand place_to_wait() const {
        ArmCommand command{last_position(), {}, false};
        if (gain_ == 0.0) return command;
        const Values& followed = references_.followed().position;
        command.position = values_of([&](int i) {
            return followed[i] + bounded(last_position()[i] - followed[i], taken_at_once_[i] / gain_);
        });
        return command;
    }

    // Go on by the first of some motions that keeps the arms apart, and true; where none does, braking, and false.
    bool step_apart(const ArmState& state, const ArmCommand* desired, double dt) {
        const SentMotion& motion = motion_;
        const bool is_held = collisions_->begin_cycle(desired, state.position, dt);
        SentMotion found = motion;
        auto is_taken = [&](const ArmCommand* candidate) {
            found = step(motion, state, candidate, dt);
            const bool feeds = candidate && candidate->has_velocity;
            return collisions_->accepts(state.planned, found.positions.moving(), found.speeds.robot, feeds);
        };
        if (desired ? !is_held && take_next(motion, *desired, is_taken, found) : is_taken(nullptr)) {
            found.was_refused = found.was_refused && desired;
            motion_ = found;
            return true;
        }
        PositionMotion positions = motion.positions;
        if (!positions.stands(dt)) positions = position_limiter_.brake(positions, dt);
        const FedForward speeds =
            feed_forward_limiter_.step(motion.speeds, state, positions.sent.position, {}, false, dt);
        motion_.positions = positions, motion_.speeds = speeds, motion_.is_at_rest = false;
        // What a refused motion has shown of how the arm comes to rest counts for the next one.
        motion_.must_settle = found.must_settle, motion_.stop_within = found.stop_within;
        motion_.was_refused = !is_held;
        ++motion_.counters.kept_apart;
        return false;
    }

    // Whether something that may be sent in place of `desired` is taken, one after the other.
    template <typename IsTaken>
    bool take_next(const SentMotion& motion, const ArmCommand& desired, IsTaken is_taken, SentMotion& found) {
        int count = 0;
        auto try_one = [&](const ArmCommand& candidate, bool is_elsewhere) {
            const bool is_first = count++ == 0;
            if (!is_taken(&candidate)) return false;
            found.was_refused = motion.was_refused && !is_first;
            found.counters.kept_apart += is_elsewhere;  // a robot that only follows later is not led elsewhere
            found.counters.feedforward_withheld += desired.has_velocity && !candidate.has_velocity;
            return true;
        };
        ArmCommand first = desired;
        const bool is_steered = collisions_->steer(first);
        if ((!first.has_velocity || collisions_->may_feed_forward()) && try_one(first, is_steered)) return true;
        // May go there, but the robot has to follow it late.
        if (first.has_velocity && !collisions_->may_feed_forward() && try_one({first.position, {}, false}, is_steered))
            return true;
        // What was compared has found the boundary; where that does not change the command, it is refused again.
        ArmCommand along = desired;
        const bool is_along = collisions_->steer(along);
        if (!(along == first) && !motion.was_refused && try_one(along, is_along)) return true;
        const Setpoint now = motion.positions.moving();
        const double far = largest_difference(desired.position, now.position);
        if (!(far > HOP && largest(now.velocity) < HOPS)) return false;
        // On its way to a far goal each joint is as quick as it may, which leads elsewhere than straight there.
        const Values near = added(now.position, HOP / far, added(desired.position, -1.0, now.position));
        return try_one({near, {}, false}, true);
    }

    // The motion after a cycle in which the robot follows: next to `desired`, or held.
    SentMotion step(const SentMotion& motion, const ArmState& state, const ArmCommand* desired, double dt) const {
        if (!desired) {
            SentMotion held = hold(motion, state, dt);
            if (state_ == HOLDING) {  // what is desired cannot be used; the next may be
                held.held_for = 0.0;
                return held;
            }
            held.held_for = motion.held_for + state.dt;
            const bool is_near = distance(held.positions.sent.position, state.position) < SLIGHT_LEAD;
            // The arm stands sooner than the command is back; what keeps shaking does so for its noise.
            const bool is_back = held.is_at_rest || (is_near && held.held_for >= SETTLING_TIME);
            held.must_settle = !is_back || state_ == IGNORED;
            return held;
        }
        SentMotion next = motion;
        const bool is_cut = !limits_.contain(desired->position);
        const Values goal = limits_.inside(desired->position, motion.positions.sent.position);
        const bool is_taken = position_limiter_.step(motion.positions, goal, dt, state.dt, next.positions);
        const Values& position = next.positions.sent.position;
        next.speeds = feed_forward_limiter_.step(motion.speeds, state, position, desired->velocity,
                                                 desired->has_velocity, dt);
        next.is_at_rest = false, next.held_for = 0.0;
        next.stop_within.reset();
        next.counters.position_limited += is_cut;
        // What is cut at the range and then passes is counted there already.
        next.counters.slowed += !is_taken || (next.speeds.is_bounded && !is_cut);
        return next;
    }

    // Come to rest, then repeat the last command.
    //
    // A command runs ahead of the robot by its speed over the loop gain. It goes back to the robot within its limits,
    // which takes longer than the robot needs to stop; what is left of the lead meanwhile, a speed against it cancels,
    // as quickly as the robot may brake. So it comes to rest on its way, not where the lead points; and not beyond,
    // since a command would run after a plan that is reported elsewhere than the robot's for as long as that follows.
    SentMotion hold(const SentMotion& motion, const ArmState& state, double dt) const {
        SentMotion held = motion;
        const Values last = motion.positions.sent.position;
        if (motion.is_at_rest && motion.positions.stands(dt)) {  // it may creep after the noise of an arm that stood
            held.speeds = feed_forward_limiter_.step(motion.speeds, state, last, {}, false, dt);
            return held;
        }
        // A command that chased noise would never rest; a lead of some size shows whether it is taken.
        const double kept = state_ == IGNORED ? PROBE : NO_LEAD;
        if (!held.stop_within) held.stop_within = places_to_stop(motion, state);
        const std::array<Values, 2>& range = *held.stop_within;
        const Values there = place_to_rest(state);
        const Values goal = values_of([&](int i) {
            return std::max(range[0][i], std::min(range[1][i], there[i] + bounded(last[i] - there[i], kept)));
        });
        held.positions = go_to(motion.positions, goal, state, dt);
        const Values& position = held.positions.sent.position;
        const bool is_led = largest_difference(position, goal) >= NO_LEAD;
        const Values against = is_led ? feed_forward_limiter_.against(state, position) : Values{};
        held.speeds = feed_forward_limiter_.step(motion.speeds, state, position, against, is_led, dt);
        held.is_at_rest = !is_led && !held.speeds.robot && held.positions.stands(dt);
        return held;
    }

    // The position that a robot goes on to report if it stops now: nearer to its plan while it moves. Not that of its
    // plan, which a load keeps elsewhere than what is reported: the robot's loop would go on.
    static Values place_to_rest(const ArmState& state) {
        Values place = state.position;
        for (int i = 0; i < JOINTS; ++i) {
            const double way = state.velocity[i] * SERVO_CYCLES * CYCLE, left = state.planned[i] - state.position[i];
            if (way * left > 0.0) place[i] += std::copysign(std::min(std::abs(way), std::abs(left)), way);
        }
        return place;
    }

    // Between which positions a robot that is to stop comes to rest: it brakes from where it plans to be, or follows
    // the last command until that has stopped.
    std::array<Values, 2> places_to_stop(const SentMotion& motion, const ArmState& state) const {
        const Values speeds = references_.speeds(state, motion.command()), last = motion.positions.sent.position;
        const Values stop = position_limiter_.place_to_stop(motion.positions);
        std::array<Values, 2> range;
        for (int i = 0; i < JOINTS; ++i) {
            const double now = state.planned[i], speed = bounded(speeds[i], limits_.velocity[i]);
            const double end = Braking(now, speed, 0.0, limits_.acceleration[i], limits_.jerk[i]).end();
            range[0][i] = std::min({now, end, last[i], stop[i]}) - NEAR;
            range[1][i] = std::max({now, end, last[i], stop[i]}) + NEAR;
        }
        return range;
    }

    // Go to where an arm is that does not follow: were it to follow after all, it would not feel a step. Where its
    // position is implausible, come to rest where the command itself does.
    void come_to(const ArmState& state, double dt) {
        const Values last = last_position();
        if (feedback_.in_a_row && !motion_.stop_at)
            motion_.stop_at = position_limiter_.place_to_stop(motion_.positions);
        const Values goal = feedback_.in_a_row ? *motion_.stop_at : state.position;
        motion_.positions = go_to(motion_.positions, goal, state, dt);
        const Values& position = last_position();
        motion_.speeds = feed_forward_limiter_.step(motion_.speeds, state, position, {}, false, dt);
        motion_.is_at_rest = distance(position, goal) < NEAR && distance(last, position) < CREEPS;
        motion_.stop_within.reset();
    }

    // Nearer to `goal` within the limits; never out of the range, or further out.
    PositionMotion go_to(const PositionMotion& positions, const Values& goal, const ArmState& state, double dt) const {
        PositionMotion next;
        position_limiter_.step(positions, limits_.inside(goal, positions.sent.position), dt, state.dt, next);
        return next;
    }

    // Whether the robot's speed, and what its acceleration can add, explain how far the command is ahead. Else the
    // robot does not get our commands, and all that piles up would reach it as one blow. A robot that follows speeds
    // only makes nothing of a lead.
    bool is_near(const ArmState& state) const {
        const Values& last = last_position();
        if (gain_ == 0.0) return true;
        // At a lead of speed over gain a robot seen at that speed has come to move so; more does not move it faster.
        return all_joints([&](int i) {
            const double speed = std::abs(state.velocity[i]) + limits_.acceleration[i] * FEEDBACK_DELAY;
            return std::abs(last[i] - state.planned[i]) < speed / EGM_GAIN;
        });
    }

    StateTable table_;
    State state_ = NO_SESSION;
    JointLimits limits_;
    double period_, gain_;
    Values taken_at_once_;  // a joint may change its speed by when it follows again
    double following_;      // for so long a robot may follow the last command
    PositionLimiter position_limiter_;
    FeedForwardLimiter feed_forward_limiter_;
    SentMotion motion_;
    FeedbackCheck feedback_;
    ReferenceMonitor references_;
    ArmCollisionLimiter* collisions_;
    std::int64_t session_ = 0;
    double sent_at_ = -INF;
    std::optional<ArmState> candidate_;  // the state before, when a session might have begun with it
    std::optional<Values> measured_;  // last; none before the first cycle
    PositionDelay delay_;
    bool is_unanswered_ = false;         // of this cycle
    double scale_ = 1.0;                 // of speeds
    double scales_[SCALES];              // of the last cycles, the highest of which is that of positions
};

}  // namespace core
