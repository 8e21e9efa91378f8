"""The MoveIt package: what belongs together agrees, judged without MoveIt."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml
from click.testing import CliRunner

from abb_protocols.catalogue import message, sentence
from abb_protocols.robot.joints import YUMI_LIMITS, Side, finger_names, joint_names
from yumi.cli.main import main
from yumi.cli.moveit import moveit_files
from yumi.planning.scene_description import GROUPS

FILES = moveit_files()
URDF = ET.fromstring(FILES["config/yumi.urdf"])
SRDF = ET.fromstring(FILES["config/yumi.srdf"])
LINKS = {link.get("name") for link in URDF.iter("link")}
JOINTS = {joint.get("name"): joint for joint in URDF.iter("joint")}


def chain(base: str, tip: str) -> list[str]:
    """The joints that move between two links, from base to tip."""
    parents = {joint.find("child").get("link"): joint for joint in JOINTS.values()}  # type: ignore[union-attr]
    names = []
    while tip != base:
        joint = parents[tip]
        if joint.get("type") != "fixed":
            names.append(joint.get("name") or "")
        tip = joint.find("parent").get("link")  # type: ignore[union-attr, assignment]
    return names[::-1]


@pytest.mark.parametrize("side", Side)
def test_group_of_an_arm_is_its_seven_joints_in_chain_order(side: Side) -> None:
    (ends,) = SRDF.findall(f"group[@name='{side.word}_arm']/chain")
    assert tuple(chain(ends.get("base_link") or "", ends.get("tip_link") or "")) == joint_names(side)
    fingers = [each.get("name") for each in SRDF.findall(f"group[@name='{side.word}_gripper']/joint")]
    assert tuple(fingers) == finger_names(side)
    assert not SRDF.findall(f"group[@name='{side.word}_gripper']/chain")


def test_group_of_both_arms_consists_of_those_of_the_arms() -> None:
    assert [each.get("name") for each in SRDF.findall("group[@name='both_arms']/group")] == ["right_arm", "left_arm"]
    assert {group.get("name") for group in SRDF.findall("group")} == {*GROUPS, "right_gripper", "left_gripper"}


def test_every_link_and_joint_that_the_srdf_names_is_in_the_urdf() -> None:
    named = [pair.get(key) for pair in SRDF.iter("disable_collisions") for key in ("link1", "link2")]
    named += [each.get("parent_link") for each in SRDF.iter("end_effector")]
    assert {*named} <= LINKS
    assert {each.get("name") for each in SRDF.iter("passive_joint")} <= {*JOINTS}


def test_no_pair_of_the_two_arms_is_left_out_but_the_shoulders() -> None:
    across = [
        pair
        for pair in SRDF.iter("disable_collisions")
        if {(pair.get(key) or "").split("_")[-1] for key in ("link1", "link2")} == {"r", "l"}
    ]
    assert [(pair.get("link1"), pair.get("link2")) for pair in across] == [("yumi_link_1_r", "yumi_link_1_l")]


def test_limits_are_those_of_the_driver() -> None:
    limits = yaml.safe_load(FILES["config/joint_limits.yaml"])["joint_limits"]
    for side in Side:
        for index, name in enumerate(joint_names(side)):
            assert limits[name]["max_velocity"] == pytest.approx(YUMI_LIMITS.velocity[index])
            assert limits[name]["max_acceleration"] == YUMI_LIMITS.acceleration[index]
            assert limits[name]["max_jerk"] == YUMI_LIMITS.jerk[index]


def test_every_moving_joint_has_a_controller() -> None:
    manager = yaml.safe_load(FILES["config/moveit_controllers.yaml"])["moveit_simple_controller_manager"]
    joints = {name for each in manager["controller_names"] for name in manager[each]["joints"]}
    free = {name for name, joint in JOINTS.items() if joint.get("type") != "fixed" and joint.find("mimic") is None}
    assert joints == free


def test_command_writes_the_package_and_never_over_another(tmp_path: Path) -> None:
    folder = tmp_path / "yumi_moveit_config"
    done = CliRunner().invoke(main, ["moveit-config", str(folder), "--right-gripper", "servo+vacuum"])
    assert done.exit_code == 0
    assert {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()} == {*FILES}
    assert 'name="gripper_r_vacuum_1"' in (folder / "config/yumi.urdf").read_text()
    compile((folder / "launch/move_group.launch.py").read_text(), "launch", "exec")
    again = CliRunner().invoke(main, ["moveit-config", str(folder)])
    assert (again.exit_code, sentence(message("folder_not_empty", folder=str(folder))) in again.output) == (2, True)
