"""The joint state broadcaster: passes every measured state of an arm on for publishing."""

from __future__ import annotations

from yumi.control.controller import Buffer, Controller
from yumi.control.shared_state import JointStates
from yumi.robot.joints import ArmCommand, ArmState


class JointStateBroadcaster(Controller):
    """Puts the time, the 7 positions [rad] and the 7 velocities [rad/s] of each state into a buffer.

    Args:
        states: where the states go.
    """

    kind = "joint_state_broadcaster/JointStateBroadcaster"
    is_command = False

    def __init__(self, states: Buffer[JointStates]) -> None:
        self._states = states

    def activate(self, state: ArmState) -> None:
        """Begins with the next state."""

    def update(self, state: ArmState) -> ArmCommand | None:
        self._states.write(JointStates(state.time, state.position, state.velocity))
        return None
