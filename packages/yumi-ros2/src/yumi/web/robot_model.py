"""The robot model of a page: the robot's description as JSON, with its arms, grippers and commands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.gripper_values import MAX_FORCE, TRAVEL
from abb_protocols.robot.joints import CHAIN_AXES, POSES, YUMI_LIMITS, Side, finger_names, joint_names, set_prefix
from abb_protocols.robot.urdf import MESHES, robot_description
from yumi.driver.commands import offered_to
from yumi.web.controller_view import ControllerReader, chain_model


def robot_model() -> dict[str, Any]:
    """Links with their shapes, joints from parent to child, and what the page must know of the arms."""
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
        "gripper": {"travel": TRAVEL, "force": MAX_FORCE},
        "commands": [
            {"method": kind.method(), "button": kind.button, "title": kind.summary()}
            for kind in offered_to(FrontEnd.PAGE)
            if kind.button
        ],
    }


def controller_model(reader: ControllerReader) -> dict[str, Any]:
    """As :func:`robot_model`, of any robot; one without a description has no links to draw."""
    model = robot_model()
    if reader.is_yumi:
        return model
    if reader.kind.is_drawn:
        camera = {"position": [1.75, -1.3, 1.0], "target": [0.15, 0.0, 0.38], "floor": 0.0}
        return {**model, **chain_model(reader.units[:1]), "camera": camera, "tip": "tool0"}
    return {**model, **chain_model([replace(unit, arm=None) for unit in reader.units])}


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
