"""What the page draws: the meshes, and the description as JSON."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from abb_protocols.robot.joints import Side, joint_names, named_pose
from abb_protocols.robot.urdf import MESHES, robot_description
from abb_view.robot_model import MESH_FOLDER, yumi_model

URDF = ET.fromstring(robot_description(meshes=MESHES))


def triangles(file: Path) -> np.ndarray:
    """Corners of a binary STL [m], (n, 3, 3)."""
    data = file.read_bytes()
    kind = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    return np.frombuffer(data, dtype=kind, offset=84)["corners"].astype(float)


def test_every_mesh_that_the_description_names_is_there_and_no_other() -> None:
    named = {str(mesh.get("filename")) for mesh in URDF.iter("mesh")}
    assert all(each.startswith("package://yumi_ros2/meshes/") for each in named)
    assert {each.rpartition("/")[2] for each in named} == {file.name for file in MESH_FOLDER.iterdir()}
    assert sum(file.stat().st_size for file in MESH_FOLDER.iterdir()) < 2e6


def test_links_that_collide_are_shown_by_meshes_and_collide_as_before() -> None:
    plain = {link.get("name"): link for link in ET.fromstring(robot_description()).iter("link")}
    for link in URDF.iter("link"):
        collisions = [ET.tostring(each) for each in link.findall("collision")]
        assert collisions == [ET.tostring(each) for each in plain[link.get("name")].findall("collision")]
        assert bool(link.findall("visual/geometry/mesh")) == bool(collisions)


@pytest.mark.parametrize("file", sorted(MESH_FOLDER.glob("*.stl")), ids=lambda file: file.stem)
def test_mesh_is_closed_and_its_triangles_look_outwards(file: Path) -> None:
    corners = np.round(triangles(file), 6)
    edges = np.concatenate([corners[:, (0, 1)], corners[:, (1, 2)], corners[:, (2, 0)]]).reshape(-1, 6)
    there, back = {edge.tobytes() for edge in edges}, {np.roll(edge, 3).tobytes() for edge in edges}
    assert len(there ^ back) <= 0.01 * len(edges)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume > 0.0


def test_poses_and_joints_are_known_to_the_page() -> None:
    model = yumi_model()
    assert model["arms"]["left"]["joints"] == joint_names(Side.LEFT)
    assert model["arms"]["right"]["poses"]["home"] == named_pose(Side.RIGHT, "home")
    names = {each["name"] for each in model["joints"]}
    assert names > {*joint_names(Side.LEFT), *joint_names(Side.RIGHT)}
