"""What the page draws: the robot's description as JSON, with the names, limits and poses of the joints."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree as ET

from yumi.driver.readiness import (
    AUTOMATIC,
    CONFIRMED,
    IDLE_OR_IN_EGM,
    MOTORS_ON,
    NEEDED,
    NO_EMERGENCY_STOP,
    PROGRAM_RUNS,
)
from yumi.robot.description import MESHES, robot_description
from yumi.robot.gripper import MAX_FORCE, TRAVEL
from yumi.robot.joints import CHAIN_AXES, POSES, YUMI_LIMITS, Side, finger_names, joint_names, set_prefix

_ON_PAGE = {
    MOTORS_ON: "“Recover…” switches them on",
    PROGRAM_RUNS: "“Recover…” starts it",
    CONFIRMED: "look at the robot, then press “Recover…”",
    IDLE_OR_IN_EGM: "wait for the end of the RAPID routine, or press “Recover…”",
}
"""Remedies that are the page's button “Recover…”."""

_ON_VIRTUAL = {
    AUTOMATIC: ("press “Turn the key to AUTO”", "key"),
    NO_EMERGENCY_STOP: ("press “Release the emergency stop”", "release-stop"),
}
"""Those of a virtual robot, which has no FlexPendant to go to, with the button of the page."""

_BUTTONS = (
    (r"call robot\.recover\(\)", "press “Start EGM”, or “Recover…” after a stop"),
    (r"robot\.recover\(\)", "“Recover…”"),
    (r"call recover( with the id [\w-]+)?", "press “Recover…”"),
    (r"Call recover", "Press “Recover…”"),
    (r"\(recover\)", "(“Recover…”)"),
    (r", then recover( with the id of the stop)?", ", then press “Recover…”"),
    (r", or recover\b", ", or press “Recover…”"),
    (r"\b[Rr]ecover(?= (?:switches|starts) |; if )", "“Recover…”"),
    (r"stop_egm, then start_egm", "“Stop EGM”, then “Start EGM”"),
    (r"service \S+/calibrate, or robot\.\w+\.gripper\.calibrate\(\) in a script", "press “Calibrate grippers”"),
    (r"end EGM, or wait", "press “Stop EGM”, or wait"),
    (r"Call start_egm", "Press “Start EGM”"),
    (r"call start_egm", "press “Start EGM”"),
)
"""What the driver's sentences say to call, as regular expressions, and the button of the page that does it."""


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
        "remedies": [
            {
                "pattern": _pattern(each.reason),
                "remedy": _ON_PAGE.get(each, each.remedy),
                "button": "recover" if each in _ON_PAGE else "",
                "on_virtual": _ON_VIRTUAL.get(each, ("", ""))[0],
                "button_on_virtual": _ON_VIRTUAL.get(each, ("", ""))[1],
            }
            for each in dict.fromkeys(condition for needed in NEEDED.values() for condition in needed)
        ],
        "buttons": _BUTTONS,
        "gripper": {"travel": TRAVEL, "force": MAX_FORCE},
    }


def _pattern(reason: str) -> str:
    """A regular expression of the page for a reason, whose fields may be anything."""
    return re.sub(r"\\\{\w+\\\}", ".*", re.escape(reason))


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
