from __future__ import annotations

import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side, joint_names
from refusals import refused
from unit.control.controller_doubles import RUNNING, Double, Watcher
from yumi.control.controller import State
from yumi.control.controller_info import InterfaceInfo, Statistics
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.manager.hardware_component import STATISTICS_WINDOW
from yumi.control.stage_times import STAGE_MARK_COUNT

NAMES = joint_names(Side.RIGHT)


@pytest.fixture
def manager() -> ControllerManager:
    """With a commanding and a watching controller, both active."""
    manager = ControllerManager(NAMES, component="ROB_R")
    manager.load("double", Double("velocity"))
    manager.load("watcher", Watcher())
    for name in ("double", "watcher"):
        manager.configure(name)
    manager.switch(["double", "watcher"], [], RUNNING)
    return manager


def states(manager: ControllerManager) -> list[State]:
    return [info.state for info in manager.controllers()]


def test_hardware_is_active_from_the_start_with_two_interfaces_for_each_joint(manager: ControllerManager) -> None:
    info = manager.hardware()
    names = [f"{joint}/{kind}" for joint in NAMES for kind in ("position", "velocity")]
    assert (info.name, info.state) == ("ROB_R", State.ACTIVE)
    assert [each.name for each in info.command_interfaces] == names
    assert [each.name for each in info.state_interfaces] == names


def test_command_interfaces_are_claimed_only_while_their_controller_is_active(manager: ControllerManager) -> None:
    velocities = {f"{joint}/velocity" for joint in NAMES}
    assert {each.name for each in manager.hardware().command_interfaces if each.is_claimed} == velocities
    manager.switch([], ["double"], RUNNING)
    assert not any(each.is_claimed for each in manager.hardware().command_interfaces)


def test_state_interfaces_are_never_claimed(manager: ControllerManager) -> None:
    assert manager.hardware().state_interfaces[0] == InterfaceInfo("yumi_joint_1_r/position", is_available=True)
    assert not any(each.is_claimed for each in manager.hardware().state_interfaces)


def test_inactive_hardware_stops_who_commands_and_can_still_be_watched(manager: ControllerManager) -> None:
    info = manager.set_hardware_state("ROB_R", State.INACTIVE)
    assert states(manager) == [State.INACTIVE, State.ACTIVE]
    assert info.state is State.INACTIVE
    assert all(each.is_available and not each.is_claimed for each in info.command_interfaces)
    assert manager.update(RUNNING) is None


def test_unconfigured_hardware_stops_everybody(manager: ControllerManager) -> None:
    info = manager.set_hardware_state("ROB_R", State.UNCONFIGURED)
    assert states(manager) == [State.INACTIVE, State.INACTIVE]
    assert not any(each.is_available for each in (*info.command_interfaces, *info.state_interfaces))


def test_active_hardware_starts_nobody(manager: ControllerManager) -> None:
    manager.set_hardware_state("ROB_R", State.UNCONFIGURED)
    manager.set_hardware_state("ROB_R", State.ACTIVE)
    assert states(manager) == [State.INACTIVE, State.INACTIVE]
    manager.switch(["double", "watcher"], [], RUNNING)
    assert states(manager) == [State.ACTIVE, State.ACTIVE]


def test_hardware_that_is_led_where_it_is_changes_nobody(manager: ControllerManager) -> None:
    manager.set_hardware_state("ROB_R", State.ACTIVE)
    assert states(manager) == [State.ACTIVE, State.ACTIVE]


@pytest.mark.parametrize(
    ("state", "name"), [(State.INACTIVE, "double"), (State.UNCONFIGURED, "double"), (State.UNCONFIGURED, "watcher")]
)
def test_controllers_cannot_begin_on_hardware_that_does_not_offer_what_they_need(
    manager: ControllerManager, state: State, name: str
) -> None:
    manager.set_hardware_state("ROB_R", state)
    with refused(CommandRefused, "hardware_not_active", controller=name, component="ROB_R", state=state.value):
        manager.switch([name], [], RUNNING)


def test_hardware_of_another_name_is_refused(manager: ControllerManager) -> None:
    with refused(CommandRefused, "hardware_unknown", component="ROB_L", own_component="ROB_R"):
        manager.set_hardware_state("ROB_L", State.INACTIVE)


def test_hardware_cannot_be_finalized(manager: ControllerManager) -> None:
    with refused(CommandRefused, "hardware_state_not_allowed", component="ROB_R", state="finalized") as caught:
        manager.set_hardware_state("ROB_R", State.FINALIZED)
    assert set(caught.value.said.values["allowed"]) == {"unconfigured", "inactive", "active"}
    assert states(manager) == [State.ACTIVE, State.ACTIVE]


def test_hardware_tells_how_long_reading_and_answering_take(manager: ControllerManager) -> None:
    for time in (1.0, 1.004):
        marks = [time, 0.0, time + 0.25, time + 0.5, time + 0.75, 0.0, time + 2.75, 0.0]
        assert len(marks) == STAGE_MARK_COUNT
        manager.note_times(RUNNING._replace(time=time), marks)
    info = manager.hardware()
    assert (info.read_time.mean, info.write_time.mean) == (pytest.approx(0.25), pytest.approx(2.0))
    assert (info.period.count, info.period.mean) == (1, pytest.approx(0.004))
    assert manager.controllers()[0].execution_time.mean == pytest.approx(0.25)


def test_hardware_counts_no_period_from_one_session_to_the_next(manager: ControllerManager) -> None:
    for session in (1, 2):
        manager.note_times(RUNNING._replace(session=session), [0.0] * STAGE_MARK_COUNT)
    assert manager.hardware().period == Statistics()


def test_hardware_forgets_how_it_was_a_window_ago(manager: ControllerManager) -> None:
    now, longest = 1.0, []
    for number in range(round(3.0 * STATISTICS_WINDOW / 0.1)):
        now += 1.5 if number == 5 else 0.1  # one long pause at the beginning
        manager.note_times(RUNNING._replace(time=now), [0.0] * STAGE_MARK_COUNT)
        longest.append(manager.hardware().period.maximum)
    assert max(longest) == pytest.approx(1.5)
    assert longest[-1] == pytest.approx(0.1)
