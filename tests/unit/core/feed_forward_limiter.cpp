// Speeds that are fed forward begin, fade and end within what the joints may do.

#include "check.hpp"
#include "feed_forward_limiter.hpp"
#include "robot.hpp"

namespace {

const core::FeedForwardLimiter SPEEDS_ONLY(YUMI, 0.0, core::CYCLE);
const core::Values WANTED = {0.5, 0, 0, 0, 0, 0, 0.5};

core::FedForward next(const core::FedForward& fed, const core::Values& wanted) {
    return SPEEDS_ONLY.step(fed, standing(), {}, wanted, core::length(wanted) > 0.0, core::CYCLE);
}

}  // namespace

TEST(nothing_is_fed_forward_where_nothing_is_wanted) {
    const core::FedForward fed = next({}, {});
    CHECK(!fed.robot);
    CHECK(core::length(fed.velocity) == 0.0);
}

TEST(speed_fades_when_it_is_not_wanted_any_more) {
    core::FedForward fed;
    for (int i = 0; i < 100; ++i) fed = next(fed, WANTED);
    CHECK(core::distance(fed.velocity, WANTED) < 1e-6);
    fed = next(fed, {});
    CHECK(0.4 < fed.velocity[6] && fed.velocity[6] < 0.5);
    for (int i = 0; i < 100; ++i) fed = next(fed, {});
    CHECK(!fed.robot);
    CHECK(core::length(fed.velocity) == 0.0);
}

TEST(step_leaves_the_motion_before_as_it_was_and_is_the_same_again) {
    const core::FedForward before = next({}, WANTED);
    const core::FedForward one = next(before, WANTED), another = next(before, WANTED);
    CHECK(one.velocity == another.velocity);
    CHECK(*one.robot == *another.robot);
    CHECK(before.velocity == next({}, WANTED).velocity);
    CHECK(one.velocity != before.velocity);
}
