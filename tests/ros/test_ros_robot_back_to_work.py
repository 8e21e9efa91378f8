"""The robot manager's modes, managed nodes and recovery, as applications use them on the driver and a virtual robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import radians
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from ros_bench import Client, Robot
from yumi_interfaces.srv import RunRoutine

from yumi.errors import RobotNotReady
from yumi.hardware.manager_state import Mode
from yumi.hardware.rws_client import RwsClient
from yumi.links.command import Command
from yumi.robot.joints import Joints, Side, joints
from yumi.ros.clients import ArmClient, RobotManagerClient, Spinner
from yumi.ros.move_and_grab import MoveAndGrab

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

MANAGED = ("/yumi_robot", "/r/arm", "/l/arm", "/r/gripper", "/l/gripper")


@pytest.fixture(scope="module")
def spinner(driver: Command) -> Iterator[Spinner]:
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


def lead(client: Client, node: str, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(client.call(ChangeState, f"{node}/change_state", request).success)


def goal_near(position: Joints, change: float) -> Joints:
    return joints([*position[:6], position[6] + change])


def begin_to_move(manager: RobotManagerClient, arm: ArmClient, spinner: Spinner) -> Joints:
    """Where an arm was that moves 40° away; a machine that stands still meanwhile ends EGM, which then begins again."""
    start: list[Joints] = []

    def is_moving() -> bool:
        if not start or not arm.is_commanded:
            manager.start_egm()
            arm.wait_for_status(5.0)
            start[:] = [arm.wait_for_state(5.0)]
            arm.move(goal_near(start[0], radians(40.0)))
        return arm.error(start[0]) > radians(2.0)

    spinner.until(is_moving, 30.0, "Motion")
    return start[0]


def test_driver_leads_its_managed_nodes_to_active(client: Client) -> None:
    states = {node: client.call(GetState, f"{node}/get_state").current_state.label for node in MANAGED}
    assert states == dict.fromkeys(MANAGED, "active")


def test_state_of_the_robot_is_on_its_topic_and_in_diagnostics(manager: RobotManagerClient, idle: Client) -> None:
    state = manager.wait_for_state(lambda state: state.is_ready, 10.0, "Readiness")
    assert (state.operating_mode, state.controller_state, state.rapid_execution) == ("AUTO", "motoron", "running")
    assert (state.left_state_machine, state.left_egm, state.speed_ratio) == ("IDLE", "off", 100)
    got: list[Any] = []
    idle.node.create_subscription(DiagnosticArray, "/diagnostics", got.append, 10)
    idle.until(lambda: any(status.name == "yumi: robot" for array in got for status in array.status))
    (told,) = {status.message for array in got for status in array.status if status.name == "yumi: robot"}
    assert told == "ready"


def test_one_arm_is_guided_alone_and_then_both_and_then_none(manager: RobotManagerClient) -> None:
    steps: list[str] = []
    manager.set_mode(Mode.EGM_LEFT, steps.append)
    state = manager.wait_for_state(lambda state: state.left_egm == "running", 5.0, "EGM on the left arm")
    assert state.right_egm == "off"
    assert "start EGM on the left arm" in steps
    manager.set_mode(Mode.EGM_BOTH)
    manager.wait_for_state(lambda state: state.right_egm == state.left_egm == "running", 5.0, "EGM on both arms")
    manager.set_mode(Mode.READY)
    manager.wait_for_state(lambda state: state.right_egm == state.left_egm == "off", 5.0, "The end of EGM")


def test_signals_and_variables_are_read_and_written(manager: RobotManagerClient) -> None:
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
    manager.wait_for_state(lambda state: state.right_state_machine == busy, 10.0, "The beginning of the routine")
    assert manager.stop_rapid() == "The RAPID program is stopped"
    client.until(running.done)
    assert running.result().message.startswith("The RAPID program stopped while T_ROB_R ran a routine")
    assert manager.recover().endswith("The robot is ready.")


def test_deactivated_robot_comes_to_rest_and_goes_on_when_it_is_activated(
    manager: RobotManagerClient, spinner: Spinner, client: Client
) -> None:
    arm = ArmClient(spinner, Side.RIGHT, lambda *_: None)
    start = begin_to_move(manager, arm, spinner)
    assert lead(client, "/yumi_robot", Transition.TRANSITION_DEACTIVATE)
    manager.wait_for_state(lambda state: state.right_egm == "off", 5.0, "The end of EGM")
    with pytest.raises(RobotNotReady, match="The robot is inactive; activate it first"):
        manager.start_egm()
    assert lead(client, "/yumi_robot", Transition.TRANSITION_ACTIVATE)
    assert arm.error(goal_near(start, radians(40.0))) > radians(2.0)
    manager.start_egm()
    manager.stop_egm()


def test_inactive_arm_is_not_guided(manager: RobotManagerClient, client: Client) -> None:
    assert lead(client, "/l/arm", Transition.TRANSITION_DEACTIVATE)
    with pytest.raises(RobotNotReady, match="The left arm is inactive"):
        manager.start_egm()
    assert lead(client, "/l/arm", Transition.TRANSITION_ACTIVATE)


def test_robot_is_disconnected_and_connected_again(manager: RobotManagerClient, client: Client) -> None:
    for transition in (
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_CLEANUP,
        Transition.TRANSITION_CONFIGURE,
        Transition.TRANSITION_ACTIVATE,
    ):
        assert lead(client, "/yumi_robot", transition)
    manager.wait_for_state(lambda state: state.is_ready, 10.0, "Readiness")


def test_application_recovers_and_goes_on_when_the_program_is_stopped(driver: Command, rws: RwsClient) -> None:
    listener = Listener({"move the left arm": rws.stop_rapid})
    application = MoveAndGrab(listener, lambda: None)
    try:
        application.run()
    finally:
        application.close()
    told = " ".join(listener.told)
    assert "The left arm was stopped " in told
    assert "Recover, attempt 1 of 3" in told
    assert application.reports[Side.LEFT].final_error < radians(0.1)
    assert driver.exit_code is None
