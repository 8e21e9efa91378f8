// An arm that is limited and comes no nearer is held, until something has changed.

#include "check.hpp"
#include "progress_check.hpp"
#include "robot.hpp"

namespace {

// How often an arm tries again while the other one swings.
int tries(bool is_limited) {
    core::ProgressCheck check;
    core::ArmCommand goal;
    goal.position.fill(0.5);
    int count = 0;
    auto holds = [&](double other, double seconds) {
        core::Surroundings now;
        now.position.emplace().fill(other);
        now.is_heard = now.is_read = true, now.is_limited = is_limited;
        return check.holds(&goal, {}, {}, seconds, core::Limited{0, 1, 0, 0.01}, now);
    };
    for (int swing = 0; swing < 20; ++swing) {
        const double at = 0.1 * (swing % 2);
        count += !holds(at, core::CYCLE);
        holds(at, 0.1), holds(at, 0.1);
        CHECK(holds(at, 0.1));
    }
    return count;
}

}  // namespace

TEST(held_arm_tries_again_when_the_other_one_moves) { CHECK(tries(false) == 20); }
TEST(held_arm_tries_again_less_often_when_the_other_one_is_pushed) { CHECK(tries(true) == 5); }
