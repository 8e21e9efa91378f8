from __future__ import annotations

import itertools

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, ArmCommand, ArmState, Joints, Side, joint_names
from abb_runtime.parameters import Parameter, Values
from refusals import assert_says, refused
from yumi.control.controller import TRANSITIONS, Controller, State, Transition
from yumi.control.manager.controller_manager import ControllerManager

RUNNING = ArmState(1.0, 0.004, 1, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=True)
STOPPED = ArmState(1.0, 0.004, 1, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=False)
THERE: Joints = (0.1,) * 7


class Pusher(Controller):
    kind = "test/Pusher"

    def __init__(self) -> None:
        self.values: Values = {}
        self.began_at: Joints | None = None
        self.fault: Exception | None = None

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (Parameter("p", 1.0, 0.0, 2.0, "1/s", "A gain."),)

    def configure(self, values: Values) -> None:
        self.values = values

    def activate(self, state: ArmState) -> None:
        self.began_at = state.position

    def update(self, state: ArmState) -> ArmCommand | None:
        if self.fault:
            raise self.fault
        return ArmCommand(THERE)

    @property
    def reference(self) -> Joints | None:
        return THERE


class Watcher(Pusher):
    is_command = False


@pytest.fixture
def pusher() -> Pusher:
    return Pusher()


@pytest.fixture
def manager(pusher: Pusher) -> ControllerManager:
    manager = ControllerManager(joint_names(Side.RIGHT))
    manager.load("pusher", pusher)
    return manager


def states(manager: ControllerManager) -> dict[str, State]:
    return {info.name: info.state for info in manager.controllers()}


def test_manager_leads_a_controller_through_its_life(manager: ControllerManager, pusher: Pusher) -> None:
    assert states(manager) == {"pusher": State.UNCONFIGURED}
    manager.set_parameters("pusher", {"p": 1.6})
    manager.configure("pusher")
    assert states(manager) == {"pusher": State.INACTIVE}
    manager.switch(["pusher"], [], RUNNING)
    assert (states(manager), pusher.began_at, pusher.values) == ({"pusher": State.ACTIVE}, ZERO_JOINTS, {"p": 1.6})
    manager.switch([], ["pusher"], RUNNING)
    assert states(manager) == {"pusher": State.INACTIVE}


def test_manager_lists_required_and_claimed_interfaces(manager: ControllerManager) -> None:
    manager.configure("pusher")
    (inactive,) = manager.controllers()
    manager.switch(["pusher"], [], RUNNING)
    (active,) = manager.controllers()
    assert inactive.required == tuple(f"{name}/position" for name in joint_names(Side.RIGHT))
    assert (inactive.claimed, active.claimed) == ((), active.required)


def test_manager_asks_active_controllers_only(manager: ControllerManager) -> None:
    manager.configure("pusher")
    assert manager.update(RUNNING) is None
    assert manager.reference is None
    manager.switch(["pusher"], [], RUNNING)
    assert manager.update(RUNNING) == ArmCommand(THERE)
    assert manager.reference == THERE


def test_activation_that_commands_the_arm_goes_on_while_a_controller_that_watches_begins(
    manager: ControllerManager, pusher: Pusher
) -> None:
    """What a client has planned for it still counts, and its goals do not end."""
    manager.load("watcher", Watcher())
    for name in ("pusher", "watcher"):
        manager.configure(name)
    manager.switch(["pusher"], [], RUNNING)
    before = manager.activation
    manager.switch(["watcher"], [], RUNNING)
    assert manager.activation == before
    manager.switch(["pusher"], ["pusher"], RUNNING)
    assert manager.activation > before


def test_manager_refuses_a_second_owner_of_an_interface(manager: ControllerManager) -> None:
    manager.load("rival", Pusher())
    for name in ("pusher", "rival"):
        manager.configure(name)
    manager.switch(["pusher"], [], RUNNING)
    with refused(
        CommandRefused, "interface_claimed", controller="rival", interface="yumi_joint_1_r/position", owner="pusher"
    ):
        manager.switch(["rival"], [], RUNNING)
    assert states(manager) == {"pusher": State.ACTIVE, "rival": State.INACTIVE}


def test_manager_hands_an_interface_over_within_one_switch(manager: ControllerManager) -> None:
    manager.load("rival", Pusher())
    for name in ("pusher", "rival"):
        manager.configure(name)
    manager.switch(["pusher"], [], RUNNING)
    manager.switch(["rival"], ["pusher"], RUNNING)
    assert states(manager) == {"pusher": State.INACTIVE, "rival": State.ACTIVE}


@pytest.mark.parametrize("state", [None, STOPPED])
def test_manager_starts_no_commanding_controller_while_egm_does_not_run(
    manager: ControllerManager, state: ArmState | None
) -> None:
    manager.configure("pusher")
    with refused(CommandRefused, "controller_without_egm", controller="pusher"):
        manager.switch(["pusher"], [], state)
    assert states(manager) == {"pusher": State.INACTIVE}


def test_manager_starts_a_watching_controller_at_any_time(manager: ControllerManager) -> None:
    manager.load("watcher", Watcher())
    manager.configure("watcher")
    manager.switch(["watcher"], [], None)
    assert states(manager)["watcher"] is State.ACTIVE


def test_manager_deactivates_a_controller_that_fails_and_holds(manager: ControllerManager, pusher: Pusher) -> None:
    manager.configure("pusher")
    manager.switch(["pusher"], [], RUNNING)
    pusher.fault = ZeroDivisionError("by zero")
    assert manager.update(RUNNING) is None
    assert states(manager) == {"pusher": State.INACTIVE}
    (failure,) = manager.failures
    error = message("text", text="by zero")
    assert_says(failure, "commanding_controller_failed", controller="pusher", type="ZeroDivisionError", error=error)


@pytest.mark.parametrize(("value", "shown"), [(2.1, "2.1"), (float("nan"), "nan")])
def test_manager_refuses_a_parameter_out_of_range(
    manager: ControllerManager, pusher: Pusher, value: float, shown: str
) -> None:
    manager.configure("pusher")
    reason = message("value_out_of_range_with_unit", parameter="p", value=shown, lowest=0.0, highest=2.0, unit="1/s")
    with refused(CommandRefused, "controller_parameter_refused", parameter="p", controller="pusher", reason=reason):
        manager.set_parameters("pusher", {"p": value})
    assert pusher.values == {"p": 1.0}


def test_manager_refuses_a_parameter_nobody_knows(manager: ControllerManager) -> None:
    with refused(CommandRefused, "controller_parameter_unknown", parameter="q", parameters=("p",)):
        manager.set_parameters("pusher", {"q": 1.0})


def test_manager_names_the_controllers_it_has(manager: ControllerManager) -> None:
    with refused(CommandRefused, "controller_unknown", controller="x") as caught:
        manager.switch(["x"], [], RUNNING)
    assert caught.value.said.values["loaded"][0] == "pusher"


def test_manager_refuses_a_name_that_is_taken(manager: ControllerManager) -> None:
    with refused(CommandRefused, "controller_loaded_already", controller="pusher"):
        manager.load("pusher", Pusher())


@pytest.mark.parametrize(("source", "transition"), list(itertools.product(State, Transition)))
def test_lifecycle_table_ends_in_finalized_and_never_leaves_it(source: State, transition: Transition) -> None:
    target = TRANSITIONS.get((source, transition))
    assert target is None or source is not State.FINALIZED
    if transition is Transition.SHUTDOWN and source is not State.FINALIZED:
        assert target is State.FINALIZED


@pytest.mark.parametrize("name", ["activate", "deactivate"])
def test_manager_says_what_a_controller_can_do_instead(manager: ControllerManager, name: str) -> None:
    lists = {
        "activate": ["pusher"] if name == "activate" else [],
        "deactivate": ["pusher"] if name == "deactivate" else [],
    }
    can = {"state": "unconfigured", "transition": name, "allowed": ("configure", "shutdown")}
    with refused(CommandRefused, "transition_not_allowed", **can):
        manager.switch(lists["activate"], lists["deactivate"], RUNNING)
