"""Inverse dynamics for any motion: against the energies, between the arms, and within the drives' torque."""

from __future__ import annotations

import pytest
from arm_bodies import ArmBodies, H, moved
from hypothesis import given, settings
from hypothesis import strategies as st

from abb_protocols.robot.description import HAND, Mass
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Joints, Side
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.dynamics import ArmDynamics

MOST_PAYLOAD = Mass(0.5, HAND.centre, tuple(2.2 * value for value in HAND.inertia))
MIRROR = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0)  # of the joints, left to right

positions = st.tuples(*(st.floats(low, high) for low, high in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)))
speeds = st.tuples(*(st.floats(-most, most) for most in YUMI_LIMITS.velocity))
accelerations = st.tuples(*(st.floats(-most, most) for most in YUMI_LIMITS.acceleration))
payloads = st.sampled_from([None, HAND, MOST_PAYLOAD])
sides = st.sampled_from(Side)


def frictionless(side: Side, payload: Mass | None) -> ArmDynamics:
    return ArmDynamics(side, payload, friction=ZERO_JOINTS)


@given(sides, payloads, positions, speeds, accelerations)
def test_torque_is_what_lagrange_derives_from_the_energies(
    side: Side, payload: Mass | None, position: Joints, velocity: Joints, acceleration: Joints
) -> None:
    torque = frictionless(side, payload).torque(position, velocity, acceleration)
    assert torque == pytest.approx(ArmBodies(side, payload).torque(position, velocity, acceleration), abs=1e-4)


@given(sides, payloads, positions, speeds, accelerations)
def test_power_of_the_drives_is_what_the_energy_of_the_arm_gains(
    side: Side, payload: Mass | None, position: Joints, velocity: Joints, acceleration: Joints
) -> None:
    bodies = ArmBodies(side, payload)

    def energy(time: float) -> float:
        q = moved(moved(position, velocity, time), acceleration, 0.5 * time * time)
        return bodies.kinetic(q, moved(velocity, acceleration, time)) + bodies.potential(q)

    torque = frictionless(side, payload).torque(position, velocity, acceleration)
    power = sum(moment * speed for moment, speed in zip(torque, velocity, strict=True))
    assert power == pytest.approx((energy(H) - energy(-H)) / (2.0 * H), abs=1e-3)


@given(sides, positions, speeds)
def test_friction_takes_power_from_every_motion(side: Side, position: Joints, velocity: Joints) -> None:
    with_friction, without = ArmDynamics(side).torque(position, velocity), frictionless(side, None)
    lost = [a - b for a, b in zip(with_friction, without.torque(position, velocity), strict=True)]
    assert all(moment * speed >= 0.0 for moment, speed in zip(lost, velocity, strict=True))


@given(positions, speeds, accelerations)
def test_arms_are_the_same_machine_but_for_their_mounting(
    position: Joints, velocity: Joints, acceleration: Joints
) -> None:
    left, right = (ArmDynamics(side, HAND, gravity=0.0).torque(position, velocity, acceleration) for side in Side)
    assert left == right


@given(positions)
def test_load_on_the_tool_axis_weighs_the_same_on_a_mirrored_arm(position: Joints) -> None:
    mirrored = tuple(sign * angle for sign, angle in zip(MIRROR, position, strict=True))
    left, right = held(Side.LEFT, position), held(Side.RIGHT, mirrored)
    assert right == pytest.approx([sign * moment for sign, moment in zip(MIRROR, left, strict=True)], abs=1e-9)


def held(side: Side, position: Joints) -> Joints:
    """What a load on the tool axis adds to the torque; the links themselves have no mirror plane."""
    load = Mass(0.5, (0.0, 0.0, 0.05), (0.0,) * 6)
    loaded, bare = ArmDynamics(side, load).torque(position), ArmDynamics(side).torque(position)
    return tuple(more - less for more, less in zip(loaded, bare, strict=True))


@settings(max_examples=500)
@given(sides, positions, speeds, accelerations)
def test_every_motion_within_the_limits_leaves_the_drives_a_margin(
    side: Side, position: Joints, velocity: Joints, acceleration: Joints
) -> None:
    torque = ArmDynamics(side, MOST_PAYLOAD).torque(position, velocity, acceleration)
    shares = [abs(moment) / most for moment, most in zip(torque, ArmModel().torque, strict=True)]
    assert max(shares) < 0.95
