"""The picture of the robot follows its URDF."""

from __future__ import annotations

import sys
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from doc_pages import ROOT

from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import Side, home, joint_names, joints
from abb_protocols.robot.kinematics import tool0_to_body
from abb_protocols.robot.urdf import robot_description
from mesh_judge import MeshJudge

sys.path.append(str(ROOT / "docs" / "images"))

import make_robot
import make_tool_motions

URDF = ET.fromstring(robot_description().encode())


def test_links_are_where_the_kinematics_say() -> None:
    positions = {name: value for side in Side for name, value in zip(joint_names(side), home(side), strict=True)}
    links = make_robot.links_of(URDF, positions)
    grippers = [link for link in links if link.color == make_robot.COLORS["abb_graphite"]]
    found = sorted((tuple(link.to_base[:3, 3]) for link in grippers), key=lambda place: place[1])
    for place, side in zip(found, (Side.RIGHT, Side.LEFT), strict=True):
        assert place == pytest.approx(tool0_to_body(side, home(side)).position, abs=1e-5)


def test_cylinder_with_equal_balls_at_its_ends_is_a_capsule() -> None:
    upper_arm = URDF.find("link[@name='yumi_link_1_r']")
    assert upper_arm is not None
    solids = [solid for each in upper_arm.iter("visual") if (solid := make_robot.solid_of(each))]
    assert {solid.kind for solid in make_robot.with_capsules(solids)} == {"capsule"}


def test_picture_shows_the_robot_on_a_transparent_background() -> None:
    positions = {name: value for side in Side for name, value in zip(joint_names(side), home(side), strict=True)}
    links = make_robot.links_of(URDF, positions)
    alpha = np.asarray(make_robot.render(links, 48, 32))[..., 3]
    assert alpha[0].max() == 0
    assert 0.1 < (alpha == 255).mean() < 0.6


def test_pictures_of_the_tool_show_what_the_examples_do() -> None:
    places = make_tool_motions.line()
    assert places[-1] == pytest.approx((0.40, -0.15, 0.15), abs=1e-4)
    assert np.max(np.abs(places[:, :2] - places[0, :2])) < 1e-4
    wanted, measured = make_tool_motions.sticks(0.8)
    assert measured[: len(wanted)][round(0.7 / 0.004032)] == pytest.approx(wanted[round(0.68 / 0.004032)], abs=0.01)


def test_arms_hand_over_without_touching() -> None:
    judge = MeshJudge()
    before, together = make_tool_motions.hand_over()
    for share in np.linspace(0.0, 1.0, 6).tolist():
        now = {
            side: joints(((1.0 - share) * np.array(before[side]) + share * np.array(together[side])).tolist())
            for side in Side
        }
        assert judge.distance(now)[0] > 0.02
    tips = {side: tool0_to_body(side, together[side], FINGERTIPS).position for side in Side}
    assert np.subtract(tips[Side.LEFT], tips[Side.RIGHT]) == pytest.approx((0.0, 0.06, 0.0), abs=1e-6)


def test_arm_goes_around_the_crate_that_stands_in_its_way() -> None:
    pytest.importorskip("roboplan")
    plan, crate = make_tool_motions.around()
    judge, ends = MeshJudge([crate]), [plan.points[Side.RIGHT][index].position for index in (0, -1)]
    for point in plan.points[Side.RIGHT][::4]:
        assert judge.distance({**plan.start, Side.RIGHT: joints(point.position)})[0] > 0.0
    straight = np.linspace(*ends, 20).tolist()
    assert min(judge.distance({**plan.start, Side.RIGHT: joints(each)})[0] for each in straight) < 0.0
