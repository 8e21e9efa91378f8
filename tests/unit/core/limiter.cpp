// Whatever is desired and reported, what two arms are sent stays within their limits; and no sanitizer finds anything.

#include <random>

#include "check.hpp"
#include "limiter.hpp"
#include "robot.hpp"

// No part of an arm is near anything.
extern "C" bool collisions_is_slow(const collision::Limiter*, const collision::Motion*) { return false; }
extern "C" bool collisions_is_clear(collision::Limiter*, std::int64_t, const collision::Motion*, const collision::Motion*,
                                    const collision::Motion*, double, std::int64_t, collision::Decision* decision) {
    *decision = {};
    return true;
}

namespace {

// The table of control/limiter_state.py as far as these tests lead; everything else goes on as if nothing were.
core::StateTable table() {
    core::StateTable all{};
    for (auto& row : all.next) {
        const std::int8_t states[core::EVENTS] = {
            core::ENTERING, core::ENTERING, core::BEGINNING, core::SETTLING,  core::HOLDING, core::LOST,
            core::DOUBTED,  core::STANDBY,  core::IGNORED,   core::WAITING,   core::HOLDING, core::SETTLING,
            core::HOLDING,  core::FOLLOWING, core::INTERRUPTED, core::DISCONNECTED, core::HOLDING};
        std::copy(states, states + core::EVENTS, row);
    }
    for (core::State state : {core::SETTLING, core::IGNORED, core::LOST, core::DISCONNECTED}) all.settles[state] = 1;
    return all;
}

struct Arm {
    core::ArmCollisionLimiter collisions;
    core::Limiter limiter;
    core::ArmState state = standing();
    core::Setpoint sent;

    Arm(core::SharedByArms& shared, int number)
        : collisions(shared, number),
          limiter({YUMI, YUMI.velocity, core::CYCLE, core::EGM_GAIN, 0.0}, table(), &collisions) {}

    void cycle(std::mt19937& random, bool is_first) {
        auto chance = [&](double share) { return double(random()) / 4294967296.0 < share; };
        std::uniform_real_distribution<double> angle(-3.0, 3.0);
        state.time += core::CYCLE, state.dt = is_first ? 0.0 : core::CYCLE;
        state.is_running = !chance(0.01);
        if (chance(0.005)) ++state.session;
        core::ArmState reported = state;
        if (chance(0.02)) reported.position[random() % 7] += angle(random);
        if (chance(0.01)) limiter.lose(chance(0.5) ? core::INTERRUPTION : core::CONNECTION_LOST);
        if (chance(0.01)) limiter.scale_speed(0.1 + 0.9 * chance(0.5));
        if (!limiter.check(reported)) return;
        const bool begins = limiter.state() == core::BEGINNING;
        core::ArmCommand desired;
        for (double& each : desired.position) each = chance(0.001) ? NAN : angle(random);
        desired.has_velocity = chance(0.3);
        if (desired.has_velocity) desired.velocity.fill(angle(random));
        const core::ArmCommand command = limiter.limit(reported, chance(0.9) ? &desired : nullptr, chance(0.05));
        CHECK(command.is_finite());
        CHECK(YUMI.contain(command.position));
        limiter.observe(reported);
        for (int i = 0; i < core::JOINTS; ++i) {
            const double speed = core::EGM_GAIN * (command.position[i] - state.position[i]) + command.velocity[i];
            const double top = YUMI.velocity[i];
            state.planned[i] += std::max(-top, std::min(top, speed)) * core::CYCLE;
            state.velocity[i] = (state.planned[i] - state.position[i]) / core::CYCLE * 0.2;
            state.position[i] += 0.2 * (state.planned[i] - state.position[i]);
        }
        for (int i = 0; i < core::JOINTS && !begins; ++i)
            CHECK(std::abs(command.position[i] - sent.position[i]) <= 1.001 * YUMI.velocity[i] * core::CYCLE);
        sent.position = command.position;
    }
};

}  // namespace

TEST(two_arms_stay_within_their_ranges_and_speeds_whatever_happens) {
    for (unsigned seed = 0; seed < 20; ++seed) {
        std::mt19937 random(seed);
        core::SharedByArms shared{nullptr, 20'000, 5.0};
        Arm right(shared, 0), left(shared, 1);
        right.collisions.other = &left.collisions, left.collisions.other = &right.collisions;
        right.limiter.pair(left.limiter);
        for (int cycle = 0; cycle < 2000; ++cycle) right.cycle(random, cycle == 0), left.cycle(random, cycle == 0);
    }
}
