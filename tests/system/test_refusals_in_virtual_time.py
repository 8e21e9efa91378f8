"""What the robot manager refuses: each request is told why and what to do, and the robot is as it was."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from system.virtual_time_bench import System
from yumi.driver.readiness import Mode
from yumi.errors import YumiError
from yumi.robot.joints import Side
from yumi.rws.types import ControllerState
from yumi.virtual.faults import Fault

MODULE = "MODULE Pick\nPROC pickOne()\nENDPROC\nENDMODULE\n"
WRITE_VARIABLE = ("write_variable", "T_ROB_L", "TRobSG", "target_position_input", "1")
LOAD_MODULE = ("load_module", Side.LEFT, "Pick.mod", MODULE)
RUN_ROUTINE = ("run_routine", Side.LEFT, "runMoveJ")
PANEL = {"read_signal", "read_variable", "write_variable"}
SET_MODE = ("go_to", Mode.EGM_LEFT, print)
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


TO_AUTO = "controller is in operating mode MANR, not in AUTO; set the controller to AUTO on the FlexPendant"
PRESSED = "the emergency stop is pressed; release it where it was pressed"
GUARD = "a guard stop keeps the motors off; close the guard, or end what else causes the guard stop"
BUSY = "a state machine is not idle (left arm: RUN_EGM_ROUTINE); end EGM"
STOPPED = "the RAPID program is stopped; call robot.recover()"
NOBODY = "Nothing answers in this memory"
START_RAPID = "The RAPID program cannot start: the motors are off; call robot.recover()"
PP_TO_MAIN = "The program pointers cannot be moved: the RAPID program runs; stop the program first"


@pytest.mark.parametrize(
    ("robot", "requests", "sentence"),
    [
        (
            in_manual,
            [("motors_on",), ("start_rapid",), ("pp_to_main",), ("set_speed_ratio", 50), ("make_ready",)],
            TO_AUTO,
        ),
        (in_manual, [RUN_ROUTINE, LOAD_MODULE, WRITE_VARIABLE, ("start_egm",), SET_MODE, RECOVER], TO_AUTO),
        (in_manual, [("write_signal", "RUN_SG_ROUTINE", "1")], TO_AUTO),
        (in_emergency_stop, [("motors_on",), ("start_egm",), SET_MODE, RECOVER], PRESSED),
        (in_emergency_stop, [("start_rapid",), RUN_ROUTINE, ("make_ready",)], PRESSED),
        (in_emergency_stop, [("start_egm",), RECOVER], "after that, look at the robot and call robot.recover("),
        (motors_off, [("start_rapid",)], START_RAPID),
        (in_guard_stop, [("motors_on",), ("start_egm",), SET_MODE, RECOVER], GUARD),
        (in_egm, [("pp_to_main",)], PP_TO_MAIN),
        (in_egm, [RUN_ROUTINE, LOAD_MODULE], BUSY),
        (stopped, [RUN_ROUTINE, LOAD_MODULE], STOPPED),
        (gone, [("motors_on",), ("motors_off",), ("start_rapid",), ("stop_rapid",), ("pp_to_main",)], NOBODY),
        (gone, [("set_speed_ratio", 50), RUN_ROUTINE, LOAD_MODULE, WRITE_VARIABLE, ("start_egm",)], NOBODY),
        (gone, [("stop_egm",), SET_MODE, ("write_signal", "RUN_SG_ROUTINE", "1"), ("read_signal", "x")], NOBODY),
        (gone, [("read_variable", "T_ROB_L", "TRobSG", "x")], NOBODY),
        (ready, [("set_speed_ratio", 101)], "A speed ratio of 101 % is not possible; give 0 to 100"),
        (ready, [("run_routine", Side.LEFT, "2nd")], "'2nd' is not a name of a RAPID routine; give a letter, then"),
        (ready, [("load_module", Side.LEFT, "Pick.txt", MODULE)], "'Pick.txt' is not a name of a RAPID file; give"),
        (ready, [("write_signal", "nothing", "1"), ("read_signal", "nothing")], "look at its list of I/O signals"),
        (ready, [("write_variable", "T_ROB_L", "TRobSG", "2nd", "1")], "'2nd' is not a RAPID name; give task, module"),
        (ready, [("read_variable", "T_ROB_L", "TRobSG", "nothing")], "no TRobSG/nothing in task T_ROB_L; check"),
        (
            ready,
            [(*WRITE_VARIABLE[:-1], "TRUE"), (*WRITE_VARIABLE[:-1], "[1]")],
            "it is a num, such as 1.5, or",
        ),
        (ready, [("write_signal", "RUN_SG_ROUTINE", "2")], "a digital signal is 0 or 1, another one has the range of"),
        (ready, [("write_signal", "OUTPUT_STATIONARY_ROB_L", "0")], 'a signal needs Access "All"'),
    ],
)
def test_request_that_is_refused_says_what_to_do_and_changes_nothing(
    robot: Callable[[], System], requests: list[tuple[object, ...]], sentence: str
) -> None:
    system = robot()
    before = seen(system)
    for name, *arguments in requests:
        request = getattr(system.manager.panel if name in PANEL else system.manager, str(name))
        with pytest.raises(YumiError) as refusal:
            request(*arguments)
        assert sentence in str(refusal.value)
        system.wait(0.1)
        assert seen(system) == before
