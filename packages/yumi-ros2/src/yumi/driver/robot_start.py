"""The start of a driver at its robot: what will be done is said, then the robot is brought to ready."""

from __future__ import annotations

import logging
from collections.abc import Callable

from abb_protocols.catalogue import Message
from abb_protocols.errors import YumiError
from yumi.driver.bringup import BRINGUP_ANNOUNCEMENT
from yumi.driver.gripper_setup import GripperSetup, close_as_test
from yumi.driver.robot_manager import RobotManager


def start_robot(
    manager: RobotManager,
    setup: GripperSetup,
    log: Callable[[int, Message | str], None],
    *,
    is_tested: bool = False,
    is_reading_only: bool = False,
) -> Message | None:
    """Bring the robot to ready, saying before what will be done to it.

    Args:
        manager: of the robot.
        setup: of the grippers.
        log: takes a level of :mod:`logging` and what is to be logged.
        is_tested: whether the grippers are closed once as a test.
        is_reading_only: whether the robot is left as it is.

    Returns:
        Why it is not ready; None when it is, or is left as it is.
    """
    try:
        if is_reading_only:
            manager.report_remarks()
            log(logging.INFO, "The robot is left as it is until start_egm, set_mode or recover is called.")
            return None
        with manager.starting(brings_up=True):
            steps = [*manager.steps_to_ready(), *setup.steps(is_tested=is_tested)]
            if steps:
                log(logging.WARNING, f"{BRINGUP_ANNOUNCEMENT}{', '.join(steps)}.")
            manager.make_ready()
        if is_tested:
            close_as_test(
                setup.grippers,
                lambda said: log(logging.INFO, str(said)),
                lambda said: log(logging.ERROR, str(said)),
            )
        log(logging.INFO, "The robot is ready.")
    except YumiError as error:
        log(logging.ERROR, error.said)
        return error.said
    return None
