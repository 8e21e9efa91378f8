"""Event routines of the system parameters, and tasks that wait for the task in their foreground."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from yumi.rapid.program import Execution
from yumi.rapid.task import StepKind
from yumi.rws.types import ControllerState
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.events import Refused
from yumi.virtual.controller.system import delivered_system, with_programs
from yumi.virtual.world import World, WorldSettings

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


def test_stop_of_the_program_itself_calls_the_routines_and_errors_and_exit_do_not(tmp_path: Path) -> None:
    for statement, seen in (("Stop;", True), ("RAISE 1;", False), ("EXIT;", False)):
        text = f'MODULE Main PROC main() TPWrite "main"; {statement} ENDPROC ENDMODULE'
        controller = started(controller_world(tmp_path, T_ROB_L=[text]))
        assert ("stop" in controller.screens["T_ROB_L"]) == seen, statement
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
