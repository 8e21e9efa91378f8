"""What the robot manager refuses: each request is told why and what to do, and the robot is as it was."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.catalogue.actions import Action
from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState
from abb_runtime.faults import Fault
from refusals import refused
from system.virtual_time_bench import System
from yumi.driver.robot_state import RobotMode

MODULE = "MODULE Pick\nPROC pickOne()\nENDPROC\nENDMODULE\n"
WRITE_VARIABLE = ("write_variable", "T_ROB_L", "TRobSG", "target_position_input", "1")
LOAD_MODULE = ("load_module", Side.LEFT, "Pick.mod", MODULE)
RUN_ROUTINE = ("run_routine", Side.LEFT, "runMoveJ")
PANEL = {"read_signal", "read_variable", "write_variable"}
SET_MODE = ("go_to", RobotMode.EGM_LEFT, print)
RECOVER = ("recover", print)


def ready() -> System:
    system = System()
    system.bringup.make_ready()
    system.wait(0.2)
    return system


def in_egm() -> System:
    system = System()
    system.manager.start_egm()
    system.wait(0.2)
    return system


def after(fault: Fault) -> System:
    system = ready()
    system.faults.inject(fault)
    system.wait(0.5)
    return system


def in_manual() -> System:
    return after(Fault.MANUAL_MODE)


def in_emergency_stop() -> System:
    return after(Fault.EMERGENCY_STOP)


def motors_off() -> System:
    return after(Fault.MOTORS_OFF)


def in_guard_stop() -> System:
    system = after(Fault.MOTORS_OFF)
    system.world.controller.controller_state = ControllerState.GUARD_STOP
    return system


def stopped() -> System:
    return after(Fault.PROGRAM_STOP)


def gone() -> System:
    system = ready()
    system.http.is_there = False
    return system


@pytest.fixture(scope="module")
def robots() -> Callable[[Callable[[], System]], System]:
    """A robot in each state, for all requests, since none of them changes it."""
    return cache(lambda robot: robot())


def seen(system: System) -> tuple[object, ...]:
    """All that a request could have changed."""
    controller = system.world.controller
    return (
        (controller.mode, controller.controller_state, controller.is_running, controller.speed_ratio),
        {name: controller.signals.get(name) for name in controller.signals.names},
        {name: [module.name for module in task.modules] for name, task in controller.tasks.items()},
        [event.code for event in controller.events.entries()],
        [(arm.position, system.arms[side].snapshot.is_commanded) for side, arm in system.world.arms.items()],
    )


MANUAL = message("not_in_auto", mode="MANR")
PRESSED = message("emergency_stop_pressed")
GUARD = message("guard_stop_active")
BUSY = message("not_idle", machines=(message("machine", arm="left", machine="RUN_EGM_ROUTINE"),))
RUNS = message("program_runs")
STOPPED = message("program_stopped")

Expected = Callable[[str], Message]
"""By the name of the request."""

REFUSALS = {
    "start_rapid": "cannot_start_rapid",
    "pp_to_main": "cannot_move_pp",
    "set_speed_ratio": "cannot_write",
    "write_signal": "cannot_write",
    "write_variable": "cannot_write",
    "run_routine": "cannot_run_routine",
    "load_module": "cannot_load_module",
}


def cannot(reason: Message) -> Expected:
    """Each request in its own words, for the same reason."""

    def expected(request: str) -> Message:
        if request == "recover":
            return message("not_brought_back", error=message("cannot_bring_up", reason=reason))
        return Message(REFUSALS.get(request, "cannot_bring_up"), {"reason": reason})

    return expected


def says(code: str, **values: object) -> Expected:
    return lambda _: Message(code, values)


STOPPED_BY_PERSON = says("stopped_by_and_active", reason=PRESSED)
NOBODY = says("text", text="Nothing answers in this memory.")
VARIABLE = {"module": "TRobSG", "variable": "target_position_input", "task": "T_ROB_L"}


@pytest.mark.parametrize(
    ("robot", "requests", "expected", "actions"),
    [
        (
            in_manual,
            [("motors_on",), ("start_rapid",), ("pp_to_main",), ("set_speed_ratio", 50), ("make_ready",)],
            cannot(MANUAL),
            {Action.TURN_TO_AUTO},
        ),
        (
            in_manual,
            [RUN_ROUTINE, LOAD_MODULE, WRITE_VARIABLE, ("start_egm",), SET_MODE, RECOVER],
            cannot(MANUAL),
            {Action.TURN_TO_AUTO},
        ),
        (in_manual, [("write_signal", "RUN_SG_ROUTINE", "1")], cannot(MANUAL), {Action.TURN_TO_AUTO}),
        (
            in_emergency_stop,
            [("motors_on",), ("start_egm",), SET_MODE, RECOVER],
            STOPPED_BY_PERSON,
            {Action.RELEASE_STOP},
        ),
        (in_emergency_stop, [("start_rapid",), RUN_ROUTINE, ("make_ready",)], STOPPED_BY_PERSON, {Action.RELEASE_STOP}),
        (in_emergency_stop, [("start_egm",), RECOVER], STOPPED_BY_PERSON, {Action.CONFIRM_STOP}),
        (motors_off, [("start_rapid",)], cannot(message("motors_off")), {Action.MOTORS_ON}),
        (
            in_guard_stop,
            [("motors_on",), ("start_egm",), SET_MODE, RECOVER],
            says("stopped_by_and_active", reason=GUARD),
            {Action.CONFIRM_STOP},
        ),
        (in_egm, [("pp_to_main",)], cannot(RUNS), set()),
        (in_egm, [RUN_ROUTINE, LOAD_MODULE], cannot(BUSY), {Action.STOP_EGM}),
        (stopped, [RUN_ROUTINE, LOAD_MODULE], cannot(STOPPED), {Action.RECOVER}),
        (gone, [("motors_on",), ("motors_off",), ("start_rapid",), ("stop_rapid",), ("pp_to_main",)], NOBODY, set()),
        (gone, [("set_speed_ratio", 50), RUN_ROUTINE, LOAD_MODULE, WRITE_VARIABLE, ("start_egm",)], NOBODY, set()),
        (gone, [("stop_egm",), SET_MODE, ("write_signal", "RUN_SG_ROUTINE", "1"), ("read_signal", "x")], NOBODY, set()),
        (gone, [("read_variable", "T_ROB_L", "TRobSG", "x")], NOBODY, set()),
        (
            ready,
            [("set_speed_ratio", 101)],
            says("speed_ratio_out_of_range", percent=101, lowest=0, highest=100),
            set(),
        ),
        (ready, [("run_routine", Side.LEFT, "2nd")], says("no_routine_name", name="2nd"), set()),
        (ready, [("load_module", Side.LEFT, "Pick.txt", MODULE)], says("no_rapid_file_name", name="Pick.txt"), set()),
        (
            ready,
            [("write_signal", "nothing", "1"), ("read_signal", "nothing")],
            says("signal_unknown", signal="nothing"),
            set(),
        ),
        (ready, [("write_variable", "T_ROB_L", "TRobSG", "2nd", "1")], says("no_rapid_name", name="2nd"), set()),
        (
            ready,
            [("read_variable", "T_ROB_L", "TRobSG", "nothing")],
            says("variable_unknown", module="TRobSG", variable="nothing", task="T_ROB_L"),
            set(),
        ),
        (
            ready,
            [(*WRITE_VARIABLE[:-1], "TRUE"), (*WRITE_VARIABLE[:-1], "[1]")],
            says("variable_refused", kind="num", example="1.5", **VARIABLE),
            set(),
        ),
        (
            ready,
            [("write_signal", "RUN_SG_ROUTINE", "2")],
            says("signal_value_refused", signal="RUN_SG_ROUTINE", value="2"),
            set(),
        ),
        (
            ready,
            [("write_signal", "OUTPUT_STATIONARY_ROB_L", "0")],
            says("rws_refused", reason=message("rws_reject")),
            set(),
        ),
    ],
)
def test_request_that_is_refused_says_what_to_do_and_changes_nothing(
    robots: Callable[[Callable[[], System]], System],
    robot: Callable[[], System],
    requests: list[tuple[object, ...]],
    expected: Expected,
    actions: set[Action],
) -> None:
    system = robots(robot)
    before = seen(system)
    for name, *arguments in requests:
        request = getattr(system.manager.panel if name in PANEL else system.manager, str(name))
        said = expected(str(name))
        with refused(YumiError, said.code, **said.values) as refusal:
            request(*arguments)
        found = set(refusal.value.said.actions)
        assert actions <= found
        assert actions or not found
        system.wait(0.1)
        assert seen(system) == before
