from __future__ import annotations

import pytest

from abb_protocols.catalogue import Message, in_words, message
from abb_protocols.errors import CommandRefused, SwitchFailed
from abb_protocols.robot.joints import Side, joint_names
from refusals import assert_says, refused
from unit.control.controller_doubles import RUNNING, Double, Watcher
from yumi.control.controller import State
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.manager.controller_switch import Strictness

STRICT, BEST_EFFORT = Strictness.STRICT, Strictness.BEST_EFFORT
LENIENT = [BEST_EFFORT, Strictness.AUTO, Strictness.FORCE_AUTO]
NO = message("text", text="no")
SWITCHED, NOTHING = message("switched"), message("nothing_to_switch")
LOADED = ("first", "second", "speed", "watcher", "raw")


@pytest.fixture
def doubles() -> dict[str, Double]:
    return {"first": Double(), "second": Double(), "speed": Double("velocity"), "watcher": Watcher()}


@pytest.fixture
def manager(doubles: dict[str, Double]) -> ControllerManager:
    """``first`` is active; ``second`` wants the same interfaces; ``raw`` is not configured."""
    manager = ControllerManager(joint_names(Side.RIGHT))
    for name, double in doubles.items():
        manager.load(name, double)
        manager.configure(name)
    manager.load("raw", Double())
    manager.switch(["first"], [], RUNNING)
    return manager


def raised(name: str, call: str) -> Message:
    return message("controller_raised", controller=name, call=call, type="ValueError", error=NO)


def not_allowed(name: str, state: str, transition: str, *allowed: str) -> Message:
    return message("transition_not_allowed", controller=name, state=state, transition=transition, allowed=allowed)


def active(manager: ControllerManager) -> list[str]:
    return [info.name for info in manager.controllers() if info.state is State.ACTIVE]


def test_switch_says_whether_there_was_something_to_switch(manager: ControllerManager) -> None:
    assert manager.switch(["second"], ["first"], RUNNING) == str(SWITCHED)
    assert active(manager) == ["second"]
    assert manager.switch([], [], RUNNING) == str(NOTHING)


@pytest.mark.words
def test_switch_says_what_clients_of_ros2_control_know() -> None:
    assert str(SWITCHED) == "Successfully switched controllers!"
    assert str(NOTHING) == "After checking the controllers, no controllers need to be activated or deactivated."


@pytest.mark.parametrize(
    ("activate", "deactivate", "code", "values"),
    [
        (
            ["watcher", "nobody"],
            [],
            "controller_unknown",
            {"controller": "nobody", "loaded": ("first", "second", "speed", "watcher", "raw")},
        ),
        (["watcher"], ["nobody"], "controller_unknown", {"controller": "nobody"}),
        (
            ["watcher", "raw"],
            [],
            "transition_not_allowed",
            {
                "controller": "raw",
                "state": "unconfigured",
                "transition": "activate",
                "allowed": ("configure", "shutdown"),
            },
        ),
        (
            ["watcher", "first"],
            [],
            "transition_not_allowed",
            {
                "controller": "first",
                "state": "active",
                "transition": "activate",
                "allowed": ("deactivate", "shutdown"),
            },
        ),
        (
            ["watcher"],
            ["second"],
            "transition_not_allowed",
            {
                "controller": "second",
                "state": "inactive",
                "transition": "deactivate",
                "allowed": ("activate", "cleanup", "shutdown"),
            },
        ),
    ],
)
def test_strict_switch_changes_nothing_when_one_controller_cannot(
    manager: ControllerManager, activate: list[str], deactivate: list[str], code: str, values: dict[str, object]
) -> None:
    with refused(CommandRefused, code, **values):
        manager.switch(activate, deactivate, RUNNING)
    assert active(manager) == ["first"]


@pytest.mark.parametrize("strictness", LENIENT)
@pytest.mark.parametrize("cannot", ["nobody", "raw", "first"])
def test_lenient_switch_leaves_out_who_cannot(manager: ControllerManager, strictness: Strictness, cannot: str) -> None:
    left_out = {
        "nobody": message("controller_unknown", controller="nobody", loaded=LOADED),
        "raw": not_allowed("raw", "unconfigured", "activate", "configure", "shutdown"),
        "first": not_allowed("first", "active", "activate", "deactivate", "shutdown"),
    }
    speed = not_allowed("speed", "inactive", "deactivate", "activate", "cleanup", "shutdown")
    done = manager.switch([cannot, "watcher"], ["speed"], RUNNING, strictness)
    assert done == in_words((SWITCHED, speed, left_out[cannot]))
    assert active(manager) == ["first", "watcher"]


@pytest.mark.parametrize("strictness", LENIENT)
def test_lenient_switch_of_unknown_controllers_alone_is_refused(
    manager: ControllerManager, strictness: Strictness
) -> None:
    reasons = tuple(message("controller_unknown", controller=name, loaded=LOADED) for name in "ab")
    with refused(CommandRefused, "switch_without_effect", reasons=reasons):
        manager.switch(["b"], ["a"], RUNNING, strictness)


def test_lenient_switch_is_done_when_nothing_is_left_of_it(manager: ControllerManager) -> None:
    first = not_allowed("first", "active", "activate", "deactivate", "shutdown")
    assert manager.switch(["first"], [], RUNNING, BEST_EFFORT) == in_words((NOTHING, first))


@pytest.mark.parametrize("strictness", list(Strictness))
def test_no_strictness_lets_two_controllers_claim_an_interface(
    manager: ControllerManager, strictness: Strictness
) -> None:
    claim = {"controller": "second", "interface": "yumi_joint_1_r/position", "owner": "first"}
    with refused(CommandRefused, "interface_claimed", **claim):
        manager.switch(["second"], [], RUNNING, strictness)
    with refused(CommandRefused, "interface_claimed", **claim):
        manager.switch(["first", "second"], ["first"], RUNNING, strictness)
    assert active(manager) == ["first"]


@pytest.mark.parametrize("strictness", list(Strictness))
def test_no_strictness_activates_what_needs_an_interface_the_arm_lacks(
    manager: ControllerManager, strictness: Strictness
) -> None:
    manager.load("strong", Double("effort"))
    manager.configure("strong")
    with refused(CommandRefused, "interface_missing", controller="strong", interface="yumi_joint_1_r/effort"):
        manager.switch(["strong"], [], RUNNING, strictness)


def test_controllers_with_disjoint_claims_are_active_at_once(manager: ControllerManager) -> None:
    manager.switch(["speed", "watcher"], [], RUNNING)
    assert active(manager) == ["first", "speed", "watcher"]


def test_controller_in_both_lists_begins_anew(manager: ControllerManager, doubles: dict[str, Double]) -> None:
    manager.switch(["first"], ["first"], RUNNING)
    assert doubles["first"].done == ["configure", "activate", "deactivate", "take_reports", "activate"]
    assert active(manager) == ["first"]


@pytest.mark.parametrize("strictness", LENIENT)
def test_lenient_switch_activates_an_inactive_controller_in_both_lists(
    manager: ControllerManager, strictness: Strictness
) -> None:
    manager.switch(["speed"], ["speed"], RUNNING, strictness)
    assert active(manager) == ["first", "speed"]


def test_controller_named_twice_is_switched_once(manager: ControllerManager, doubles: dict[str, Double]) -> None:
    manager.switch(["watcher", "watcher"], ["first", "first"], RUNNING)
    assert active(manager) == ["watcher"]
    assert doubles["watcher"].done.count("activate") == 1


def test_strict_switch_takes_back_what_it_activated_when_one_cannot_begin(
    manager: ControllerManager, doubles: dict[str, Double]
) -> None:
    doubles["speed"].faults["activate"] = ValueError("no")
    with refused(SwitchFailed, "switch_failed", failures=(raised("speed", "activate"),), active=()):
        manager.switch(["second", "speed", "watcher"], ["first"], RUNNING)
    assert active(manager) == []
    assert manager.update(RUNNING) is None
    assert "activate" not in doubles["watcher"].done


def test_lenient_switch_keeps_what_it_activated_when_one_cannot_begin(
    manager: ControllerManager, doubles: dict[str, Double]
) -> None:
    doubles["second"].faults["activate"] = ValueError("no")
    failures = (raised("second", "activate"),)
    with refused(SwitchFailed, "switch_failed", failures=failures, active=("speed", "watcher")):
        manager.switch(["second", "speed", "watcher"], ["first"], RUNNING, BEST_EFFORT)
    assert active(manager) == ["speed", "watcher"]


@pytest.mark.parametrize("deed", ["deactivate", "take_reports"])
def test_controller_that_fails_on_its_way_out_is_out(
    manager: ControllerManager, doubles: dict[str, Double], deed: str
) -> None:
    doubles["first"].faults[deed] = ValueError("no")
    manager.switch(["second"], ["first"], RUNNING)
    assert active(manager) == ["second"]
    assert manager.failures == [raised("first", "deactivate")]


def test_notices_are_told_in_order_and_once_even_by_who_has_left(
    manager: ControllerManager, doubles: dict[str, Double]
) -> None:
    manager.switch(["watcher"], [], RUNNING)
    doubles["first"].notices = ["arrived", "aborted"]
    doubles["watcher"].notices = ["seen"]
    manager.switch([], ["first"], RUNNING)
    assert manager.take_reports() == [("first", "arrived"), ("first", "aborted"), ("watcher", "seen")]
    assert manager.take_reports() == []


def test_controller_that_fails_to_tell_is_deactivated(manager: ControllerManager, doubles: dict[str, Double]) -> None:
    doubles["first"].faults["take_reports"] = ValueError("no")
    assert manager.take_reports() == []
    assert active(manager) == []
    assert_says(manager.failures[0], "commanding_controller_failed", controller="first", type="ValueError", error=NO)


def test_orders_reach_active_controllers_only(manager: ControllerManager, doubles: dict[str, Double]) -> None:
    manager.receive("first", "good", RUNNING)
    assert doubles["first"].orders == ["good"]
    with refused(CommandRefused, "controller_not_active", controller="second", state="inactive"):
        manager.receive("second", "good", RUNNING)
    with pytest.raises(CommandRefused, match="The order is bad; send a good one"):
        manager.receive("first", "bad", RUNNING)
    with refused(CommandRefused, "controller_unknown", controller="nobody"):
        manager.receive("nobody", "good", RUNNING)
    assert (doubles["first"].orders, doubles["second"].orders) == (["good"], [])


def test_fault_of_who_was_asked_is_told_after_others_have_left(
    manager: ControllerManager, doubles: dict[str, Double]
) -> None:
    manager.switch(["speed"], [], RUNNING)
    manager.switch([], ["first"], RUNNING)
    doubles["speed"].faults["update"] = ValueError("no")
    assert manager.update(RUNNING) is None
    (failure,) = manager.failures
    assert_says(failure, "commanding_controller_failed", controller="speed", type="ValueError", error=NO)
