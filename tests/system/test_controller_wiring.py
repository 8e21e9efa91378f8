"""Each delivered controller, made as the driver makes it, takes the goals of its own mailbox."""

from __future__ import annotations

import pytest

from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, Side
from abb_runtime.parameters import Values
from abb_runtime.rws.client import RwsClient
from controller_states import moved
from refusals import refused
from yumi.control.goals import GoalKind, write_goal
from yumi.control.place import Place
from yumi.control.speed_scale import SpeedScale
from yumi.driver.control_process import ArmBuffers
from yumi.driver.initial_controllers import CONTROLLER_KINDS
from yumi.driver.settings import override, read_controllers, read_settings
from yumi.driver.wiring import make_parts
from yumi_evaluation.virtual_time import VirtualArmRig

SIDE = Side.LEFT


@pytest.mark.parametrize(
    ("name", "box", "kind"),
    [
        ("joint_position_controller", "goals", GoalKind.POSITION),
        ("joint_velocity_controller", "speeds", GoalKind.VELOCITY),
        ("forward_position_controller", "forward_positions", GoalKind.FORWARD_POSITION),
        ("forward_velocity_controller", "forward_speeds", GoalKind.FORWARD_VELOCITY),
    ],
)
def test_delivered_controller_takes_the_goals_of_its_mailbox(name: str, box: str, kind: GoalKind) -> None:
    kinds = {entry.name: entry.kind for entry in read_controllers(SIDE)}
    buffers = ArmBuffers()
    place = Place(name, SIDE, buffers, {}, YUMI_LIMITS, CYCLE, SpeedScale(buffers.speed_scale))
    arm = VirtualArmRig({name: CONTROLLER_KINDS[kinds[name]](place)}, side=SIDE)
    arm.start()
    arm.switch_to(name)
    start = arm.robot.arm.planned
    assert arm.snapshot.goal_kind is GoalKind.NONE
    arm.cycle()
    assert arm.snapshot.goal_kind is kind
    write_goal(getattr(buffers, box), 1, moved(start, 6, 0.3), moved(ZERO_JOINTS, 6, 0.3))
    arm.run(0.2)
    assert arm.robot.arm.planned[6] > start[6] + 0.02


@pytest.mark.parametrize("name", ["joint_state_broadcaster", "joint_trajctory_controller"])
def test_controller_that_cannot_command_an_arm_at_first_is_refused_with_those_that_can(name: str) -> None:
    chosen = {"robot": {"address": "127.0.0.1"}, "ros": {"initial_joint_controller": name}}
    settings = override(read_settings(), chosen, "x")
    with refused(SettingsError, "initial_controller_commands_nothing", controller=name, arm="right") as refusal:
        make_parts(settings, {side: read_controllers(side) for side in Side}, ignore, ignore)
    assert refusal.value.said.values["choices"][:2] == ("joint_position_controller", "joint_velocity_controller")


def test_controller_that_commands_an_arm_at_first_may_be_chosen() -> None:
    chosen = {"robot": {"address": "127.0.0.1"}, "ros": {"initial_joint_controller": "joint_trajectory_controller"}}
    settings = override(read_settings(), chosen, "x")
    make_parts(settings, {side: read_controllers(side) for side in Side}, ignore, ignore).client.close()


@pytest.mark.parametrize(("chosen", "timeout"), [({}, 2.0), ({"timeout": 1.0}, 1.0)])
def test_exchanges_of_the_driver_end_after_two_seconds_unless_the_settings_say_otherwise(
    chosen: Values, timeout: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    timeouts: list[float] = []

    def make_client(address: str, *, timeout: float, **login: str) -> RwsClient:
        timeouts.append(timeout)
        return RwsClient(address, timeout=timeout, **login)

    monkeypatch.setattr("yumi.driver.settings.RwsClient", make_client)
    settings = override(read_settings(), {"robot": {"address": "127.0.0.1", **chosen}}, "x")
    make_parts(settings, {side: read_controllers(side) for side in Side}, ignore, ignore).client.close()
    assert timeouts == [timeout]


def ignore(_: object) -> None:
    """Takes events and steps of what does not run."""
