// The braking of a joint, as hard as it may: its acceleration changes by its jerk to a peak, stays, and goes back.

#pragma once

#include "joints.hpp"

namespace core {

struct Braking {
    double at, sign, velocity, acceleration, jerk, peak, first, second, third;  // as seen in the direction of `sign`

    Braking() = default;
    // Of a joint that is here and moves like this, at most `top` strong. `top` and `changing` are above 0.
    Braking(double position, double speed, double rate, double top, double changing) : at(position), jerk(changing) {
        sign = speed + rate * std::abs(rate) / (2.0 * jerk) < 0.0 ? -1.0 : 1.0;
        velocity = sign * speed, acceleration = sign * rate;
        const double fastest = std::max(velocity + acceleration * acceleration / (2.0 * jerk), 0.0);
        peak = std::min(top, std::sqrt(jerk * fastest));
        first = std::max((acceleration + peak) / jerk, 0.0);
        second = peak > 0.0 ? std::max((fastest - peak * peak / jerk) / peak, 0.0) : 0.0;
        third = peak / jerk;
    }
    double duration() const { return first + second + third; }
    double position(double time) const {
        const double one = std::min(time, first), two = std::min(std::max(time - first, 0.0), second);
        const double three = std::min(std::max(time - first - second, 0.0), third);
        const double after_first = velocity + acceleration * first - 0.5 * jerk * first * first;
        const double after_second = after_first - peak * second;
        return at + sign * (one * (velocity + one * (0.5 * acceleration - one * jerk / 6.0)) +
                            two * (after_first - 0.5 * two * peak) +
                            three * (after_second + three * (three * jerk / 6.0 - 0.5 * peak)));
    }
    // Where it turns round, since it goes backwards until its acceleration has turned it; else where it begins.
    double turn() const {
        if (velocity >= 0.0) return at;
        const double square = acceleration * acceleration + 2.0 * jerk * velocity;
        return position((acceleration - std::sqrt(std::max(square, 0.0))) / jerk);
    }
    double end() const { return position(duration()); }
    // A range to all where it comes.
    void extend(double& low, double& high) const {
        const double turning = turn(), rest = end();
        low = std::min({low, at, turning, rest}), high = std::max({high, at, turning, rest});
    }
};

}  // namespace core
