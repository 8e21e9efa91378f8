"""The dual-arm move-and-grab application of the thesis (listing 3.4), on the driver's ROS interface alone."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from math import degrees, radians
from typing import Any, Protocol, TypeVar

import rclpy

from yumi.driver.stops import demand_confirmation
from yumi.errors import GoalNotReached, RobotNotReady, YumiError
from yumi.robot.joints import Joints, Side, joints
from yumi.ros.clients import ArmClient, Grip, GripperClient, RobotManagerClient, Spinner

T = TypeVar("T")

GOALS: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(value) for value in (42.1, -118.4, -92.1, 46.5, -143.6, 42.5, 36.1)]),
    Side.LEFT: joints([radians(value) for value in (-39.0, -104.1, 80.0, 8.0, 31.0, 93.0, 57.0)]),
}
"""Where the arms go, chain order [rad]."""

CLOSE_ENOUGH = radians(0.1)
"""An arm has arrived when every joint is this near to its goal [rad]."""

OPEN, CLOSED = 0.025, 0.0
"""Finger positions [m]."""

MOVE_TIMEOUT = 30.0
"""Longest time for one motion at full speed [s]."""

RECOVERIES = 3
"""How often the task goes on after the robot has been stopped, for each of its steps; a person says whether."""

_EXPLAINED = 1.5  # [s] after EGM's end the driver knows what stopped the robot


class Progress(Protocol):
    """Whoever shows a person how far the task is."""

    def step(self, sentence: str) -> None:
        """A new step begins."""

    def error(self, side: Side, error_deg: float, share: float) -> None:
        """An arm has come nearer: the largest joint error, and the share of the way done, 0 to 1."""

    def note(self, sentence: str) -> None:
        """A step had a result."""


@dataclass(slots=True)
class ArmReport:
    """What became of one arm's part of the task.

    Attributes:
        duration: from the goal until every joint was near enough [s].
        final_error: largest joint error at the end of the task [rad].
        missed: cycles of the robot without an answer during the task.
        grip: how closing the gripper ended.
        path: times [s] and positions [rad] of every joint state received.
    """

    duration: float = 0.0
    final_error: float = 0.0
    missed: int = 0
    grip: Grip | None = None
    path: list[tuple[float, Joints]] = field(default_factory=list)


class MoveAndGrab:
    """The application; one node of its own.

    Args:
        progress: shows the steps.
        check: called again and again while waiting; raises when the task shall end.
        confirm: asks a person who sees the robot whether it may go on after the stop of this sentence.
    """

    def __init__(
        self, progress: Progress, check: Callable[[], None], confirm: Callable[[str], bool] = lambda _: False
    ) -> None:
        self._confirm = confirm
        self.reports = {side: ArmReport() for side in Side}
        self._progress = progress
        self._node: Any = rclpy.create_node("move_and_grab")
        spinner = Spinner(self._node, check)
        self._spinner = spinner
        self._manager = RobotManagerClient(spinner)
        self._grippers = {side: GripperClient(spinner, side) for side in Side}
        self._arms = {side: ArmClient(spinner, side, self._recorder(side)) for side in Side}
        self._started_egm = False

    def close(self) -> None:
        """Destroy the node."""
        self._spinner.close()
        self._node.destroy_node()

    def run(self) -> None:
        """The whole task.

        Raises:
            YumiError: a step failed.
            Exception: whatever the check raises.
        """
        self._wait_until_ready()
        self._despite_stops(self._start_egm)
        missed = {side: self._arms[side].missed for side in Side}
        self._despite_stops(lambda: self._grip("open both grippers", OPEN))
        for side in (Side.RIGHT, Side.LEFT):
            self._despite_stops(partial(self._move, side))
        grips = self._despite_stops(lambda: self._grip("close both grippers", CLOSED))
        for side, grip in grips.items():
            self.reports[side].grip = grip
        for side in Side:
            self.reports[side].missed = self._arms[side].missed - missed[side]
            self.reports[side].final_error = self._arms[side].error(GOALS[side])
        self._progress.step("stop EGM")
        self._manager.stop_egm()
        self._started_egm = False

    def stop_motion(self) -> None:
        """End EGM if this application started it; for use after a cancel."""
        if self._started_egm:
            self._spinner.close()
            self._spinner = Spinner(self._node)
            RobotManagerClient(self._spinner).stop_egm()

    def _wait_until_ready(self) -> None:
        self._progress.step("wait until the robot is ready")
        reason: list[str | None] = [None]

        def is_ready() -> bool:
            reason[0] = self._manager.robot_is_ready()
            return reason[0] is None or bool(self._manager.state is not None and self._manager.state.stop)

        try:
            self._spinner.until(is_ready, 30.0, "Readiness of the robot")
        except RobotNotReady as error:
            raise RobotNotReady(f"{error} It is {reason[0]}.") from error
        if reason[0] is not None:  # an earlier stop waits for a person
            self._recover(RobotNotReady(f"The robot is {reason[0]}."))

    def _despite_stops(self, step: Callable[[], T]) -> T:
        """What ``step`` gives; where the robot has been stopped meanwhile, it recovers and ``step`` is done again."""
        attempt = 0
        while True:
            try:
                return step()
            except YumiError as error:
                attempt += 1
                was_stopped = isinstance(error, GoalNotReached) or self._stop_state() is not None
                if not was_stopped or attempt > RECOVERIES:
                    raise
                self._progress.step(f"{error} Recover, attempt {attempt} of {RECOVERIES}")
                self._recover(error)
                self._start_egm()

    def _recover(self, error: YumiError) -> None:
        """Bring the robot back: by itself where only this machine lost it, else when a person says so.

        Raises:
            RobotNotReady: nobody says so; the message says what stopped the robot.
        """
        with suppress(RobotNotReady):  # no stop is known: the robot works, and lost us for a moment
            self._spinner.until(self._is_explained, _EXPLAINED, "A cause")
        state, stop = self._stop_state(), ""
        if state is not None:
            stop = str(state.stop)
            sentence = f"The robot stands. Cause: {state.cause}.{demand_confirmation(stop)}"
            if not self._confirm(sentence):
                raise RobotNotReady(f"{error} {sentence} Not confirmed by a person.", stop) from error
        while True:
            try:
                self._progress.note(self._manager.recover(self._progress.note, stop))
                return
            except RobotNotReady as refusal:
                if not self._confirm(str(refusal)):
                    raise
                stop = refusal.stop

    def _is_explained(self) -> bool:
        """Whether the driver knows more than that the robot is stopped."""
        state = self._stop_state()
        return state is not None and (bool(state.stop) or state.cause != state.reason)

    def _stop_state(self) -> Any:
        """The robot's state while something known keeps it stopped; else None."""
        state = self._manager.state
        return state if state is not None and (state.stop or state.cause) else None

    def _start_egm(self) -> None:
        self._progress.step("start EGM on both arms")
        self._started_egm = True
        self._progress.note(self._manager.start_egm())
        for side in Side:
            self._arms[side].wait_for_state(5.0)
            self._arms[side].wait_for_status(5.0)
            self._wait_for_command(side)

    def _wait_for_command(self, side: Side) -> None:
        try:
            self._arms[side].wait_for_command(5.0)
        except RobotNotReady as error:
            raise GoalNotReached(f"The {side.word} arm was stopped before it moved.") from error

    def _move(self, side: Side) -> None:
        goal, arm, report = GOALS[side], self._arms[side], self.reports[side]
        self._progress.step(f"move the {side.word} arm")
        whole = max(arm.error(goal), CLOSE_ENOUGH)
        begin = self._seconds()
        arm.move(goal)

        def has_arrived() -> bool:
            error = arm.error(goal)
            self._progress.error(side, degrees(error), 1.0 - error / whole)
            if error >= CLOSE_ENOUGH and not arm.is_commanded:
                raise GoalNotReached(f"The {side.word} arm was stopped {degrees(error):.1f}° before its goal.")
            return error < CLOSE_ENOUGH

        timeout = MOVE_TIMEOUT / self._manager.state.speed_scale
        self._spinner.until(has_arrived, timeout, f"Arrival of the {side.word} arm within 0.1°")
        report.duration = self._seconds() - begin

    def _grip(self, sentence: str, position: float) -> dict[Side, Grip]:
        self._progress.step(sentence)
        waits = {side: gripper.begin(position) for side, gripper in self._grippers.items()}
        grips = _ends_of(waits)
        self._progress.note(
            ", ".join(f"{side.word}: {grip.word} at {grip.position * 1e3:.1f} mm" for side, grip in grips.items())
        )
        return grips

    def _recorder(self, side: Side) -> Callable[[float, Joints], None]:
        path = self.reports[side].path
        return lambda time, position: path.append((time, position))

    def _seconds(self) -> float:
        return float(self._node.get_clock().now().nanoseconds) * 1e-9


def _ends_of(waits: dict[Side, Callable[[], Grip]]) -> dict[Side, Grip]:
    """How both grips ended, once both have, however the first did."""
    grips: dict[Side, Grip] = {}
    failures = []
    for side, wait in waits.items():
        try:
            grips[side] = wait()
        except GoalNotReached as error:
            failures.append(error)
    if failures:
        raise failures[0]
    return grips
