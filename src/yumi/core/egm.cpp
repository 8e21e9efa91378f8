// EGM as library.py declares it for egm/codec.py and egm/session.py: datagrams, sessions, and both together for the
// control loop. No exception leaves, and nothing is allocated after the start.

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

// ---- an arm of the control loop

// Take a datagram, the first and the last of those that wait together, or one between; whether any of them is to be
// answered, which is in `arm` after the last.
bool egm_arm_accept(SessionHandle* handle, const char* datagram, std::int64_t size, double now, bool is_first,
                    bool is_last) {
    const Guard guard(lock);
    if (is_first) handle->egm.session.begin_batch();
    handle->egm.accept(datagram, std::size_t(size), now);
    if (is_last) handle->end_batch(now, true);
    return handle->egm.session.is_accepted();
}

// Python's answer to what it accepted last; its size, 0 where a value is not finite, and -1 where the core has answered
// something newer meanwhile.
std::int64_t egm_arm_reply(SessionHandle* handle, const ArmCommand* command, unsigned char* datagram) {
    const Guard guard(lock);
    if (handle->cycle != handle->pythons) return -1;
    handle->awaits_python = false;
    return std::int64_t(handle->egm.reply(*command, datagram));
}

}  // extern "C"
