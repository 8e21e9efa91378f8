// The interface of collision.cpp, which keeps both arms apart, for the limiter and for Python.

#pragma once

#include "joints.hpp"

namespace collision {

constexpr int MOST_BOUNDARIES = 3;  // that count at once

// How a command moves an arm, and where it may come until it rests: where its robot plans to be; how the position sent
// moves; how the robot itself moves where speeds are fed forward to it; and where it may go if it is not heard any
// more.
struct Motion {
    core::Values planned;
    core::Setpoint sent;
    double has_robot;
    core::Setpoint robot;
    double coasts;
    core::Values coasts_to;
};

// What an arm must not cross: normal · position >= least, near where it was calculated; as Boundary in library.py.
struct Boundary {
    double beyond;    // how far the arm is on this side of it [m]
    double distance;  // of the parts from each other [m]
    double least;     // the least product of `normal` and a position [m]
    core::Values normal;  // by how much a radian of each joint moves the parts apart [m/rad]
    std::int64_t part, other;
};

// Why a command is clear or not.
struct Decision {
    std::int64_t distances = 0;          // calculated, or what took as long
    std::int64_t part = -1, other = -1;  // of the pair that may be too near; -1 for none
    double distance = 0.0;               // of these in the middle of their segments
    std::int64_t boundary_count = 0;
    Boundary boundaries[MOST_BOUNDARIES];  // near the arm, nearest first
};

struct Limiter;

}  // namespace collision

extern "C" {

// Keep these margins from now on (parts, parts) [m]; -inf between those that may touch.
void collisions_permit(collision::Limiter* limiter, const double* margins);

// Whether an arm that moves like this comes to rest so soon that it is led along boundaries.
bool collisions_is_slow(const collision::Limiter* limiter, const collision::Motion* motion);

// Whether an arm, 0 the right and 1 the left one, keeps apart from all else on all of its braking path, should it move
// as `motion` says, after `last`, whichever arm is quicker; `its` is the other arm's motion, null where that is
// unknown. With `apart` below infinity, whether they stay that far apart [m] wherever both arms would go without their
// links. As many distances may be calculated as `budget` says.
bool collisions_is_clear(collision::Limiter* limiter, std::int64_t arm, const collision::Motion* motion,
                         const collision::Motion* last, const collision::Motion* its, double apart, std::int64_t budget,
                         collision::Decision* decision);

}  // extern "C"
