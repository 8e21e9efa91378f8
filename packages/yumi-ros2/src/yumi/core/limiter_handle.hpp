// The limiter of one arm as Python holds it.

#pragma once

#include "limiter.hpp"
#include "lock.hpp"

// What crosses between an arm's limiter and Python; as LimiterExchange in library.py.
struct LimiterExchange {
    core::ArmState state;      // as it was checked
    core::ArmCommand command;  // sent
    std::int64_t limiter_state = core::NO_SESSION;
    std::int64_t forbidden = -1;  // the event that the table forbids in this state, after which nothing was done
    std::int64_t is_implausible = 0, are_references_ignored = 0;  // why the arm holds whatever is desired
    std::int64_t is_at_rest = 1, must_settle = 0, is_other_arm = 0;
    core::Values implausible_position{};
    core::LimiterCounters counters;
};

struct LimiterHandle {
    LimiterExchange exchange;
    core::Limiter limiter;

    LimiterHandle(const core::Limiter::Settings& settings, const core::StateTable& table,
                  core::ArmCollisionLimiter* collisions)
        : limiter(settings, table, collisions) {}

    // Act, and show what has become of the limiter; -1 where the table forbids that, and the result else.
    template <typename Act>
    std::int64_t act(Act action) {
        const core::Guard guard(core::lock);
        std::int64_t result = -1;
        exchange.forbidden = -1;
        try {
            result = action();
        } catch (const core::ForbiddenTransition& forbidden) {
            exchange.forbidden = forbidden.event;
        } catch (...) {  // no memory: nothing here allocates
        }
        const core::SentMotion& motion = limiter.motion();
        const core::FeedbackCheck& feedback = limiter.feedback();
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
