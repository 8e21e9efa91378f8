// The session of a robot as Python holds it.

#pragma once

#include "egm_session.hpp"
#include "lock.hpp"

// What Python reads of it; as SessionValues in library.py.
struct SessionValues {
    std::int64_t state = core::Session::NONE, number = 0;
    double period = 0.0;
    core::SessionCounters counters;
    double jitter = 0.0, worst_jitter = 0.0, drift_ppm = 0.0, cycle_time = 0.0;
};

struct SessionHandle : SessionValues {
    core::Session session;

    explicit SessionHandle(double silence) : session(silence) {}

    // Act, and show what has become of the session.
    template <typename Act>
    auto act(Act action) {
        const core::Guard guard(core::lock);
        struct Shown {
            SessionHandle& handle;
            ~Shown() { handle.show(); }
        } shown{*this};
        return action(session);
    }

    void show() {
        state = session.state, number = session.number, period = session.period(), counters = session.counters;
        jitter = session.arrivals.jitter, worst_jitter = session.arrivals.worst_jitter;
        drift_ppm = session.arrivals.drift_ppm, cycle_time = session.arrivals.cycle_time();
    }
};
