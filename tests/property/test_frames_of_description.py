"""The frames on /tf are those of the description: another forward kinematics says the same of every link."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Side, finger_names, joint_names, set_prefix
from abb_protocols.robot.kinematics import tool0_to_body
from abb_protocols.robot.urdf import read_frames, robot_description
from urdf_kinematics import links_to_root, matrix

angles = st.floats(-3.0, 3.0)
MODULES = {Side.RIGHT: GripperModules.VISION_VACUUM, Side.LEFT: GripperModules.TWO_VACUUMS}


@given(
    arms=st.fixed_dictionaries({side: st.tuples(*[angles] * 7) for side in Side}),
    fingers=st.fixed_dictionaries({side: st.floats(0.0, 0.025) for side in Side}),
)
def test_every_frame_is_where_another_forward_kinematics_of_the_urdf_has_it(arms, fingers):
    urdf = robot_description(grippers=MODULES)
    positions = {name: value for side in Side for name, value in zip(joint_names(side), arms[side], strict=True)}
    positions |= {finger_names(side)[0]: fingers[side] for side in Side}
    expected = links_to_root(urdf, positions)
    found = {"yumi_base_link": np.eye(4)}
    for frame in read_frames(urdf):
        pose = frame.to_parent(positions.get(frame.joint, 0.0))
        found[frame.name] = found[frame.parent] @ matrix(pose.position, pose.orientation)
    assert found.keys() == expected.keys()
    for name, pose in expected.items():
        assert found[name] == pytest.approx(pose, abs=1e-9), name
    for side in Side:
        pose = tool0_to_body(side, arms[side])
        assert found[f"yumi_tool0_{side.value}"] == pytest.approx(matrix(pose.position, pose.orientation), abs=1e-9)


@pytest.mark.parametrize(
    ("modules", "extra"),
    [
        (GripperModules.SERVO, set()),
        (GripperModules.VISION, {"camera"}),
        (GripperModules.VACUUM, {"vacuum_1"}),
        (GripperModules.VISION_VACUUM, {"camera", "vacuum_1"}),
        (GripperModules.TWO_VACUUMS, {"vacuum_1", "vacuum_2"}),
    ],
)
def test_gripper_has_the_frames_of_its_modules(modules, extra):
    frames = read_frames(robot_description(grippers=dict.fromkeys(Side, modules)))
    named = {frame.name.removeprefix("gripper_r_") for frame in frames if frame.name.startswith("gripper_r_")}
    assert named == {"base", "fingertips", "finger", "finger_m", *extra}


def test_flange_looks_along_its_x_axis_and_tool0_along_its_z_axis():
    links = links_to_root(
        robot_description(),
        {name: 0.1 for side in Side for name in joint_names(side)} | {finger_names(side)[0]: 0.0 for side in Side},
    )
    assert links["yumi_flange_r"][:3, 0] == pytest.approx(links["yumi_tool0_r"][:3, 2], abs=1e-12)
    assert links["yumi_flange_r"][:3, 3] == pytest.approx(links["yumi_tool0_r"][:3, 3], abs=1e-12)
    tips = np.linalg.inv(links["yumi_tool0_r"]) @ links["gripper_r_fingertips"]
    assert tips == pytest.approx(matrix((0.0, 0.0, 0.1142), (1.0, 0.0, 0.0, 0.0)), abs=1e-12)


@pytest.fixture
def _prefix():
    set_prefix("a_")
    yield
    set_prefix("")


@pytest.mark.usefixtures("_prefix")
def test_every_joint_and_link_bears_the_prefix():
    frames = read_frames(robot_description())
    assert all(frame.name.startswith("a_") and frame.parent.startswith("a_") for frame in frames)
    assert all(not frame.joint or frame.joint.startswith("a_") for frame in frames)
    assert joint_names(Side.RIGHT)[2] == "a_yumi_joint_7_r"
