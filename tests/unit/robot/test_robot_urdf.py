"""The URDF is complete, and its numbers are the robot's."""

from __future__ import annotations

from collections import Counter
from math import radians
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from abb_protocols.robot.description import GRIPPER_MASSES, joint_1_origin
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import YUMI_LIMITS, Side, finger_names, joint_names
from abb_protocols.robot.urdf import robot_description

CUP = 0.0075


@pytest.fixture(scope="module")
def robot() -> ET.Element:
    return ET.fromstring(robot_description())


def joint(robot: ET.Element, name: str) -> ET.Element:
    (found,) = [element for element in robot.iter("joint") if element.get("name") == name]
    return found


def test_every_joint_and_link_is_named_once(robot):
    names = Counter((element.tag, element.get("name")) for element in robot if element.tag in ("joint", "link"))
    assert set(names.values()) == {1}


def test_links_form_one_tree_from_the_base_link(robot):
    links = {link.get("name") for link in robot.findall("link")}
    children = [element.find("child").get("link") for element in robot.findall("joint")]
    parents = {element.find("parent").get("link") for element in robot.findall("joint")}
    assert sorted(children) == sorted(links - {"yumi_base_link"})
    assert parents <= links


@pytest.mark.parametrize("side", list(Side))
def test_moving_joints_are_those_of_the_joint_table(robot, side):
    moving = [
        e.get("name") for e in robot.findall("joint") if e.get("type") != "fixed" and f"_{side.value}" in e.get("name")
    ]
    assert moving == [*joint_names(side), *finger_names(side)]


@pytest.mark.parametrize("side", list(Side))
def test_links_of_an_arm_are_numbered_along_the_chain(robot, side):
    children = [joint(robot, name).find("child").get("link") for name in joint_names(side)]
    assert children == [f"yumi_link_{number}_{side.value}" for number in range(1, 8)]


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("index", range(7))
def test_joint_has_the_limits_of_the_motion_configuration(robot, side, index):
    limit = joint(robot, joint_names(side)[index]).find("limit")
    assert float(limit.get("lower")) == YUMI_LIMITS.lower[index]
    assert float(limit.get("upper")) == YUMI_LIMITS.upper[index]
    assert float(limit.get("velocity")) == pytest.approx(YUMI_LIMITS.velocity[index], rel=1e-14)


@pytest.mark.parametrize("side", list(Side))
def test_second_finger_mimics_the_first(robot, side):
    first, second = finger_names(side)
    assert joint(robot, first).find("mimic") is None
    assert joint(robot, second).find("mimic").get("joint") == first
    assert joint(robot, second).find("limit").get("upper") == "0.025"


@pytest.mark.parametrize(("side", "mirror"), [(Side.LEFT, 1), (Side.RIGHT, -1)])
def test_first_joint_sits_where_the_controller_puts_it(side, mirror):
    origin = joint_1_origin(side)
    assert origin.xyz == pytest.approx((0.053711, mirror * 0.072573, 0.415010), abs=1e-6)
    assert origin.rpy == pytest.approx((mirror * 0.979068, -0.569211, mirror * 2.316178), abs=1e-6)


def test_every_inertia_belongs_to_a_body_that_can_exist(robot):
    for inertia in robot.iter("inertia"):
        xx, xy, xz, yy, yz, zz = (float(inertia.get(key)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        small, middle, large = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert small > 0.0
        assert large <= small + middle


def test_masses_add_up_to_the_robots_weight(robot):
    arms_and_body = [link for link in robot.findall("link") if "gripper" not in link.get("name")]
    masses = [float(mass.get("value")) for link in arms_and_body for mass in link.iter("mass")]
    assert sum(masses) == pytest.approx(38.0, abs=0.01)


def test_every_material_is_defined(robot):
    defined = {material.get("name") for material in robot.findall("material")}
    assert {material.get("name") for material in robot.iter("material")} == defined


def test_shapes_show_and_collide_alike(robot):
    for link in robot.findall("link"):
        seen = [visual.find("geometry")[0] for visual in link.findall("visual")]
        solid = [collision.find("geometry")[0] for collision in link.findall("collision")]
        assert [(shape.tag, shape.attrib) for shape in seen] == [(shape.tag, shape.attrib) for shape in solid]


def test_description_has_the_speeds_that_the_robot_is_slowed_to() -> None:
    slow = YUMI_LIMITS.slowed_to(0.5)
    joints = ET.fromstring(robot_description(slow)).iter("joint")
    limits = [joint.find("limit") for joint in joints if joint.get("type") == "revolute"]
    assert {float(limit.get("velocity", "")) for limit in limits if limit is not None} == {0.5}


@pytest.mark.parametrize(
    ("modules", "mass_with_fingers"),
    [
        (GripperModules.SERVO, 0.230),
        (GripperModules.VISION, 0.244),
        (GripperModules.VACUUM, 0.248 - CUP),
        (GripperModules.VISION_VACUUM, 0.262 - CUP),
        (GripperModules.TWO_VACUUMS, 0.280 - 2 * CUP),
    ],
)
def test_hand_weighs_what_it_is_made_of(modules: GripperModules, mass_with_fingers: float) -> None:
    robot = ET.fromstring(robot_description(grippers={Side.RIGHT: GripperModules.SERVO, Side.LEFT: modules}))
    masses = {
        link.get("name"): float(link.find("inertial/mass").get("value"))
        for link in robot.iter("link")
        if "gripper" in link.get("name") and link.find("inertial") is not None
    }
    assert sum(mass for name, mass in masses.items() if "_l_" in name) == pytest.approx(mass_with_fingers, abs=6e-4)
    assert sum(mass for name, mass in masses.items() if "_r_" in name) == pytest.approx(0.230)


@pytest.mark.parametrize("modules", list(GripperModules))
def test_inertia_of_every_hand_belongs_to_a_body_that_can_exist(modules: GripperModules) -> None:
    xx, _, _, yy, _, zz = GRIPPER_MASSES[modules].inertia
    assert max(xx, yy, zz) < xx + yy + zz - max(xx, yy, zz)


def test_joints_can_be_slowed_down_together() -> None:
    slow = YUMI_LIMITS.slowed_to(radians(200.0))
    assert slow.velocity == (*YUMI_LIMITS.velocity[:4], *(radians(200.0),) * 3)
    assert slow.acceleration == YUMI_LIMITS.acceleration
