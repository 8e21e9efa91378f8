"""Contacts of the virtual robot's arms with each other and with the body, and the contact that ContactL seeks.

The shapes that may touch are those of the URDF that the robot publishes, without padding, and MuJoCo places them by
that URDF: nothing here is shared with the limiter that keeps the arms apart, so that a run without contact is the
limiter's doing. Links of one arm do not touch each other here.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import Enum, auto
from functools import cache
from typing import Any

from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Joints, Side, finger_names, joint_names, prefixed
from abb_protocols.robot.urdf import robot_description

_ARMS_DEPTH = 0.003
"""Parts of both arms that overlap by less do not touch: the shapes are fitted to the outsides of covers [m]."""

_BODY_DEPTH = 0.030
"""The same of an arm and the body, which at home are 7 mm apart: boxes stand for its rounded covers [m]."""

_DEEPER = 0.001  # [m] parts that overlap already touch anew once they are deeper by this
_MOVED = 0.004  # [rad] of all joints together; with less, no part has moved by more than _ARMS_DEPTH
_FINGERS_MOVED = 1e-4  # [m]

# Which shapes MuJoCo compares, as bits.
_OF_BODY = 1
_OF_ARM = {side: 2 << 2 * index for index, side in enumerate(Side)}
_OF_SHOULDER = {side: 2 * bit for side, bit in _OF_ARM.items()}


@cache  # a robot has one, and nothing changes it
def _contact_model(*grippers: tuple[Side, GripperModules]) -> Any:
    """The shapes of a robot with these grippers, and which of them are compared."""
    import mujoco  # noqa: PLC0415 - what runs no virtual robot need not wait for it

    spec = mujoco.MjSpec.from_string(robot_description(grippers=dict(grippers)))
    for shape in spec.geoms:
        shape.contype, shape.conaffinity = _OF_BODY, 0
    for side in Side:
        shoulder = spec.body(prefixed(f"yumi_link_1_{side.value}"))
        for shape in shoulder.find_all("geom"):
            shape.contype, shape.conaffinity = (
                _OF_ARM[side],
                _OF_ARM[side.other] | _OF_SHOULDER[side.other] | _OF_BODY,
            )
        for shape in shoulder.geoms:  # bolted to the body
            shape.contype, shape.conaffinity = _OF_SHOULDER[side], 0
    return spec.compile()


class Contact(Enum):
    """What ContactL waits for."""

    SOUGHT = auto()
    MADE = auto()


class ContactDetector:
    """Sees when parts begin to touch.

    Parts that overlap from the beginning, or that were let through, may come apart: only what gets deeper touches anew.

    Args:
        grippers: the modules of each gripper.
        positions: where the arms are at first [rad], (7,) each.

    Attributes:
        free: where the arms were last before they touched anything new [rad], (7,) each.
    """

    def __init__(self, grippers: Mapping[Side, GripperModules], positions: Mapping[Side, Joints]) -> None:
        import mujoco  # noqa: PLC0415 - what runs no virtual robot need not wait for it

        self._mujoco = mujoco
        self._model = _contact_model(*((side, grippers[side]) for side in Side))
        self._data: Any = mujoco.MjData(self._model)
        self._joints = {
            side: [int(self._model.joint(name).qposadr[0]) for name in (*joint_names(side), *finger_names(side))]
            for side in Side
        }
        roots = {self._model.body(prefixed(f"yumi_link_1_{side.value}")).id: side for side in Side}
        self._side_of = [roots.get(root) for root in self._model.body_rootid[self._model.geom_bodyid].tolist()]
        self.free = dict(positions)
        self._fingers = dict.fromkeys(Side, 0.0)
        self._allowed = self._overlaps(positions, self._fingers)

    def touched(
        self, positions: Mapping[Side, Joints], fingers: Mapping[Side, float], supervised: Collection[Side]
    ) -> Mapping[Side, str]:
        """What the arms touch, by the arm that has moved there; to be asked in every cycle.

        Args:
            positions: of both arms [rad], (7,) each.
            fingers: of each gripper, from its middle [m].
            supervised: the arms that notice when they touch something; others are let through.
        """
        if positions == self.free:
            return {}
        changes = {
            side: sum(abs(now - before) for now, before in zip(positions[side], self.free[side], strict=True))
            for side in Side
        }
        if sum(changes.values()) < _MOVED:
            return {}
        if any(abs(fingers[side] - self._fingers[side]) > _FINGERS_MOVED for side in Side):
            # They have opened into something while the arms stood: that is no motion of the arms.
            self._fingers, self._allowed = dict(fingers), self._overlaps(self.free, fingers)
        allowed, touched = dict[tuple[int, int], float](), dict[Side, str]()
        for pair, depth in self._overlaps(positions, fingers).items():
            sides = [side for side in map(self._side_of.__getitem__, pair) if side is not None]
            moved = [side for side in sides if changes[side] > 0.0 and side in supervised]
            allowed[pair] = min(depth, self._allowed.get(pair, depth)) if moved else depth
            if moved and depth > self._allowed.get(pair, 0.0) + _DEEPER:
                met = {side: f"the {side.other.word} arm" if len(sides) > 1 else "the robot's body" for side in moved}
                touched.update(met)
        if not touched:
            self.free, self._allowed = dict(positions), allowed
        return touched

    def _overlaps(
        self, positions: Mapping[Side, Joints], fingers: Mapping[Side, float]
    ) -> dict[tuple[int, int], float]:
        """Of shapes that overlap by more than those of two that touch may, by how much [m]."""
        for side, places in self._joints.items():
            self._data.qpos[places] = (*positions[side], fingers[side], fingers[side])
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_collision(self._model, self._data)
        found, depths = self._data.contact, dict[tuple[int, int], float]()
        for (one, other), distance in zip(found.geom.tolist(), found.dist.tolist(), strict=True):
            is_body = self._side_of[one] is None or self._side_of[other] is None
            if distance < -(_BODY_DEPTH if is_body else _ARMS_DEPTH):
                depths[one, other] = max(-distance, depths.get((one, other), 0.0))
        return depths
