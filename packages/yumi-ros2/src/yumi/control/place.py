"""The place of a controller: the arm that a controller is made for, and the buffers of the arm's controllers."""

from __future__ import annotations

from dataclasses import dataclass

from abb_protocols.robot.joints import JointLimits, Side
from yumi.control.goals import SessionGoal
from yumi.control.shared_memory import SharedBuffer, SharedHistory
from yumi.control.shared_state import JointStates, TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.tool_goal import ToolGoal
from yumi.control.tool_limits import ToolLimits

_STATES = 64  # a quarter of a second, longer than a publisher is ever busy


class ControllerBuffers:
    """What the controllers of one arm share with the driver process.

    Attributes:
        states: the newest measured states, see the joint state broadcaster.
        goals: positions, for controllers that follow a stream of goals.
        point_goals: the same for controllers that plan the way to a single point.
        speeds: speeds of the joints.
        forward_positions: positions by index.
        forward_speeds: speeds by index.
        trajectory: how it follows a trajectory of its own.
        dual_trajectory: how it follows its part of one for both arms.
        tool_goals: poses and velocities of the tool.
        tool_path: how it follows a line of the tool.
    """

    def __init__(self) -> None:
        self.states = SharedHistory(JointStates, _STATES)
        self.goals = SharedBuffer(SessionGoal)
        self.speeds = SharedBuffer(SessionGoal)
        self.forward_positions = SharedBuffer(SessionGoal)
        self.forward_speeds = SharedBuffer(SessionGoal)
        self.trajectory = SharedBuffer(TrajectoryFeedback)
        self.dual_trajectory = SharedBuffer(TrajectoryFeedback)
        self.tool_goals = SharedBuffer(ToolGoal)
        self.tool_path = SharedBuffer(TrajectoryFeedback)
        self.point_goals = SharedBuffer(SessionGoal)


@dataclass(frozen=True, slots=True)
class Place:
    """What a controller is given when it is made in the control process.

    Attributes:
        name: the controller's name.
        side: its arm.
        buffers: what the controllers of its arm share with the driver process.
        halves: controllers of this name that are active, by arm, for what moves both arms.
        limits: what the joints may do in the robot's EGM motion.
        period: time between two datagrams of the arm [s].
        speed: the factor on its speeds.
        tool_limits: what its tool keeps.
    """

    name: str
    side: Side
    buffers: ControllerBuffers
    halves: dict[Side, object]
    limits: JointLimits
    period: float
    speed: SpeedScale
    tool_limits: ToolLimits = ToolLimits()  # noqa: RUF009 - it is frozen
