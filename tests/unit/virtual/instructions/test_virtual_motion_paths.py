"""Where moves take the tool and how fast, against geometry of the tests' own."""

import numpy as np
import pytest
from drawn_path import Drawing, at, from_line
from instruction_bench import InstructionBench

from abb_protocols.robot.joints import YUMI_LIMITS, Side
from virtual_irc5.mechanics.path import PREFETCH, SMOOTHING

TO_START = r"ConfL\Off; ConfJ\Off; MoveAbsJ [[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]],vmax,fine,tool0; "
TOOL = (0.0, 0.0, 100.0)


def drawn(body: str, tool_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Drawing:
    """What a body draws, from a place where there is room."""
    bench = InstructionBench()
    bench.run(TO_START)
    drawing = Drawing(r"ConfL\Off; ConfJ\Off; " + body, tool_mm, bench)
    assert bench.failure == ""
    return drawing


@pytest.mark.parametrize(("speed", "mm_s"), [("v50", 50.0), ("v200", 200.0), ("v500", 500.0)])
def test_line_is_straight_and_as_fast_as_programmed(speed: str, mm_s: float) -> None:
    drawing = drawn(f"point:=CRobT(); MoveL Offs(point,60,-80,-120),{speed},fine,tool0;")
    start = drawing.points[0]
    end = start + at(60, -80, -120)
    assert np.max(from_line(drawing.points, start, end)) < 0.1
    assert drawing.points[-1] == pytest.approx(end, abs=1e-2)
    assert np.max(drawing.speeds) == pytest.approx(mm_s, rel=0.02)


def test_line_with_a_tool_turns_the_tool_evenly_about_its_point() -> None:
    drawing = drawn(r"point:=CRobT(\Tool:=my_tool); MoveL RelTool(point,50,0,0\Rz:=40),v100,fine,my_tool;", TOOL)
    frames, points = drawing.frames, drawing.points
    end = points[0] + frames[0, :3, :3] @ np.array([50.0, 0.0, 0.0])
    assert np.max(from_line(points, points[0], end)) < 0.1
    assert points[-1] == pytest.approx(end, abs=1e-2)
    cosine = (np.trace(frames[0, :3, :3].T @ frames[:, :3, :3], axis1=1, axis2=2) - 1.0) / 2.0
    turned = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    share = np.linalg.norm(points - points[0], axis=1) / 50.0
    assert np.max(np.abs(turned - 40.0 * share)) < 0.1


@pytest.mark.parametrize("target", ["point", "Offs(point,60,-80,-20)", "RelTool(point,60,0,-20\\Ry:=30)"])
def test_move_takes_the_time_that_is_programmed_also_where_it_does_not_turn(target: str) -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    there = r"ConfL\Off; point:=CRobT(\Tool:=my_tool); MoveL Offs(point,60,-80,-120),v500,fine,my_tool;"
    seconds = bench.run(there)
    bench.run(TO_START)
    total = bench.run(rf"{there} MoveL {target},v1000\T:=2,fine,my_tool;")
    assert total - seconds == pytest.approx(2.0, abs=0.3)


def test_turn_about_the_tools_point_leaves_it_in_place() -> None:
    drawing = drawn(r"point:=CRobT(\Tool:=my_tool); MoveL RelTool(point,0,0,0\Ry:=30),v100,fine,my_tool;", TOOL)
    assert np.max(np.linalg.norm(drawing.points - drawing.points[0], axis=1)) < 0.1
    rotation = drawing.frames[0, :3, :3].T @ drawing.frames[-1, :3, :3]
    assert np.degrees(np.arccos((np.trace(rotation) - 1.0) / 2.0)) == pytest.approx(30.0, abs=1e-2)


@pytest.mark.parametrize("zone_mm", [5, 20, 50])
def test_corner_is_rounded_inside_its_zone_and_not_stopped_at(zone_mm: int) -> None:
    body = (
        f"point:=CRobT(); MoveL Offs(point,0,0,-120),v200,z{zone_mm},tool0; "
        "MoveL Offs(point,120,0,-120),v200,fine,tool0;"
    )
    drawing = drawn(body)
    start = drawing.points[0]
    turn, end = start + at(0, 0, -120), start + at(120, 0, -120)
    distances = np.linalg.norm(drawing.points - turn, axis=1)
    straight = drawing.points[distances > zone_mm + 0.1]
    off = np.minimum(from_line(straight, start, turn), from_line(straight, turn, end))
    assert np.max(off) < 0.1
    assert 0.1 * zone_mm < np.min(distances) <= zone_mm
    assert drawing.points[-1] == pytest.approx(end, abs=1e-2)
    middle = slice(len(drawing.speeds) // 4, 3 * len(drawing.speeds) // 4)
    assert np.min(drawing.speeds[middle]) > 5.0
    assert np.max(drawing.speeds) == pytest.approx(200.0, rel=0.02)


def test_stop_point_is_reached_and_stood_at() -> None:
    drawing = drawn(
        "point:=CRobT(); MoveL Offs(point,0,0,-60),v200,fine,tool0; MoveL Offs(point,60,0,-60),v200,fine,tool0;"
    )
    assert drawing.distance_to(drawing.points[0] + at(0, 0, -60)) < 1e-2


def test_zone_is_at_most_half_of_each_of_its_moves() -> None:
    drawing = drawn(
        "point:=CRobT(); MoveL Offs(point,0,0,-40),v100,z100,tool0; MoveL Offs(point,100,0,-40),v100,fine,tool0;"
    )
    start = drawing.points[0]
    early = drawing.points[drawing.points[:, 2] > start[2] - 19.9]
    assert np.max(from_line(early, start, start + at(0, 0, -40))) < 0.1
    late = drawing.points[drawing.points[:, 0] > start[0] + 50.1]
    assert np.max(from_line(late, start + at(0, 0, -40), start + at(100, 0, -40))) < 0.1


def test_zone_given_as_an_argument_counts_instead() -> None:
    body = (
        r"point:=CRobT(); MoveL Offs(point,0,0,-80),v100,fine\Z:=0,tool0; MoveL Offs(point,80,0,-80),v100,z50{},tool0;"
    )
    plain, smaller = (drawn(body.format(z) + "MoveL Offs(point,80,0,0),v100,fine,tool0;") for z in ("", r"\Z:=10"))
    turn = plain.points[0] + at(80, 0, -80)
    assert smaller.distance_to(turn) < 5.0 < plain.distance_to(turn)


def test_circle_runs_through_its_points() -> None:
    drawing = drawn("point:=CRobT(); MoveC Offs(point,50,0,-50),Offs(point,0,0,-100),v100,fine,tool0;")
    start = drawing.points[0]
    centre = start + at(0, 0, -50)
    assert np.linalg.norm(drawing.points - centre, axis=1) == pytest.approx(50.0, abs=0.1)
    assert np.max(np.abs(drawing.points[:, 1] - start[1])) < 0.1
    assert drawing.distance_to(start + at(50, 0, -50)) < 0.5
    assert drawing.points[-1] == pytest.approx(start + at(0, 0, -100), abs=1e-2)
    assert np.min(drawing.points[:, 0]) > start[0] - 0.1
    assert np.max(drawing.speeds) == pytest.approx(100.0, rel=0.02)


@pytest.mark.parametrize(
    "targets",
    [
        "Offs(point,25,25,0),Offs(point,50,0,0)",
        "Offs(point,25,0,-25),Offs(point,0,0,-50)",
        "Offs(point,30,30,0),Offs(point,42.7,-27.2,0)",
        "Offs(point,30,-30,0),Offs(point,42.7,27.2,0)",
    ],
    ids=["half", "half upright", "230 degrees", "230 degrees back"],
)
def test_tool_does_not_turn_on_a_long_arc_between_targets_of_one_orientation(targets: str) -> None:
    drawing = drawn(f"point:=CRobT(); MoveC {targets},v100,fine,tool0;")
    turns = drawing.frames[:, :3, :3] @ drawing.frames[0, :3, :3].T
    assert np.min(np.trace(turns, axis1=1, axis2=2)) > 3.0 - 1e-5


def test_joint_move_turns_all_joints_in_proportion() -> None:
    drawing = drawn("point:=CRobT(); MoveJ Offs(point,80,-60,-60),v200,fine,tool0;")
    joints = np.array(drawing.joints)
    way = joints[-1] - joints[0]
    share = (joints - joints[0]) @ way / (way @ way)
    assert np.max(np.abs(joints - joints[0] - np.outer(share, way))) < 1e-6
    assert drawing.points[-1] == pytest.approx(drawing.points[0] + at(80, -60, -60), abs=1e-2)
    assert np.max(drawing.speeds) == pytest.approx(200.0, rel=0.02)


def test_corner_between_joint_move_and_line_stays_inside_its_zone() -> None:
    body = "point:=CRobT(); MoveJ Offs(point,80,0,0),v200,z30,tool0; MoveL Offs(point,80,0,-100),v200,fine,tool0;"
    drawing = drawn(body)
    turn = drawing.points[0] + at(80, 0, 0)
    distances = np.linalg.norm(drawing.points - turn, axis=1)
    assert 1.0 < np.min(distances) <= 30.0
    late = drawing.points[drawing.points[:, 2] < turn[2] - 30.1]
    assert np.max(from_line(late, turn, turn + at(0, 0, -100))) < 0.1


def test_line_in_a_turned_work_object_is_straight_there() -> None:
    body = (
        'my_wobj:=[FALSE,TRUE,"",[[300,-200,100],[0.9238795,0,0,0.3826834]],[[0,0,0],[1,0,0,0]]]; '
        r"point:=CRobT(\Tool:=tool0\WObj:=my_wobj); MoveL Offs(point,-60,0,0),v100,fine,tool0\WObj:=my_wobj;"
    )
    drawing = drawn(body)
    along = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0])
    assert drawing.points[-1] == pytest.approx(drawing.points[0] - 60.0 * along, abs=1e-2)
    assert np.max(from_line(drawing.points, drawing.points[0], drawing.points[-1])) < 0.1


def test_time_given_as_an_argument_is_kept() -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    assert bench.run(r"ConfL\Off; point:=CRobT(); MoveL Offs(point,0,0,-100),v1000\T:=3,fine,tool0;") == pytest.approx(
        3.0, abs=0.25
    )


def test_motion_keeps_speed_and_acceleration_of_the_joints() -> None:
    drawing = drawn(
        "point:=CRobT(); MoveL Offs(point,0,0,-120),vmax,z10,tool0; MoveL Offs(point,120,0,-120),vmax,z10,tool0; "
        "MoveL Offs(point,120,0,0),vmax,fine,tool0;"
    )
    joints = np.array(drawing.joints)
    velocity = np.diff(joints, axis=0) / 0.004032
    assert np.all(np.max(np.abs(velocity), 0) <= np.array(YUMI_LIMITS.velocity) * 1.001)
    acceleration = np.diff(velocity, axis=0) / 0.004032
    assert np.all(np.max(np.abs(acceleration), 0) <= np.array(YUMI_LIMITS.acceleration) * 1.1)


def test_program_goes_on_shortly_before_the_arm_comes_to_the_zone() -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    bench.start(
        r"ConfL\Off; point:=CRobT(); MoveL Offs(point,0,0,-100),v100,z10,tool0; number:=1; "
        "MoveL Offs(point,50,0,-100),v100,fine,tool0; number:=2;"
    )
    arm = bench.unit.arm
    zone_m = arm.kinematics.tool0(arm.planned).position[2] - 0.090
    went_on = came = 0.0
    while bench.task.is_running:
        bench.step()
        went_on = went_on or (bench.task.now if bench.read("number") == "1" else 0.0)
        came = came or (bench.task.now if arm.kinematics.tool0(arm.planned).position[2] <= zone_m else 0.0)
    # The arm is smoothed over some cycles behind the law that plans its speed.
    assert came - went_on == pytest.approx(PREFETCH + SMOOTHING / 2 * 0.004, abs=0.03)
    assert bench.read("number") == "2"


def test_short_moves_are_planned_far_enough_ahead_to_keep_the_speed() -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    took = bench.run(
        r"ConfL\Off; point:=CRobT(); FOR i FROM 1 TO 40 DO MoveL Offs(point,0,0,-2.5*i),v200,z1,tool0; ENDFOR "
        "MoveL Offs(point,0,0,-101),v200,fine,tool0;"
    )
    assert took < 0.101 / 0.2 + 0.25
    assert bench.events.entries() == ()


def test_late_next_move_makes_the_corner_a_stop_and_logs_it() -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    drawing = Drawing(
        r"ConfL\Off; point:=CRobT(); MoveL Offs(point,0,0,-50),v200,z10,tool0; WaitTime 1; "
        "MoveL Offs(point,50,0,-50),v200,fine,tool0;",
        bench=bench,
    )
    assert drawing.distance_to(drawing.points[0] + at(0, 0, -50)) < 1e-2
    assert [event.code for event in bench.events.entries()] == [50024]


def test_move_to_where_the_arm_is_has_no_corner_to_fail() -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    bench.run(
        r"ConfL\Off; ConfJ\Off; point:=CRobT(); MoveJ Offs(point,0.001,0,0),v500,z100,tool0; "
        "MoveJ point,v500,z100,tool0; MoveL Offs(point,50,0,-50),v200,fine,tool0;"
    )
    assert bench.events.entries() == ()


@pytest.mark.parametrize(
    ("body", "code", "sentence"),
    [
        (r"MoveL Offs(point,900,0,0),v100,fine,tool0;", 50050, "does not reach"),
        (r"MoveJ Offs(point,900,0,0),v100,fine,tool0;", 50050, "does not reach"),
        (r"MoveC Offs(point,10,0,0),Offs(point,20,0,0),v100,fine,tool0;", 50063, "in a line"),
        (r"MoveAbsJ [[0,-130,200,0,40,0],[-135,0,0,0,0,0]],v100,fine,tool0;", 50027, "Axis 3 of the right arm"),
        (r"point.robconf.cf4:=2; ConfJ\On; MoveJ point,v100,fine,tool0;", 50080, "with the configuration"),
    ],
)
def test_impossible_move_stops_the_program_with_abbs_event(body: str, code: int, sentence: str) -> None:
    bench = InstructionBench()
    bench.run(TO_START)
    before = bench.unit.arm.planned
    bench.run(r"ConfL\Off; ConfJ\Off; point:=CRobT(); " + body)
    assert sentence in bench.failure
    assert [event.code for event in bench.events.entries()] == [code]
    assert bench.unit.arm.planned == before


def test_left_arm_draws_lines_as_well() -> None:
    bench = InstructionBench(Side.LEFT)
    bench.run("MoveAbsJ [[-20,-100,20,0,60,0],[110,9E9,9E9,9E9,9E9,9E9]],vmax,fine,tool0;")
    drawing = Drawing(r"ConfL\Off; point:=CRobT(); MoveL Offs(point,60,80,-60),v200,fine,tool0;", bench=bench)
    assert np.max(from_line(drawing.points, drawing.points[0], drawing.points[0] + at(60, 80, -60))) < 0.1
