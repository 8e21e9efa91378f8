"""Motion instructions: where the arm goes, how fast, and what it says about itself."""

import re
from math import degrees, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from instruction_bench import InstructionBench

from abb_protocols.robot.inverse_kinematics import arm_angle
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Pose, Side, home, joint_names
from abb_protocols.robot.kinematics import matrix_from_quaternion, quaternion_of, tool0_to_body
from abb_protocols.robot.urdf import robot_description
from abb_protocols.robot.yumi_arms import yumi_arm
from unit.robot.test_robot_inverse_kinematics import random_postures
from virtual_irc5.instructions.robot_data import NOT_PRESENT, jointtarget, robtarget

NEAR = "[[20,-120,30,0,40,0],[-130,9E9,9E9,9E9,9E9,9E9]]"


@pytest.fixture
def bench() -> InstructionBench:
    return InstructionBench()


def test_move_abs_j_stands_at_its_target(bench: InstructionBench) -> None:
    bench.run(f"MoveAbsJ {NEAR}\\NoEOffs,v1000,fine,tool0;")
    robax, extax = jointtarget(bench.unit.arm.position)
    assert robax == pytest.approx((20, -120, 30, 0, 40, 0), abs=1e-3)
    assert extax[0] == pytest.approx(-130, abs=1e-3)
    assert bench.unit.arm.is_stationary


def test_move_abs_j_leaves_an_axis_that_is_not_given(bench: InstructionBench) -> None:
    bench.run("MoveAbsJ [[20,-120,30,0,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;")
    assert bench.unit.arm.position[2] == pytest.approx(radians(-135), abs=1e-5)


def test_move_abs_j_to_where_the_arm_stands_takes_no_time(bench: InstructionBench) -> None:
    assert bench.run("MoveAbsJ CJointT(),v1000,fine,tool0;") <= CYCLE


def test_loop_of_moves_of_no_length_makes_one_in_a_cycle(bench: InstructionBench) -> None:
    loop = "WHILE TRUE DO MoveAbsJ target,v1000,fine,tool0; number:=number+1; ENDWHILE"
    bench.start(f"target:=CJointT(); MoveAbsJ target,v1000,fine,tool0; {loop}")
    for _ in range(100):
        bench.step()
    assert 90 <= float(bench.read("number")) <= 100


def test_move_of_no_length_is_not_planned(bench: InstructionBench, monkeypatch: pytest.MonkeyPatch) -> None:
    planned: list[object] = []
    monkeypatch.setattr("virtual_irc5.mechanics.arm.tool0_to_body", planned.append)
    bench.unit.arm.move_to(bench.unit.arm.planned)
    assert planned == []


def test_move_abs_j_is_slower_with_a_slower_speed(bench: InstructionBench) -> None:
    slow = bench.run(f"MoveAbsJ {NEAR},v10,fine,tool0;")
    assert slow > 2.0 * InstructionBench().run(f"MoveAbsJ {NEAR},v200,fine,tool0;")


def test_move_abs_j_obeys_the_speed_ratio(bench: InstructionBench) -> None:
    full = InstructionBench().run(f"MoveAbsJ {NEAR},v10,fine,tool0;")
    bench.speed_ratio = 50
    assert bench.run(f"MoveAbsJ {NEAR},v10,fine,tool0;") == pytest.approx(2.0 * full, rel=0.05)


def test_move_abs_j_takes_at_least_the_time_it_is_given(bench: InstructionBench) -> None:
    assert bench.run(f"MoveAbsJ {NEAR},v1000\\T:=4,fine,tool0;") == pytest.approx(4.0, abs=0.2)


def test_move_abs_j_refuses_a_target_out_of_range(bench: InstructionBench) -> None:
    bench.run("MoveAbsJ [[0,-130,200,0,40,0],[-135,0,0,0,0,0]],v1000,fine,tool0;")
    assert "ERR_ROBLIMIT" in bench.failure
    assert "Axis 3 of the right arm cannot move to 200.00°" in bench.failure
    assert bench.unit.arm.position == home(Side.RIGHT)


def test_move_abs_j_refuses_while_the_motors_are_off(bench: InstructionBench) -> None:
    bench.unit.arm.switch_motors_off()
    bench.run(f"MoveAbsJ {NEAR},v1000,fine,tool0;")
    assert "motors of the right arm are off" in bench.failure


def test_move_abs_j_to_where_the_arm_is_takes_no_time(bench: InstructionBench) -> None:
    assert bench.run("MoveAbsJ CJointT(),v100,fine,tool0;") < 0.1


def test_wait_rob_waits_until_the_arm_stands(bench: InstructionBench) -> None:
    bench.unit.arm.move_to(tuple(value + 0.2 for value in home(Side.RIGHT)))  # type: ignore[arg-type]
    bench.run("WaitRob\\InPos;")
    assert bench.unit.arm.is_stationary


def test_c_joint_t_tells_where_the_arm_is(bench: InstructionBench) -> None:
    bench.run("target:=CJointT();")
    assert bench.read("target") == "[[0,-130,30,0,40,0],[-135,9E+09,9E+09,9E+09,9E+09,9E+09]]"


def test_c_rob_t_tells_home_as_abb_does() -> None:
    bench = InstructionBench(Side.LEFT)
    bench.run("point:=CRobT();")
    assert bench.read("point").startswith("[[-9.57833,182.61,198.628],[0.0660108,0.842421,-0.111215,0.523069]")
    assert ",[101.964,9E+09,9E+09,9E+09,9E+09,9E+09]]" in bench.read("point")


def test_c_rob_t_counts_the_tool_in(bench: InstructionBench) -> None:
    bench.run("point:=CRobT(); tip:=CRobT(\\Tool:=my_tool\\WObj:=wobj0); number:=Distance(point.trans,tip.trans);")
    assert float(bench.read("number")) == pytest.approx(100.0, abs=1e-3)


TIP = Pose((0.02, -0.01, 0.15), quaternion_of((0.3, -0.2, 0.5)))
TABLE = Pose((0.4, -0.1, 0.2), quaternion_of((0.1, 0.2, -0.7)))


@pytest.mark.parametrize(("side", "position"), random_postures(3303, 6))
def test_c_rob_t_is_where_pinocchio_says_with_tool_and_work_object(side: Side, position: Joints) -> None:
    """Within 0.01 mm; RAPID counts in single precision and prints six digits."""
    pin = pytest.importorskip("pinocchio", reason="pip install yumi-ros2[planning]")
    model = pin.buildModelFromXML(robot_description())
    values, data = pin.neutral(model), model.createData()
    for name, value in zip(joint_names(side), position, strict=True):
        values[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, values)
    tool0 = data.oMf[model.getFrameId(f"yumi_tool0_{side.value}")]
    tool, table = (pin.SE3(matrix_from_quaternion(each.orientation), np.array(each.position)) for each in (TIP, TABLE))
    expected = table.inverse() * tool0 * tool

    def in_rapid(pose: Pose) -> str:
        place = ",".join(f"{each * 1e3:.6f}" for each in pose.position)
        return f"[[{place}],[{','.join(f'{each:.9f}' for each in pose.orientation)}]]"

    bench = InstructionBench(side, position=position)
    bench.run(
        f"my_tool.tframe:={in_rapid(TIP)}; my_wobj:=wobj0; my_wobj.uframe:={in_rapid(TABLE)};"
        r"point:=CRobT(\Tool:=my_tool\WObj:=my_wobj);"
    )
    assert not bench.failure
    x, y, z, *quaternion = [float(each) for each in re.findall(r"[-+.E\d]+", bench.read("point"))[:7]]
    assert (x, y, z) == pytest.approx(1e3 * expected.translation, abs=0.01)
    assert matrix_from_quaternion((quaternion[0], quaternion[1], quaternion[2], quaternion[3])) == pytest.approx(
        expected.rotation, abs=1e-5
    )


def test_c_tool_tells_the_tool_of_the_last_motion(bench: InstructionBench) -> None:
    bench.run(f"MoveAbsJ {NEAR},v1000,fine,my_tool; my_tool:=CTool();")
    assert bench.unit.tool.tframe.trans.z == 100


@pytest.mark.parametrize(("side", "angle_deg"), [(Side.RIGHT, -101.9644), (Side.LEFT, 101.9644)])
def test_arm_angle_at_home_is_the_one_abb_publishes(side: Side, angle_deg: float) -> None:
    assert degrees(arm_angle(side, home(side))) == pytest.approx(angle_deg, abs=1e-4)


positions = st.tuples(*(st.floats(low, high) for low, high in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)))


@given(positions)
def test_robtarget_without_tool_and_work_object_is_tool0_in_millimetres(position: Joints) -> None:
    trans, rot, _, extax = robtarget(yumi_arm(Side.LEFT), position, None, None)
    pose = tool0_to_body(Side.LEFT, position)
    assert trans == pytest.approx([value * 1e3 for value in pose.position])
    assert rot == pytest.approx(pose.orientation, abs=1e-9)
    assert -180.0 <= extax[0] <= 180.0


@given(positions)
def test_jointtarget_holds_every_axis_in_abbs_order(position: Joints) -> None:
    robax, extax = jointtarget(position)
    a1, a2, a7, a3, a4, a5, a6 = map(degrees, position)
    assert robax == (a1, a2, a3, a4, a5, a6)
    assert extax == (a7, *(NOT_PRESENT,) * 5)
