"""One arm with a Cartesian controller and a virtual robot, in virtual time, and what its tool has done."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.inverse_kinematics import arm_angle
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Pose, Quaternion, Side, joints
from abb_protocols.robot.kinematics import quaternion_product, rotation_vector, tool0_to_body
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_events import ControllerReport
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.tool_goal import ToolGoal
from yumi.control.tool_limits import ToolLimits
from yumi.control.trajectory_commands import ArmPlan, FollowTrajectory, TrajectoryEnded
from yumi_evaluation.virtual_time import VirtualArmRig

NAME = "cartesian_controller"
Array = NDArray[np.float64]


class CartesianBench:
    """An arm that follows, with the Cartesian controller active."""

    def __init__(
        self,
        side: Side,
        position: Joints,
        speed: SpeedScale | None = None,
        within: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
    ) -> None:
        self.side = side
        self.goals = MemoryBuffer[ToolGoal]()
        feedback = MemoryBuffer[TrajectoryFeedback]()
        self.controller = CartesianController(side, self.goals, feedback, speed=speed, within=within)
        self.rig = VirtualArmRig({NAME: self.controller}, side=side, position=position, speed=speed)
        self.rig.start()
        self.rig.switch_to(NAME)
        self.rig.run(0.1)

    @property
    def start(self) -> Joints:
        """Where the arm is commanded to be."""
        reference = self.rig.manager.reference
        assert reference is not None
        return reference

    def follow(self, plan: ArmPlan, number: int = 1) -> TrajectoryEnded:
        """Follow a plan to its end."""
        self.rig.manager.receive(NAME, FollowTrajectory(plan, number), self.rig.line.state)
        self.rig.run_until(lambda: bool(self.ended), plan.spline.end + 2.0)
        return self.ended[-1]

    @property
    def ended(self) -> list[TrajectoryEnded]:
        reports = (event.report for event in self.rig.events if isinstance(event, ControllerReport))
        return [report for report in reports if isinstance(report, TrajectoryEnded)]

    def stream(self, seconds: float, goal: Callable[[float], ToolGoal | None]) -> None:
        """Run, with what ``goal`` gives for each time since now [s]; None gives nothing in that cycle."""
        for number in range(round(seconds / CYCLE)):
            message = goal(number * CYCLE)
            if message is not None:
                self.goals.write(message._replace(session=self.rig.snapshot.session))
            self.rig.cycle()

    @property
    def sent(self) -> Array:
        """The positions sent in each cycle [rad], (n, 7)."""
        return np.array([cycle.sent.position for cycle in self.rig.cycles])

    @property
    def measured(self) -> Array:
        """The positions measured in each cycle [rad], (n, 7)."""
        return np.array([cycle.state.position for cycle in self.rig.cycles])


class Shares(NamedTuple):
    """The largest of what the joints did, as shares of their limits."""

    velocity: float
    acceleration: float
    jerk: float


def shares(positions: Array) -> Shares:
    """From positions in each cycle, (n, 7)."""
    rates = [np.diff(positions, order, axis=0) / CYCLE**order for order in (1, 2, 3)]
    limits = YUMI_LIMITS.velocity, YUMI_LIMITS.acceleration, YUMI_LIMITS.jerk
    return Shares(*(float(np.max(np.abs(rate) / top)) for rate, top in zip(rates, limits, strict=True)))


def between(start: Quaternion, end: Quaternion) -> Array:
    """The turn from one orientation to another as a rotation vector [rad], (3,)."""
    w, x, y, z = start
    return np.array(rotation_vector(quaternion_product((w, -x, -y, -z), end)))


class Deviation(NamedTuple):
    """How far a tool was from its line: [m], [rad], and of its arm angle [rad]."""

    position: float
    orientation: float
    elbow: float


def deviation(side: Side, positions: Array, start: Pose, goal: Pose, tool: Pose | None = None) -> Deviation:
    """Of positions (n, 7) from the line with an evenly turning orientation, and from the arm angle at its begin."""
    begin, way = np.array(start.position), np.subtract(goal.position, start.position)
    turn, angle = between(start.orientation, goal.orientation), arm_angle(side, joints(positions[0].tolist()))
    length = max(float(way @ way), 1e-12)
    worst = [0.0, 0.0, 0.0]
    for row in positions:
        position = joints(row.tolist())
        pose = tool0_to_body(side, position, tool)
        share = float((np.array(pose.position) - begin) @ way) / length
        off = np.array(pose.position) - begin - share * way
        twisted = between(start.orientation, pose.orientation) - share * turn
        bent = (arm_angle(side, position) - angle + np.pi) % (2.0 * np.pi) - np.pi
        found = (np.linalg.norm(off), np.linalg.norm(twisted), abs(bent))
        worst = [max(a, float(b)) for a, b in zip(worst, found, strict=True)]
    return Deviation(*worst)
