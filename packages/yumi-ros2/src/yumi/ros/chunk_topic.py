"""Chunks of a policy on a topic: ``~/chunks`` of each trajectory controller and of both arms, and ``~/chunk_state``.

A chunk is a trajectory_msgs/JointTrajectory with positions alone. ``header.stamp`` is when its time 0 is due; 0 is at
once. Each replaces what has not been executed yet. What became of it is published as four numbers: points that were too
late, points of earlier chunks that it replaced, time from its arrival until the arms are on its own path [s], and until
its last point is due [s].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from abb_protocols.catalogue import message
from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import JointLimits, Side, joint_names
from abb_runtime.clock import Clock
from yumi.control.chunk_commands import ChunkTaken, FollowChunk
from yumi.control.loop_commands import CommandPort, Commands, ControllerCommand
from yumi.control.trajectory_commands import ResultCode, trajectory_refused
from yumi.planning.chunk_plan import plan_chunk
from yumi.planning.trajectory_request import JointTrajectory as Trajectory
from yumi.planning.trajectory_request import check_trajectory_joints
from yumi.ros.topic_refusals import RefusalLog, check_wait, waited_for
from yumi.ros.trajectory_messages import stamp_of, trajectory_of


class ChunkTopic:
    """Serves both topics of one controller, which must be active: a policy takes no arm over by sending.

    Args:
        node: the controller's node.
        group: of its commands.
        name: of the controller on each arm.
        sides: its arms; a chunk names all joints of one or more of them.
        control: where the controllers are commanded.
        clock: the machine's clock.
        limits: of the joints.
    """

    def __init__(
        self,
        node: Any,
        group: Any,
        name: str,
        sides: Sequence[Side],
        control: CommandPort,
        clock: Clock,
        limits: JointLimits,
    ) -> None:
        self._name, self._sides = name, sides
        self._control, self._clock, self._limits = control, clock, limits
        self._ros_clock = node.get_clock()
        self._numbers = count(1)
        self._refusals = RefusalLog(node.get_logger(), clock.now)
        self._states = node.create_publisher(Float64MultiArray, "~/chunk_state", 10)
        # The newest one counts: an older one that waits is not worth following any more.
        node.create_subscription(JointTrajectory, "~/chunks", self._receive, 1, callback_group=group)

    def _receive(self, received: Any, info: Mapping[str, Any]) -> None:
        try:
            check_wait("Chunk", waited_for(info))
            taken, now = self._take(received), self._clock.now()
        except YumiError as error:
            self._refusals.warn(error.said)
            return
        late, replaced = (max(getattr(each, name) for each in taken) for name in ("late", "replaced"))
        joined, until = (max(getattr(each, name) for each in taken) - now for name in ("joined", "until"))
        self._states.publish(Float64MultiArray(data=[float(late), float(replaced), joined, until]))

    def _take(self, received: Any) -> list[ChunkTaken]:
        trajectory, stamped, now = trajectory_of(received), stamp_of(received), self._clock.now()
        start = now + (stamped - int(self._ros_clock.now().nanoseconds)) * 1e-9 if stamped else now
        number = next(self._numbers)
        commands = [
            ControllerCommand(side, self._name, FollowChunk(number, start, plan, is_of_both=len(self._sides) > 1))
            for side, plan in chunk_topic_plans(trajectory, self._sides, self._limits).items()
        ]
        made = self._control.call(Commands.take_commands, *commands).made
        return [each for each in made.values() if isinstance(each, ChunkTaken)]


def chunk_topic_plans(trajectory: Trajectory, sides: Sequence[Side], limits: JointLimits) -> Mapping[Side, Any]:
    """The spline of each arm whose joints a chunk names.

    Raises:
        CommandRefused: it names other joints, or an arm in part, or its points cannot be followed.
    """
    given, known = trajectory.joint_names, [name for side in sides for name in joint_names(side)]
    check_trajectory_joints(given, known, may_leave_out=True)
    for number, point in enumerate(trajectory.points, 1):
        if len(point.position) != len(given):
            raise trajectory_refused(
                message(
                    "point_value_count",
                    point=number,
                    count=len(point.position),
                    quantity="positions",
                    joints=len(given),
                )
            )
    times = [point.time for point in trajectory.points]
    plans = {}
    for side in sides:
        names = joint_names(side)
        missing = tuple(name for name in names if name not in given)
        if len(missing) == len(names):
            continue
        if missing:
            raise trajectory_refused(message("trajectory_joints_missing", missing=missing), ResultCode.INVALID_JOINTS)
        columns = [given.index(name) for name in names]
        rows = [[float(point.position[column]) for column in columns] for point in trajectory.points]
        plans[side] = plan_chunk(side, times, np.array(rows), limits)
    return plans
