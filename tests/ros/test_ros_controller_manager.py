"""The controller managers as the tools of ros2_control call them: the command line, the spawner, rqt, MoveIt."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from controller_manager_bench import (
    BEST_EFFORT,
    PARAMETER_SERVICES,
    SERVICES,
    STRICT,
    Manager,
    get_parameter,
    number,
    set_parameter,
    text,
    texts,
)
from controller_manager_msgs.msg import ControllerManagerActivity
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State
from rcl_interfaces.srv import ListParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import Client, begin_egm
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import Side, joint_names

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

BROADCASTER = "joint_state_broadcaster"
POSITION = "joint_position_controller"
POSITION_KIND = "yumi_controllers/JointPositionController"
POSITIONS = [f"{name}/position" for name in joint_names(Side.RIGHT)]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def manager(client: Client) -> Manager:
    return Manager(client)


@pytest.fixture
def egm_running(manager: Manager) -> Manager:
    """With EGM running and no controller commanding the right arm."""
    begin_egm(manager.client)
    assert manager.switch([], [POSITION], BEST_EFFORT).ok
    return manager


@pytest.fixture
def spare(manager: Manager) -> Iterator[str]:
    """Name of a controller that is gone afterwards."""
    yield "spare_controller"
    manager.switch([], ["spare_controller"], BEST_EFFORT)
    manager.call("unload_controller", name="spare_controller")


def said(code: str, **values: Any) -> str:
    """How the driver words a message."""
    return sentence(message(code, **values), FrontEnd.ROS)


def nobody(manager: Manager) -> str:
    return said("controller_unknown", controller="nobody", loaded=tuple(manager.controllers()))


def heard(client: Client, kind: Any, topic: str, qos: Any = 10) -> list[Any]:
    got: list[Any] = []
    client.node.create_subscription(kind, topic, got.append, qos)
    return got


# ros2 control


def test_list_controllers_shows_every_column(egm_running: Manager) -> None:
    controllers = egm_running.controllers()
    broadcaster, position = controllers[BROADCASTER], controllers[POSITION]
    assert (broadcaster.type, broadcaster.state) == ("joint_state_broadcaster/JointStateBroadcaster", "active")
    assert (position.type, position.state, position.update_rate) == (POSITION_KIND, "inactive", 248)
    assert set(POSITIONS) <= set(position.required_command_interfaces)
    assert set(POSITIONS) <= set(broadcaster.required_state_interfaces)
    flags = (position.is_async, position.is_chainable, position.is_chained)
    lists = ("claimed_interfaces", "chain_connections", "reference_interfaces", "exported_state_interfaces")
    assert not any(flags)
    assert not any(getattr(position, name) for name in lists)


def test_controller_claims_its_interfaces_only_while_it_is_active(egm_running: Manager) -> None:
    assert egm_running.switch([POSITION], []).ok
    assert {*egm_running.controllers()[POSITION].claimed_interfaces} >= {*POSITIONS}
    listed = egm_running.call("list_hardware_interfaces").command_interfaces
    assert {each.name for each in listed if each.is_claimed} >= {*POSITIONS}
    assert egm_running.switch([], [POSITION]).ok
    assert not egm_running.controllers()[POSITION].claimed_interfaces


def test_list_controller_types_has_a_base_class_for_each_type(manager: Manager) -> None:
    answer = manager.call("list_controller_types")
    assert POSITION_KIND in answer.types
    assert list(answer.base_classes) == ["controller_interface::ControllerInterface"] * len(answer.types)


def test_list_hardware_components_shows_every_column(manager: Manager) -> None:
    (component,) = manager.call("list_hardware_components").component
    assert (component.type, component.plugin_name, component.rw_rate) == ("system", "yumi_ros2/EgmSystem", 248)
    assert (component.state, component.is_async) == (State(id=State.PRIMARY_STATE_ACTIVE, label="active"), False)
    assert set(POSITIONS) <= {each.name for each in component.command_interfaces}
    assert all(each.is_available and each.data_type == "double" for each in component.command_interfaces)
    assert not any(each.is_claimed for each in component.state_interfaces)


def test_list_hardware_interfaces_shows_commands_and_states(manager: Manager) -> None:
    answer = manager.call("list_hardware_interfaces")
    for interfaces in (answer.command_interfaces, answer.state_interfaces):
        assert set(POSITIONS) <= {each.name for each in interfaces}
        assert all(each.is_available and each.data_type == "double" for each in interfaces)


def test_load_controller_with_set_state_loads_configures_and_activates_by_best_effort(
    egm_running: Manager, spare: str
) -> None:
    assert egm_running.state(spare) == "not loaded"
    assert egm_running.set_parameter(f"{spare}.type", text(POSITION_KIND)).successful
    assert egm_running.call("load_controller", name=spare).ok
    assert egm_running.state(spare) == "unconfigured"
    assert egm_running.call("configure_controller", name=spare).ok
    assert egm_running.state(spare) == "inactive"
    assert egm_running.switch([spare], [], strictness=int(True)).ok
    assert egm_running.state(spare) == "active"


def test_set_controller_state_leads_a_controller_through_its_life(manager: Manager, spare: str) -> None:
    assert manager.spawn(spare, POSITION_KIND, inactive=True)
    assert manager.call("cleanup_controller", name=spare).ok
    assert manager.state(spare) == "unconfigured"
    assert manager.call("cleanup_controller", name=spare).ok  # nothing to do
    assert manager.call("configure_controller", name=spare).ok
    assert manager.call("configure_controller", name=spare).ok  # anew
    assert manager.state(spare) == "inactive"


def test_switch_without_strictness_leaves_out_what_cannot_be_switched(egm_running: Manager) -> None:
    answer = egm_running.switch([POSITION, "nobody"], [], strictness=0)
    assert answer.ok
    assert answer.message == f"{said('switched')} {nobody(egm_running)}"
    assert egm_running.switch([], [POSITION], strictness=0).ok


def test_strict_switch_refuses_an_unknown_name_and_changes_nothing(egm_running: Manager) -> None:
    answer = egm_running.switch([POSITION, "nobody"], [], STRICT)
    assert not answer.ok
    assert answer.message == nobody(egm_running)
    assert egm_running.state(POSITION) == "inactive"


def test_switch_with_nothing_left_is_a_success_in_upstreams_words(egm_running: Manager) -> None:
    answer = egm_running.switch([], [POSITION], BEST_EFFORT)
    assert answer.ok
    left_out = said(
        "transition_not_allowed",
        controller=POSITION,
        state="inactive",
        transition="deactivate",
        allowed=("activate", "cleanup", "shutdown"),
    )
    assert answer.message == f"{said('nothing_to_switch')} {left_out}"


@pytest.mark.words
def test_switch_is_answered_as_upstream_does() -> None:
    assert said("switched") == "Successfully switched controllers!"
    assert said("nothing_to_switch") == (
        "After checking the controllers, no controllers need to be activated or deactivated."
    )


def test_switch_refuses_a_second_owner_of_an_interface(egm_running: Manager, spare: str) -> None:
    assert egm_running.spawn(spare, POSITION_KIND)
    answer = egm_running.switch([POSITION], [], BEST_EFFORT)
    assert not answer.ok
    assert answer.message == said("interface_claimed", controller=POSITION, interface=POSITIONS[0], owner=spare)
    assert egm_running.switch([POSITION], [spare], STRICT).ok  # the one for the other
    assert egm_running.switch([], [POSITION], STRICT).ok


def test_switch_refuses_a_strictness_that_does_not_exist(manager: Manager) -> None:
    answer = manager.switch([POSITION], [], strictness=7)
    assert (answer.ok, answer.message) == (False, said("strictness_unknown", value=7))


def test_active_controller_is_neither_unloaded_nor_cleaned_up_nor_configured(manager: Manager) -> None:
    for service in ("unload_controller", "cleanup_controller", "configure_controller"):
        assert not manager.call(service, name=BROADCASTER).ok
    assert manager.state(BROADCASTER) == "active"


def test_reload_controller_libraries_is_refused_while_a_controller_is_active(manager: Manager) -> None:
    assert not manager.call("reload_controller_libraries", force_kill=False).ok
    active = tuple(name for name, each in manager.controllers().items() if each.state == "active")
    assert active[0] == BROADCASTER
    refusal = said("controllers_are_active", controllers=active)
    manager.client.until(manager.client.hears(f"reload_controller_libraries: {refusal}"))


def test_reload_controller_libraries_by_force_unloads_all_and_the_spawner_brings_them_back(client: Client) -> None:
    left = Manager(client, "/l/controller_manager")
    kinds = {name: state.type for name, state in left.controllers().items()}
    assert left.call("reload_controller_libraries", force_kill=True).ok
    assert not left.controllers()
    client.until(lambda: (POSITION, "/l") not in client.node.get_node_names_and_namespaces())
    for name, kind in kinds.items():
        assert left.spawn(name, kind, inactive=name != BROADCASTER)
    assert set(left.controllers()) == set(kinds)


def test_view_controller_chains_finds_no_dangling_connection(manager: Manager) -> None:
    controllers = manager.controllers()
    exported = {f"{name}/{each}" for name, state in controllers.items() for each in state.reference_interfaces}
    for state in controllers.values():
        assert {f"{c.name}/{each}" for c in state.chain_connections for each in c.reference_interfaces} <= exported


def test_shell_completion_finds_the_types_among_the_parameters(manager: Manager) -> None:
    names = manager.client.call(ListParameters, f"{manager.name}/list_parameters").result.names
    assert {f"{BROADCASTER}.type", f"{POSITION}.type"} <= {name for name in names if name.endswith(".type")}
    assert get_parameter(manager.client, manager.name, f"{POSITION}.type").string_value == POSITION_KIND


# spawner, unspawner, hardware_spawner


def test_spawner_finds_all_six_parameter_services(manager: Manager) -> None:
    for service, kind in PARAMETER_SERVICES.items():
        client = manager.client.node.create_client(kind, f"{manager.name}/{service}")
        manager.client.until(client.service_is_ready)
        manager.client.node.destroy_client(client)


def test_spawner_gives_a_controller_the_parameters_of_its_file(
    egm_running: Manager, spare: str, tmp_path: Path
) -> None:
    file = tmp_path / "spare.yaml"
    file.write_text(f"/**:\n  ros__parameters:\n    p: 0.5\n/r/{spare}:\n  ros__parameters:\n    p: 0.75\n")
    assert egm_running.spawn(spare, POSITION_KIND, [str(file)])
    assert egm_running.state(spare) == "active"
    assert get_parameter(egm_running.client, f"/r/{spare}", "p").double_value == 0.75
    assert egm_running.unspawn(spare)
    assert egm_running.state(spare) == "not loaded"


def test_spawner_may_set_a_list_where_a_text_was(manager: Manager, spare: str, tmp_path: Path) -> None:
    file = tmp_path / "spare.yaml"
    file.write_text("/**:\n  ros__parameters:\n    p: 0.25\n")
    assert manager.set_parameter(f"{spare}.params_file", text("/nowhere.yaml")).successful
    assert manager.spawn(spare, POSITION_KIND, [str(file)], inactive=True)
    assert get_parameter(manager.client, f"/r/{spare}", "p").double_value == 0.25


def test_spawner_started_again_configures_an_inactive_controller_anew_and_fails_on_an_active_one(
    manager: Manager, spare: str
) -> None:
    assert manager.spawn(spare, POSITION_KIND, inactive=True)
    assert manager.spawn(spare, POSITION_KIND, inactive=True)
    assert not manager.spawn(BROADCASTER)


@pytest.mark.parametrize(
    ("kind", "refusal"),
    [
        (
            None,
            "load_controller: "
            f"{said('controller_without_type', controller='spare_controller', node='controller_manager')}",
        ),
        ("no/Such", "'no/Such'"),
    ],
)
def test_controller_without_a_known_type_is_not_loaded(
    manager: Manager, spare: str, kind: str | None, refusal: str
) -> None:
    assert manager.set_parameter(f"{spare}.type", text(kind or "")).successful
    assert not manager.call("load_controller", name=spare).ok
    manager.client.until(manager.client.hears(refusal))
    assert manager.state(spare) == "not loaded"


@pytest.mark.parametrize("entry", ["p: 1000.0", "p: [1, 2.0]"])
def test_controller_whose_file_breaks_a_rule_is_not_loaded(
    manager: Manager, spare: str, entry: str, tmp_path: Path
) -> None:
    """A rule of the controller, and of ROS's parser."""
    file = tmp_path / "spare.yaml"
    file.write_text(f"/**:\n  ros__parameters:\n    {entry}\n")
    assert manager.set_parameter(f"{spare}.params_file", texts([str(file)])).successful
    assert manager.set_parameter(f"{spare}.type", text(POSITION_KIND)).successful
    assert not manager.call("load_controller", name=spare).ok
    assert manager.state(spare) == "not loaded"
    assert manager.set_parameter(f"{spare}.params_file", texts([])).successful


def test_hardware_spawner_leads_a_component_and_compares_id_and_label(manager: Manager) -> None:
    (name,) = (each.name for each in manager.call("list_hardware_components").component)
    inactive, active = State(id=2, label="inactive"), State(id=3, label="active")
    answer = manager.set_hardware(name, 2, "inactive")
    assert (answer.ok, answer.state, manager.component(name).state) == (True, inactive, inactive)
    answer = manager.set_hardware(name, 0, "active")  # by its label, as the command line does
    assert (answer.ok, answer.state, manager.component(name).state) == (True, active, active)


@pytest.mark.parametrize(
    ("name", "number_", "label"), [("nothing", 3, "active"), ("", 4, "finalized"), ("", 0, "asleep")]
)
def test_component_is_not_led_to_where_it_cannot_go(manager: Manager, name: str, number_: int, label: str) -> None:
    (component,) = manager.call("list_hardware_components").component
    answer = manager.set_hardware(name or component.name, number_, label)
    assert (answer.ok, answer.state) == (False, component.state)


def test_inactive_component_deactivates_who_commands_it(egm_running: Manager) -> None:
    (component,) = egm_running.call("list_hardware_components").component
    assert egm_running.switch([POSITION], []).ok
    assert egm_running.set_hardware(component.name, 2, "inactive").ok
    try:
        assert egm_running.state(POSITION) == "inactive"
        assert not egm_running.switch([POSITION], []).ok
    finally:
        assert egm_running.set_hardware(component.name, 3, "active").ok
    assert egm_running.switch([POSITION], []).ok
    assert egm_running.switch([], [POSITION]).ok


# rqt


@pytest.mark.parametrize("side", list(Side))
def test_rqt_finds_both_managers_by_their_services(client: Client, side: Side) -> None:
    expected = {
        f"/{side.value}/controller_manager/{name}": [f"controller_manager_msgs/srv/{kind.__name__}"]
        for name, kind in SERVICES.items()
    }
    client.until(lambda: expected.items() <= dict(client.node.get_service_names_and_types()).items())


@pytest.mark.real_time  # a machine that stands still for 0.3 s lets the switch take longer than rqt waits
@pytest.mark.parametrize("timeout", [pytest.param(0.3, id="rqt_controller_manager"), pytest.param(0.0, id="moveit")])
def test_switch_succeeds_with_the_timeouts_of_rqt_and_moveit(egm_running: Manager, timeout: float) -> None:
    assert egm_running.switch([POSITION], [], STRICT, asap=False, timeout=timeout).ok
    assert egm_running.switch([], [POSITION], STRICT, asap=False, timeout=timeout).ok


def test_rqt_joint_trajectory_controller_finds_a_description_with_joint_limits(client: Client) -> None:
    got = heard(client, String, "/r/robot_description", LATCHED)
    client.until(lambda: bool(got))
    assert all(f'<joint name="{name}" type="revolute">' in got[0].data for name in joint_names(Side.RIGHT))
    assert got[0].data.count("<limit ") >= len(POSITIONS)


# launch tests, Foxglove


@pytest.mark.parametrize("side", list(Side))
def test_launch_tests_see_a_node_for_each_controller(client: Client, side: Side) -> None:
    expected = {(name, f"/{side.value}") for name in ("controller_manager", BROADCASTER, POSITION)}
    client.until(lambda: expected <= set(client.node.get_node_names_and_namespaces()))


def test_launch_tests_hear_joint_states(egm_running: Manager) -> None:
    got = heard(egm_running.client, JointState, "/joint_states")
    egm_running.client.until(lambda: bool(got) and len(got[-1].name) >= 14)


def test_activity_is_known_to_late_comers_and_follows_each_change(egm_running: Manager) -> None:
    got = heard(egm_running.client, ControllerManagerActivity, f"{egm_running.name}/activity", LATCHED)

    def state() -> str:
        return next((each.state.label for each in got[-1].controllers if each.name == POSITION), "") if got else ""

    egm_running.client.until(lambda: state() == "inactive")
    assert got[-1].hardware_components[0].state == State(id=3, label="active")
    assert egm_running.switch([POSITION], []).ok
    egm_running.client.until(lambda: state() == "active")
    assert egm_running.switch([], [POSITION]).ok
    egm_running.client.until(lambda: state() == "inactive")


def test_diagnostics_have_the_three_tasks_of_a_controller_manager(egm_running: Manager) -> None:
    got = heard(egm_running.client, DiagnosticArray, "/diagnostics")
    tasks = ("Controllers Activity", "Hardware Components Activity", "Controller Manager Activity")
    wanted = {f"{egm_running.name}: {task}" for task in tasks}
    latest: dict[str, Any] = {}

    def all_there() -> bool:
        latest.update({status.name: status for array in got for status in array.status})
        return wanted <= set(latest)

    egm_running.client.until(all_there)
    controllers, hardware, manager = (latest[f"{egm_running.name}: {task}"] for task in tasks)
    assert {controllers.hardware_id, hardware.hardware_id, manager.hardware_id} == {"ros2_control"}
    assert controllers.message in {"Not all controllers are active", "All controllers are active"}
    values = {pair.key: pair.value for status in (controllers, hardware, manager) for pair in status.values}
    assert values[f"{BROADCASTER}.state"] == "active"
    assert values["update_rate"] == "248"
    assert any(key.endswith(".read_cycle.execution_time") and "us, StdDev: " in values[key] for key in values)


def test_gain_set_on_a_controller_is_kept_by_its_node(client: Client) -> None:
    before = get_parameter(client, f"/r/{POSITION}", "p").double_value
    assert set_parameter(client, f"/r/{POSITION}", "p", number(0.9)).successful
    try:
        assert get_parameter(client, f"/r/{POSITION}", "p").double_value == 0.9
    finally:
        assert set_parameter(client, f"/r/{POSITION}", "p", number(before)).successful
