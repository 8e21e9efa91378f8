"""Supervision of the load that EGM's references put on the drives."""

from __future__ import annotations

from dataclasses import replace

import pytest

from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, home
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel, MotionState
from virtual_irc5.mechanics.dynamics import ArmDynamics
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from virtual_irc5.mechanics.load_supervision import LoadSupervision, Overload

HOME = home(Side.LEFT)
MODEL = ArmModel(supervises_load=True)
CYCLE = 0.004032
FAST = EgmMotionParameters(gain=5.0, bandwidth=0.0, max_speed=7.0)


@pytest.fixture
def load() -> LoadSupervision:
    return LoadSupervision(Side.LEFT, MODEL, HOME)


@pytest.fixture
def arm() -> VirtualArm:
    arm = VirtualArm(Side.LEFT, model=MODEL)
    arm.switch_motors_on()
    arm.start_egm(FAST)
    return arm


def beside(by: float, *indices: int) -> Joints:
    return tuple(value + (by if index in indices else 0.0) for index, value in enumerate(HOME))


def pushed(acceleration: float) -> MotionState:
    return MotionState(HOME, ZERO_JOINTS, (acceleration, *ZERO_JOINTS[1:]))


def test_load_begins_with_what_holds_the_arm(load: LoadSupervision) -> None:
    assert load.torque == ArmDynamics(Side.LEFT, MODEL.payload).torque(HOME)
    assert load.advance(MotionState(HOME), CYCLE) is None


def test_load_that_lasts_is_the_torque_the_motion_needs(load: LoadSupervision) -> None:
    for _ in range(50):
        load.advance(pushed(20.0), CYCLE)
    assert load.torque == pytest.approx(ArmDynamics(Side.LEFT, MODEL.payload).torque(*vars_of(pushed(20.0))))


def vars_of(state: MotionState) -> tuple[Joints, Joints, Joints]:
    return state.position, state.velocity, state.acceleration


def test_short_peak_passes_and_a_longer_one_does_not(load: LoadSupervision) -> None:
    assert load.advance(pushed(400.0), 0.001) is None
    overload = load.advance(pushed(400.0), 0.02)
    assert overload is not None
    assert (overload.joint, overload.limit) == (0, 72.0)
    assert overload.torque > overload.limit


@pytest.mark.parametrize("parts", [1, 4, 20])
def test_load_is_the_same_however_time_is_divided(load: LoadSupervision, parts: int) -> None:
    for _ in range(parts):
        load.advance(pushed(50.0), 0.02 / parts)
    once = LoadSupervision(Side.LEFT, MODEL, HOME)
    once.advance(pushed(50.0), 0.02)
    assert load.torque == pytest.approx(once.torque)


def test_heavier_payload_is_a_higher_load() -> None:
    heavy = replace(MODEL, payload=replace(MODEL.payload, mass=0.5))
    loads = [LoadSupervision(Side.LEFT, model, beside(1.2, 1)) for model in (MODEL, heavy)]
    assert abs(loads[1].torque[1]) > abs(loads[0].torque[1]) + 0.3


def test_step_of_several_joints_overloads_the_arm(arm: VirtualArm) -> None:
    arm.set_reference(beside(0.7, 0, 2, 3), None)
    arm.advance(0.1)
    assert arm.overload is not None


def test_arm_that_is_not_supervised_is_never_overloaded() -> None:
    arm = VirtualArm(Side.LEFT, model=ArmModel(supervises_load=False))
    arm.switch_motors_on()
    arm.start_egm(FAST)
    arm.set_reference(beside(0.7, 0, 2, 3), None)
    arm.advance(0.1)
    assert arm.overload is None


def test_small_step_of_one_joint_is_bearable(arm: VirtualArm) -> None:
    arm.set_reference(beside(0.2, 6), None)
    arm.advance(1.0)
    assert arm.overload is None


def test_new_session_forgets_the_overload(arm: VirtualArm) -> None:
    arm.set_reference(beside(0.7, 0, 2, 3), None)
    arm.advance(0.1)
    arm.stop_egm()
    arm.advance(2.0)
    arm.start_egm(FAST)
    assert arm.overload is None


def test_motions_of_the_controller_itself_are_not_supervised() -> None:
    arm = VirtualArm(Side.LEFT, model=replace(MODEL, torque=(1.0,) * 7))
    arm.switch_motors_on()
    arm.move_to(beside(0.5, 0))
    arm.advance(1.0)
    assert arm.overload is None


def test_step_after_motion_within_the_limits_overloads_as_if_all_torques_had_been_computed() -> None:
    always, seldom = (LoadSupervision(Side.LEFT, MODEL, HOME) for _ in range(2))
    always._is_strong = False  # computes the torque in each cycle
    found: list[Overload] = []
    for index in range(120):
        change = 600.0 if index >= 100 else 0.2
        position = (HOME[0] + 0.002 * min(index, 100), *HOME[1:])
        state = MotionState(position, (0.5, *ZERO_JOINTS[1:]), (change, *ZERO_JOINTS[1:]))
        overloads = [load.advance(state, CYCLE) for load in (always, seldom)]
        assert (overloads[0] is None) == (overloads[1] is None)
        if None not in overloads:
            found = [each for each in overloads if each is not None]
            break
    assert index >= 100
    assert found[1].joint == found[0].joint
    assert found[1].torque == pytest.approx(found[0].torque, rel=1e-3)
