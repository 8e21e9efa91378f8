"""A driver with its local endpoint and a robot that notes what it is asked."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace

from abb_protocols.errors import CommandRefused, RobotNotReady, StopNotConfirmed
from abb_protocols.robot.gripper_values import GripOutcome, GripperGoal, GripperState, ServoState
from abb_protocols.robot.joints import Pose, Side, home
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from fake_robot import FakeRobot
from yumi.control.shared_state import JointStates
from yumi.driver.command import CommandedRobot
from yumi.driver.endpoint_server import EndpointServer
from yumi.driver.gripper import RwsGripper
from yumi.driver.robot_state import RobotMode, RobotState
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.surroundings import Surroundings, SurroundingsBox

ROBOT = "192.168.125.1:80"
WAIT = 10.0
BOX = SurroundingsBox("table", Pose((0.4, 0.0, -0.05), (1.0, 0.0, 0.0, 0.0)), (0.6, 1.2, 0.1))


class FakeManager:
    """A robot that is ready; notes what it is asked for."""

    def __init__(self) -> None:
        self.asked: list[object] = []
        self.egm_arms = tuple(Side)
        self.speed = SpeedSetting()
        self.is_interrupted = False
        self.session_count = 1
        self.blocks: threading.Event | None = None
        self.robot = RobotState(
            True, OperatingMode.AUTO, ControllerState.MOTORS_ON, ExecutionState.RUNNING, reasons=(), speed_ratio=100
        )

    def state(self) -> RobotState:
        return replace(self.robot, speed_scale=self.speed.value)

    def start_egm(self, arms: Sequence[Side] | None, report: Callable[[str], None], check: Callable[[], None]) -> str:
        self.asked.append(arms)
        if self.blocks is not None:
            assert self.blocks.wait(WAIT)
        check()
        return "EGM runs"

    def stop_egm(self) -> str:
        self.asked.append("stop")
        return "EGM has ended"

    def go_to(self, mode: RobotMode, report: Callable[[str], None], check: Callable[[], None] = lambda: None) -> str:
        report("motors off")
        self.asked.append(mode)
        return "The motors are off"

    def check_not_stopped(self) -> None:
        if self.robot.stop:
            raise RobotNotReady("A stop waits.", self.robot.stop)

    def check_gripper(self, side: Side) -> None:
        self.check_not_stopped()

    def allow_collision(self, part: str, other: str, seconds: float) -> str:
        if part == "shelf":
            raise CommandRefused("Collision not allowed: there is no shelf.")
        self.robot = replace(self.robot, allowed_collisions=(f"{part} - {other}",))
        return f"{part} and {other} may touch for {seconds:g} s"

    def end_allowed_collision(self, part: str, other: str) -> str:
        assert self.robot.allowed_collisions == (f"{part} - {other}",)
        self.robot = replace(self.robot, allowed_collisions=())
        return f"{part} and {other} are kept apart"

    def interrupt(self) -> None:
        self.is_interrupted = True


class FakeGripper:
    """Fingers that are where they are sent at once."""

    def __init__(self, side: Side) -> None:
        self.side = side
        self.busy = threading.Lock()
        self.goals: list[GripperGoal] = []
        self.goal: GripperGoal | None = None
        self.last_position = 0.0
        self.on_begin: Callable[[], None] = lambda: None

    alone = RwsGripper.alone

    def begin(self, goal: GripperGoal, check: Callable[[], None]) -> None:
        self.on_begin()
        check()
        self.goals.append(goal)
        self.goal = goal
        self.last_position = goal.position

    def wait(self, goal: GripperGoal, is_cancelled: Callable[[], bool]) -> GripOutcome | None:
        return None if is_cancelled() else GripOutcome.HOLDING if goal.direction else GripOutcome.OPEN


class FakeDriver:
    """A driver with its endpoint."""

    def __init__(self, log: Callable[[int, str], None] = lambda level, sentence: None) -> None:
        self.robot = FakeRobot()
        self.manager = FakeManager()
        self.grippers = {side: FakeGripper(side) for side in Side}
        self.recovered: list[str] = []
        self.changes: list[int] = []
        self.read: dict[Side, JointStates] = {}
        self.subscriptions = 0
        self.calibrated: list[Sequence[Side]] = []
        self.fingers: GripperState | None = GripperState(ServoState.KEEP_OBJECT, 0, True, 0.01, 0.0, 10.0)
        for side in Side:
            self.robot.control.snapshots[side] = self.robot.control.snapshots[side]._replace(sent=home(side))
        robot = CommandedRobot(
            address=ROBOT,
            manager=self.manager,  # type: ignore[arg-type]
            control=self.robot.control,
            datagram=lambda side: b"",
            grippers=self.grippers,  # type: ignore[arg-type]
            gripper_state=lambda side: self.fingers,
            force=10.0,
            mover=self.robot.executor,
            recover=self.recover,
            calibrate=lambda sides, check: self.calibrated.append(sides),
            on_change=lambda: self.changes.append(len(self.changes)),
            surroundings=Surroundings(boxes=(BOX,), is_limited=True, margin=0.01),
            joints=self.read.get,
            on_subscription=self.subscribe,
        )
        self.server = EndpointServer(robot, log)

    def subscribe(self) -> None:
        self.subscriptions += 1

    def recover(self, report: Callable[[str], None], check: Callable[[], None], confirm: str) -> str:
        if self.manager.robot.stop != confirm:
            raise StopNotConfirmed("A person must confirm it.", self.manager.robot.stop)
        report("motors on")
        self.recovered.append(confirm)
        return "The robot is ready"

    def arrive(self, count: int = 1) -> None:
        """The motions that were asked for end at their goals, as soon as they have begun."""
        self.robot.control.on_command = self.robot.end
