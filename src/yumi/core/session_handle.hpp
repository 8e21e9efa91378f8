// The session of an arm as Python holds it, and whether the datagram that was accepted last waits for Python's answer.

#pragma once

#include "egm_arm.hpp"
#include "lock.hpp"

// What Python reads of it; as SessionValues in library.py.
struct SessionValues {
    std::int64_t state = core::Session::NONE, number = 0;
    core::SessionCounters counters;
    double jitter = 0.0, worst_jitter = 0.0, drift_ppm = 0.0, cycle_time = 0.0;
};

struct SessionHandle : SessionValues {
    core::EgmArm egm;
    core::ArmState arm;  // as it was reported last
    bool awaits_python = false;

    explicit SessionHandle(double silence) : egm(silence) {}

    // The last of the datagrams that waited together was taken: what is to be answered, and whether by Python.
    void end_batch(double now, bool for_python) {
        if (egm.session.is_accepted()) arm = egm.state(now), awaits_python = for_python;
        show();
    }

    void show() {
        const core::Session& session = egm.session;
        state = session.state, number = session.number, counters = session.counters;
        jitter = session.arrivals.jitter, worst_jitter = session.arrivals.worst_jitter;
        drift_ppm = session.arrivals.drift_ppm, cycle_time = session.arrivals.cycle_time();
    }
};
