// EGM as library.py declares it for egm/codec.py and egm/session.py: datagrams and sessions. No exception leaves, and
// nothing is allocated after the start.

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

// ---- sessions

SessionHandle* session_new(double silence) {
    try {
        return new SessionHandle(silence);
    } catch (...) {  // no memory
        return nullptr;
    }
}

void session_delete(SessionHandle* handle) { delete handle; }

void session_begin_batch(SessionHandle* handle) {
    const Guard guard(lock);
    handle->egm.session.begin_batch();
    handle->show();
}

bool session_takes(SessionHandle* handle, std::uint32_t seqno, double robot_time, double now) {
    const Guard guard(lock);
    const bool is_taken = handle->egm.session.takes(seqno, robot_time, now);
    handle->show();
    return is_taken;
}

void session_note_malformed(SessionHandle* handle) {
    const Guard guard(lock);
    handle->egm.session.note_malformed();
    handle->show();
}

std::uint32_t session_next_seqno(SessionHandle* handle) {
    const Guard guard(lock);
    return handle->egm.session.next_seqno();
}

void session_settle(SessionHandle* handle) {
    const Guard guard(lock);
    handle->egm.session.settle();
    handle->show();
}

double session_silence(const SessionHandle* handle, double now) {
    const Guard guard(lock);
    return handle->egm.session.silence(now);
}

bool session_close_if_silent(SessionHandle* handle, double now) {
    const Guard guard(lock);
    const bool is_closed = handle->egm.session.close_if_silent(now);
    handle->show();
    return is_closed;
}

}  // extern "C"
