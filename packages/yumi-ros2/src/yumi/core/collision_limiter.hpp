// The collision limiter: the paths of both arms are compared with each other and with what stands still.
//
// A part of collision.cpp, which is compiled as one unit.

#pragma once

#include "collision_paths.hpp"

namespace collision {

constexpr double TOLERANCE = 5e-4;            // [m] a path that is off a posture by less counts as being there
constexpr double SHORT = 5e-3;                // [m] segments in which parts move less are taken for straight
constexpr double BOUNDARY_WITHIN = 0.002;     // [m] a boundary so near is led along
constexpr double ALLOWED_APPROACH = 1e-4;     // [m] in a cycle, of a part within its margin
constexpr double TURNING_DEPTH = 5e-4;        // [m] so far within its margin a part may turn round
// [m] one that came nearer by more did so for another reason, and may go on
constexpr double UNPLANNED_APPROACH = 3e-4;
constexpr double COARSE = 0.12;               // [m] where parts move further, segments are cut without looking closer
// of two segments, that in which parts move by this share of it is cut, too
constexpr double SIMILAR = 0.5;
// so many distances take as long as placing the arms; as one, so many looks
constexpr int PLACING = 20, LOOKS = 8;

// Of parts within their margins: how near they may be, and how near in this cycle. Positions sent and robots have their
// own: a position sent is led no nearer because its robot is.
struct Floor {
    int part, other;
    bool is_robots;
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
    // how far parts keep apart beyond their margins at least; nothing is open where it is not negative
    double free;
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

    Limiter(const Model& its, const Limits& joints, const std::int64_t* numbers)
        : model(its), names(numbers, numbers + its.count), limits(joints) {
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
            for (const bool is_still : {false, true})
                model.for_frames(arm, is_still, [&](int frame, int other) {
                    double& most = is_still ? widest_still[arm][frame] : widest[arm][frame][other];
                    model.for_parts(arm, frame, is_still, other, [&](int part, int its_part) {
                        most = std::max(most, margin(part, its_part, is_still));
                    });
                });
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
                double allowed[2] = {kept, kept};  // of positions sent, and of robots; whole paths are of both
                for (const Floor& floor : floored)
                    if (floor.part == model.arms[arm].first + part && floor.other == number(other, is_still))
                        allowed[floor.is_robots] = floor.allowed;
                const int its_curve = is_still ? own.segment.curve : its->segment.curve;
                if (own.segment.curve == SENT && its_curve == SENT) allowed[1] = allowed[0];
                if (std::max(own.segment.curve, its_curve) > SENT) allowed[0] = allowed[1];
                // A part within its margin already comes no nearer, and may leave it.
                if (std::min(allowed[0], allowed[1]) < kept) {
                    beyond = near.distance - std::min(allowed[0], allowed[1]);
                    free = near.distance - std::max(allowed[0], allowed[1]) - nearer;
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
        spend(PLACING + seen / LOOKS);
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
        auto note = [&](Placed* placed, bool is_robots) {
            const bool is_still = !placed;
            auto find = [&](int part, int other) {
                const double kept = margin(part, other, is_still);
                if (kept == -INF || model.is_far(arm, own, part, placed, other, kept)) return;
                const double now = model.near(arm, own, part, placed, other).distance;
                if (!(now < kept)) return;
                for (Floor& floor : floored)
                    if (floor.part == model.arms[arm].first + part && floor.other == number(other, is_still) &&
                        floor.is_robots == is_robots) {
                        floor.floor = std::min(floor.floor, now);
                        return;
                    }
                floored.push_back({model.arms[arm].first + part, number(other, is_still), is_robots, now, 0.0});
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
            model.place(1 - arm, its->sent.position.data(), spans[3].placed);
            model.place(1 - arm, its->planned.data(), spans[4].placed);
        }
        for (const bool is_sent : {true, false}) {
            model.place(arm, (is_sent ? last.sent.position : last.planned).data(), own);
            if (is_sent) note(nullptr, false);
            if (is_sent && its) note(&spans[3].placed, false);
            // Robots are on their way to where they are sent, one later than the other.
            note(nullptr, true);
            if (its) note(&spans[3].placed, true), note(&spans[4].placed, true);
        }
        for (Floor& floor : floored) {
            const std::size_t row = std::size_t(floor.part) * model.count;
            const double now = floor.floor, kept = std::min(margins[row + floor.other], most_margin);
            // What was once left does not come back; an arm that came nearer all the same may go on from there.
            for (const Floor& before : known)
                if (before.part == floor.part && before.other == floor.other && before.is_robots == floor.is_robots &&
                    now >= before.floor - UNPLANNED_APPROACH)
                    floor.floor = std::max(now, std::min(before.floor, kept - TURNING_DEPTH));
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
        if (found[0].free < 0.0 || found[1].free < 0.0) find_floors(last, its);
        if (!floored.empty())
            for (Finding& each : found)
                if (each.free < 0.0) each = compare(0, each.theirs, &each);
        if (found[1].is_certain || (!found[0].is_certain && found[1].free < found[0].free))
            std::swap(found[0], found[1]);
        const bool is_clear_of_all = is_clear(found[0], 2) && is_clear(found[1], 2);
        std::sort(boundaries.begin(), boundaries.end(),
                  [](const Boundary& a, const Boundary& b) { return a.beyond < b.beyond; });
        result.boundary_count = std::min<std::int64_t>(MOST_BOUNDARIES, std::int64_t(boundaries.size()));
        std::copy_n(boundaries.begin(), result.boundary_count, result.boundaries);
        return is_clear_of_all;
    }
};

}  // namespace collision
