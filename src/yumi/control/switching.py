"""What a switch of controllers comes to, decided before anything is done (reference/ros2_control.md §1.11)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from yumi.control.component import HardwareComponent
from yumi.control.lifecycle import State, Transition
from yumi.control.loaded import LoadedController
from yumi.control.requests import Strictness
from yumi.errors import CommandRefused

NOTHING_TO_SWITCH = "After checking the controllers, no controllers need to be activated or deactivated."
SWITCHED = "Successfully switched controllers!"
"""In the words that clients of ros2_control know."""


@dataclass(frozen=True, slots=True)
class Switch:
    """What is done in one step, in this order.

    Attributes:
        deactivate: active controllers.
        activate: controllers that are inactive by then; one that is in both lists begins anew.
        left_out: why something else that was asked for is not done.
    """

    deactivate: tuple[LoadedController, ...]
    activate: tuple[LoadedController, ...]
    left_out: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """What was done, once it is done."""
        if not self.deactivate and not self.activate:
            return " ".join((NOTHING_TO_SWITCH, *self.left_out))
        return " ".join((SWITCHED, *self.left_out))


def plan_switch(
    loaded: Mapping[str, LoadedController],
    component: HardwareComponent,
    activate: Sequence[str],
    deactivate: Sequence[str],
    strictness: Strictness,
) -> Switch:
    """What the switch comes to.

    Args:
        loaded: all controllers of the arm by name.
        component: its hardware.
        activate: names of controllers to activate.
        deactivate: names of controllers to deactivate.
        strictness: whether those that cannot are left out.

    Raises:
        CommandRefused: a name or a state stands against it and it is strict, or an interface does, however strict.
    """
    chooser = _Chooser(loaded, strictness)
    stopping = chooser.chosen(deactivate, Transition.DEACTIVATE, ())
    starting = chooser.chosen(activate, Transition.ACTIVATE, stopping)
    if not stopping and not starting and chooser.known == 0 and chooser.left_out:
        raise CommandRefused(" ".join(chooser.left_out))
    for controller in starting:
        component.check_interfaces(controller.name, controller.required, controller.required_state)
    staying = [each for each in loaded.values() if each.state is State.ACTIVE and each not in stopping]
    _check_claims((*staying, *starting))
    return Switch(stopping, starting, tuple(chooser.left_out))


class _Chooser:
    """Goes through the names of a request; what cannot be done is left out or refused."""

    def __init__(self, loaded: Mapping[str, LoadedController], strictness: Strictness) -> None:
        self.left_out: list[str] = []
        self.known = 0
        self._loaded = loaded
        self._is_strict = strictness is Strictness.STRICT

    def chosen(
        self, names: Sequence[str], transition: Transition, stopping: tuple[LoadedController, ...]
    ) -> tuple[LoadedController, ...]:
        """Those of ``names`` that can make the transition; who is ``stopping`` can begin anew."""
        controllers = []
        for name in dict.fromkeys(names):
            try:
                controller = find(self._loaded, name)
                self.known += 1
                if controller not in stopping:
                    controller.check(transition)
            except CommandRefused as refusal:
                if self._is_strict:
                    raise
                self.left_out.append(str(refusal))
            else:
                controllers.append(controller)
        return tuple(controllers)


def find(loaded: Mapping[str, LoadedController], name: str) -> LoadedController:
    """The controller of that name.

    Raises:
        CommandRefused: there is none; the sentence lists those there are.
    """
    if name not in loaded:
        raise CommandRefused(f"There is no controller {name!r}; loaded are: {', '.join(loaded) or 'none'}.")
    return loaded[name]


def _check_claims(controllers: Iterable[LoadedController]) -> None:
    owners: dict[str, str] = {}
    for controller in controllers:
        for interface in controller.required:
            if interface in owners:
                raise CommandRefused(
                    f"Controller {controller.name!r} needs {interface}, which {owners[interface]!r} has claimed; "
                    f"deactivate {owners[interface]!r} in the same switch."
                )
            owners[interface] = controller.name
