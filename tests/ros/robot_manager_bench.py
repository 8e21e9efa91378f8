"""The robot manager's ROS side in this process, on a manager that remembers its calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from threading import Barrier, Event, Thread
from types import SimpleNamespace
from typing import Any

from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from ros_bench import Client, rclpy

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from abb_runtime.clock import SystemClock, wait_until
from yumi.control.hand_over import HandOver
from yumi.driver.command import CommandedRobot
from yumi.driver.robot_state import Report, RobotMode, RobotState
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.state_machine import MachineState
from yumi.ros.command_services import CommandActions, CommandServices, SpeedScaleInterface
from yumi.ros.nodes import TimerThread
from yumi.ros.state_topics import RobotStateTopic, SignalsTopic

THREADS = 6

READY = RobotState(
    is_connected=True,
    operating_mode=OperatingMode.AUTO,
    controller_state=ControllerState.MOTORS_ON,
    execution=ExecutionState.RUNNING,
    machines=dict.fromkeys(Side, MachineState.IDLE),
    speed_ratio=100,
    reasons=(),
)


class FakeManager:
    """Notes each call; what stands in ``refusals`` by its name is refused with that sentence."""

    egm_arms = ()
    session_count = 1

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.refusals: dict[str, str] = {}
        self.robot = READY
        self.monitor = self.panel = self
        self.may_go_on = Event()
        self.may_go_on.set()
        self.runs_routine = Event()
        self.heard: list[str] | None = None

    def __getattr__(self, name: str) -> Callable[..., str]:
        return lambda *values: self._note(name, *values)

    def state(self) -> RobotState:
        return self.robot

    def signals(self) -> dict[str, float]:
        return {"OUTPUT_STATIONARY_ROB_R": 1.0, "valve": 0.0}

    def start_egm(self, arms: Sequence[Side] | None, report: Report, check: Callable[[], None]) -> str:
        return self._note("start_egm") if arms is None else self._note("start_egm", arms)

    def go_to(self, mode: RobotMode, report: Report, check: Callable[[], None] = lambda: None) -> str:
        for count, step in enumerate(("motors on", "start EGM"), start=1):
            report(step)
            assert self.may_go_on.wait(10.0)
            self._wait_until_heard(count)
        return self._note("go_to", mode)

    def run_routine(self, side: Side, name: str, *, is_unchecked: bool) -> str:
        self.runs_routine.set()
        assert self.may_go_on.wait(30.0)
        return self._note("run_routine", side, name, is_unchecked)

    def run_module(self, side: Side, file_name: str, text: str, routine: str, *, is_unchecked: bool) -> str:
        return self._note("run_module", side, file_name, text, routine, is_unchecked)

    def recover(self, report: Report, check: Callable[[], None], confirmed: str = "") -> str:
        report("read the event log")
        self._wait_until_heard(1)
        while not self.may_go_on.wait(0.01):
            check()
        return self._note("recover", confirmed) if confirmed else self._note("recover")

    def _wait_until_heard(self, steps: int) -> None:
        """Else the result may overtake the feedback: rclpy's client drops feedback that it takes after the result."""
        heard = self.heard
        wait_until(SystemClock(), lambda: heard is None or len(heard) >= steps, 10.0, "the feedback", period=0.005)

    def _note(self, name: str, *values: Any) -> str:
        if name in self.refusals:
            raise RobotNotReady(self.refusals[name])
        self.calls.append((name, *values))
        return f"{name} done"


def commanded(manager: FakeManager, check_arms: Callable[[Sequence[Side]], None]) -> CommandedRobot:
    """A robot of which a manager is all that there is."""
    absent: Any = None
    return CommandedRobot(
        address="memory",
        manager=manager,  # type: ignore[arg-type]
        control=SimpleNamespace(hand_over=HandOver(lambda: 0.0)),  # type: ignore[arg-type]
        datagram=absent,
        grippers={},
        gripper_state=absent,
        force=0.0,
        mover=absent,
        recover=manager.recover,
        calibrate=absent,
        check_arms=check_arms,
    )


class RobotManagerRig:
    """The robot manager's node, spun by a thread; and a client."""

    def __init__(self) -> None:
        self.manager = FakeManager()
        self.inactive: set[Side] = set()
        self.node = rclpy.create_node("yumi_robot_manager")
        robot = commanded(self.manager, self._check_arms)
        CommandServices(self.node, robot)
        self.speed = SpeedSetting()
        self.timers = TimerThread(SystemClock(), print)
        SpeedScaleInterface(self.node, self.speed, self.timers)
        self.signals = SignalsTopic(self.node, self.manager.signals, self.timers)
        self.actions = CommandActions(self.node, robot)
        self.topic = RobotStateTopic(self.node, self.manager.state, SystemClock(), self.timers)
        self.client = Client()
        self._executor = MultiThreadedExecutor(num_threads=THREADS)
        self._executor.add_node(self.node)
        self._is_over = Event()
        self._thread = Thread(target=self._spin, name="robot-manager-rig")
        self._thread.start()
        self._begin_all_threads()
        self.timers.start()

    def begin(self) -> None:
        """A test begins: both arms active, nothing refused, no calls."""
        self.manager.refusals.clear()
        self.manager.robot = READY
        self.manager.may_go_on.set()
        self.manager.runs_routine.clear()
        self.manager.heard = None
        self.inactive.clear()
        self.manager.calls.clear()
        self.client.sentences.clear()

    def call(self, kind: Any, service: str, /, **fields: Any) -> Any:
        return self.client.call(kind, f"/yumi_robot_manager/{service}", kind.Request(**fields))

    def know(self, **fields: Any) -> None:
        """The robot is otherwise than it was."""
        self.manager.robot = replace(self.manager.robot, **fields)

    def close(self) -> None:
        self.timers.stop()
        self._is_over.set()
        self._thread.join()
        self._executor.shutdown()
        self.client.close()
        self.actions.destroy()
        self.node.destroy_node()

    def _check_arms(self, sides: Sequence[Side]) -> None:
        for side in sides:
            if side in self.inactive:
                raise CommandRefused(f"The {side.word} arm is inactive.")

    def _begin_all_threads(self) -> None:
        """The pool would begin them one after another, in the middle of tests that look for threads left behind."""
        barrier = Barrier(THREADS + 1)
        group = ReentrantCallbackGroup()
        for _ in range(THREADS):
            self.node.create_guard_condition(barrier.wait, group).trigger()
        barrier.wait(10.0)

    def _spin(self) -> None:
        while not self._is_over.is_set():
            self._executor.spin_once(timeout_sec=0.05)


class Goal:
    """A goal that was sent, its steps and its result."""

    def __init__(self, rig: RobotManagerRig, kind: Any, name: str, /, **fields: Any) -> None:
        self.steps: list[str] = []
        if rig.manager.heard is None:
            rig.manager.heard = self.steps
        self._client = rig.client
        self._action = ActionClient(rig.client.node, kind, f"/yumi_robot_manager/{name}")
        self._client.until(self._action.server_is_ready)
        sent = self._action.send_goal_async(kind.Goal(**fields), lambda told: self.steps.append(told.feedback.step))
        self._client.until(sent.done)
        self.handle = sent.result()
        self._ended = self.handle.get_result_async()

    def end(self) -> tuple[int, Any]:
        """Status and result."""
        self._client.until(self._ended.done)
        self._action.destroy()
        return self._ended.result().status, self._ended.result().result
