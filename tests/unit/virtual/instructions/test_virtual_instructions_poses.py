"""RAPID's geometry against matrices of the tests' own."""

import numpy as np
import pytest
from instruction_bench import InstructionBench
from numpy.typing import NDArray

from urdf_kinematics import matrix, rotation

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)


def read(text: str) -> list[float]:
    return [float(each) for each in text.replace("[", "").replace("]", "").split(",")]


@pytest.fixture(scope="module")
def bench() -> InstructionBench:
    return InstructionBench()


def evaluated(bench: InstructionBench, body: str, *names: str) -> list[list[float]]:
    bench.run(body)
    assert bench.failure == ""
    return [read(bench.read(name)) for name in names]


def frame(values: list[float]) -> Array:
    w, x, y, z = values[3:7]
    pose: Array = matrix(tuple(values[:3]), (w, x, y, z))
    return pose


TARGET = "[[100,200,300],[0.5,0.5,0.5,0.5],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


def test_offs_moves_along_the_axes_of_the_work_object(bench: InstructionBench) -> None:
    (point,) = evaluated(bench, f"point:=Offs({TARGET},1,-2,3);", "point")
    assert point[:3] == [101, 198, 303]
    assert point[3:7] == [0.5, 0.5, 0.5, 0.5]


def test_rel_tool_moves_and_turns_in_the_tools_own_frame(bench: InstructionBench) -> None:
    (point,) = evaluated(bench, rf"point:=RelTool({TARGET},10,20,30\Rx:=10\Ry:=20\Rz:=30);", "point")
    before = matrix((100, 200, 300), (0.5, 0.5, 0.5, 0.5))
    turn = rotation(X, np.radians(10)) @ rotation(Y, np.radians(20)) @ rotation(Z, np.radians(30))
    after = frame(point)
    assert after[:3, 3] == pytest.approx(before[:3, 3] + before[:3, :3] @ [10, 20, 30], abs=1e-3)
    assert after[:3, :3] == pytest.approx(before[:3, :3] @ turn, abs=1e-5)  # six digits are read


def test_orientation_is_made_of_euler_angles_and_gives_them_back(bench: InstructionBench) -> None:
    (values, pos) = evaluated(
        bench,
        r"point.rot:=OrientZYX(30,20,10); tip.trans.x:=EulerZYX(\Z,point.rot); tip.trans.y:=EulerZYX(\Y,point.rot); "
        r"tip.trans.z:=EulerZYX(\X,point.rot);",
        "point",
        "tip",
    )
    turn = rotation(Z, np.radians(30)) @ rotation(Y, np.radians(20)) @ rotation(X, np.radians(10))
    assert frame(values)[:3, :3] == pytest.approx(turn, abs=1e-6)
    assert pos[:3] == pytest.approx([30, 20, 10], abs=1e-4)


A, B = "[[10,20,30],[0.8,0.6,0,0]]", "[[1,2,3],[0.6,0,0.8,0]]"


def test_poses_are_multiplied_and_inverted(bench: InstructionBench) -> None:
    a, b = frame(read(A)), frame(read(B))
    (product, back, vector) = evaluated(
        bench,
        f"one:=PoseMult({A},{B}); two:=PoseInv({A}); tip.trans:=PoseVect({A},[1,2,3]);",
        "one",
        "two",
        "tip",
    )
    assert frame(product) == pytest.approx(a @ b, abs=1e-4)
    assert frame(back) == pytest.approx(np.linalg.inv(a), abs=1e-4)
    assert vector[:3] == pytest.approx((a @ [1, 2, 3, 1])[:3], abs=1e-4)


def test_frame_of_three_points_has_x_along_the_first_two(bench: InstructionBench) -> None:
    (values, second, third) = evaluated(
        bench,
        r"one:=DefFrame([100,0,0],[100,50,0],[80,70,0]); two:=DefFrame([100,0,0],[100,50,0],[80,70,0]\Origin:=2); "
        r"three:=DefFrame([100,0,0],[100,50,0],[80,70,0]\Origin:=3);",
        "one",
        "two",
        "three",
    )
    expected = np.stack([(0, 1, 0), (-1, 0, 0), (0, 0, 1)], 1)
    assert frame(values)[:3, :3] == pytest.approx(expected, abs=1e-6)
    assert (values[:3], second[:3], third[:3]) == ([100, 0, 0], [100, 50, 0], [100, 70, 0])


def test_displacement_of_three_points_moves_the_old_to_the_new(bench: InstructionBench) -> None:
    (pose,) = evaluated(bench, "one:=DefDFrame([0,0,0],[10,0,0],[0,10,0],[5,5,5],[5,15,5],[-5,5,5]);", "one")
    assert frame(pose) @ [10, 0, 0, 1] == pytest.approx([5, 15, 5, 1], abs=1e-4)
    assert frame(pose) @ [0, 10, 0, 1] == pytest.approx([-5, 5, 5, 1], abs=1e-4)


def test_fitted_frame_is_the_one_the_points_were_moved_by(bench: InstructionBench) -> None:
    moved = frame([100, 50, 20, *read("[0.8,0,0,0.6]")])
    points = [(0, 0, 0), (100, 0, 0), (0, 80, 0), (0, 0, 60)]
    rest = "[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]"
    fill = ""
    for number, point in enumerate(points, start=1):
        x, y, z = (moved @ [*point, 1])[:3]
        fill += f"list_one{{{number}}}:=[[{x:.5f},{y:.5f},{z:.5f}],{rest}]; "
        fill += f"list_two{{{number}}}:=[[{point[0]},{point[1]},{point[2]}],{rest}]; "
    (pose, worst) = evaluated(
        bench, fill + "one:=DefAccFrame(list_one,list_two,4,number,tip.trans.x);", "one", "number"
    )
    assert frame(pose) == pytest.approx(moved, abs=1e-3)
    assert worst[0] < 1e-2


def test_mirrored_position_lies_behind_the_plane_and_stays_right_handed(bench: InstructionBench) -> None:
    plane = '[FALSE,TRUE,"",[[0,0,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]'
    (point,) = evaluated(bench, f"my_wobj:={plane}; point:=MirPos({TARGET},my_wobj);", "point")
    assert point[:3] == pytest.approx([100, 200, -100], abs=1e-3)
    before, after = matrix((0, 0, 0), (0.5, 0.5, 0.5, 0.5))[:3, :3], frame(point)[:3, :3]
    assert np.linalg.det(after) == pytest.approx(1.0)
    assert after[:, 2] == pytest.approx(np.diag([1, 1, -1]) @ before[:, 2], abs=1e-6)


def test_vectors_have_products_and_lengths(bench: InstructionBench) -> None:
    (point, tip) = evaluated(
        bench,
        "point.trans:=CrossProd([1,2,3],[4,5,6]); tip.trans.x:=DotProd([1,2,3],[4,5,6]); "
        "tip.trans.y:=VectMagn([3,4,12]); tip.trans.z:=Distance([1,1,1],[1,4,5]);",
        "point",
        "tip",
    )
    assert point[:3] == [-3, 6, -3]
    assert tip[:3] == pytest.approx([32, 13, 5])


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("one:=DefFrame([0,0,0],[1,0,0],[2,0,0]);", "in a line"),
        (r"one:=DefFrame([0,0,0],[1,0,0],[0,1,0]\Origin:=4);", "1, 2 or 3"),
        ("one:=PoseInv([[0,0,0],[0,0,0,0]]);", "ERR_ILLQUAT"),
        ("number:=EulerZYX([1,0,0,0]);", r"one of \X, \Y and \Z"),
    ],
)
def test_what_has_no_answer_is_an_error(bench: InstructionBench, body: str, sentence: str) -> None:
    bench.run(body)
    assert sentence in bench.failure
