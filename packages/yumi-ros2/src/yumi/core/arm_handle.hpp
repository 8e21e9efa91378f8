// One arm of the control loop: what waits in its socket becomes a state, what its controllers want becomes the answer.
//
// In each cycle Python calls receive, reply, and after the replies of both arms settle. Where Python does not, the
// fallback thread answers. Where the controller's formula is known here, the answer has left before Python is woken.

#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <optional>
#include <utility>

#include "egm_codec.hpp"
#include "egm_session.hpp"
#include "limiter_handle.hpp"
#include "sampled.hpp"

// What Python reads of a cycle; as ArmExchange in library.py.
struct ArmExchange {
    // When a cycle began that the core has sampled, and when its stages ended [s]; sampled_at is 0 of other cycles.
    double begun_at = 0.0, received_at = 0.0, checked_at = 0.0, sampled_at = 0.0, limited_at = 0.0, encoded_at = 0.0,
           sent_at = 0.0;
    std::int64_t send_error = 0;     // errno of the answer, 0 where the answer has left
    std::int64_t answer_size = 0;    // 0 where a value of the command is not finite
    std::int64_t datagram_size = 0;  // of the robot's newest
    std::int64_t foreign = 0;        // datagrams of other senders that waited when the robot began
    unsigned char answer[core::LARGEST_REFERENCE];
    unsigned char datagram[2048];
};

// A cycle that the fallback thread has answered; as BRAKED in library.py.
struct BrakedCycle {
    core::ArmState state;
    core::ArmCommand command;
};

struct ArmHandle {
    // What became of the datagrams that waited.
    enum Verdict : std::int64_t {
        NONE,       // none of them counts
        UNSAFE,     // one counts, and no answer is safe
        TO_ANSWER,  // one is to be answered: its state is in the limiter's exchange
    };

    static constexpr std::int64_t MOST_BRAKED = 250;  // cycles that are kept for Python: a second

    ArmExchange exchange;
    LimiterHandle& limiter;
    const int socket;             // -1 where Python reads and sends
    bool awaits_python = false;   // whether the state that was checked last waits for Python's answer
    double* last_call = nullptr;  // when Python called the core last, where the fallback thread is to know
    std::optional<core::Sampled> prepared;  // what answers the next datagram, where nothing about that is unusual

    ArmHandle(LimiterHandle& limits, core::Session& sessions, int descriptor)
        : limiter(limits), socket(descriptor), session_(sessions) {}

    // Act for Python; what takes the core long is no fault of a controller.
    template <typename Act>
    std::int64_t act_for_python(Act action) {
        const core::Guard guard(core::lock);
        const std::int64_t result = limiter.act(action);
        if (result < 0) awaits_python = false;  // the program is wrong: the cycle gets no answer
        if (last_call) *last_call = core::monotonic_now();
        return result;
    }

    // For Python: take what waits in the socket.
    std::int64_t receive(double now) {
        if (forbidden_ >= 0) throw core::ForbiddenTransition{core::Event(std::exchange(forbidden_, -1))};
        if (received_) return *std::exchange(received_, std::nullopt);
        prepared.reset(), begins_ = false;
        // Of a robot that is on time nothing else can wait behind the first, and another look would cost time.
        const bool has_any = take_waiting(now, is_punctual(now) ? 1 : MOST, true);
        return has_any ? check_batch(now) : std::int64_t(NONE);
    }

    // While Python waits: answer what waits in the socket as it was prepared. Python hears of that by receive and
    // reply, which have nothing to do then. Of a robot that is late, a session that begins and the like Python knows
    // first.
    void answer_prepared() {
        const std::optional<core::Sampled> formula = std::exchange(prepared, std::nullopt);
        const double now = core::monotonic_now();
        if (!formula || !is_punctual(now)) return;
        exchange.begun_at = now;
        const std::int64_t done = act_for_python([&]() -> std::int64_t {
            received_ = receive(now);
            if (*received_ != TO_ANSWER || session_.state != core::Session::OPEN) return 0;
            const std::optional<core::ArmCommand> desired = formula->command(limiter.exchange.state);
            exchange.sampled_at = core::monotonic_now();
            if (desired) answer(&*desired, true), is_sampled_ = true;
            return 0;
        });
        if (done < 0) received_ = done, forbidden_ = limiter.exchange.forbidden;  // receive raises it
    }

    // Python waits again: what it has left without an answer, since something failed, is answered now.
    void begin_wait() {
        if (awaits_python) brake(false);
        if (is_sampled_) keep_braked();  // of which Python has not heard
        received_.reset(), is_sampled_ = false;
    }

    // For Python: take a datagram that it has read: the first or the last of those that wait together, or one between.
    std::int64_t accept(const char* datagram, std::size_t size, double now, bool is_first, bool is_last) {
        if (is_first) session_.begin_batch(), exchange.received_at = core::monotonic_now();
        take(datagram, size, now);
        if (!is_last) return NONE;
        keep(datagram, size);
        return check_batch(now);
    }

    // For Python: the answer to the state that was received, which leaves where the core sends it. Without a desired
    // command the arm holds. False where the fallback thread has answered.
    bool reply(const core::ArmCommand* desired, bool sends) {
        if (is_sampled_) return !(is_sampled_ = false);
        if (!awaits_python) return false;
        exchange.sampled_at = 0.0;
        answer(desired, sends);
        return true;
    }

    // For Python: after the reply.
    void settle() {
        if (is_unobserved_) observe();
        session_.settle();
    }

    // For the fallback thread: take what has arrived, and answer. Of a session that ended by a silence, or has begun,
    // Python has to know first: the controllers are of the one before.
    void receive_and_brake() {
        const double arrival = core::monotonic_now();
        if (begins_ || !peer() || session_.is_lost(arrival)) return;
        if (!take_waiting(arrival, MOST, false)) return;
        end_batch(arrival, false);
        begins_ = session_.state == core::Session::BEGUN;
        if (session_.is_accepted && !begins_) brake(true);
    }

    // Answer so that the arm brakes within its limits, since Python has not in time, or has failed to.
    void brake(bool is_unanswered) {
        const std::int64_t done = limiter.act([&] {
            if (is_sampled_) keep_braked();  // of which Python has not heard
            received_.reset(), is_sampled_ = false;
            if (!awaits_python && !check()) return 0;
            limit(nullptr, is_unanswered);
            unsigned char answer[core::LARGEST_REFERENCE];
            const std::size_t size = encode(answer);
            if (size) send(socket, answer, size, MSG_DONTWAIT | MSG_NOSIGNAL);  // what cannot leave is lost
            observe();
            if (is_unanswered) keep_braked();
            return 0;
        });
        if (done < 0) forbidden_ = limiter.exchange.forbidden;
        awaits_python = false;
        session_.settle();
    }

    // For Python: the newest cycles that the fallback thread has answered since the last call, oldest first; how many.
    std::int64_t take_braked(BrakedCycle* cycles) {
        const std::int64_t count = std::min(braked_count_, MOST_BRAKED);
        for (std::int64_t i = 0; i < count; ++i) cycles[i] = braked_[(braked_count_ - count + i) % MOST_BRAKED];
        braked_count_ = 0;
        return count;
    }

    // The arm's robot where it is known: the socket is connected to it then.
    std::optional<sockaddr_in> peer() const {
        sockaddr_in found;
        socklen_t size = sizeof found;
        if (getpeername(socket, reinterpret_cast<sockaddr*>(&found), &size) != 0) return std::nullopt;
        return found;
    }

private:
    static constexpr int MOST = 256;  // datagrams read at once: whatever arrives, the caller goes on after a while
    static constexpr double SOONEST = 0.5 * core::CYCLE, LATEST = 1.25 * core::CYCLE;  // [s] between two

    bool is_punctual(double now) {
        const double silence = session_.silence(now);
        return SOONEST < silence && silence < LATEST;
    }

    // Take up to so many datagrams into the session; whether there was any.
    bool take_waiting(double now, int most, bool for_python) {
        session_.begin_batch();
        const std::optional<sockaddr_in> robot = peer();
        unsigned char datagram[sizeof exchange.datagram];
        bool has_any = false;
        for (int i = 0; i < most; ++i) {
            sockaddr_in from;
            socklen_t size_of_from = sizeof from;
            const ssize_t size = recvfrom(socket, datagram, sizeof datagram, MSG_DONTWAIT,
                                          reinterpret_cast<sockaddr*>(&from), &size_of_from);
            if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) break;
            if (size < 0) continue;  // an error of an earlier answer says nothing of what waits here
            if (!robot || from.sin_addr.s_addr != robot->sin_addr.s_addr || from.sin_port != robot->sin_port) {
                ++exchange.foreign;  // it waited when the socket was connected
                continue;
            }
            if (for_python) exchange.received_at = core::monotonic_now(), keep(datagram, std::size_t(size));
            take(datagram, std::size_t(size), now);
            has_any = true;
        }
        return has_any;
    }

    // Take a datagram into the session.
    void take(const void* datagram, std::size_t size, double now) {
        core::JointReport report;
        core::Unreadable unreadable;
        if (!core::JointCodec::decode(datagram, size, report, unreadable))
            ++session_.counters.malformed;
        else if (session_.takes(std::uint32_t(report.seqno), report.time, now))
            newest_ = report;
    }

    void keep(const void* datagram, std::size_t size) {
        exchange.datagram_size = std::int64_t(std::min(size, sizeof exchange.datagram));
        std::memcpy(exchange.datagram, datagram, std::size_t(exchange.datagram_size));
    }

    // The last of the datagrams that waited together was taken: what is to be answered, and whether by Python.
    void end_batch(double now, bool for_python) {
        if (!session_.is_accepted) return;
        const core::Values before = reported_.position;
        reported_ = {now, session_.period, session_.number, newest_.measured, {}, newest_.planned,
                     core::is_running(newest_.motors, newest_.mci, newest_.rapid)};
        if (reported_.dt > 0.0) reported_.velocity = core::rate_of(reported_.position, before, reported_.dt);
        awaits_python = for_python;
    }

    std::int64_t check_batch(double now) {
        end_batch(now, true);
        if (!session_.is_accepted) return NONE;
        const bool is_safe = check();
        exchange.checked_at = core::monotonic_now();
        return is_safe ? TO_ANSWER : UNSAFE;
    }

    // Check the state that was reported, which is in the limiter's exchange then; whether a reply is safe.
    bool check() {
        if (is_unobserved_) observe();  // of the cycle before
        limiter.exchange.state = reported_;
        const bool is_safe = limiter.limiter.check(limiter.exchange.state);
        awaits_python = awaits_python && is_safe;
        return is_safe;
    }

    void answer(const core::ArmCommand* desired, bool sends) {
        limit(desired, false);
        exchange.limited_at = core::monotonic_now();
        const std::size_t size = encode(exchange.answer);
        exchange.encoded_at = core::monotonic_now();
        exchange.answer_size = std::int64_t(size);
        const bool has_left = !sends || !size || send(socket, exchange.answer, size, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
        exchange.send_error = has_left ? 0 : errno;
        exchange.sent_at = core::monotonic_now();
    }

    void limit(const core::ArmCommand* desired, bool is_unanswered) {
        limiter.exchange.command = limiter.limiter.limit(limiter.exchange.state, desired, is_unanswered);
        awaits_python = false, is_unobserved_ = true;
    }

    std::size_t encode(unsigned char* answer) {
        return core::JointCodec::encode(session_.next_seqno(), limiter.exchange.command, answer);
    }

    void observe() {
        limiter.limiter.observe(limiter.exchange.state);
        is_unobserved_ = false;
    }

    void keep_braked() {
        braked_[braked_count_++ % MOST_BRAKED] = {limiter.exchange.state, limiter.exchange.command};
    }

    core::Session& session_;
    core::JointReport newest_;  // of those that count
    core::ArmState reported_;
    bool is_unobserved_ = false;  // whether the reply was sent, and not observed yet
    std::optional<std::int64_t> received_;  // the verdict on a datagram of which Python has not heard
    // the event that the table forbade while Python waited or was busy; nothing was done on it, and receive raises it
    std::int64_t forbidden_ = -1;
    bool is_sampled_ = false;               // whether that was answered, too, of which Python has not heard
    bool begins_ = false;         // whether a session has begun of which Python does not know
    std::int64_t braked_count_ = 0;
    BrakedCycle braked_[MOST_BRAKED];  // last, so that what each cycle uses lies close together
};
