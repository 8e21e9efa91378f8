// EGM as library.py declares it for egm/codec.py and egm/egm_session.py: datagrams and sessions. No exception leaves, and
// nothing is allocated after the start.

#include "egm_codec.hpp"
#include "egm_session.hpp"
#include "lock.hpp"

using namespace core;

extern "C" {

// ---- datagrams

bool codec_decode(const char* datagram, std::int64_t size, JointReport* report, Unreadable* unreadable) {
    return JointCodec::decode(datagram, std::size_t(size), *report, *unreadable);
}

// The size of the datagram; 0 where a value is not finite.
std::int64_t codec_encode(std::uint32_t seqno, const ArmCommand* command, unsigned char* datagram) {
    return std::int64_t(JointCodec::encode(seqno, *command, datagram));
}

bool codec_is_running(std::int64_t motors, std::int64_t mci, std::int64_t rapid) {
    return is_running(motors, mci, rapid);
}

// ---- sessions

Session* session_new(double silence) { return made<Session>(silence); }

void session_delete(Session* session) { delete session; }

// Of a session whose datagrams Python reads, which no other thread has.

void session_begin_batch(Session* session) { session->begin_batch(); }

bool session_takes(Session* session, std::uint32_t seqno, double robot_time, double now) {
    return session->takes(seqno, robot_time, now);
}

void session_note_malformed(Session* session) { ++session->counters.malformed; }

std::uint32_t session_next_seqno(Session* session) { return session->next_seqno(); }

void session_settle(Session* session) { session->settle(); }

// Of any session.

double session_silence(const Session* session, double now) {
    const Guard guard(lock);
    return session->silence(now);
}

bool session_close_if_silent(Session* session, double now) {
    const Guard guard(lock);
    return session->close_if_silent(now);
}

}  // extern "C"
