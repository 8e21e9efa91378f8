from __future__ import annotations

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side, joint_names
from refusals import assert_says, refused
from unit.control.controller_doubles import RUNNING, Double, Watcher
from yumi.control.controller import Controller, State
from yumi.control.controller_info import ControllerInfo
from yumi.control.manager.controller_manager import ControllerManager

NAMES = joint_names(Side.RIGHT)


@pytest.fixture
def made() -> list[Double]:
    """What was made by type, in this order."""
    return []


@pytest.fixture
def manager(made: list[Double]) -> ControllerManager:
    """Knows two types and has nothing loaded."""

    def make_double(name: str) -> Controller:
        made.append(Double())
        return made[-1]

    def make_broken(name: str) -> Controller:
        raise ValueError(f"{name} is broken")

    return ControllerManager(NAMES, {"test/Double": make_double, "test/Broken": make_broken})


@pytest.fixture
def double(manager: ControllerManager, made: list[Double]) -> Double:
    """Loaded as ``double``."""
    manager.load_kind("double", "test/Double")
    return made[0]


def info(manager: ControllerManager) -> ControllerInfo:
    return manager.controllers()[0]


def values(manager: ControllerManager) -> dict[str, object]:
    return {each.parameter.name: each.value for each in manager.parameters("double")}


def test_manager_tells_which_types_it_can_load(manager: ControllerManager) -> None:
    assert manager.kinds == ("test/Double", "test/Broken")


def test_manager_loads_by_type_with_the_parameters_as_they_are_by_default(manager: ControllerManager) -> None:
    manager.load_kind("double", "test/Double")
    assert (info(manager).name, info(manager).kind, info(manager).state) == (
        "double",
        "test/Double",
        State.UNCONFIGURED,
    )
    assert values(manager) == {"p": 1.0, "mode": "slow"}


@pytest.mark.parametrize(
    ("name", "kind", "code", "values"),
    [
        (
            "other",
            "test/None",
            "controller_type_unknown",
            {"type": "test/None", "types": ("test/Double", "test/Broken")},
        ),
        (
            "other",
            "test/Broken",
            "controller_raised",
            {"call": "load", "type": "ValueError", "error": message("text", text="other is broken")},
        ),
        ("double", "test/Double", "controller_loaded_already", {}),
        ("1st", "test/Double", "controller_name_not_allowed", {}),
        ("a/b", "test/Double", "controller_name_not_allowed", {}),
        ("", "test/Double", "controller_name_not_allowed", {}),
    ],
)
@pytest.mark.usefixtures("double")
def test_manager_refuses_to_load(
    manager: ControllerManager, name: str, kind: str, code: str, values: dict[str, object]
) -> None:
    before = manager.activity
    with refused(CommandRefused, code, controller=name, **values):
        manager.load_kind(name, kind)
    assert [each.name for each in manager.controllers()] == ["double"]
    assert manager.activity == before


def test_manager_knows_required_interfaces_once_a_controller_is_configured(
    manager: ControllerManager, double: Double
) -> None:
    assert (info(manager).required, info(manager).required_state) == ((), ())
    manager.configure("double")
    assert info(manager).required == tuple(f"{name}/position" for name in NAMES)
    assert len(info(manager).required_state) == 14
    manager.clean_up("double")
    assert (info(manager).state, info(manager).required) == (State.UNCONFIGURED, ())


def test_manager_configures_an_inactive_controller_anew(manager: ControllerManager, double: Double) -> None:
    manager.configure("double")
    manager.configure("double")
    assert double.done == ["configure", "clean_up", "configure"]
    assert (info(manager).state, double.values) == (State.INACTIVE, {"p": 1.0, "mode": "slow"})


def test_manager_leaves_a_controller_unconfigured_that_fails_to_configure(
    manager: ControllerManager, double: Double
) -> None:
    manager.configure("double")
    double.faults["configure"] = KeyError("gain")
    error = message("text", text="'gain'")
    with refused(
        CommandRefused, "controller_raised", controller="double", call="configure", type="KeyError", error=error
    ):
        manager.configure("double")
    assert info(manager).state is State.UNCONFIGURED


def test_manager_keeps_an_inactive_controller_when_a_value_is_refused(
    manager: ControllerManager, double: Double
) -> None:
    manager.configure("double")
    reason = message("value_out_of_range_with_unit", parameter="p", value="5", lowest=0.0, highest=2.0, unit="1/s")
    with refused(CommandRefused, "controller_parameter_refused", parameter="p", controller="double", reason=reason):
        manager.set_parameters("double", {"p": 5})
    assert (info(manager).state, double.done) == (State.INACTIVE, ["configure"])


def test_manager_refuses_a_controller_that_names_an_interface_twice(manager: ControllerManager, double: Double) -> None:
    double.kinds = ("position", "position")
    with refused(CommandRefused, "interface_named_twice", controller="double", interface="yumi_joint_1_r/position"):
        manager.configure("double")
    assert info(manager).state is State.UNCONFIGURED


@pytest.mark.parametrize(
    ("verb", "code"),
    [
        ("configure", "transition_not_allowed"),
        ("clean_up", "transition_not_allowed"),
        ("unload", "controller_still_active"),
    ],
)
def test_manager_leaves_an_active_controller_as_it_is(
    manager: ControllerManager, double: Double, verb: str, code: str
) -> None:
    manager.configure("double")
    manager.switch(["double"], [], RUNNING)
    with refused(CommandRefused, code, controller="double"):
        getattr(manager, verb)("double")
    assert info(manager).state is State.ACTIVE


@pytest.mark.parametrize("verb", ["configure", "clean_up", "unload", "parameters"])
def test_manager_names_what_is_loaded_when_asked_for_something_else(manager: ControllerManager, verb: str) -> None:
    with refused(CommandRefused, "controller_unknown", controller="other", loaded=()) as caught:
        getattr(manager, verb)("other")
    assert "none" in str(caught.value)


@pytest.mark.usefixtures("double")
def test_manager_cleans_up_an_unconfigured_controller_without_a_word(manager: ControllerManager) -> None:
    manager.clean_up("double")
    assert info(manager).state is State.UNCONFIGURED


@pytest.mark.parametrize("is_configured", [False, True])
def test_manager_unloads_what_is_not_active(manager: ControllerManager, double: Double, is_configured: bool) -> None:
    if is_configured:
        manager.configure("double")
    manager.unload("double")
    assert manager.controllers() == ()
    assert ("clean_up" in double.done) is is_configured


def test_manager_changes_parameters_of_an_unconfigured_controller_for_later(
    manager: ControllerManager, double: Double
) -> None:
    manager.set_parameters("double", {"p": 0.5, "mode": "fast"})
    assert double.done == []
    manager.configure("double")
    assert double.values == {"p": 0.5, "mode": "fast"}


@pytest.mark.parametrize(
    ("given", "code", "said"),
    [
        ({"p": 3.0}, "controller_parameter_refused", {"parameter": "p"}),
        ({"q": 3.0}, "controller_parameter_unknown", {"parameter": "q", "parameters": ("p", "mode")}),
    ],
)
@pytest.mark.usefixtures("double")
def test_manager_refuses_parameters_of_an_unconfigured_controller(
    manager: ControllerManager, given: dict[str, float], code: str, said: dict[str, object]
) -> None:
    with refused(CommandRefused, code, controller="double", **said):
        manager.set_parameters("double", given)
    assert values(manager) == {"p": 1.0, "mode": "slow"}


def test_manager_changes_parameters_of_an_active_controller_at_once(manager: ControllerManager, double: Double) -> None:
    manager.configure("double")
    manager.switch(["double"], [], RUNNING)
    manager.set_parameters("double", {"p": 0.5, "mode": "slow"})
    assert double.values == {"p": 0.5, "mode": "slow"}
    assert info(manager).state is State.ACTIVE


def test_manager_keeps_a_read_only_parameter_once_configured(manager: ControllerManager, double: Double) -> None:
    manager.configure("double")
    settled = {"parameter": "mode", "controller": "double", "state": "inactive"}
    with refused(CommandRefused, "controller_parameter_settled", **settled):
        manager.set_parameters("double", {"p": 0.5, "mode": "fast"})
    assert double.values == {"p": 1.0, "mode": "slow"}
    manager.clean_up("double")
    manager.set_parameters("double", {"mode": "fast"})
    assert values(manager)["mode"] == "fast"


@pytest.mark.parametrize(
    ("fault", "code", "said"),
    [
        (CommandRefused("They do not go together."), "text", {"text": "They do not go together."}),
        (ZeroDivisionError("by zero"), "controller_raised", {"call": "set_parameters", "type": "ZeroDivisionError"}),
    ],
)
def test_manager_keeps_the_values_when_a_controller_refuses_the_new_ones(
    manager: ControllerManager, double: Double, fault: Exception, code: str, said: dict[str, object]
) -> None:
    manager.configure("double")
    double.faults["configure"] = fault
    with refused(CommandRefused, code, **said):
        manager.set_parameters("double", {"p": 0.5})
    assert values(manager) == {"p": 1.0, "mode": "slow"}


def test_activity_counts_every_change_of_what_there_is(manager: ControllerManager) -> None:
    counts = [manager.activity]
    for act in (
        lambda: manager.load_kind("double", "test/Double"),
        lambda: manager.configure("double"),
        lambda: manager.switch(["double"], [], RUNNING),
        lambda: manager.set_hardware_state("arm", State.INACTIVE),
        lambda: manager.clean_up("double"),
        lambda: manager.unload("double"),
    ):
        act()
        counts.append(manager.activity)
    assert counts == sorted(set(counts))


@pytest.mark.usefixtures("double")
def test_activity_does_not_count_parameters_and_cycles(manager: ControllerManager) -> None:
    before = manager.activity
    manager.set_parameters("double", {"p": 0.5})
    manager.update(RUNNING)
    manager.watch(RUNNING)
    manager.deactivate_commanding()
    assert manager.activity == before


def test_watching_controller_that_fails_is_deactivated_and_the_others_go_on(
    manager: ControllerManager, double: Double
) -> None:
    watcher, other = Watcher(), Watcher()
    for name, each in (("watcher", watcher), ("other", other)):
        manager.load(name, each)
    for name in ("double", "watcher", "other"):
        manager.configure(name)
    manager.switch(["double", "watcher", "other"], [], RUNNING)
    watcher.faults["update"] = OSError("disk full")
    manager.watch(RUNNING)
    (failure,) = manager.failures
    error = message("text", text="disk full")
    assert_says(failure, "watching_controller_failed", controller="watcher", type="OSError", error=error)
    assert [each.state for each in manager.controllers()] == [State.ACTIVE, State.INACTIVE, State.ACTIVE]


def test_statistics_of_a_controller_begin_anew_when_it_is_activated(manager: ControllerManager, double: Double) -> None:
    manager.configure("double")
    for _ in range(2):
        manager.switch(["double"], [], RUNNING)
        manager.note_times(RUNNING, [0.0] * 8)
        assert info(manager).execution_time.count == 1
        manager.switch([], ["double"], RUNNING)
