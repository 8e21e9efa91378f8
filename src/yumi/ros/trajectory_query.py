"""The service ``~/query_state``: where the trajectory that is followed has the joints at some moment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from control_msgs.srv import QueryTrajectoryState

from yumi.clock import Clock
from yumi.control.mailbox import Mailbox
from yumi.control.point_motion import Setpoint
from yumi.control.spline import Walk
from yumi.control.trajectory import ArmPlan
from yumi.control.trajectory_feedback import TrajectoryFeedback, peek_feedback
from yumi.robot.joints import Side, joint_names

_FRESH = 0.5  # [s] a controller that is active tells how it follows many times within this time

Plans = Mapping[Side, ArmPlan]
Feedbacks = Mapping[Side, TrajectoryFeedback]


class TrajectoryQuery:
    """Serves ``~/query_state`` as upstream.

    ``success`` is false when the controller is inactive or, with the present values, when nothing is followed or the
    time is before the first point, to which the controller plans the way itself, or after the last.

    Args:
        node: the controller's node.
        feedback: by arm; where the controllers let others see how they follow.
        clock: the machine's clock.
    """

    def __init__(self, node: Any, feedback: Mapping[Side, Mailbox], clock: Clock) -> None:
        self._ros_clock = node.get_clock()
        self._feedback = feedback
        self._clock = clock
        self._followed: tuple[int, Plans] = (0, {})
        node.create_service(QueryTrajectoryState, "~/query_state", self.answer)

    def note(self, number: int, plans: Plans) -> None:
        """The controllers have taken ``plans``, the order ``number``."""
        self._followed = (number, plans)

    def forget(self, number: int) -> None:
        """The motion of the order ``number`` has ended: its plans may be long."""
        if self._followed[0] == number:
            self._followed = (0, {})

    def answer(self, request: Any, response: Any) -> Any:
        """Fill ``response`` for the time of ``request``; 0 is now."""
        letters = {side: peek_feedback(box) for side, box in self._feedback.items()}
        feedbacks = {side: letter[1] for side, letter in letters.items() if letter is not None}
        now = self._clock.now()
        if len(feedbacks) < len(letters) or any(now - each.time > _FRESH for each in feedbacks.values()):
            response.message = "The controller is not active; activate it first."
            return response
        stamp = request.time.sec * 1_000_000_000 + request.time.nanosec
        time = now + (stamp - int(self._ros_clock.now().nanoseconds)) * 1e-9 if stamp else now
        setpoints = self._sample(feedbacks, time)
        response.success = bool(setpoints)
        response.message = "" if setpoints else "No trajectory is followed at that time; ask for a time within one."
        return _filled(response, feedbacks, setpoints)

    def _sample(self, feedbacks: Feedbacks, time: float) -> Mapping[Side, Setpoint]:
        number, plans = self._followed
        if any(feedback.goal != number or not number for feedback in feedbacks.values()):
            return {}
        setpoints = {}
        for side, feedback in feedbacks.items():
            spline, moment = plans[side].spline, feedback.progress + (time - feedback.time) * feedback.scale
            if not spline.begin <= moment <= spline.end:
                return {}
            setpoints[side] = Walk(spline).setpoint(moment)
        return setpoints


def _filled(response: Any, feedbacks: Feedbacks, setpoints: Mapping[Side, Setpoint]) -> Any:
    present = {side: Setpoint(each.actual, each.actual_velocity) for side, each in feedbacks.items()}
    rows = (setpoints or present).values()
    response.name = [name for side in feedbacks for name in joint_names(side)]
    response.position = [value for row in rows for value in row.position]
    response.velocity = [value for row in rows for value in row.velocity]
    response.acceleration = [value for row in rows for value in row.acceleration]
    return response
