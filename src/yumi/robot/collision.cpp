// Distances of the shapes of both arms, and whether a command keeps them apart: what collision.py and
// control/collisions.py ask in every cycle, through ctypes. Why so: docs/explanation/decisions/0032-arms-keep-apart.md.
//
// Arms are 0, right, and 1, left. Parts are numbered as in CollisionModel.names: the capsules of the right arm, those of
// the left one, then the boxes that stand still. Positions are in the body frame [m], joints in chain order [rad].
// Callers check the sizes of arrays. Not for several threads at once.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

namespace {

constexpr int JOINTS = 7, LEVELS = 6, SAMPLES = 1 << LEVELS;
constexpr int STRIP_LEVELS = 4, STRIPS = 1 << STRIP_LEVELS;  // of a sheet
constexpr int FRAMES = JOINTS + 1;  // those of the links, and that of tool0
constexpr int NAMED = 3;            // boundaries that count at once
constexpr double INF = std::numeric_limits<double>::infinity(), TINY = 1e-12;

constexpr double TOLERANCE = 5e-4;         // [m] a path that is off a posture by less counts as being there
constexpr double SHORT = 5e-3;             // [m] segments in which parts move less are taken for straight
constexpr double BOUNDARY_WITHIN = 0.002;  // [m] a boundary so near is led along
constexpr double ALLOWED_APPROACH = 1e-4;  // [m] in a cycle, of a part within its margin
constexpr double SPARE = 5e-4;             // [m] so far within its margin a part may turn round
constexpr double MOVED = 3e-4;             // [m] one that came nearer by more did so for another reason, and may go on
constexpr double COARSE = 0.12;            // [m] where parts move further, segments are cut without looking closer
constexpr int PLACING = 20, SEEN = 8;      // so many distances take as long as placing the arms; as one, so many looks
constexpr double SLOW = 0.06;              // [rad] an arm that comes to rest within this is led along a boundary
constexpr double WIDE = 1.0;               // of a sheet: what is off its line by this share of its length is cut in time
constexpr double SIMILAR = 0.5;            // of two segments, that in which parts move by this share of it is cut, too

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

// A capsule around others, about a line through the middle of all, in the direction of one of the ways between their
// ends: that which is smallest.
Around around(const std::vector<Capsule>& capsules) {
    Around least{{}, INF};
    std::vector<std::pair<Vec, double>> balls;  // the ends
    Vec middle{};
    for (const Capsule& its : capsules)
        for (Vec end : {its.start, its.end}) balls.push_back({end, its.radius}), middle = middle + end;
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

// Half of the squared distance from a box along a segment is convex, and a parabola between the places where the segment
// crosses the plane of a face. So its slope is a line between two of these: the nearest point is where it is zero.
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
            const double here = sign * at[k], there = sign * (at[k] + along[k]), depth = std::min(here, there) - half[k];
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

// Two parts that are near each other, as in collision.py.
struct Contact {
    double distance, normal[3], points[2][3];
    double behind[2][2];          // how much further back than its foremost end each end of each part is
    double slopes[2][2][JOINTS];  // by how much a radian of each joint moves it forward
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

struct Model {
    Arm arms[2];
    std::vector<Box> boxes;
    int count;  // of all parts

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
        const double size = dot(apart, apart), reach = std::abs(dot(axis.half, apart)) + std::abs(dot(other.half, apart));
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
    void forward(int arm, const Placed& placed, int part, Vec normal, double behind[2], double slopes[2][JOINTS]) const {
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

// ---- where an arm may come until it rests

// How a command moves an arm, as ArmMotion in control/collisions.py packs it.
struct Motion {
    double planned[JOINTS];
    double sent[3][JOINTS];  // position, velocity, acceleration
    double has_robot, robot[3][JOINTS];
    double coasts, coasts_to[JOINTS];
};

struct Limits {
    double acceleration[JOINTS], jerk[JOINTS];
    double gain;  // of the robots' position loops [1/s]
};

// A joint that brakes as hard as it may, forwards: its acceleration changes by its jerk to a peak, stays, and goes back.
struct Braking {
    double at, sign, velocity, acceleration, jerk, peak, first, second, third;

    Braking() = default;
    Braking(const double (&start)[3][JOINTS], int joint, const Limits& limits)
        : at(start[0][joint]), jerk(limits.jerk[joint]) {
        const double speed = start[1][joint], rate = start[2][joint], top = limits.acceleration[joint];
        sign = speed + rate * std::abs(rate) / (2.0 * jerk) < 0.0 ? -1.0 : 1.0;
        velocity = sign * speed, acceleration = sign * rate;
        const double fastest = std::max(velocity + acceleration * acceleration / (2.0 * jerk), 0.0);
        peak = std::min(top, std::sqrt(jerk * fastest));
        first = std::max((acceleration + peak) / jerk, 0.0);
        second = std::max((fastest - peak * peak / jerk) / std::max(peak, TINY), 0.0);
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
    void extend(double& low, double& high) const {  // a range to all where it comes
        double turning = 0.0;                       // it goes backwards first until its acceleration has turned it round
        const double root = acceleration * acceleration + 2.0 * jerk * velocity;
        if (velocity < 0.0) turning = (acceleration - std::sqrt(std::max(root, 0.0))) / jerk;
        for (double place : {at, position(turning), position(duration())})
            low = std::min(low, place), high = std::max(high, place);
    }
};

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

// Postures along a path: a curve, or a straight line, of which there are only the ends.
struct Curve {
    bool is_straight;
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
    Slice slice;  // of what the line of a sheet sweeps on part i of 2^n of its way, where `curve` is 2^n + i
};

// Where an arm may come, or, of a path that coasts, where its robot may, should its link be lost now or while it brakes:
// one that is fed speeds goes on straight by its speed over its gain, on a line that sweeps a sheet while the robot
// brakes. One that is sent positions only rests where its position sent does, and one that follows speeds only is not
// known to stop.
struct Path {
    Motion motion;
    bool coasts, can_sheet;
    Braking braking[JOINTS];     // of the position sent
    int curves;                  // of it; none before it is cut
    Curve curve[CURVES];         // how the position sent brakes, how the robot follows it, and where it may coast
    Segment all, sheet;          // the whole of a path, and of one that coasts on a sheet
    double passed[SAMPLES + 1];  // the way of the ends of a sheet's line so far

    Path() { motion.planned[0] = INF; }  // as of no arm

    bool is_sheet() const { return coasts && can_sheet; }
    const Segment& whole() const { return is_sheet() ? sheet : all; }

    // Where an arm may come from now on: the braking path of the position sent, the robot's way behind it, from where it
    // plans to be to where it rests, and where it may coast.
    void begin(const Motion& its, const Limits& limits, bool its_coasts) {
        coasts = its_coasts;
        if (std::memcmp(&motion, &its, sizeof motion) == 0) return;  // as of the other arm's command
        motion = its, curves = 0;
        const bool has_robot = its.has_robot > 0.0, is_led = its.coasts > 0.0;
        can_sheet = has_robot && !is_led && limits.gain > 0.0;
        double range[2][JOINTS];
        for (int j = 0; j < JOINTS; ++j) {
            double &low = range[0][j], &high = range[1][j];
            braking[j] = Braking(its.sent, j, limits);
            low = high = its.sent[0][j];
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

    void add_line(const double* from, const double* to) {
        Curve& its = curve[curves++];
        its.is_straight = true;
        std::copy(from, from + JOINTS, its.postures[0]);
        std::copy(to, to + JOINTS, its.postures[1]);
    }

    void add_braking() {
        Curve& its = curve[curves++];
        its.is_straight = false;
        double longest = 0.0;
        for (const Braking& joint : braking) longest = std::max(longest, joint.duration());
        for (int j = 0; j < JOINTS; ++j) {
            const Braking joint = braking[j];  // a copy is known not to change with the postures
            for (int i = 0; i <= SAMPLES; ++i) its.postures[i][j] = joint.position(longest * i / SAMPLES);
        }
    }

    // How the robot follows the position sent while that brakes, at the speed that its position loop makes of the lead.
    // A speed fed forward is taken back, as FeedForwardLimiter in control/limiter.py does it. The rest of the way is
    // straight. One that may coast on a sheet, with where it would coast to from there.
    void add_following(const Limits& limits) {
        constexpr int BRAKING = 3 * SAMPLES / 4;
        const bool is_fed = motion.has_robot > 0.0;
        Curve& its = curve[curves++];
        its.is_straight = false;
        double time = 0.0;
        for (int j = 0; j < JOINTS; ++j) {
            time = std::max(time, braking[j].duration());
            if (is_fed) time = std::max(time, Braking(motion.robot, j, limits).duration());
        }
        const double dt = time / BRAKING, left = std::exp(-limits.gain * dt);
        for (int j = 0; j < JOINTS; ++j) {
            const Braking joint = braking[j];
            const double top = limits.acceleration[j], rise = limits.jerk[j] * dt, half = 0.5 * rise;
            double position = is_fed ? motion.robot[0][j] : motion.planned[j];
            double speed = motion.robot[1][j], rate = motion.robot[2][j];
            for (int i = 0; i < BRAKING; ++i) {
                its.postures[i][j] = position;
                if (can_sheet) curve[COASTING].postures[i][j] = position + speed / limits.gain;
                const double ahead = joint.position((i + 0.5) * dt);
                if (!is_fed) {
                    position = ahead + (position - ahead) * left;
                    continue;
                }
                const double missing = limits.gain * (ahead - position) - speed, size = std::abs(missing);
                const double ease = std::sqrt(2.0 * limits.jerk[j] * size + half * half) - half;  // as ramp_speed has it
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
        return segment.curve < 0 || segment.level < LEVELS || (is_sheet() && segment.curve < STRIPS);
    }

    // What a segment consists of: at most CURVES parts.
    int cut(const Segment& segment, const Limits& limits, Segment* parts) {
        if (is_sheet() && segment.curve >= 0) {
            double off = 0.0, along = 0.0;
            for (int j = 0; j < JOINTS; ++j) off += segment.off[j], along += std::abs(segment.along[j]);
            const bool in_time = segment.curve < STRIPS && (off > WIDE * along || segment.level == LEVELS);
            const Slice its = segment.slice;
            if (in_time) {
                // A slice keeps its sides, so that its parts are all of it; before that, each part has its own way.
                const Slice* sides = segment.level ? &its : nullptr;
                int count = 0;
                for (int i = 0; i < 2; ++i) count += sweep(2 * segment.curve + i, segment.level, sides, 1, parts + count);
                return count;
            }
            const double middle = 0.5 * (its.low + its.high);
            const Slice halves[2] = {{its.from, its.to, its.low, middle}, {its.from, its.to, middle, its.high}};
            return sweep(segment.curve, segment.level + 1, halves, 2, parts);
        }
        if (segment.curve >= 0) {
            for (int i = 0; i < 2; ++i) parts[i] = part(segment.curve, segment.level + 1, 2 * segment.index + i);
            return 2;
        }
        if (is_sheet()) {
            return sweep(1, 0, nullptr, 1, parts);
        }
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
            // Along the longest line, since further cuts in time make it no shorter; without such, along the longest way.
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
            its.curve = strip, its.level = level, its.slice = slices[which];
            const double low = its.slice.low = std::max(its.slice.low, nearest);
            const double high = its.slice.high = std::min(its.slice.high, furthest);
            if (low > high) continue;
            double least[2][JOINTS], most[2][JOINTS];  // off that way, and of the joints
            std::fill(least[0], least[0] + 2 * JOINTS, INF), std::fill(most[0], most[0] + 2 * JOINTS, -INF);
            auto extend = [&](int joint, double its_off, double share) {
                const double at = its_off + share * way[joint];
                least[0][joint] = std::min(least[0][joint], its_off), most[0][joint] = std::max(most[0][joint], its_off);
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
            double from = its.postures[0][j], to = its.postures[1][j];
            if (its.is_straight) {
                const double way = (to - from) / (1 << level);
                from += index * way, to = from + way;
            } else {
                from = its.postures[first][j], to = its.postures[first + step][j];
            }
            segment.middle[j] = 0.5 * (from + to), segment.along[j] = 0.5 * (to - from);
            size += segment.along[j] * segment.along[j];
        }
        for (int i = 1; i < step && !its.is_straight; ++i) {
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

// ---- whether a command keeps the arms apart

// What an arm must not cross: normal · position >= least, near where it was calculated.
struct Boundary {
    double beyond, distance, least, normal[JOINTS];
    std::int64_t part, other;
};

// As Decision in collision_library.py.
struct Decision {
    std::int64_t distances;    // calculated
    std::int64_t part, other;  // of the pair that may be too near; -1 for none
    double distance;           // of these in the middle of their segments
    std::int64_t boundary_count;
    Boundary boundaries[NAMED];
};

// Of parts within their margins: how near they may be, and how near in this cycle.
struct Floor {
    int part, other;
    double floor, allowed;
};

// A segment of an arm's path, with the arm in its middle.
struct Span {
    Segment segment;
    Placed placed;
    double moved_frames[FRAMES], most;  // how far the parts of each frame, and any, may be from there
    std::vector<double> moved;          // and each part; see Limiter::place_parts
};

// Two parts, or of two frames all parts, or of a frame and a box.
struct Pair {
    int part, other;
    bool are_frames;
};

// What was found of two segments. `pairs` are those that are not decided: first and behind the last in Limiter::pairs.
struct Finding {
    double free;      // how far parts keep apart beyond their margins at least; nothing is open where it is not negative
    bool is_certain;  // that parts come too near: smaller segments would say the same
    std::size_t first, last;
    int mine, theirs;  // numbers of the segments' spans; -1 for what stands still
    int part, other;   // those that may be nearest
};

constexpr Finding NOTHING = {INF, false, 0, 0, 0, -1, -1, -1};

struct Limiter {
    const Model& model;
    std::vector<double> margins;      // (parts, parts)
    std::vector<std::int64_t> names;  // equal ones for parts of the same name
    double widest[2][FRAMES][FRAMES], widest_still[2][FRAMES];  // of the parts of an arm's frames
    Limits limits;
    std::vector<Floor> floors[2];

    // Of one decision.
    int arm = 0;
    bool steers = false;
    double most_margin = INF;  // whatever the margins say
    Path paths[2];
    std::vector<Span> spans;
    std::vector<Pair> pairs;
    std::vector<Floor> floored;
    std::vector<Boundary> boundaries;
    std::int64_t budget = 0;
    Decision* decision = nullptr;

    Limiter(const Model& its, const Limits& joints) : model(its), limits(joints) {
        // Two whole paths; then each cut, of which a path has so many, adds the parts of a segment of each arm.
        spans.resize(2 + 2 * (LEVELS + STRIP_LEVELS + 1) * 2 * CURVES);
        pairs.reserve(1 << 14);
        boundaries.reserve(64);
    }

    int number(int other, bool is_still) const {
        return is_still ? model.box_number(other) : model.arms[1 - arm].first + other;
    }
    double margin(int part, int other, bool is_still) const {
        const std::size_t row = std::size_t(model.arms[arm].first + part) * model.count;
        return std::min(margins[row + number(other, is_still)], most_margin);
    }

    double widest_of(int frame, int other, bool is_still) const {
        return std::min(is_still ? widest_still[arm][frame] : widest[arm][frame][other], most_margin);
    }

    // Other margins from now on.
    void permit(const double* all) {
        most_margin = INF;
        margins.assign(all, all + std::size_t(model.count) * model.count);
        std::fill(&widest[0][0][0], &widest[0][0][0] + 2 * FRAMES * FRAMES, -INF);
        std::fill(&widest_still[0][0], &widest_still[0][0] + 2 * FRAMES, -INF);
        for (arm = 0; arm < 2; ++arm)
            for (std::size_t part = 0; part < model.arms[arm].parts.size(); ++part) {
                const int frame = int(model.arms[arm].parts[part].frame);
                double* its = widest[arm][frame];
                for (std::size_t other = 0; other < model.arms[1 - arm].parts.size(); ++other) {
                    double& most = its[int(model.arms[1 - arm].parts[other].frame)];
                    most = std::max(most, margin(int(part), int(other), false));
                }
                for (std::size_t box = 0; box < model.boxes.size(); ++box)
                    widest_still[arm][frame] = std::max(widest_still[arm][frame], margin(int(part), int(box), true));
            }
    }

    void span(int which, int number, const Segment& segment) {
        Span& its = spans[number];
        its.segment = segment;
        model.place(which, segment.middle, its.placed);
        for (int frame = 0; frame < FRAMES; ++frame)
            its.moved_frames[frame] = moved(model.arms[which].reach[frame], segment.half);
        its.most = *std::max_element(its.moved_frames, its.moved_frames + FRAMES);
    }

    void place_parts(int which, Span& its) {
        const std::vector<Capsule>& parts = model.arms[which].parts;
        if (its.placed.has_parts) return;
        model.place_parts(which, its.placed);
        its.moved.resize(parts.size());
        for (std::size_t i = 0; i < parts.size(); ++i) its.moved[i] = moved(parts[i].reach, its.segment.half);
    }

    // How far a part with this reach comes when the joints move by so much.
    static double moved(const double (&reach)[JOINTS], const double (&by)[JOINTS]) {
        double sum = 0.0;
        for (int j = 0; j < JOINTS; ++j) sum += reach[j] * by[j];
        return sum;
    }

    // How much nearer an end of a part may come to another one along the line of nearest distance.
    double towards(int which, const Span& span, int part, Vec normal) const {
        const Segment& its = span.segment;
        double behind[2], slopes[2][JOINTS], most = 0.0, bend = 0.0, before = 0.0;
        model.forward(which, span.placed, part, normal, behind, slopes);
        for (int end = 0; end < 2; ++end) {
            double along = 0.0, off = 0.0;
            for (int j = 0; j < JOINTS; ++j)
                along += slopes[end][j] * its.along[j], off += std::abs(slopes[end][j]) * its.off[j];
            most = std::max(most, std::abs(along) - behind[end] + off);
        }
        // What the joints bend its way: each turns the path of those behind it.
        for (int j = 0; j < JOINTS; ++j) {
            before += its.half[j];
            bend += model.arms[which].parts[part].reach[j] * its.half[j] * (before - 0.5 * its.half[j]);
        }
        return most + bend;
    }

    // How near parts may come to each other on two segments, or on one to what stands still: of all pairs, or of those
    // that were not decided on the segments that these are parts of.
    Finding compare(int mine, int theirs, const Finding* whole) {
        const bool is_still = theirs < 0;
        Span &own = spans[mine], *its = is_still ? nullptr : &spans[theirs];
        const Placed* placed = is_still ? nullptr : &its->placed;
        const std::vector<Capsule> &own_parts = model.arms[arm].parts, &its_parts = model.arms[1 - arm].parts;
        const double least = steers ? BOUNDARY_WITHIN : 0.0;
        Finding finding = NOTHING;
        finding.first = pairs.size(), finding.mine = mine, finding.theirs = theirs;
        double worst = INF;
        const bool can_cut = paths[arm].can_cut(own.segment) || (!is_still && paths[1 - arm].can_cut(its->segment));
        int seen = 0;
        auto place_both = [&] {
            place_parts(arm, own);
            if (!is_still) place_parts(1 - arm, *its);
        };
        auto examine = [&](int part, int other) {
            ++seen;
            const double off = own.moved[part] + (is_still ? 0.0 : its->moved[other]);
            const double kept = margin(part, other, is_still), within = kept + std::max(off - TOLERANCE, least);
            if (kept == -INF || model.is_far(arm, own.placed, part, placed, other, within)) return;
            spend(1);
            const Near near = model.near(arm, own.placed, part, placed, other);
            double beyond = near.distance - kept;
            if (steers && own.segment.curve <= SENT && beyond < BOUNDARY_WITHIN && off < SHORT)
                note_boundary(own, part, other, is_still, near, beyond);
            double free = INF;
            if (beyond < std::max(off - TOLERANCE, 0.0)) {
                double nearer = towards(arm, own, part, near.normal);
                if (!is_still) nearer += towards(1 - arm, *its, other, -1.0 * near.normal);
                nearer = std::min(nearer, off);
                free = beyond - std::max(nearer - TOLERANCE, 0.0);
                for (const Floor& floor : floored)
                    if (floor.part == model.arms[arm].first + part && floor.other == number(other, is_still)) {
                        // A part within its margin already comes no nearer, and may leave it.
                        beyond = near.distance - floor.allowed;
                        free = beyond - nearer;
                    }
            }
            if (free < 0.0 || (steers && beyond - off < BOUNDARY_WITHIN)) pairs.push_back({part, other, false});
            if (!(free < 0.0)) return;
            // Each path comes as near to the middle of a segment as it is off the line.
            double certain = beyond + moved(own_parts[part].reach, own.segment.off);
            if (!is_still) certain += moved(its_parts[other].reach, its->segment.off);
            finding.free = std::min(finding.free, free);
            const bool is_certain = certain < 0.0;
            const double severity = is_certain ? certain : free;
            if (finding.is_certain ? is_certain && severity < worst : is_certain || severity < worst) {
                worst = severity;
                finding.part = part, finding.other = other;
            }
            finding.is_certain = finding.is_certain || is_certain;
        };
        auto examine_frames = [&](int frame, int other) {
            ++seen;
            const double off = own.moved_frames[frame] + (is_still ? 0.0 : its->moved_frames[other]);
            const double within = widest_of(frame, other, is_still) + std::max(off - TOLERANCE, least);
            if (model.is_frame_far(arm, own.placed, frame, placed, other, within)) return;
            if (!(off > COARSE && can_cut)) {
                place_both();
                return model.for_parts(arm, frame, is_still, other, examine);
            }
            pairs.push_back({frame, other, true});
            if (!(-off < finding.free)) return;
            finding.free = -off, finding.part = model.arms[arm].of_frame[frame][0];
            finding.other = is_still ? other : model.arms[1 - arm].of_frame[other][0];
        };
        if (!whole) model.for_frames(arm, is_still, examine_frames);
        for (std::size_t i = whole ? whole->first : 0, last = whole ? whole->last : 0; i < last; ++i) {
            const Pair pair = pairs[i];
            if (pair.are_frames) {
                examine_frames(pair.part, pair.other);
            } else {
                place_both();
                examine(pair.part, pair.other);
            }
        }
        finding.last = pairs.size();
        spend(PLACING + seen / SEEN);
        return finding;
    }

    void note_boundary(const Span& own, int part, int other, bool is_still, const Near& near, double beyond) {
        Boundary boundary{beyond, near.distance, -beyond, {}, model.arms[arm].first + part, number(other, is_still)};
        double behind[2], slopes[2][JOINTS];
        model.forward(arm, own.placed, part, near.normal, behind, slopes);
        for (int j = 0; j < JOINTS; ++j) {
            boundary.normal[j] = -slopes[behind[0] <= behind[1] ? 0 : 1][j];
            boundary.least += boundary.normal[j] * own.segment.middle[j];
        }
        for (Boundary& known : boundaries)  // a part has several capsules: that which is nearest counts
            if (names[known.part] == names[boundary.part] && names[known.other] == names[boundary.other]) {
                if (boundary.beyond < known.beyond) known = boundary;
                return;
            }
        boundaries.push_back(boundary);
    }

    void spend(int distances) { budget -= distances, decision->distances += distances; }

    bool refuse(const Finding& finding) {
        const bool is_still = finding.theirs < 0;
        const Placed &mine = spans[finding.mine].placed, *theirs = is_still ? nullptr : &spans[finding.theirs].placed;
        place_parts(arm, spans[finding.mine]);
        if (!is_still) place_parts(1 - arm, spans[finding.theirs]);
        decision->part = model.arms[arm].first + finding.part, decision->other = number(finding.other, is_still);
        decision->distance = model.near(arm, mine, finding.part, theirs, finding.other).distance;
        return false;
    }

    // Whether two segments are clear of each other, or one of what stands still: where that is open they are cut, and
    // the parts that are nearest to each other come first. `top` is behind the last span in use.
    bool is_clear(const Finding& finding, int top) {
        if (!(finding.free < 0.0)) return true;
        const bool is_still = finding.theirs < 0;
        const Span &own = spans[finding.mine], &its = spans[is_still ? finding.mine : finding.theirs];
        const bool can_cut = paths[arm].can_cut(own.segment);
        const bool can_cut_theirs = !is_still && paths[1 - arm].can_cut(its.segment);
        const bool cuts = can_cut && (own.most >= SIMILAR * its.most || !can_cut_theirs);
        const bool cuts_theirs = can_cut_theirs && (its.most > SIMILAR * own.most || !can_cut);
        if (finding.is_certain || !(cuts || cuts_theirs)) return refuse(finding);
        Segment parts[CURVES];
        int first = finding.mine, count = 1, their_first = finding.theirs, their_count = 1;
        if (cuts) {
            first = top, count = paths[arm].cut(own.segment, limits, parts);
            for (int i = 0; i < count; ++i) span(arm, top++, parts[i]);
        }
        if (cuts_theirs) {
            their_first = top, their_count = paths[1 - arm].cut(its.segment, limits, parts);
            for (int i = 0; i < their_count; ++i) span(1 - arm, top++, parts[i]);
        }
        Finding found[CURVES * CURVES], *last = found;
        const std::size_t known = pairs.size();
        for (int i = 0; i < count; ++i)
            for (int k = 0; k < their_count; ++k) {
                if (budget <= 0) return refuse(finding);
                // Positions sent are compared with positions sent, and robots with robots.
                const int curve = spans[first + i].segment.curve;
                const int its_curve = is_still ? curve : spans[their_first + k].segment.curve;
                if (std::min(curve, its_curve) == SENT && std::max(curve, its_curve) == FOLLOWING) continue;
                *last = compare(first + i, is_still ? -1 : their_first + k, &finding);
                if (last++->is_certain) return refuse(last[-1]);
            }
        std::sort(found, last, [](const Finding& a, const Finding& b) { return a.free < b.free; });
        for (Finding* each = found; each != last; ++each)
            if (!is_clear(*each, top)) return false;
        pairs.resize(known);
        return true;
    }

    // Of parts that are within their margins now, how near they may be to each other.
    void find_floors(const Motion& last, const Motion* its) {
        std::vector<Floor> none, &known = paths[arm].coasts ? none : floors[arm];
        floored.clear();
        Placed& own = spans[2].placed;
        auto note = [&](Placed* placed) {
            const bool is_still = !placed;
            auto find = [&](int part, int other) {
                const double kept = margin(part, other, is_still);
                if (kept == -INF || model.is_far(arm, own, part, placed, other, kept)) return;
                const double now = model.near(arm, own, part, placed, other).distance;
                if (!(now < kept)) return;
                for (Floor& floor : floored)
                    if (floor.part == model.arms[arm].first + part && floor.other == number(other, is_still)) {
                        floor.floor = std::min(floor.floor, now);
                        return;
                    }
                floored.push_back({model.arms[arm].first + part, number(other, is_still), now, 0.0});
            };
            model.for_frames(arm, is_still, [&](int frame, int other) {
                const double within = widest_of(frame, other, is_still);
                if (model.is_frame_far(arm, own, frame, placed, other, within)) return;
                model.place_parts(arm, own);
                if (!is_still) model.place_parts(1 - arm, *placed);
                model.for_parts(arm, frame, is_still, other, find);
            });
        };
        // Where the arms are sent, and where their robots plan to be.
        if (its) {
            model.place(1 - arm, its->sent[0], spans[3].placed);
            model.place(1 - arm, its->planned, spans[4].placed);
        }
        for (const double* posture : {last.sent[0], last.planned}) {
            model.place(arm, posture, own);
            note(nullptr);
            // Only what is compared: a position sent may be nearer to the other robot than both are to each other.
            const bool with_all = its && (last.coasts > 0.0 || its->coasts > 0.0), is_sent = posture == last.sent[0];
            if (its && (is_sent || with_all)) note(&spans[3].placed);
            if (its && (!is_sent || with_all)) note(&spans[4].placed);
        }
        for (Floor& floor : floored) {
            const std::size_t row = std::size_t(floor.part) * model.count;
            const double now = floor.floor, kept = std::min(margins[row + floor.other], most_margin);
            // What was once left does not come back; an arm that came nearer all the same may go on from there.
            for (const Floor& before : known)
                if (before.part == floor.part && before.other == floor.other && now >= before.floor - MOVED)
                    floor.floor = std::max(now, std::min(before.floor, kept - SPARE));
            floor.allowed = std::min(floor.floor - ALLOWED_APPROACH, now);
        }
        known = floored;
    }

    bool decide(int which, const Motion& motion, const Motion& last, const Motion* its, double apart, std::int64_t most,
                Decision& result) {
        const bool coasts = apart < INF;
        arm = which, budget = most, decision = &result, most_margin = apart;
        pairs.clear(), boundaries.clear(), floored.clear();
        Path &own = paths[arm], &other = paths[1 - arm];
        own.begin(motion, limits, coasts);
        if (its) other.begin(*its, limits, coasts);
        steers = !coasts && is_slow(own.braking);
        // Robots that are sent positions only go nowhere else without their links.
        if (coasts && !own.is_sheet() && !(its && other.is_sheet())) return true;
        for (int i = 0; i < (its ? 2 : 1); ++i) {
            const Segment& whole = paths[i ? 1 - arm : arm].whole();
            if (!are_finite(whole.middle, JOINTS) || !are_finite(whole.half, JOINTS)) return false;
            span(i ? 1 - arm : arm, i, whole);
        }
        Finding found[2] = {NOTHING, NOTHING};
        if (!coasts || own.is_sheet()) found[0] = compare(0, -1, nullptr);
        if (its) found[1] = compare(0, 1, nullptr);
        bool is_open = found[0].free < 0.0 || found[1].free < 0.0;
        if (is_open) find_floors(last, its);
        if (!floored.empty()) {
            for (Finding& each : found)
                if (each.free < 0.0) each = compare(0, each.theirs, &each);
            is_open = found[0].free < 0.0 || found[1].free < 0.0;
        }
        if (found[1].is_certain || (!found[0].is_certain && found[1].free < found[0].free))
            std::swap(found[0], found[1]);
        const bool is_clear_of_all = !is_open || (is_clear(found[0], 2) && is_clear(found[1], 2));
        std::sort(boundaries.begin(), boundaries.end(),
                  [](const Boundary& a, const Boundary& b) { return a.beyond < b.beyond; });
        result.boundary_count = std::min<std::int64_t>(NAMED, std::int64_t(boundaries.size()));
        std::copy_n(boundaries.begin(), result.boundary_count, result.boundaries);
        return is_clear_of_all;
    }
};

constexpr int MOTION_SIZE = sizeof(Motion) / sizeof(double);
static_assert(MOTION_SIZE == 58 && sizeof(Capsule) == 15 * sizeof(double) && sizeof(Box) == 16 * sizeof(double),
              "as collision_library.py and collision.py pack them");

}  // namespace

// ---- what collision_library.py declares

extern "C" {

// A model of arms with these frames (2, 8, 12), so many capsules (2), these capsules (n, 15) and boxes (n, 16), each the
// fields of the structures above.
Model* model_new(const double* origins, const std::int64_t* counts, const Capsule* capsules, const Box* boxes,
                 std::int64_t box_count) {
    try {
        Model* model = new Model();
        for (int arm = 0; arm < 2; ++arm) {
            Arm& its = model->arms[arm];
            std::memcpy(static_cast<void*>(its.origins), origins + arm * FRAMES * 12, sizeof its.origins);
            its.first = arm ? int(counts[0]) : 0;
            its.parts.assign(capsules + its.first, capsules + its.first + counts[arm]);
            for (std::size_t i = 0; i < its.parts.size(); ++i) {
                const auto& [frame, start, end, radius, reach] = its.parts[i];
                its.axes.push_back({0.5 * (start + end), 0.5 * (end - start)});
                its.of_frame[int(frame)].push_back(int(i));
            }
            for (int frame = 0; frame < FRAMES; ++frame) {
                std::vector<Capsule> of_frame;
                for (int i : its.of_frame[frame]) of_frame.push_back(its.parts[i]);
                if (!of_frame.empty()) its.around[frame] = around(of_frame);
                for (const Capsule& part : of_frame)
                    for (int j = 0; j < JOINTS; ++j) its.reach[frame][j] = std::max(its.reach[frame][j], part.reach[j]);
            }
        }
        model->boxes.assign(boxes, boxes + box_count);
        model->count = model->box_number(int(box_count));
        return model;
    } catch (...) {
        return nullptr;
    }
}

void model_delete(Model* model) { delete model; }

// The pairs of parts nearer to each other than `within` [m], with the arms at two postures (14), of both arms, or of one
// of them with what stands still. Returns how many; `contacts` has room for all.
std::int64_t model_contacts(const Model* model, const double* postures, double within, std::int64_t arm, bool is_still,
                            Contact* contacts) {
    Placed placed, others;
    for (int which : {int(arm), int(1 - arm)}) {
        Placed& its = which == arm ? placed : others;
        model->place(which, postures + JOINTS * which, its);
        model->place_parts(which, its);
    }
    const Placed* theirs = is_still ? nullptr : &others;
    std::int64_t count = 0;
    auto note = [&](int part, int other) {
        const Near near = model->near(int(arm), placed, part, theirs, other);
        if (!(near.distance < within)) return;
        Contact& contact = contacts[count++] = Contact{};
        contact.distance = near.distance;
        std::memcpy(contact.normal, &near.normal, sizeof contact.normal);
        std::memcpy(contact.points, near.points, sizeof contact.points);
        contact.parts[0] = model->arms[arm].first + part;
        contact.parts[1] = is_still ? model->box_number(other) : model->arms[1 - arm].first + other;
        model->forward(int(arm), placed, part, near.normal, contact.behind[0], contact.slopes[0]);
        if (is_still) return;
        model->forward(int(1 - arm), others, other, -1.0 * near.normal, contact.behind[1], contact.slopes[1]);
    };
    model->for_frames(int(arm), is_still, [&](int frame, int other) {
        if (!model->is_frame_far(int(arm), placed, frame, theirs, other, within))
            model->for_parts(int(arm), frame, is_still, other, note);
    });
    return count;
}

// For arms whose joints brake with these accelerations and jerks, of robots of this gain (15); parts of the same name
// have the same number.
Limiter* limiter_new(const Model* model, const double* limits, const std::int64_t* names) {
    try {
        Limits joints;
        std::memcpy(&joints, limits, sizeof joints);
        Limiter* limiter = new Limiter(*model, joints);
        limiter->names.assign(names, names + model->count);
        return limiter;
    } catch (...) {
        return nullptr;
    }
}

void limiter_delete(Limiter* limiter) { delete limiter; }

// Keep these margins from now on (parts, parts) [m]; -inf between those that may touch.
void limiter_permit(Limiter* limiter, const double* margins) { limiter->permit(margins); }

// Whether an arm that moves like this comes to rest so soon that it is led along boundaries.
bool limiter_is_slow(const Limiter* limiter, const char* packed) {
    Motion motion;
    std::memcpy(static_cast<void*>(&motion), packed, sizeof motion);
    Braking braking[JOINTS];
    for (int j = 0; j < JOINTS; ++j) braking[j] = Braking(motion.sent, j, limiter->limits);
    return is_slow(braking);
}

// The segments of a path that was cut so often, at most 6 times: middles, lines from there to their ends, and how far
// the path may be off them, (n, 3, 7), at most 3 * 64; and the whole path's middle and half, (2, 7). Returns n. Those 2 i
// and 2 i + 1 are cut from i of one cut less; what has nothing of the path is off it by -inf. For tests.
std::int64_t limiter_segments(Limiter* limiter, const char* packed, bool coasts, std::int64_t level, double* segments,
                              double* whole) {
    Motion motion;
    std::memcpy(static_cast<void*>(&motion), packed, sizeof motion);
    Path& path = limiter->paths[0];
    path.begin(motion, limiter->limits, coasts);
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

// Whether an arm keeps apart from all else on all of its braking path, should it move as `motion` says, after `last`,
// whichever arm is quicker; `its` is the other arm's motion, null where that is unknown. Motions are packed. With
// `apart` below infinity, whether they stay that far apart [m] wherever both arms would go without their links.
bool limiter_is_clear(Limiter* limiter, std::int64_t arm, const char* motion, const char* last, const char* its,
                      double apart, std::int64_t budget, Decision* decision) {
    Motion motions[3] = {};
    const char* packed[3] = {motion, last, its};
    *decision = {};
    decision->part = decision->other = -1;
    for (int i = 0; i < 3; ++i) {
        if (!packed[i]) continue;
        double values[MOTION_SIZE];
        std::memcpy(values, packed[i], sizeof values);
        if (!are_finite(values, MOTION_SIZE)) return false;
        std::memcpy(static_cast<void*>(&motions[i]), values, sizeof values);
    }
    try {
        return limiter->decide(int(arm), motions[0], motions[1], its ? &motions[2] : nullptr, apart, budget, *decision);
    } catch (...) {  // no memory
        return false;
    }
}

}  // extern "C"
