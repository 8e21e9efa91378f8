"""The robot model of a page: the description of a robot as JSON, of a YuMi with its meshes, of others as capsules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2, hypot, radians
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from abb_protocols.robot.gripper_values import FINGER_TRAVEL, MAX_GRIP_FORCE
from abb_protocols.robot.joints import CHAIN_AXES, POSES, YUMI_LIMITS, Side, finger_names, joint_names, set_prefix
from abb_protocols.robot.kinematics import matrix_from_quaternion
from abb_protocols.robot.urdf import MESHES, robot_description
from abb_view.controller_reader import ControllerReader, ReaderUnit

MESH_FOLDER = Path(__file__).with_name("meshes")
"""The meshes of a YuMi."""


def yumi_model() -> dict[str, Any]:
    """Links of a YuMi with their shapes, joints from parent to child, and what the page must know of the arms."""
    set_prefix("")  # the page has names of its own
    urdf = ET.fromstring(robot_description(meshes=MESHES))
    colors = {
        each.get("name"): _numbers(each.find("color"), "rgba", "0.8 0.8 0.8 1")[:3] for each in urdf.findall("material")
    }
    return {
        "links": {
            str(link.get("name")): [_visual(each, colors) for each in link.findall("visual")]
            for link in urdf.findall("link")
        },
        "joints": [_joint(each) for each in urdf.findall("joint")],
        "arms": {
            side.word: {
                "joints": joint_names(side),
                "axes": CHAIN_AXES,
                "fingers": finger_names(side),
                "tip": f"gripper_{side.value}_fingertips",
                "tool0": f"yumi_tool0_{side.value}",
                "poses": {name: pose(side) for name, pose in POSES.items()},
            }
            for side in Side
        },
        "limits": {"lower": YUMI_LIMITS.lower, "upper": YUMI_LIMITS.upper, "velocity": YUMI_LIMITS.velocity},
        "gripper": {"travel": FINGER_TRAVEL, "force": MAX_GRIP_FORCE},
    }


def controller_model(reader: ControllerReader) -> dict[str, Any]:
    """As :func:`yumi_model`, of any robot, with its name and units; one without a description has no links to draw."""
    # Not its address: a page gets this without the token.
    model = {**yumi_model(), "controller": {"robot": reader.robot, "units": reader.kind.units}}
    if reader.is_yumi:
        return model
    if reader.kind.is_drawn:
        camera = {"position": [1.75, -1.3, 1.0], "target": [0.15, 0.0, 0.38], "floor": 0.0}
        return {**model, **capsule_model(reader.units[:1]), "camera": camera, "tip": "tool0"}
    return {**model, **capsule_model([replace(unit, arm=None) for unit in reader.units])}


def _visual(visual: ET.Element, colors: dict[str | None, list[float]]) -> dict[str, Any]:
    geometry, material = visual.find("geometry"), visual.find("material")
    assert geometry is not None, "URDF"
    shape = geometry[0]
    sizes = {
        name: [float(number) for number in value.split()] for name, value in shape.items() if name not in {"filename"}
    }
    return {
        "shape": shape.tag,
        "mesh": shape.get("filename", "").rpartition("/")[2],
        **sizes,
        **_origin(visual),
        "color": colors.get(None if material is None else material.get("name"), [0.8, 0.8, 0.8]),
    }


def _joint(joint: ET.Element) -> dict[str, Any]:
    parent, child, mimic = joint.find("parent"), joint.find("child"), joint.find("mimic")
    assert parent is not None, "URDF"
    assert child is not None, "URDF"
    return {
        "name": joint.get("name"),
        "type": joint.get("type"),
        "parent": parent.get("link"),
        "child": child.get("link"),
        "axis": _numbers(joint.find("axis"), "xyz", "0 0 1"),
        "mimic": None if mimic is None else mimic.get("joint"),
        **_origin(joint),
    }


def _origin(element: ET.Element) -> dict[str, list[float]]:
    origin = element.find("origin")
    return {"xyz": _numbers(origin, "xyz", "0 0 0"), "rpy": _numbers(origin, "rpy", "0 0 0")}


def _numbers(element: ET.Element | None, name: str, otherwise: str) -> list[float]:
    return [float(value) for value in (otherwise if element is None else element.get(name, otherwise)).split()]


# ---- what a page draws of a robot that has no meshes here

_COLOR = [0.86, 0.87, 0.88]
_JOINT_COLOR = [0.45, 0.48, 0.52]
_THICKEST, _THINNEST = 0.055, 0.028  # [m] radius of the first and the last link
_SHORTEST = 1e-6  # [m]
_NOWHERE = [0.0, 0.0, 0.0]


def _shape(
    kind: str, color: list[float], xyz: list[float] = _NOWHERE, rpy: list[float] = _NOWHERE, **sizes: float
) -> dict[str, Any]:
    """A shape of a link, at a place [m], [rad] of the link; sizes [m] are lists, as in a URDF."""
    given = {name: [size] for name, size in sizes.items()}
    return {"shape": kind, "mesh": "", **given, "xyz": xyz, "rpy": rpy, "color": color}


def capsule_model(units: Sequence[ReaderUnit]) -> dict[str, Any]:
    """The part of the page's model that says how robots are drawn: capsules from axis to axis of a description.

    Args:
        units: one with its description; or any without, of which nothing is drawn.
    """
    arm = units[0].arm if units else None
    if arm is None:
        return {
            "links": {"base_link": []},
            "joints": [],
            "arms": {unit.key: _arm_model(unit, [], "base_link") for unit in units},
            "limits": {"lower": [], "upper": [], "velocity": []},
        }
    unit = units[0]
    names = [f"{unit.name}_{axis}" for axis in arm.axes]
    foot = _shape("cylinder", _JOINT_COLOR, [0.0, 0.0, 0.01], radius=0.09, length=0.02)
    links: dict[str, list[dict[str, Any]]] = {"base_link": [foot], **{name: [] for name in names}, "tool0": []}
    joints = []
    for index, (name, after) in enumerate(zip([*names, "tool0"], [*names[1:], "tool0", ""], strict=True)):
        share = index / len(names)
        radius = _THICKEST + share * (_THINNEST - _THICKEST)
        is_tool, parent = name == "tool0", "base_link" if index == 0 else names[index - 1]
        axis = [0.0, 0.0, 0.0] if is_tool else [float(about == arm.turns_about[index]) for about in range(3)]
        joints.append(
            {
                "name": name,
                "type": "fixed" if is_tool else "revolute",
                "parent": parent,
                "child": name,
                "axis": axis,
                "mimic": None,
                # tool0 has its z axis along the foot's x in the all-zero pose.
                "xyz": arm.offsets[index].tolist(),
                "rpy": [0.0, radians(90.0), 0.0] if is_tool else _NOWHERE,
            }
        )
        links[parent] += _capsule(arm.offsets[index].tolist(), radius)
        if after:
            links[name].append(_hub(axis, radius))
    x, y, z = arm.foot_to_world.position
    joints[0]["xyz"] = [a + b for a, b in zip((x, y, z), joints[0]["xyz"], strict=True)]
    assert np.allclose(matrix_from_quaternion(arm.foot_to_world.orientation), np.eye(3)), "a foot that stands upright"
    return {
        "links": links,
        "joints": joints,
        "arms": {unit.key: _arm_model(unit, names, "tool0")},
        "limits": {"lower": arm.limits.lower, "upper": arm.limits.upper, "velocity": arm.limits.velocity},
    }


def _arm_model(unit: ReaderUnit, joints: list[str], tip: str) -> dict[str, Any]:
    home = unit.arm.home if unit.arm is not None else [0.0] * len(unit.axes)
    return {"joints": joints, "axes": unit.axes, "fingers": [], "tip": tip, "tool0": tip, "poses": {"home": home}}


def _capsule(end: list[float], radius: float) -> list[dict[str, Any]]:
    """A cylinder from a link's origin to ``end`` [m] with a ball there; nothing where that is at the origin."""
    x, y, z = end
    length = hypot(x, y, z)
    if length < _SHORTEST:
        return []
    middle, rpy = [x / 2.0, y / 2.0, z / 2.0], [0.0, atan2(hypot(x, y), z), atan2(y, x)]
    return [
        _shape("cylinder", _COLOR, middle, rpy, radius=radius, length=length),
        _shape("sphere", _COLOR, end, radius=radius),
    ]


def _hub(axis: list[float], radius: float) -> dict[str, Any]:
    """A short cylinder along a joint's axis, so that its turning is seen."""
    x, y, z = axis
    rpy = [0.0, atan2(hypot(x, y), z), atan2(y, x)]
    return _shape("cylinder", _JOINT_COLOR, rpy=rpy, radius=0.8 * radius, length=2.5 * radius)
