"""What the page draws: the meshes, and the description as JSON."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import yumi
from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import StopNotConfirmed
from abb_protocols.robot.joints import Side, joint_names, named_pose
from abb_protocols.robot.urdf import MESHES, robot_description
from yumi.web.page_words import failure_for_page, words_for_page
from yumi.web.robot_model import robot_model

FOLDER = Path(next(iter(yumi.__path__))) / "meshes"
URDF = ET.fromstring(robot_description(meshes=MESHES))


def triangles(file: Path) -> np.ndarray:
    """Corners of a binary STL [m], (n, 3, 3)."""
    data = file.read_bytes()
    kind = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    return np.frombuffer(data, dtype=kind, offset=84)["corners"].astype(float)


def test_every_mesh_that_the_description_names_is_there_and_no_other() -> None:
    named = {str(mesh.get("filename")) for mesh in URDF.iter("mesh")}
    assert all(each.startswith("package://yumi_ros2/meshes/") for each in named)
    assert {each.rpartition("/")[2] for each in named} == {file.name for file in FOLDER.iterdir()}
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < 2e6


def test_links_that_collide_are_shown_by_meshes_and_collide_as_before() -> None:
    plain = {link.get("name"): link for link in ET.fromstring(robot_description()).iter("link")}
    for link in URDF.iter("link"):
        collisions = [ET.tostring(each) for each in link.findall("collision")]
        assert collisions == [ET.tostring(each) for each in plain[link.get("name")].findall("collision")]
        assert bool(link.findall("visual/geometry/mesh")) == bool(collisions)


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.stl")), ids=lambda file: file.stem)
def test_mesh_is_closed_and_its_triangles_look_outwards(file: Path) -> None:
    corners = np.round(triangles(file), 6)
    edges = np.concatenate([corners[:, (0, 1)], corners[:, (1, 2)], corners[:, (2, 0)]]).reshape(-1, 6)
    there, back = {edge.tobytes() for edge in edges}, {np.roll(edge, 3).tobytes() for edge in edges}
    assert len(there ^ back) <= 0.01 * len(edges)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume > 0.0


def test_poses_and_joints_are_known_to_the_page() -> None:
    model = robot_model()
    assert model["arms"]["left"]["joints"] == joint_names(Side.LEFT)
    assert model["arms"]["right"]["poses"]["home"] == named_pose(Side.RIGHT, "home")
    names = {each["name"] for each in model["joints"]}
    assert names > {*joint_names(Side.LEFT), *joint_names(Side.RIGHT)}


@pytest.mark.parametrize("is_virtual", [True, False])
def test_page_gets_code_sentence_and_the_action_of_its_button(is_virtual: bool) -> None:
    said = message("not_in_auto", mode="MANR")
    front_end = FrontEnd.VIRTUAL_PAGE if is_virtual else FrontEnd.PAGE
    assert words_for_page(said, is_virtual=is_virtual) == {
        "code": "not_in_auto",
        "sentence": sentence(said, front_end),
        "action": "turn_to_auto",
    }
    assert words_for_page(message("system_failure"), is_virtual=is_virtual)["action"] is None


def test_silence_of_a_virtual_robot_is_that_of_a_busy_machine() -> None:
    said = message("feedback_lost", arm="right", silence=0.082, controllers=("a",))
    assert words_for_page(said, is_virtual=True)["code"] == "virtual_robot_was_late"
    assert words_for_page(said, is_virtual=False)["code"] == "feedback_lost"


def test_failure_carries_the_stop_that_a_person_must_confirm() -> None:
    stop = message("stopped_by", causes=(message("event_10013", number=10013, title="Emergency stop"),), stop="10013-4")
    failure = failure_for_page(StopNotConfirmed(stop, "10013-4"), is_virtual=True)
    assert {name: failure[name] for name in ("kind", "code", "stop", "action")} == {
        "kind": "StopNotConfirmed",
        "code": "stopped_by",
        "stop": "10013-4",
        "action": "confirm_stop",
    }
