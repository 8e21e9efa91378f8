"""The demonstration: virtual controller, driver and move-and-grab application, each a process, from start to end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from yumi.errors import RobotNotReady, YumiError
from yumi.hardware.bringup import ANNOUNCEMENT
from yumi.links.command import Command
from yumi.links.udp import free_port
from yumi.robot.joints import Side
from yumi.ros.driver import close_ros, open_ros
from yumi.ros.move_and_grab import ArmReport, MoveAndGrab, Progress

OBJECT_WIDTH = 0.020
"""What lies between the left fingers of the virtual robot [m]."""

_READY_TIMEOUT = 60.0


@dataclass(frozen=True, slots=True)
class DemoPlan:
    """What the demonstration runs on.

    Attributes:
        robot: address of a real controller; None brings a virtual one.
        options: further options for the driver, e.g. a settings file.
        logs: folder for the processes' output.
        secrets: environment variables for the driver and the virtual controller: the password.
    """

    robot: str | None
    options: tuple[str, ...]
    logs: Path
    secrets: Mapping[str, str] = field(default_factory=dict, repr=False)


class Cancelled(Exception):
    """The demonstration was told to end."""


def run_demo(plan: DemoPlan, progress: Progress, is_cancelled: Callable[[], bool]) -> Mapping[Side, ArmReport]:
    """Run the task from start to end; on any way out motion is stopped and every process has ended.

    Raises:
        YumiError: a step failed; the message says which.
        Cancelled: it was told to end.
    """

    def check() -> None:
        if is_cancelled():
            raise Cancelled

    plan.logs.mkdir(parents=True, exist_ok=True)
    with _driver(plan, progress, check) as driver:

        def check_driver() -> None:
            check()
            if driver.exit_code is not None:
                raise RobotNotReady(f"The driver has ended (exit code {driver.exit_code}); see {driver.log}.")

        return _run_application(progress, check_driver)


def _run_application(progress: Progress, check: Callable[[], None]) -> Mapping[Side, ArmReport]:
    open_ros()
    application = MoveAndGrab(progress, check)
    try:
        application.run()
    except BaseException:
        with suppress(YumiError):  # what went wrong first is what a person must read; the driver ends EGM as well
            application.stop_motion()
        raise
    finally:
        application.close()
        close_ros()
    return application.reports


@contextmanager
def _driver(plan: DemoPlan, progress: Progress, check: Callable[[], None]) -> Iterator[Command]:
    with ExitStack() as stack:
        where = ("--robot", plan.robot) if plan.robot else _start_controller(plan, progress, stack, check)
        progress.step("start the driver")
        command = Command("driver", ("up", *where, *plan.options), plan.logs / "driver.log", plan.secrets)
        driver = stack.enter_context(command)
        progress.note(driver.wait_until_ready(_READY_TIMEOUT, check, lambda line: _pass_on(line, progress)))
        yield driver


def _pass_on(line: str, progress: Progress) -> None:
    """Of what the driver logs, what it will do to the robot is for the person at the terminal."""
    _, announces, steps = line.partition(ANNOUNCEMENT)
    if announces:
        progress.note(f"{ANNOUNCEMENT}{steps}")


def _start_controller(
    plan: DemoPlan, progress: Progress, stack: ExitStack, check: Callable[[], None]
) -> tuple[str, ...]:
    """Start the virtual controller on ports nobody uses; returns the driver's options to find it."""
    progress.step("start the virtual controller")
    left, right = free_port(), free_port()
    ports = ("--left-egm-port", str(left), "--right-egm-port", str(right))
    arguments = ("controller", "--rws-port", "0", "--left-object", str(OBJECT_WIDTH), *ports)
    command = Command("virtual controller", arguments, plan.logs / "controller.log", plan.secrets)
    address = stack.enter_context(command).wait_until_ready(_READY_TIMEOUT, check)
    progress.note(address)
    host, _, rws_port = address.removeprefix("http://").partition(":")
    return ("--robot", host, "--rws-port", rws_port, *ports)
