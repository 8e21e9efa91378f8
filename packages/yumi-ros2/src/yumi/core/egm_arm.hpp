// One seven-axis arm that is guided by EGM: its datagrams become states, commands become datagrams.

#pragma once

#include "egm_codec.hpp"
#include "egm_session.hpp"

namespace core {

class EgmArm {
public:
    explicit EgmArm(Session& session) : session_(session) {}

    // Take a datagram into the session.
    void accept(const void* datagram, std::size_t size, double now) {
        JointReport report;
        Unreadable unreadable;
        if (!JointCodec::decode(datagram, size, report, unreadable))
            session_.note_malformed();
        else if (session_.takes(std::uint32_t(report.seqno), report.time, now))
            newest_ = report;
    }

    // The arm as the message reports it that was accepted last; to be called once for each.
    ArmState state(double now) {
        ArmState arm;
        arm.time = now;
        arm.dt = session_.period();
        arm.session = session_.number;
        arm.position = newest_.measured;
        if (arm.dt > 0.0) arm.velocity = rate_of(newest_.measured, before_, arm.dt);
        arm.planned = newest_.planned;
        arm.is_running = is_running(newest_.motors, newest_.mci, newest_.rapid);
        before_ = newest_.measured;
        return arm;
    }

    std::size_t reply(const ArmCommand& command, unsigned char* datagram) {
        return JointCodec::encode(session_.next_seqno(), command, datagram);
    }

private:
    Session& session_;
    JointReport newest_;
    Values before_{};  // where the arm was measured in the state before
};

}  // namespace core
