// The next command of a controller whose formula the core has, and no Python runs between a datagram and its answer.

#pragma once

#include <iterator>
#include <optional>

#include "joints.hpp"

namespace core {

// Goals in the memory of several processes, the newest only; as SharedBuffer[SessionGoal] has them.
struct SharedGoal {
    std::int64_t begun, finished;  // which write: equal where the goal is whole
    std::int64_t session;          // that the goal is meant for
    double time;
    double delay;  // of the stream that the goal is a point of; NaN where it is none
    Values position, velocity;
};

// position + gain · (goal - position), or the goal itself; as SAMPLED in library.py.
struct Sampled {
    std::int64_t session;  // in which the controller was asked last, and no other
    const SharedGoal* goals;
    std::int64_t taken;  // which of them was taken last, and what it was
    std::int64_t goes_there;
    Values goal, gain;

    // The command for a state; none in another session, none while a goal is written, or for a point of a stream.
    std::optional<ArmCommand> command(const ArmState& state) const {
        if (state.session != session) return std::nullopt;
        const std::int64_t newest = __atomic_load_n(&goals->finished, __ATOMIC_ACQUIRE);
        std::int64_t words[sizeof(SharedGoal) / sizeof(std::int64_t)];  // each read before the count is read again
        const auto* shared = reinterpret_cast<const std::int64_t*>(goals);
        for (std::size_t i = 0; i < std::size(words); ++i) words[i] = __atomic_load_n(shared + i, __ATOMIC_ACQUIRE);
        SharedGoal found;
        std::memcpy(&found, words, sizeof found);
        if (__atomic_load_n(&goals->begun, __ATOMIC_RELAXED) != newest) return std::nullopt;
        const bool is_new = newest != taken && found.session == session;
        if (is_new && !std::isnan(found.delay)) return std::nullopt;
        ArmCommand command;
        command.position = is_new ? found.position : goal;
        for (int i = 0; i < JOINTS && !goes_there; ++i)
            command.position[i] = state.position[i] + gain[i] * (command.position[i] - state.position[i]);
        return command;
    }
};

}  // namespace core
