"""One hand as an rclpy program sees it: actions, services and topics, on a virtual robot in virtual time."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import nan
from threading import Barrier, Event
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand, ParallelGripperCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import Client, rclpy
from ros_clients import GripperClient
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady
from abb_protocols.robot.gripper_values import (
    FINGER_TRAVEL,
    LOWEST_FINGER_SPEED,
    MAX_GRIP_FORCE,
    TOP_FINGER_SPEED,
    GripperModules,
    GripperState,
    read_gripper,
)
from abb_protocols.robot.joints import CYCLE, Side, finger_names
from abb_runtime.clock import SystemClock
from abb_runtime.faults import Fault
from system.virtual_time_bench import System
from virtual_irc5.mechanics.virtual_gripper import CupObject, Workpiece
from yumi.driver.settings import GripperSettings
from yumi.ros.gripper_actions import GripperParts, Grippers
from yumi.ros.nodes import TimerThread

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]

THREADS = 3  # a goal that goes on, one that is refused, and a timer
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SETTINGS = GripperSettings(left=GripperModules.VACUUM)


class Robot(System):
    """The virtual robot, which goes on only while the gate is open; tells what its hands show."""

    def __init__(self) -> None:
        super().__init__(modules=GripperModules.VACUUM, are_calibrated=True)
        self.gate = Event()
        self.gate.set()
        self.bringup.make_ready()

    def wait(self, seconds: float) -> None:
        assert self.gate.wait(10.0)
        super().wait(seconds)

    def keep_open(self) -> None:
        """It always tells."""

    def close(self) -> None:
        """Nothing to close."""

    def state(self, side: Side) -> GripperState:
        signals, suffix = self.world.controller.signals, side.name[0]
        return read_gripper(lambda name: signals.get(f"{name}_{suffix}").value, SETTINGS.modules(side))


class Hand:
    """The left hand's clients."""

    def __init__(self, client: Client, robot: Robot, refusals: list[str]) -> None:
        self.client = client
        self.robot = robot
        self.refusals = refusals  # why nothing may move, when there is something in it
        self.application = GripperClient(client, Side.LEFT)
        self._actions: list[Any] = []

    @property
    def virtual(self) -> Any:
        return self.robot.world.grippers[Side.LEFT]

    def send(self, kind: Any, goal: Any) -> Any:
        name = "gripper_cmd" if kind is GripperCommand else "parallel_gripper_cmd"
        action = ActionClient(self.client.node, kind, f"l/gripper/{name}")
        self._actions.append(action)
        self.client.until(action.server_is_ready)
        return self._wait(action.send_goal_async(goal))

    def command(self, position: float, effort: float = 0.0) -> Any:
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = position, effort
        return self.send(GripperCommand, goal)

    def result(self, handle: Any) -> Any:
        assert handle.accepted
        return self._wait(handle.get_result_async())

    def cancel(self, handle: Any) -> None:
        self._wait(handle.cancel_goal_async())

    def trigger(self, name: str) -> Any:
        return self.client.call(Trigger, f"l/gripper/{name}")

    def switch(self, name: str, *, is_on: bool) -> Any:
        return self.client.call(SetBool, f"l/gripper/{name}", SetBool.Request(data=is_on))

    def hear(self, kind: Any, topic: str, qos: Any = 10) -> list[Any]:
        heard: list[Any] = []
        self.client.node.create_subscription(kind, f"l/gripper/{topic}", heard.append, qos)
        return heard

    def close(self) -> None:
        for action in self._actions:
            action.destroy()
        self._actions.clear()

    def _wait(self, future: Any) -> Any:
        self.client.until(future.done)
        return future.result()


def start_threads(executor: MultiThreadedExecutor) -> None:
    """All at once: a test counts the threads that are new at its end."""
    meeting = Barrier(THREADS + 1)
    for _ in range(THREADS):
        executor.create_task(meeting.wait, 10.0)
    for _ in range(THREADS):
        executor.spin_once(timeout_sec=1.0)
    meeting.wait(10.0)


@pytest.fixture(scope="module")
def hands(ros: None) -> Iterator[Hand]:
    robot, refusals = Robot(), []
    executor = MultiThreadedExecutor(THREADS)
    start_threads(executor)
    nodes = {side: rclpy.create_node("gripper", namespace=side.value) for side in Side}
    streams = {side: rclpy.create_node("yumi_topics", namespace=side.value) for side in Side}
    parts = GripperParts(robot.grippers, robot, SETTINGS)
    timers = TimerThread(SystemClock(), print)

    def check(side: Side) -> None:
        if refusals and side is Side.LEFT:
            raise RobotNotReady(refusals[0])

    hands = Grippers(parts, nodes, streams, lambda _: None, timers, check)
    client = Client(executor)
    for node in (*nodes.values(), *streams.values()):
        executor.add_node(node)
    timers.start()
    yield Hand(client, robot, refusals)
    timers.stop()
    client.close()
    hands.destroy()
    for node in (*nodes.values(), *streams.values()):
        node.destroy_node()


@pytest.fixture
def hand(hands: Hand) -> Iterator[Hand]:
    """Open, with nothing between its fingers."""
    hands.virtual.workpiece, hands.virtual.cups[1].under = None, None
    hands.robot.gate.set()
    assert hands.result(hands.command(FINGER_TRAVEL)).result.reached_goal
    yield hands
    hands.close()
    hands.refusals.clear()


def test_gripper_command_holds_what_it_finds(hand: Hand) -> None:
    hand.virtual.workpiece = Workpiece(0.02)
    result = hand.result(hand.command(0.0, 12.0)).result
    assert (result.stalled, result.reached_goal, result.effort) == (True, False, 12.0)
    assert result.position == pytest.approx(0.010)
    assert hand.robot.state(Side.LEFT).is_holding


def test_gripper_command_grips_outwards_when_it_is_open_with_an_effort(hand: Hand) -> None:
    hand.result(hand.command(0.0))
    hand.virtual.workpiece = Workpiece(0.030, is_hollow=True)
    result = hand.result(hand.command(FINGER_TRAVEL, 8.0)).result
    assert (result.stalled, result.effort, result.position) == (True, 8.0, pytest.approx(0.015))


def test_gripper_command_that_meets_an_obstacle_is_stalled_without_effort(hand: Hand) -> None:
    hand.virtual.workpiece = Workpiece(0.02)
    answer = hand.result(hand.command(0.005))
    assert (answer.status, answer.result.stalled, answer.result.effort) == (GoalStatus.STATUS_SUCCEEDED, True, 0.0)


def test_parallel_gripper_command_takes_speed_and_effort_by_finger_name(hand: Hand) -> None:
    names = list(finger_names(Side.LEFT))
    command = JointState(name=names, position=[0.010] * 2, velocity=[0.01] * 2)
    begin = hand.robot.now()
    result = hand.result(hand.send(ParallelGripperCommand, ParallelGripperCommand.Goal(command=command))).result
    assert (result.stalled, result.reached_goal, list(result.state.name)) == (False, True, names)
    assert list(result.state.position) == pytest.approx([0.010] * 2, abs=2e-4)
    assert hand.robot.now() - begin > 1.4


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (
            JointState(name=["elbow"], position=[0.0]),
            message("no_finger", name="elbow", fingers=finger_names(Side.LEFT)),
        ),
        (JointState(), message("goal_without_position")),
        (JointState(position=[0.01, 0.02]), message("fingers_with_different_values", what="position")),
        (
            JointState(position=[0.01], velocity=[0.5]),
            message("gripper_speed_out_of_range", speed=0.5, lowest=LOWEST_FINGER_SPEED, highest=TOP_FINGER_SPEED),
        ),
        (
            JointState(position=[0.01], effort=[nan]),
            message("gripper_effort_out_of_range", effort=nan, most=MAX_GRIP_FORCE),
        ),
        (JointState(position=[nan]), message("gripper_position_out_of_range", position=nan, most=FINGER_TRAVEL)),
    ],
)
def test_goal_that_no_gripper_can_carry_out_is_refused(hand: Hand, command: JointState, reason: Message) -> None:
    hand.client.sentences.clear()
    assert not hand.send(ParallelGripperCommand, ParallelGripperCommand.Goal(command=command)).accepted
    hand.client.until(hand.client.hears(f"Gripper goal refused: {reason}"))
    assert hand.robot.state(Side.LEFT).position == FINGER_TRAVEL


def test_goal_is_refused_while_nothing_may_move(hand: Hand) -> None:
    hand.refusals.append("the left gripper is inactive; activate it first.")
    assert not hand.command(0.0).accepted
    for answer in (hand.trigger("calibrate"), hand.trigger("jog_open"), hand.switch("vacuum_1", is_on=True)):
        assert (answer.success, answer.message) == (False, "the left gripper is inactive; activate it first.")


def test_second_goal_is_refused_and_the_first_can_be_cancelled(hand: Hand) -> None:
    hand.robot.gate.clear()
    first = hand.command(0.0)
    assert first.accepted
    assert not hand.command(FINGER_TRAVEL).accepted
    refused = hand.trigger("calibrate")
    assert refused.message == str(message("gripper_busy", gripper="left"))
    hand.cancel(first)
    hand.robot.gate.set()
    answer = hand.result(first)
    assert (answer.status, answer.result.stalled, answer.result.reached_goal) == (
        GoalStatus.STATUS_CANCELED,
        False,
        False,
    )
    assert hand.robot.state(Side.LEFT).position > 0.02


def test_gripper_is_jogged_and_stopped_and_calibrated(hand: Hand) -> None:
    assert hand.trigger("jog_close").message == "The fingers close until stop is called."
    hand.robot.wait(1.0)
    assert hand.trigger("stop").success
    assert 0.012 < hand.robot.state(Side.LEFT).position < 0.018
    assert hand.trigger("calibrate").message == "The gripper is calibrated: closed is 0."
    assert hand.robot.state(Side.LEFT).position == 0.0


def test_object_that_is_lost_is_reported_and_the_gripper_goes_on(hand: Hand) -> None:
    states = hand.hear(JointState, "joint_states")
    hand.virtual.workpiece = Workpiece(0.02)
    assert hand.result(hand.command(0.0, 9.0)).result.effort == 9.0
    hand.client.until(lambda: bool(states) and states[-1].effort[0] == 9.0)
    hand.robot.faults.inject(Fault.OBJECT_LOST, Side.LEFT)
    hand.robot.wait(1.0)
    hand.client.until(lambda: (states[-1].effort[0], states[-1].position[0]) == (0.0, 0.0))
    assert hand.result(hand.command(FINGER_TRAVEL)).result.reached_goal


def test_gripper_that_lost_its_calibration_says_so_and_is_calibrated_again(hand: Hand) -> None:
    states = hand.hear(DiagnosticStatus, "state", 1)
    hand.robot.faults.inject(Fault.GRIPPER_NOT_CALIBRATED, Side.LEFT)
    hand.robot.wait(CYCLE)
    hand.client.until(lambda: any(state.message == "not calibrated; call calibrate" for state in states))
    assert hand.result(hand.command(0.0)).status == GoalStatus.STATUS_ABORTED
    hand.client.until(hand.client.hears(str(message("gripper_not_calibrated", gripper="left"))))
    assert hand.trigger("calibrate").success
    assert hand.result(hand.command(FINGER_TRAVEL)).result.reached_goal


def test_error_is_cleared_by_its_service_and_shown_in_the_state(hand: Hand) -> None:
    states = hand.hear(DiagnosticStatus, "state", 1)
    hand.robot.faults.inject(Fault.GRIPPER_ERROR, Side.LEFT)
    hand.robot.wait(CYCLE)
    hand.client.until(lambda: any(state.message.startswith("error 7; look at the event log") for state in states))
    assert hand.result(hand.command(0.0)).status == GoalStatus.STATUS_ABORTED
    assert hand.trigger("clear_error").success
    hand.client.until(lambda: states[-1].message == "ready")


def test_vacuum_picks_an_object_and_loses_it(hand: Hand) -> None:
    pressures = hand.hear(FluidPressure, "vacuum_1/pressure")
    picked = hand.hear(Bool, "vacuum_1/object_picked", LATCHED)
    hand.client.until(lambda: [each.data for each in picked] == [False])
    hand.virtual.cups[1].under = CupObject()
    assert hand.switch("vacuum_1", is_on=True).message == "Vacuum 1 is on."
    hand.robot.wait(1.0)
    hand.client.until(lambda: [each.data for each in picked] == [False, True])
    hand.client.until(lambda: pressures[-1].fluid_pressure < 30e3)
    hand.virtual.cups[1].under = None
    hand.robot.wait(1.0)
    hand.client.until(lambda: [each.data for each in picked] == [False, True, False])
    assert hand.switch("blow_1", is_on=True).success
    assert hand.switch("blow_1", is_on=False).success


def test_vacuum_that_the_gripper_does_not_have_is_refused(hand: Hand) -> None:
    answer = hand.switch("vacuum_2", is_on=True)
    assert not answer.success
    said = message("gripper_has_other_vacuum", gripper="left", has=(1,), modules="servo+vacuum", channel=2)
    assert answer.message == str(said)


def test_finger_joints_come_with_force_and_speed(hand: Hand) -> None:
    states = hand.hear(JointState, "joint_states")
    hand.virtual.workpiece = Workpiece(0.02)
    hand.result(hand.command(0.0, 12.0))
    hand.client.until(lambda: bool(states) and list(states[-1].effort) == [12.0, 12.0])
    assert list(states[-1].position) == pytest.approx([0.010, 0.010])
    assert list(states[-1].name) == list(finger_names(Side.LEFT))


def test_vacuum_and_blow_off_are_switched(hand: Hand) -> None:
    assert hand.switch("vacuum_1", is_on=True).message == "Vacuum 1 is on."
    assert hand.switch("blow_1", is_on=True).message == "Blow-off 1 is on."
    assert hand.switch("blow_1", is_on=False).message == "Blow-off 1 is off."


def test_gripper_is_jogged_open_and_stopped(hand: Hand) -> None:
    assert hand.trigger("jog_close").success
    hand.robot.wait(0.3)
    assert hand.trigger("jog_open").message == "The fingers open until stop is called."
    assert hand.trigger("stop").message == "The fingers stand; what they held is free."


def test_refused_goal_has_its_reason_in_the_state(hand: Hand) -> None:
    said = message("gripper_position_out_of_range", position=0.03, most=FINGER_TRAVEL)
    with pytest.raises(CommandRefused, match=re.escape(f"The left gripper refused the goal: {said}")):
        hand.application.begin(0.03)


def test_failed_goal_has_its_reason_in_the_state(hand: Hand) -> None:
    hand.robot.faults.inject(Fault.GRIPPER_NOT_CALIBRATED, Side.LEFT)
    hand.robot.wait(CYCLE)
    with pytest.raises(GoalNotReached, match=re.escape(str(message("gripper_not_calibrated", gripper="left")))):
        hand.application.begin(0.01)()
    hand.robot.faults.inject(Fault.GRIPPER_ERROR, Side.LEFT)
    assert hand.trigger("clear_error").message == "The gripper reports no error."
    assert hand.trigger("calibrate").success
    hand.robot.faults.inject(Fault.GRIPPER_ERROR, Side.LEFT)
    hand.robot.wait(CYCLE)
    said = message("gripper_reports_error", gripper="left", error=7)
    with pytest.raises(GoalNotReached, match=re.escape(str(said))):
        hand.application.begin(0.01)()
    assert hand.trigger("clear_error").success
