"""The robot manager's modes and recovery, as applications use them on the driver and a virtual robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import copysign, radians
from typing import Any

import pytest
import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from controller_manager_msgs.srv import SetHardwareComponentState, SwitchController
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State
from rclpy.action import ActionClient
from ros_bench import TIMEOUT, Client, Robot
from ros_clients import ArmClient, GripperClient, RobotManagerClient, Spinner
from trajectory_msgs.msg import JointTrajectoryPoint
from yumi_interfaces.srv import RunRoutine

from abb_protocols.errors import CommandRefused, RobotNotReady, StopNotConfirmed
from abb_protocols.robot.joints import Joints, Side, joint_names, joints
from abb_runtime.fault_command import fault as fault_command
from abb_runtime.faults import Fault
from abb_runtime.process.command_process import DRIVER_READY, CommandProcess
from abb_runtime.rws.client import RwsClient
from yumi.driver.robot_state import RobotMode
from yumi.ros.move_and_grab import GRAB_GOALS, MoveAndGrab

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def spinner(driver: CommandProcess) -> Iterator[Spinner]:
    node = rclpy.create_node("application")
    spinner = Spinner(node)
    yield spinner
    spinner.close()
    node.destroy_node()


@pytest.fixture(scope="module")
def manager(spinner: Spinner) -> RobotManagerClient:
    return RobotManagerClient(spinner)


@pytest.fixture
def rws(robot: Robot) -> Iterator[RwsClient]:
    """What somebody else does at the robot."""
    with RwsClient(f"127.0.0.1:{robot.rws_port}") as client:
        yield client


class Listener:
    """Takes what an application tells; ``acts`` are done once, when their step begins."""

    def __init__(self, acts: dict[str, Callable[[], None]]) -> None:
        self.told: list[str] = []
        self._acts = acts

    def step(self, sentence: str) -> None:
        self.told.append(sentence)

    def note(self, sentence: str) -> None:
        self.told.append(sentence)

    def error(self, side: Side, error_deg: float, share: float) -> None:
        if share > 0.2 and self.told[-1] in self._acts:
            self._acts.pop(self.told[-1])()


def goal_near(position: Joints, change: float) -> Joints:
    return joints([*position[:6], position[6] + change])


def begin_to_move(manager: RobotManagerClient, arm: ArmClient, spinner: Spinner) -> Joints:
    """Where an arm was that moves 40° away; a machine that stands still meanwhile ends EGM, which then begins again."""
    start: list[Joints] = []

    def is_moving() -> bool:
        if not start or not arm.is_commanded:
            manager.start_egm()
            arm.wait_for_status(5.0)
            start[:] = [arm.wait_for_state(TIMEOUT)]
            arm.move(goal_near(start[0], radians(40.0)))
        return arm.error(start[0]) > radians(2.0)

    spinner.until(is_moving, 30.0, "Motion")
    return start[0]


def test_state_of_the_robot_is_on_its_topic_and_in_diagnostics(manager: RobotManagerClient, idle: Client) -> None:
    # An arm is streaming until it has not been heard for the time that EGM's silence may last.
    state = manager.wait_for_state(lambda state: state.is_ready and state.left_egm == "off", TIMEOUT, "Readiness")
    assert (state.operating_mode, state.controller_state, state.rapid_execution) == ("AUTO", "motoron", "running")
    assert (state.left_state_machine, state.speed_ratio) == ("IDLE", 100)
    got: list[Any] = []
    idle.node.create_subscription(DiagnosticArray, "/diagnostics", got.append, 10)
    idle.until(lambda: any(status.name == "yumi: robot" for array in got for status in array.status))
    (told,) = {status.message for array in got for status in array.status if status.name == "yumi: robot"}
    assert told == "ready"


def test_signals_and_variables_are_read_and_written(manager: RobotManagerClient, idle: Client) -> None:
    assert manager.read_variable("T_ROB_L", "TRobMain", "current_state") == "0"
    manager.write_signal("RUN_SG_ROUTINE", "0")
    assert manager.read_signal("RUN_SG_ROUTINE") == "0"
    with pytest.raises(RobotNotReady, match="no_such_signal"):
        manager.read_signal("no_such_signal")


def test_routine_of_a_loaded_module_is_stopped_by_who_does_not_wait_for_its_end(
    manager: RobotManagerClient, client: Client
) -> None:
    module = "MODULE Patience\n  PROC sitThere()\n    WaitTime 60;\n  ENDPROC\nENDMODULE\n"
    assert manager.load_module(Side.RIGHT, "Patience.mod", module) == "T_ROB_R has loaded HOME:/Patience.mod"
    service = client.node.create_client(RunRoutine, "yumi_robot_manager/run_routine")
    client.until(service.service_is_ready)
    running = service.call_async(RunRoutine.Request(arm="right", routine="sitThere"))
    busy = "RUN_RAPID_ROUTINE"
    manager.wait_for_state(lambda state: state.right_state_machine == busy, TIMEOUT, "The beginning of the routine")
    assert manager.stop_rapid() == "The RAPID program is stopped"
    client.until(running.done)
    assert running.result().message.startswith("The RAPID program stopped while T_ROB_R ran a routine")
    assert manager.recover().endswith("The robot is ready.")


def set_hardware(client: Client, side: Side, label: str) -> None:
    request = SetHardwareComponentState.Request(name=side.unit, target_state=State(label=label))
    name = f"/{side.value}/controller_manager/set_hardware_component_state"
    assert client.call(SetHardwareComponentState, name, request).ok


def test_deactivated_arm_comes_to_rest_and_egm_runs_on_the_other_one_alone_until_it_is_activated(
    manager: RobotManagerClient, spinner: Spinner, client: Client
) -> None:
    arm = ArmClient(spinner, Side.RIGHT)
    set_hardware(client, Side.RIGHT, "active")  # it is; the service is found before the arm moves
    start = begin_to_move(manager, arm, spinner)
    set_hardware(client, Side.RIGHT, "inactive")
    spinner.until(lambda: not arm.is_commanded, TIMEOUT, "The end of the commands")
    manager.set_mode(RobotMode.READY)
    manager.wait_for_state(lambda state: state.right_egm == state.left_egm == "off", TIMEOUT, "The end of EGM")
    with pytest.raises(RobotNotReady, match="The right arm is inactive; activate its hardware component ROB_R first"):
        manager.start_egm()
    steps: list[str] = []
    manager.set_mode(RobotMode.EGM_LEFT, steps.append)
    state = manager.wait_for_state(lambda state: state.left_egm == "running", TIMEOUT, "EGM on the left arm")
    assert state.right_egm == "off"
    manager.wait_for_state(lambda _: "start EGM on the left arm" in steps, TIMEOUT, "The feedback of the step")
    with pytest.raises(RobotNotReady, match="The right arm is inactive"):
        manager.set_mode(RobotMode.EGM_BOTH)
    set_hardware(client, Side.RIGHT, "active")
    assert arm.error(goal_near(start, radians(40.0))) > radians(2.0)
    manager.set_mode(RobotMode.EGM_BOTH)
    manager.wait_for_state(lambda state: state.right_egm == state.left_egm == "running", TIMEOUT, "EGM on both arms")


class Person:
    """Reads what is asked, and answers; ``acts`` are done before that."""

    def __init__(self, *acts: Callable[[], None], says_yes: bool = True) -> None:
        self.asked: list[str] = []
        self._acts = list(acts)
        self._says_yes = says_yes

    def __call__(self, sentence: str) -> bool:
        self.asked.append(sentence)
        assert len(self.asked) < 10, "\n".join(self.asked)
        if self._acts:
            self._acts.pop(0)()
        return self._says_yes


def happen(robot: Robot, fault: Fault) -> None:
    fault_command.main([fault.value.name, "--robot", f"127.0.0.1:{robot.rws_port}"], standalone_mode=False)


@pytest.fixture
def short_task(spinner: Spinner, manager: RobotManagerClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """The goals of the application: 2° from where the right arm stands; for the left one, where it has room to lift."""
    manager.start_egm()
    for side, change in ((Side.RIGHT, 2.0), (Side.LEFT, 15.0)):
        position = ArmClient(spinner, side).wait_for_state(TIMEOUT)
        middle = GRAB_GOALS[side] if side is Side.LEFT else position
        turn = copysign(radians(change), middle[6] - position[6] or -position[6])
        monkeypatch.setitem(GRAB_GOALS, side, goal_near(middle, turn))


def move_left_arm(listener: Listener, person: Person) -> None:
    """The application's motion of the left arm alone; ``yumi demo`` does the whole of it."""
    application = MoveAndGrab(listener, lambda: None, person)
    try:
        application._despite_stops(application._start_egm)
        application._despite_stops(partial(application._move, Side.LEFT))
        assert application._arms[Side.LEFT].error() < radians(0.1)
    finally:
        application.close()


@pytest.mark.usefixtures("short_task")
def test_application_asks_before_it_goes_on_when_the_program_was_stopped(
    driver: CommandProcess, rws: RwsClient
) -> None:
    listener, person = Listener({"move the left arm": rws.stop_rapid}), Person()
    move_left_arm(listener, person)
    told = " ".join(listener.told)
    assert "The left arm was stopped " in told, "\n".join(listener.told)
    assert "Recover, attempt 1 of 3" in told
    assert "10125 Program stopped" in person.asked[0]
    assert driver.exit_code is None


@pytest.mark.soak
@pytest.mark.usefixtures("short_task")
def test_application_goes_on_after_an_emergency_stop_only_when_a_person_confirms_it(
    driver: CommandProcess, robot: Robot
) -> None:
    listener = Listener({"move the left arm": partial(happen, robot, Fault.EMERGENCY_STOP)})
    person = Person(lambda: None, partial(happen, robot, Fault.EMERGENCY_STOP_RESET))
    move_left_arm(listener, person)
    assert "10013 Emergency stop: an emergency stop was pressed" in person.asked[0]
    assert "cannot be confirmed yet" in person.asked[1]


@pytest.mark.usefixtures("short_task")
def test_application_ends_with_the_cause_when_no_person_confirms_a_collision(
    driver: CommandProcess, robot: Robot, manager: RobotManagerClient, spinner: Spinner
) -> None:
    listener = Listener({"move the left arm": partial(happen, robot, Fault.COLLISION)})
    says = "50204 Motion supervision: an arm has collided"
    before = driver.log.read_text(encoding="utf-8").count(says)
    with pytest.raises(RobotNotReady, match=says) as end:
        move_left_arm(listener, Person(says_yes=False))
    state = manager.wait_for_state(lambda state: state.stop, TIMEOUT, "The stop")
    assert state.stop == end.value.stop
    assert state.rapid_execution == "stopped"
    assert says in state.cause
    manager.wait_for_state(
        lambda _: driver.log.read_text(encoding="utf-8").count(says) > before, TIMEOUT, "The log line"
    )
    for request in (manager.start_egm, manager.motors_on, lambda: manager.set_mode(RobotMode.EGM_BOTH)):
        with pytest.raises(RobotNotReady, match=state.stop):
            request()
    gripper = GripperClient(spinner, Side.LEFT)
    with pytest.raises(CommandRefused):
        gripper.begin(0.0)
    with pytest.raises(StopNotConfirmed, match="'10013-1-abcdef' is not the stop that is open now"):
        manager.recover(confirm="10013-1-abcdef")
    manager.recover(confirm=state.stop)
    manager.wait_for_state(lambda state: state.is_ready and not state.stop, TIMEOUT, "Readiness")


def test_trajectory_that_an_emergency_stop_ended_says_so(
    robot: Robot, manager: RobotManagerClient, spinner: Spinner, client: Client
) -> None:
    arm = ArmClient(spinner, Side.RIGHT)
    manager.start_egm()
    switch = SwitchController.Request(
        activate_controllers=["joint_trajectory_controller"],
        deactivate_controllers=["joint_position_controller"],
        strictness=SwitchController.Request.STRICT,
    )
    assert client.call(SwitchController, "/r/controller_manager/switch_controller", switch).ok
    start = arm.wait_for_state(TIMEOUT)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = list(joint_names(Side.RIGHT))
    point = JointTrajectoryPoint(positions=list(goal_near(start, radians(30.0))), time_from_start=Duration(sec=5))
    goal.trajectory.points = [point]
    action = ActionClient(spinner.node, FollowJointTrajectory, "/r/joint_trajectory_controller/follow_joint_trajectory")
    spinner.until(action.server_is_ready, TIMEOUT, "The action")
    sent = action.send_goal_async(goal)
    spinner.until(sent.done, TIMEOUT, "The answer")
    ended = sent.result().get_result_async()
    spinner.until(lambda: arm.error(start) > radians(2.0), TIMEOUT, "Motion")
    happen(robot, Fault.EMERGENCY_STOP)
    spinner.until(ended.done, TIMEOUT, "The end")
    assert "Cause: 10013 Emergency stop: an emergency stop was pressed" in ended.result().result.error_string
    happen(robot, Fault.EMERGENCY_STOP_RESET)
    with pytest.raises(StopNotConfirmed) as refusal:
        manager.recover()
    manager.recover(confirm=refusal.value.stop)
    manager.stop_egm()
    action.destroy()


def test_driver_never_says_that_the_robot_may_move_before_it_may(driver: CommandProcess) -> None:
    log = driver.log.read_text(encoding="utf-8")
    before, ready, _ = log.partition(DRIVER_READY)
    assert ready
    assert "may move" not in before
    assert "Waiting for a message on robot_description" not in log
