"""A driver and a virtual robot as processes of their own, both arms in motion, and what then happens to them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from math import copysign, radians
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import TIMEOUT, Robot, rclpy
from ros_clients import ArmClient, GripperClient, RobotManagerClient, Spinner
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from yumi_interfaces.msg import RobotState

from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import CYCLE, Joints, Side, joints
from abb_runtime.clock import SystemClock
from abb_runtime.fault_command import fault as fault_command
from abb_runtime.faults import Fault
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.client import RwsClient
from yumi.control.flight_recorder import RecordedCycle

FAR, NEAR, MOVING, THERE = radians(60.0), radians(3.0), radians(1.0), radians(0.5)
STANDING = 1e-4  # [rad] between two looks
LOOKS = 5
STOOD_STILL = "EGM feedback lost, the robot has been silent"
EVERY_CHANGE = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True, slots=True)
class Scenario:
    """Something that ends the motion of one arm or both.

    Attributes:
        fault: what happens.
        says: what a user then reads in the robot's state or in the log.
        recovered: what the result of ``recover`` says.
        refused: what it says while somebody has to act first, as a regular expression.
        repaired_by: what somebody has to do; None where nobody has to.
        side: which arm it happens to; None is both, or the robot.
        duration: how long it lasts [s]; None is its own time.
    """

    fault: Fault
    says: str
    recovered: str
    refused: str = ""
    repaired_by: Fault | None = None
    side: Side | None = None
    duration: float | None = None

    def __str__(self) -> str:
        parts = (self.fault.value.name, self.side and self.side.word, self.duration and f"{self.duration:g}s")
        return "-".join(part for part in parts if part)

    @property
    def sides(self) -> tuple[Side, ...]:
        """The arms that it stops."""
        return tuple(Side) if self.side is None else (self.side,)


class Tracking(NamedTuple):
    """How an arm followed in some of its cycles.

    Attributes:
        missed: cycles of the robot without an answer, as a share.
        lead: how far a command was ahead of its joint, at most [rad].
    """

    missed: float
    lead: float


def tracking(frames: Sequence[RecordedCycle], begin: float, end: float) -> Tracking:
    """That of the cycles between two times [s]."""
    followed = [frame for frame in frames if frame.is_running and frame.dt > 0.0 and begin <= frame.time <= end]
    missed = sum(round(frame.dt / CYCLE) - 1 for frame in followed) / len(followed)
    leads = (abs(a - b) for frame in followed for a, b in zip(frame.sent, frame.position, strict=True))
    return Tracking(missed, max(leads))


class Listener:
    """What a user reads: the state of robot, arms and hands as it was told, and the log.

    Attributes:
        heard: all of it, since it was cleared.
        interruptions: of each arm's feedback, as counted by the driver.
    """

    def __init__(self, node: Any) -> None:
        self.heard: list[str] = []
        self.interruptions = dict.fromkeys(Side, 0)
        node.create_subscription(RobotState, "yumi_robot_manager/state", self._take_state, EVERY_CHANGE)
        node.create_subscription(Log, "/rosout", lambda message: self.heard.append(message.msg), 100)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._take_diagnostics, 10)
        for side in Side:
            node.create_subscription(DiagnosticStatus, f"{side.value}/egm_state", partial(self._count, side), 1)
            node.create_subscription(DiagnosticStatus, f"{side.value}/gripper/state", self._take_status, 10)
            node.create_subscription(JointState, f"{side.value}/gripper/joint_states", partial(self._feel, side), 10)

    def has(self, part: str) -> bool:
        return any(part in sentence for sentence in self.heard)

    def _take_state(self, state: Any) -> None:
        event = state.last_event
        self.heard += [
            f"not ready: {state.reason}" if state.reason else "ready",
            f"{event.number} {event.title}: {event.cause}; {event.remedy}",
            f"EGM: right {state.right_egm}, left {state.left_egm}",
            f"programs: right {state.right_state_machine}, left {state.left_state_machine}",
            f"speed ratio {state.speed_ratio} %",
        ]

    def _take_diagnostics(self, array: Any) -> None:
        for status in array.status:
            self._take_status(status)

    def _take_status(self, status: Any) -> None:
        self.heard.append(f"{status.name}: {status.message}")

    def _feel(self, side: Side, state: Any) -> None:
        self.heard.append(f"{side.word} fingers press with {state.effort[0]:g} N")

    def _count(self, side: Side, status: Any) -> None:
        self.interruptions[side] = next(int(pair.value) for pair in status.values if pair.key == "interruptions")


class Application:
    """What a program in ROS has of one driver."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("application")
        self.spinner = Spinner(self.node)
        self.manager = RobotManagerClient(self.spinner)
        self.arms = {side: ArmClient(self.spinner, side) for side in Side}
        self.grippers = {side: GripperClient(self.spinner, side) for side in Side}
        self.listener = Listener(self.node)

    def close(self) -> None:
        self.spinner.close()
        self.node.destroy_node()


class Stage:
    """One robot and one driver after the other, on which one thing after another happens.

    Attributes:
        robot: the virtual controller.
        driver: its process.
        application: a program that uses it.
        spans: when each scene began and ended, by its name, on the monotonic clock [s].
        recordings: every cycle of each driver.

    Args:
        folder: for logs and recordings.
    """

    def __init__(self, folder: Path) -> None:
        self.spans: dict[str, tuple[float, float]] = {}
        self.recordings: list[Path] = []
        self._folder = folder
        self._clock = SystemClock()
        self._damage: Fault | None = None
        self.robot = Robot(folder)
        self.robot.start()
        self.start_driver()

    # Processes

    def start_driver(self) -> None:
        number = len(self.recordings)
        self.recordings.append(self._folder / f"session_{number}.mcap")
        where = ["--robot", f"127.0.0.1:{self.robot.rws_port}", *self.robot.egm_options]
        arguments = ["up", *where, "--record", str(self.recordings[-1])]
        self.driver = CommandProcess("driver", "yumi", arguments, self._folder / f"driver_{number}.log").__enter__()
        self.driver.wait_until_ready(2 * TIMEOUT)
        if number:
            self.application.close()
        self.application = Application()
        # A service of a driver that was killed is found for some time yet: only what it sends shows the new one.
        self.until(lambda: self.application.listener.has("EGM: "), "A state of the robot")

    def stop_driver(self) -> None:
        """In order: its recording is complete then."""
        self.application.close()
        self.driver.stop()

    def kill_driver(self) -> None:
        """As ``kill -9``; returns when its fast lines have ended, too."""
        self.driver.kill()
        self.until(lambda: not self.processes(), "The end of all processes")

    def close(self) -> None:
        if self.driver.exit_code is None:
            self.stop_driver()
        self.robot.stop()

    def processes(self) -> set[int]:
        """Numbers of the driver's processes."""
        return {int(each.name) for each in Path("/proc").glob("[0-9]*") if _is_in_session(each, self.driver.pid)}

    @contextmanager
    def other_program(self) -> Iterator[RwsClient]:
        """Somebody else who talks with the controller."""
        with RwsClient(f"127.0.0.1:{self.robot.rws_port}") as client:
            yield client

    # What happens

    @contextmanager
    def scene(self, name: str) -> Iterator[dict[Side, Joints]]:
        """Something that happens while both arms move to their goals; no process is another one afterwards."""
        with self.span(name):
            goals = self.begin_to_move()
            processes = self.processes()
            try:
                yield goals
                assert self.processes() == processes
            finally:
                self.repair()

    @contextmanager
    def span(self, name: str) -> Iterator[None]:
        """Remembers when it was."""
        begin = self._clock.now()
        yield
        self.spans[name] = (begin, self._clock.now())

    def inject_fault(self, fault: Fault, side: Side | None = None, duration: float | None = None) -> None:
        """``yumi fault``."""
        options = {"--robot": f"127.0.0.1:{self.robot.rws_port}", "--arm": side and side.word, "--duration": duration}
        chosen = [text for name, value in options.items() if value is not None for text in (name, str(value))]
        fault_command.main([fault.value.name, *chosen], standalone_mode=False)

    def notice(self, change: Callable[[], None], says: str) -> float:
        """How long it takes from before a ``change`` until a user can read of it [s]."""
        self.application.listener.heard.clear()
        begin = self._clock.now()
        change()
        self.until_heard(says)
        return self._clock.now() - begin

    def inject(self, scenario: Scenario) -> float:
        """Have it happen; how long it took until a user could read of it [s]."""
        self._damage = scenario.repaired_by
        told = self.notice(lambda: self.inject_fault(scenario.fault, scenario.side, scenario.duration), scenario.says)
        arms = [self.application.arms[side] for side in scenario.sides]
        self.until(lambda: not any(arm.is_commanded for arm in arms), "The end of the motion")
        return told

    def repair(self) -> None:
        """What somebody does, where somebody has to."""
        if self._damage is not None:
            self.inject_fault(self._damage)
            self._damage = None

    def calibrate(self, side: Side) -> str:
        """What the service of a hand answers."""
        client = self.application.node.create_client(Trigger, f"{side.value}/gripper/calibrate")
        self.until(client.service_is_ready, "The service of the hand")
        future = client.call_async(Trigger.Request())
        self.until(future.done, "The answer of the hand")
        return str(future.result().message)

    # Motion

    def begin_to_move(self) -> dict[Side, Joints]:
        """Both arms are on their way; a machine that stands still meanwhile ends EGM, which then begins again.

        Returns:
            Where to.
        """
        start: dict[Side, Joints] = {}
        arms = self.application.arms

        def are_moving() -> bool:
            if not start or self._has_stood_still():
                start.update(self._start_to_move())
            return all(arms[side].error(position) > MOVING for side, position in start.items())

        self.until(are_moving, "The motion of both arms")
        return {side: _towards_the_middle(position, FAR) for side, position in start.items()}

    def reach_new_goals(self) -> None:
        """A little back from where each arm stands; nothing is started for that."""
        arms = self.application.arms
        goals = {side: _towards_the_middle(arm.wait_for_state(TIMEOUT), NEAR) for side, arm in arms.items()}
        self._order(goals)
        self.reach(goals)

    def reach(self, goals: dict[Side, Joints]) -> None:
        """Wait for it; where this machine has stood still for longer than a robot bears, EGM begins again."""
        arms = self.application.arms

        def are_there() -> bool:
            if self._has_stood_still():
                self._guide()
                self._order(goals)
            return all(arms[side].error(goal) < THERE for side, goal in goals.items())

        self.until(are_there, "The goals")

    def wait_for_rest(self, client: RwsClient) -> None:
        """Until the controller tells the same position of both arms several times, one after another."""
        looks: list[Joints] = []

        def are_standing() -> bool:
            looks.append(tuple(value for side in Side for value in client.joint_target(side.unit)))
            recent = looks[-LOOKS:]
            spans = [max(values) - min(values) for values in zip(*recent, strict=True)]
            return len(recent) == LOOKS and max(spans) < STANDING

        self.until(are_standing, "Rest")

    # Waiting

    def until(self, is_so: Callable[[], bool], what: str) -> None:
        self.application.spinner.until(is_so, TIMEOUT, what)

    def until_heard(self, part: str) -> None:
        listener = self.application.listener
        try:
            self.until(lambda: listener.has(part), repr(part))
        except RobotNotReady as error:
            raise AssertionError(f"{error} Heard: {listener.heard}") from error

    def _start_to_move(self) -> dict[Side, Joints]:
        self._guide()
        start = {side: arm.wait_for_state(TIMEOUT) for side, arm in self.application.arms.items()}
        self._order({side: _towards_the_middle(position, FAR) for side, position in start.items()})
        return start

    def _guide(self) -> None:
        """Start EGM; again where this machine has stood still meanwhile, which ends it."""
        arms = self.application.arms
        self.application.manager.start_egm()

        def are_commanded() -> bool:
            if self._has_stood_still():
                self.application.manager.start_egm()
            return all(arm.is_commanded for arm in arms.values())

        self.until(are_commanded, "Controllers that command both arms")

    def _has_stood_still(self) -> bool:
        """Whether EGM has ended, and the driver has told of a robot that was silent, as it is while its machine is."""
        arms = self.application.arms
        return self.application.listener.has(STOOD_STILL) and not all(arm.is_commanded for arm in arms.values())

    def _order(self, goals: dict[Side, Joints]) -> None:
        for side, goal in goals.items():
            self.application.arms[side].move(goal)


def _towards_the_middle(position: Joints, change: float) -> Joints:
    """The flange turned by ``change`` [rad]."""
    return joints([*position[:6], position[6] - copysign(change, position[6])])


def _is_in_session(process: Path, session: int) -> bool:
    """Whether a living process belongs to a session; one that has ended has no command line."""
    try:
        return os.getsid(int(process.name)) == session and bool((process / "cmdline").read_bytes())
    except (ProcessLookupError, FileNotFoundError):
        return False
