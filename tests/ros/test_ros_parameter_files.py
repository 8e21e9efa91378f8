"""Parameter files in the format of other projects, loaded as the spawner does: by calling services."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Concatenate, ParamSpec, TypeVar

import pytest
from controller_manager_bench import Manager, get_parameter, set_parameter, text
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import Client
from std_msgs.msg import String

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Side, home, joint_names
from abb_protocols.robot.urdf import robot_description
from abb_runtime.clock import SystemClock
from controller_arms import LimitedArm, PerfectArm
from reported_limiter import ReportedLimiter
from yumi.control.goals import MemoryBuffer
from yumi.control.loop import ArmLoop
from yumi.control.loop_commands import Commands, serve
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.place import Place
from yumi.control.speed_scale import SpeedScale
from yumi.driver.control_process import ArmBuffers
from yumi.driver.initial_controllers import CONTROLLER_KINDS
from yumi.ros.controller_manager_node import ControllerManagerNode
from yumi.ros.nodes import TimerThread

pytestmark = pytest.mark.ros

FILES = Path(__file__).parents[1] / "fixtures" / "parameter_files"
NAMES = list(joint_names(Side.RIGHT))
P = ParamSpec("P")
T = TypeVar("T")


class RightArm:
    """The controllers of the driver on an arm in memory, in this process."""

    def __init__(self) -> None:
        buffers = ArmBuffers()

        def factory(kind: str) -> Callable[[str], Any]:
            return lambda name: CONTROLLER_KINDS[kind](
                Place(name, Side.RIGHT, buffers, {}, YUMI_LIMITS, CYCLE, SpeedScale())
            )

        manager = ControllerManager(joint_names(Side.RIGHT), {kind: factory(kind) for kind in CONTROLLER_KINDS})
        limiter = ReportedLimiter(YUMI_LIMITS)
        arm = LimitedArm(PerfectArm(home(Side.RIGHT)), limiter)
        self._commands = Commands({Side.RIGHT: ArmLoop(Side.RIGHT, arm, manager, limiter, MemoryBuffer())}, lambda: 0.0)

    def call(self, command: Callable[Concatenate[Commands, P], T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        return serve(self._commands, command, *args, **kwargs)


@pytest.fixture(scope="module")
def rig(ros: None) -> Iterator[SimpleNamespace]:
    executor, clock = SingleThreadedExecutor(), SystemClock()
    arm = ControllerManagerNode(Side.RIGHT, "/r", RightArm(), [], executor, {}, clock, TimerThread(clock, print))
    client = Client(executor)
    logs: list[Log] = []
    client.node.create_subscription(Log, "/rosout", logs.append, 100)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.node.create_publisher(String, "/r/robot_description", latched).publish(String(data=robot_description()))
    yield SimpleNamespace(client=client, manager=Manager(client), logs=logs)
    client.close()
    arm.destroy()


@pytest.fixture
def manager(rig: SimpleNamespace) -> Iterator[Manager]:
    """With nothing loaded before and after."""
    manager: Manager = rig.manager
    yield manager
    for name in manager.controllers():
        assert manager.call("unload_controller", name=name).ok
    rig.client.sentences.clear()
    rig.logs.clear()


def spawned(manager: Manager, name: str, file: str, kind: str | None = None) -> bool:
    """As ``spawner NAME --inactive -p FILE``; ``kind`` where the file has a type among the controller's parameters."""
    return manager.spawn(name, kind, [str(FILES / file)], inactive=True)


def no_choice(controller: str, parameter: str, value: str, *choices: str) -> Message:
    """A parameter has a value that it cannot have."""
    reason = message("value_not_a_choice", parameter=parameter, value=value, choices=choices)
    return message("controller_parameter_refused", controller=controller, reason=reason)


def hears(manager: Manager, sentence: str) -> None:
    manager.client.until(manager.client.hears(sentence), what=sentence)


@pytest.mark.parametrize(
    ("file", "name", "values"),
    [
        ("ur.yaml", "joint_state_broadcaster", {}),
        (
            "ur.yaml",
            "ur_joint_trajectory_controller",
            {
                "command_interfaces": ["position"],
                "state_publish_rate": 100.0,
                "constraints.stopped_velocity_tolerance": 0.2,
                "constraints.yumi_joint_7_r.trajectory": 0.2,
            },
        ),
        ("ur.yaml", "ur_forward_position_controller", {"joints": NAMES, "interface_name": "position"}),
        ("ur.yaml", "ur_forward_velocity_controller", {"joints": NAMES, "interface_name": "velocity"}),
        ("franka.yaml", "joint_state_broadcaster", {"use_local_topics": False, "publish_dynamic_joint_states": False}),
        ("franka.yaml", "fr3_arm_controller", {"state_interfaces": ["position", "velocity"], "update_rate": 248}),
        (
            "openarm.yaml",
            "right_joint_trajectory_controller",
            {"constraints.goal_time": 0.6, "open_loop_control": True, "update_rate": 248},
        ),
        ("openarm.yaml", "right_forward_position_controller", {"joints": NAMES}),
        ("openarm.yaml", "joint_state_broadcaster", {"update_rate": 248}),
        ("ros2_control_demos.yaml", "joint_state_broadcaster", {}),
    ],
)
def test_controller_of_a_foreign_file_is_loaded_with_its_parameters(
    manager: Manager, file: str, name: str, values: dict[str, object]
) -> None:
    assert spawned(manager, name, file), manager.client.sentences
    assert manager.state(name) in {"inactive", "active"}
    assert {each: value(manager, name, each) for each in values} == values


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("demo_position_controller", "forward_command_controller/ForwardCommandController"),
        ("demo_trajectory_controller", "joint_trajectory_controller/JointTrajectoryController"),
    ],
)
def test_type_may_stand_with_the_controller(rig: SimpleNamespace, manager: Manager, name: str, kind: str) -> None:
    assert spawned(manager, name, "ros2_control_demos.yaml", kind)
    assert manager.controllers()[name].type == kind
    assert not [log.msg for log in rig.logs if log.level > Log.INFO[0]]


@pytest.mark.parametrize(
    ("file", "name", "sentences"),
    [
        (
            "ur.yaml",
            "ur_joint_trajectory_controller",
            ["'speed_scaling.state_interface' of 'ur_joint_trajectory_controller' stays '': every trajectory follows"],
        ),
        ("franka.yaml", "fr3_arm_controller", ["'gains' of 'fr3_arm_controller' is not used: gains are for velocity"]),
        (
            "franka.yaml",
            "joint_state_broadcaster",
            ["'publish_dynamic_joint_states' of 'joint_state_broadcaster' stays"],
        ),
        (
            "openarm.yaml",
            "right_joint_trajectory_controller",
            [
                "'open_loop_control' of 'right_joint_trajectory_controller' stays True: a motion always continues",
                "'allow_integration_in_goal_trajectories' of 'right_joint_trajectory_controller' stays False: points",
                "'interface_name' of 'right_joint_trajectory_controller' is not used: a trajectory controller has",
            ],
        ),
    ],
)
def test_parameter_that_changes_nothing_is_logged_with_the_reason(
    manager: Manager, file: str, name: str, sentences: list[str]
) -> None:
    assert spawned(manager, name, file)
    for sentence in sentences:
        hears(manager, f"Parameter {sentence}")


@pytest.mark.parametrize(
    ("file", "name", "said"),
    [
        ("ur.yaml", "ur_scaled_trajectory_controller", "take joint_trajectory_controller/JointTrajectoryController"),
        ("ur.yaml", "ur_forward_effort_controller", "EGM takes no efforts"),
        (
            "franka.yaml",
            "gravity_compensation_example_controller",
            message(
                "controller_type_unknown",
                controller="gravity_compensation_example_controller",
                type="franka_example_controllers/GravityCompensationExampleController",
                types=tuple(CONTROLLER_KINDS),
            ),
        ),
        (
            "franka.yaml",
            "fr3_effort_arm_controller",
            no_choice("fr3_effort_arm_controller", "command_interfaces", "('effort',)", "position", "velocity"),
        ),
        (
            "openarm.yaml",
            "right_gripper_controller",
            message("parameter_joint_foreign", joint="gripper_r_joint", joints=tuple(NAMES)),
        ),
        (
            "openarm.yaml",
            "left_joint_trajectory_controller",
            message("parameter_joint_foreign", joint="yumi_joint_1_l", joints=tuple(NAMES)),
        ),
    ],
)
def test_what_this_robot_does_not_have_is_refused_with_a_sentence(
    manager: Manager, file: str, name: str, said: Message | str
) -> None:
    assert not spawned(manager, name, file)
    hears(manager, str(said))


@pytest.mark.parametrize(
    ("section", "said"),
    [
        (
            "/**/mine: {ros__parameters: {constrains: {goal_time: 1.0}}}",
            message(
                "parameter_unknown_similar",
                name="constrains.goal_time",
                node="mine",
                similar="constraints.goal_time",
            ),
        ),
        (
            "mine: {ros__parameters: {action_monitor_rate: 5.0}}",
            message(
                "section_of_other_node",
                place="mine.yaml line 1",
                section="/mine",
                node="/r/mine",
                controller="mine",
            ),
        ),
        (
            "/r/mine: {ros__parameters: {interpolation_method: none}}",
            no_choice("mine", "interpolation_method", "'none'", "splines"),
        ),
        ("/r/mine: {ros__parameters: {state_publish_rate: 100}}", "of type 'INTEGER', expecting type 'DOUBLE'"),
    ],
)
def test_mistake_in_a_file_is_refused_with_a_sentence(
    manager: Manager, tmp_path: Path, section: str, said: Message | str
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(section)
    assert not manager.spawn("mine", "joint_trajectory_controller/JointTrajectoryController", [str(file)])
    hears(manager, str(said))
    assert manager.state("mine") == "not loaded"


@pytest.mark.parametrize(
    "sections",
    [
        "r: {mine: {ros__parameters: {PARAMETERS}}}",
        "/**: {mine: {ros__parameters: {PARAMETERS}}}",
        "/*/mine: {ros__parameters: {PARAMETERS}}",
        "/**: {ros__parameters: {robot_ip: 10.0.0.1, use_sim_time: false}}\n/r/*: {ros__parameters: {PARAMETERS}}",
        "/r/controller_manager: {ros__parameters: {mine.type: KIND}}\n/r/mine: {ros__parameters: {PARAMETERS}}",
        "r: {controller_manager: {ros__parameters: {mine: {type: KIND}}}, mine: {ros__parameters: {PARAMETERS}}}",
    ],
)
def test_file_is_loaded_however_it_names_the_node(manager: Manager, tmp_path: Path, sections: str) -> None:
    kind = "joint_trajectory_controller/JointTrajectoryController"
    file = tmp_path / "mine.yaml"
    parameters = f"joints: [{', '.join(NAMES)}], constraints.goal_time: 0.5, state_publish_rate: 30.0"
    file.write_text(sections.replace("PARAMETERS", parameters).replace("KIND", kind))
    assert manager.spawn("mine", None if "type" in sections else kind, [str(file)], inactive=True)
    assert value(manager, "mine", "state_publish_rate") == 30.0
    assert value(manager, "mine", "constraints.goal_time") == 0.5


def test_qos_overrides_of_a_dumped_file_are_logged_as_not_used(manager: Manager, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    overrides = "qos_overrides: {/parameter_events: {publisher: {depth: 1000, reliability: reliable}}}"
    file.write_text(f"/r/mine: {{ros__parameters: {{{overrides}}}}}")
    assert manager.spawn("mine", "joint_trajectory_controller/JointTrajectoryController", [str(file)], inactive=True)
    hears(manager, "Parameter 'qos_overrides' of 'mine' is not used: topics have fixed QoS.")


def test_fixed_parameter_cannot_be_set_on_the_node(manager: Manager) -> None:
    assert spawned(manager, "fr3_arm_controller", "franka.yaml")
    refused = set_parameter(manager.client, "/r/fr3_arm_controller", "speed_scaling.state_interface", text("any"))
    assert refused.reason == "Trying to set a read-only parameter: speed_scaling.state_interface."


def value(manager: Manager, controller: str, parameter: str) -> object:
    """A parameter of a controller's node as a Python value."""
    fields = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value", 9: "string_array_value"}
    found = get_parameter(manager.client, f"/r/{controller}", parameter)
    held = getattr(found, fields[found.type])
    return list(held) if found.type == 9 else held
