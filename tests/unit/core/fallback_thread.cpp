// The thread that answers while the other one is busy: each datagram once, and in time.

#include <arpa/inet.h>
#include <poll.h>

#include <functional>
#include <random>

#include "check.hpp"
#include "robot.hpp"
#include "fallback_thread.hpp"

// No part of an arm is near anything.
extern "C" bool collisions_is_slow(const collision::Limiter*, const collision::Motion*) { return false; }
extern "C" bool collisions_is_clear(collision::Limiter*, std::int64_t, const collision::Motion*, const collision::Motion*,
                                    const collision::Motion*, double, std::int64_t, collision::Decision*) {
    return true;
}

thread_local std::function<void()> after_poll;  // what happens once, as soon as this thread has waited

extern "C" int poll(pollfd* waits, nfds_t count, int milliseconds) {
    const timespec most{milliseconds / 1000, milliseconds % 1000 * 1'000'000L};
    const int found = ppoll(waits, count, milliseconds < 0 ? nullptr : &most, nullptr);
    if (const auto happens = std::exchange(after_poll, nullptr)) happens();
    return found;
}

namespace {

core::StateTable table() {
    core::StateTable all{};
    for (auto& row : all.next) {
        std::fill(row, row + core::EVENTS, std::int8_t(core::HOLDING));
        row[core::SESSION_NEW] = core::BEGINNING, row[core::DESIRED] = core::FOLLOWING;
    }
    return all;
}

int bound_socket(sockaddr_in& own) {
    const int descriptor = socket(AF_INET, SOCK_DGRAM, 0);
    own = {};
    own.sin_family = AF_INET, own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof own;
    CHECK(bind(descriptor, reinterpret_cast<sockaddr*>(&own), size) == 0);
    CHECK(getsockname(descriptor, reinterpret_cast<sockaddr*>(&own), &size) == 0);
    return descriptor;
}

// A robot and our end of its wire, which has the thread beside it.
struct Wire {
    sockaddr_in ours_at, robots_at;
    int ours = bound_socket(ours_at), robots = bound_socket(robots_at);
    core::Session session{0.5};
    LimiterHandle limiter{{YUMI, YUMI.velocity, core::CYCLE, core::EGM_GAIN, 0.0}, table(), nullptr};
    ArmHandle arm{limiter, session, ours};
    FallbackThread thread;
    std::uint32_t seqno = 0;
    unsigned seconds = 1000;  // of the robot's clock, when its session began

    Wire() {
        CHECK(connect(ours, reinterpret_cast<sockaddr*>(&robots_at), sizeof robots_at) == 0);
        CHECK(connect(robots, reinterpret_cast<sockaddr*>(&ours_at), sizeof ours_at) == 0);
        thread.add(arm);
        CHECK(thread.start());
    }
    ~Wire() { close(ours), close(robots); }

    void robot_sends() {
        using Bytes = std::vector<unsigned char>;
        auto field = [](int number, const Bytes& inside) {
            Bytes bytes = {static_cast<unsigned char>(number << 3 | 2), static_cast<unsigned char>(inside.size())};
            bytes.insert(bytes.end(), inside.begin(), inside.end());
            return bytes;
        };
        auto add = [](Bytes& bytes, const Bytes& more) { bytes.insert(bytes.end(), more.begin(), more.end()); };
        Bytes axes;
        for (int i = 0; i < 6; ++i) add(axes, {0x09, 0, 0, 0, 0, 0, 0, 0, 0});
        auto varint = [](unsigned value) {
            return Bytes{static_cast<unsigned char>(value | 0x80), static_cast<unsigned char>((value >> 7 & 0x7F) | 0x80),
                         static_cast<unsigned char>(value >> 14 & 0x7F)};
        };
        Bytes clock = {0x08}, header = {0x08}, motion = field(1, axes);
        const unsigned passed = seqno * 4032;  // [µs]
        add(clock, varint(seconds + passed / 1'000'000)), add(clock, {0x10}), add(clock, varint(passed % 1'000'000));
        add(header, varint(seqno)), add(header, {0x18, 2});
        add(motion, field(3, {0x09, 0, 0, 0, 0, 0, 0, 0, 0})), add(motion, field(4, clock));
        Bytes datagram = field(1, header);
        for (int part : {2, 3}) add(datagram, field(part, motion));
        add(datagram, field(4, {0x08, 1})), add(datagram, field(5, {0x08, 3})), add(datagram, field(8, {0x08, 2}));
        CHECK(send(robots, datagram.data(), datagram.size(), 0) == ssize_t(datagram.size()));
        ++seqno;
    }

    // Whether an answer comes within so many milliseconds.
    bool is_answered(int patience) const {
        pollfd waits = {robots, POLLIN, 0};
        unsigned char datagram[256];
        return poll(&waits, 1, patience) == 1 && recv(robots, datagram, sizeof datagram, 0) > 0;
    }

    // What Python does with a datagram: takes it, and answers it unless the thread has.
    void take() {
        arm.act_for_python([&] { return arm.receive(core::monotonic_now()); });
    }
    bool answer() {
        const core::Guard guard(core::lock);
        return arm.act_for_python([&]() -> std::int64_t {
            if (!arm.reply(nullptr, true)) return 0;
            arm.settle();
            return 1;
        });
    }
    std::int64_t unanswered() {
        const core::Guard guard(core::lock);
        return limiter.exchange.counters.unanswered;
    }
};

}  // namespace

TEST(datagram_is_answered_while_the_other_thread_is_busy) {
    Wire wire;
    wire.robot_sends(), wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
    wire.robot_sends(), wire.take();
    wire.thread.note_busy();
    CHECK(wire.is_answered(1000));  // what was taken
    CHECK(!wire.answer());          // which comes too late
    wire.robot_sends();
    CHECK(wire.is_answered(1000));  // what was not
    CHECK(wire.unanswered() == 2);
    wire.thread.note_waiting();
    wire.robot_sends();
    CHECK(!wire.is_answered(20));  // now the other thread is asked
    wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
    CHECK(wire.unanswered() == 2);
}

TEST(what_is_left_without_an_answer_is_answered_when_the_other_thread_waits) {
    Wire wire;
    wire.thread.note_busy();
    wire.robot_sends(), wire.take();
    wire.thread.note_waiting();
    CHECK(wire.is_answered(1000));
    CHECK(wire.unanswered() == 0);  // it was in time
}

TEST(no_session_begins_while_the_other_thread_is_busy) {
    Wire wire;
    wire.robot_sends(), wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
    wire.thread.note_busy();
    wire.robot_sends();
    CHECK(wire.is_answered(1000));
    wire.seqno = 0, wire.seconds += 10;  // the robot begins anew
    wire.robot_sends();
    CHECK(!wire.is_answered(50));
    wire.robot_sends();
    CHECK(!wire.is_answered(50));
    wire.thread.note_waiting();
    wire.take();
    CHECK(wire.session.number == 2);
    CHECK(!wire.answer());  // one look at the robot may be at a late datagram
    wire.robot_sends(), wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
}

TEST(each_datagram_is_answered_once_however_both_threads_meet) {
    Wire wire;
    std::mt19937 random(5);
    for (int round = 0; round < 400; ++round) {
        wire.thread.note_busy();
        wire.robot_sends();
        if (random() % 3) wire.take();
        const auto pause = timespec{0, long(random() % 4'000'000)};
        nanosleep(&pause, nullptr);
        wire.take();
        wire.answer();
        wire.thread.note_waiting();
        CHECK(wire.is_answered(1000));
    }
    CHECK(!wire.is_answered(20));
    const std::int64_t count = wire.unanswered();
    CHECK(20 < count && count < 380);
}

namespace {

// A robot that stands at zero and sends in its cycle; what is prepared is a proportional formula. The other thread is
// in time, whatever the machine does, until it is given less time.
struct PreparedWire : Wire {
    core::SharedGoal goals{0, 0, 0, 0.0, std::nan(""), {}, {}};
    core::Sampled formula{1, &goals, 0, false, joint_1(0.002), {}};  // so near that it is no wonder that the robot stands

    PreparedWire() {
        give(60.0);
        formula.gain.fill(0.5);
        for (int cycle = 0; cycle < 3; ++cycle) CHECK(is_taken_and_answered());
    }
    void give(double seconds) {
        const core::Guard guard(core::lock);
        thread.deadline = seconds;
    }
    void prepare(std::optional<core::Sampled> prepared) {
        const core::Guard guard(core::lock);
        arm.prepared = prepared;
    }
    // What a wait for the robot's next datagram, a cycle later, returns.
    std::int64_t come(long after = 3'500'000, std::optional<core::Sampled> prepared = std::nullopt) {
        const timespec pause{0, after};
        nanosleep(&pause, nullptr);
        robot_sends();
        prepare(prepared);  // just before the wait, as Python does it
        return thread.wait(-1, 1000);
    }
    bool is_taken_and_answered() {
        const bool has_come = come() == 1;
        take();
        return has_come && answer() && is_answered(1000);
    }
    // Whether the robot's next datagram is answered while the other thread waits, which has nothing to do then.
    bool is_sampled(long after = 3'500'000) {
        come(after, formula);
        if (!is_answered(0)) return false;
        take();
        if (!answer() || is_answered(0)) return false;
        const core::Guard guard(core::lock);
        return arm.exchange.sampled_at > 0.0;
    }
    // Whether joint 1 is sent there by datagrams that are answered so. Where the machine is late, they are taken.
    bool comes_to(double goal) {
        for (int cycle = 0, sampled = 0; cycle < 2000; ++cycle) {
            if (is_sampled()) {
                const core::Guard guard(core::lock);
                if (++sampled > 50 && std::abs(limiter.exchange.command.position[0] - goal) < 1e-9) return true;
            } else {
                take(), answer(), is_answered(5);
            }
        }
        return false;
    }
};

}  // namespace

TEST(datagram_is_answered_by_the_formula_that_was_prepared) {
    PreparedWire wire;
    CHECK(wire.comes_to(0.001));
    wire.formula.goes_there = true;
    CHECK(wire.comes_to(0.002));
}

TEST(formula_that_was_prepared_takes_the_newest_goal_of_its_session) {
    core::SharedGoal goals{2, 2, 7, 0.0, std::nan(""), joint_1(0.2), {}};
    core::ArmState state = standing();
    core::Sampled formula{state.session, &goals, 1, true, joint_1(0.1), {}};
    CHECK(formula.command(state)->position == joint_1(0.1));  // a goal for another session
    state.session = 7;
    CHECK(!formula.command(state));  // the controller was not asked in this one
    formula.session = 7;
    CHECK(formula.command(state)->position == joint_1(0.2));
    formula.taken = 2;
    CHECK(formula.command(state)->position == joint_1(0.1));  // one that was taken, and is not in force any more
    goals.begun = 3;
    CHECK(!formula.command(state));
}

TEST(datagram_that_comes_late_or_without_a_formula_is_left_to_the_other_thread) {
    PreparedWire wire;
    CHECK(wire.come() == 1);
    CHECK(!wire.is_answered(0));
    wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
    CHECK(!wire.is_sampled(20'000'000));
    wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
    wire.goals.begun = 1;  // a goal is being written
    CHECK(!wire.is_sampled());
    wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
}

TEST(formula_that_was_prepared_is_forgotten_while_the_other_thread_is_busy) {
    PreparedWire wire;
    wire.robot_sends(), wire.take();
    CHECK(wire.answer());
    CHECK(wire.is_answered(1000));
    wire.prepare(wire.formula);
    wire.give(0.002);
    wire.thread.note_busy();
    wire.robot_sends();
    CHECK(wire.is_answered(1000));
    const core::Guard guard(core::lock);
    CHECK(!wire.arm.prepared);  // its controller may have to be deactivated first
}

TEST(what_was_sampled_is_recorded_where_the_other_thread_does_not_hear_of_it) {
    PreparedWire wire;
    wire.give(0.002);
    wire.come(3'500'000, wire.formula);
    const bool is_sampled = wire.is_answered(0);
    wire.robot_sends();
    CHECK(wire.is_answered(1000));  // the other thread has been busy since
    CHECK(!wire.answer());
    BrakedCycle cycles[ArmHandle::MOST_BRAKED];
    const core::Guard guard(core::lock);
    CHECK(wire.arm.take_braked(cycles) == 1 + is_sampled);
}

TEST(datagram_that_comes_while_the_other_arm_is_answered_is_found_by_the_same_wait) {
    Wire right, left;
    FallbackThread both;
    both.add(right.arm), both.add(left.arm);
    for (Wire* first : {&right, &left}) {
        Wire* second = first == &right ? &left : &right;
        first->robot_sends();
        after_poll = [&] { second->robot_sends(); };
        CHECK(both.wait(-1, 1000) == 3);
        right.take(), left.take();
        CHECK(both.wait(-1, 0) == 0);
    }
}
