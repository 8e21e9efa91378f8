// How regularly a robot's datagrams arrive.

#include <random>

#include "check.hpp"
#include "egm_session.hpp"

namespace {

constexpr double CYCLE = 0.004032;

// Of a robot whose datagrams are delayed by up to `spread`.
core::Arrivals arrivals_of(double seconds, double drift_ppm = 0.0, double spread = 0.0, double epoch = 0.0) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> delay(0.0, 1.0);
    core::Arrivals arrivals;
    arrivals.begin(100.0, epoch);
    for (int count = 1; count < std::lround(seconds / CYCLE); ++count) {
        const double ours = count * CYCLE;
        arrivals.note(100.0 + ours + spread * delay(random), epoch + ours * (1.0 + drift_ppm * 1e-6), 1);
    }
    return arrivals;
}

}  // namespace

TEST(arrivals_of_one_datagram_have_no_cycle_time) { CHECK(core::Arrivals().cycle_time == 0.0); }

TEST(arrivals_of_a_regular_robot_have_no_jitter) {
    const core::Arrivals arrivals = arrivals_of(3.0);
    CHECK(std::abs(arrivals.cycle_time - CYCLE) < 1e-9);
    CHECK(arrivals.worst_jitter < 1e-9);
    CHECK(std::abs(arrivals.drift_ppm) < 1e-6);
}

TEST(jitter_settles_at_the_mean_difference_of_delays) {
    const core::Arrivals arrivals = arrivals_of(20.0, 0.0, 0.0003);
    CHECK(0.00005 < arrivals.jitter && arrivals.jitter < 0.00015);  // a third of the spread
    CHECK(0.00025 < arrivals.worst_jitter && arrivals.worst_jitter < 0.0003);
}

TEST(drift_is_found_beneath_the_jitter) {
    for (double epoch : {0.0, 28'800.0, 1.8e9})
        for (double drift : {-80.0, 0.0, 30.0})
            CHECK(std::abs(arrivals_of(30.0, drift, 0.0005, epoch).drift_ppm - drift) < 2.0);
}

TEST(drift_is_unknown_before_two_seconds) { CHECK(arrivals_of(1.9, 50.0).drift_ppm == 0.0); }

TEST(lost_datagrams_do_not_change_the_cycle_time) {
    core::Arrivals arrivals;
    arrivals.begin(0.0, 0.0);
    arrivals.note(5 * CYCLE, 5 * CYCLE, 5);
    CHECK(std::abs(arrivals.cycle_time - CYCLE) < 1e-12);
}

TEST(a_clock_that_was_set_is_no_jitter) {
    core::Arrivals arrivals = arrivals_of(3.0, 40.0);
    const double before = arrivals.jitter;
    arrivals.note(103.0, 1.8e9, 1);
    CHECK(arrivals.jitter == before);
    CHECK(arrivals.worst_jitter < 1e-6);
}

TEST(arrivals_stand_any_clock) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (int run = 0; run < 200; ++run) {
        core::Arrivals arrivals;
        double now = 0.0;
        for (int step = 0; step < 200; ++step) {
            now += 0.1 * share(random) * (share(random) < 0.9);
            arrivals.note(now, share(random) < 0.5 ? now : 1e9 * share(random), 1 + std::int64_t(63 * share(random)));
        }
        CHECK(0.0 <= arrivals.jitter && arrivals.jitter <= arrivals.worst_jitter && arrivals.worst_jitter <= 1.0);
    }
}
