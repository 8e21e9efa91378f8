"""The service that returns the place of a trajectory at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from control_msgs.srv import QueryTrajectoryState

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side, joint_names
from abb_runtime.clock import Clock
from yumi.control.goals import Buffer
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import SplineSampler
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.trajectory_commands import ArmPlan
from yumi.ros.messages import SERVICES_QOS, nanoseconds

FRESH_TRAJECTORY_FEEDBACK = 0.5  # [s] an active controller writes its feedback many times within this time

_Plans = Mapping[Side, ArmPlan]
_Feedbacks = Mapping[Side, TrajectoryFeedback]


class TrajectoryQuery:
    """Serves ``~/query_state`` as upstream.

    ``success`` is false when the controller is inactive or, with the present values, when nothing is followed or the
    time is before the first point, to which the controller plans the way itself, or after the last.
    """

    def __init__(self, node: Any, feedback: Mapping[Side, Buffer[TrajectoryFeedback]], clock: Clock) -> None:
        self._ros_clock = node.get_clock()
        self._feedback = feedback
        self._clock = clock
        self._followed: tuple[int, _Plans] = (0, {})
        node.create_service(QueryTrajectoryState, "~/query_state", self.answer, qos_profile=SERVICES_QOS)

    def note(self, number: int, plans: _Plans) -> None:
        """The controllers have accepted ``plans`` as goal ``number``."""
        self._followed = (number, plans)

    def forget(self, number: int) -> None:
        """The motion of goal ``number`` has ended: its plans may be long."""
        if self._followed[0] == number:
            self._followed = (0, {})

    def answer(self, request: Any, response: Any) -> Any:
        """Fill ``response`` for the time of ``request``; 0 is now."""
        newest = {side: buffer.read() for side, buffer in self._feedback.items()}
        feedbacks = {side: each[1] for side, each in newest.items() if each is not None}
        now = self._clock.now()
        if len(feedbacks) < len(newest) or any(
            now - each.time > FRESH_TRAJECTORY_FEEDBACK for each in feedbacks.values()
        ):
            response.message = "The controller is not active; activate it first."
            return response
        try:
            stamp = nanoseconds(request.time, "Query refused: time")
        except CommandRefused as refusal:
            response.message = str(refusal)
            return response
        time = now + (stamp - int(self._ros_clock.now().nanoseconds)) * 1e-9 if stamp else now
        setpoints = self._sample(feedbacks, time)
        response.success = bool(setpoints)
        response.message = "" if setpoints else "No trajectory is followed at that time; ask for a time within one."
        present = {side: Setpoint(each.actual, each.actual_velocity) for side, each in feedbacks.items()}
        rows = (setpoints or present).values()
        response.name = [name for side in feedbacks for name in joint_names(side)]
        response.position = [value for row in rows for value in row.position]
        response.velocity = [value for row in rows for value in row.velocity]
        response.acceleration = [value for row in rows for value in row.acceleration]
        return response

    def _sample(self, feedbacks: _Feedbacks, time: float) -> Mapping[Side, Setpoint]:
        number, plans = self._followed
        if any(feedback.goal != number or not number for feedback in feedbacks.values()):
            return {}
        setpoints = {}
        for side, feedback in feedbacks.items():
            spline, moment = plans[side].spline, feedback.progress + (time - feedback.time) * feedback.scale
            if not spline.begin <= moment <= spline.end:
                return {}
            setpoints[side] = SplineSampler(spline).setpoint(moment)
        return setpoints
