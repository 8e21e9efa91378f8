// What an arm that stands at a boundary is compared with, and when that boundary is forgotten.

#include "arm_collisions.hpp"
#include "check.hpp"

namespace {

int compared = 0;
bool has_boundary = false;  // of what is compared from now on, which joint 1 must not cross forwards

}  // namespace

extern "C" bool collisions_is_slow(const collision::Limiter*, const collision::Motion*) { return true; }
extern "C" bool collisions_is_clear(collision::Limiter*, std::int64_t, const collision::Motion* motion,
                                    const collision::Motion*, const collision::Motion*, double, std::int64_t,
                                    collision::Decision* decision) {
    ++compared;
    *decision = {};
    if (!has_boundary) return true;
    decision->boundary_count = 1;
    decision->boundaries[0].normal[0] = -1.0;
    const bool is_clear = motion->sent.position[0] <= 0.0;
    if (!is_clear) decision->part = decision->other = 0;
    return is_clear;
}

namespace {

const core::Setpoint STANDS, BEFORE{{-0.01, 0, 0, 0, 0, 0, 0}, {}, {}}, BEYOND{{0.1, 0, 0, 0, 0, 0, 0}, {}, {}};

// The right arm stands at a boundary, which is a part of the left one.
struct Arms : CollisionsHandle {
    core::ArmCollisionLimiter &right = arms[0], &left = arms[1];

    Arms() : CollisionsHandle({nullptr, 20'000, 5.0}) {
        has_boundary = true;
        for (core::ArmCollisionLimiter* arm : {&right, &left}) arm->note_sent({}, BEFORE, {});
        CHECK(stands_on() == 1);
    }
    // How often the right arm is compared in a cycle in which it stands.
    int stands_on() {
        const int before = compared;
        right.begin_cycle(nullptr, {}, 0.0);
        CHECK(right.accepts({}, STANDS, {}, false));
        return compared - before;
    }
    bool is_steered() {
        core::ArmCommand desired{BEYOND.position, {}, false};
        return right.steer(desired);
    }
};

}  // namespace

TEST(arm_that_stands_is_not_compared_again_until_something_changes) {
    Arms arms;
    CHECK(arms.stands_on() == 0);
    arms.note_permission();
    arms.right.begin_cycle(nullptr, {}, 0.0);
    CHECK(!arms.right.accepts({}, BEYOND, {}, false));
    CHECK(arms.stands_on() > 0);
    CHECK(arms.stands_on() == 0);
    arms.left.note_sent({}, BEYOND, {});
    CHECK(arms.stands_on() > 0);
}

TEST(arm_that_stands_at_a_boundary_is_not_led_along_it_when_the_other_one_has_left) {
    Arms arms;
    for (int repeat = 0; repeat < 3; ++repeat) {
        CHECK(arms.is_steered());
        arms.stands_on();
    }
    arms.left.note_sent({}, BEYOND, {}), has_boundary = false;
    CHECK(arms.stands_on() == 1);
    CHECK(!arms.is_steered());
    arms.right.begin_cycle(nullptr, {}, 0.0);
    CHECK(!arms.right.limited);
}

TEST(arm_that_stands_at_a_boundary_is_not_led_along_it_when_the_parts_may_touch) {
    Arms arms;
    CHECK(arms.is_steered());
    arms.note_permission();
    CHECK(!arms.is_steered());
}
