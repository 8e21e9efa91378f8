// The delay of positions that are desired with a speed.
//
// A robot's plan takes a speed at once, and the robot reports the position that goes with the speed later, by its
// servo's delay. Its position loop is closed over what it reports: sent together, position and speed would both ask for
// the distance of that delay (docs/explanation/decisions/0051-position-behind-its-speed.md).

#pragma once

#include "joints.hpp"

namespace core {

class PositionDelay {
public:
    // What was desired is over.
    void clear() { count_ = 0, with_speed_ = -INF; }

    // `desired`, of finite numbers, with the position that goes with its speed; itself where no speeds are desired any
    // more. `dt` has passed since the last call, by the robot's time; the first position is gone to from the one sent
    // last.
    ArmCommand next(ArmCommand desired, double dt, const Values& sent) {
        now_ += dt;
        if (!count_) add({now_ - dt, sent});
        add({now_, desired.position});
        if (desired.has_velocity) with_speed_ = now_;
        const double due = now_ - BEHIND;
        while (count_ > 2 && places_[1].time <= due) std::copy(places_ + 1, places_ + count_--, places_);
        if (due > with_speed_ + CYCLE) return desired;  // the position has come to where the speeds ended
        const Place &older = places_[0], &newer = places_[1];
        if (due >= newer.time) {
            desired.position = newer.position;
            return desired;
        }
        const double way = newer.time - older.time;
        const double share = way > 0.0 ? std::max(0.0, due - older.time) / way : 1.0;
        desired.position = added(older.position, share, added(newer.position, -1.0, older.position));
        return desired;
    }

private:
    // The servo's delay, and half of the cycle for which a speed counts [s].
    static constexpr double BEHIND = (SERVO_CYCLES + 0.5) * CYCLE;
    static constexpr int MOST = 64;  // as of a robot that sends each 0.3 ms

    struct Place {
        double time;
        Values position;
    };

    void add(const Place& place) {
        if (count_ == MOST) std::copy(places_ + 1, places_ + count_--, places_);
        places_[count_++] = place;
    }

    double now_ = 0.0;
    double with_speed_ = -INF;  // when a speed was desired last
    Place places_[MOST];        // desired, the oldest first
    int count_ = 0;
};

}  // namespace core
