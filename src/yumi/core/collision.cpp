// Distances of the shapes of both arms, and whether a command keeps them apart. Why so:
// docs/explanation/decisions/0032-arms-keep-apart.md.
//
// Arms are 0, right, and 1, left. Parts are numbered as in CollisionModel.names: the capsules of the right arm, those of
// the left one, then the boxes that stand still. Positions are in the body frame [m], joints in chain order [rad].
// Callers check the sizes of arrays. Not for several threads at once.

#include "collision_limiter.hpp"
#include "lock.hpp"

using namespace collision;

constexpr int MOTION_SIZE = sizeof(Motion) / sizeof(double);
static_assert(MOTION_SIZE == 58 && sizeof(Capsule) == 15 * sizeof(double) && sizeof(Box) == 16 * sizeof(double),
              "as robot/collision.py and tests pack them");

// What library.py declares, and what collision.hpp does.
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
Limiter* collisions_new(const Model* model, const double* limits, const std::int64_t* names) {
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

void collisions_delete(Limiter* limiter) { delete limiter; }

// Keep these margins from now on (parts, parts) [m]; -inf between those that may touch.
void collisions_permit(Limiter* limiter, const double* margins) {
    const core::Guard guard(core::lock);
    limiter->permit(margins);
}

bool collisions_is_slow(const Limiter* limiter, const Motion* motion) {
    Braking braking[JOINTS];
    for (int j = 0; j < JOINTS; ++j) braking[j] = Braking(motion->sent, j, limiter->limits);
    return is_slow(braking);
}

// The segments of a path that was cut so often, at most 6 times: middles, lines from there to their ends, and how far
// the path may be off them, (n, 3, 7), at most 3 * 64; and the whole path's middle and half, (2, 7). Returns n. Those 2 i
// and 2 i + 1 are cut from i of one cut less; what has nothing of the path is off it by -inf. For tests.
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

bool collisions_is_clear(Limiter* limiter, std::int64_t arm, const Motion* motion, const Motion* last, const Motion* its,
                         double apart, std::int64_t budget, Decision* decision) {
    const core::Guard guard(core::lock);
    *decision = {};
    decision->part = decision->other = -1;
    for (const Motion* each : {motion, last, its})
        if (each && !are_finite(each->planned, MOTION_SIZE)) return false;
    try {
        return limiter->decide(int(arm), *motion, *last, its, apart, budget, *decision);
    } catch (...) {  // no memory
        return false;
    }
}

}  // extern "C"
