"""The set-up of both grippers: calibrated each time the robot has become ready, and closed once as a test."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import ControllerRefused, GoalNotReached, ProtocolError, RobotNotReady
from abb_protocols.robot.gripper_values import GripOutcome, finger_position_goal
from abb_protocols.robot.joints import Side
from yumi.driver.gripper import RwsGripper
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import CalibrateWhen, GripperSettings

_CLOSED = finger_position_goal(0.0)
_FAILURES = (RobotNotReady, ControllerRefused, ProtocolError, GoalNotReached)

_MessageReport = Callable[[Message], None]
"""Takes what was done, or what is not as it should be."""


class GripperSetup:
    """Calibrates grippers that need it, both at once, each time the robot has become ready and before EGM starts.

    A gripper loses its calibration with its 24 V supply. One that cannot be used is reported and left, since the arms
    move without it.

    Args:
        grippers: the robot's; an attribute, too.
        report: gets what is done, before it is done.
        warn: gets which gripper cannot be used, why, and what to do; once, until that changes.
        is_allowed: whether they may be calibrated without being asked for (``gripper.calibrate``).
        is_named: whether what makes the robot ready names the calibration, as a call that only resumes does not.
        is_confirmed: whether nothing that stopped the robot waits for a person: an uncalibrated gripper does not know
            what is between its fingers.
    """

    def __init__(
        self,
        grippers: Mapping[Side, RwsGripper],
        report: Callable[[str], None],
        warn: _MessageReport,
        *,
        is_allowed: bool = True,
        is_named: Callable[[], bool] = lambda: True,
        is_confirmed: Callable[[], bool] = lambda: True,
    ) -> None:
        self.grippers = grippers
        self._report = report
        self._warn = warn
        self._is_allowed = is_allowed
        self._is_named = is_named
        self._is_confirmed = is_confirmed
        self._warnings: dict[Side, Message] = {}

    def steps(self, *, is_tested: bool = False) -> list[str]:
        """What :meth:`run` and :func:`close_as_test` will do to the grippers as they are now, in words."""
        steps = []
        for side, gripper in self.grippers.items():
            with suppress(*_FAILURES):  # what cannot be used is not moved, and run() reports why
                if not gripper.is_calibrated() and self._why_not_now(gripper) is None:
                    steps.append(f"calibrate the {side.word} gripper (its fingers close)")
                if is_tested and not gripper.is_holding():
                    steps.append(f"close the {side.word} gripper as a test")
        return steps

    def run(self) -> None:
        """Calibrate what needs it and may be calibrated; what cannot is left uncalibrated."""
        chosen = [gripper for gripper in self.grippers.values() if self._is_to_calibrate(gripper)]
        if not chosen:
            return
        words = " and ".join(gripper.side.word for gripper in chosen)
        self._report(f"calibrate the {words} gripper{'s' if len(chosen) > 1 else ''}: the fingers close")
        try:
            chosen[0].calibrate(*chosen[1:])
        except _FAILURES as error:
            for gripper in chosen:
                self._warn_if_new(gripper.side, _unusable(gripper.side, error))
            return
        for gripper in chosen:
            self._warnings.pop(gripper.side, None)

    def _is_to_calibrate(self, gripper: RwsGripper) -> bool:
        side = gripper.side
        try:
            if gripper.is_calibrated():
                self._warnings.pop(side, None)
                return False
            reason = self._why_not_now(gripper)
        except _FAILURES as error:
            self._warn_if_new(side, _unusable(side, error))
            return False
        if reason is not None:
            self._warn_if_new(side, message("gripper_left_uncalibrated", gripper=side.word, reason=reason))
        return reason is None

    def _why_not_now(self, gripper: RwsGripper) -> Message | None:
        if not self._is_allowed:
            return message("calibration_not_allowed_by_settings")
        if not self._is_named():
            return message("calibration_not_named")
        if not self._is_confirmed():
            return message("gripper_may_hold_something_after_stop")
        return gripper.why_not_calibrate()

    def _warn_if_new(self, side: Side, said: Message) -> None:
        if self._warnings.get(side) != said:
            self._warnings[side] = said
            self._warn(said)


def _unusable(side: Side, error: Exception) -> Message:
    return message("gripper_unusable", gripper=side.word, reason=said_by(error))


def set_up_grippers(
    manager: RobotManager, grippers: Mapping[Side, RwsGripper], settings: GripperSettings, warn: _MessageReport
) -> GripperSetup:
    """The set-up of the grippers, which takes place each time the robot has become ready."""
    setup = GripperSetup(
        grippers,
        manager.step,
        warn,
        is_allowed=settings.calibrate is CalibrateWhen.AT_START,
        is_named=lambda: manager.may_calibrate,
        is_confirmed=lambda: not manager.is_unattended,
    )
    manager.when_ready(setup.run)
    return setup


def close_as_test(grippers: Mapping[Side, RwsGripper], report: _MessageReport, warn: _MessageReport) -> None:
    """Close each gripper to see that it does; one that holds something, or is not calibrated, is left as it is.

    Args:
        grippers: the robot's.
        report: gets what was done.
        warn: gets which gripper cannot be used, and why.
    """
    for side, gripper in grippers.items():
        try:
            if gripper.is_holding():
                report(message("gripper_holds_and_was_not_tested", gripper=side.word))
                continue
            gripper.begin(_CLOSED)
            if gripper.wait(_CLOSED) is not GripOutcome.CLOSED:
                raise RobotNotReady(message("gripper_test_failed", position=gripper.last_position))
            report(message("gripper_tested", gripper=side.word))
        except _FAILURES as error:
            warn(_unusable(side, error))
