// Shapes of both arms and of what stands still, and how near they are to each other.
//
// A part of collision.cpp, which is compiled as one unit.

#pragma once

#include <utility>
#include <vector>

#include "joints.hpp"

namespace collision {

using core::INF, core::JOINTS;

constexpr int FRAMES = JOINTS + 1;  // those of the links, and that of tool0
constexpr double TINY = 1e-12;

// ---- vectors and frames

struct Vec {
    double x, y, z;
};
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double length(Vec a) { return std::sqrt(dot(a, a)); }

struct Frame {
    Vec x, y, z, at;  // its axes and its origin

    Vec turn(Vec v) const { return v.x * x + v.y * y + v.z * z; }
    Vec operator*(Vec v) const { return at + turn(v); }
    Frame operator*(const Frame& f) const { return {turn(f.x), turn(f.y), turn(f.z), *this * f.at}; }
    Vec turn_back(Vec v) const { return {dot(v, x), dot(v, y), dot(v, z)}; }
    Vec to_local(Vec v) const { return turn_back(v - at); }
    Frame turned(double angle) const {  // about its z axis
        const double c = std::cos(angle), s = std::sin(angle);
        return {c * x + s * y, c * y - s * x, z, at};
    }
};

bool are_finite(const double* values, int count) {
    return std::all_of(values, values + count, [](double value) { return std::isfinite(value); });
}

// ---- shapes

struct Capsule {
    double frame;  // that it moves with
    Vec start, end;
    double radius;
    double reach[JOINTS];  // by how much a radian of each joint moves its axis at most
};

// The axis of a capsule.
struct Axis {
    Vec middle, half;  // which leads from there to its end
};
Axis operator*(const Frame& frame, const Axis& axis) { return {frame * axis.middle, frame.turn(axis.half)}; }

struct Around {
    Axis axis;
    double radius;
};

struct Box {
    Frame pose;
    Vec half;
    double is_body;  // which the shoulders are bolted to
};

// Where two shapes are nearest: how far from each other, and from the first to the second.
struct Near {
    double distance;
    Vec normal;
    Vec points[2];  // of their surfaces
};

Vec perpendicular(Vec a, Vec b) {  // to both, or to one of them
    for (Vec v : {cross(a, b), cross(a, {1.0, 0.0, 0.0}), cross(a, {0.0, 1.0, 0.0}), Vec{0.0, 0.0, 1.0}})
        if (dot(v, v) > TINY * TINY) return (1.0 / length(v)) * v;
    return {0.0, 0.0, 1.0};
}

// The nearest points of the lines, moved into the segments one after the other (C. Ericson, Real-Time Collision
// Detection, 5.1.9). Segments are given by their middles and halves.
Near between_capsules(Vec middle, Vec half, double radius, Vec other_middle, Vec other, double other_radius) {
    const Vec apart = middle - other_middle;
    const double size = dot(half, half), other_size = dot(other, other), both = dot(half, other);
    const double offset = dot(half, apart), other_offset = dot(other, apart);
    const double denominator = size * other_size - both * both;
    auto inside = [](double share) { return std::min(std::max(share, -1.0), 1.0); };
    const bool is_parallel = denominator <= TINY * size * other_size;
    double s = is_parallel ? -1.0 : inside((both * other_offset - offset * other_size) / denominator);
    const double t = other_size > 0.0 ? inside((both * s + other_offset) / other_size) : 0.0;
    s = size > 0.0 ? inside((both * t - offset) / size) : 0.0;
    const Vec first = middle + s * half, second = other_middle + t * other, line = second - first;
    const double axes = length(line);
    const Vec normal = axes > TINY ? (1.0 / axes) * line : perpendicular(half, other);
    return {axes - radius - other_radius, normal, {first + radius * normal, second - other_radius * normal}};
}

// Half of the squared distance from a box along a segment is convex, and a parabola between the places where the
// segment crosses the plane of a face. So its slope is a line between two of these: the nearest point is where it is
// zero.
Near between_capsule_and_box(const Vec& start, const Vec& end, double radius, const Box& box) {
    const Vec from = box.pose.to_local(start), to = box.pose.to_local(end);
    const double at[3] = {from.x, from.y, from.z}, along[3] = {to.x - from.x, to.y - from.y, to.z - from.z};
    const double half[3] = {box.half.x, box.half.y, box.half.z};
    auto outside = [&](int k, double share) {
        const double value = at[k] + share * along[k];
        return value - std::min(std::max(value, -half[k]), half[k]);
    };
    auto slope = [&](double share) {
        return along[0] * outside(0, share) + along[1] * outside(1, share) + along[2] * outside(2, share);
    };
    double share = 0.0, low = slope(0.0);
    if (low < 0.0) {
        double shares[7], *last = shares;
        for (int k = 0; k < 3; ++k)
            for (double face : {half[k], -half[k]}) {
                const double crossing = (face - at[k]) / along[k];
                if (crossing > 0.0 && crossing < 1.0) *last++ = crossing;
            }
        *last++ = 1.0;
        std::sort(shares, last);
        double high = low;
        for (double* next = shares; next != last; ++next) {
            high = slope(*next);
            if (high >= 0.0) {
                share += high > low ? (*next - share) * -low / (high - low) : 0.0;
                break;
            }
            share = *next, low = high;
        }
    }
    const Vec out = {outside(0, share), outside(1, share), outside(2, share)};
    const double far = length(out);
    const Vec axis = start + share * (end - start);
    if (far > TINY) {
        const Vec normal = (-1.0 / far) * (box.pose.turn(out));
        return {far - radius, normal, {axis + radius * normal, axis + far * normal}};
    }
    // The axis is inside. How deep says the face through which it would leave soonest, so that it may.
    double deepest = -INF;
    Near near{};
    const Vec axes[3] = {box.pose.x, box.pose.y, box.pose.z};
    for (int k = 0; k < 3; ++k)
        for (double sign : {1.0, -1.0}) {
            const double here = sign * at[k], there = sign * (at[k] + along[k]);
            const double depth = std::min(here, there) - half[k];
            if (depth <= deepest) continue;
            deepest = depth;
            const Vec normal = -sign * axes[k], point = here < there ? start : end;
            near = {depth - radius, normal, {point + radius * normal, point + depth * normal}};
        }
    return near;
}

// An arm in one posture.
struct Placed {
    Frame frames[FRAMES];
    Vec moments[JOINTS];  // of the joints' axes
    Axis around[FRAMES];  // of what is around the parts of each
    std::vector<Axis> axes;  // of its parts; see Model::place_parts
    bool has_parts;
};

// Two parts that are near each other, as in robot/collision.py.
struct Contact {
    Near near;
    std::int64_t parts[2];
};

struct Arm {
    Frame origins[FRAMES];  // in the frame before
    std::vector<Capsule> parts;
    std::vector<Axis> axes;  // of the parts
    std::vector<int> of_frame[FRAMES];
    Around around[FRAMES];         // all parts of a frame
    double reach[FRAMES][JOINTS];  // the most of the parts of each
    int first;                     // number of its first part
};

// A capsule around the parts of a frame, about a line through the middle of all, in the direction of one of the ways
// between their ends: that which is smallest.
Around around(const Arm& arm, int frame) {
    Around least{{}, INF};
    std::vector<std::pair<Vec, double>> balls;  // the ends
    Vec middle{};
    for (int part : arm.of_frame[frame])
        for (Vec end : {arm.parts[part].start, arm.parts[part].end})
            balls.push_back({end, arm.parts[part].radius}), middle = middle + end;
    middle = (1.0 / double(balls.size())) * middle;
    for (const auto& from : balls)
        for (const auto& to : balls) {
            const Vec way = to.first - from.first;
            const Vec line = length(way) > TINY ? (1.0 / length(way)) * way : Vec{0.0, 0.0, 1.0};
            auto off = [&](Vec at) { return length(at - middle - dot(at - middle, line) * line); };
            double radius = 0.0, low = INF, high = -INF;
            for (const auto& [at, its] : balls) radius = std::max(radius, off(at) + its);
            for (const auto& [at, its] : balls) {
                const double along = dot(at - middle, line), room = radius - its;
                const double inside = std::sqrt(std::max(room * room - off(at) * off(at), 0.0));
                low = std::min(low, along + inside), high = std::max(high, along - inside);
            }
            const double half = std::max(0.5 * (high - low), 0.0);
            if (radius + half < least.radius + length(least.axis.half))
                least = {{middle + 0.5 * (low + high) * line, half * line}, radius};
        }
    return least;
}

struct Model {
    Arm arms[2];
    std::vector<Box> boxes;
    int count;  // of all parts

    Model(const Frame* origins, const std::int64_t* counts, const Capsule* capsules, const Box* all,
          std::int64_t number)
        : boxes(all, all + number) {
        for (int arm = 0; arm < 2; ++arm) {
            Arm& its = arms[arm] = {};
            std::copy(origins + arm * FRAMES, origins + (arm + 1) * FRAMES, its.origins);
            its.first = arm ? int(counts[0]) : 0;
            its.parts.assign(capsules + its.first, capsules + its.first + counts[arm]);
            for (std::size_t i = 0; i < its.parts.size(); ++i) {
                const auto& [frame, start, end, radius, reach] = its.parts[i];
                its.axes.push_back({0.5 * (start + end), 0.5 * (end - start)});
                its.of_frame[int(frame)].push_back(int(i));
                double* most = its.reach[int(frame)];
                for (int j = 0; j < JOINTS; ++j) most[j] = std::max(most[j], reach[j]);
            }
            for (int frame = 0; frame < FRAMES; ++frame)
                if (!its.of_frame[frame].empty()) its.around[frame] = around(its, frame);
        }
        count = box_number(int(number));
    }

    int box_number(int box) const { return arms[1].first + int(arms[1].parts.size()) + box; }

    void place(int arm, const double* posture, Placed& placed) const {
        const Arm& its = arms[arm];
        Frame frame = its.origins[0];
        for (int joint = 0; joint < JOINTS; ++joint) {
            if (joint) frame = frame * its.origins[joint];
            frame = placed.frames[joint] = frame.turned(posture[joint]);
            placed.moments[joint] = cross(frame.at, frame.z);
        }
        placed.frames[JOINTS] = frame * its.origins[JOINTS];
        for (int of = 0; of < FRAMES; ++of) placed.around[of] = placed.frames[of] * its.around[of].axis;
        placed.has_parts = false;
    }

    // What is around them is often far enough from all else: its parts are placed only when it is not.
    void place_parts(int arm, Placed& placed) const {
        const Arm& its = arms[arm];
        if (placed.has_parts) return;
        placed.has_parts = true;
        placed.axes.resize(its.parts.size());
        for (std::size_t i = 0; i < its.parts.size(); ++i)
            placed.axes[i] = placed.frames[int(its.parts[i].frame)] * its.axes[i];
    }

    // How near a part is to the other arm's, or to a box.
    Near near(int arm, const Placed& placed, int part, const Placed* others, int other) const {
        const auto [middle, half] = placed.axes[part];
        const double radius = arms[arm].parts[part].radius;
        if (!others) return between_capsule_and_box(middle - half, middle + half, radius, boxes[other]);
        const Axis& its = others->axes[other];
        return between_capsules(middle, half, radius, its.middle, its.half, arms[1 - arm].parts[other].radius);
    }

    // Whether a quick look shows that they are further apart than this: by how far both reach along the line between
    // their middles, or along the edges of a box.
    bool is_far(int arm, const Placed& placed, int part, const Placed* others, int other, double within) const {
        const double far = arms[arm].parts[part].radius + within;
        if (!others) return is_far(placed.axes[part], boxes[other], far);
        return is_far(placed.axes[part], others->axes[other], far + arms[1 - arm].parts[other].radius);
    }

    // The same of all parts of a frame, and all of a frame of the other arm or a box.
    bool is_frame_far(int arm, const Placed& placed, int frame, const Placed* others, int other, double within) const {
        const double far = arms[arm].around[frame].radius + within;
        if (!others) return is_far(placed.around[frame], boxes[other], far);
        return is_far(placed.around[frame], others->around[other], far + arms[1 - arm].around[other].radius);
    }

    static bool is_far(const Axis& axis, const Axis& other, double far) {
        const Vec apart = other.middle - axis.middle;
        const double size = dot(apart, apart);
        const double reach = std::abs(dot(axis.half, apart)) + std::abs(dot(other.half, apart));
        return far < 0.0 || size - reach > far * std::sqrt(size);
    }

    static bool is_far(const Axis& axis, const Box& box, double far) {
        const Vec at = box.pose.to_local(axis.middle), along = box.pose.turn_back(axis.half);
        const Vec out = {std::max(std::abs(at.x) - std::abs(along.x) - box.half.x, 0.0),
                         std::max(std::abs(at.y) - std::abs(along.y) - box.half.y, 0.0),
                         std::max(std::abs(at.z) - std::abs(along.z) - box.half.z, 0.0)};
        return far < 0.0 || dot(out, out) > far * far;
    }

    // Frames of an arm that have parts, with those of the other arm or with boxes. Shoulders and body are bolted
    // together and count as one.
    template <class Visit>
    void for_frames(int arm, bool is_still, Visit visit) const {
        const int others = is_still ? int(boxes.size()) : FRAMES;
        for (int frame = 0; frame < FRAMES; ++frame)
            for (int other = 0; other < others; ++other) {
                const bool is_bolted = frame == 0 && (is_still ? boxes[other].is_body > 0.0 : other == 0);
                const bool has_parts = !arms[arm].of_frame[frame].empty() &&
                                       (is_still || !arms[1 - arm].of_frame[other].empty());
                if (has_parts && !is_bolted) visit(frame, other);
            }
    }

    template <class Visit>
    void for_parts(int arm, int frame, bool is_still, int other, Visit visit) const {
        for (int part : arms[arm].of_frame[frame]) {
            if (is_still) visit(part, other);
            else for (int its_part : arms[1 - arm].of_frame[other]) visit(part, its_part);
        }
    }

    // How both ends of a part move along a line of nearest distance, towards the other part.
    void forward(int arm, const Placed& placed, int part, Vec normal, double behind[2],
                 double slopes[2][JOINTS]) const {
        const int last = std::min(int(arms[arm].parts[part].frame), JOINTS - 1);
        const auto [middle, half] = placed.axes[part];
        const double tilt = dot(half, normal);
        behind[0] = std::max(2.0 * tilt, 0.0), behind[1] = std::max(-2.0 * tilt, 0.0);
        // How fast a joint moves a point along a line is the product of the joint's screw and the line's.
        const Vec moment = cross(middle, normal), turns = cross(half, normal);
        for (int joint = 0; joint <= last; ++joint) {
            const double moves = dot(placed.frames[joint].z, moment) + dot(placed.moments[joint], normal);
            const double tilts = dot(placed.frames[joint].z, turns);
            slopes[0][joint] = moves - tilts, slopes[1][joint] = moves + tilts;
        }
        for (int joint = last + 1; joint < JOINTS; ++joint) slopes[0][joint] = slopes[1][joint] = 0.0;
    }
};

}  // namespace collision
