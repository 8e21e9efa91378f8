"""Controllers are found in the modules of their package, by the type that each class has."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Side
from yumi.control import controllers
from yumi.control.controllers import find_controllers
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.place import ControllerBuffers, Place
from yumi.control.speed_scale import SpeedScale
from yumi.driver.initial_controllers import CONTROLLER_KINDS

PLACE = Place("waiting", Side.RIGHT, ControllerBuffers(), {}, YUMI_LIMITS, CYCLE, SpeedScale())
WAITING = """
from yumi.control.controller import Controller
from yumi.control.controllers.joint_velocity import JointVelocityController


class WaitingController(Controller):
    kind = "test/WaitingController"

    def activate(self, state):
        pass


class SlowVelocities(JointVelocityController):
    kind = "test/SlowVelocities"


class Unfinished(JointVelocityController):
    pass
"""


COPY = WAITING.replace("class WaitingController", "class CopiedController")


@pytest.fixture
def kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """The names of the classes of each type, with a file more than there is."""
    (tmp_path / "waiting.py").write_text(WAITING)
    monkeypatch.setattr(controllers, "__path__", [*controllers.__path__, str(tmp_path)])
    found: dict[str, list[str]] = {}
    for each in find_controllers():
        found.setdefault(each.kind, []).append(each.__name__)
    del sys.modules["yumi.control.controllers.waiting"]
    return found


def test_controller_in_a_new_file_is_found_by_its_type(kinds: dict[str, list[str]]) -> None:
    assert kinds["test/WaitingController"] == ["WaitingController"]
    assert kinds["test/SlowVelocities"] == ["SlowVelocities"]


def test_class_without_a_type_of_its_own_replaces_none(kinds: dict[str, list[str]]) -> None:
    assert kinds[JointVelocityController.kind] == ["JointVelocityController"]
    assert all(len(names) == 1 for names in kinds.values())


def test_two_controllers_of_one_type_are_refused_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in (("waiting", WAITING), ("waiting_copy", COPY)):
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.delitem(sys.modules, f"yumi.control.controllers.{name}", raising=False)
    monkeypatch.setattr(controllers, "__path__", [*controllers.__path__, str(tmp_path)])
    with pytest.raises(SettingsError) as refusal:
        list(find_controllers())
    for name in ("waiting", "waiting_copy"):
        del sys.modules[f"yumi.control.controllers.{name}"]
    assert str(refusal.value) == (
        "Controllers yumi.control.controllers.waiting.WaitingController and "
        "yumi.control.controllers.waiting_copy.CopiedController have the same type, 'test/WaitingController'; "
        "give each a kind of its own."
    )


@pytest.mark.parametrize("kind", list(find_controllers()), ids=lambda kind: kind.__name__)
def test_each_controller_is_made_from_its_place(kind: type[controllers.Controller]) -> None:
    made = CONTROLLER_KINDS[kind.kind](PLACE)
    assert (type(made), made.kind) == (kind, kind.kind)
