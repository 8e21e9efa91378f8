"""The robot manager's ROS side in this process, on a manager and a connection that remember what they are asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from threading import Barrier, Event, Thread
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from ros_bench import Client, rclpy

from yumi.clock import SystemClock
from yumi.control.controller import HardwareInfo, State
from yumi.control.loop import Commands
from yumi.driver.speed import SpeedSetting
from yumi.driver.state import Mode, Report, RobotState
from yumi.driver.state_machine import MachineState
from yumi.errors import RobotNotReady
from yumi.robot.joints import Side
from yumi.ros.executors import Ticker
from yumi.ros.health import RobotStateTopic
from yumi.ros.lifecycle import ManagedNodes
from yumi.ros.robot_manager import RobotManagerActions, RobotManagerServices, SpeedScaleInterface
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

THREADS = 6

READY = RobotState(
    is_connected=True,
    mode=OperatingMode.AUTO,
    controller_state=ControllerState.MOTORS_ON,
    execution=ExecutionState.RUNNING,
    machines=dict.fromkeys(Side, MachineState.IDLE),
    speed_ratio=100,
    reason="",
)


class FakeManager:
    """Notes each call; what stands in ``refusals`` by its name is refused with that sentence."""

    egm_arms = ()

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.refusals: dict[str, str] = {}
        self.robot = READY
        self.monitor = self.panel = self
        self.may_go_on = Event()
        self.may_go_on.set()

    def __getattr__(self, name: str) -> Callable[..., str]:
        return lambda *values: self._note(name, *values)

    def state(self) -> RobotState:
        return self.robot

    def go_to(self, mode: Mode, report: Report) -> str:
        for step in ("motors on", "start EGM"):
            report(step)
            assert self.may_go_on.wait(10.0)
        return self._note("go_to", mode)

    def recover(self, report: Report, check: Callable[[], None], confirmed: str = "") -> str:
        report("read the event log")
        while not self.may_go_on.wait(0.01):
            check()
        return self._note("recover", confirmed) if confirmed else self._note("recover")

    def _note(self, name: str, *values: Any) -> str:
        if name in self.refusals:
            raise RobotNotReady(self.refusals[name])
        self.calls.append((name, *values))
        return f"{name} done"


class FakeConnection:
    """Opens and ends; or does not, with a sentence."""

    def __init__(self) -> None:
        self.refusal = ""

    def connect(self) -> str:
        if self.refusal:
            raise RobotNotReady(self.refusal)
        return "Connected."

    def disconnect(self) -> str:
        return "Disconnected."


class FakeLine:
    """The arms' hardware components."""

    def __init__(self) -> None:
        self.states = dict.fromkeys(Side, State.ACTIVE)
        self.held: list[Side] = []

    def call(self, command: Callable[..., Any], side: Side, *args: Any) -> HardwareInfo | None:
        if command is Commands.hold:
            self.held.append(side)
            return None
        if command is Commands.set_hardware_state:
            self.states[side] = args[1]
        assert command in (Commands.hardware, Commands.set_hardware_state)
        return HardwareInfo(side.unit, self.states[side], (), ())


class FakeGripper:
    """Counts how often it was told to hold."""

    def __init__(self) -> None:
        self.holds = 0
        self.refusal = ""

    def position(self) -> float:
        return 0.01

    def hold(self) -> None:
        self.holds += 1
        if self.refusal:
            raise RobotNotReady(self.refusal)


class RobotManagerRig:
    """All nodes, spun by a thread; and a client."""

    def __init__(self) -> None:
        self.manager, self.connection, self.line = FakeManager(), FakeConnection(), FakeLine()
        self.node = rclpy.create_node("yumi_robot_manager")
        self.grippers = {side: FakeGripper() for side in Side}
        self.managed = ManagedNodes(self.connection, self.manager, self.line, self.grippers, lambda: None)
        offered = (self.node, self.manager, self.managed.permission, lambda: None)
        RobotManagerServices(*offered)
        self.speed = SpeedSetting()
        SpeedScaleInterface(self.node, self.speed)
        self.actions = RobotManagerActions(*offered)
        self.ticker = Ticker(SystemClock(), print)
        self.topic = RobotStateTopic(self.node, self.manager.state, SystemClock(), self.ticker)
        self.client = Client()
        self._executor = MultiThreadedExecutor(num_threads=THREADS)
        for node in (self.node, *self.managed.all):
            self._executor.add_node(node)
        self._is_over = Event()
        self._thread = Thread(target=self._spin, name="robot-manager-rig")
        self._thread.start()
        self._begin_all_threads()
        self.ticker.start()

    def begin(self) -> None:
        """A test begins: all active, nothing refused, nothing noted."""
        self.manager.refusals.clear()
        self.manager.robot = READY
        self.manager.may_go_on.set()
        self.connection.refusal = ""
        self.managed.bring_up()
        self.manager.calls.clear()
        self.line.held.clear()
        for gripper in self.grippers.values():
            gripper.holds, gripper.refusal = 0, ""
        self.client.sentences.clear()

    def call(self, kind: Any, service: str, /, **fields: Any) -> Any:
        return self.client.call(kind, f"/yumi_robot_manager/{service}", kind.Request(**fields))

    def lead(self, node: str, label: str) -> bool:
        request = ChangeState.Request(transition=Transition(label=label))
        return bool(self.client.call(ChangeState, f"{node}/change_state", request).success)

    def lead_by_number(self, node: str, number: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=number))
        return bool(self.client.call(ChangeState, f"{node}/change_state", request).success)

    def life(self, node: str) -> str:
        return str(self.client.call(GetState, f"{node}/get_state").current_state.label)

    def know(self, **fields: Any) -> None:
        """The robot is otherwise than it was."""
        self.manager.robot = replace(self.manager.robot, **fields)

    def close(self) -> None:
        self.ticker.stop()
        self._is_over.set()
        self._thread.join()
        self._executor.shutdown()
        self.client.close()
        self.actions.destroy()
        self.managed.destroy()
        self.node.destroy_node()

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
