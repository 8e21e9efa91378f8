"""Motions by RAPID: checked along their path before they start, named where that cannot be, and slow the first time."""

from __future__ import annotations

from contextlib import suppress
from math import degrees, radians

import pytest

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import Joints, Side, abb_from_chain, home
from abb_protocols.rws import rapid_values
from abb_protocols.rws.values import ExecutionState
from refusals import refused
from system.virtual_time_bench import System
from yumi.control.collisions import COLLISION_MARGIN
from yumi.core.collision import CollisionModel
from yumi.driver import rapid_routines
from yumi.driver.rapid_motion_check import FIRST_RATIO, RapidMotionCheck
from yumi.driver.robot_manager import RobotManager
from yumi.driver.state_machine import MachineState

RIGHT, LEFT = Side.RIGHT, Side.LEFT
ACROSS = (-1.6, *home(RIGHT)[1:])  # the right arm turned to where the left one is
WAVE = "MODULE Wave\nPROC wave()\nWaitTime 0.1;\nENDPROC\nPROC lingers()\nWaitTime 30;\nENDPROC\nENDMODULE\n"


def check_of(system: System, *, is_real: bool) -> RapidMotionCheck:
    return RapidMotionCheck(
        system.client,
        system.bringup.panel,
        system.bringup.machines,
        CollisionModel(SERVO_GRIPPERS),
        COLLISION_MARGIN,
        is_real=lambda: is_real,
    )


def checked(system: System, *, is_real: bool) -> RobotManager:
    """The system's robot manager, with the check of motions by RAPID, of a robot that is ready."""
    check = check_of(system, is_real=is_real)
    manager = RobotManager(system.bringup, system.control, system, is_real=lambda: is_real, rapid_check=check)
    manager.make_ready()
    return manager


def aim(system: System, goal: Joints) -> None:
    """Have ``runMoveAbsJ`` of the right arm go to a position [rad]."""
    robax, seventh = abb_from_chain(tuple(map(degrees, goal)))
    unused = [9e9] * 5
    target = rapid_values.encode((robax, (seventh, *unused)))
    system.client.set_symbol(RIGHT.task, "TRobRAPID", "move_jointtarget_input", target)
    system.client.set_symbol(RIGHT.task, "TRobRAPID", "move_speed_input", "[500,50,500,50]")


def where(system: System) -> Joints:
    return system.client.joint_target(RIGHT.unit)


@pytest.fixture
def system() -> System:
    return System()


@pytest.fixture
def manager(system: System) -> RobotManager:
    return checked(system, is_real=True)


def test_motion_whose_path_is_clear_is_carried_out(system: System, manager: RobotManager) -> None:
    goal = (*where(system)[:6], where(system)[6] + 0.3)
    aim(system, goal)
    manager.run_routine(RIGHT, "runMoveAbsJ")
    assert where(system) == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize("is_real", [True, False])
def test_motion_into_the_other_arm_does_not_start(system: System, is_real: bool) -> None:
    manager, still = checked(system, is_real=is_real), where(system)
    aim(system, ACROSS)
    with refused(CommandRefused, "rapid_path_too_near"):
        manager.run_routine(RIGHT, "runMoveAbsJ")
    system.wait(1.0)
    assert where(system) == pytest.approx(still, abs=1e-4)
    with refused(CommandRefused, "rapid_path_too_near"):  # RAPID looks procedures up whatever the case
        manager.run_routine(RIGHT, "runmoveabsj")


def test_motion_beside_an_arm_that_egm_moves_does_not_start(system: System, manager: RobotManager) -> None:
    manager.start_egm((LEFT,))
    aim(system, where(system))
    with refused(RobotNotReady, "rapid_beside_moving_arm", arm="left"):
        manager.run_routine(RIGHT, "runMoveAbsJ")


def test_calibration_position_is_checked_as_the_controller_has_it(system: System, manager: RobotManager) -> None:
    values = [item for angle in abb_order(ACROSS) for item in (True, angle)]
    system.client.set_symbol(RIGHT.task, "TRobUtility", "calibration_values", rapid_values.encode(tuple(values)))
    with refused(CommandRefused, "rapid_path_too_near"):
        manager.run_routine(RIGHT, "runMoveToCalibrationPosition")


def abb_order(position: Joints) -> list[float]:
    robax, seventh = abb_from_chain(position)
    return [*robax, seventh]


def test_routine_of_unknown_path_runs_on_a_real_robot_only_where_that_is_named(
    system: System, manager: RobotManager
) -> None:
    manager.load_module(RIGHT, "wave.mod", WAVE)
    for name in ("wave", "runMoveJ", "runCallByVar"):
        with refused(CommandRefused, "rapid_path_unknown", routine=name):
            manager.run_routine(RIGHT, name)
    assert manager.run_routine(RIGHT, "wave", is_unchecked=True)


def test_routine_of_unknown_path_runs_on_a_virtual_robot(system: System) -> None:
    manager = checked(system, is_real=False)
    assert manager.run_module(RIGHT, "wave.mod", WAVE, "wave")
    assert system.client.speed_ratio() == 100


def test_first_run_on_a_real_robot_has_a_tenth_of_the_speed(system: System, manager: RobotManager) -> None:
    here = where(system)
    durations = []
    for turn in (0.3, 0.0):
        aim(system, (*here[:6], here[6] + turn))
        begin = system.now()
        manager.run_routine(RIGHT, "runMoveAbsJ")
        durations.append(system.now() - begin)
        assert system.client.speed_ratio() == 100
    assert durations[0] > 3.0 * durations[1]


def test_speed_ratio_is_restored_where_the_first_run_fails(system: System, manager: RobotManager) -> None:
    with pytest.raises(CommandRefused):
        manager.run_routine(RIGHT, "there_is_none", is_unchecked=True)
    assert system.client.speed_ratio() == 100
    manager.set_speed_ratio(FIRST_RATIO // 2)
    manager.load_module(RIGHT, "wave.mod", WAVE)
    manager.run_routine(RIGHT, "wave", is_unchecked=True)
    assert system.client.speed_ratio() == FIRST_RATIO // 2


def test_program_of_a_real_robot_is_started_from_main_and_not_in_the_middle_of_a_routine(
    system: System, manager: RobotManager
) -> None:
    manager.stop_rapid()
    manager.start_rapid()  # it stood in its idle loop
    manager.load_module(RIGHT, "wave.mod", WAVE)
    system.client.set_symbol(RIGHT.task, "TRobRAPID", "routine_name_input", '"lingers"')
    system.client.pulse_signal("RUN_RAPID_ROUTINE")
    system.wait(0.5)
    assert system.bringup.machines.state(RIGHT) is MachineState.RUN_RAPID_ROUTINE
    system.client.stop_rapid()
    system.wait(0.5)
    with refused(RobotNotReady, "rapid_start_in_routine", task=RIGHT.task):
        manager.start_rapid()
    assert system.client.execution() is ExecutionState.STOPPED
    manager.pp_to_main()
    manager.start_rapid()
    assert system.client.execution() is ExecutionState.RUNNING


def test_signal_that_runs_a_routine_is_not_written_past_the_check(system: System, manager: RobotManager) -> None:
    for name in ("RUN_RAPID_ROUTINE", "run_rapid_routine", "EtherNetIP/device/RUN_RAPID_ROUTINE"):
        with refused(CommandRefused, "rapid_signal_not_written"):
            manager.write_signal(name, 1)
    assert system.bringup.machines.state(RIGHT) is MachineState.IDLE


@pytest.mark.parametrize(("module", "name"), [("TRobMain", "current_state"), ("trobrapid", "ROUTINE_NAME_INPUT")])
def test_variable_that_starts_a_routine_is_not_written_past_the_check(
    system: System, manager: RobotManager, module: str, name: str
) -> None:
    with refused(CommandRefused, "rapid_variable_not_written", module=module, variable=name):
        manager.write_variable(RIGHT.task, module, name, "2")
    manager.write_variable(RIGHT.task, "TRobRAPID", "move_speed_input", "[100,50,500,50]")
    assert system.bringup.machines.state(RIGHT) is MachineState.IDLE


def test_routine_does_not_start_where_a_stop_was_requested_while_it_was_checked(
    system: System, manager: RobotManager, monkeypatch: pytest.MonkeyPatch
) -> None:
    manager.load_module(RIGHT, "wave.mod", WAVE)
    check = manager._rapid_check
    assert check is not None
    monkeypatch.setattr(check, "check_routine", lambda *_, **__: setattr(manager, "_stop_requests", 1))
    with refused(RobotNotReady, "stop_requested_meanwhile"):
        manager.run_routine(RIGHT, "wave", is_unchecked=True)
    system.wait(0.5)
    assert system.bringup.machines.state(RIGHT) is MachineState.IDLE
    assert system.client.symbol(RIGHT.task, "TRobRAPID", "routine_name_input") == '""'
    assert system.client.speed_ratio() == 100


def test_speed_ratio_stays_low_where_the_first_run_may_go_on(
    system: System, manager: RobotManager, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rapid_routines, "LONGEST_ROUTINE", 1.0)
    manager.load_module(RIGHT, "wave.mod", WAVE)
    with refused(RobotNotReady, "first_run_stays_slow", ratio=FIRST_RATIO):
        manager.run_routine(RIGHT, "lingers", is_unchecked=True)
    assert system.client.speed_ratio() == FIRST_RATIO


def test_run_counts_as_the_first_where_another_motion_may_have_the_name(system: System) -> None:
    check = check_of(system, is_real=True)
    system.bringup.make_ready()

    def ratio(routine: str) -> int:
        with check.slow_first(RIGHT, routine, lambda: True):
            return system.client.speed_ratio()

    assert [ratio("wave"), ratio("wave")] == [FIRST_RATIO, 100]
    assert [ratio("runMoveJ"), ratio("runMoveJ")] == [FIRST_RATIO, FIRST_RATIO]
    with suppress(RobotNotReady), check.slow_first(RIGHT, "runModuleLoad", lambda: True):
        raise RobotNotReady("the module was loaded, and no answer came")
    assert ratio("wave") == FIRST_RATIO


def test_run_counts_as_the_first_again_once_another_controller_may_answer(system: System) -> None:
    is_real = [False]
    check = RapidMotionCheck(
        system.client, system.bringup.panel, system.bringup.machines, None, COLLISION_MARGIN, is_real=lambda: is_real[0]
    )
    system.bringup.make_ready()

    def ratio() -> int:
        with check.slow_first(RIGHT, "wave", lambda: True):
            return system.client.speed_ratio()

    assert ratio() == 100  # of a virtual robot
    is_real[0] = True
    system.adapter.expire_sessions()
    assert [ratio(), ratio()] == [FIRST_RATIO, 100]


@pytest.mark.parametrize("angle", [radians(400.0), 1e6])
def test_goal_that_no_joint_reaches_is_refused_at_once(system: System, manager: RobotManager, angle: float) -> None:
    aim(system, (*where(system)[:6], angle))
    with refused(CommandRefused, "rapid_goal_out_of_range", routine="runMoveAbsJ"):
        manager.run_routine(RIGHT, "runMoveAbsJ")
