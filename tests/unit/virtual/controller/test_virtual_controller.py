"""The controller: what it refuses, what it logs, what faults do to it."""

from collections.abc import Callable

import pytest

from abb_protocols.egm.codec import RapidState
from abb_protocols.robot.joints import Side, home
from abb_protocols.rws.values import ControllerState, OperatingMode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.rapid.states import Execution
from virtual_irc5.world import World, WorldSettings

Request = Callable[[Irc5], None]

HOOKS = """MODULE TRobSystem
    VAR num x;
    PROC initializeSystemModule() ENDPROC
    FUNC bool attemptSystemRoutine(string name)
        x:=1/x;
    ENDFUNC
    FUNC bool attemptNonBlockingSystemRoutine(string name) RETURN FALSE; ENDFUNC
ENDMODULE"""


@pytest.fixture
def world() -> World:
    return World(WorldSettings(robot_name="Test"))


@pytest.fixture
def controller(world: World) -> Irc5:
    return world.controller


@pytest.fixture
def running(controller: Irc5) -> Irc5:
    controller.set_motors(True)
    controller.start_rapid()
    return controller


def codes(controller: Irc5) -> list[int]:
    return [event.code for event in controller.events.entries()]


def test_controller_begins_in_auto_with_its_program_loaded(controller: Irc5) -> None:
    assert controller.mode is OperatingMode.AUTO
    assert controller.cycle == "forever"
    assert controller.identity.system_name == "Test"
    names = [module.name for module in controller.tasks["T_ROB_L"].modules]
    ours = ["TRobUtility", "TRobSystem", "TRobMain", "TRobRAPID", "TRobEGM", "TRobSG", "TRobWatchdog"]
    assert names == ["user", *ours]


def test_motors_on_switches_both_arms(world: World) -> None:
    world.controller.set_motors(True)
    assert world.controller.controller_state is ControllerState.MOTORS_ON
    assert all(arm.motors_on for arm in world.arms.values())
    assert codes(world.controller) == [10011]


def test_motors_on_twice_is_one_event(controller: Irc5) -> None:
    controller.set_motors(True)
    controller.set_motors(True)
    assert codes(controller) == [10011]


def test_motors_off_stop_rapid_and_say_so(running: Irc5) -> None:
    running.set_motors(False)
    assert running.controller_state is ControllerState.MOTORS_OFF
    assert codes(running) == [10010, 10125, 10150, 10011]


def test_motors_off_when_off_does_nothing(controller: Irc5) -> None:
    controller.set_motors(False)
    assert codes(controller) == []


@pytest.mark.parametrize(
    ("request_", "reason", "sentence"),
    [
        (Irc5.start_rapid, RefusalReason.MOTORS_OFF, "RAPID starts with motors on only"),
        (lambda c: c.set_speed_ratio(101), RefusalReason.OUT_OF_RANGE, "0 to 100 %, not 101 %"),
        (lambda c: c.set_speed_ratio(-1), RefusalReason.OUT_OF_RANGE, "0 to 100 %, not -1 %"),
        (lambda c: c.joint_target("ROB_X"), RefusalReason.UNKNOWN, "no mechanical unit ROB_X"),
        (lambda c: c.signals.get("X"), RefusalReason.UNKNOWN, "no signal X"),
        (lambda c: c.signals.set("OUTPUT_STATIONARY_ROB_L", 0), RefusalReason.READ_ONLY, "access level ReadOnly"),
    ],
)
def test_controller_refuses(controller: Irc5, request_: Request, reason: RefusalReason, sentence: str) -> None:
    with pytest.raises(Refused, match=sentence) as refused:
        request_(controller)
    assert refused.value.reason is reason
    assert codes(controller) == []


@pytest.mark.parametrize(
    ("request_", "reason", "sentence"),
    [
        (Irc5.start_rapid, RefusalReason.ALREADY_RUNNING, "RAPID is running already"),
        (Irc5.move_pp_to_main, RefusalReason.NOT_STOPPED, "stop it first"),
    ],
)
def test_running_controller_refuses(running: Irc5, request_: Request, reason: RefusalReason, sentence: str) -> None:
    with pytest.raises(Refused, match=sentence) as refused:
        request_(running)
    assert refused.value.reason is reason
    assert running.is_running


@pytest.mark.parametrize(
    "request_",
    [
        Irc5.start_rapid,
        Irc5.move_pp_to_main,
        lambda controller: controller.set_motors(True),
        lambda controller: controller.set_speed_ratio(50),
    ],
)
def test_manual_mode_leaves_control_to_the_person_at_the_cabinet(controller: Irc5, request_: Request) -> None:
    controller.select_mode(OperatingMode.MANUAL_REDUCED)
    with pytest.raises(Refused, match="the controller is in MANR") as refused:
        request_(controller)
    assert refused.value.reason is RefusalReason.WRONG_MODE


def test_speed_ratio_is_kept(controller: Irc5) -> None:
    controller.set_speed_ratio(40)
    assert controller.speed_ratio == 40


@pytest.mark.parametrize("unit", ["ROB_L", "ROB_L_7", "rob_l"])
def test_joint_target_is_in_degrees_with_axis_7_apart(controller: Irc5, unit: str) -> None:
    robax, extax = controller.joint_target(unit)
    assert robax == pytest.approx((0, -130, 30, 0, 40, 0))
    assert extax == pytest.approx((135, *(9e9,) * 5))


def test_mechanical_units_tell_which_is_part_of_which(controller: Irc5) -> None:
    facts = [(u.name, u.task, u.total_axes, u.containing_unit, u.integrated_unit) for u in controller.units]
    assert facts == [
        ("ROB_R", "T_ROB_R", 7, "", "ROB_R_7"),
        ("ROB_L", "T_ROB_L", 7, "", "ROB_L_7"),
        ("ROB_R_7", "T_ROB_R", 1, "ROB_R", ""),
        ("ROB_L_7", "T_ROB_L", 1, "ROB_L", ""),
    ]


def test_configuration_is_stock_and_ours_together(controller: Irc5) -> None:
    instances = controller.configuration.instances
    assert [one.name for one in instances("sys", "mechanical_unit_group")] == ["rob_r", "rob_l"]
    assert [one.name for one in instances("MOC", "EXT_MOTION_DATA")][:3] == ["default", "ROB_R", "ROB_R_RAW"]
    assert instances("MOC", "NOTHING") == ()


def test_options_are_those_clients_look_for(controller: Irc5) -> None:
    wanted = {
        "StateMachine Core",
        "SmartGripper",
        "689-1 Externally Guided Motion (EGM)",
        "604-1 MultiMove Coordinated",
        "IRB 14000-0.5/0.5",
    }
    assert wanted <= set(controller.identity.options)


def test_emergency_stop_stops_everything(running: Irc5) -> None:
    running.press_emergency_stop()
    assert running.controller_state is ControllerState.EMERGENCY_STOP
    assert not running.is_running
    assert codes(running)[0] == 10013


def test_motors_stay_off_until_the_emergency_stop_is_released(running: Irc5) -> None:
    running.press_emergency_stop()
    with pytest.raises(Refused, match="in state emergencystop: release the stop first") as refused:
        running.set_motors(True)
    assert refused.value.reason is RefusalReason.EMERGENCY_STOP
    running.release_emergency_stop()
    assert running.controller_state is ControllerState.EMERGENCY_STOP_RESET
    running.set_motors(True)
    assert running.controller_state is ControllerState.MOTORS_ON


def test_turning_the_key_does_not_release_an_emergency_stop(running: Irc5) -> None:
    running.press_emergency_stop()
    running.select_mode(OperatingMode.MANUAL_REDUCED)
    assert running.controller_state is ControllerState.EMERGENCY_STOP


def test_turning_the_key_switches_the_motors_off(running: Irc5) -> None:
    running.select_mode(OperatingMode.MANUAL_REDUCED)
    assert running.mode is OperatingMode.MANUAL_REDUCED
    assert not running.is_running
    assert codes(running)[0] == 10015


@pytest.mark.parametrize("stop", [lambda controller: controller.set_motors(False), Irc5.stop_rapid])
def test_rapid_stops_on_request(running: Irc5, stop: Callable[[Irc5], None]) -> None:
    stop(running)
    assert not running.is_running
    assert 10125 in codes(running)


def run_by_name(world: World, text: str, name: str) -> None:
    """Load a module into the left task and call its procedure ``<name>0``."""
    task = world.controller.tasks["T_ROB_L"]
    for _ in range(5):
        world.cycle({})
    task.load(text, f"{name}.mod")
    task.write("TRobRAPID", "callbyvar_name_input", f'"{name}"')
    task.write("TRobRAPID", "routine_name_input", '"runCallByVar"')
    world.controller.signals.set("RUN_RAPID_ROUTINE", 1)
    for _ in range(10):
        world.cycle({})


def stopping(instruction: str) -> str:
    return f"MODULE halt\nPROC halt0()\n{instruction};\nENDPROC\nENDMODULE"


def test_stop_stops_its_own_task_only(world: World, running: Irc5) -> None:
    run_by_name(world, stopping("Stop"), "halt")
    assert running.is_running
    states = {name: task.execution for name, task in running.tasks.items()}
    assert states == {"T_ROB_R": Execution.STARTED, "T_ROB_L": Execution.STOPPED}
    assert (codes(running)[0], "T_ROB_L was stopped by" in running.events.entries()[0].description) == (10125, True)


def test_datagrams_of_an_arm_show_whether_its_own_task_runs(world: World, running: Irc5) -> None:
    def shown() -> dict[Side, RapidState]:
        return {side: egm.rapid for side, egm in world.egm.items()}

    run_by_name(world, stopping("Stop"), "halt")
    assert shown() == {Side.RIGHT: RapidState.RUNNING, Side.LEFT: RapidState.STOPPED}
    running.start_rapid()
    assert set(shown().values()) == {RapidState.RUNNING}
    running.stop_rapid()
    assert set(shown().values()) == {RapidState.STOPPED}


def test_event_of_a_stop_says_where_the_program_stands(world: World, running: Irc5) -> None:
    run_by_name(world, stopping("Stop"), "halt")
    description = running.events.entries()[0].description
    assert description == "T_ROB_L has stopped: T_ROB_L was stopped by the program in halt/halt0, line 3."


def test_task_that_stopped_alone_is_started_again_beside_the_other(world: World, running: Irc5) -> None:
    run_by_name(world, stopping("Stop"), "halt")
    running.start_rapid()
    assert {task.execution for task in running.tasks.values()} == {Execution.STARTED}


@pytest.mark.parametrize(
    "instruction", ["Stop\\AllMoveTasks", "SystemStopAction\\Stop", "SystemStopAction\\StopBlock", "EXIT"]
)
def test_program_that_stops_the_system_stops_both_tasks(world: World, running: Irc5, instruction: str) -> None:
    run_by_name(world, stopping(instruction), "halt")
    assert not running.is_running
    assert Execution.STARTED not in {task.execution for task in running.tasks.values()}
    assert "T_ROB_L was " in running.events.entries()[0].description


def test_system_stop_goes_on_behind_the_instruction(world: World, running: Irc5) -> None:
    run_by_name(world, stopping("SystemStopAction\\Stop"), "halt")
    running.start_rapid()
    for _ in range(10):
        world.cycle({})
    assert running.is_running


def test_blocking_system_stop_takes_the_program_pointers_away(world: World, running: Irc5) -> None:
    run_by_name(world, stopping("SystemStopAction\\StopBlock"), "halt")
    with pytest.raises(Refused, match="T_ROB_R has no program pointer: move it to main first"):
        running.start_rapid()


def test_halting_system_stop_switches_the_motors_off(world: World, running: Irc5) -> None:
    run_by_name(world, stopping("SystemStopAction\\Halt"), "halt")
    assert not running.is_running
    assert running.controller_state is ControllerState.MOTORS_OFF


def test_error_that_is_handled_stops_nothing(world: World, running: Irc5) -> None:
    run_by_name(world, "MODULE broken\nVAR num x;\nPROC broken0()\nx:=1/x;\nENDPROC\nENDMODULE", "broken")
    assert "[RAPID]: 'runCallByVar' failed!" in running.screens["T_ROB_L"]
    assert running.is_running


def test_error_nobody_handles_stops_both_tasks_and_is_logged(world: World, running: Irc5) -> None:
    running.tasks["T_ROB_L"].unload("TRobSystem")
    running.tasks["T_ROB_L"].load(HOOKS, "TRobSystem.sys")
    run_by_name(world, "MODULE empty\nENDMODULE", "empty")
    assert not running.is_running
    assert [event.code for event in running.events.entries()[:2]] == [10125, 40228]
    assert "T_ROB_L/TRobSystem/attemptSystemRoutine, line 5" in running.events.entries()[1].description


def test_module_that_does_not_fit_is_found_when_the_pointer_moves(controller: Irc5) -> None:
    controller.tasks["T_ROB_L"].load("MODULE bad\nPROC bad()\nWaitTime TRUE;\nENDPROC\nENDMODULE", "bad.mod")
    with pytest.raises(Refused, match="T_ROB_L has no program to run: bad, line 3") as refused:
        controller.move_pp_to_main()
    assert refused.value.reason is RefusalReason.NO_PROGRAM_POINTER


@pytest.mark.parametrize("path", ["HOME:", "HOME:/yumi"])
def test_directory_is_no_module(controller: Irc5, path: str) -> None:
    with pytest.raises(Refused, match=f"{path} is a directory") as refused:
        controller.load_module("T_ROB_L", path, replace=False)
    assert refused.value.reason is RefusalReason.NO_FILE


def test_world_moves_nothing_while_the_motors_are_off(world: World) -> None:
    for _ in range(100):
        assert world.cycle({}) == {}
    assert {side: arm.position for side, arm in world.arms.items()} == {side: home(side) for side in Side}
