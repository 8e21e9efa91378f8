"""Foxglove's layout fits the recordings; the app itself is not run here.

Names of panels and fields are those of the last open version of the app, whose layouts later versions read.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from abb_protocols.robot.gripper_values import GripperState, ServoState
from abb_protocols.robot.joints import CHAIN_AXES, JOINT_COUNT, Side
from flight import LOST, flown
from yumi.driver.robot_state import RobotState
from yumi.recording.message_types import recorded_event
from yumi.recording.writer import RecordingWriter

LAYOUT = json.loads((Path(__file__).parents[3] / "config" / "foxglove.json").read_text(encoding="utf-8"))
PANELS: Mapping[str, Mapping[str, Any]] = LAYOUT["configById"]
PATH = re.compile(r"(?P<topic>[\w/-]+)(?P<fields>(?:\.[\w-]+(?:\[\d+\])?)+)(?P<modifier>\.@rad2deg)?")
"""A message path as far as the layout has them: topic, fields with an index, a function of the Plot panel."""


@pytest.fixture(scope="module")
def schemas(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, tuple[str, str, bytes]]:
    """By topic what a recording of a session has: its schema's name, encoding and text."""
    file = tmp_path_factory.mktemp("recording") / "session.mcap"
    with RecordingWriter(file, 1.8e9) as writer:
        writer.add_value("state", 0.0, RobotState(is_connected=True))
        for side in Side:
            writer.add_value(f"{side.value}/gripper", 0.0, GripperState(ServoState.READY, 0, True, 0.01, 0.0, 0.0))
            for frame in flown(10).frames():
                writer.add_frame(side, frame)
        writer.add_event(recorded_event(LOST, 0.1))
    with file.open("rb") as stream:
        found = {channel.topic: schema for schema, channel, _ in make_reader(stream).iter_messages()}
    return {topic: (each.name, each.encoding, each.data) for topic, each in found.items() if each is not None}


def kind(panel: str) -> str:
    return panel.partition("!")[0]


def paths() -> Iterator[tuple[str, str]]:
    """The kind of panel and the message path of each line."""
    for panel, config in PANELS.items():
        for line in config.get("paths", ()):
            yield kind(panel), line["value"]


def topics() -> Iterator[str]:
    """The topics that panels show as a whole."""
    for config in PANELS.values():
        yield from (config[name] for name in ("topicToRender", "topicPath") if name in config)
        yield from (layer["topic"] for layer in config.get("layers", {}).values() if "topic" in layer)


def resolved(schema: Mapping[str, Any], fields: str) -> Mapping[str, Any]:
    """The schema of a field. Raises KeyError where there is none, IndexError where an array has no such place."""
    for name, index in re.findall(r"\.([\w-]+)(?:\[(\d+)\])?", fields):
        schema = schema["properties"][name]
        if index:
            assert "array" in schema["type"]
            if int(index) >= schema["maxItems"]:
                raise IndexError(index)
            schema = schema["items"]
    return schema


def leaves(node: object) -> Iterator[str]:
    if isinstance(node, str):
        yield node
        return
    assert isinstance(node, dict)
    assert node["direction"] in {"row", "column"}
    assert 0 < node["splitPercentage"] < 100
    yield from leaves(node["first"])
    yield from leaves(node["second"])


def test_each_panel_is_shown_once_and_is_one_of_the_app_s() -> None:
    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)
    assert {kind(panel) for panel in PANELS} == {"3D", "Plot", "StateTransitions", "RosOut", "RawMessages"}


def test_topics_are_in_a_recording(schemas: Mapping[str, tuple[str, str, bytes]]) -> None:
    assert set(topics()) == {"robot_description", "events", "state"}
    assert set(topics()) < set(schemas)
    assert schemas["robot_description"][0] == "std_msgs/msg/String"
    assert schemas["events"][0] == "foxglove.Log"
    assert schemas["/tf"][0] == "tf2_msgs/msg/TFMessage"  # moves the robot; the 3D panel takes it by its type


@pytest.mark.parametrize(("panel", "path"), list(paths()))
def test_path_leads_to_a_value_of_a_recording(
    schemas: Mapping[str, tuple[str, str, bytes]], panel: str, path: str
) -> None:
    found = PATH.fullmatch(path)
    assert found is not None
    name, encoding, text = schemas[found["topic"]]
    assert (encoding, name.partition(".")[0]) == ("jsonschema", "yumi")
    types = resolved(json.loads(text), found["fields"]).get("type", "string")  # what is null at first may be anything
    wanted = {"number", "integer"} if panel == "Plot" else {"string", "boolean"}
    assert wanted & set([types] if isinstance(types, str) else types)
    assert panel == "Plot" or found["modifier"] is None


@pytest.mark.parametrize("path", ["r/cycle.positions[0]", "r/cycle.position[7]", "state.egm.right"])
def test_path_that_leads_nowhere_is_found(schemas: Mapping[str, tuple[str, str, bytes]], path: str) -> None:
    found = PATH.fullmatch(path)
    assert found is not None
    with pytest.raises((KeyError, IndexError)):
        resolved(json.loads(schemas[found["topic"]][2]), found["fields"])


def test_all_joints_of_both_arms_are_plotted_by_abb_s_axis_number() -> None:
    plotted = {line["value"]: line["label"] for config in PANELS.values() for line in config.get("paths", ())}
    for index, axis in zip(range(JOINT_COUNT), CHAIN_AXES, strict=True):
        for side in Side:
            assert plotted[f"{side.value}/cycle.position[{index}].@rad2deg"] == f"axis {axis}"
            assert plotted[f"{side.value}/cycle.sent[{index}].@rad2deg"] == f"axis {axis} sent"
            assert plotted[f"tracking_error.{side.word}[{index}].@rad2deg"] == f"{side.word}, axis {axis}"


def test_robot_is_drawn_in_its_own_root_frame() -> None:
    (scene,) = (config for panel, config in PANELS.items() if kind(panel) == "3D")
    layer = scene["layers"]["robot"]
    assert (layer["layerId"], layer["sourceType"], layer["framePrefix"]) == ("foxglove.Urdf", "topic", "")
    assert scene["followTf"] == "yumi_base_link"
