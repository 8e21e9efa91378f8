from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.tool_path import ToolLimits, Wall
from yumi.driver.settings import Settings, config_folder, override, read_controllers, read_settings
from yumi.errors import SettingsError
from yumi.robot.description import SERVO_GRIPPERS
from yumi.robot.joints import Side
from yumi.settings import read_parameter_file


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
    assert remark.startswith("collision.enabled is false: nothing keeps the arms apart")


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


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("robot: {adress: x}", "mine.yaml: robot has no setting 'adress'; it has: address, rws_port"),
        (
            "speed: 3",
            "mine.yaml has no setting 'speed'; it has: robot, egm, egm_motion, gripper, watchdog, recovery, collision",
        ),
        ("robot: {rws_port: 70000}", "mine.yaml: robot: rws_port is 70000; allowed is 1 to 65535."),
        ("robot: {speed_scale: 0}", "mine.yaml: robot: speed_scale is 0; allowed is 0.01 to 1."),
        ("robot: {speed_scale: .nan}", "mine.yaml: robot: speed_scale is nan; allowed is 0.01 to 1."),
        ("robot: {speed_scale: slow}", "mine.yaml: robot: speed_scale is 'slow'; it must be a number."),
        ("robot: {rws_port: '80'}", "mine.yaml: robot: rws_port is '80'; it must be a whole number."),
        ("egm_motion: {max_speed_deviation: .nan}", "max_speed_deviation is nan; allowed is 0.1 to 400 deg/s."),
        ("gripper: {force: 21}", "gripper: force is 21; allowed is 0.1 to 20 N."),
        (egm_tool("-0.2"), "]]': The tool has -0.2 kg at 0.0539271 m from the flange; give a mass from 0 to 0.5 kg"),
        (egm_tool("0.6"), "Tool and payload have 0.6 kg together; an arm carries up to 0.5 kg"),
        (egm_tool("1E+999"), "it must be a RAPID tooldata such as [TRUE,"),
        (egm_tool("0.2").replace("52", "1E+999"), "with finite numbers."),
        ("egm_motion: {use_filtering: 1}", "use_filtering is 1; it must be true or false."),
        ("egm: {wake: now}", "egm: wake is 'now'; choose from: auto, blocking."),
        ("robot: {password: 1234}", "mine.yaml: robot: password must be a text; put it in quotes."),
        ("robot:", "mine.yaml: robot needs a mapping, it has None."),
        ("robot: here", "mine.yaml: robot needs a mapping, it has 'here'."),
        ("- 1", "must hold a mapping of settings."),
        ("robot: [", "mine.yaml is not YAML in line 1, column 9"),
        (
            "collision: {enabled: true}\ncollision: {}",
            "mine.yaml line 2: collision stands in line 1 already; remove one",
        ),
        ("robot:\n  user: a\n  user: b", "mine.yaml line 3: user stands in line 2 already; remove one."),
        (
            "collision:\n  boxes:\n    1: {size: [1, 1, 1]}\n    '1': {size: [2, 2, 2]}",
            "mine.yaml line 4: 1 stands in line 3 already; remove one.",
        ),
        (
            "collision:\n  boxes: {<<: {table: {}, table: {}}}",
            "mine.yaml line 2: table stands in line 2 already; remove one.",
        ),
        (
            f"robot: {{rws_port: {'9' * 5000}}}",
            "mine.yaml line 1: a number has 5000 characters; allowed are 1000.",
        ),
        (f"robot: {{rws_port: {'9' * 1000}}}", f"robot: rws_port is {'9' * 80}…; allowed is 1 to 65535."),
        ("robot: {user: 2024-99-99}", "mine.yaml line 1: what stands there is not a valid timestamp; quote a text."),
        (
            "robot: !!python/tuple {user: a}",
            "mine.yaml line 1 has the tag 'tag:yaml.org,2002:python/tuple'; remove it.",
        ),
        ("robot: &a {user: *a}", "mine.yaml line 1: an alias stands for what it is part of; remove it."),
    ],
)
def test_settings_are_refused_with_a_sentence(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)
    with pytest.raises(SettingsError, match=re.escape(sentence)):
        read_settings(file)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"robot: {user: a}\n" * 4_000_000, "mine.yaml has more than 256 kB, the most a file of settings may have;"),
        (b"robot:\n  user: \xe9", "mine.yaml is not text in UTF-8 from line 2 on: byte 0xe9; save it as UTF-8."),
        (
            b"robot: " + b"[" * 20_000,
            "mine.yaml is nested more than 20 levels deep in line 1; allowed are",
        ),
        (b"{a: " * 20_000, "mine.yaml is nested more than 20 levels deep in line 1; allowed are 20."),
        (b"robot:\n" + b"- " * 20_000, "mine.yaml is nested more than 20 levels deep in line 2"),
        (
            b"r: [" + b"1," * 60_000,
            "mine.yaml has more than 20000 keys and values up to line 1; allowed are 20000, and",
        ),
        (
            b"a: &a0 [1]\n" + b"".join(b"b%d: &a%d [*a%d]\n" % (each, each, each - 1) for each in range(1, 500)),
            "mine.yaml is nested more than 20 levels deep in line 19; allowed are 20.",
        ),
        (
            b"a: &a0 [1]\n"
            + b"".join(b"b%d: &a%d [%s]\n" % (each, each, b"*a%d," % (each - 1) * 9) for each in range(1, 9)),
            "mine.yaml has more than 20000 keys and values up to line 6; allowed are 20000, and what an alias",
        ),
        (
            b"a: &a0 {x: 1}\n"
            + b"".join(b"b%d: &a%d {<<: [%s]}\n" % (each, each, b"*a%d," % (each - 1) * 9) for each in range(1, 7)),
            "mine.yaml has more than 20000 keys and values up to line 5; allowed are 20000",
        ),
    ],
    ids=["50 MB", "Latin-1", "lists", "mappings", "items", "values", "deep aliases", "wide aliases", "merged aliases"],
)
@pytest.mark.parametrize("read", [read_settings, read_parameter_file], ids=["settings", "parameters"])
def test_file_of_any_size_or_depth_is_refused_at_once(
    file: Path, read: Callable[[Path], object], content: bytes, sentence: str
) -> None:
    file.write_bytes(content)
    begin = time.process_time()
    with pytest.raises(SettingsError, match=re.escape(sentence)):
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
    with pytest.raises(SettingsError, match=re.escape(f"Cannot read {file}: No such file or directory.")):
        read_settings(file)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{}", "/r/controller_manager lists no controller with a 'type'"),
        ("/r/controller_manager: {ros__parameters: 3}", "/r/controller_manager needs a mapping 'ros__parameters'"),
    ],
)
def test_controllers_are_refused_with_a_sentence(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)
    with pytest.raises(SettingsError, match=re.escape(sentence)):
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
    ("values", "sentence"),
    [
        ({"robot": {"rws_port": 0}}, "command line: robot: rws_port is 0; allowed is 1 to 65535."),
        ({"egm": {"left_port": 99999}}, "command line: egm: left_port is 99999; allowed is 1 to 65535."),
        ({"robot": {"adress": "x"}}, "command line: robot has no setting 'adress'"),
    ],
)
def test_overriding_values_keep_the_bounds_of_the_file(values: dict[str, dict[str, object]], sentence: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(sentence)):
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
    ("text", "sentence"),
    [
        ("collision: {boxes: [table]}", "collision: boxes needs a mapping of names, it has ['table']."),
        ("collision: {boxes: {table: {size: [1, 1]}}}", "a box's size has 2 values; give x, y, z."),
        ("collision: {boxes: {table: {size: [1, 0, 1]}}}", "each edge is longer than 0 m."),
        (
            "collision: {boxes: {table: {extent: [1, 1, 1]}}}",
            "boxes: table has no setting 'extent'; it has: position",
        ),
        ("collision: {boxes: {table: {size: wide}}}", "size is 'wide'; it must be a list of numbers."),
        ("tool_limits: {speed: 2.0}", "tool_limits: speed is 2; allowed is 0.01 to 1.5 m/s."),
        ("tool_limits: {walls: {window: {point: [1, 2]}}}", "a wall's point has 2 values; give x, y, z."),
        ("tool_limits: {walls: {window: {normal: [0, 0, 0]}}}", "a wall's normal has no direction"),
        ("tool_limits: {walls: [window]}", "tool_limits: walls needs a mapping of names, it has ['window']."),
        ("collision: {right_tools: {needle: {radius: 0}}}", "radius is 0; allowed is 0.001 to 0.5 m."),
        (
            "collision: {boxes: {body: {size: [1, 1, 1]}}}",
            "mine.yaml: collision: Box 'body' refused: a part of the robot has this name; give another one.",
        ),
        ("collision: {boxes: {'': {size: [1, 1, 1]}}}", "collision: Box '' refused: it has no name; give one such as"),
        (
            "collision: {right_tools: {gripper: {}}}",
            "mine.yaml: collision: Tool 'gripper' of the right arm refused: a part of the robot has this name;",
        ),
    ],
)
def test_boxes_and_tools_are_refused_with_a_sentence(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)
    with pytest.raises(SettingsError, match=re.escape(sentence)):
        read_settings(file)


def test_so_many_boxes_are_refused_at_once(file: Path) -> None:
    box = "{size: [1, 1, 1]}"
    file.write_text("collision: {boxes: {" + "".join(f"b{each}: {box}, " for each in range(1000)) + "}}")
    with pytest.raises(
        SettingsError, match=re.escape("collision: Box 'b100' refused: it is one of 1000, allowed are 100.")
    ):
        read_settings(file)
    file.write_text("collision: {boxes: {" + "".join(f"b{each}: {box}, " for each in range(100)) + "}}")
    assert len(read_settings(file).collision.boxes) == 100
