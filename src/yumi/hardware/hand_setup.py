"""What grippers need before they can be used: calibration, and, where it is wanted, a test whether they close."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from yumi.errors import ControllerRefused, GoalNotReached, ProtocolError, RobotNotReady
from yumi.hardware.gripper import Gripper, how_to_calibrate
from yumi.robot.gripper import Outcome
from yumi.robot.hand import go_to
from yumi.robot.joints import Side

CLOSED = go_to(0.0)

Say = Callable[[str], None]

_FAILURES = (RobotNotReady, ControllerRefused, ProtocolError, GoalNotReached)


class GripperSetup:
    """Calibrates grippers that need it, both at once, each time the robot has become ready and before EGM starts.

    A gripper loses its calibration with its 24 V supply. One that cannot be used is reported and left, since the arms
    move without it.

    Args:
        grippers: the robot's.
        is_wanted: whether they may be calibrated without being asked for (``gripper.calibrate``).
        report: told what is done, before it is done.
        complain: told which gripper cannot be used, why, and what to do; once, until that changes.
        why_not: why a gripper may not move now; None when it may.
        is_confirmed: whether nothing that stopped the robot waits for a person: an uncalibrated gripper does not know
            what is between its fingers.
    """

    def __init__(
        self,
        grippers: Mapping[Side, Gripper],
        report: Say,
        complain: Say,
        *,
        is_wanted: bool = True,
        why_not: Callable[[Side], str | None] = lambda side: None,
        is_confirmed: Callable[[], bool] = lambda: True,
    ) -> None:
        self._grippers = grippers
        self._report = report
        self._complain = complain
        self._is_wanted = is_wanted
        self._why_not = why_not
        self._is_confirmed = is_confirmed
        self._complaints: dict[Side, str] = {}

    def steps(self, *, is_tested: bool = False) -> list[str]:
        """What :meth:`run` and :func:`close_as_test` will do to the grippers as they are now, in words."""
        steps = []
        for side, gripper in self._grippers.items():
            with suppress(*_FAILURES):  # what cannot be used is not moved, and run() reports why
                if not gripper.is_calibrated() and self._why_not_now(gripper) is None:
                    steps.append(f"calibrate the {side.word} gripper (its fingers close)")
                if is_tested and not gripper.is_holding():
                    steps.append(f"close the {side.word} gripper as a test")
        return steps

    def run(self) -> None:
        """Calibrate what needs it and may be calibrated; what cannot is left uncalibrated."""
        chosen = [gripper for gripper in self._grippers.values() if self._is_to_calibrate(gripper)]
        if not chosen:
            return
        words = " and ".join(gripper.side.word for gripper in chosen)
        self._report(f"calibrate the {words} gripper{'s' if len(chosen) > 1 else ''}: the fingers close")
        try:
            chosen[0].calibrate(*chosen[1:])
        except _FAILURES as error:
            for gripper in chosen:
                self._complain_if_new(gripper.side, f"The {gripper.side.word} gripper cannot be used: {error}")
            return
        for gripper in chosen:
            self._complaints.pop(gripper.side, None)

    def _is_to_calibrate(self, gripper: Gripper) -> bool:
        side = gripper.side
        try:
            if gripper.is_calibrated():
                self._complaints.pop(side, None)
                return False
            reason = self._why_not_now(gripper)
        except _FAILURES as error:
            self._complain_if_new(side, f"The {side.word} gripper cannot be used: {error}")
            return False
        if reason is not None:
            self._complain_if_new(
                side,
                f"The {side.word} gripper is not calibrated, and is not calibrated now: {reason}. When its fingers may "
                f"close: {how_to_calibrate(side)}.",
            )
        return reason is None

    def _why_not_now(self, gripper: Gripper) -> str | None:
        if not self._is_wanted:
            return "gripper.calibrate is never"
        if not self._is_confirmed():
            return "the robot was stopped, and a gripper without calibration does not know what it holds"
        return self._why_not(gripper.side) or gripper.why_not_calibrate()

    def _complain_if_new(self, side: Side, sentence: str) -> None:
        if self._complaints.get(side) != sentence:
            self._complaints[side] = sentence
            self._complain(sentence)


def close_as_test(grippers: Mapping[Side, Gripper], report: Say, complain: Say) -> None:
    """Close each gripper to see that it does; one that holds something, or is not calibrated, is left as it is.

    Args:
        grippers: the robot's.
        report: told what was done.
        complain: told which gripper cannot be used, and why.
    """
    for side, gripper in grippers.items():
        try:
            report(f"The {side.word} gripper {_tested(gripper)}.")
        except _FAILURES as error:
            complain(f"The {side.word} gripper cannot be used: {error}")


def _tested(gripper: Gripper) -> str:
    """Close a hand; what became of it.

    Raises:
        RobotNotReady: it did not close, or reports an error.
        GoalNotReached: somebody stopped it.
    """
    if gripper.is_holding():
        return "holds something and was not closed as a test"
    gripper.begin(CLOSED)
    if gripper.wait(CLOSED) is not Outcome.CLOSED:
        raise RobotNotReady(
            f"Its test failed: it was to close, and its fingers are at {gripper.last_position * 1e3:.1f} mm; look what "
            "is between them, or calibrate it with nothing between them."
        )
    return "was closed as a test"
