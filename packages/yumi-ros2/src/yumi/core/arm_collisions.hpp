// The collision check of one arm: whether its commands keep the arms apart, and what is sent in place of them.

#pragma once

#include <vector>

#include "collision.hpp"
#include "progress_check.hpp"

namespace core {

// How a command moves an arm: there is no `robot` where the robot follows the position sent.
inline collision::Motion arm_motion(const Values& planned, const Setpoint& sent, const std::optional<Setpoint>& robot) {
    return {planned, sent, double(robot.has_value()), robot.value_or(Setpoint{}), 0.0, {}};
}

// What is the same for both arms.
struct SharedByArms {
    collision::Limiter* limiter;
    std::int64_t distances;       // that may be calculated for an arm in a cycle
    double gain;                  // at which the robots' plans close their leads, see plan_gain in robot_response.py
    std::int64_t permission = 0;  // how often other margins were set
};

class ArmCollisionLimiter {
public:
    // Of arm 0, the right one, or 1.
    ArmCollisionLimiter(SharedByArms& shared, int arm) : shared_(shared), arm_(arm), distances_left_(shared.distances) {
        boundaries_.reserve(collision::MOST_BOUNDARIES);
    }

    ArmCollisionLimiter* other = nullptr;
    bool has_motion = false;    // whether it was sent anything
    collision::Motion motion{};         // of the command sent last
    bool is_heard = false;      // whether its robot's datagrams arrive
    bool is_read = false;       // whether its joints were read from the controller since they did
    std::optional<Limited> limited;  // what limits it in this cycle

    // Whether the arm is to hold whatever is desired, see ProgressCheck.
    bool begin_cycle(const ArmCommand* desired, const Values& measured, double dt) {
        const std::optional<Limited> before = limited;
        limited.reset(), distances_left_ = shared_.distances;
        withheld_for_ = std::max(withheld_for_ - 1, 0);
        if (!withheld_for_) coasts_into_.reset();
        if (!has_motion) return false;
        const bool was_held = progress_.limited.has_value();
        // A faster one has to slow down first.
        const std::optional<Limited> by = before && is_slow() ? before : std::nullopt;
        const bool is_held = progress_.holds(desired, measured, position(), dt, by, surroundings());
        if (is_held)
            limited = progress_.limited;
        else if (was_held)
            forget_boundaries();
        return is_held;
    }

    // The arm's datagrams do not arrive any more: it goes on to where its last command leads it. The other arm keeps
    // clear of that until they arrive again, or the arm's joints are read.
    void lose_connection() {
        if (!is_heard || !has_motion) return;
        is_heard = is_read = false;
        collision::Motion coasting = motion;
        coasting.coasts = 1.0, coasting.coasts_to = position();
        if (motion.has_robot && shared_.gain > 0.0)
            coasting.coasts_to = added(motion.robot.position, 1.0 / shared_.gain, motion.robot.velocity);
        set_motion(coasting);
    }

    // An arm that is not heard was read from the controller to be at a position. The other arm keeps clear of what lies
    // between there and where it was read before.
    void note_measured(const Values& measured) {
        if (is_heard) return;
        is_read = true;
        const Values before = has_motion ? position() : measured;
        collision::Motion read = arm_motion(before, {measured, {}, {}}, {});
        // It may not have come yet to where its last command leads it.
        if (has_motion && motion.coasts && distance(before, measured) > NOISE) {
            read.coasts = 1.0, read.coasts_to = motion.coasts_to;
        }
        set_motion(read);
    }

    // An arm is sent a command that `accepts` has not accepted; arguments as there.
    void note_sent(const Values& planned, const Setpoint& sent, const std::optional<Setpoint>& robot) {
        const collision::Motion next = arm_motion(planned, sent, robot);
        if (!is_heard || !has_motion || !stays(next)) set_motion(next);
        is_heard = true;
        if (!limited) limited = coasts_into_;
    }

    // Whether an arm may be sent this command; if so, it is taken. `planned` is where its robot plans to be, `sent` how
    // the position sent would move at the end of this cycle's step, `robot` how the robot would, where a speed is fed
    // forward; whether one is desired, else it is only taken back.
    bool accepts(const Values& planned, const Setpoint& sent, const std::optional<Setpoint>& robot, bool feeds_forward) {
        const bool is_back = !is_heard;
        is_heard = true;
        const collision::Motion last = motion, *of_other = other->has_motion ? &other->motion : nullptr;
        collision::Motion next = arm_motion(planned, sent, robot);
        const bool is_same = has_motion && !is_back && stays(next);
        if (is_same) next = last;
        // What it stands at may have left it, or have come nearer; else nothing has changed.
        if (!is_same || !(boundaries_.empty() || compared_ == comparison())) {
            // Its first command is where it stands.
            if (has_motion && !(is_clear(next, last, of_other) && coasts_clear(next, last, of_other, feeds_forward)))
                return false;
            if (!is_same) set_motion(next);
            compared_ = comparison();
        }
        if (!limited) limited = coasts_into_;
        return true;
    }

    // Whether a speed may be fed forward; else the robot would coast too far if its link were lost.
    bool may_feed_forward() const { return withheld_for_ == 0; }

    // Other margins are kept: what is near is compared anew.
    void forget_boundaries() { boundaries_.clear(); }

    // The command next to `desired` that stays on this side of the boundaries near an arm; whether that is another one.
    bool steer(ArmCommand& desired) {
        // First an arm is slowed down on its path: where that is free after all, it is not left. One that is to stay
        // where it is stays there, though it may be nearer than where it would be led to.
        const Values now = has_motion ? position() : desired.position;
        if (boundaries_.empty() || !is_slow() || distance(desired.position, now) < STAYS) return false;
        const collision::Boundary* crossed = nullptr;
        for (int repeat = 0; repeat < REPEATS; ++repeat) {
            bool is_clear = true;
            for (const collision::Boundary& each : boundaries_) {
                const double missing = each.least - dot(each, desired.position);
                if (missing <= EXACT) continue;
                is_clear = false, crossed = &each;
                lead_along(each, desired.position, missing);
                const double inwards = dot(each, desired.velocity);
                if (inwards < 0.0) lead_along(each, desired.velocity, -inwards);
            }
            if (is_clear) break;
        }
        if (!crossed) return false;
        limited = limited_by(crossed->part, crossed->other, crossed->distance);
        desired.has_velocity = largest(desired.velocity) > 0.0;
        return true;
    }

private:
    // [m] between parts of arms that coast: a quarter of the padding is left
    static constexpr double COASTING = -0.003;
    // [m] where a speed is fed forward: taken back, the way changes slightly
    static constexpr double COASTING_AHEAD = 0.0;
    static constexpr double SHARE_AHEAD = 0.25;     // of the distances, for where a robot coasts that is fed a speed
    // cycles in which no speed is fed to a robot that would have coasted too far
    static constexpr int WITHHELD_FOR = 5;
    static constexpr double NOISE = 1e-3;   // [rad] of where the robot plans to be
    static constexpr double EXACT = 1e-6;   // [m]
    static constexpr double STAYS = 1e-6;   // [rad]
    static constexpr double FLAT = 1e-4;    // [m²/rad²] of a slope below which no joint leads away
    static constexpr int REPEATS = 3;       // of leading off one boundary after the other

    // Of which of the arms' motions and which margins something was found.
    using Comparison = std::array<std::int64_t, 3>;
    Comparison comparison() const { return {number_, other->number_, shared_.permission}; }

    const Values& position() const { return motion.sent.position; }

    void set_motion(const collision::Motion& next) { motion = next, has_motion = true, ++number_; }

    // Whether a command changes nothing. Most of the time an arm stands.
    bool stays(const collision::Motion& next) const {
        return !motion.coasts && motion.sent == next.sent && motion.has_robot == next.has_robot &&
               motion.robot == next.robot && distance(motion.planned, next.planned) < NOISE;
    }

    // Whether the arm is led along boundaries; a faster one is slowed down first.
    bool is_slow() const { return has_motion && collisions_is_slow(shared_.limiter, &motion); }

    Surroundings surroundings() const {
        Surroundings now;
        if (other->has_motion) now.position = other->position();
        now.is_heard = other->is_heard, now.is_read = other->is_read;
        now.coasts = other->has_motion && other->motion.coasts;
        now.permission = shared_.permission;
        now.is_limited = other->limited || other->progress_.is_limited();
        return now;
    }

    // Whether an arm keeps apart from everything on all of its braking path, whichever arm is quicker, should it move
    // as `next` says, after `last`; `of_other` is the other arm's motion.
    bool is_clear(const collision::Motion& next, const collision::Motion& last, const collision::Motion* of_other) {
        if (distances_left_ <= 0) return false;
        const bool is_clear = decide(next, last, of_other, distances_left_, INF);
        if (!is_clear && decision_.part >= 0) limited = limited_by(decision_.part, decision_.other, decision_.distance);
        boundaries_.assign(decision_.boundaries, decision_.boundaries + decision_.boundary_count);
        return is_clear;
    }

    // Whether nothing touches wherever both arms would coast without their links; arguments as above.
    bool coasts_clear(const collision::Motion& next, const collision::Motion& last, const collision::Motion* of_other,
                      bool feeds_forward) {
        // Robots that are sent positions go nowhere else.
        if (!next.has_robot && !(of_other && of_other->has_robot)) return true;
        const auto most = std::int64_t((feeds_forward ? SHARE_AHEAD : 1.0) * double(shared_.distances));
        const double apart = feeds_forward ? COASTING_AHEAD : COASTING;
        if (decide(next, last, of_other, std::min(distances_left_, most), apart)) return true;
        if (decision_.part >= 0) coasts_into_ = limited_by(decision_.part, decision_.other, decision_.distance);
        if (feeds_forward) withheld_for_ = WITHHELD_FOR;
        return false;
    }

    bool decide(const collision::Motion& next, const collision::Motion& last, const collision::Motion* of_other,
                std::int64_t most, double apart) {
        const bool is_clear =
            collisions_is_clear(shared_.limiter, arm_, &next, &last, of_other, apart, most, &decision_);
        distances_left_ -= decision_.distances;
        return is_clear;
    }

    Limited limited_by(std::int64_t part, std::int64_t of_other, double apart) const {
        return {part, of_other, !other->is_heard && !other->is_read, apart};
    }

    // The product of a boundary's normal with a position, with what each addition rounds off (Neumaier): along a
    // boundary the last digits of this decide to which side an arm is led.
    static double dot(const collision::Boundary& boundary, const Values& values) {
        double sum = 0.0, lost = 0.0;
        for (int i = 0; i < JOINTS; ++i) {
            const double term = boundary.normal[i] * values[i], next = sum + term;
            lost += std::abs(sum) >= std::abs(term) ? (sum - next) + term : (term - next) + sum;
            sum = next;
        }
        return sum + lost;
    }

    // Change values of the joints so that they lead away from a boundary by so much.
    static void lead_along(const collision::Boundary& boundary, Values& values, double change) {
        const double square = std::max(dot(boundary, boundary.normal), FLAT);
        for (int i = 0; i < JOINTS; ++i) values[i] += boundary.normal[i] * change / square;
    }

    SharedByArms& shared_;
    int arm_;
    std::int64_t number_ = 0;  // of its motion
    std::vector<collision::Boundary> boundaries_;  // near it
    Comparison compared_{-1, -1, -1};              // what was found to be clear last
    ProgressCheck progress_;
    std::int64_t distances_left_;  // in this cycle
    collision::Decision decision_{};
    int withheld_for_ = 0;                // cycles, since the robot would have coasted too far with a speed fed forward
    std::optional<Limited> coasts_into_;  // what it would have coasted into
};

}  // namespace core

// Both arms as Python holds them.
struct CollisionsHandle {
    core::SharedByArms shared;
    core::ArmCollisionLimiter arms[2];

    explicit CollisionsHandle(const core::SharedByArms& settings) : shared(settings), arms{{shared, 0}, {shared, 1}} {
        arms[0].other = &arms[1], arms[1].other = &arms[0];
    }

    // Other margins are kept from now on.
    void note_permission() {
        ++shared.permission;
        for (core::ArmCollisionLimiter& arm : arms) arm.forget_boundaries();
    }
};
