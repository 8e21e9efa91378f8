// One seven-axis arm that is guided by EGM: its datagrams become states, commands become datagrams.

#pragma once

#include "egm_codec.hpp"
#include "egm_session.hpp"

namespace core {

struct EgmArm {
    Session session;

    explicit EgmArm(double silence) : session(silence) {}

    // Take a datagram into the session.
    void accept(const void* datagram, std::size_t size, double now) {
        JointReport report;
        Unreadable unreadable;
        if (!JointCodec::decode(datagram, size, report, unreadable))
            session.note_malformed();
        else if (session.takes(std::uint32_t(report.seqno), report.time, now))
            newest_ = report;
    }

    // The arm as the message reports it that was accepted last; to be called once for each.
    ArmState state(double now) {
        const bool is_fresh = session.state == Session::BEGUN || session.state == Session::RESUMED || !has_before_;
        ArmState arm;
        arm.time = now;
        arm.dt = is_fresh ? 0.0 : period(newest_.time - before_.time);
        arm.session = session.number;
        arm.position = newest_.measured;
        if (arm.dt > 0.0) arm.velocity = rate_of(newest_.measured, before_.measured, arm.dt);
        arm.planned = newest_.planned;
        // Undefined counts: a restart of the controller leaves it so (reference/egm.md §3.3).
        arm.is_running = newest_.motors == MOTORS_ON && newest_.mci == MCI_RUNNING && newest_.rapid != RAPID_STOPPED;
        before_ = newest_, has_before_ = true;
        return arm;
    }

    std::size_t reply(const ArmCommand& command, unsigned char* datagram) {
        return JointCodec::encode(session.next_seqno(), command, datagram);
    }

private:
    static constexpr double LONGEST_PERIOD = 0.100;  // [s] between two messages; as in driver/egm_server.py
    static constexpr int MOTORS_ON = 1, MCI_RUNNING = 3, RAPID_STOPPED = 1;

    // Robot time from one message to the next.
    static double period(double passed) { return 0.0 < passed && passed <= LONGEST_PERIOD ? passed : CYCLE; }

    JointReport newest_, before_;
    bool has_before_ = false;
};

}  // namespace core
