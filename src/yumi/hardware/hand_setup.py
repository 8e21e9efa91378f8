"""What hands need before the arms move: calibration, and, where it is wanted, a test whether they close."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from yumi.errors import ControllerRefused, GoalNotReached, ProtocolError, RobotNotReady
from yumi.hardware.gripper import Gripper
from yumi.robot.gripper import Outcome
from yumi.robot.hand import go_to
from yumi.robot.joints import Side

CLOSED = go_to(0.0)

Say = Callable[[str], None]


def set_up_hands(grippers: Mapping[Side, Gripper], say: Say, complain: Say, *, is_tested: bool = False) -> None:
    """Calibrate all hands that need it; a hand that cannot be used is told and left, since the arms move without it.

    Args:
        grippers: the hands.
        say: told what was done.
        complain: told which hand cannot be used, and why.
        is_tested: whether each hand shall be closed to see that it does; one that holds something is left as it is.
    """
    for side, gripper in grippers.items():
        try:
            if gripper.calibrate_if_needed():
                say(f"The {side.word} gripper was calibrated.")
            if is_tested:
                say(f"The {side.word} gripper {_tested(gripper)}.")
        except (RobotNotReady, ControllerRefused, ProtocolError, GoalNotReached) as error:
            complain(f"The {side.word} gripper cannot be used: {error}")


def hand_steps(grippers: Mapping[Side, Gripper], *, is_tested: bool = False) -> list[str]:
    """What :func:`set_up_hands` will do to the hands as they are now, in words; nothing for one that cannot be used."""
    steps = []
    for side, gripper in grippers.items():
        with suppress(RobotNotReady, ControllerRefused, ProtocolError):  # set_up_hands says why
            if not gripper.is_calibrated():
                steps.append(f"calibrate the {side.word} gripper (its fingers close)")
            if is_tested and not gripper.is_holding():
                steps.append(f"close the {side.word} gripper as a test")
    return steps


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
