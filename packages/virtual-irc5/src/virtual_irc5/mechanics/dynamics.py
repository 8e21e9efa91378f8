"""Inverse dynamics of one arm, by MuJoCo: the torque that a motion needs.

Bodies, friction and mounting are those of reference/yumi.md §1.3-1.9, in the frames of the URDF.
"""

from __future__ import annotations

from functools import lru_cache
from math import tanh
from typing import Any

from abb_protocols.robot.description import (
    FLANGE_ORIGIN,
    JOINT_FRICTION,
    TOOL0_ORIGIN,
    Mass,
    Origin,
    link_mass,
    link_origins,
)
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, Vector, rotate
from abb_protocols.robot.kinematics import foot_to_body, inverse_pose, quaternion_from_euler_zyx
from abb_protocols.robot.load import principal_inertia

GRAVITY = 9.81
"""Acceleration of free fall [m/s²]."""

DRIVE_INERTIA: Joints = (0.10, 0.10, 0.05, 0.05, 0.01, 0.01, 0.01)
"""Inertia of each motor seen at its joint, chain order [kg m²]: our estimate, ABB publishes none.

Rotors of 1e-5, 5e-6 and 1e-6 kg m² behind gears of 100:1.
"""

_FULL_FRICTION_SPEED = 0.01
"""Speed above which friction no longer grows [rad/s]; below, it goes through zero without a jump."""


class ArmDynamics:
    """Inverse dynamics of one arm.

    Args:
        side: the arm; the two are mounted differently.
        payload: what hangs on tool0, seen from tool0; None is a bare flange.
        friction: Coulomb friction of each joint [N m], (7,).
        drive_inertia: inertia of each motor seen at its joint [kg m²], (7,).
        gravity: [m/s²].
    """

    def __init__(
        self,
        side: Side,
        payload: Mass | None = None,
        *,
        friction: Joints = JOINT_FRICTION,
        drive_inertia: Joints = DRIVE_INERTIA,
        gravity: float = GRAVITY,
    ) -> None:
        import mujoco  # noqa: PLC0415 - what runs no virtual robot need not wait for it

        self._friction, self._inverse = friction, mujoco.mj_inverse
        pull = rotate(inverse_pose(foot_to_body(side)).orientation, (0.0, 0.0, -gravity))
        self._model = _arm_model(payload, drive_inertia, pull)
        self._data: Any = mujoco.MjData(self._model)

    def torque(self, position: Joints, velocity: Joints = ZERO_JOINTS, acceleration: Joints = ZERO_JOINTS) -> Joints:
        """What the drives have to give at the joints, chain order [N m], (7,).

        Args:
            position: joint positions [rad], (7,).
            velocity: joint speeds [rad/s], (7,).
            acceleration: joint accelerations [rad/s²], (7,).
        """
        data = self._data
        data.qpos[:], data.qvel[:], data.qacc[:] = position, velocity, acceleration
        self._inverse(self._model, data)
        rows = zip(data.qfrc_inverse.tolist(), self._friction, velocity, strict=True)
        return tuple([load + most * tanh(speed / _FULL_FRICTION_SPEED) for load, most, speed in rows])


@lru_cache(maxsize=8)  # nothing changes it, and it takes 1.5 ms
def _arm_model(payload: Mass | None, drive_inertia: Joints, gravity: Vector) -> Any:
    """An arm whose foot stands in the world, and is pulled at as the arm is on its robot."""
    import mujoco  # noqa: PLC0415 - what runs no virtual robot need not wait for it

    spec = mujoco.MjSpec()
    spec.option.gravity = gravity
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    body = spec.worldbody
    for index, origin in enumerate(link_origins()):
        body = body.add_body(**_placed(origin), **_inertial(link_mass(index)))
        body.add_joint(axis=(0.0, 0.0, 1.0), armature=drive_inertia[index])
    for origin in (FLANGE_ORIGIN, TOOL0_ORIGIN):
        body = body.add_body(**_placed(origin))
    if payload is not None:
        body.add_body(**_inertial(payload))
    return spec.compile()


def _placed(origin: Origin) -> dict[str, Any]:
    return {"pos": origin.xyz, "quat": quaternion_from_euler_zyx(origin.rpy)}


def _inertial(body: Mass) -> dict[str, Any]:
    """A body as MuJoCo has it."""
    axes, moments = principal_inertia(body)
    return {"explicitinertial": True, "mass": body.mass, "ipos": body.centre, "iquat": axes, "inertia": moments}
