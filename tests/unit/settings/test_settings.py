from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import Side
from abb_runtime.parameters import ParameterType, read_parameter_file
from refusals import assert_says, refused
from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.tool_limits import ToolLimits, Wall
from yumi.driver.settings import Settings, config_folder, override, read_controllers, read_settings


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "mine.yaml"


def test_delivered_settings_are_the_defaults() -> None:
    assert read_settings() == Settings()


def test_delivered_egm_settings_are_the_fullspeed_ones_of_the_thesis() -> None:
    motion = read_settings().egm_motion
    assert (motion.use_filtering, motion.comm_timeout, motion.lp_filter, motion.sample_rate) == (False, 60.0, 0.0, 4)
    assert (motion.max_speed_deviation, motion.ramp_in_time, motion.pos_corr_gain) == (180.0, 0.1, 1.0)


@pytest.mark.parametrize("side", list(Side))
def test_delivered_controllers_have_the_names_of_the_interface(side: Side) -> None:
    kinds = {entry.name: entry.kind for entry in read_controllers(side)}
    assert kinds["joint_state_broadcaster"] == "joint_state_broadcaster/JointStateBroadcaster"
    assert kinds["joint_position_controller"] == JointPositionController.kind
    assert {"joint_velocity_controller", "forward_position_controller", "forward_velocity_controller"} < {*kinds}
    assert kinds["joint_goal_controller"] == JointGoalController.kind
    assert {"joint_trajectory_controller", "dual_arm_trajectory_controller"} < {*kinds}


def test_delivered_gain_is_the_thesis_s_cautious_one() -> None:
    values = {entry.name: entry.values for entry in read_controllers(Side.RIGHT)}
    assert values["joint_position_controller"]["p"] == 1.2


def test_every_start_says_that_nothing_keeps_the_arms_apart(file: Path) -> None:
    file.write_text("collision: {enabled: false}\n")
    (remark,) = read_settings(file).collision.remarks
    assert remark == message("nothing_keeps_arms_apart")


def test_arms_are_kept_apart_unless_the_settings_say_otherwise(file: Path) -> None:
    file.write_text("robot: {address: 127.0.0.1}\n")
    collision = read_settings(file).collision
    assert collision.enabled
    assert not collision.remarks


def test_settings_may_name_only_what_differs(file: Path) -> None:
    file.write_text("robot: {address: 10.0.0.7}\n")
    settings = read_settings(file)
    assert (settings.robot.address, settings.robot.rws_port) == ("10.0.0.7", 80)


@pytest.mark.parametrize(("text", "scale"), [("auto", None), ("null", None), ("0.1", 0.1), ("1", 1.0)])
def test_speed_scale_is_a_number_or_left_to_the_address(file: Path, text: str, scale: float | None) -> None:
    file.write_text(f"robot: {{speed_scale: {text}}}\n")
    assert read_settings(file).robot.speed_scale == scale


def egm_tool(mass: str) -> str:
    return (
        f'egm_motion: {{tool: "[TRUE,[[0,0,114.2],[1,0,0,0]],[{mass},[8.2,11.7,52],[1,0,0,0],0.0002,0.0002,0.0001]]"}}'
    )


def of_value(place: str, code: str, parameter: str, value: str, **allowed: object) -> Message:
    """That a value at this place is refused."""
    return message("setting_refused", place=place, reason=message(code, parameter=parameter, value=value, **allowed))


def not_in_range(place: str, parameter: str, value: str, lowest: float, highest: float, unit: str = "") -> Message:
    code = "value_out_of_range_with_unit" if unit else "value_out_of_range"
    return of_value(place, code, parameter, value, lowest=lowest, highest=highest, unit=unit)


def not_of_type(place: str, parameter: str, value: str, kind: ParameterType) -> Message:
    return of_value(place, "value_of_wrong_type", parameter, value, type=kind.value)


def given_twice(line: int, setting: str, first: int) -> Message:
    return message("setting_given_twice", file="mine.yaml", line=line, setting=setting, first=first)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "robot: {adress: x}",
            message(
                "setting_unknown",
                place="mine.yaml: robot",
                setting="adress",
                known=("address", "rws_port", "user", "password", "timeout", "speed_scale"),
            ),
        ),
        (
            "speed: 3",
            message("setting_unknown", place="mine.yaml", setting="speed", known=tuple(Settings.__dataclass_fields__)),
        ),
        ("robot: {rws_port: 70000}", not_in_range("mine.yaml: robot", "rws_port", "70000", 1, 65535)),
        ("robot: {speed_scale: 0}", not_in_range("mine.yaml: robot", "speed_scale", "0", 0.01, 1.0)),
        ("robot: {speed_scale: .nan}", not_in_range("mine.yaml: robot", "speed_scale", "nan", 0.01, 1.0)),
        ("robot: {speed_scale: slow}", not_of_type("mine.yaml: robot", "speed_scale", "'slow'", ParameterType.DOUBLE)),
        ("robot: {rws_port: '80'}", not_of_type("mine.yaml: robot", "rws_port", "'80'", ParameterType.INTEGER)),
        (
            "egm_motion: {max_speed_deviation: .nan}",
            not_in_range("mine.yaml: egm_motion", "max_speed_deviation", "nan", 0.1, 400.0, "deg/s"),
        ),
        ("gripper: {force: 21}", not_in_range("mine.yaml: gripper", "force", "21", 0.1, 20.0, "N")),
        (
            "egm_motion: {use_filtering: 1}",
            not_of_type("mine.yaml: egm_motion", "use_filtering", "1", ParameterType.BOOL),
        ),
        (
            "egm: {wake: now}",
            of_value("mine.yaml: egm", "value_not_a_choice", "wake", "'now'", choices=("auto", "blocking")),
        ),
        ("robot: {password: 1234}", message("secret_is_no_text", place="mine.yaml: robot: password")),
        ("robot:", message("setting_needs_mapping", place="mine.yaml: robot", value="None")),
        ("robot: here", message("setting_needs_mapping", place="mine.yaml: robot", value="'here'")),
        ("- 1", message("settings_without_mapping", file="mine.yaml")),
        ("collision: {enabled: true}\ncollision: {}", given_twice(2, "collision", 1)),
        ("robot:\n  user: a\n  user: b", given_twice(3, "user", 2)),
        ("collision:\n  boxes:\n    1: {size: [1, 1, 1]}\n    '1': {size: [2, 2, 2]}", given_twice(4, "1", 3)),
        ("collision:\n  boxes: {<<: {table: {}, table: {}}}", given_twice(2, "table", 2)),
        (
            f"robot: {{rws_port: {'9' * 5000}}}",
            message("number_too_long", place="mine.yaml line 1", length=5000, limit=1000),
        ),
        (
            f"robot: {{rws_port: {'9' * 1000}}}",
            not_in_range("mine.yaml: robot", "rws_port", f"{'9' * 80}…", 1, 65535),
        ),
        ("robot: {user: 2024-99-99}", message("value_not_valid", place="mine.yaml line 1", kind="timestamp")),
        (
            "robot: !!python/tuple {user: a}",
            message("tag_not_allowed", place="mine.yaml line 1", tag="tag:yaml.org,2002:python/tuple"),
        ),
        ("robot: &a {user: *a}", message("alias_in_itself", place="mine.yaml line 1")),
    ],
)
def test_settings_are_refused_with_place_value_and_what_is_allowed(file: Path, text: str, said: Message) -> None:
    file.write_text(text)
    with refused(SettingsError, said.code, **said.values):
        read_settings(file)


def test_place_of_what_is_no_yaml_is_said(file: Path) -> None:
    file.write_text("robot: [")
    with refused(SettingsError, "settings_not_yaml_at", file=str(file), line=1, column=9):
        read_settings(file)


@pytest.mark.parametrize("text", [egm_tool("1E+999"), egm_tool("0.2").replace("52", "1E+999")])
def test_tool_that_rapid_does_not_know_is_refused(file: Path, text: str) -> None:
    file.write_text(text)
    with refused(SettingsError, "egm_frame_not_rapid", setting="egm_motion: tool", type="tooldata"):
        read_settings(file)


@pytest.mark.parametrize(("mass", "code"), [(-0.2, "load_out_of_range"), (0.6, "load_too_heavy")])
def test_tool_that_an_arm_cannot_carry_is_refused_with_its_mass(file: Path, mass: float, code: str) -> None:
    file.write_text(egm_tool(str(mass)))
    with refused(SettingsError, "egm_tool_refused", setting="egm_motion: tool") as refusal:
        read_settings(file)
    assert_says(refusal.value.said.values["reason"], code, mass=mass)


def nested(line: int) -> Message:
    return message("settings_nested_too_deeply", file="mine.yaml", line=line, limit=20)


def too_many(line: int) -> Message:
    return message("too_many_settings", file="mine.yaml", line=line, limit=20_000)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"robot: {user: a}\n" * 4_000_000, message("settings_too_large", limit=256)),
        (b"robot:\n  user: \xe9", message("settings_not_in_utf8", line=2, byte=0xE9)),
        (b"robot: " + b"[" * 20_000, nested(1)),
        (b"{a: " * 20_000, nested(1)),
        (b"robot:\n" + b"- " * 20_000, nested(2)),
        (b"r: [" + b"1," * 60_000, too_many(1)),
        (
            b"a: &a0 [1]\n" + b"".join(b"b%d: &a%d [*a%d]\n" % (each, each, each - 1) for each in range(1, 500)),
            nested(19),
        ),
        (
            b"a: &a0 [1]\n"
            + b"".join(b"b%d: &a%d [%s]\n" % (each, each, b"*a%d," % (each - 1) * 9) for each in range(1, 9)),
            too_many(6),
        ),
        (
            b"a: &a0 {x: 1}\n"
            + b"".join(b"b%d: &a%d {<<: [%s]}\n" % (each, each, b"*a%d," % (each - 1) * 9) for each in range(1, 7)),
            too_many(5),
        ),
    ],
    ids=["50 MB", "Latin-1", "lists", "mappings", "items", "values", "deep aliases", "wide aliases", "merged aliases"],
)
@pytest.mark.parametrize("read", [read_settings, read_parameter_file], ids=["settings", "parameters"])
def test_file_of_any_size_or_depth_is_refused_at_once(
    file: Path, read: Callable[[Path], object], content: bytes, said: Message
) -> None:
    file.write_bytes(content)
    begin = time.process_time()
    with refused(SettingsError, said.code, **said.values):
        read(file)
    assert time.process_time() - begin < 5.0


def test_key_overrides_one_of_a_mapping_that_is_merged(file: Path) -> None:
    file.write_text("robot: &robot {user: a, timeout: 1}\negm: {}\n")
    assert read_settings(file).robot.user == "a"
    file.write_text("collision: {boxes: {a: &box {size: [1, 1, 1]}, b: {<<: *box, position: [1, 0, 0]}, c: *box}}")
    boxes = read_settings(file).collision.boxes
    assert [box.position[0] for box in boxes.values()] == [0.0, 1.0, 0.0]
    file.write_text("collision: {boxes: {a: &box {size: [1, 1, 1]}, b: {<<: *box, size: [2, 2, 2]}}}")
    assert [box.size[0] for box in read_settings(file).collision.boxes.values()] == [1.0, 2.0]


def test_missing_settings_file_is_named(file: Path) -> None:
    with refused(SettingsError, "settings_unreadable", file=str(file), reason="No such file or directory"):
        read_settings(file)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("{}", "no_controller_listed"),
        ("/r/controller_manager: {ros__parameters: 3}", "section_without_parameters"),
    ],
)
def test_controllers_are_refused_with_the_section_at_fault(file: Path, text: str, code: str) -> None:
    file.write_text(text)
    with refused(SettingsError, code, name="/r/controller_manager"):
        read_controllers(Side.RIGHT, file)


def test_every_setting_in_the_delivered_file_is_explained_by_its_class() -> None:
    text = (config_folder() / "yumi.yaml").read_text()
    groups = re.findall(r"^(\w+):$", text, re.MULTILINE)
    assert groups == [
        "robot",
        "egm",
        "egm_motion",
        "gripper",
        "watchdog",
        "recovery",
        "collision",
        "tool_limits",
        "ros",
        "recorder",
    ]


def test_overridden_settings_keep_the_others() -> None:
    settings = override(Settings(), {"robot": {"rws_port": 8080}, "egm": {}}, "command line")
    assert (settings.robot.rws_port, settings.robot.address) == (8080, "192.168.125.1")
    assert settings.egm == Settings().egm


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"robot": {"rws_port": 0}}, not_in_range("command line: robot", "rws_port", "0", 1, 65535)),
        ({"egm": {"left_port": 99999}}, not_in_range("command line: egm", "left_port", "99999", 1, 65535)),
        ({"robot": {"adress": "x"}}, message("setting_unknown", place="command line: robot", setting="adress")),
    ],
)
def test_overriding_values_keep_the_bounds_of_the_file(values: dict[str, dict[str, object]], said: Message) -> None:
    with refused(SettingsError, said.code, **said.values):
        override(Settings(), values, "command line")


def test_boxes_and_tools_are_shapes_of_the_robots_surroundings(file: Path) -> None:
    file.write_text(
        "collision: {boxes: {table: {position: [0.4, 0, -0.05], size: [0.6, 1.2, 0.1], rpy: [0, 0, 1.57]}}, "
        "left_tools: {needle: {start: [0, 0, 0.1], end: [0, 0, 0.3], radius: 0.004}}}"
    )
    model = read_settings(file).collision.model(SERVO_GRIPPERS)
    assert model.names[-1] == "table"
    assert model.names[model.arms[Side.LEFT]][-1] == "left needle"
    assert "right needle" not in model.names


def test_walls_have_normals_of_length_one(tmp_path: Path) -> None:
    file = tmp_path / "yumi.yaml"
    file.write_text("tool_limits: {speed: 0.5, walls: {window: {point: [0.6, 0, 0], normal: [-2, 0, 0]}}}")
    limits = read_settings(file).tool_limits.limits
    assert limits == ToolLimits(0.5, (Wall("window", (0.6, 0.0, 0.0), (-1.0, 0.0, 0.0)),))
    assert limits.walls[0].distance((0.5, 1.0, 1.0)) == pytest.approx(0.1)
    assert read_settings().tool_limits.limits == ToolLimits(1.5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "collision: {boxes: [table]}",
            message("setting_needs_names", place="mine.yaml: collision: boxes", value="['table']"),
        ),
        (
            "collision: {boxes: {table: {size: [1, 1]}}}",
            message("setting_is_no_vector", place="collision: boxes", setting="size", count=2),
        ),
        (
            "collision: {boxes: {table: {size: [1, 0, 1]}}}",
            message("box_without_size", place="collision: boxes", size=(1.0, 0.0, 1.0)),
        ),
        (
            "collision: {boxes: {table: {extent: [1, 1, 1]}}}",
            message(
                "setting_unknown",
                place="mine.yaml: collision: boxes: table",
                setting="extent",
                known=("position", "size", "rpy"),
            ),
        ),
        (
            "collision: {boxes: {table: {size: wide}}}",
            not_of_type("mine.yaml: collision: boxes: table", "size", "'wide'", ParameterType.DOUBLE_ARRAY),
        ),
        ("tool_limits: {speed: 2.0}", not_in_range("mine.yaml: tool_limits", "speed", "2", 0.01, 1.5, "m/s")),
        (
            "tool_limits: {walls: {window: {point: [1, 2]}}}",
            message("setting_is_no_vector", place="tool_limits: walls", setting="point", count=2),
        ),
        (
            "tool_limits: {walls: {window: {normal: [0, 0, 0]}}}",
            message("wall_without_direction", place="tool_limits: walls"),
        ),
        (
            "tool_limits: {walls: [window]}",
            message("setting_needs_names", place="mine.yaml: tool_limits: walls", value="['window']"),
        ),
        (
            "collision: {right_tools: {needle: {radius: 0}}}",
            not_in_range("mine.yaml: collision: right_tools: needle", "radius", "0", 0.001, 0.5, "m"),
        ),
    ],
)
def test_boxes_and_tools_are_refused_with_place_and_what_is_allowed(file: Path, text: str, said: Message) -> None:
    file.write_text(text)
    with refused(SettingsError, said.code, **said.values):
        read_settings(file)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("collision: {boxes: {body: {size: [1, 1, 1]}}}", {"name": "body"}),
        ("collision: {boxes: {'': {size: [1, 1, 1]}}}", {"name": ""}),
        ("collision: {right_tools: {gripper: {}}}", {"name": "gripper", "arm": "right"}),
        (
            "collision: {boxes: {" + "".join(f"b{each}: {{size: [1, 1, 1]}}, " for each in range(101)) + "}}",
            {"name": "b100"},
        ),
    ],
)
def test_declared_parts_that_the_robot_cannot_have_are_refused_with_file_and_group(
    file: Path, text: str, values: dict[str, str]
) -> None:
    file.write_text(text)
    with refused(SettingsError, "setting_refused", place="mine.yaml: collision") as refusal:
        read_settings(file)
    reason = refusal.value.said.values["reason"]
    assert values.items() <= reason.values.items(), reason.code


def test_as_many_boxes_as_are_allowed_are_taken(file: Path) -> None:
    box = "{size: [1, 1, 1]}"
    file.write_text("collision: {boxes: {" + "".join(f"b{each}: {box}, " for each in range(100)) + "}}")
    assert len(read_settings(file).collision.boxes) == 100
