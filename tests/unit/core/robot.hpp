// The YuMi's joints, and a robot that stands at zero.

#pragma once

#include "joints.hpp"

constexpr core::JointLimits YUMI = {
    {-2.94088, -2.50455, -2.94088, -2.15548, -5.06145, -1.53589, -3.9968},
    {2.94088, 0.759218, 2.94088, 1.39626, 5.06145, 2.40855, 3.9968},
    {3.14159, 3.14159, 3.14159, 3.14159, 6.98132, 6.98132, 6.98132},
    {20, 20, 20, 20, 40, 40, 40},
    {300, 300, 300, 300, 600, 600, 600},
};

inline core::ArmState standing() {
    core::ArmState state;
    state.dt = core::CYCLE, state.session = 1, state.is_running = true;
    return state;
}

inline core::Values joint_1(double value) { return {value, 0, 0, 0, 0, 0, 0}; }
