"""Clients of the driver's ROS interface: what an application needs to move both arms and both grippers.

A client of everything that one hand offers; what is refused is raised, in the driver's words where it has any.

A client that leads a managed node of the driver through its life.

A client of everything that ``yumi_robot_manager`` offers; what is refused is raised, in the driver's words.

Calls of one node's services: waited for, and raised in the driver's words when they are refused.

An application's node, and waiting in it: the node is spun by who waits, and by nobody else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand, ParallelGripperCommand
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.msg import RobotState
from yumi_interfaces.srv import (
    LoadModule,
    ReadSignal,
    ReadVariable,
    RunModule,
    RunRoutine,
    SetSpeedRatio,
    WriteSignal,
    WriteVariable,
)

from yumi.clock import SystemClock
from yumi.driver.rapid_routines import LONGEST_ROUTINE
from yumi.driver.state import Mode
from yumi.errors import CommandRefused, GoalNotReached, RobotNotReady, StopNotConfirmed, YumiError
from yumi.robot.gripper import TRAVEL, Outcome, outcome_of
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.ros.gripper import FAILURE, FAILURES

_SPIN = 0.05  # [s]


class Spinner:
    """Spins one node until something has happened; everything an application waits for goes through here.

    Args:
        node: the application's node.
        check: called again and again while waiting; raises when waiting has become useless.
    """

    def __init__(self, node: Any, check: Callable[[], None] = lambda: None) -> None:
        self.node = node
        self._check = check
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def close(self) -> None:
        """Let go of the node, so that another spinner may have it."""
        self._executor.remove_node(self.node)
        self._executor.shutdown()

    def until(self, is_so: Callable[[], bool], timeout: float, what: str) -> None:
        """Spin until ``is_so``.

        Raises:
            RobotNotReady: it did not become so within ``timeout`` [s].
            Exception: whatever the check raises.
        """
        clock = SystemClock()  # not the node's, which somebody may set meanwhile
        end = clock.now() + timeout
        while not is_so():
            self._check()
            if clock.now() > end:
                raise RobotNotReady(f"{what} did not happen within {timeout:g} s.")
            self._executor.spin_once(timeout_sec=_SPIN)


@contextmanager
def application(name: str) -> Iterator[Spinner]:
    """ROS with one node, for a program that has nothing else; it ends with the block.

    ::

        with application("grip") as spinner:
            GripperClient(spinner, Side.LEFT).move_to(0.01)

    Ctrl-C stays Python's KeyboardInterrupt, so that the program can end its motion with ROS before it goes.

    Args:
        name: the node's.
    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(name)
        spinner = Spinner(node)
        try:
            yield spinner
        finally:
            spinner.close()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


class ServiceCalls:
    """Calls services below one name.

    Args:
        spinner: spins the node it belongs to.
        prefix: what their names begin with, e.g. ``r/gripper``.
    """

    def __init__(self, spinner: Spinner, prefix: str) -> None:
        self._spinner = spinner
        self._prefix = prefix
        self._clients: dict[str, Any] = {}

    def prepare(self, kind: Any, name: str) -> None:
        """Look for a service before it is called: finding it takes a moment."""
        self._client(kind, name)

    def call(self, kind: Any, name: str, timeout: float, /, **fields: object) -> Any:
        """The service's response, whatever it says.

        Raises:
            RobotNotReady: there is no such service, or no answer within ``timeout`` [s].
        """
        client = self._client(kind, name)
        self._spinner.until(client.service_is_ready, timeout, f"The service {name} of the driver: its appearance")
        future = client.call_async(kind.Request(**fields))
        self._spinner.until(future.done, timeout, f"The answer of {name}")
        return future.result()

    def demand(self, kind: Any, name: str, timeout: float, /, **fields: object) -> Any:
        """The service's response, which says that it was done.

        Raises:
            RobotNotReady: it was refused or failed; the message says why.
        """
        response = self.call(kind, name, timeout, **fields)
        if not response.success:
            raise RobotNotReady(str(response.message))
        return response

    def _client(self, kind: Any, name: str) -> Any:
        if name not in self._clients:
            self._clients[name] = self._spinner.node.create_client(kind, f"{self._prefix}/{name}")
        return self._clients[name]


_ANSWER = 30.0  # [s]; calibration takes some seconds
_ACCEPTANCE = 10.0  # [s]
_REASON = 1.0  # [s]
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        position: finger position [m].
        effort: holding force [N]; 0 when nothing is held.
        outcome: what became of it.
    """

    position: float
    effort: float
    outcome: Outcome

    @property
    def word(self) -> str:
        """``holding``, ``open``, ``closed``, ``in place`` or ``stalled``."""
        return self.outcome.value


class GripperClient:
    """The actions and services of one hand.

    What moves the fingers with a goal raises CommandRefused when the driver refuses it, and GoalNotReached when it
    could not carry it out or was cancelled. Every service raises RobotNotReady when it was refused or failed. All of
    them say why.

    Args:
        spinner: spins the node it belongs to.
        side: which hand.
    """

    def __init__(self, spinner: Spinner, side: Side) -> None:
        self._spinner = spinner
        self._side = side
        self._name = f"{side.value}/gripper"
        self._services = ServiceCalls(spinner, self._name)
        self._actions: dict[str, Any] = {}
        self._goal: Any = None
        self._failures = (0, "")  # how many goals failed, and why the last one did
        spinner.node.create_subscription(DiagnosticStatus, f"{self._name}/state", self._take_state, _LATCHED)
        self._action(GripperCommand, "gripper_cmd")  # finding it takes a moment

    # Goals

    def begin(self, position: float, effort: float = 0.0) -> Callable[[], Grip]:
        """Send the fingers to ``position`` [m] with ``effort`` [N]; returns what waits for the result."""
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = position, effort
        wait = self._begin(GripperCommand, "gripper_cmd", goal)

        def result() -> Grip:
            ended = wait()
            return _grip(ended.position, ended.effort, ended)

        return result

    def begin_at_speed(self, position: float, speed: float, effort: float = 0.0) -> Callable[[], Grip]:
        """The same with ``parallel_gripper_cmd``, at ``speed`` of each finger [m/s]."""
        command = JointState(position=[position], velocity=[speed], effort=[effort])
        goal = ParallelGripperCommand.Goal(command=command)
        wait = self._begin(ParallelGripperCommand, "parallel_gripper_cmd", goal)

        def result() -> Grip:
            ended = wait()
            return _grip(ended.state.position[0], ended.state.effort[0], ended)

        return result

    def move_to(self, position: float, speed: float = 0.0) -> Grip:
        """Send the fingers to ``position`` [m]; ``speed`` 0 is the configured one [m/s]."""
        return self.begin_at_speed(position, speed)()

    def grip_inwards(self, force: float = 0.0) -> Grip:
        """Close on what is between the fingers with ``force`` [N]; 0 is the configured one."""
        return self.begin(0.0, force)()

    def grip_outwards(self, force: float) -> Grip:
        """Open inside something hollow with ``force`` [N]."""
        return self.begin(TRAVEL, force)()

    def cancel(self) -> None:
        """Stop the fingers on their way to the newest goal, whose wait then raises GoalNotReached."""
        if self._goal is not None:
            asked = self._goal.cancel_goal_async()
            self._spinner.until(asked.done, _ACCEPTANCE, f"The end of the {self._side.word} gripper's goal")

    # Services

    def calibrate(self) -> str:
        """Close the fingers and call that zero."""
        return self._demand(Trigger, "calibrate")

    def jog_open(self) -> str:
        """Open slowly until :meth:`stop`, calibrated or not."""
        return self._demand(Trigger, "jog_open")

    def jog_close(self) -> str:
        """Close slowly until :meth:`stop`, calibrated or not."""
        return self._demand(Trigger, "jog_close")

    def stop(self) -> str:
        """Stop the fingers; what they hold is let go."""
        return self._demand(Trigger, "stop")

    def clear_error(self) -> str:
        """Acknowledge the hand's error."""
        return self._demand(Trigger, "clear_error")

    def switch_vacuum(self, channel: int, *, is_on: bool) -> str:
        """Switch the vacuum of module 1 or 2; its blow-off ends."""
        return self._demand(SetBool, f"vacuum_{channel}", data=is_on)

    def switch_blow(self, channel: int, *, is_on: bool) -> str:
        """Switch the blow-off of module 1 or 2; its vacuum ends."""
        return self._demand(SetBool, f"blow_{channel}", data=is_on)

    # How

    def _demand(self, kind: Any, service: str, **fields: object) -> str:
        return str(self._services.demand(kind, service, _ANSWER, **fields).message)

    def _action(self, kind: Any, name: str) -> Any:
        if name not in self._actions:
            self._actions[name] = ActionClient(self._spinner.node, kind, f"{self._name}/{name}")
        return self._actions[name]

    def _begin(self, kind: Any, name: str, goal: Any) -> Callable[[], Any]:
        action, side = self._action(kind, name), self._side.word
        self._spinner.until(action.server_is_ready, _ACCEPTANCE, f"The {side} gripper's action: its appearance")
        before = self._failures[0]
        sent = action.send_goal_async(goal)
        self._spinner.until(sent.done, _ACCEPTANCE, f"The answer of the {side} gripper")
        handle = sent.result()
        if not handle.accepted:
            raise CommandRefused(f"The {side} gripper refused the goal: {self._why_failed(before)}")
        self._goal = handle
        return lambda: self._result(handle, before)

    def _result(self, handle: Any, before: int) -> Any:
        future = handle.get_result_async()
        self._spinner.until(future.done, _ANSWER, f"The end of the {self._side.word} gripper's motion")
        if self._goal is handle:
            self._goal = None
        status = future.result().status
        if status == GoalStatus.STATUS_CANCELED:
            raise GoalNotReached(f"The {self._side.word} gripper's goal was cancelled; its fingers stand.")
        if status != GoalStatus.STATUS_SUCCEEDED:
            raise GoalNotReached(self._why_failed(before))
        return future.result().result

    def _why_failed(self, before: int) -> str:
        """The driver's words for a goal that failed after ``before`` others; they come on another topic."""
        with suppress(RobotNotReady):
            self._spinner.until(lambda: self._failures[0] > before, _REASON, "The reason")
            return self._failures[1]
        return f"The {self._side.word} gripper did not do it; the driver's log says why."

    def _take_state(self, status: Any) -> None:
        values = {each.key: each.value for each in status.values}
        self._failures = (int(values.get(FAILURES, 0)), values.get(FAILURE, ""))


def _grip(position: float, effort: float, result: Any) -> Grip:
    outcome = outcome_of(position, effort, stalled=result.stalled, reached_goal=result.reached_goal)
    return Grip(position=position, effort=effort, outcome=outcome)


class ManagedNodeClient:
    """One of ``yumi_robot``, ``r/arm``, ``r/gripper``, ``l/arm`` and ``l/gripper``.

    Every transition raises CommandRefused when it is not possible now or failed; the driver's log says why.

    Args:
        spinner: spins the node it belongs to.
        name: of the managed node.
    """

    def __init__(self, spinner: Spinner, name: str) -> None:
        self._name = name
        self._services = ServiceCalls(spinner, name)

    @property
    def state(self) -> str:
        """``unconfigured``, ``inactive``, ``active`` or ``finalized``."""
        return str(self._services.call(GetState, "get_state", _ANSWER).current_state.label)

    def configure(self) -> None:
        """Connect and check."""
        self._lead("configure")

    def activate(self) -> None:
        """Permit motion."""
        self._lead("activate")

    def deactivate(self) -> None:
        """Hold, and permit no motion."""
        self._lead("deactivate")

    def cleanup(self) -> None:
        """Disconnect."""
        self._lead("cleanup")

    def _lead(self, label: str) -> None:
        transition = Transition(label=label)
        if not self._services.call(ChangeState, "change_state", _ANSWER, transition=transition).success:
            raise CommandRefused(f"{self._name} does not {label}: it is {self.state}; the driver's log says why.")


NAME = "yumi_robot_manager"
_READ = 10.0  # [s]
_ROUTINE = LONGEST_ROUTINE + _ANSWER
_ACTION = 120.0  # [s]; a controller that restarts is dark for some twenty

OnStep = Callable[[str], None]
"""Told each step of an action."""


def _ignore(_: str) -> None:
    return None


class RobotManagerClient:
    """The services, actions and the state of ``yumi_robot_manager``.

    Every call that changes something raises RobotNotReady when it was refused or failed; the message says why.

    Attributes:
        state: the newest ``yumi_interfaces/RobotState``; None before the first.

    Args:
        spinner: spins the node it belongs to.
    """

    def __init__(self, spinner: Spinner) -> None:
        self.state: Any = None
        self._spinner = spinner
        self._services = ServiceCalls(spinner, NAME)
        self._actions: dict[str, Any] = {}
        spinner.node.create_subscription(RobotState, f"{NAME}/state", self._take_state, _LATCHED)
        for name in ("start_egm", "stop_egm", "robot_is_ready", "get_state"):  # finding them takes a moment
            self._services.prepare(Trigger, name)

    def robot_is_ready(self) -> str | None:
        """None when EGM can be started, else the reason why not."""
        response = self._services.call(Trigger, "robot_is_ready", _READ)
        return None if response.success else str(response.message)

    def get_state(self) -> str:
        """The robot's state in one line."""
        return self._demand(Trigger, "get_state")

    def wait_for_state(self, is_so: Callable[[Any], bool], timeout: float, what: str) -> Any:
        """Wait until ``is_so`` of the state; returns it.

        Raises:
            RobotNotReady: ``what`` did not come.
        """
        self._spinner.until(lambda: self.state is not None and is_so(self.state), timeout, what)
        return self.state

    def start_egm(self) -> str:
        """Make the robot ready if need be, start EGM on both arms and activate their position controllers."""
        return self._demand(Trigger, "start_egm")

    def stop_egm(self) -> str:
        """Deactivate what commands the arms, and stop EGM."""
        return self._demand(Trigger, "stop_egm")

    @contextmanager
    def egm_running(self, report: OnStep = _ignore) -> Iterator[None]:
        """EGM on both arms for the time of a block, ended on every way out: ``with manager.egm_running():``.

        Args:
            report: told what the driver says when EGM has started, and when it has ended.

        Raises:
            RobotNotReady: EGM did not start, or did not end after a block that went well.
        """
        has_begun = True  # as far as anybody knows: Ctrl-C may come while the driver starts EGM
        try:
            try:
                report(self.start_egm())
            except YumiError:
                has_begun = False
                raise
            yield
        except BaseException:  # Ctrl-C too
            if has_begun:
                with suppress(YumiError):  # what went wrong in the block matters more
                    report(self.stop_egm())
            raise
        report(self.stop_egm())

    def motors_on(self) -> str:
        """Switch the motors on."""
        return self._demand(Trigger, "motors_on")

    def motors_off(self) -> str:
        """Switch the motors off; the brakes hold the arms."""
        return self._demand(Trigger, "motors_off")

    def start_rapid(self) -> str:
        """Start the RAPID program from where its program pointers are."""
        return self._demand(Trigger, "start_rapid")

    def stop_rapid(self) -> str:
        """Stop the RAPID program."""
        return self._demand(Trigger, "stop_rapid")

    def pp_to_main(self) -> str:
        """Move the program pointers to main; RAPID must be stopped."""
        return self._demand(Trigger, "pp_to_main")

    def set_speed_ratio(self, percent: int) -> str:
        """Set the share of all speeds that RAPID moves with [%]."""
        return self._demand(SetSpeedRatio, "set_speed_ratio", percent=percent)

    def run_routine(self, side: Side, routine: str) -> str:
        """Run a RAPID routine without parameters, and wait for its end."""
        return str(self._services.demand(RunRoutine, "run_routine", _ROUTINE, arm=side.word, routine=routine).message)

    def load_module(self, side: Side, file_name: str, text: str) -> str:
        """Write a RAPID module to the controller and load it into the arm's task."""
        return self._demand(LoadModule, "load_module", arm=side.word, file_name=file_name, text=text)

    def run_module(self, side: Side, file_name: str, text: str, routine: str) -> str:
        """Write and load a RAPID module and run one of its routines, and wait for its end."""
        fields = {"arm": side.word, "file_name": file_name, "text": text, "routine": routine}
        return str(self._services.demand(RunModule, "run_module", _ROUTINE, **fields).message)

    def read_signal(self, name: str) -> str:
        """The value of an I/O signal."""
        return str(self._services.demand(ReadSignal, "read_signal", _READ, name=name).value)

    def write_signal(self, name: str, value: str) -> str:
        """Write an I/O signal."""
        return self._demand(WriteSignal, "write_signal", name=name, value=value)

    def read_variable(self, task: str, module: str, name: str) -> str:
        """The value of a RAPID variable, as RAPID writes it."""
        fields = {"task": task, "module": module, "name": name}
        return str(self._services.demand(ReadVariable, "read_variable", _READ, **fields).value)

    def write_variable(self, task: str, module: str, name: str, value: str) -> str:
        """Write a RAPID variable; ``value`` as RAPID writes it."""
        fields = {"task": task, "module": module, "name": name, "value": value}
        return self._demand(WriteVariable, "write_variable", **fields)

    def set_mode(self, mode: Mode, on_step: OnStep = _ignore) -> str:
        """Bring the robot to a named state, step by step."""
        return self._carry_out(SetMode, "set_mode", SetMode.Goal(mode=mode.value), on_step)

    def recover(self, on_step: OnStep = _ignore, confirm: str = "") -> str:
        """Have what stopped the robot cleared, as far as it may be, and the robot brought to ready; what was done.

        Args:
            on_step: told each step.
            confirm: the stop that a person has looked at and confirms, ``state.stop``; needed after an emergency stop,
                a guard stop or a collision.

        Raises:
            StopNotConfirmed: a person has to confirm the stop first; its id is the error's ``stop``.
            RobotNotReady: a step failed; the message says which and what to do.
        """
        return self._carry_out(Recover, "recover", Recover.Goal(confirm_stop=confirm), on_step)

    def _take_state(self, message: Any) -> None:
        self.state = message

    def _demand(self, kind: Any, service: str, /, **fields: object) -> str:
        return str(self._services.demand(kind, service, _ANSWER, **fields).message)

    def _carry_out(self, kind: Any, name: str, goal: Any, on_step: OnStep) -> str:
        if name not in self._actions:
            self._actions[name] = ActionClient(self._spinner.node, kind, f"{NAME}/{name}")
        action = self._actions[name]
        self._spinner.until(action.server_is_ready, _READ, f"The action {name} of the driver: its appearance")
        sent = action.send_goal_async(goal, feedback_callback=lambda message: on_step(str(message.feedback.step)))
        self._spinner.until(sent.done, _READ, f"The answer of {name}")
        result = self._result(sent.result(), name)
        message, stop = str(result.message), str(result.state.stop)
        if not result.success and stop and stop in message:  # the state is newer: a stop it alone knows was not shown
            raise StopNotConfirmed(message, stop)
        if not result.success:
            raise RobotNotReady(message)
        return message

    def _result(self, handle: Any, name: str) -> Any:
        ended = handle.get_result_async()
        try:
            self._spinner.until(ended.done, _ACTION, f"The end of {name}")
        except BaseException:
            handle.cancel_goal_async()
            raise
        return ended.result().result


__all__ = ["ArmClient", "Grip", "GripperClient", "ManagedNodeClient", "RobotManagerClient", "Spinner", "application"]


class ArmClient:
    """Goals and joint states of one arm.

    Attributes:
        position: of the newest joint state [rad]; None before the first.
        missed: cycles without an answer, as the driver counts them since its start.
        is_commanded: whether EGM runs and a controller commands the arm.

    Args:
        spinner: spins the node it belongs to.
        side: which arm.
        on_state: called with time [s] and positions [rad] of every joint state.
    """

    def __init__(self, spinner: Spinner, side: Side, on_state: Callable[[float, Joints], None]) -> None:
        self.position: Joints | None = None
        self.missed = 0
        self.is_commanded = False
        self._has_status = False
        self._status = ""
        self._spinner = spinner
        self._side = side
        self._on_state = on_state
        node, name = spinner.node, side.value
        self._publisher = node.create_publisher(JointState, f"{name}/joint_commands", 10)
        node.create_subscription(JointState, f"{name}/joint_states", self._take, 100)
        node.create_subscription(DiagnosticStatus, f"{name}/egm_state", self._take_status, 1)

    def wait_for_state(self, timeout: float) -> Joints:
        """The arm's position [rad], waiting for the first joint state.

        Raises:
            RobotNotReady: none came.
        """
        self._spinner.until(lambda: self.position is not None, timeout, f"A joint state of the {self._side.word} arm")
        assert self.position is not None
        return self.position

    def wait_for_status(self, timeout: float) -> None:
        """Wait until ``missed`` is known.

        Raises:
            RobotNotReady: the driver did not tell.
        """
        self._spinner.until(lambda: self._has_status, timeout, f"The EGM state of the {self._side.word} arm")

    def move(self, goal: Joints) -> None:
        """Publish a goal [rad]; returns at once."""
        self._spinner.until(
            lambda: self._publisher.get_subscription_count() > 0,
            10.0,
            f"A listener for goals of the {self._side.word} arm",
        )
        message = JointState()
        message.name = list(joint_names(self._side))
        message.position = list(goal)
        self._publisher.publish(message)

    def reach(self, goal: Joints, tolerance: float, timeout: float) -> None:
        """Publish a goal and wait until all joints are nearer to it than ``tolerance`` [rad].

        Raises:
            GoalNotReached: they were not in ``timeout`` [s], or the arm follows no more.
        """
        self.wait_for_command(timeout)
        self.move(goal)
        is_there = False

        def has_ended() -> bool:
            nonlocal is_there
            is_there = self.error(goal) < tolerance
            return is_there or not self.is_commanded

        try:
            self._spinner.until(has_ended, timeout, "Arrival")
        except RobotNotReady:
            raise GoalNotReached(
                f"The {self._side.word} arm has not reached its goal within {timeout:g} s: the farthest joint is "
                f"{self.error(goal):.3f} rad away."
            ) from None
        if not is_there:
            raise GoalNotReached(
                f"The {self._side.word} arm follows no more ({self._status}); the driver's log says why."
            )

    def wait_for_command(self, timeout: float) -> None:
        """Wait until a controller commands the arm.

        Raises:
            RobotNotReady: none does.
        """
        self._spinner.until(lambda: self.is_commanded, timeout, f"A controller that commands the {self._side.word} arm")

    def error(self, goal: Joints) -> float:
        """Largest distance of a joint from ``goal`` [rad]."""
        position = self.wait_for_state(5.0)
        return max(abs(now - wanted) for now, wanted in zip(position, goal, strict=True))

    def _take(self, message: Any) -> None:
        self.position = joints(message.position)
        self._on_state(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9, self.position)

    def _take_status(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self.missed = int(values["missed"])
        self.is_commanded = values["running"] == values["commanded"] == str(True)
        self._status = message.message
        self._has_status = True
