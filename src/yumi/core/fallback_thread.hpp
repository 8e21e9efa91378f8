// The thread that answers for controllers that do not: no arm waits for Python.
//
// Python says when it waits for datagrams and when it is busy. Where it is busy, and does not call the core for DEADLINE,
// the thread takes what is not answered, and whatever arrives until Python goes on: each arm brakes within its limits.
// An answer of Python that comes later is dropped; the next one goes on from what was sent. Where that takes
// long, control/loop.py deactivates the controllers afterwards. The thread never takes Python's lock.

#pragma once

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <thread>

#include "arm_handle.hpp"

class FallbackThread {
public:
    FallbackThread() : timer_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)), wake_(eventfd(0, EFD_CLOEXEC)) {
        if (timer_ < 0 || wake_ < 0) {
            close_descriptors();
            throw std::system_error(errno, std::generic_category());
        }
    }
    FallbackThread(const FallbackThread&) = delete;
    ~FallbackThread() {
        if (thread_.joinable()) {
            is_over_ = true;
            const std::uint64_t one = 1;
            if (write(wake_, &one, sizeof one) == sizeof one) thread_.join();
        }
        for (int i = 0; i < count_; ++i) arms_[i]->limiter.last_call = nullptr;
        close_descriptors();
    }

    void add(ArmHandle& arm) {
        arm.limiter.last_call = &last_call_;
        arms_[count_++] = &arm;
    }

    bool start() {
        try {
            thread_ = std::thread([this] { run(); });
            return true;
        } catch (const std::system_error&) {
            return false;
        }
    }

    // Python has found something to do.
    void note_busy() {
        const core::Guard guard(core::lock);
        is_busy_ = true, last_call_ = core::monotonic_now();
        set_timer(DEADLINE);
    }

    // Python waits for datagrams again. What it has left without an answer, since something failed, is answered now.
    void note_waiting() {
        const core::Guard guard(core::lock);
        is_busy_ = false;
        set_timer(0);
        for (int i = 0; i < count_; ++i)
            if (arms_[i]->session.awaits_python) arms_[i]->brake(false);
    }

private:
    static constexpr double DEADLINE = 0.002;  // [s] for Python to call the core again
    static constexpr int GRACE = 1;             // [ms] with what arrives while Python is busy for longer

    void close_descriptors() {
        if (timer_ >= 0) close(timer_);
        if (wake_ >= 0) close(wake_);
    }

    void set_timer(double seconds) {
        const itimerspec once = {{0, 0}, {0, long(seconds * 1e9)}};
        timerfd_settime(timer_, 0, &once, nullptr);  // of a descriptor and times that are sound, which cannot fail
    }

    // Before Python's thread, where both have a priority in real time: one that computes is in the way on its processor.
    static void go_before() {
        sched_param priority;
        int policy;
        if (pthread_getschedparam(pthread_self(), &policy, &priority) != 0) return;
        if (policy != SCHED_FIFO && policy != SCHED_RR) return;
        ++priority.sched_priority;
        pthread_setschedparam(pthread_self(), policy, &priority);  // where that is not permitted it goes beside it
    }

    void run() {
        go_before();
        pollfd waits[2 + 2] = {{wake_, POLLIN, 0}, {timer_, POLLIN, 0}, {}, {}};
        bool is_in_charge = false;
        while (!is_over_) {
            for (int i = 0; i < count_; ++i) waits[2 + i] = {arms_[i]->peer() ? arms_[i]->socket : -1, POLLIN, 0};
            poll(waits, is_in_charge ? nfds_t(2 + count_) : 2, is_in_charge ? GRACE : -1);
            // What has arrived Python may still take: it comes back at any moment.
            if (is_in_charge && (waits[2].revents | waits[3].revents)) poll(waits, 1, GRACE);
            const core::Guard guard(core::lock);
            const double left = is_busy_ ? std::max(last_call_ + DEADLINE - core::monotonic_now(), 0.0) : 0.0;
            set_timer(left);  // which clears the timer, too
            is_in_charge = is_busy_ && left == 0.0;
            if (!is_in_charge) continue;
            for (int i = 0; i < count_; ++i) {
                if (arms_[i]->session.awaits_python) arms_[i]->brake(true);
                arms_[i]->receive_and_brake();
            }
        }
    }

    int timer_, wake_;
    ArmHandle* arms_[2] = {};
    int count_ = 0;
    bool is_busy_ = false;
    double last_call_ = 0.0;  // when Python called the core last, or got busy [s]
    std::atomic<bool> is_over_{false};
    std::thread thread_;
};
