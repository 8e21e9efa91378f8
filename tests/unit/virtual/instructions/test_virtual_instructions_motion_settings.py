"""What a program sets for its motions, seen on the path."""

import numpy as np
import pytest
from drawn_path import Drawing, at, from_line
from instruction_bench import InstructionBench

from abb_protocols.robot.joints import CYCLE
from virtual_irc5.rapid.states import Execution
from virtual_irc5.world import World

TO_START = r"ConfL\Off; ConfJ\Off; MoveAbsJ [[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]],vmax,fine,tool0; "
BEGIN = r"ConfL\Off; point:=CRobT(\Tool:=tool0\WObj:=wobj0); "
DOWN = "MoveL Offs(point,0,0,-100),v200,fine,tool0;"


@pytest.fixture
def bench() -> InstructionBench:
    bench = InstructionBench()
    bench.run(TO_START)
    return bench


@pytest.mark.parametrize(
    ("settings", "mm_s"), [("VelSet 50,5000;", 100.0), ("VelSet 100,50;", 50.0), ("SpeedRefresh 25;", 50.0)]
)
def test_speed_follows_its_settings(bench: InstructionBench, settings: str, mm_s: float) -> None:
    drawing = Drawing(BEGIN + settings + DOWN, bench=bench)
    assert np.max(drawing.speeds) == pytest.approx(mm_s, rel=0.02)
    assert np.max(from_line(drawing.points, drawing.points[0], drawing.points[0] + at(0, 0, -100))) < 0.1


def test_speed_is_refreshed_on_the_way(bench: InstructionBench) -> None:
    drawing = Drawing(
        BEGIN + DOWN.replace("MoveL ", r"MoveL\Conc, ") + r"WaitTime 0.25; SpeedRefresh 10; WaitRob\InPos;", bench=bench
    )
    assert np.max(drawing.speeds) == pytest.approx(200.0, rel=0.02)
    middle = drawing.speeds[len(drawing.speeds) // 2]
    assert middle == pytest.approx(20.0, rel=0.02)
    assert np.max(from_line(drawing.points, drawing.points[0], drawing.points[0] + at(0, 0, -100))) < 0.1


def accelerations(drawing: Drawing) -> float:
    return float(np.max(np.abs(np.diff(drawing.speeds)))) / CYCLE / 1e3  # [m/s²]


@pytest.mark.parametrize(
    ("settings", "most"), [(r"PathAccLim TRUE\AccMax:=1,TRUE\DecelMax:=1;", 1.0), (r"WorldAccLim\On:=0.5;", 0.5)]
)
def test_acceleration_of_the_tool_is_limited(bench: InstructionBench, settings: str, most: float) -> None:
    plain = Drawing(BEGIN + DOWN.replace("v200", "v500"), bench=bench)
    bench.run(TO_START)
    drawing = Drawing(BEGIN + settings + DOWN.replace("v200", "v500"), bench=bench)
    assert accelerations(drawing) <= most < accelerations(plain)


def test_acceleration_setting_makes_moves_gentler(bench: InstructionBench) -> None:
    plain = Drawing(BEGIN + DOWN.replace("v200", "v500"), bench=bench)
    bench.run(TO_START)
    gentle = Drawing(BEGIN + "AccSet 30,100;" + DOWN.replace("v200", "v500"), bench=bench)
    assert accelerations(gentle) == pytest.approx(0.3 * accelerations(plain), rel=0.1)


def test_too_low_acceleration_is_an_error(bench: InstructionBench) -> None:
    bench.run(r"PathAccLim TRUE\AccMax:=0.05,FALSE;")
    assert "ERR_ACC_TOO_LOW" in bench.failure


def test_displacement_moves_the_targets_until_it_is_off(bench: InstructionBench) -> None:
    drawing = Drawing(
        BEGIN + "PDispSet [[0,-40,0],[1,0,0,0]]; MoveL point,v200,fine,tool0; PDispOff; MoveL point,v200,fine,tool0;",
        bench=bench,
    )
    assert drawing.distance_to(drawing.points[0] + at(0, -40, 0)) < 0.01
    assert drawing.points[-1] == pytest.approx(drawing.points[0], abs=0.01)


def test_displacement_from_two_positions_moves_what_follows(bench: InstructionBench) -> None:
    drawing = Drawing(
        BEGIN + r"PDispOn\ExeP:=Offs(point,30,0,0),point,tool0; MoveL Offs(point,0,-40,0),v200,fine,tool0; "
        r"tip:=CRobT(\Tool:=tool0\WObj:=wobj0);",
        bench=bench,
    )
    assert drawing.points[-1] == pytest.approx(drawing.points[0] + at(30, -40, 0), abs=0.01)
    read = [float(x) for x in bench.read("tip").split("],")[0].strip("[").split(",")]
    assert read == pytest.approx(drawing.points[0] + at(0, -40, 0), abs=0.02)  # without the displacement


def test_offset_of_the_seventh_axis_is_added(bench: InstructionBench) -> None:
    bench.run(r"EOffsSet [5,0,0,0,0,0]; MoveAbsJ [[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]],v500,fine,tool0;")
    assert np.degrees(bench.unit.arm.planned[2]) == pytest.approx(-105.0, abs=1e-4)
    bench.run(
        r"EOffsSet [5,0,0,0,0,0]; MoveAbsJ [[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]]\NoEOffs,v500,fine,tool0;"
    )
    assert np.degrees(bench.unit.arm.planned[2]) == pytest.approx(-110.0, abs=1e-4)


def test_circle_turns_the_tool_as_its_mode_says(bench: InstructionBench) -> None:
    arc = r"MoveC Offs(point,40,0,-40),RelTool(Offs(point,0,0,-80),0,0,0\Rz:=30),v100,fine,tool0;"
    for mode in (r"CirPathMode\ObjectFrame; ", r"CirPathMode\PathFrame; ", r"CirPathMode\CirPointOri; "):
        bench.run(TO_START)
        drawing = Drawing(BEGIN + mode + arc, bench=bench)
        turn = drawing.frames[0, :3, :3].T @ drawing.frames[-1, :3, :3]
        assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) == pytest.approx(30.0, abs=0.01)
        centre = drawing.points[0] + at(0, 0, -40)
        assert np.linalg.norm(drawing.points - centre, axis=1) == pytest.approx(40.0, abs=0.1)


@pytest.mark.parametrize(
    "statement",
    [
        r"SingArea\Wrist;",
        r"SoftAct\MechUnit:=ROB_R,3,40\Ramp:=120; SoftDeact\Ramp:=100;",
        r"MotionSup\On\TuneValue:=200; MotionSup\Off;",
        "GripLoad load0;",
        "MechUnitLoad ROB_R,1,load0;",
        "ActUnit ROB_R;",
        "CornerPathWarning FALSE;",
        "PathResol 50;",
        r"TuneServo ROB_R,1,110\Type:=TUNE_KP; TuneReset;",
        "MotionProcessModeSet LOW_SPEED_ACCURACY_MODE;",
        r"StopMoveReset\AllMotionTasks;",
    ],
)
def test_setting_is_accepted_and_the_next_move_goes_to_its_target(bench: InstructionBench, statement: str) -> None:
    drawing = Drawing(BEGIN + statement + DOWN, bench=bench)
    assert bench.failure == ""
    assert drawing.points[-1] == pytest.approx(drawing.points[0] + at(0, 0, -100), abs=0.01)


@pytest.mark.parametrize(
    ("statement", "sentence"),
    [
        ("SoftAct 9,50;", "an axis of the robot"),
        (r"MotionSup\On\TuneValue:=500;", "1 to 300 %"),
        ("SpeedRefresh 150;", "ERR_SPEED_REFRESH_LIM"),
        ("DeactUnit ROB_R;", "cannot be deactivated"),
        ("RestoPath;", "no path is stored"),
    ],
)
def test_impossible_setting_is_refused(bench: InstructionBench, statement: str, sentence: str) -> None:
    bench.run(statement)
    assert sentence in bench.failure


def test_functions_tell_what_holds(bench: InstructionBench) -> None:
    bench.run("SpeedRefresh 40; number:=CSpeedOverride(); text:=RobName(); flag:=TaskRunRob();")
    assert (bench.read("number"), bench.read("text"), bench.read("flag")) == ("40", '"ROB_R"', "TRUE")
    bench.run("number:=MaxRobSpeed();")
    assert bench.read("number") == "1500"
    bench.run("StorePath; number:=PathLevel(); RestoPath;")
    assert bench.read("number") == "2"


def test_joints_and_targets_are_each_others_inverse(bench: InstructionBench) -> None:
    bench.run(
        r"point:=CRobT(\Tool:=my_tool\WObj:=wobj0); target:=CalcJointT(point,my_tool); tip:=CalcRobT(target,my_tool);"
    )
    assert bench.failure == ""
    robax = [float(x) for x in bench.read("target").strip("[]").split("],")[0].strip("[").split(",")]
    assert robax == pytest.approx([20, -100, 20, 0, 60, 0], abs=0.01)
    assert bench.read("tip")[:20] == bench.read("point")[:20]


def test_target_out_of_reach_has_no_joints(bench: InstructionBench) -> None:
    bench.run("point:=Offs(CRobT(),2000,0,0); target:=CalcJointT(point,tool0);")
    assert "ERR_OUTSIDE_REACH" in bench.failure


def test_joints_of_a_target_are_of_the_configuration_it_names_also_without_supervision(bench: InstructionBench) -> None:
    bench.run(
        "ConfL\\Off; ConfJ\\Off; point:=CRobT(); target:=CalcJointT(point,tool0); "
        "point.robconf:=[2,2,2,2]; target:=CalcJointT(point,tool0);"
    )
    assert "ERR_ROBLIMIT" in bench.failure
    assert "with the configuration [2, 2, 2, 2], but with" in bench.failure


STOPPED_ON_ANOTHER_PATH = r"""MODULE Program
    PERS bool again:=FALSE;
    VAR pathrecid begin;
    PROC main()
        VAR robtarget p;
        p:=CRobT();
        IF NOT again THEN
            again:=TRUE;
            PathRecStart begin;
            MoveL Offs(p,0,0,-20),v200,fine,tool0;
            StorePath;
            WaitTime 100;
        ENDIF
        TPWrite ValToStr(PathLevel())+ValToStr(PathRecValidBwd());
        MoveL Offs(p,0,0,20),v200,fine,tool0;
        TPWrite ValToStr(PathRecValidBwd());
        PathRecStart begin;
        MoveL p,v200,fine,tool0;
        TPWrite ValToStr(PathRecValidBwd(\ID:=begin));
        StorePath;
        RestoPath;
        TPWrite "end";
    ENDPROC
ENDMODULE
"""


def test_program_that_begins_at_main_again_has_no_stored_path_and_no_recorded_one() -> None:
    world = World()
    controller = world.controller
    task, other = controller.tasks["T_ROB_R"], controller.tasks["T_ROB_L"]
    for each in (task, other):
        each.lose_pp()
        for module in each.modules:
            each.unload(module.name)
    task.load(STOPPED_ON_ANOTHER_PATH, "program.mod")
    controller.set_motors(True)
    for seconds in (1.0, 3.0):
        controller.move_pp_to_main()
        controller.start_rapid("once")
        for _ in range(round(seconds / CYCLE)):
            world.cycle({})
        stopped_at = task.execution
        controller.stop_rapid()
    assert list(controller.screens["T_ROB_R"]) == ["1FALSE", "FALSE", "TRUE", "end"], controller.events.entries()[:2]
    assert stopped_at is Execution.READY


def test_arm_goes_back_to_a_stored_path_from_elsewhere_without_a_jump(bench: InstructionBench) -> None:
    bench.start(
        BEGIN + r"MoveL\Conc,Offs(point,0,0,-60),v100,fine,tool0; WaitTime 0.2; StopMove; StorePath; "
        r"found:=CRobT(\Tool:=tool0\WObj:=wobj0); MoveL Offs(found,0,20,0),v200,fine,tool0; "
        r"RestoPath; StartMove; WaitTime 0.05; WaitRob\InPos;"
    )
    arm = bench.unit.arm
    begin, before, steps = arm.kinematics.tool0(arm.planned).position, np.array(arm.planned), []
    while bench.task.is_running:
        bench.step()
        steps.append(np.abs(np.array(arm.planned) - before))
        before = np.array(arm.planned)
    assert bench.failure == ""
    assert np.all(np.max(steps, axis=0) <= np.array(arm.model.limits.velocity) * 0.0041)
    end = arm.kinematics.tool0(arm.planned).position
    assert np.subtract(end, begin) * 1e3 == pytest.approx([0.0, 0.0, -60.0], abs=0.05)
