// Which command a robot follows, of those that were sent.

#include "check.hpp"
#include "references.hpp"
#include "robot.hpp"

namespace {

constexpr double STEP = 0.008;  // [rad] a command goes on in a cycle
constexpr int LATE = 8, LOST_AFTER = 3;  // cycles

core::ArmCommand command(double angle) { return {joint_1(angle), {}, false}; }

// A robot that follows the command it is given, and a monitor that sees its plan.
struct Robot {
    core::ReferenceMonitor monitor{core::EGM_GAIN, YUMI.velocity, core::CYCLE, 0.0};
    core::ArmState state = standing();

    Robot() {
        state.dt = 0.0;
        monitor.begin(state, command(0.0));
    }
    void cycle(const core::ArmCommand& followed, const core::ArmCommand& sent) {
        const double left = std::exp(-core::EGM_GAIN * core::CYCLE);
        state.planned = core::added(followed.position, -left, core::added(followed.position, -1.0, state.planned));
        state.position = state.planned;
        state.time += core::CYCLE, state.dt = core::CYCLE;
        monitor.compare(&state);
        monitor.observe(state, sent, true, false, false);
    }
};

void follow_late(int late) {
    Robot robot;
    for (int i = 1; i < 100; ++i) {
        robot.cycle(command(STEP * std::max(0, i - late)), command(STEP * i));
        CHECK(i <= 2 * LATE || !robot.monitor.is_repeating());
    }
}

}  // namespace

TEST(robot_that_follows_each_command_a_cycle_late_repeats_none) { follow_late(1); }
TEST(robot_that_follows_each_command_some_cycles_late_repeats_none) { follow_late(LATE); }

TEST(robot_repeats_a_command_after_more_cycles_where_each_command_shows_late) {
    Robot robot;
    int i = 1;
    for (; i < 50; ++i) robot.cycle(command(STEP * std::max(0, i - LATE)), command(STEP * i));
    for (; i < 50 + LOST_AFTER; ++i) {
        robot.cycle(command(STEP * (49 - LATE)), command(STEP * i));
        CHECK(!robot.monitor.is_repeating());
    }
    for (; i < 50 + LOST_AFTER + LATE; ++i) robot.cycle(command(STEP * (49 - LATE)), command(STEP * i));
    CHECK(robot.monitor.is_repeating());
}

TEST(plan_that_looks_now_like_one_of_two_old_commands_now_like_the_other_shows_no_new_one) {
    Robot robot;
    for (int i = 1; i < 20; ++i) robot.cycle(command(STEP * (i - 1)), command(STEP * i));
    const double followed = STEP * 19;
    std::vector<core::ArmCommand> sent;  // they go on, come back, and go on
    for (int i = 20; i < 28; ++i) sent.push_back(command(STEP * i));
    for (int i = 27; i >= 20; --i) sent.push_back(command(STEP * i));
    sent.push_back(command(followed + 4.4e-4));  // nearly as alike as commands are that make the same
    for (int i = 20; i < 30; ++i) sent.push_back(command(STEP * i));
    for (const core::ArmCommand& each : sent)
        for (double noise : {5e-5, -5e-5}) robot.cycle(command(followed + noise), each);
    CHECK(robot.monitor.is_repeating());
}

TEST(more_commands_than_are_remembered_are_compared_all_the_same) {
    Robot robot;
    for (int i = 1; i < 200; ++i) robot.cycle(command(0.0), command(STEP * i));
    CHECK(robot.monitor.is_repeating());
    CHECK(robot.monitor.followed() == command(0.0));
    CHECK(robot.monitor.are_ignored);
}
