// The limiter of one arm as Python holds it.

#pragma once

#include "limiter.hpp"
#include "session_handle.hpp"

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
    SessionHandle* session = nullptr;  // of an arm for which the core answers where Python does not
    double* last_call = nullptr;       // of that arm: when Python called the core last
    bool is_checked = false;           // whether the state that is to be answered was
    bool is_unobserved = false;     // whether the reply was sent, and not observed yet

    LimiterHandle(const core::Limiter::Settings& settings, const core::StateTable& table,
                  core::ArmCollisionLimiter* collisions)
        : limiter(settings, table, collisions) {}

    // Whether the core has answered what Python is about to.
    bool is_answered() const { return session && !session->awaits_python; }

    // Check a state, which is in the exchange then; whether a reply is safe.
    bool check(const core::ArmState& reported) {
        if (is_unobserved) observe();  // of the cycle before
        exchange.state = reported;
        is_checked = limiter.check(exchange.state);
        if (session && !is_checked) session->awaits_python = false;
        return is_checked;
    }

    void limit(const core::ArmCommand* desired, bool is_unanswered) {
        exchange.command = limiter.limit(exchange.state, desired, is_unanswered);
        is_checked = false, is_unobserved = session != nullptr;
        if (session) session->awaits_python = false;
    }

    void observe() {
        limiter.observe(exchange.state);
        is_unobserved = false;
    }

    // Act for Python; what takes the core long is no fault of a controller.
    template <typename Act>
    std::int64_t act_for_python(Act action) {
        const core::Guard guard(core::lock);
        const std::int64_t result = act(action);
        if (last_call) *last_call = core::monotonic_now();
        return result;
    }

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
        if (result < 0 && session) session->awaits_python = false;  // the program is wrong: the cycle gets no answer
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
