// Distances of the shapes of both arms, and whether a command keeps them apart. Why so:
// docs/explanation/decisions/0032-arms-keep-apart.md.
//
// Arms are 0, right, and 1, left. Parts are numbered as in CollisionModel.names: the capsules of the right arm, those
// of the left one, then the boxes that stand still. Positions are in the body frame [m], joints in chain order [rad].
// Callers check the sizes of arrays. Not for several threads at once.

#include "collision_limiter.hpp"
#include "lock.hpp"

using namespace collision;

constexpr int MOTION_SIZE = sizeof(Motion) / sizeof(double);
static_assert(MOTION_SIZE == 58 && sizeof(Capsule) == 15 * sizeof(double) && sizeof(Box) == 16 * sizeof(double),
              "as robot/collision.py and tests pack them");

// What library.py declares, and what collision.hpp does.
extern "C" {

// A model of arms with these frames (2, 8, 12), so many capsules (2), these capsules (n, 15) and boxes (n, 16), each
// the fields of the structures above.
Model* model_new(const Frame* origins, const std::int64_t* counts, const Capsule* capsules, const Box* boxes,
                 std::int64_t box_count) {
    return core::made<Model>(origins, counts, capsules, boxes, box_count);
}

void model_delete(Model* model) { delete model; }

// The pairs of parts nearer to each other than `within` [m], with the arms at two postures (14), of both arms, or of
// one of them with what stands still. Returns how many; `contacts` has room for all.
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
        const int number = is_still ? model->box_number(other) : model->arms[1 - arm].first + other;
        contacts[count++] = {near, {model->arms[arm].first + part, number}};
    };
    model->for_frames(int(arm), is_still, [&](int frame, int other) {
        if (!model->is_frame_far(int(arm), placed, frame, theirs, other, within))
            model->for_parts(int(arm), frame, is_still, other, note);
    });
    return count;
}

// For arms whose joints brake with these accelerations and jerks, of robots of this gain (15); parts of the same name
// have the same number.
Limiter* collisions_new(const Model* model, const Limits* limits, const std::int64_t* names) {
    return core::made<Limiter>(*model, *limits, names);
}

void collisions_delete(Limiter* limiter) { delete limiter; }

void collisions_permit(Limiter* limiter, const double* margins) { limiter->permit(margins); }

bool collisions_is_slow(const Limiter* limiter, const Motion* motion) {
    Braking braking[JOINTS];
    for (int j = 0; j < JOINTS; ++j) braking[j] = braking_of(motion->sent, j, limiter->limits);
    return is_slow(braking);
}

bool collisions_is_clear(Limiter* limiter, std::int64_t arm, const Motion* motion, const Motion* last,
                         const Motion* its, double apart, std::int64_t budget, Decision* decision) {
    *decision = {};
    for (const Motion* each : {motion, last, its})
        if (each && !are_finite(each->planned.data(), MOTION_SIZE)) return false;
    try {
        return limiter->decide(int(arm), *motion, *last, its, apart, budget, *decision);
    } catch (...) {  // no memory
        return false;
    }
}

}  // extern "C"
