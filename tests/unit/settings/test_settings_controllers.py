from __future__ import annotations

from pathlib import Path

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side
from abb_runtime.parameters import read_parameter_file
from refusals import assert_says, refused
from yumi.control.controllers.joint_position import JointPositionController
from yumi.driver.initial_controllers import check_controllers
from yumi.driver.settings import ControllerSettings, InitialState, read_controllers

RIGHT = Side.RIGHT
LISTED = """
/r/controller_manager:
  ros__parameters:
    update_rate: 250
    position:
      type: yumi_controllers/JointPositionController
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "mine.yaml"


def values(file: Path, text: str, node: str) -> dict[str, object]:
    file.write_text(text)
    return {key: entry.value for key, entry in read_parameter_file(file).parameters(node).items()}


def checked(file: Path, text: str) -> ControllerSettings:
    """The one controller of the right arm, after trying it out."""
    file.write_text(text)
    (settings,) = check_controllers({RIGHT: read_controllers(RIGHT, file)})[RIGHT]
    return settings


@pytest.mark.parametrize("side", list(Side))
def test_delivered_controllers_can_all_be_started(side: Side) -> None:
    settings = check_controllers({side: read_controllers(side)})[side]
    assert [each.state for each in settings] == [None] * len(settings)


def test_parameter_file_keeps_types_and_joins_groups_with_dots(file: Path) -> None:
    text = "/c: {ros__parameters: {a: {b: {c: 1.5}}, d.e: 2, f: yes, g: [x, y], h: [1, 2.5], i: text, j: []}}"
    assert values(file, text, "/c") == {
        "a.b.c": 1.5,
        "d.e": 2,
        "f": True,
        "g": ("x", "y"),
        "h": (1.0, 2.5),
        "i": "text",
        "j": (),
    }


@pytest.mark.parametrize(
    "nodes",
    ["/r/c", "/**", "/**/c", "/*/c", "/r/*", "/r/**", "/**/r/c", "/r/c/**", "r/c", "/r: {c", "r: {/c", "/**: {c"],
)
def test_parameter_file_finds_a_node_by_name_and_wildcard(file: Path, nodes: str) -> None:
    assert values(file, f"{nodes}: {{ros__parameters: {{p: 1}}}}{'}' * nodes.count('{')}", "/r/c") == {"p": 1}


@pytest.mark.parametrize("nodes", ["/l/c", "/c", "/*", "/r", "/r/c/*", "/*/*/c", "/r/cc", "/r/./c"])
def test_parameter_file_keeps_what_is_for_others_from_a_node(file: Path, nodes: str) -> None:
    assert values(file, f"{nodes}: {{ros__parameters: {{p: 1}}}}", "/r/c") == {}


def test_parameter_file_lets_the_later_section_count(file: Path) -> None:
    text = "/**: {ros__parameters: {p: 1, q: 1}}\n/r/c: {ros__parameters: {p: 2}}"
    assert values(file, text, "/r/c") == {"p": 2, "q": 1}


def test_parameter_file_understands_anchors_and_empty_sections(file: Path) -> None:
    text = "/r/c: &c {ros__parameters: {<<: {q: 3}, p: 2}}\n/l/c: *c\n/l/d: {ros__parameters: }\n/l/e:"
    assert values(file, text, "/l/c") == {"p": 2, "q": 3}
    assert values(file, text, "/l/d") == {}


def of_no_type(line: int, parameter: str, value: str) -> Message:
    return message("value_of_no_type", place=f"mine.yaml line {line}", parameter=parameter, value=value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- 1", message("settings_without_mapping", file="mine.yaml")),
        ("/c: [", message("settings_not_yaml_at", line=1, column=6)),
        ("/c: 3", message("section_without_parameters", place="mine.yaml line 1", name="/c")),
        ("/c:\n  ros__parameters: 3", message("section_without_parameters", place="mine.yaml line 2", name="/c")),
        ("/c:\n  p: 3", message("section_without_parameters", place="mine.yaml line 2", name="/c/p")),
        ("/c:\n  ros__parameters:\n    p:", of_no_type(3, "p", "None")),
        ("/c:\n  ros__parameters:\n    p: [1, x]", of_no_type(3, "p", "[1, 'x']")),
        ("/c:\n  ros__parameters:\n    p: [yes]", of_no_type(3, "p", "[True]")),
        ("/c:\n  ros__parameters:\n    g: {p: 2024-01-01}", of_no_type(3, "g.p", "datetime.date(2024, 1, 1)")),
        (
            "/c:\n  ros__parameters:\n    p: 1\n    p: 2",
            message("setting_given_twice", file="mine.yaml", line=4, setting="p", first=3),
        ),
        (f"/c: {{ros__parameters: {{p: [{'9' * 400}]}}}}", of_no_type(1, "p", f"[{'9' * 79}…")),
    ],
)
def test_parameter_file_is_refused_with_line_and_value(file: Path, text: str, said: Message) -> None:
    file.write_text(text)
    with refused(SettingsError, said.code, **said.values):
        read_parameter_file(file)


def test_missing_parameter_file_is_named(file: Path) -> None:
    with refused(SettingsError, "settings_unreadable", file=str(file), reason="No such file or directory"):
        read_parameter_file(file)


def test_controllers_take_what_their_own_section_and_the_wildcards_say(file: Path) -> None:
    settings = checked(file, LISTED + "/**: {ros__parameters: {p: 0.5}}")
    assert (settings.kind, settings.values) == (JointPositionController.kind, {"p": 0.5})
    assert checked(file, LISTED + "/**/position: {ros__parameters: {p: 1}}").values == {"p": 1}


@pytest.mark.parametrize("state", [None, *InitialState])
def test_controllers_have_an_initial_state(file: Path, state: InitialState | None) -> None:
    file.write_text(LISTED + (f"      initial_state: {state.value}" if state else ""))
    (settings,) = read_controllers(RIGHT, file)
    assert settings.state is state


def test_controllers_may_be_listed_for_both_arms_at_once(file: Path) -> None:
    file.write_text(LISTED.replace("/r/", "/**/"))
    assert [settings.name for side in Side for settings in read_controllers(side, file)] == ["position", "position"]


def no_node(name: str) -> Message:
    known = ("/r/controller_manager", "/r/position", "/l/controller_manager")
    return message("section_of_no_node", place="mine.yaml line 7", name=name, known=known)


def no_setting(setting: str, value: str) -> Message:
    place = "mine.yaml line 7"
    return message("controller_manager_setting_unknown", place=place, setting=setting, value=value, rate=250)


def refused_at(line: int, reason: Message) -> Message:
    return message("setting_refused", place=f"mine.yaml line {line}", reason=reason)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("/r/place: {ros__parameters: {p: 1}}", no_node("/r/place")),
        ("/r/place: {ros__parameters: }", no_node("/r/place")),
        ("/l/position: {ros__parameters: {p: 1}}", no_node("/l/position")),
        ("      kind: x", no_setting("position.kind", "'x'")),
        ("    other: {initial_state: active}", no_setting("other.initial_state", "'active'")),
        ("    update_rte: 250", no_setting("update_rte", "250")),
        (
            "    other: {type: 3}",
            refused_at(7, message("value_of_wrong_type", parameter="other.type", value="3", type="a text")),
        ),
        (
            "    other: {type: a/B}",
            message("controller_of_unknown_type", place="mine.yaml line 7", controller="other", type="a/B"),
        ),
        (
            "      initial_state: on",
            refused_at(
                7,
                message(
                    "value_not_a_choice",
                    parameter="position.initial_state",
                    value="True",
                    choices=tuple(each.value for each in InitialState),
                ),
            ),
        ),
        (
            "/r/position: {ros__parameters: {p: x}}",
            refused_at(
                7,
                message(
                    "controller_parameter_refused",
                    controller="position",
                    parameter="p",
                    reason=message("value_of_wrong_type", parameter="p", value="'x'", type="a number"),
                ),
            ),
        ),
        (
            "/**:\n  ros__parameters:\n    q: 3",
            message("parameter_of_no_controller", place="mine.yaml line 9", parameter="q"),
        ),
    ],
)
def test_controllers_are_refused_with_file_and_line(file: Path, more: str, said: Message) -> None:
    with refused(SettingsError, said.code, **said.values):
        checked(file, LISTED + more)


@pytest.mark.parametrize(
    ("more", "line", "said"),
    [
        (
            "    two words: {type: yumi_controllers/JointPositionController}",
            7,
            message("controller_name_not_allowed", controller="two words"),
        ),
        ("      initial_state: active", 6, message("controller_without_egm", controller="position")),
        (
            "/r/position: {ros__parameters: {q: 1}}",
            7,
            message("controller_parameter_unknown", controller="position", parameter="q"),
        ),
        (
            "/r/position:\n  ros__parameters:\n    p: 3",
            9,
            message(
                "controller_parameter_refused",
                controller="position",
                parameter="p",
                reason=message("value_out_of_range", parameter="p", value="3", lowest=0.0, highest=2.0, unit=""),
            ),
        ),
    ],
)
def test_what_a_controller_refuses_is_said_with_file_and_line(file: Path, more: str, line: int, said: Message) -> None:
    with refused(SettingsError, "setting_refused", place=f"mine.yaml line {line}") as refusal:
        checked(file, LISTED + more)
    assert_says(refusal.value.said.values["reason"], said.code, **said.values)


def test_update_rate_other_than_the_robots_is_refused(file: Path) -> None:
    with refused(SettingsError, "controller_manager_setting_unknown", setting="update_rate", value="100", rate=250):
        checked(file, LISTED.replace("250", "100"))


def test_sections_of_one_name_add_up_as_in_ros(file: Path) -> None:
    text = "/**: {c: {ros__parameters: {p: 1}}}\n/**: {d: {ros__parameters: {p: 3}}, c: {ros__parameters: {q: 2}}}"
    assert values(file, text, "/r/c") == {"p": 1, "q": 2}
