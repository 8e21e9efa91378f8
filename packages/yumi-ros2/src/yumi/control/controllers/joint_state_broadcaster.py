"""The joint state broadcaster: passes the state of the joints on, and commands nothing."""

from __future__ import annotations

from abb_protocols.robot.joints import ArmCommand, ArmState
from abb_runtime.parameters import Parameter
from yumi.control.controller import Controller
from yumi.control.goals import Buffer
from yumi.control.place import Place
from yumi.control.shared_state import JointStates


class JointStateBroadcaster(Controller):
    """Puts the time, the 7 positions [rad] and the 7 velocities [rad/s] of each state into a buffer.

    Args:
        states: where the states go.
    """

    kind = "joint_state_broadcaster/JointStateBroadcaster"
    is_command = False

    def __init__(self, states: Buffer[JointStates]) -> None:
        self._states = states

    @classmethod
    def make(cls, place: Place) -> JointStateBroadcaster:
        return cls(place.buffers.states)

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        every = "all joints are published, with position and velocity"
        one = "joint_states has them, in the namespace of the arm"
        return (
            Parameter("joints", joint_names, fixed=every),
            Parameter("interfaces", ("position", "velocity"), fixed=every),
            Parameter("extra_joints", (), fixed=every),
            Parameter("map_interface_to_joint_state", (), fixed=every),
            Parameter("use_urdf_to_filter", default=True, fixed="all joints are in the robot description"),
            Parameter("use_local_topics", default=False, fixed=one),
            Parameter("publish_dynamic_joint_states", default=False, fixed=one),
            Parameter("frame_id", (), fixed="the driver sets the frame"),
        )

    def activate(self, state: ArmState) -> None:
        """Begins with the next state."""

    def update(self, state: ArmState) -> ArmCommand | None:
        self._states.write(JointStates(state.time, state.position, state.velocity))
        return None
