"""Instructions that act with the whole controller: speed limits of a system input, what is stored at a stop, modes."""

from __future__ import annotations

from collections.abc import Callable
from math import dist
from pathlib import Path

import pytest

from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import OperatingMode
from virtual_irc5.controller.installed_system import delivered_system, with_programs
from virtual_irc5.rapid.states import Execution
from virtual_irc5.world import World, WorldSettings

IDLE = "MODULE Idle\nPROC main()\nWaitTime 1000;\nENDPROC\nENDMODULE\n"
LIMIT_SPEED = (
    'EIO:CFG_1.0:6:1::\n#\nEIO_SIGNAL:\n -Name "limit" -SignalType "DI" -Access "All"\n'
    '#\nSYSSIG_IN:\n -Signal "limit" -Action "LimitSpeed"\n'
)
PROCESS_SIGNAL = 'EIO:CFG_1.0:6:1::\n#\nEIO_SIGNAL:\n -Name "process" -SignalType "DO" -Access "All"\n'
Start = Callable[..., World]


@pytest.fixture
def start(tmp_path: Path) -> Start:
    def begin(body: str, declarations: str = "", cfg: str = "") -> World:
        right, left, parameters = tmp_path / "right.mod", tmp_path / "left.mod", tmp_path / "EIO.cfg"
        right.write_text(f"MODULE Program\n{declarations}\nPROC main()\n{body}\nENDPROC\nENDMODULE\n")
        left.write_text(IDLE)
        parameters.write_text(cfg)
        system = with_programs(delivered_system(), {"T_ROB_R": [right], "T_ROB_L": [left]}, [parameters] if cfg else [])
        world = World(WorldSettings(system=system))
        world.controller.execution.move_pp_to_main()
        world.controller.set_motors(True)
        world.controller.start_rapid("once")
        return world

    return begin


def run(world: World, seconds: float) -> float:
    """Let time pass; the highest speed of the right tool0 in it [m/s]."""
    arm, most = world.arms[Side.RIGHT], 0.0
    before = arm.tool_pose(arm.planned, None).position
    for _ in range(round(seconds / world.cycle_time)):
        world.cycle({})
        now = arm.tool_pose(arm.planned, None).position
        most, before = max(most, dist(now, before) / world.cycle_time), now
    return most


BACK_AND_FORTH = "a:=CJointT(); b:=a; b.robax.rax_1:=a.robax.rax_1+15; WHILE TRUE DO MoveAbsJ b,v300,fine,tool0; MoveAbsJ a,v300,fine,tool0; ENDWHILE"  # noqa: E501
TARGETS = "VAR jointtarget a; VAR jointtarget b;"


@pytest.mark.parametrize(
    ("instruction", "is_slower"),
    [
        ("SpeedLimCheckPoint 50;", True),
        ("SpeedLimAxis ROB_R,1,8;", True),
        ("SpeedLimAxis ROB_R,4,8;", False),
        ("", False),
    ],
)
def test_speed_limit_counts_while_the_system_input_is_set(start: Start, instruction: str, is_slower: bool) -> None:
    world = start(f"{instruction} {BACK_AND_FORTH}", TARGETS, LIMIT_SPEED)
    assert run(world, 2.0) > 0.15, "the input is not set"
    world.controller.signals.set("limit", 1)
    run(world, 0.5)  # it slows down
    limited = run(world, 3.0)
    if instruction.startswith("SpeedLimCheckPoint"):
        assert limited == pytest.approx(0.05, rel=0.03)
    assert (limited < 0.12) is is_slower
    world.controller.signals.set("limit", 0)
    assert run(world, 2.0) > 0.15


@pytest.mark.parametrize("instruction", ["SpeedLimCheckPoint 0", "SpeedLimCheckPoint -5", "SpeedLimAxis ROB_R,1,0"])
def test_speed_limit_of_nothing_is_an_error(start: Start, instruction: str) -> None:
    world = start(f'{instruction}; ERROR IF ERRNO=ERR_SPEEDLIM_VALUE TPWrite "too low"; TRYNEXT;')
    run(world, 0.1)
    assert list(world.controller.screens["T_ROB_R"]) == ["too low"]


RESTART = "TASK PERS restartdata restart:=[FALSE,FALSE,0,0,0,0,0,0,0,0,0,0,0,0,0];" + TARGETS
PROCESS = "a:=CJointT(); b:=a; b.robax.rax_1:=a.robax.rax_1+15; TriggStopProc restart\\DO1:=custom_DO_0,custom_DO_1; "


@pytest.mark.parametrize("moves", [True, False])
def test_stop_stores_process_signals_and_sets_them_to_zero(start: Start, moves: bool) -> None:
    move = "MoveAbsJ b,v20,fine,tool0;" if moves else "WaitTime 10;"
    world = start(PROCESS + "SetDO custom_DO_0,1; SetDO custom_DO_1,1; " + move, RESTART)
    controller = world.controller
    run(world, 0.5)
    task = controller.tasks["T_ROB_R"]
    assert task.read("Program", "restart").startswith("[FALSE,FALSE,0")
    controller.stop_rapid()
    run(world, 0.2)
    assert controller.signals.get("custom_DO_0").value == 1, "not before the process has come to its end"
    run(world, 0.5)
    on_path = "TRUE" if moves else "FALSE"
    assert task.read("Program", "restart") == f"[TRUE,{on_path},1,1,-1,-1,-1,-1,-1,-1,-1,-1,1,0,1]"
    assert (controller.signals.get("custom_DO_0").value, controller.signals.get("custom_DO_1").value) == (0, 0)


def test_process_signal_that_a_restart_takes_away_stops_rapid_once_and_no_cycle(start: Start) -> None:
    world = start(PROCESS.replace("custom_DO_1", "process") + "WaitTime 10;", RESTART, PROCESS_SIGNAL)
    run(world, 0.1)
    controller = world.controller
    controller.configuration.remove("EIO", "EIO_SIGNAL", "process")
    controller.restart(1.0)
    run(world, 1.5)
    assert "process" not in controller.signals
    faults = [each.description for each in controller.events.entries() if "process signals" in each.description]
    assert faults == [
        "The process signals at stops of T_ROB_R are no longer followed: There is no I/O signal 'process'."
    ]
    controller.execution.move_pp_to_main()
    controller.set_motors(True)
    controller.start_rapid("once")
    assert controller.is_running


@pytest.mark.parametrize(
    ("mode", "number"),
    [(OperatingMode.AUTO, 1), (OperatingMode.MANUAL_REDUCED, 2), (OperatingMode.MANUAL_FULL, 3)],
)
def test_task_knows_the_mode_of_the_controller(start: Start, mode: OperatingMode, number: int) -> None:
    controller = start("WaitTime 1;").controller
    controller.select_mode(mode)
    assert controller.tasks["T_ROB_R"].operating_mode() == number


def test_program_pointer_moved_in_manual_mode_is_remembered_until_it_is_reset(start: Start) -> None:
    report = "TPWrite ValToStr(PPMovedInManMode()); ResetPPMoved; TPWrite ValToStr(PPMovedInManMode());"
    world = start(report)
    controller = world.controller
    run(world, 0.1)
    assert controller.tasks["T_ROB_R"].execution is not Execution.STARTED
    controller.select_mode(OperatingMode.MANUAL_REDUCED)
    controller.execution.move_pp_to_main()
    controller.select_mode(OperatingMode.AUTO)
    controller.set_motors(True)
    controller.start_rapid("once")
    run(world, 0.1)
    assert list(controller.screens["T_ROB_R"]) == ["FALSE", "FALSE", "TRUE", "FALSE"]


CORRECTED = "VAR corrdescr one; VAR robtarget t; VAR jointtarget a; VAR jointtarget b;"
CORRECT_AGAIN = """
    MotionSup \\Off; ConfL \\Off; a:=CJointT(); CorrCon one; CorrWrite one,[0,5,0];
    t:=CRobT(\\Tool:=tool0\\WObj:=wobj0); MoveL Offs(t,0,0,20),v200,fine,tool0\\Corr;
    CorrWrite one,[0,0,0]; MoveL Offs(t,0,0,70),v20,fine,tool0\\Corr; b:=CJointT(); b.robax.rax_1:=b.robax.rax_1-60;
    MoveAbsJ b,v1000,fine,tool0; t:=CRobT(\\Tool:=tool0\\WObj:=wobj0); MoveL Offs(t,0,0,-20),v200,fine,tool0\\Corr;
    CorrWrite one,[0,5,0]; MoveL Offs(t,0,0,10),v200,fine,tool0\\Corr; TPWrite "done";"""


def greatest_step(world: World, seconds: float) -> float:
    """The greatest step of a planned joint of the right arm from one cycle to the next [rad]."""
    arm, most = world.arms[Side.RIGHT], 0.0
    before = arm.planned
    for _ in range(round(seconds / world.cycle_time)):
        world.cycle({})
        most, before = max(most, *(abs(a - b) for a, b in zip(arm.planned, before, strict=True))), arm.planned
    return most


def test_correction_after_moves_without_one_does_not_make_the_arm_jump(start: Start) -> None:
    world = start(CORRECT_AGAIN, CORRECTED)
    step = greatest_step(world, 10.0)
    assert list(world.controller.screens["T_ROB_R"]) == ["done"]
    assert step < 0.02, "more than any joint's speed allows"


def test_correction_that_is_no_longer_in_reach_leads_back_to_the_path(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = start(
        """ConfL \\Off; CorrCon one; CorrWrite one,[0,5,0];
        t:=CRobT(\\Tool:=tool0\\WObj:=wobj0); MoveL Offs(t,0,0,60),v20,fine,tool0\\Corr; TPWrite "done";""",
        CORRECTED,
    )
    run(world, 1.5)
    path = world.arms[Side.RIGHT].path
    beside = max(abs(a - b) for a, b in zip(path.state.position, path.nominal, strict=True))
    assert beside > 0.005, "it is corrected"
    with monkeypatch.context() as patched:
        patched.setattr(path.corrector, "_reached", lambda *_: None)
        assert greatest_step(world, 0.5) < 0.002
        assert path.state.position == pytest.approx(path.nominal, abs=0.01 * beside)
    assert greatest_step(world, 2.0) < 0.002, "nor when it is in reach again"
    assert list(world.controller.screens["T_ROB_R"]) == ["done"]
