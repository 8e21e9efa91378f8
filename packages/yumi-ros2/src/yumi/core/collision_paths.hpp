// Paths of an arm until it rests: how its command brakes, how its robot follows, and where that would coast if
// its link were lost.
//
// A part of collision.cpp, which is compiled as one unit.

#pragma once

#include "braking.hpp"
#include "collision.hpp"
#include "collision_shapes.hpp"

namespace collision {

constexpr int LEVELS = 6, SAMPLES = 1 << LEVELS;
constexpr int STRIP_LEVELS = 4, STRIPS = 1 << STRIP_LEVELS;  // of a sheet
constexpr double SLOW = 0.06;  // [rad] an arm that comes to rest within this is led along a boundary
constexpr double WIDE = 1.0;   // of a sheet: what is off its line by this share of its length is cut in time

struct Limits {
    double acceleration[JOINTS], jerk[JOINTS];
    double gain;  // of the robots' position loops [1/s]
};

using core::Braking;

Braking braking_of(const core::Setpoint& start, int joint, const Limits& limits) {
    return {start.position[joint], start.velocity[joint], start.acceleration[joint], limits.acceleration[joint],
            limits.jerk[joint]};
}

// Whether an arm that brakes like this comes to rest so soon that it is led along boundaries.
bool is_slow(const Braking (&joints)[JOINTS]) {
    double way = 0.0;
    for (const Braking& joint : joints) {
        double low = joint.at, high = low;
        joint.extend(low, high);
        way += high - low;
    }
    return way < SLOW;
}

constexpr int CURVES = 3;                                         // of a path at most
constexpr int WHOLE = -1, SENT = 0, FOLLOWING = 1, COASTING = 2;  // their numbers; of all of them

// Postures along a path.
struct Curve {
    double postures[SAMPLES + 1][JOINTS];
};

// What of a sheet is between two shares of the way from one of its corners to another.
struct Slice {
    const double *from, *to;
    double low, high;
};

// Of a path: a straight line in joint space, and how far each joint may be off it.
struct Segment {
    double middle[JOINTS], along[JOINTS];  // `along` leads from there to its end
    double off[JOINTS];                    // it by so much, at most
    double half[JOINTS];                   // how far each joint is from the middle, at most
    int curve, level, index;               // of 2^level segments of a curve; of the whole path without a curve
    int strip;                             // of a sheet: 2^n + i for what its line sweeps on part i of 2^n of its way
    Slice slice;                           // of that strip
};

// Where an arm may come, or, of a path that coasts, where its robot may, should its link be lost now or while it
// brakes: one that is fed speeds goes on straight by its speed over its gain, on a line that sweeps a sheet while the
// robot brakes. One that is sent positions only rests where its position sent does, and one that follows speeds only is
// not known to stop.
struct Path {
    Motion motion;
    bool coasts = false, can_sheet = false;
    Braking braking[JOINTS];     // of the position sent
    int curves = 0;              // of it; none before it is cut
    Curve curve[CURVES];         // how the position sent brakes, how the robot follows it, and where it may coast
    Segment all, sheet;          // the whole of a path, and of one that coasts on a sheet
    double passed[SAMPLES + 1];  // the way of the ends of a sheet's line so far

    Path() { motion.planned[0] = INF; }  // as of no arm

    bool is_sheet() const { return coasts && can_sheet; }
    const Segment& whole() const { return is_sheet() ? sheet : all; }

    // Where an arm may come from now on: the braking path of the position sent, the robot's way behind it, from where
    // it plans to be to where it rests, and where it may coast.
    void begin(const Motion& its, const Limits& limits, bool its_coasts) {
        coasts = its_coasts;
        if (std::memcmp(&motion, &its, sizeof motion) == 0) return;  // as of the other arm's command
        motion = its, curves = 0;
        const bool has_robot = its.has_robot > 0.0, is_led = its.coasts > 0.0;
        can_sheet = has_robot && !is_led && limits.gain > 0.0;
        double range[2][JOINTS];
        for (int j = 0; j < JOINTS; ++j) {
            double &low = range[0][j], &high = range[1][j];
            braking[j] = braking_of(its.sent, j, limits);
            low = high = its.sent.position[j];
            braking[j].extend(low, high);
            // A robot that gets its speed by the position alone stays between these.
            extend(range, j, its.planned[j]);
            if (is_led) extend(range, j, its.coasts_to[j]);
        }
        if (has_robot) {
            add_curves(limits);
            extend(range, curve[FOLLOWING]);
        }
        all = between(range);
        if (!can_sheet) return;
        std::fill(range[0], range[1], INF), std::fill(range[1], range[1] + JOINTS, -INF);
        extend(range, curve[FOLLOWING]), extend(range, curve[COASTING]);
        sheet = between(range);
    }

    static void extend(double (&range)[2][JOINTS], int joint, double to) {
        range[0][joint] = std::min(range[0][joint], to), range[1][joint] = std::max(range[1][joint], to);
    }

    static void extend(double (&range)[2][JOINTS], const Curve& to) {
        for (const auto& posture : to.postures)
            for (int j = 0; j < JOINTS; ++j) extend(range, j, posture[j]);
    }

    static Segment between(const double (&range)[2][JOINTS]) {
        Segment its{};
        its.curve = WHOLE;
        for (int j = 0; j < JOINTS; ++j) {
            its.middle[j] = 0.5 * (range[0][j] + range[1][j]);
            its.half[j] = its.off[j] = 0.5 * (range[1][j] - range[0][j]);
        }
        return its;
    }

    void add_curves(const Limits& limits) {
        if (curves) return;
        add_braking();
        add_following(limits);
        if (motion.coasts > 0.0) add_line(motion.planned, motion.coasts_to);
    }

    void add_line(const core::Values& from, const core::Values& to) {
        Curve& its = curve[curves++];
        for (int i = 0; i <= SAMPLES; ++i)
            for (int j = 0; j < JOINTS; ++j) its.postures[i][j] = from[j] + (to[j] - from[j]) * i / SAMPLES;
    }

    void add_braking() {
        Curve& its = curve[curves++];
        double longest = 0.0;
        for (const Braking& joint : braking) longest = std::max(longest, joint.duration());
        for (int j = 0; j < JOINTS; ++j) {
            const Braking joint = braking[j];  // a copy is known not to change with the postures
            for (int i = 0; i <= SAMPLES; ++i) its.postures[i][j] = joint.position(longest * i / SAMPLES);
        }
    }

    // How the robot follows the position sent while that brakes, at the speed that its position loop makes of the lead.
    // A speed fed forward is taken back, as feed_forward_limiter.hpp does it. The rest of the way is straight.
    // One that may coast on a sheet, with where it would coast to from there.
    void add_following(const Limits& limits) {
        constexpr int BRAKING = 3 * SAMPLES / 4;
        const bool is_fed = motion.has_robot > 0.0;
        Curve& its = curve[curves++];
        double time = 0.0;
        for (int j = 0; j < JOINTS; ++j) {
            time = std::max(time, braking[j].duration());
            if (is_fed) time = std::max(time, braking_of(motion.robot, j, limits).duration());
        }
        const double dt = time / BRAKING, left = std::exp(-limits.gain * dt);
        for (int j = 0; j < JOINTS; ++j) {
            const Braking joint = braking[j];
            const double top = limits.acceleration[j], rise = limits.jerk[j] * dt, half = 0.5 * rise;
            double position = is_fed ? motion.robot.position[j] : motion.planned[j];
            double speed = motion.robot.velocity[j], rate = motion.robot.acceleration[j];
            for (int i = 0; i < BRAKING; ++i) {
                its.postures[i][j] = position;
                if (can_sheet) curve[COASTING].postures[i][j] = position + speed / limits.gain;
                const double ahead = joint.position((i + 0.5) * dt);
                if (!is_fed) {
                    position = ahead + (position - ahead) * left;
                    continue;
                }
                const double missing = limits.gain * (ahead - position) - speed, size = std::abs(missing);
                // as ramp_speed has it
                const double ease = std::sqrt(2.0 * limits.jerk[j] * size + half * half) - half;
                const double aim = std::copysign(std::min(std::min(top, ease), dt > 0.0 ? size / dt : 0.0), missing);
                const double before = rate;
                rate = std::max(rate - rise, std::min(rate + rise, aim));
                position += (speed + (2.0 * before + rate) * dt / 6.0) * dt;
                speed += 0.5 * (before + rate) * dt;
            }
            const double rest = limits.gain > 0.0 ? joint.position(time) : position;
            const double furthest = can_sheet ? position + speed / limits.gain : rest;
            for (int i = BRAKING; i <= SAMPLES; ++i) {
                const double share = double(i - BRAKING) / (SAMPLES - BRAKING);
                its.postures[i][j] = position + (rest - position) * share;
                if (can_sheet) curve[COASTING].postures[i][j] = furthest + (rest - furthest) * share;
            }
        }
        if (!can_sheet) return;
        passed[0] = 0.0;
        for (int i = 1; i <= SAMPLES; ++i) {
            passed[i] = passed[i - 1];
            for (const Curve* ends : {&its, &curve[COASTING]})
                for (int j = 0; j < JOINTS; ++j) passed[i] += std::abs(ends->postures[i][j] - ends->postures[i - 1][j]);
        }
    }

    bool can_cut(const Segment& segment) const {
        return segment.curve < 0 || segment.level < LEVELS || (is_sheet() && segment.strip < STRIPS);
    }

    // What a segment consists of: at most CURVES parts.
    int cut(const Segment& segment, const Limits& limits, Segment* parts) {
        if (is_sheet() && segment.curve >= 0) {
            double off = 0.0, along = 0.0;
            for (int j = 0; j < JOINTS; ++j) off += segment.off[j], along += std::abs(segment.along[j]);
            const bool in_time = segment.strip < STRIPS && (off > WIDE * along || segment.level == LEVELS);
            const Slice its = segment.slice;
            if (in_time) {
                // A slice keeps its sides, so that its parts are all of it; before that, each part has its own way.
                const Slice* sides = segment.level ? &its : nullptr;
                int count = 0;
                for (int i = 0; i < 2; ++i)
                    count += sweep(2 * segment.strip + i, segment.level, sides, 1, parts + count);
                return count;
            }
            const double middle = 0.5 * (its.low + its.high);
            const Slice halves[2] = {{its.from, its.to, its.low, middle}, {its.from, its.to, middle, its.high}};
            return sweep(segment.strip, segment.level + 1, halves, 2, parts);
        }
        if (segment.curve >= 0) {
            for (int i = 0; i < 2; ++i) parts[i] = part(segment.curve, segment.level + 1, 2 * segment.index + i);
            return 2;
        }
        if (is_sheet()) return sweep(1, 0, nullptr, 1, parts);
        add_curves(limits);
        const int first = coasts ? FOLLOWING : SENT;
        for (int i = first; i < curves; ++i) parts[i - first] = part(i, 0, 0);
        return curves - first;
    }

    // Slices of what the line of a sheet sweeps on a part of its way, or all of that. Returns in how many something is.
    int sweep(int strip, int level, const Slice* slices, int count, Segment* parts) const {
        int first = 0, last = SAMPLES;
        for (int bit = STRIPS; bit; bit >>= 1)  // the bits behind the first one say which half of which half
            if (bit <= strip / 2) {
                const double half = 0.5 * (passed[first] + passed[last]);
                const int middle = int(std::lower_bound(passed + first, passed + last, half) - passed);
                (strip & bit ? first : last) = std::max(std::min(middle, last - 1), first);
            }
        const double(*ends[2])[JOINTS] = {curve[FOLLOWING].postures, curve[COASTING].postures};
        Slice all = {ends[0][first], ends[0][first], -INF, INF};
        if (!slices) {
            // Along the longest line, since further cuts in time make it no shorter; without such, along the longest
            // way.
            double longest = TINY;
            auto lead = [&](const double* from, const double* to) {
                double size = 0.0;
                for (int j = 0; j < JOINTS; ++j) size += (to[j] - from[j]) * (to[j] - from[j]);
                if (size > longest) longest = size, all.from = from, all.to = to;
            };
            for (int i : {first, last}) lead(ends[0][i], ends[1][i]);
            for (int end = 0; end < 2 && strip >= STRIPS; ++end) lead(ends[0][first], ends[end][last]);
            slices = &all;
        }
        const double* from = slices->from;
        double way[JOINTS], size = TINY;
        for (int j = 0; j < JOINTS; ++j) way[j] = slices->to[j] - from[j], size += way[j] * way[j];
        // How far along that way the lines begin and end, and how far off it.
        double along[2][SAMPLES + 1], off[2][SAMPLES + 1][JOINTS], nearest = INF, furthest = -INF;
        for (int end = 0; end < 2; ++end)
            for (int i = first; i <= last; ++i) {
                const double* posture = ends[end][i];
                double share = 0.0;
                for (int j = 0; j < JOINTS; ++j) share += (posture[j] - from[j]) * way[j];
                share /= size, along[end][i] = share;
                for (int j = 0; j < JOINTS; ++j) off[end][i][j] = posture[j] - from[j] - share * way[j];
                nearest = std::min(nearest, share), furthest = std::max(furthest, share);
            }
        int found = 0;
        for (int which = 0; which < count; ++which) {
            Segment& its = parts[found];
            its.curve = COASTING, its.strip = strip, its.level = level, its.slice = slices[which];
            const double low = its.slice.low = std::max(its.slice.low, nearest);
            const double high = its.slice.high = std::min(its.slice.high, furthest);
            if (low > high) continue;
            double least[2][JOINTS], most[2][JOINTS];  // off that way, and of the joints
            std::fill(least[0], least[0] + 2 * JOINTS, INF), std::fill(most[0], most[0] + 2 * JOINTS, -INF);
            auto extend = [&](int joint, double its_off, double share) {
                const double at = its_off + share * way[joint];
                least[0][joint] = std::min(least[0][joint], its_off);
                most[0][joint] = std::max(most[0][joint], its_off);
                least[1][joint] = std::min(least[1][joint], at), most[1][joint] = std::max(most[1][joint], at);
            };
            auto cross = [&](int end, int i, int other_end, int other) {  // by where an edge crosses a side
                const double begin = along[end][i], finish = along[other_end][other];
                for (double side : {low, high})
                    if ((begin < side) != (finish < side)) {
                        const double share = (side - begin) / (finish - begin);
                        for (int j = 0; j < JOINTS; ++j)
                            extend(j, off[end][i][j] + share * (off[other_end][other][j] - off[end][i][j]), side);
                    }
            };
            for (int i = first; i <= last; ++i) {
                cross(0, i, 1, i);
                for (int end = 0; end < 2; ++end) {
                    if (i < last) cross(end, i, end, i + 1);
                    const double share = along[end][i];
                    for (int j = 0; j < JOINTS && share >= low && share <= high; ++j) extend(j, off[end][i][j], share);
                }
            }
            for (int j = 0; j < JOINTS; ++j) {
                const double middle = 0.5 * (low + high) * way[j] + 0.5 * (least[0][j] + most[0][j]);
                its.middle[j] = from[j] + middle;
                its.along[j] = 0.5 * (high - low) * way[j];
                its.off[j] = 0.5 * (most[0][j] - least[0][j]);
                its.half[j] = std::max(most[1][j] - middle, middle - least[1][j]);
            }
            ++found;
        }
        return found;
    }

    Segment part(int number, int level, int index) const {
        const Curve& its = curve[number];
        const int step = SAMPLES >> level, first = index * step;
        Segment segment{};
        segment.curve = number, segment.level = level, segment.index = index;
        double size = TINY;
        for (int j = 0; j < JOINTS; ++j) {
            const double from = its.postures[first][j], to = its.postures[first + step][j];
            segment.middle[j] = 0.5 * (from + to), segment.along[j] = 0.5 * (to - from);
            size += segment.along[j] * segment.along[j];
        }
        for (int i = 1; i < step; ++i) {
            const double* inner = its.postures[first + i];
            double share = 0.0;
            for (int j = 0; j < JOINTS; ++j) share += (inner[j] - segment.middle[j]) * segment.along[j] / size;
            share = std::min(std::max(share, -1.0), 1.0);
            for (int j = 0; j < JOINTS; ++j)
                segment.off[j] =
                    std::max(segment.off[j], std::abs(inner[j] - segment.middle[j] - share * segment.along[j]));
        }
        for (int j = 0; j < JOINTS; ++j) segment.half[j] = std::abs(segment.along[j]) + segment.off[j];
        return segment;
    }
};

}  // namespace collision
