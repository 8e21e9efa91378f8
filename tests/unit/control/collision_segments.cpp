// How the core divides the paths of an arm, as the tests of the collision limiter look at it; compiled by them.

#include "arm_collisions.hpp"
#include "collision_limiter.hpp"

using namespace collision;

extern "C" {

// The segments of a path that was cut so often, at most 6 times: middles, lines from there to their ends, and how far
// the path may be off them, (n, 3, 7), at most 3 * 64; and the whole path's middle and half, (2, 7). Returns n. Those 2 i
// and 2 i + 1 are cut from i of one cut less; what has nothing of the path is off it by -inf.
std::int64_t collisions_segments(Limiter* limiter, const Motion* motion, bool coasts, std::int64_t level,
                                 double* segments, double* whole) {
    Path& path = limiter->paths[0];
    path.begin(*motion, limiter->limits, coasts);
    std::memcpy(whole, path.whole().middle, sizeof path.whole().middle);
    std::memcpy(whole + JOINTS, path.whole().half, sizeof path.whole().half);
    Segment parts[CURVES];
    std::int64_t count = 0;
    auto add = [&](auto& add_halves, const Segment* segment, std::int64_t cuts) -> void {
        Segment halves[CURVES];
        const int number = segment && cuts ? path.cut(*segment, limiter->limits, halves) : 0;
        for (int i = 0; i < 2 && cuts; ++i) add_halves(add_halves, i < number ? &halves[i] : nullptr, cuts - 1);
        if (cuts) return;
        for (int j = 0; j < JOINTS; ++j) {
            segments[j] = segment ? segment->middle[j] : 0.0;
            segments[JOINTS + j] = segment ? segment->along[j] : 0.0;
            segments[2 * JOINTS + j] = segment ? segment->off[j] : -INF;
        }
        segments += 3 * JOINTS, ++count;
    };
    const int number = path.cut(path.whole(), limiter->limits, parts);
    for (int i = 0; i < number; ++i) add(add, &parts[i], level);
    return count;
}

// How the command sent last moves an arm.
const Motion* collisions_motion(const CollisionsHandle* both, std::int64_t arm) { return &both->arms[arm].motion; }

// As many distances may be calculated for an arm in a cycle from now on.
void collisions_limit_distances(CollisionsHandle* both, std::int64_t most) { both->shared.distances = most; }

}  // extern "C"
