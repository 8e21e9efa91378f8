// EGM as library.py declares it for egm/codec.py and egm/egm_session.py: datagrams and sessions. No exception leaves, and
// nothing is allocated after the start.

#include "egm_codec.hpp"
#include "session_handle.hpp"

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

SessionHandle* session_new(double silence) { return made<SessionHandle>(silence); }

void session_delete(SessionHandle* handle) { delete handle; }

void session_begin_batch(SessionHandle* handle) {
    handle->act([](Session& session) { session.begin_batch(); });
}

bool session_takes(SessionHandle* handle, std::uint32_t seqno, double robot_time, double now) {
    return handle->act([&](Session& session) { return session.takes(seqno, robot_time, now); });
}

void session_note_malformed(SessionHandle* handle) {
    handle->act([](Session& session) { session.note_malformed(); });
}

std::uint32_t session_next_seqno(SessionHandle* handle) {
    return handle->act([](Session& session) { return session.next_seqno(); });
}

void session_settle(SessionHandle* handle) {
    handle->act([](Session& session) { session.settle(); });
}

double session_silence(SessionHandle* handle, double now) {
    return handle->act([&](Session& session) { return session.silence(now); });
}

bool session_close_if_silent(SessionHandle* handle, double now) {
    return handle->act([&](Session& session) { return session.close_if_silent(now); });
}

}  // extern "C"
