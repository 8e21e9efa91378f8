from __future__ import annotations

from types import SimpleNamespace

import pytest

from yumi.control.controller import ControllerInfo, State
from yumi.errors import CommandRefused

pytestmark = pytest.mark.ros
messages = pytest.importorskip("yumi.ros.messages")


def test_message_of_an_older_installation_is_filled_as_far_as_it_goes() -> None:
    older = SimpleNamespace(ok=False)
    assert messages.filled(older, ok=True, message="done") == SimpleNamespace(ok=True)


@pytest.mark.parametrize(("state", "number"), [(state, number) for number, state in enumerate(State, start=1)])
def test_state_is_told_by_id_and_label_and_found_by_either(state: State, number: int) -> None:
    told = messages.lifecycle_state(state)
    assert (told.id, told.label) == (number, state.value)
    assert messages.state_of(told) is state
    assert messages.state_of(SimpleNamespace(id=0, label=state.value)) is state


@pytest.mark.parametrize(("number", "label"), [(0, ""), (0, "Active"), (10, "configuring")])
def test_what_is_no_state_to_be_in_is_refused(number: int, label: str) -> None:
    with pytest.raises(
        CommandRefused, match=r"is not a primary state; choose from: 1 unconfigured, 2 inactive, 3 active"
    ):
        messages.state_of(SimpleNamespace(id=number, label=label))


@pytest.mark.parametrize("state", list(State))
def test_controller_tells_what_it_requires_only_once_it_is_configured(state: State) -> None:
    info = ControllerInfo("one", "tests/One", state, ("a/position",), (), ("a/velocity",))
    told = messages.controller_state(info, 248)
    wanted = ["a/position"] if state in {State.INACTIVE, State.ACTIVE} else []
    assert list(told.required_command_interfaces) == wanted
    assert bool(told.required_state_interfaces) is bool(wanted)
