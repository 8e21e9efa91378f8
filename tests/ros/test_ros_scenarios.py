"""What may happen to a robot in mid-motion, as a ROS user sees it: told, recovered, moving again, without a jump.

Each is let happen by ``yumi fault`` on a virtual controller with a driver, all of them processes of their own. All of
it is tested cycle by cycle in virtual time, in ``system/test_recovery_scenarios`` and ``system/test_robot_monitor``,
which says how soon a change is known; a few run here with all others, the rest with ``make soak``. That a second driver
refuses is in ``test_ros_command_line``, a power cut in ``test_ros_driver`` and ``test_ros_records``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import inf
from typing import Any

import pytest
from ros_clients import RobotManagerClient
from scenario_bench import STOOD_STILL, Scenario, Stage, tracking

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import GoalNotReached, RobotNotReady, StopNotConfirmed
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripOutcome
from abb_protocols.robot.joints import Side
from abb_runtime.faults import Fault
from system.recovery_bench import largest_jump
from yumi.control.flight_recorder import RecordedCycle
from yumi.recording.reader import read_recording

# Both arms are in motion: a machine that stands still for 100 ms stops them by itself, with another cause.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(120)]

NO_JUMP = 1.001
BACK = "EGM runs on both arms, the controllers are active."
UNANSWERED = "no EGM answer reached the robot in time; check the network"

IN_EGM = tuple(message("machine", arm=side.word, machine="RUN_EGM_ROUTINE") for side in Side)


def not_ready(code: str, **values: object) -> str:
    """What the robot's state says of the first thing that it needs; the driver words it for ROS."""
    return f"not ready: {sentence(message(code, **values), FrontEnd.ROS)}"


STOPS = [
    Scenario(Fault.EGM_SILENCE, STOOD_STILL, BACK, duration=1.0),
    Scenario(
        Fault.EGM_SILENCE,
        not_ready("neither_idle_nor_in_egm", machines=IN_EGM),
        BACK,
        "ROB_R, ROB_L",
        Fault.EGM_REPAIR,
    ),
    Scenario(Fault.COMM_TIMEOUT, UNANSWERED, "41822 No data from the UdpUc device"),
    Scenario(Fault.COMM_TIMEOUT, UNANSWERED, "41822 No data from the UdpUc device", side=Side.RIGHT),
    Scenario(Fault.EGM_CONVERGENCE, "EGM: right off, left off", BACK),
    Scenario(Fault.PROGRAM_STOP, not_ready("program_stopped"), "10125 Program stopped"),
    Scenario(Fault.MOTORS_OFF, not_ready("motors_off"), "10010 Motors OFF"),
    Scenario(
        Fault.EMERGENCY_STOP,
        not_ready("emergency_stop_pressed"),
        BACK,
        "10013 Emergency stop.* 10013-",
        Fault.EMERGENCY_STOP_RESET,
    ),
    Scenario(
        Fault.MANUAL_MODE,
        not_ready("not_in_auto", mode="MANR"),
        BACK,
        "10015 Manual mode selected.*MANR",
        Fault.AUTO_MODE,
    ),
    Scenario(Fault.COLLISION, "see what the arm touched, and free the arm", "50204 Motion supervision"),
    Scenario(Fault.DYNAMIC_LOAD, "lower acceleration, or set the tool's load", "50375 Dynamic load too high"),
    Scenario(
        Fault.WRONG_PROGRAM,
        not_ready("program_stopped"),
        BACK,
        "T_ROB_R.*TRobMain",
        Fault.RIGHT_PROGRAM,
    ),
    Scenario(Fault.WARM_RESTART, not_ready("controller_does_not_answer"), BACK, duration=4.0),
]
DISTURBANCES = [Fault.RWS_RESET, Fault.RWS_SESSIONS_EXPIRED, Fault.WEB_SOCKET_DROP]
SHORT, BUSY, LOST, UNCALIBRATED = "egm-silence-0.05s", "rws-busy", "object-lost", "gripper-not-calibrated"
KILLED, ALONE, BESIDE = "driver-killed", "motion-alone", "motion-beside-the-hands"
SCENES = [
    *map(str, STOPS),
    *(fault.value.name for fault in DISTURBANCES),
    *(SHORT, BUSY, LOST, UNCALIBRATED, KILLED, ALONE, BESIDE),
]
SMOKE = {"warm-restart-4s", "web-socket-drop", KILLED}
"""What runs with all other tests: the controller, the network and the driver that are gone for a time.

What needs nobody and what needs a person are in ``test_ros_robot_back_to_work``: program, emergency stop, collision.
"""


def scenes(values: Sequence[object], name: Callable[[Any], str] = str) -> list[object]:
    """Parameters, of which those that are not in :data:`SMOKE` run with ``make soak`` only."""
    marks = {True: (), False: pytest.mark.soak}
    return [pytest.param(value, marks=marks[name(value) in SMOKE], id=name(value)) for value in values]


PERSONS_STOPS = {Fault.EMERGENCY_STOP, Fault.COLLISION}


def recover_by_person(manager: RobotManagerClient, *, needs_person: bool) -> str:
    """What recovery says in the end; a person confirms the stop where recovery asks for that."""
    if not needs_person:
        return manager.recover()
    with pytest.raises(StopNotConfirmed) as refusal:
        manager.recover()
    return manager.recover(confirm=refusal.value.stop)


@pytest.fixture(scope="module")
def stage(ros: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    stage = Stage(tmp_path_factory.mktemp("stage"))
    yield stage
    stage.close()


@pytest.mark.parametrize("scenario", scenes(STOPS))
def test_robot_that_was_stopped_says_why_and_moves_again(
    stage: Stage, scenario: Scenario, request: pytest.FixtureRequest
) -> None:
    manager = stage.application.manager
    with stage.scene(str(scenario)):
        noticed = stage.inject(scenario)
        request.node.user_properties.append(("noticed_s", round(noticed, 3)))
        if scenario.repaired_by:
            with pytest.raises(RobotNotReady, match=scenario.refused):
                manager.recover()
            stage.until_heard(f"yumi: robot: {scenario.says}")  # in /diagnostics
            stage.repair()
        assert scenario.recovered in recover_by_person(manager, needs_person=scenario.fault in PERSONS_STOPS)
        stage.reach_new_goals()


@pytest.mark.soak
def test_short_silence_of_the_network_needs_no_person(stage: Stage) -> None:
    with stage.scene(SHORT):
        listener, before = stage.application.listener, dict(stage.application.listener.interruptions)
        stage.inject_fault(Fault.EGM_SILENCE, duration=0.05)
        stage.until(lambda: all(listener.interruptions[side] > before[side] for side in Side), "The interruption")
        stage.reach_new_goals()


@pytest.mark.parametrize("fault", scenes(DISTURBANCES, lambda fault: fault.value.name))
def test_arms_go_on_and_the_robot_is_watched_whatever_becomes_of_web_services(stage: Stage, fault: Fault) -> None:
    with stage.scene(fault.value.name):
        stage.inject_fault(fault)
        stage.reach_new_goals()
        with stage.other_program() as client:
            stage.notice(partial(client.set_speed_ratio, 50), "speed ratio 50 %")
        assert stage.application.manager.set_speed_ratio(100) == "The speed ratio is 100 %"
        stage.reach_new_goals()


@pytest.mark.soak
def test_robot_is_recovered_as_soon_as_web_services_answer_again(stage: Stage) -> None:
    with stage.scene(BUSY):
        stage.inject_fault(Fault.RWS_BUSY, duration=1.5)
        stage.reach_new_goals()
        stage.inject_fault(Fault.PROGRAM_STOP)
        assert stage.application.manager.recover().startswith("Recovered after 10125 Program stopped")
        stage.reach_new_goals()


@pytest.mark.soak
def test_object_that_is_lost_is_reported_and_the_gripper_grips_again(stage: Stage) -> None:
    gripper = stage.application.grippers[Side.LEFT]
    with stage.scene(LOST):
        gripper.begin(FINGER_TRAVEL)()
        assert gripper.begin(0.0)() is GripOutcome.HOLDING
        stage.notice(lambda: stage.inject_fault(Fault.OBJECT_LOST, Side.LEFT), "left fingers press with 0 N")
        assert gripper.begin(FINGER_TRAVEL)() is GripOutcome.OPEN
        assert gripper.begin(0.0)() is GripOutcome.CLOSED
        stage.reach_new_goals()


@pytest.mark.soak
def test_gripper_that_lost_its_calibration_says_so_and_grips_again(stage: Stage) -> None:
    gripper = stage.application.grippers[Side.LEFT]
    with stage.scene(UNCALIBRATED):
        lost = partial(stage.inject_fault, Fault.GRIPPER_NOT_CALIBRATED, Side.LEFT)
        stage.notice(lost, "not calibrated; call calibrate")
        with pytest.raises(GoalNotReached, match=re.escape(str(message("gripper_not_calibrated", gripper="left")))):
            gripper.begin(0.0)()
        stage.until_heard(str(message("gripper_not_calibrated", gripper="left")))
        assert "cannot be calibrated: a state machine is not idle" in stage.calibrate(Side.LEFT)
        stage.reach_new_goals()
        stage.application.manager.stop_egm()
        assert stage.calibrate(Side.LEFT) == "The gripper is calibrated: closed is 0."
        assert gripper.begin(FINGER_TRAVEL)() is GripOutcome.OPEN


def test_what_another_program_changes_is_reported(stage: Stage, request: pytest.FixtureRequest) -> None:
    with stage.other_program() as client:
        noticed = stage.notice(partial(client.set_speed_ratio, 50), "speed ratio 50 %")
        client.set_speed_ratio(100)
    request.node.user_properties.append(("noticed_s", round(noticed, 3)))


@pytest.mark.soak
def test_grippers_grip_while_the_arms_move(stage: Stage) -> None:
    with stage.scene(ALONE) as goals:
        stage.reach(goals)
    with stage.scene(BESIDE) as goals:
        ends = [gripper.begin(0.5 * FINGER_TRAVEL) for gripper in stage.application.grippers.values()]
        stage.reach(goals)
        assert [end() for end in ends] == [GripOutcome.IN_PLACE, GripOutcome.IN_PLACE]


def test_robot_whose_driver_is_killed_comes_to_rest_and_is_moved_by_the_next_one(stage: Stage) -> None:
    with stage.span(KILLED):
        stage.begin_to_move()
        stage.kill_driver()
        assert stage.processes() == set()
        with stage.other_program() as client:
            stage.wait_for_rest(client)
        stage.start_driver()
        stage.begin_to_move()
        stage.reach_new_goals()


@pytest.fixture(scope="module")
def flights(stage: Stage) -> list[tuple[RecordedCycle, ...]]:
    """Every cycle of each arm, of one driver after the other."""
    stage.stop_driver()
    recordings = [read_recording(file, before=inf, after=inf) for file in stage.recordings]
    return [frames for recording in recordings for frames in recording.frames.values()]


@pytest.mark.parametrize("name", scenes(SCENES))
def test_no_command_of_a_scene_jumps(stage: Stage, flights: list[tuple[RecordedCycle, ...]], name: str) -> None:
    jumps = [largest_jump(frames, *stage.spans[name]) for frames in flights]
    assert 0.0 < max(jumps) < NO_JUMP


@pytest.mark.soak
@pytest.mark.parametrize("arm", range(2))
def test_motion_is_the_same_beside_gripper_commands(
    stage: Stage, flights: list[tuple[RecordedCycle, ...]], arm: int, request: pytest.FixtureRequest
) -> None:
    """Cycle for cycle it is so in ``system/test_grippers_in_virtual_time``; here the machine has other things to do."""
    alone, beside = (tracking(flights[arm], *stage.spans[name]) for name in (ALONE, BESIDE))
    request.node.user_properties += [("alone", str(alone)), ("beside", str(beside))]
    assert beside.missed <= alone.missed + 0.2
    assert beside.lead <= 1.5 * alone.lead
