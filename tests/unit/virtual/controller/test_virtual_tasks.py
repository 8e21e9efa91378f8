"""Event routines of the system parameters, and tasks that wait for the task in their foreground."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from itertools import permutations
from math import degrees
from pathlib import Path
from typing import Any

import pytest

from abb_protocols.robot.joints import Joints, Side
from abb_protocols.rws.values import ControllerState, EventType
from virtual_irc5.controller.installed_system import ROBOTS, delivered_system, factory_system, with_programs
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import Refused
from virtual_irc5.mechanics.egm_motion import EgmRun
from virtual_irc5.rapid.pauses import StepKind
from virtual_irc5.rapid.states import Execution
from virtual_irc5.rws.rapid import _get_task
from virtual_irc5.rws.rws_call import RwsCall
from virtual_irc5.world import World, WorldSettings

TASKS = """
CAB_TASKS:

      -Name "T_ROB_L" -Type "NORMAL" -UseMechanicalUnitGroup "rob_l" -MotionTask

      -Name "T_ROB_R" -Type "NORMAL" -UseMechanicalUnitGroup "rob_r" -MotionTask

      -Name "SERVER" -Type "NORMAL"

      -Name "WATCHER" -Type "SEMISTATIC" -TrustLevel "None"
"""
NOTE = """MODULE Hooks(SYSMODULE)
  PROC on_event()
    TEST EventType()
    CASE EVENT_POWERON: TPWrite "power on";
    CASE EVENT_START: TPWrite "start";
    CASE EVENT_STOP: TPWrite "stop";
    CASE EVENT_QSTOP: TPWrite "qstop";
    CASE EVENT_RESTART: TPWrite "restart";
    CASE EVENT_RESET: TPWrite "reset";
    CASE EVENT_STEP: TPWrite "step";
    DEFAULT: TPWrite "none";
    ENDTEST
  ENDPROC
  PROC second()
    TPWrite "second";
  ENDPROC
ENDMODULE"""
EVENTS = ("POWER_ON", "START", "STOP", "QSTOP", "RESTART", "RESET", "STEP")
ALL = "\n\n".join(f'      -Routine "on_event" -Shelf "{event}" -Task "T_ROB_L" -SeqNo 5' for event in EVENTS)
WAITING = 'MODULE Main PROC main() TPWrite "main"; WaitTime 100; TPWrite "later"; WaitTime 100; ENDPROC ENDMODULE'


def controller_world(folder: Path, hooks: str = ALL, tasks: str = "", **modules: Sequence[str]) -> World:
    """A YuMi with event routines; of each task its modules, of which NOTE is one more."""
    cfg = folder / "SYS.cfg"
    cfg.write_text(f"SYS:CFG_1.0:6:0::\n{tasks}\nCAB_EXEC_HOOKS:\n\n{hooks}\n")
    programs: dict[str, list[Path]] = {"T_ROB_R": [], "T_ROB_L": []} | {
        task: [file_of(folder, f"{task}{number}.mod", text) for number, text in enumerate((*texts, NOTE))]
        for task, texts in modules.items()
    }
    system = with_programs(delivered_system(), programs, [cfg])
    return World(WorldSettings(system=system))


def file_of(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def run(world: World, seconds: float) -> Irc5:
    for _ in range(round(seconds / world.cycle_time)):
        world.cycle({})
    return world.controller


def logged(controller: Irc5) -> str:
    return "\n".join(each.description for each in controller.events.entries())


def started(world: World, seconds: float = 0.1) -> Irc5:
    world.controller.set_motors(True)
    world.controller.start_rapid()
    return run(world, seconds)


def test_event_routines_run_at_power_on_start_stop_and_restart(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=[WAITING])
    controller = run(world, 0.1)
    assert list(controller.screens["T_ROB_L"]) == ["power on"]
    started(world)
    controller.stop_rapid()
    run(world, 0.1)
    assert not controller.is_running
    controller.start_rapid()
    run(world, 0.1)
    assert list(controller.screens["T_ROB_L"]) == ["power on", "start", "main", "stop", "restart"]
    assert controller.tasks["T_ROB_L"].execution is Execution.STARTED
    assert controller.tasks["T_ROB_L"].call_stack[-1].routine == "main"


def test_start_comes_again_once_the_program_pointer_is_at_main(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=[WAITING])
    controller = started(world)
    controller.stop_rapid()
    run(world, 0.1)
    controller.move_pp_to_main()
    controller.start_rapid()
    run(world, 0.1)
    assert controller.screens["T_ROB_L"] == ("power on", "start", "main", "stop", "start", "main")


def test_main_that_repeats_starts_once(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=["MODULE Main PERS num n:=0; PROC main() Incr n; ENDPROC ENDMODULE"])
    controller = started(world)
    assert controller.screens["T_ROB_L"] == ("power on", "start")
    assert float(controller.tasks["T_ROB_L"].read("Main", "n")) > 5


def test_emergency_stop_calls_the_routines_of_qstop(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=[WAITING])
    controller = started(world)
    controller.press_emergency_stop()
    run(world, 0.1)
    assert controller.screens["T_ROB_L"][-1] == "qstop"
    assert not controller.is_running


def test_step_calls_the_routines_of_step_and_executes_one_statement(tmp_path: Path) -> None:
    text = 'MODULE Main PROC main() TPWrite "a"; TPWrite "b"; ENDPROC ENDMODULE'
    world = controller_world(tmp_path, T_ROB_L=[text])
    world.controller.set_motors(True)
    for _ in range(2):
        world.controller.start_rapid(step=StepKind.OVER)
        run(world, 0.1)
    assert world.controller.screens["T_ROB_L"] == ("power on", "step", "a", "step", "b")


def test_another_program_calls_the_routines_of_reset(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=[WAITING])
    world.controller.restart(0.01, discards_programs=True)
    controller = run(world, 0.5)
    assert controller.screens["T_ROB_L"] == ("power on", "power on", "reset")


def test_routines_run_in_the_order_of_their_numbers_in_the_tasks_they_are_for(tmp_path: Path) -> None:
    hooks = '-Routine "second" -Shelf "START" -AllTask -SeqNo 2\n\n-Routine "on_event" -Shelf "START" -AllMotionTask'
    world = controller_world(tmp_path, hooks, TASKS, T_ROB_L=[WAITING], T_ROB_R=[WAITING], SERVER=[WAITING])
    controller = started(world)
    assert controller.screens["T_ROB_L"] == controller.screens["T_ROB_R"] == ("start", "second", "main")
    assert controller.screens["SERVER"] == ("second", "main")


def test_routine_of_stop_runs_when_the_arm_stands_still(tmp_path: Path) -> None:
    moving = """MODULE Main
      PROC main()
        MoveAbsJ [[0,-130,30,0,40,0],[90,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs, v100, fine, tool0;
      ENDPROC
      PROC halted()
        VAR jointtarget here;
        here := CJointT();
        WaitTime 0.3;
        TPWrite "moved by "\\Num:=Round(Abs(here.robax.rax_6 - j_of_now())\\Dec:=3);
      ENDPROC
      FUNC num j_of_now()
        VAR jointtarget here;
        here := CJointT();
        RETURN here.robax.rax_6;
      ENDFUNC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"', T_ROB_L=[moving])
    controller = started(world, 0.6)
    controller.stop_rapid()
    assert controller.is_running  # until the routine has been executed
    run(world, 0.2)
    with pytest.raises(Refused, match="STOP are still running"):
        controller.start_rapid()
    run(world, 0.6)
    assert controller.screens["T_ROB_L"] == ("moved by 0",)
    assert not controller.is_running
    assert controller.tasks["T_ROB_L"].execution is Execution.STOPPED


def test_interrupts_ordered_at_start_work_in_the_program_and_wait_for_the_routine(tmp_path: Path) -> None:
    text = """MODULE Main
      VAR intnum tick;
      PROC at_start()
        CONNECT tick WITH ticked;
        ITimer\\Single, 0.1, tick;
        WaitTime 0.2;
        TPWrite "ready "\\Num:=ExecLevel();
      ENDPROC
      TRAP ticked
        TPWrite "tick in level "\\Num:=ExecLevel();
      ENDTRAP
      PROC main() WaitTime 100; ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "at_start" -Shelf "START" -Task "T_ROB_L"', T_ROB_L=[text])
    assert started(world, 0.5).screens["T_ROB_L"] == ("ready 2", "tick in level 1")


def test_error_in_a_routine_stops_the_start_and_no_handler_of_main_takes_it(tmp_path: Path) -> None:
    text = """MODULE Main
      PROC at_start() RAISE 1; ENDPROC
      PROC main()
        TPWrite "main";
      ERROR
        TPWrite "handled";
        TRYNEXT;
      ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "at_start" -Shelf "START" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = started(world)
    assert controller.screens["T_ROB_L"] == ()
    assert not controller.is_running
    assert "at_start" in logged(controller)
    assert [each.routine for each in controller.tasks["T_ROB_L"].call_stack] == ["main"]


@pytest.mark.parametrize(("statement", "is_called"), [("Stop;", True), ("RAISE 1;", False), ("EXIT;", False)])
def test_stop_of_the_program_itself_calls_the_routines_and_errors_and_exit_do_not(
    tmp_path: Path, statement: str, is_called: bool
) -> None:
    text = f'MODULE Main PROC main() TPWrite "main"; {statement} ENDPROC ENDMODULE'
    controller = started(controller_world(tmp_path, T_ROB_L=[text]))
    assert ("stop" in controller.screens["T_ROB_L"]) == is_called
    assert not controller.is_running


def test_routine_of_start_that_is_stopped_goes_on_at_the_next_start(tmp_path: Path) -> None:
    text = """MODULE Main
      PROC main() TPWrite "main"; WaitTime 100; ENDPROC
      PROC at_start()
        TPWrite "first half";
        WaitTime 1;
        TPWrite "second half";
      ENDPROC
    ENDMODULE"""
    hooks = ALL.replace('-Routine "on_event" -Shelf "START"', '-Routine "at_start" -Shelf "START"')
    world = controller_world(tmp_path, hooks, T_ROB_L=[text])
    controller = started(world, 0.5)
    controller.stop_rapid()
    run(world, 0.1)
    assert not controller.is_running
    controller.start_rapid()
    run(world, 1.0)
    assert list(controller.screens["T_ROB_L"]) == ["power on", "first half", "stop", "restart", "second half", "main"]


def test_stop_in_a_routine_of_stop_ends_the_routine(tmp_path: Path) -> None:
    text = """MODULE Main
      PROC main() TPWrite "main"; WaitTime 100; ENDPROC
      PROC halted() TPWrite "halted"; Stop; TPWrite "never"; ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = started(world)
    controller.stop_rapid()
    run(world, 0.1)
    assert not controller.is_running
    controller.start_rapid()
    run(world, 0.1)
    assert list(controller.screens["T_ROB_L"]) == ["main", "halted"]
    assert controller.tasks["T_ROB_L"].call_stack[0].routine == "main"
    assert "system error" not in logged(controller)


def test_stop_in_a_routine_of_a_stop_of_one_task_is_no_stop_of_its_own(tmp_path: Path) -> None:
    text = """MODULE Main
      PROC main() TPWrite "main"; Stop; ENDPROC
      PROC halted() TPWrite "halted"; Stop; TPWrite "never"; ENDPROC
    ENDMODULE"""
    hook = '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"'
    controller = started(controller_world(tmp_path, hook, TASKS, T_ROB_L=[text], SERVER=[WAITING]), 0.5)
    assert controller.screens["T_ROB_L"] == ("main", "halted")
    assert controller.tasks["T_ROB_L"].execution is Execution.STOPPED
    assert controller.is_running, "the other task goes on"


ENDS: dict[str, Callable[[Irc5], object]] = {
    "stop": Irc5.stop_rapid,
    "collision": lambda controller: controller.collide(Side.LEFT),
    "motors off": lambda controller: controller.set_motors(False),
    "emergency stop": Irc5.press_emergency_stop,
}


@pytest.mark.parametrize("end", ENDS)
def test_another_stop_leaves_the_routines_of_a_stop(tmp_path: Path, end: str) -> None:
    text = """MODULE Main
      PROC main() WaitTime 100; ENDPROC
      PROC halted() WaitTime 50; TPWrite "never"; ENDPROC
    ENDMODULE"""
    hooks = ALL.replace('-Routine "on_event" -Shelf "STOP"', '-Routine "halted" -Shelf "STOP"')
    world = controller_world(tmp_path, hooks, T_ROB_L=[text])
    controller = started(world, 0.3)
    controller.stop_rapid()
    run(world, 0.3)
    assert controller.is_running
    ENDS[end](controller)
    run(world, 0.3)
    assert not controller.is_running
    seen = ("power on", "start", *(["qstop"] if end == "emergency stop" else []))
    assert controller.screens["T_ROB_L"] == seen
    assert [each.routine for each in controller.tasks["T_ROB_L"].call_stack] == ["main"]


def test_stop_that_comes_twice_before_the_arm_stands_calls_its_routines(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=[MOVING % ("", "")])
    controller = started(world, 2.0)
    controller.stop_rapid()
    controller.stop_rapid()
    run(world, 1.0)
    assert not controller.is_running
    assert controller.screens["T_ROB_L"] == ("power on", "start", "stop")


def test_program_is_replaced_while_routines_of_a_stop_run(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() WaitTime 100; ENDPROC PROC halted() WaitTime 50; ENDPROC ENDMODULE"
    world = controller_world(tmp_path, '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = started(world)
    controller.replace_program({"HOME:/other.mod": "MODULE Other PROC main() WaitTime 5; ENDPROC ENDMODULE"})
    assert not controller.is_running
    task = controller.tasks["T_ROB_L"]
    assert [each.name for each in task.modules] == ["user", "Other"]
    assert task.execution is Execution.READY


def test_start_after_exit_is_refused(tmp_path: Path) -> None:
    controller = started(controller_world(tmp_path, "", T_ROB_L=["MODULE Main PROC main() EXIT; ENDPROC ENDMODULE"]))
    with pytest.raises(Refused, match="T_ROB_L has no program pointer: move it to main first"):
        controller.start_rapid()
    assert not controller.is_running


def test_background_task_that_has_ended_begins_again_at_a_restart(tmp_path: Path) -> None:
    text = 'MODULE Main PROC main() TPWrite "main"; EXIT; ENDPROC ENDMODULE'
    tasks = TASKS.replace('-Type "SEMISTATIC"', '-Type "STATIC"')
    world = controller_world(tmp_path, "", tasks, WATCHER=[text])
    run(world, 0.1)
    world.controller.restart(0.01)
    assert run(world, 0.5).screens["WATCHER"] == ("main", "main")


def test_routines_that_the_call_stack_has_no_room_for_leave_a_warning(tmp_path: Path) -> None:
    text = """MODULE Main
      PERS num depth := 0;
      PROC main() deep; ENDPROC
      PROC deep() Incr depth; IF depth < 249 deep; WaitTime 100; ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, T_ROB_L=[text])
    controller = started(world, 0.5)
    controller.stop_rapid()
    run(world, 0.1)
    assert not controller.is_running
    assert "on_event of the system event STOP is not executed" in logged(controller)
    controller.start_rapid()
    run(world, 0.1)
    assert controller.tasks["T_ROB_L"].execution is Execution.STARTED
    assert controller.screens["T_ROB_L"] == ("power on", "start")


MOVING = """MODULE Moving
  PROC main()
    MoveAbsJ [[30,-100,10,0,40,0],[120,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs, v50, fine, tool0;
    %s
    WaitTime 100;
  ENDPROC
  PROC on_it()
    VAR egmident egm;
    %s
  ENDPROC
ENDMODULE"""
MOVES = (
    "MoveAbsJ [[10,-120,20,0,40,0],[130,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs, v50, fine, tool0;",
    "StartMove;",
    "StartMove\\AllMotionTasks;",
    "EGMRunJoint egm, EGM_STOP_HOLD\\J1;",
)


def left(world: World) -> Joints:
    return next(arm.position for settings, arm in world.arms.items() if settings.name == "LEFT")


def moved_by(world: World, before: Joints) -> float:
    """The largest way of a joint of the left arm [deg]."""
    return max(abs(degrees(a - b)) for a, b in zip(left(world), before, strict=True))


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("event", ["STOP", "QSTOP"])
def test_routines_of_a_stop_move_no_arm(tmp_path: Path, event: str, move: str) -> None:
    hook = f'-Routine "on_it" -Shelf "{event}" -Task "T_ROB_L"'
    world = controller_world(tmp_path, hook, T_ROB_L=[MOVING % ("", f"WaitTime 1; {move}")])
    controller = started(world, 3.0)
    if event == "STOP":
        controller.stop_rapid()
        run(world, 0.5)
    else:
        controller.press_emergency_stop()
        run(world, 0.2)
        controller.release_emergency_stop()
        controller.set_motors(True)
    position = left(world)
    run(world, 3.0)
    assert moved_by(world, position) < 0.01
    assert not controller.is_running
    assert f"moves a robot, which an event routine of {event} may not" in logged(controller)


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("event", ["POWER_ON", "RESET"])
def test_routines_without_a_start_move_no_arm(tmp_path: Path, event: str, move: str) -> None:
    hook = f'-Routine "on_it" -Shelf "{event}" -Task "T_ROB_L"'
    world = controller_world(tmp_path, hook, T_ROB_L=[MOVING % ("", f"WaitTime 1; {move}")])
    world.controller.set_motors(True)
    world.controller.program_loaded("T_ROB_L")
    position = left(world)
    run(world, 3.0)
    assert moved_by(world, position) < 0.01
    assert f"moves a robot, which an event routine of {event} may not" in logged(world.controller)


def test_routines_of_a_start_may_move_the_arm(tmp_path: Path) -> None:
    hook = '-Routine "on_it" -Shelf "START" -Task "T_ROB_L"'
    world = controller_world(tmp_path, hook, T_ROB_L=[MOVING % ("", f"{MOVES[0]} Stop;")])
    position = left(world)
    started(world, 2.0)
    assert moved_by(world, position) > 1.0


def test_stop_leaves_the_routines_of_power_on_though_nothing_is_started(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() WaitTime 100; ENDPROC PROC endless() WaitUntil FALSE; ENDPROC ENDMODULE"
    world = controller_world(tmp_path, '-Routine "endless" -Shelf "POWER_ON" -Task "T_ROB_L"', T_ROB_L=[text])
    task = run(world, 0.1).tasks["T_ROB_L"]
    assert task.call_stack[0].routine == "endless"
    world.controller.stop_rapid()
    run(world, 0.1)
    assert [each.routine for each in task.call_stack] == ["main"]
    assert not task.is_running


def test_pp_to_main_lets_the_routine_of_a_reset_end(tmp_path: Path) -> None:
    text = """MODULE Main
      PROC main() TPWrite "main"; Stop; ENDPROC
      PROC cleaned() WaitTime 1; TPWrite "clean"; ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "cleaned" -Shelf "RESET" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = world.controller
    controller.program_loaded("T_ROB_L")
    run(world, 0.5)
    controller.execution.move_pp_to_main()
    assert [each.routine for each in controller.tasks["T_ROB_L"].call_stack] == ["cleaned", "main"]
    run(world, 0.6)
    assert controller.screens["T_ROB_L"] == ("clean",)
    started(world, 0.1)
    assert controller.screens["T_ROB_L"] == ("clean", "main")


def test_wait_of_the_program_does_not_pass_in_routines_of_a_stop(tmp_path: Path) -> None:
    text = """MODULE Main
      VAR intnum tick;
      PROC main()
        CONNECT tick WITH ticked;
        ITimer\\Single, 2, tick;
        WaitTime 1;
        TPWrite "waited";
        WaitTime 100;
      ENDPROC
      TRAP ticked TPWrite "tick"; ENDTRAP
      PROC halted() WaitTime 5; ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = started(world, 0.5)
    controller.stop_rapid()
    run(world, 5.5)
    assert not controller.is_running
    controller.start_rapid()
    run(world, 0.4)
    assert controller.screens["T_ROB_L"] == ()
    run(world, 0.2)
    assert controller.screens["T_ROB_L"] == ("waited",)
    run(world, 0.8)
    assert controller.screens["T_ROB_L"] == ("waited",)
    run(world, 0.2)
    assert controller.screens["T_ROB_L"] == ("waited", "tick")


def test_routines_of_another_program_are_compiled_beside_the_cycle(tmp_path: Path) -> None:
    world = controller_world(tmp_path, T_ROB_L=[WAITING])
    controller = run(world, 0.1)
    task = controller.tasks["T_ROB_L"]
    waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def later(work: Callable[[], Any]) -> Future[Any]:
        waiting.append((Future(), work))
        return waiting[-1][0]

    task.background = later
    controller.execution.load_program("T_ROB_L", {"HOME:/late.mod": WAITING.replace("Main", "Late")}, replace=True)
    controller.program_loaded("T_ROB_L")
    run(world, 0.1)
    assert controller.screens["T_ROB_L"] == ("power on",)
    for result, work in waiting:
        result.set_result(work())
    run(world, 0.1)
    assert controller.screens["T_ROB_L"] == ("power on", "reset")


def test_routine_of_stop_that_does_not_end_is_left_after_a_minute(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() WaitTime 100; ENDPROC PROC halted() WaitUntil FALSE; ENDPROC ENDMODULE"
    world = controller_world(tmp_path, '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = started(world)
    controller.stop_rapid()
    run(world, 59.0)
    assert controller.is_running
    run(world, 2.0)
    assert not controller.is_running
    assert "longer than 60 s" in logged(controller)
    assert controller.tasks["T_ROB_L"].call_stack[0].routine == "main"


def test_routine_that_does_not_exist_leaves_a_warning(tmp_path: Path) -> None:
    world = controller_world(tmp_path, '-Routine "nowhere" -Shelf "START" -Task "T_ROB_L"', T_ROB_L=[WAITING])
    controller = started(world)
    assert controller.screens["T_ROB_L"] == ("main",)
    assert "nowhere" in logged(controller)


def test_background_task_calls_its_routines_of_power_on_and_start(tmp_path: Path) -> None:
    hooks = '-Routine "on_event" -Shelf "POWER_ON" -AllTask\n\n-Routine "on_event" -Shelf "START" -AllTask'
    world = controller_world(tmp_path, hooks, TASKS, WATCHER=[WAITING])
    assert run(world, 0.1).screens["WATCHER"] == ("power on", "start", "main")


BUSY = "MODULE Main PERS num n := 0; PROC main() WHILE n < 100000 DO Incr n; ENDWHILE WaitTime 1; ENDPROC ENDMODULE"
COUNT = "MODULE Other PERS num c := 0; PROC main() WHILE TRUE DO Incr c; WaitTime 0.01; ENDWHILE ENDPROC ENDMODULE"


SHARING = {
    "T_ROB1": '-Type "NORMAL" -UseMechanicalUnitGroup "rob1" -MotionTask',
    "WRITER": '-Type "SEMISTATIC"',
    "READER": '-Type "SEMISTATIC"',
}


@pytest.mark.parametrize("order", list(permutations(SHARING)), ids="-".join)
def test_persistent_of_one_name_is_shared_whatever_the_order_of_tasks(tmp_path: Path, order: Sequence[str]) -> None:
    tasks = "\n\n".join(f'-Name "{name}" {SHARING[name]}' for name in order)
    system = replace(factory_system(ROBOTS["irb120"]), restored=(f"SYS:CFG_1.0:6:0::\nCAB_TASKS:\n\n{tasks}\n",))
    text = "MODULE {0} PERS num k:=0; PROC main() {1} WHILE TRUE DO WaitTime 0.1; ENDWHILE ENDPROC ENDMODULE"
    files = {
        name: [file_of(tmp_path, f"{name}.mod", text.format(name.title(), "k:=3;" if name == "WRITER" else ""))]
        for name in order
    }
    controller = run(World(WorldSettings(system=with_programs(system, files))), 0.3)
    assert list(controller.tasks) == list(order)
    assert [task.read(name.title(), "k") for name, task in controller.tasks.items()] == ["3", "3", "3"]


@pytest.mark.parametrize("spelling", ["Task_in_forground", "TaskInForeground"])
def test_task_waits_while_the_task_in_its_foreground_has_something_to_do(tmp_path: Path, spelling: str) -> None:
    tasks = TASKS.replace('-Name "SERVER"', f'-Name "SERVER" -{spelling} "T_ROB_L"')
    world = controller_world(tmp_path, "", tasks, T_ROB_L=[BUSY], SERVER=[COUNT])
    controller = started(world, 0.05)
    busy, other = controller.tasks["T_ROB_L"], controller.tasks["SERVER"]
    assert 0.0 < float(busy.read("Main", "n")) < 100000.0
    assert other.read("Other", "c") == "0"
    run(world, 1.0)
    assert float(other.read("Other", "c")) > 20


def test_only_tasks_without_one_in_their_foreground_are_in_it_over_rws(tmp_path: Path) -> None:
    tasks = TASKS.replace('-Name "SERVER"', '-Name "SERVER" -TaskInForeground "T_ROB_L"')
    controller = controller_world(tmp_path, "", tasks).controller
    calls = [RwsCall("GET", ("rw", "rapid", "tasks", name), names={"task": name}) for name in ("SERVER", "T_ROB_L")]
    shown = [dict(_get_task(controller, call).states[0].fields)["task_in_forgnd"] for call in calls]
    assert shown == ["False", "True"]


def test_tasks_without_one_in_their_foreground_share_the_time(tmp_path: Path) -> None:
    world = controller_world(tmp_path, "", TASKS, T_ROB_L=[BUSY], SERVER=[COUNT])
    controller = started(world, 0.05)
    assert float(controller.tasks["SERVER"].read("Other", "c")) > 2
    assert controller.controller_state is ControllerState.MOTORS_ON


def test_pulse_ends_and_clock_goes_on_while_the_program_is_stopped(tmp_path: Path) -> None:
    text = """MODULE Main
      VAR clock watch;
      PERS num seconds := 0;
      PROC main()
        ClkStart watch;
        PulseDO\\PLength:=0.5, custom_DO_0;
        SetDO\\SDelay:=0.3, custom_DO_1, 1;
        Stop;
        seconds := ClkRead(watch);
      ENDPROC
    ENDMODULE"""
    first, second = "custom_DO_0", "custom_DO_1"
    world = controller_world(tmp_path, "", T_ROB_L=[text])
    controller = started(world)
    assert not controller.is_running
    assert [controller.signals.get(name).value for name in (first, second)] == [1.0, 0.0]
    run(world, 1.0)
    assert [controller.signals.get(name).value for name in (first, second)] == [0.0, 1.0]
    controller.start_rapid("once")
    run(world, 0.1)
    assert float(controller.tasks["T_ROB_L"].read("Main", "seconds")) == pytest.approx(1.1, abs=0.02)


@pytest.mark.parametrize(("parameters", "tries"), [("", 5), ('SYS_MISC:\n\n -Name "NoOfRetry" -Value 9\n#\n', 10)])
def test_retry_is_possible_as_often_as_the_system_parameters_say(tmp_path: Path, parameters: str, tries: int) -> None:
    text = """MODULE Main
      PERS num n := 0;
      PROC main()
        attempt;
      ENDPROC
      PROC attempt()
        fail;
      ERROR
        RETRY;
      ENDPROC
      PROC fail()
        Incr n;
        RAISE 5;
      ERROR
        RAISE;
      ENDPROC
    ENDMODULE"""
    controller = started(controller_world(tmp_path, "", parameters, T_ROB_L=[text]))
    assert controller.tasks["T_ROB_L"].read("Main", "n") == f"{tries}"
    assert "ERR_EXCRTYMAX" in logged(controller)


@pytest.mark.parametrize(("length_mm", "is_all"), [(20, False), (500, True)])
def test_arm_steps_back_on_its_path_before_it_goes_on(tmp_path: Path, length_mm: int, is_all: bool) -> None:
    text = f"""MODULE Main
      VAR robtarget begin;
      PERS num stopped := 0;
      PERS num back := 0;
      PROC main()
        ConfL\\Off;
        begin := CRobT();
        MoveL Offs(begin,100,0,50), v50, fine, tool0;
        TPWrite "from begin "\\Num:=Round(from_begin());
      ENDPROC
      PROC at_restart()
        stopped := from_begin();
        WaitTime 0.2;
        StepBwdPath {length_mm}, 0.5;
        back := from_begin();
        TPWrite "back";
      ENDPROC
      FUNC num from_begin()
        VAR robtarget here;
        here := CRobT();
        RETURN Distance(here.trans, begin.trans);
      ENDFUNC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "at_restart" -Shelf "RESTART" -Task "T_ROB_L"', T_ROB_L=[text])
    task = started(world, 1.4).tasks["T_ROB_L"]
    world.controller.stop_rapid()
    run(world, 0.5)
    world.controller.start_rapid("once")
    run(world, 0.9)
    assert world.controller.screens["T_ROB_L"] == ("back",)
    stopped, back = float(task.read("Main", "stopped")), float(task.read("Main", "back"))
    assert stopped == pytest.approx(65.0, abs=10.0)
    assert back == pytest.approx(0.0 if is_all else stopped - length_mm, abs=0.1)
    run(world, 4.0)
    assert world.controller.screens["T_ROB_L"] == ("back", "from begin 112")


def test_stepping_back_is_for_event_routines_of_restart_only(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() StepBwdPath 10, 1; ENDPROC ENDMODULE"
    controller = started(controller_world(tmp_path, "", T_ROB_L=[text]))
    assert "event routines of RESTART" in logged(controller)


def test_task_without_an_arm_steps_no_arm_back(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() WaitTime 100; ENDPROC PROC back() StepBwdPath 10, 1; ENDPROC ENDMODULE"
    world = controller_world(tmp_path, '-Routine "back" -Shelf "RESTART" -Task "SERVER"', TASKS, SERVER=[text])
    started(world).stop_rapid()
    world.controller.start_rapid()
    assert "which the task SERVER may not" in logged(run(world, 0.1))


def test_move_that_was_stopped_goes_on_after_the_routine_of_restart(tmp_path: Path) -> None:
    text = """MODULE Main
      PERS num moved := -1;
      PROC main()
        MoveAbsJ [[0,-130,30,0,40,30],[135,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs, v50, fine, tool0;
        TPWrite "done";
      ENDPROC
      PROC at_restart()
        VAR jointtarget before;
        VAR jointtarget after;
        before := CJointT();
        WaitTime 0.5;
        after := CJointT();
        moved := Abs(after.robax.rax_6 - before.robax.rax_6);
      ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, '-Routine "at_restart" -Shelf "RESTART" -Task "T_ROB_L"', T_ROB_L=[text])
    controller = started(world, 0.3)
    controller.stop_rapid()
    run(world, 0.5)
    controller.start_rapid("once")
    run(world, 4.0)
    assert float(controller.tasks["T_ROB_L"].read("Main", "moved")) == pytest.approx(0.0, abs=0.01)
    assert controller.screens["T_ROB_L"] == ("done",)


BACK = """MODULE Moving
  PROC main()
    MoveAbsJ [[30,-100,10,0,40,0],[120,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs, v50, fine, tool0;
    TPWrite "main";
    WaitTime 100;
  ENDPROC
  PROC back() StepBwdPath %s; TPWrite "back"; ENDPROC
ENDMODULE"""


def stopped_on_path(folder: Path, step: str) -> World:
    """The left arm stands on its path; at a start it steps back."""
    hook = '-Routine "back" -Shelf "RESTART" -Task "T_ROB_L"'
    world = controller_world(folder, hook, T_ROB_L=[BACK % step])
    started(world, 5.0)
    world.controller.stop_rapid()
    run(world, 0.5)
    return world


def test_stop_ends_the_way_back(tmp_path: Path) -> None:
    world = stopped_on_path(tmp_path, "60, 5")
    begin = left(world)
    world.controller.start_rapid()
    run(world, 1.0)
    assert moved_by(world, begin) > 0.1
    world.controller.stop_rapid()
    run(world, 0.2)
    position = left(world)
    run(world, 6.0)
    assert moved_by(world, position) < 0.01
    world.controller.start_rapid()
    run(world, 40.0)
    assert world.controller.screens["T_ROB_L"] == ("back", "back", "main")


def test_arm_comes_back_to_its_path_before_it_steps_back(tmp_path: Path) -> None:
    hook = '-Routine "back" -Shelf "RESTART" -Task "T_ROB_L"'
    world = controller_world(tmp_path, hook, T_ROB_L=[BACK % "20, 1"])
    controller = started(world, 5.0)
    controller.press_emergency_stop()
    run(world, 1.0)
    controller.release_emergency_stop()
    controller.set_motors(True)
    begin = left(world)
    controller.start_rapid()
    while controller.screens["T_ROB_L"] != ("back",):
        run(world, world.cycle_time)
    assert moved_by(world, begin) > 0.5
    controller.stop_rapid()
    run(world, 0.2)
    position = left(world)
    run(world, 2.0)
    assert moved_by(world, position) < 0.01


def test_arm_steps_back_no_faster_than_its_joints_may(tmp_path: Path) -> None:
    world = stopped_on_path(tmp_path, "60, 0.001")
    arm = next(arm for settings, arm in world.arms.items() if settings.name == "LEFT")
    limits, cycle = arm.model.limits, world.cycle_time
    world.controller.start_rapid()
    past = [arm.planned] * 3
    while world.controller.screens["T_ROB_L"] != ("back",):
        run(world, cycle)
        past = [*past[1:], arm.planned]
        for first, second, third, speed, acceleration in zip(*past, limits.velocity, limits.acceleration, strict=True):
            assert abs(third - second) <= speed * cycle
            assert abs(third - 2.0 * second + first) <= acceleration * cycle**2


EGM_ON = """MODULE Guided
  VAR egmident egm;
  PROC main()
    MoveAbsJ CJointT(), v100, fine, tool0;
    EGMGetId egm;
    EGMSetupUC ROB_L, egm, "ROB_L", "ROB_L"\\Joint\\CommTimeout:=100;
    EGMActJoint egm\\J1:=[-0.1,0.1];
    EGMRunJoint egm, EGM_STOP_HOLD\\J1\\J2\\J3\\J4\\J5\\J6\\J7;
  ENDPROC
  PROC waits() WaitTime 0.5; EGMWaitCond egm; ENDPROC
ENDMODULE"""


def test_routine_of_stop_does_not_start_egm_again(tmp_path: Path) -> None:
    world = controller_world(tmp_path, '-Routine "waits" -Shelf "STOP" -Task "T_ROB_L"', T_ROB_L=[EGM_ON])
    controller = started(world, 1.0)
    assert world.egm[Side.LEFT].is_running
    controller.stop_rapid()
    run(world, 3.0)
    assert not world.egm[Side.LEFT].is_running
    assert not controller.is_running
    assert "EGMWaitCond moves a robot, which an event routine of STOP may not" in logged(controller)


def test_stop_ends_egm_though_no_program_runs(tmp_path: Path) -> None:
    world = controller_world(tmp_path, "", T_ROB_L=[EGM_ON])
    controller = started(world, 1.0)
    controller.stop_rapid()
    run(world, 1.0)
    egm = world.egm[Side.LEFT]
    egm.run_joint(EgmRun())
    run(world, 0.5)
    assert egm.is_running
    controller.stop_rapid()
    run(world, 0.5)
    assert not egm.is_running


RESUMING = """MODULE Main
  VAR num number := 0;
  PROC main()
    IF custom_DO_0 = 1 THEN
      StartMove\\AllMotionTasks;
      WaitTime 100;
    ENDIF
    WaitTime 0.01;
  ERROR
    number := ERRNO;
    WaitTime 100;
  ENDPROC
ENDMODULE"""


def test_background_task_moves_no_arm_whose_program_is_stopped(tmp_path: Path) -> None:
    world = controller_world(tmp_path, "", TASKS, T_ROB_L=[MOVING % ("", "")], WATCHER=[RESUMING])
    controller = started(world, 3.0)
    controller.stop_rapid()
    run(world, 0.5)
    position = left(world)
    controller.signals.drive("custom_DO_0", 1.0)
    run(world, 1.0)
    assert moved_by(world, position) < 0.01
    watcher = controller.tasks["WATCHER"]
    assert watcher.machine.error_name(float(watcher.read("Main", "number"))) == "ERR_PROGSTOP"


@pytest.mark.parametrize("discards_programs", [False, True])
def test_routine_of_stop_ends_with_a_restart(tmp_path: Path, discards_programs: bool) -> None:
    text = "MODULE Main PROC main() WaitTime 100; ENDPROC PROC halted() WaitDI custom_DI_0, 1; ENDPROC ENDMODULE"
    hooks = ALL.replace('-Routine "on_event" -Shelf "STOP"', '-Routine "halted" -Shelf "STOP"')
    world = controller_world(tmp_path, hooks, T_ROB_L=[text])
    started(world).restart(1.0, discards_programs=discards_programs)
    controller = run(world, 4.0)
    assert not controller.is_running
    assert not [entry for entry in controller.events.entries() if entry.type is EventType.ERROR]
    assert [each.routine for each in controller.tasks["T_ROB_L"].call_stack] == ["main"]
    controller.set_motors(True)
    controller.start_rapid()
    assert run(world, 0.1).tasks["T_ROB_L"].execution is Execution.STARTED


def test_routine_of_power_on_is_left_at_a_restart(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() WaitTime 100; ENDPROC PROC endless() WaitUntil FALSE; ENDPROC ENDMODULE"
    world = controller_world(tmp_path, '-Routine "endless" -Shelf "POWER_ON" -Task "T_ROB_L"', T_ROB_L=[text])
    run(world, 0.1).restart(0.1)
    stack = run(world, 4.0).tasks["T_ROB_L"].call_stack
    assert [each.routine for each in stack] == ["endless", "main"]


SOON = 'MODULE Main PROC main() WaitTime %s; TPWrite "waited"; WaitTime 100; ENDPROC %s ENDMODULE'


def test_wait_of_a_program_does_not_pass_in_routines_of_another_task(tmp_path: Path) -> None:
    hook = '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"'
    long = SOON % (100, "PROC halted() WaitTime 5; ENDPROC")
    world = controller_world(tmp_path, hook, T_ROB_L=[long], T_ROB_R=[SOON % (1, "")])
    controller = started(world, 0.5)
    controller.stop_rapid()
    run(world, 5.5)
    assert not controller.is_running
    controller.start_rapid()
    assert run(world, 0.4).screens["T_ROB_R"] == ()
    assert run(world, 0.2).screens["T_ROB_R"] == ("waited",)


def test_time_of_a_task_that_has_stopped_itself_stands_still_while_another_runs(tmp_path: Path) -> None:
    text = """MODULE Main
      VAR intnum tick;
      PROC main()
        CONNECT tick WITH ticked;
        ITimer\\Single, 1, tick;
        Stop;
        WaitTime 100;
      ENDPROC
      TRAP ticked TPWrite "tick"; ENDTRAP
    ENDMODULE"""
    world = controller_world(tmp_path, "", T_ROB_L=[text], T_ROB_R=[WAITING])
    controller = started(world, 3.0)
    assert controller.is_running
    controller.start_rapid()
    assert run(world, 0.9).screens["T_ROB_L"] == ()
    assert run(world, 0.2).screens["T_ROB_L"] == ("tick",)


def test_tasks_that_stop_themselves_together_execute_their_routines_of_stop(tmp_path: Path) -> None:
    text = 'MODULE Main PROC main() Stop; ENDPROC PROC halted() TPWrite "halted"; ENDPROC ENDMODULE'
    hook = '-Routine "halted" -Shelf "STOP" -AllMotionTask'
    controller = started(controller_world(tmp_path, hook, T_ROB_L=[text], T_ROB_R=[text]))
    assert controller.screens["T_ROB_L"] == controller.screens["T_ROB_R"] == ("halted",)
    assert not controller.is_running


def test_task_that_finishes_leaves_the_routine_of_stop_of_another(tmp_path: Path) -> None:
    text = """MODULE Main
      PROC main() Stop; ENDPROC
      PROC halted() WaitTime 1; TPWrite "halted"; ENDPROC
    ENDMODULE"""
    short = "MODULE Main PROC main() WaitTime 0.5; ENDPROC ENDMODULE"
    hook = '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"'
    world = controller_world(tmp_path, hook, T_ROB_L=[text], T_ROB_R=[short])
    world.controller.set_motors(True)
    world.controller.start_rapid("once")
    assert run(world, 0.9).is_running
    assert run(world, 0.2).screens["T_ROB_L"] == ("halted",)
    assert not world.controller.is_running


def test_routine_of_stop_that_does_not_end_is_left_a_minute_after_the_last_task(tmp_path: Path) -> None:
    text = "MODULE Main PROC main() Stop; ENDPROC PROC halted() WaitUntil FALSE; ENDPROC ENDMODULE"
    short = "MODULE Main PROC main() WaitTime 0.5; Stop; ENDPROC ENDMODULE"
    hook = '-Routine "halted" -Shelf "STOP" -Task "T_ROB_L"'
    world = controller_world(tmp_path, hook, T_ROB_L=[text], T_ROB_R=[short])
    started(world)
    assert run(world, 60.0).is_running
    assert not run(world, 1.0).is_running
    assert "longer than 60 s" in logged(world.controller)


@pytest.mark.parametrize("after", ["", 'UnLoad "HOME:/other.mod";'])
def test_routines_run_though_a_module_that_was_loaded_does_not_fit(tmp_path: Path, after: str) -> None:
    text = f"""MODULE Main
      PROC main() Load "HOME:/tool.mod"; Load "HOME:/other.mod"; {after} WaitTime 100; ENDPROC
    ENDMODULE"""
    world = controller_world(tmp_path, T_ROB_L=[text])
    files = {"tool": "PROC misfit() on_event 5; ENDPROC", "other": "PROC unused() ENDPROC"}
    world.controller.files.update({f"HOME:/{name}.mod": f"MODULE {name} {it} ENDMODULE" for name, it in files.items()})
    controller = started(world)
    controller.stop_rapid()
    run(world, 0.1)
    assert "Execution error" not in [entry.title for entry in controller.events.entries()]
    assert controller.screens["T_ROB_L"] == ("power on", "start", "stop")
