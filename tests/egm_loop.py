"""Both ends of one arm's EGM in virtual time with a joint position controller; see :mod:`yumi_evaluation.virtual_time`.

The whole robot, with RAPID and RWS, is in ``system/virtual_time_bench.py``.
"""

from __future__ import annotations

from dataclasses import replace

from abb_protocols.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, Joints, Side, joints
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import MemoryBuffer, write_goal
from yumi.control.limiter import Limiter
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.egm_session import ROBOT_SILENCE
from yumi_evaluation.virtual_time import FULL_SPEED, VirtualArmEnd, VirtualArmRig, Wire

__all__ = ["CONTROLLER", "CYCLE", "FULL_SPEED", "SUPERVISED", "EgmLoop", "OpenLimiter", "VirtualArmEnd", "Wire"]

CONTROLLER = "joint_position_controller"

SUPERVISED = ArmModel(supervises_load=True)
"""An arm that stops with 50375 as the real one does."""


_NO_LIMIT = joints([1e9] * JOINT_COUNT)


class OpenLimiter(Limiter):
    """No guard but the ranges: what the controllers want is what the robot gets."""

    def __init__(self) -> None:
        super().__init__(replace(YUMI_LIMITS, velocity=_NO_LIMIT, acceleration=_NO_LIMIT, jerk=_NO_LIMIT))


class EgmLoop(VirtualArmRig):
    """A lone arm and our fast line with a joint position controller, :data:`CONTROLLER`, configured and not active.

    Args:
        side: the arm.
        guard: of the fast line; the real one when left out, :class:`OpenLimiter` for none.
        model: dynamics of the virtual arm.
        silence: EGM has ended for our end after this time without a datagram [s].
    """

    def __init__(
        self,
        side: Side = Side.LEFT,
        limiter: Limiter | None = None,
        model: ArmModel = SUPERVISED,
        *,
        silence: float = ROBOT_SILENCE,
    ) -> None:
        self._goals = MemoryBuffer()
        controllers = {CONTROLLER: JointPositionController(self._goals)}
        super().__init__(controllers, side=side, limiter=limiter, model=model, silence=silence)

    def begin(self, motion: EgmMotionSettings = FULL_SPEED) -> None:
        """Start EGM, and let the controller command as soon as the robot follows."""
        self.start(motion)
        self.activate()

    def activate(self) -> None:
        self.manager.switch((CONTROLLER,), (), self.line.state)

    def deactivate(self) -> None:
        self.manager.switch((), (CONTROLLER,), self.line.state)

    def go(self, goal: Joints) -> None:
        """Order a goal [rad], (7,)."""
        write_goal(self._goals, self.snapshot.session, goal)
