// Steps of positions: what is smooth passes, what brakes comes to rest where it was foretold, and nothing is kept.

#include <random>

#include "check.hpp"
#include "position_limiter.hpp"
#include "robot.hpp"

namespace {

const core::PositionLimiter LIMITER(YUMI);
const core::Values HOME = {0.0, -2.26893, 2.35619, 0.5236, 0.0, 0.69813, 0.0};
constexpr double DT = core::CYCLE;

// The motion after one step towards each of some goals.
core::PositionMotion after(core::PositionMotion motion, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> offset(-0.5, 0.5);
    for (unsigned i = 0; i <= seed % 10; ++i) {
        core::Values goal = HOME;
        for (double& each : goal) each += offset(random);
        LIMITER.step(motion, goal, DT, DT, motion);
    }
    return motion;
}

core::PositionMotion at_home() { return core::PositionMotion::resting_at(HOME); }

}  // namespace

TEST(step_that_is_smooth_ends_at_the_position_that_is_desired) {
    core::Values desired = HOME;
    for (double& each : desired) each += 1e-6;
    core::PositionMotion motion = at_home();
    CHECK(LIMITER.step(motion, desired, DT, DT, motion));
    CHECK(motion.sent.position == desired);
}

TEST(steps_from_one_motion_are_the_same_again) {
    for (unsigned seed = 0; seed < 50; ++seed) {
        const core::PositionMotion before = after(at_home(), seed);
        const core::PositionMotion one = after(before, seed + 1), another = after(before, seed + 1);
        CHECK(one.sent == another.sent);
        CHECK(LIMITER.brake(before, DT).sent == LIMITER.brake(before, DT).sent);
    }
}

TEST(joints_that_brake_come_to_the_place_that_was_foretold) {
    for (unsigned seed = 0; seed < 50; ++seed) {
        core::PositionMotion motion = after(at_home(), seed);
        const core::Values place = LIMITER.place_to_stop(motion);
        int cycles = 0;
        for (; !motion.stands(DT) && cycles < 500; ++cycles) motion = LIMITER.brake(motion, DT);
        CHECK(cycles < 500);
        CHECK(core::largest_difference(motion.sent.position, place) < 0.02);
    }
}

TEST(joints_brake_as_hard_as_they_may_where_no_way_is_found) {
    core::JointLimits limits = YUMI;
    limits.jerk = {};  // for which there is none
    core::Setpoint now{HOME, joint_1(1.0), {}}, reached;
    CHECK(!core::step_towards(now, {HOME, {}, {}}, limits, DT, {true}, reached));
    core::Flags all;
    all.fill(true);
    for (int cycle = 0; cycle < 20; ++cycle) {
        const double before = now.velocity[0];
        now = core::step_to_rest(now, limits, DT, all);
        CHECK(now.velocity[0] >= 0.0);
        CHECK(std::abs(before - now.velocity[0] - std::min(before, limits.acceleration[0] * DT)) < 1e-12);
    }
    CHECK(now.velocity[0] == 0.0);
}
