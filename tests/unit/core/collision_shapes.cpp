// Slopes say how distances of parts change, from the other arm's and from what stands still.

#include <random>

#include "check.hpp"
#include "collision_shapes.hpp"

namespace {

using namespace collision;

std::mt19937 generator(3);
double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator); }
Vec vector(double far) { return {between(-far, far), between(-far, far), between(-far, far)}; }

// Arms that stand beside each other, with a part on each link and a box between them; joints turn about all axes.
Model shapes() {
    std::vector<Frame> origins;
    std::vector<Capsule> capsules;
    const Vec x{1.0, 0.0, 0.0}, y{0.0, 1.0, 0.0}, z{0.0, 0.0, 1.0};
    for (int arm = 0; arm < 2; ++arm)
        for (int frame = 0; frame < FRAMES; ++frame) {
            const Vec at = frame ? vector(0.15) : Vec{0.0, arm ? 0.2 : -0.2, 0.3};
            origins.push_back(Frame{y, z, x, at}.turned(between(-3.0, 3.0)));
            capsules.push_back({double(frame), vector(0.08), vector(0.08), between(0.01, 0.04), {}});
        }
    const std::int64_t counts[2] = {FRAMES, FRAMES};
    const Box box{{x, y, z, {0.3, 0.0, 0.2}}, {0.05, 0.1, 0.15}, 0.0};
    return {origins.data(), counts, capsules.data(), &box, 1};
}

struct Postures {
    double angles[2][JOINTS];

    Placed placed(const Model& model, int arm, int joint, double by) const {
        double posture[JOINTS];
        std::copy(angles[arm], angles[arm] + JOINTS, posture);
        posture[joint] += by;
        Placed its;
        model.place(arm, posture, its), model.place_parts(arm, its);
        return its;
    }
};

// How often the slopes of an arm's parts were compared with distances that its joints change.
int compare(const Model& model, const Postures& postures, int arm, bool is_still) {
    constexpr double STEP = 1e-5;
    const Placed own = postures.placed(model, arm, 0, 0.0), others = postures.placed(model, 1 - arm, 0, 0.0);
    const Placed* theirs = is_still ? nullptr : &others;
    int compared = 0;
    for (int part = 0; part < FRAMES; ++part)
        for (int other = 0; other < (is_still ? 1 : FRAMES); ++other) {
            const Near near = model.near(arm, own, part, theirs, other);
            double behind[2], slopes[2][JOINTS];
            model.forward(arm, own, part, near.normal, behind, slopes);
            // One end is foremost: else the nearest point is between both.
            if (near.distance < 1e-3 || std::max(behind[0], behind[1]) < 0.01) continue;
            for (int joint = 0; joint < JOINTS; ++joint) {
                const auto distance = [&](double by) {
                    return model.near(arm, postures.placed(model, arm, joint, by), part, theirs, other).distance;
                };
                const double change = (distance(STEP) - distance(-STEP)) / (2.0 * STEP);
                CHECK(std::abs(change + slopes[behind[0] <= behind[1] ? 0 : 1][joint]) < 2e-3);
                ++compared;
            }
        }
    return compared;
}

}  // namespace

TEST(slopes_say_how_distances_change) {
    const Model model = shapes();
    for (const bool is_still : {false, true}) {
        int compared = 0;
        for (int run = 0; run < 20; ++run) {
            Postures postures;
            for (auto& posture : postures.angles)
                for (double& angle : posture) angle = between(-2.5, 2.5);
            for (int arm = 0; arm < 2; ++arm) compared += compare(model, postures, arm, is_still);
        }
        CHECK(compared > 500);
    }
}
