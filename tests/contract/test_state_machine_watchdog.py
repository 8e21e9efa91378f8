"""The watchdog stops arms that EGM guides: with the instruction it uses, and not with the one it used before."""

from __future__ import annotations

import pytest
from state_machine_bench import ARMS, Bench

from abb_protocols.robot.joints import CYCLE, Joints, Side, home
from abb_protocols.rws.values import ControllerState

WATCHDOG = "HOME:/yumi/TRobWatchdog.mod"
RAMP = 0.2
"""ramp_time of MOC.cfg [s]."""


def far(side: Side) -> Joints:
    """Home with the last joint turned by two radians."""
    *others, last = home(side)
    a, b, c, d, e, f = others
    return (a, b, c, d, e, f, last + (2.0 if last < 0.0 else -2.0))


def moving(bench: Bench) -> Bench:
    """Both arms on a long way under EGM, the watchdogs active."""
    bench.bring_up()
    bench.set_egm("activate.max_speed_deviation", "20")
    for side in ARMS:
        bench.sensors[side].goal = far(side)
        bench.write(side, "TRobWatchdog", "active", "TRUE")
    bench.pulse("EGM_START_JOINT")
    bench.run(2.0)
    assert all(speed(bench, side) > 0.1 for side in ARMS)
    return bench


def speed(bench: Bench, side: Side) -> float:
    """Of the fastest joint [rad/s]."""
    return max(abs(value) for value in bench.world.arms[side].velocity)


def with_stop_instruction() -> Bench:
    """The controller with the watchdog as it was, which ends the program with Stop."""
    bench = Bench()
    old = bench.controller.files[WATCHDOG].replace("SystemStopAction\\Stop;", "Stop;")
    assert old != bench.controller.files[WATCHDOG]
    bench.controller.files[WATCHDOG] = old
    for side in ARMS:
        bench.controller.load_module(side.task, WATCHDOG, replace=True)
    return bench


def test_watchdog_stops_both_arms_that_egm_guides_within_its_ramp() -> None:
    bench = moving(Bench())
    bench.pulse("WD_STOP_REQUEST")
    bench.run(RAMP + 2 * CYCLE)
    assert all(arm.is_stationary or speed(bench, side) < 1e-3 for side, arm in bench.world.arms.items())
    assert not bench.controller.is_running
    assert bench.controller.controller_state is ControllerState.MOTORS_ON


def test_stop_instruction_would_let_egm_go_on() -> None:
    """Stop waits for the end of a movement, and EGMRunJoint has none: the arms would go on for ever."""
    bench = moving(with_stop_instruction())
    bench.pulse("WD_STOP_REQUEST")
    bench.run(2.0)
    assert all(speed(bench, side) > 0.1 for side in ARMS)
    assert bench.controller.is_running


def test_silent_client_is_stopped_while_egm_guides() -> None:
    bench = moving(Bench())
    for side in ARMS:
        bench.write(side, "TRobWatchdog", "external_timeout", "0.5")
        bench.write(side, "TRobWatchdog", "check_external_status", "TRUE")
    bench.run(0.5 + 0.2 + RAMP + 2 * CYCLE)
    assert not bench.controller.is_running
    assert all(speed(bench, side) < 1e-3 for side in ARMS)


def test_stopped_program_guides_the_arms_again_when_it_is_started() -> None:
    bench = moving(Bench())
    bench.pulse("WD_STOP_REQUEST")
    bench.run(1.0)
    bench.controller.start_rapid()
    bench.run(1.0)
    assert all(bench.world.egm[side].is_running for side in ARMS)


def test_stop_waits_for_the_movement_under_way() -> None:
    """RAPID reference manual, Stop: any movement is finished before the instruction is ready."""
    bench, side = Bench(), Side.RIGHT
    bench.bring_up()
    bench.write(side, "TRobRAPID", "move_jointtarget_input", "[[20,-120,30,0,40,0],[-130,9E9,9E9,9E9,9E9,9E9]]")
    bench.write(side, "TRobRAPID", "move_speed_input", "[50,50,50,50]")
    bench.write(side, "TRobRAPID", "routine_name_input", '"runMoveAbsJ"')
    program = "MODULE halting TRAP stopping Stop; ENDTRAP PROC arm() VAR intnum n; CONNECT n WITH stopping; "
    task = bench.controller.tasks[side.task]
    task.load(f"{program}ITimer\\Single,0.3,n; ENDPROC ENDMODULE", "halting.mod")
    task.load(HOOKS, "TRobSystem.sys", replace=True)
    bench.pulse("RUN_RAPID_ROUTINE")
    bench.run(0.6)
    assert task.is_running
    assert speed(bench, side) > 0.0
    bench.run_until(lambda: not task.is_running, limit=20.0)
    assert bench.world.arms[side].is_stationary
    assert bench.world.arms[side].planned[0] == pytest.approx(0.349, abs=1e-3)


HOOKS = """MODULE TRobSystem(SYSMODULE)
    PROC initializeSystemModule() ENDPROC
    FUNC bool attemptSystemRoutine(string name) arm; RETURN FALSE; ENDFUNC
    FUNC bool attemptNonBlockingSystemRoutine(string name) RETURN FALSE; ENDFUNC
ENDMODULE"""
