from __future__ import annotations

import re
from pathlib import Path

import pytest

from yumi.control.controllers.joint_position import JointPositionController
from yumi.driver.settings import ControllerSettings, InitialState, read_controllers
from yumi.driver.wiring import check_controllers
from yumi.errors import SettingsError
from yumi.robot.joints import Side
from yumi.settings import read_parameter_file

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


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("- 1", "mine.yaml must hold a mapping of settings."),
        ("/c: [", "mine.yaml is not YAML in line 1, column 6; quote texts"),
        ("/c: 3", "mine.yaml line 1: /c needs a mapping 'ros__parameters'."),
        ("/c:\n  ros__parameters: 3", "mine.yaml line 2: /c needs a mapping 'ros__parameters'."),
        ("/c:\n  p: 3", "mine.yaml line 2: /c/p needs a mapping 'ros__parameters'."),
        ("/c:\n  ros__parameters:\n    p:", "mine.yaml line 3: p is None; it must be a truth value, a number"),
        ("/c:\n  ros__parameters:\n    p: [1, x]", "mine.yaml line 3: p is [1, 'x']; it must be"),
        ("/c:\n  ros__parameters:\n    p: [yes]", "mine.yaml line 3: p is [True]; it must be"),
        ("/c:\n  ros__parameters:\n    g: {p: 2024-01-01}", "mine.yaml line 3: g.p is datetime.date(2024, 1, 1)"),
        ("/c:\n  ros__parameters:\n    p: 1\n    p: 2", "mine.yaml line 4: p stands in line 3 already; remove one."),
        (f"/c: {{ros__parameters: {{p: [{'9' * 400}]}}}}", f"mine.yaml line 1: p is [{'9' * 79}…; it must be a truth"),
    ],
)
def test_parameter_file_is_refused_with_a_sentence(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)
    with pytest.raises(SettingsError, match=re.escape(sentence)):
        read_parameter_file(file)


def test_missing_parameter_file_is_named(file: Path) -> None:
    with pytest.raises(SettingsError, match=re.escape(f"Cannot read {file}: No such file or directory.")):
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


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("/r/place: {ros__parameters: {p: 1}}", "mine.yaml line 7: /r/place is not the name of anything here;"),
        ("/r/place: {ros__parameters: }", "mine.yaml line 7: /r/place is not the name of anything here;"),
        ("/l/position: {ros__parameters: {p: 1}}", "there are: /r/controller_manager, /r/position, /l/controller_m"),
        ("      kind: x", "mine.yaml line 7: the controller manager has no setting position.kind = 'x'; it has: <con"),
        ("    other: {initial_state: active}", "line 7: the controller manager has no setting other.initial_state"),
        ("    update_rte: 250", "mine.yaml line 7: the controller manager has no setting update_rte = 250"),
        ("    other: {type: 3}", "mine.yaml line 7: other.type is 3; it must be a text."),
        ("    other: {type: a/B}", "mine.yaml line 7: controller 'other' has type 'a/B'; known are: joint_state_broad"),
        (
            "    two words: {type: yumi_controllers/JointPositionController}",
            "mine.yaml line 7: Controller name 'two wo",
        ),
        (
            "      initial_state: on",
            "line 7: position.initial_state is True; choose one of unloaded, unconfigured,",
        ),
        ("      initial_state: active", "mine.yaml line 6: Controller 'position' cannot start: EGM is not running"),
        ("/r/position: {ros__parameters: {q: 1}}", "mine.yaml line 7: Controller 'position' has no parameter 'q'"),
        ("/r/position: {ros__parameters: {p: x}}", "line 7: Parameter 'p' of controller 'position' is 'x'; it must be"),
        (
            "/r/position:\n  ros__parameters:\n    p: 3",
            "line 9: Parameter 'p' of controller 'position' is 3; allowed",
        ),
        ("/**:\n  ros__parameters:\n    q: 3", "mine.yaml line 9: no controller has a parameter 'q'."),
    ],
)
def test_controllers_are_refused_with_file_and_line(file: Path, more: str, sentence: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(sentence)):
        checked(file, LISTED + more)


def test_update_rate_other_than_the_robots_is_refused(file: Path) -> None:
    with pytest.raises(SettingsError, match="has no setting update_rate = 100; it has:"):
        checked(file, LISTED.replace("250", "100"))


def test_sections_of_one_name_add_up_as_in_ros(file: Path) -> None:
    text = "/**: {c: {ros__parameters: {p: 1}}}\n/**: {d: {ros__parameters: {p: 3}}, c: {ros__parameters: {q: 2}}}"
    assert values(file, text, "/r/c") == {"p": 1, "q": 2}
