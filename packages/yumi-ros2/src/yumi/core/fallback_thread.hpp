// The thread that answers for controllers that do not: no arm waits for Python.
//
// Python says when it waits for datagrams and when it is busy. Where it is busy, and does not call the core in time, the
// thread takes what is not answered, and whatever arrives until Python goes on: each arm brakes within its limits. An
// answer of Python that comes later is dropped; the next one goes on from what was sent. Where that takes long,
// control/loop.py deactivates the controllers afterwards. The thread never takes Python's lock.

#pragma once

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <thread>

#include "arm_handle.hpp"

class FallbackThread {
public:
    double deadline = 0.002;  // [s] for Python to call the core again; changed with the lock

    FallbackThread() : timer_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) {
        if (timer_ < 0) throw std::system_error(errno, std::generic_category());
    }
    FallbackThread(const FallbackThread&) = delete;
    ~FallbackThread() {
        if (thread_.joinable()) {
            {
                const core::Guard guard(core::lock);
                is_over_ = true;
                set_timer(1e-9);
            }
            thread_.join();
        }
        for (int i = 0; i < count_; ++i) arms_[i]->last_call = nullptr;
        close(timer_);
    }

    void add(ArmHandle& arm) {
        arm.last_call = &last_call_;
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
        set_timer(deadline);
    }

    // Python waits for datagrams again.
    void note_waiting() {
        const core::Guard guard(core::lock);
        is_busy_ = false;
        set_timer(0);
        for (int i = 0; i < count_; ++i) arms_[i]->begin_wait();
    }

    // Python waits until a datagram can be read, or something else, at most so many milliseconds. What is prepared is
    // answered at once. Returns a bit for each arm that is to be looked at, and the next one for what else can be read.
    std::int64_t wait(int other, int milliseconds) {
        note_waiting();
        pollfd waits[2 + 1] = {{-1, POLLIN, 0}, {-1, POLLIN, 0}, {other, POLLIN, 0}};
        for (int i = 0; i < count_; ++i) waits[i].fd = arms_[i]->socket;
        poll(waits, 2 + 1, milliseconds);
        const core::Guard guard(core::lock);
        is_busy_ = true;  // the timer comes after the answers, which it need not wait for
        std::int64_t found = answer_prepared(waits);
        // The datagrams of both arms come close together: the second one often while the first is answered.
        if (found == 1 || found == 2) poll(waits, 2, 0), found |= answer_prepared(waits);
        note_busy();
        return found | (waits[2].revents != 0) << 2;
    }

private:
    static constexpr int GRACE = 1;  // [ms] with what arrives while Python is busy for longer

    // Answer the arms that can be read as it was prepared, and wait for them no more; returns a bit for each.
    std::int64_t answer_prepared(pollfd* waits) {
        std::int64_t found = 0;
        for (int i = 0; i < count_; ++i) {
            if (!waits[i].revents) continue;
            arms_[i]->answer_prepared();
            waits[i].fd = -1, found |= 1 << i;
        }
        return found;
    }

    void set_timer(double seconds) {
        const itimerspec once = {{0, 0}, {long(seconds), long((seconds - long(seconds)) * 1e9)}};
        timerfd_settime(timer_, 0, &once, nullptr);  // of a descriptor and times that are sound, which cannot fail
    }

    // Before Python's thread, where both have a priority in real time: one that computes is in the way on its
    // processor.
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
        pollfd waits[1 + 2] = {{timer_, POLLIN, 0}, {}, {}};
        bool is_in_charge = false;
        while (true) {
            for (int i = 0; i < count_; ++i) waits[1 + i] = {arms_[i]->peer() ? arms_[i]->socket : -1, POLLIN, 0};
            poll(waits, is_in_charge ? nfds_t(1 + count_) : 1, is_in_charge ? GRACE : -1);
            // What has arrived Python may still take: it comes back at any moment.
            if (is_in_charge && (waits[1].revents | waits[2].revents)) poll(waits, 1, GRACE);
            const core::Guard guard(core::lock);
            if (is_over_) return;
            const double left = is_busy_ ? std::max(last_call_ + deadline - core::monotonic_now(), 0.0) : 0.0;
            set_timer(left);  // which clears the timer, too
            is_in_charge = is_busy_ && left == 0.0;
            if (!is_in_charge) continue;
            for (int i = 0; i < count_; ++i) {
                arms_[i]->prepared.reset();  // Python may have to deactivate the controllers first
                if (arms_[i]->awaits_python) arms_[i]->brake(true);
                arms_[i]->receive_and_brake();
            }
        }
    }

    int timer_;
    ArmHandle* arms_[2] = {};
    int count_ = 0;
    bool is_busy_ = false;
    double last_call_ = 0.0;  // when Python called the core last, or got busy [s]
    bool is_over_ = false;
    std::thread thread_;
};
