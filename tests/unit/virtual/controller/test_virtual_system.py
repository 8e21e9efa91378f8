"""Programs and parameters of a user: modules, program files, backups, and the tasks they make."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side, joints
from abb_protocols.rws.values import ControllerState, EventType, OperatingMode
from refusals import refused
from virtual_irc5.controller.backup import write_backup
from virtual_irc5.controller.installed_system import (
    ROBOTS,
    System,
    delivered_system,
    factory_system,
    read_backup,
    with_programs,
)
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.mechanics.units import UnitSupervision
from virtual_irc5.rapid.pauses import StepKind
from virtual_irc5.rapid.states import Execution
from virtual_irc5.world import World, WorldSettings

EIO = """EIO:CFG_1.0:6:1::
#
DEVICENET_DEVICE:

      -Name "Board10" -VendorName "ABB Robotics" -ProductName "24 VDC I/O" \\
      -Address 10
#
EIO_SIGNAL:

      -Name "doLamp" -SignalType "DO" -Device "Board10" -DeviceMap "0"

      -Name "aoGlue" -SignalType "AO" -Default 1.5
"""
SYS = """SYS:CFG_1.0:6:0::
#
CAB_TASKS:

      -Name "T_ROB1" -Type "NORMAL" -MotionTask -UseMechanicalUnitGroup "rob1"

      -Name "LOGGER" -Type "SEMISTATIC" -Entry "log" -TrustLevel "SysStop"
#
MECHANICAL_UNIT_GROUP:

      -Name "rob1" -Robot "ROB_1"
"""
HEADER = "%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\n\n"
COUNT = 'MODULE Count PERS num n := 0; PROC main() Incr n; TPWrite "pass " \\Num:=n; WaitTime 0.1; ENDPROC ENDMODULE'


def write(folder: Path, files: Mapping[str, str | bytes]) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def world_of(folder: Path, *, cfg: tuple[str, ...] = (), **programs: str) -> World:
    """A robot with programs of its own: their file names by task."""
    paths = {task: [folder / name for name in names.split(",") if name] for task, names in programs.items()}
    return World(WorldSettings(system=with_programs(delivered_system(), paths, [folder / name for name in cfg])))


def started(world: World, seconds: float = 0.5) -> Irc5:
    world.controller.set_motors(True)
    world.controller.start_rapid()
    run(world, seconds)
    return world.controller


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / world.cycle_time)):
        world.cycle({})


def test_program_of_a_user_runs_in_the_place_of_ours_and_repeats(tmp_path: Path) -> None:
    controller = started(world_of(write(tmp_path, {"a.mod": COUNT}), T_ROB_L="a.mod", T_ROB_R=""), 0.35)
    assert controller.screens["T_ROB_L"] == ("pass 1", "pass 2", "pass 3", "pass 4")
    assert [module.name for module in controller.tasks["T_ROB_R"].modules] == ["user"]


def test_modules_use_each_other_and_signals_of_a_cfg_as_robotstudio_writes_it(tmp_path: Path) -> None:
    main = "MODULE A PROC main() Set doLamp; lamp_is DOutput(doLamp); Stop; ENDPROC ENDMODULE"
    other = 'MODULE user(SYSMODULE) PROC lamp_is(num n) TPWrite "lamp "\\Num:=n; ENDPROC ENDMODULE'
    write(tmp_path, {"a.mod": HEADER + main, "user.sys": other, "EIO.cfg": EIO})
    controller = started(world_of(tmp_path, cfg=("EIO.cfg",), T_ROB_L="a.mod,user.sys", T_ROB_R=""))
    assert controller.screens["T_ROB_L"] == ("lamp 1",)
    assert (controller.signals.get("doLamp").network, controller.signals.get("aoGlue").value) == ("DeviceNet", 1.5)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-8-sig"])
def test_text_is_read_in_either_encoding(tmp_path: Path, encoding: str) -> None:
    text = 'MODULE A PROC main() TPWrite "Größe " \\Num:=StrLen("Größe"); Stop; ENDPROC ENDMODULE'
    controller = started(world_of(write(tmp_path, {"a.mod": text.encode(encoding)}), T_ROB_L="a.mod", T_ROB_R=""))
    assert controller.screens["T_ROB_L"] == ("Größe 5",)


def test_program_file_names_its_modules_in_any_letter_case(tmp_path: Path) -> None:
    pgf = '<?xml version="1.0" encoding="ISO-8859-1" ?>\n<Program>\n <Module>MAIN.mod</Module>\n</Program>'
    world = world_of(write(tmp_path, {"p.pgf": pgf, "main.mod": COUNT}), T_ROB_L="p.pgf", T_ROB_R="")
    assert [module.name for module in world.controller.tasks["T_ROB_L"].modules] == ["user", "Count"]


@pytest.mark.parametrize(
    ("programs", "sentence"),
    [
        ({"T_ROB9": "a.mod"}, "there is no task T_ROB9; there are T_ROB_L, T_ROB_R"),
        ({"T_ROB_L": "none.mod"}, "none.mod cannot be read: No such file"),
        ({"T_ROB_L": "a.txt"}, "a.txt is not a RAPID file: its name has to end in .mod"),
        ({"T_ROB_L": "bad.pgf"}, "bad.pgf is not a program file"),
    ],
)
def test_program_that_cannot_be_installed_is_refused(tmp_path: Path, programs: dict[str, str], sentence: str) -> None:
    write(tmp_path, {"a.mod": COUNT, "a.txt": COUNT, "bad.pgf": "MODULE"})
    with pytest.raises(SettingsError) as caught:
        world_of(tmp_path, **programs)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("cfg", "sentence"),
    [
        ('EIO:CFG_1.0::\nEIO_SIGNAL:\n-Name "x" -SignalType "XX"', "the signal x of the EIO parameters has the"),
        ('SYS:CFG_1.0::\nCAB_TASKS:\n-Name "x" -Type "ODD"', "the task x has the type 'ODD'"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(tmp_path: Path, cfg: str, sentence: str) -> None:
    write(tmp_path, {"x.cfg": cfg})
    with pytest.raises(SettingsError, match=sentence):
        world_of(tmp_path, cfg=("x.cfg",))


def test_parameters_without_a_domain_are_refused(tmp_path: Path) -> None:
    write(tmp_path, {"x.cfg": ""})
    with refused(SettingsError, "cfg_file_without_domain", header=""):
        world_of(tmp_path, cfg=("x.cfg",))


# Backups ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def backup(tmp_path: Path) -> Path:
    """Of a robot with a background task, as RobotStudio writes it."""
    log = "MODULE Log PERS num n; PROC log() IF n > 2 notice; WaitTime 0.05; ENDPROC ENDMODULE"
    notice = 'MODULE More PROC notice() TPWrite "two"; n := 0; ENDPROC ENDMODULE'
    return write(
        tmp_path / "Backup_1",
        {
            "BACKINFO/backinfo.txt": ">>TASK1: (T_ROB1,,)\nPROGMOD/Count.mod @ \n>>TASK2: (LOGGER,,)",
            "SYSPAR/SYS.cfg": SYS,
            "SYSPAR/EIO.cfg": EIO,
            "RAPID/TASK1/PROGMOD/Count.mod": HEADER + COUNT,
            "RAPID/TASK1/SYSMOD/BASE.sys": "MODULE BASE(SYSMODULE) PERS num spare; ENDMODULE",
            "RAPID/TASK2/PROGMOD/Log.mod": log,
            "RAPID/TASK2/PROGMOD/More.mod": notice,
            "HOME/data/list.txt": "1;2",
        },
    )


def test_backup_brings_its_tasks_modules_signals_and_files(backup: Path) -> None:
    world = World(WorldSettings(system=read_backup(backup)))
    controller = world.controller
    modules = {name: [module.name for module in task.modules] for name, task in controller.tasks.items()}
    assert modules == {"T_ROB1": ["user", "BASE", "Count"], "LOGGER": ["user", "Log", "More"]}
    assert controller.files["HOME:/data/list.txt"] == "1;2"
    assert controller.signals.get("doLamp").value == 0.0
    assert controller.execution.installed["T_ROB1"].unit is not None
    assert controller.execution.installed["LOGGER"].unit is None


def test_backup_has_modules_of_all_tasks_in_task0_and_those_of_its_configuration_in_home(backup: Path) -> None:
    common = "MODULE Common(SYSMODULE) PROC note(string text) TPWrite GetTaskName() + text; ENDPROC ENDMODULE"
    configured = (
        '#\nCAB_TASK_MODULES:\n\n -File "HOME:/loaded.sys" -Task "LOGGER"\n\n -File "HOME:/Log.mod" -Task "LOGGER"\n'
    )
    write(
        backup,
        {
            "RAPID/TASK0/SYSMOD/common.sys": common,
            "SYSPAR/SYS.cfg": SYS + configured,
            "HOME/loaded.sys": "MODULE Loaded(SYSMODULE) PERS num also; ENDMODULE",
            "HOME/Log.mod": "MODULE Other ENDMODULE",
        },
    )
    controller = World(WorldSettings(system=read_backup(backup))).controller
    modules = {name: [module.name for module in task.modules] for name, task in controller.tasks.items()}
    assert modules == {"T_ROB1": ["Common", "BASE", "Count"], "LOGGER": ["Loaded", "Common", "Log", "More"]}


def test_background_task_runs_by_itself_and_shares_persistents(backup: Path) -> None:
    world = World(WorldSettings(system=read_backup(backup)))
    controller = started(world, 0.32)
    assert controller.screens["LOGGER"] == ("two",)
    assert controller.screens["T_ROB1"] == ("pass 1", "pass 2", "pass 3", "pass 1")
    controller.stop_rapid()
    assert controller.tasks["LOGGER"].execution is Execution.STARTED
    assert controller.tasks["T_ROB1"].execution is Execution.STOPPED


def test_error_of_a_background_task_stops_the_others_as_its_trust_level_says(backup: Path) -> None:
    (backup / "RAPID/TASK2/PROGMOD/More.mod").write_text("MODULE More PROC notice() RAISE 1; ENDPROC ENDMODULE")
    controller = started(World(WorldSettings(system=read_backup(backup))))
    assert not controller.is_running
    assert controller.controller_state is ControllerState.MOTORS_ON  # SysStop


def test_semistatic_task_begins_anew_after_a_restart(backup: Path) -> None:
    text = 'MODULE Log VAR num k; PROC log() Incr k; TPWrite "k "\\Num:=k; WaitTime 100; ENDPROC ENDMODULE'
    (backup / "RAPID/TASK2/PROGMOD/Log.mod").write_text(text)
    world = World(WorldSettings(system=read_backup(backup)))
    run(world, 0.1)
    world.controller.restart(0.5)
    run(world, 1.0)
    assert world.controller.screens["LOGGER"] == ("k 1", "k 1")


@pytest.mark.parametrize(
    "move",
    [
        "MoveAbsJ [[0,0,0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]], v100, fine, tool0;",
        "CorrCon one;",
        "CorrClear;",
        "SpeedLimCheckPoint 100;",
        "SpeedLimAxis ROB_R, 1, 10;",
        "TuneServo ROB_R, 1, 50;",
        "TuneReset;",
        "PathRecStart here;",
    ],
)
def test_task_without_a_robot_cannot_move_one(backup: Path, move: str) -> None:
    handler = 'ERROR IF ERRNO = ERR_NOT_MOVETASK TPWrite "may not"; TRYNEXT;'
    (backup / "RAPID/TASK2/PROGMOD/Log.mod").write_text(
        f"MODULE Log VAR corrdescr one; VAR pathrecid here; PROC log() {move} WaitTime 9; {handler} ENDPROC ENDMODULE"
    )
    world = World(WorldSettings(system=read_backup(backup)))
    run(world, 0.1)
    assert world.controller.screens["LOGGER"] == ("may not",)


def test_tasks_of_a_backup_without_backinfo_are_in_the_order_of_their_declarations(backup: Path) -> None:
    (backup / "BACKINFO/backinfo.txt").unlink()
    modules = read_backup(backup).modules or {}
    assert [path.rpartition("/")[2] for path in modules["LOGGER"]] == ["user.sys", "Log.mod", "More.mod"]


def test_directory_that_is_no_backup_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="is not a backup of a controller: it has neither RAPID nor SYSPAR"):
        read_backup(tmp_path)


# The module `user` ------------------------------------------------------------------------------------------------

REGISTERS = """MODULE Registers
PROC main()
  reg1 := reg1 + 1;
  reg5 := reg1 + reg2 + reg3 + reg4;
  ClkReset clock1;
  ClkStart clock1;
  WaitTime 0.1;
  ClkStop clock1;
  TPWrite "reg5 "\\Num:=reg5;
  TPWrite "after "\\Num:=Round(ClkRead(clock1)\\Dec:=1);
  Stop;
ENDPROC
ENDMODULE
"""


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_robot_has_registers_and_a_stopwatch_in_the_system_module_user(tmp_path: Path, robot: str) -> None:
    model = ROBOTS[robot]
    tasks = {unit.task for unit in model.units}
    (tmp_path / "a.mod").write_text(REGISTERS)
    programs = {task: [tmp_path / "a.mod"] for task in tasks}
    controller = started(World(WorldSettings(system=with_programs(factory_system(model), programs))))
    assert {task: controller.screens[task] for task in tasks} == dict.fromkeys(tasks, ("reg5 1", "after 0.1"))
    assert {task: controller.tasks[task].modules[0].is_system for task in tasks} == dict.fromkeys(tasks, True)


def test_program_that_declares_a_register_as_local_has_its_own(tmp_path: Path) -> None:
    text = REGISTERS.replace("PROC main", "LOCAL VAR num reg1 := 4;\nPROC main", 1)
    controller = started(world_of(write(tmp_path, {"a.mod": text}), T_ROB_L="a.mod", T_ROB_R=""))
    assert controller.screens["T_ROB_L"][0] == "reg5 5"
    assert controller.tasks["T_ROB_L"].read("user", "reg1") == "0"


def test_program_with_a_module_user_of_its_own_has_it_in_its_task_alone(tmp_path: Path) -> None:
    own = "MODULE USER(SYSMODULE) PERS num reg1 := 40; VAR num reg2; VAR num reg3; VAR num reg4; VAR num reg5;"
    files = {"a.mod": REGISTERS, "mine.sys": f"{own} VAR clock clock1; ENDMODULE"}
    world = world_of(write(tmp_path, files), T_ROB_L="a.mod,mine.sys", T_ROB_R="a.mod")
    controller = started(world)
    assert [controller.screens[task][0] for task in ("T_ROB_L", "T_ROB_R")] == ["reg5 41", "reg5 1"]
    assert [module.name for module in controller.tasks["T_ROB_L"].modules] == ["Registers", "USER"]


def test_backup_with_a_module_user_has_its_own(backup: Path) -> None:
    write(backup, {"RAPID/TASK1/SYSMOD/User.sys": "MODULE user(SYSMODULE) PERS num mine := 7; ENDMODULE"})
    controller = World(WorldSettings(system=read_backup(backup))).controller
    assert controller.tasks["T_ROB1"].read("user", "mine") == "7"
    assert controller.tasks["LOGGER"].symbols("user") == ("reg1", "reg2", "reg3", "reg4", "reg5", "clock1")


def test_robot_from_the_factory_has_the_module_user_and_no_program(tmp_path: Path) -> None:
    controller = World(WorldSettings(system=factory_system())).controller
    assert {name: [each.name for each in task.modules] for name, task in controller.tasks.items()} == {
        "T_ROB_R": ["user"],
        "T_ROB_L": ["user"],
    }
    assert [event.title for event in controller.events.entries() if event.type is not EventType.INFORMATION] == []
    assert controller.files["HOME:/user.sys"].startswith("MODULE user")


def test_backup_of_the_controller_has_the_module_user_among_system_modules(tmp_path: Path) -> None:
    controller = World(WorldSettings(system=factory_system())).controller
    write_backup(controller, "BACKUP:/one")
    assert "VAR num reg1" in controller.files["BACKUP:/one/RAPID/TASK1/SYSMOD/user.sys"]


def test_module_user_is_there_again_after_programs_are_discarded(tmp_path: Path) -> None:
    world = World(WorldSettings(system=factory_system()))
    world.controller.tasks["T_ROB_R"].unload("user")
    world.controller.restart(0.1, discards_programs=True)
    run(world, 1.0)
    assert [each.name for each in world.controller.tasks["T_ROB_R"].modules] == ["user"]


# Starting, stopping, stepping ---------------------------------------------------------------------------------------

STEPS = """MODULE Steps
VAR num n;
PROC main()
  n := 1;
  inner;
  n := 3;
ENDPROC
PROC inner()
  n := 2;
  n := 2.5;
ENDPROC
ENDMODULE
"""


@pytest.fixture
def stepping(tmp_path: Path) -> World:
    world = world_of(write(tmp_path, {"steps.mod": STEPS}), T_ROB_L="steps.mod", T_ROB_R="")
    world.controller.set_motors(True)
    return world


def places(world: World, *steps: StepKind) -> list[int]:
    """The line of the program pointer after each step."""
    lines = []
    for step in steps:
        world.controller.start_rapid(step=step)
        run(world, 0.02)
        assert not world.controller.is_running
        lines.append(world.controller.tasks["T_ROB_L"].call_stack[0].line)
    return lines


def test_steps_go_into_over_and_out_of_routines(stepping: World) -> None:
    into, over, out = StepKind.IN, StepKind.OVER, StepKind.OUT
    assert places(stepping, over, into, out) == [5, 9, 6]
    stepping.controller.move_pp_to_main()
    assert places(stepping, into, over) == [5, 6]


def test_call_stack_names_routines_from_the_inside(stepping: World) -> None:
    places(stepping, StepKind.IN, StepKind.IN)
    stack = [(each.module, each.routine, each.line) for each in stepping.controller.tasks["T_ROB_L"].call_stack]
    assert stack == [("Steps", "inner", 9), ("Steps", "main", 5)]


def test_program_stops_at_a_breakpoint_and_goes_on_from_it(stepping: World) -> None:
    task = stepping.controller.tasks["T_ROB_L"]
    task.set_breakpoint("Steps", 10)
    for _ in range(2):
        stepping.controller.start_rapid("once", stop_at_breakpoints=True)
        run(stepping, 0.02)
    assert (task.read("Steps", "n"), task.execution) == ("3", Execution.READY)
    stepping.controller.start_rapid("once", stop_at_breakpoints=True)
    run(stepping, 0.02)
    assert (task.read("Steps", "n"), task.call_stack[0].line) == ("2", 10)


def test_cycle_once_ends_after_main_and_forever_goes_on(stepping: World) -> None:
    stepping.controller.start_rapid("once")
    run(stepping, 0.1)
    assert (stepping.controller.is_running, stepping.controller.cycle) == (False, "once")
    stepping.controller.start_rapid("forever")
    run(stepping, 0.1)
    assert stepping.controller.is_running


def test_pointer_is_set_to_a_routine(stepping: World) -> None:
    controller = stepping.controller
    controller.execution.move_pp_to_routine("T_ROB_L", "inner")
    assert controller.tasks["T_ROB_L"].call_stack[0].routine == "inner"
    with pytest.raises(Refused, match=r"has no procedure nothing\(\) without parameters"):
        controller.execution.move_pp_to_routine("T_ROB_L", "nothing")
    assert controller.tasks["T_ROB_L"].call_stack[0].routine == "inner"


def test_task_that_is_taken_out_on_the_task_panel_is_not_started(tmp_path: Path) -> None:
    write(tmp_path, {"a.mod": COUNT, "b.mod": COUNT.replace("PERS", "TASK PERS")})
    world = world_of(tmp_path, T_ROB_L="a.mod", T_ROB_R="b.mod")
    world.controller.execution.select("T_ROB_R", is_active=False)
    controller = started(world, 0.05)
    assert (controller.screens["T_ROB_L"], controller.screens["T_ROB_R"]) == (("pass 1",), ())
    with pytest.raises(Refused) as refused:
        controller.execution.select("T_ROB_L", is_active=False)
    assert refused.value.reason is RefusalReason.NOT_STOPPED


def test_module_with_the_pointer_is_replaced_and_the_pointer_is_lost(stepping: World) -> None:
    controller = stepping.controller
    controller.files["HOME:/steps.mod"] = STEPS.replace("n := 1", "n := 7")
    controller.load_module("T_ROB_L", "$HOME/steps.mod", replace=True)
    assert controller.tasks["T_ROB_L"].execution is Execution.UNINITIALIZED
    controller.move_pp_to_main()
    places(stepping, StepKind.OVER)
    assert controller.tasks["T_ROB_L"].read("Steps", "n") == "7"


# Persistents of several tasks ---------------------------------------------------------------------------------------


def shared(tmp_path: Path, left: str, right: str) -> World:
    modules = {"l.mod": f"MODULE L {left} ENDMODULE", "r.mod": f"MODULE R {right} ENDMODULE"}
    return world_of(write(tmp_path, modules), T_ROB_L="l.mod", T_ROB_R="r.mod")


def test_persistents_of_one_name_are_one_value_unless_local_or_of_the_task(tmp_path: Path) -> None:
    data = "PERS num a := {0}; TASK PERS num b := {0}; LOCAL PERS num c := {0}; PERS num d{{2}};"
    write_all = "PROC main() a := 5; b := 5; c := 5; d{2} := 5; Stop; ENDPROC"
    world = shared(tmp_path, data.format(1) + write_all, data.format(2) + "PROC main() Stop; ENDPROC")
    controller = started(world)
    values = [controller.tasks["T_ROB_R"].read("R", name) for name in "abcd"]
    assert values == ["5", "2", "2", "[0,5]"]


def test_first_value_of_a_shared_persistent_may_stand_in_one_task(tmp_path: Path) -> None:
    world = shared(tmp_path, "PERS num a := 3; PROC main() ENDPROC", "PERS num a; PROC main() ENDPROC")
    assert [task.read(name[-1], "a") for name, task in world.controller.tasks.items()] == ["3", "3"]


def test_shared_persistents_of_different_types_are_refused(tmp_path: Path) -> None:
    world = shared(tmp_path, "PERS num a := 3; PROC main() ENDPROC", 'PERS string a := ""; PROC main() ENDPROC')
    with pytest.raises(Refused, match="'a' is a num, in another task a string: make one a TASK PERS"):
        world.controller.move_pp_to_main()


_TWO_TASKS = SYS.replace('-UseMechanicalUnitGroup "rob1"', '-UseMechanicalUnitGroup "rob_r"').replace("SysStop", "None")
_TWO_TASKS = _TWO_TASKS.replace('-Name "rob1" -Robot "ROB_1"', '-Name "rob_r" -Robot "ROB_R"')
_OUTPUTS = """EIO:CFG_1.0:6:1::
#
SYSSIG_OUT:

      -Status "TaskExecuting" -Signal "runs" -Arg2 "T_ROB1"

      -Status "Error" -Signal "failed" -Arg2 "T_ROB1"

      -Status "MotOnState" -Signal "powered"
#
EIO_SIGNAL:

      -Name "runs" -SignalType "DO"

      -Name "failed" -SignalType "DO"

      -Name "powered" -SignalType "DO"
"""
_FAILS = "MODULE Fails VAR num zero := 0; PROC main() WaitTime 0.1; zero := 1 / zero; ENDPROC ENDMODULE"
_ASKS = """MODULE Asks
    PERS string answers := "";
    PROC log()
        VAR jointtarget place;
        VAR rawbytes bytes;
        VAR string text := "not empty";
        place := CJointT(\\TaskRef:=T_ROB1Id);
        PackRawBytes 1, bytes, 1 \\Float4;
        UnpackRawBytes bytes, 1, text \\ASCII:=0;
        Save \\TaskName:="T_ROB1", "Fails" \\FilePath:="HOME:/saved.mod";
        answers := ValToStr(place.robax.rax_2) + "<" + text + ">";
        place := CJointT(\\TaskName:="T_ROB9");
    ENDPROC
ENDMODULE"""


def _two_tasks() -> World:
    """A YuMi with a task for the right arm and one in the background."""
    files = {"HOME:/fails.mod": _FAILS.encode(), "HOME:/asks.mod": _ASKS.encode()}
    modules = {"T_ROB1": ("HOME:/fails.mod",), "LOGGER": ("HOME:/asks.mod",)}
    return World(WorldSettings(system=System((_OUTPUTS,), files, (_TWO_TASKS,), modules, is_factory=True)))


def test_two_tasks_of_one_arm_are_refused() -> None:
    twice = _TWO_TASKS.replace("LOGGER", "T_ROB2").replace(
        "SEMISTATIC", 'NORMAL" -MotionTask -UseMechanicalUnitGroup "rob_r'
    )
    with pytest.raises(SettingsError, match="T_ROB2 moves ROB_R, which another task of CAB_TASKS moves already"):
        World(WorldSettings(system=System((), {}, (twice,), is_factory=True)))


def test_system_outputs_show_what_a_task_does() -> None:
    world = _two_tasks()
    controller = world.controller

    def outputs() -> list[float]:
        return [controller.signals.get(name).value for name in ("runs", "failed", "powered")]

    assert outputs() == [0, 0, 0]
    controller.set_motors(True)
    controller.start_rapid("once")
    world.cycle({})
    assert outputs() == [1, 0, 1]
    while controller.is_running:
        world.cycle({})
    assert outputs() == [0, 1, 1]
    controller.move_pp_to_main()
    world.cycle({})
    assert outputs() == [0, 0, 1]


def _following(*outputs: str) -> World:
    """A YuMi with one system output for each ``Status`` and its arguments, in signals ``out0``, ``out1`` and so on."""
    bound = "".join(f' -Status {each} -Signal "out{number}"\n' for number, each in enumerate(outputs))
    signals = "".join(f' -Name "out{number}" -SignalType "DO"\n' for number in range(len(outputs)))
    eio = f"EIO:CFG_1.0:6:1::\nSYSSIG_OUT:\n{bound}#\nEIO_SIGNAL:\n{signals}"
    return World(WorldSettings(system=System((eio,), {}, is_factory=True)))


def _outputs(world: World) -> list[float]:
    """The system outputs after a cycle."""
    world.cycle({})
    signals = world.controller.signals
    return [signals.get(name).value for name in signals.names if name.startswith("out")]


def test_system_output_of_the_run_chain_follows_the_stops() -> None:
    world = _following('"RunchOk"', '"EmStop"', '"MotorOn"', '"MotorOff"', '"MotOffState"')
    controller = world.controller
    assert _outputs(world) == [1, 0, 0, 1, 1]
    controller.set_motors(True)
    assert _outputs(world) == [1, 0, 1, 0, 0]
    controller.press_emergency_stop()
    assert _outputs(world) == [0, 1, 0, 1, 1]
    controller.release_emergency_stop()
    assert _outputs(world) == [1, 0, 0, 1, 1]


def test_system_output_of_the_run_chain_is_off_in_manual_mode_without_the_enabling_device() -> None:
    world = _following('"RunchOk"', '"AutoOn"')
    assert _outputs(world) == [1, 1]
    world.controller.select_mode(OperatingMode.MANUAL_REDUCED)
    assert _outputs(world) == [0, 0]
    world.controller.select_mode(OperatingMode.AUTO)
    assert _outputs(world) == [1, 1]


def test_system_outputs_show_the_motion_supervision_of_a_unit() -> None:
    world = _following(
        '"MotSupOn" -Arg1 "ROB_L"', '"MotSupTrigg" -Arg1 "ROB_L"', '"MotSupTrigg" -Arg1 "rob_r"', '"MotSupTrigg"'
    )
    controller = world.controller
    assert _outputs(world) == [0, 0, 0, 0]
    controller.set_motors(True)
    assert _outputs(world) == [1, 0, 0, 0]
    controller.collide(Side.LEFT)
    assert _outputs(world) == [1, 1, 0, 1]
    controller.acknowledge_collision()
    controller.motion.supervision["ROB_L"] = UnitSupervision(jogging=False)
    assert _outputs(world) == [0, 0, 0, 0]


def test_system_outputs_without_a_unit_show_all_of_them() -> None:
    world = _following(
        '"MechUnitNotMoving"', '"MechUnitNotMoving" -Arg1 "ROB_R"', '"MechUnitActive" -Arg1 "ROB_L_7"', '"LimitSpeed"'
    )
    controller = world.controller
    assert _outputs(world) == [1, 1, 1, 0]
    controller.set_motors(True)
    left = next(unit for unit in controller.units if unit.name == "ROB_L")
    arm = controller.arm_of(left)
    arm.move_to(joints([each + 0.2 for each in arm.planned]))
    controller.units = tuple(
        replace(unit, is_active=False) if unit.name == "ROB_L_7" else unit for unit in controller.units
    )
    assert _outputs(world) == [0, 1, 0, 0]


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        ('"TCPSpeed" -Arg1 "ROB_L"', "does not follow the Status 'TCPSpeed', only AutoOn, CycleOn, EmStop"),
        ('"MotSupOn" -Arg1 "ROB_1"', "there is no mechanical unit 'ROB_1' (Arg1); there are ROB_L, ROB_L_7, ROB_R"),
    ],
)
def test_system_output_that_is_not_followed_is_in_the_event_log(output: str, sentence: str) -> None:
    world = _following(output)
    event = next(each for each in world.controller.events.entries() if each.title == "System output rejected")
    assert "The system output out0 of the EIO parameters stays as it is" in event.description
    assert sentence in event.description
    assert _outputs(world) == [0]


def test_system_input_resets_the_error_of_programs() -> None:
    world = _two_tasks()
    controller = world.controller
    eio = 'EIO:CFG_1.0:6:1::\nSYSSIG_IN:\n -Signal "reset" -Action "ResetError"\n#\nEIO_SIGNAL:\n'
    controller.configuration.load(f'{eio} -Name "reset" -SignalType "DI"\n')
    controller.restart(0.1)
    run(world, 0.5)
    controller.set_motors(True)
    controller.start_rapid("once")
    while controller.is_running:
        world.cycle({})
    world.cycle({})
    assert controller.signals.get("failed").value == 1
    controller.signals.drive("reset", 1.0)
    run(world, 0.02)
    assert controller.signals.get("failed").value == 0


INPUTS = """EIO:CFG_1.0:6:1::
SYSSIG_IN:

      -Signal "power" -Action "MotorOn"

      -Signal "go" -Action "StartMain" -Arg1 "CONT"

      -Signal "resume" -Action "Start" -Arg1 "CYCLE"

      -Signal "halt" -Action "Stop"

      -Signal "last" -Action "StopCycle"

      -Signal "off" -Action "MotorOff"

      -Signal "reset" -Action "ResetEstop"
#
EIO_SIGNAL:
"""


def test_system_inputs_switch_motors_and_start_and_stop_the_program(tmp_path: Path) -> None:
    names = ("power", "go", "resume", "halt", "last", "off", "reset")
    signals = "".join(f'\n -Name "{name}" -SignalType "DI"\n' for name in names)
    folder = write(tmp_path, {"a.mod": COUNT, "EIO.cfg": INPUTS + signals})
    world = world_of(folder, cfg=("EIO.cfg",), T_ROB_L="a.mod", T_ROB_R="")
    controller = world.controller

    def press(name: str, seconds: float = 0.02) -> None:
        controller.signals.drive(name, 1.0)
        run(world, seconds)
        controller.signals.drive(name, 0.0)
        run(world, 0.02)

    press("go")
    assert not controller.is_running
    assert "motors on only" in controller.events.entries()[0].description
    press("power")
    assert controller.controller_state is ControllerState.MOTORS_ON
    press("go", 0.35)
    assert len(controller.screens["T_ROB_L"]) == 4
    press("halt")
    assert not controller.is_running
    press("resume", 0.3)
    assert controller.cycle == "once"
    assert not controller.is_running
    press("go", 0.3)
    press("last", 0.3)
    assert not controller.is_running
    assert controller.cycle == "forever"
    controller.start_rapid()
    run(world, 0.5)
    assert controller.is_running, "only the run before ended with its cycle"
    press("off")
    assert controller.controller_state is ControllerState.MOTORS_OFF
    controller.press_emergency_stop()
    press("reset")
    assert controller.controller_state is ControllerState.EMERGENCY_STOP, "a signal pulls no button out"
    assert "reset once its button is pulled out" in controller.events.entries()[0].description
    controller.release_emergency_stop()
    press("reset")
    assert controller.controller_state is ControllerState.MOTORS_OFF


def test_a_background_task_reads_and_saves_of_another_task() -> None:
    world = _two_tasks()
    controller = world.controller
    controller.set_motors(True)
    for _ in range(10):
        world.cycle({})
    assert controller.tasks["LOGGER"].read("Asks", "answers") == '"-130<>"'
    assert "PROC main()" in controller.files["HOME:/saved.mod"]
    error = controller.events.entries()[0]
    assert (error.arguments, error.code) == (("LOGGER", "ERR_TASKNAME", "/Asks/log/12"), 40228)
    # TrustLevel None: the error of the task stops nothing else.
    assert controller.controller_state is ControllerState.MOTORS_ON
