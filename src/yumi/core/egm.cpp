// EGM as library.py declares it for egm/codec.py and egm/session.py: datagrams, conversations, and both together for the
// control loop. No exception leaves, and nothing is allocated after the start.

#include "egm_arm.hpp"

using namespace core;

// A conversation, and what others read of it; as SessionValues in library.py.
struct SessionHandle {
    std::int64_t state = Session::NONE, number = 0;
    SessionCounters counters;
    double jitter = 0.0, worst_jitter = 0.0, drift_ppm = 0.0, cycle_time = 0.0;
    ArmState arm;  // of an arm, as it was reported last
    EgmArm egm;

    explicit SessionHandle(double silence) : egm(silence) {}

    void show() {
        const Session& session = egm.session;
        state = session.state, number = session.number, counters = session.counters;
        jitter = session.arrivals.jitter, worst_jitter = session.arrivals.worst_jitter;
        drift_ppm = session.arrivals.drift_ppm, cycle_time = session.arrivals.cycle_time();
    }
};

extern "C" {

// ---- datagrams

bool codec_decode(const char* datagram, std::int64_t size, JointReport* report, Unreadable* unreadable) {
    return JointCodec::decode(datagram, std::size_t(size), *report, *unreadable);
}

// The size of the datagram; 0 where a value is not finite.
std::int64_t codec_encode(std::uint32_t seqno, const ArmCommand* command, unsigned char* datagram) {
    return std::int64_t(JointCodec::encode(seqno, *command, datagram));
}

// ---- conversations

SessionHandle* session_new(double silence) {
    try {
        return new SessionHandle(silence);
    } catch (...) {  // no memory
        return nullptr;
    }
}

void session_delete(SessionHandle* handle) { delete handle; }

void session_begin_batch(SessionHandle* handle) {
    handle->egm.session.begin_batch();
    handle->show();
}

bool session_takes(SessionHandle* handle, std::uint32_t seqno, double robot_time, double now) {
    const bool is_taken = handle->egm.session.takes(seqno, robot_time, now);
    handle->show();
    return is_taken;
}

void session_note_malformed(SessionHandle* handle) {
    handle->egm.session.note_malformed();
    handle->show();
}

std::uint32_t session_next_seqno(SessionHandle* handle) { return handle->egm.session.next_seqno(); }

void session_settle(SessionHandle* handle) {
    handle->egm.session.settle();
    handle->show();
}

double session_silence(const SessionHandle* handle, double now) { return handle->egm.session.silence(now); }

bool session_close_if_silent(SessionHandle* handle, double now) {
    const bool is_closed = handle->egm.session.close_if_silent(now);
    handle->show();
    return is_closed;
}

// ---- an arm of the control loop

// Take a datagram, the first and the last of those that wait together, or one between; whether any of them is to be
// answered, which is in `arm` after the last.
bool egm_arm_accept(SessionHandle* handle, const char* datagram, std::int64_t size, double now, bool is_first, bool is_last) {
    if (is_first) handle->egm.session.begin_batch();
    handle->egm.accept(datagram, std::size_t(size), now);
    const bool is_accepted = handle->egm.session.is_accepted();
    if (is_last && is_accepted) handle->arm = handle->egm.state(now);
    if (is_last) handle->show();
    return is_accepted;
}

// The answer to what was accepted last; its size, 0 where a value is not finite.
std::int64_t egm_arm_reply(SessionHandle* handle, const ArmCommand* command, unsigned char* datagram) {
    return std::int64_t(handle->egm.reply(*command, datagram));
}

}  // extern "C"
