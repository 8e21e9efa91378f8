"""A switch of controllers: which of those that were named are deactivated and activated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from yumi.control.controller import State, Transition
from yumi.control.manager.hardware_component import HardwareComponent
from yumi.control.manager.loaded_controller import LoadedController


class Strictness(IntEnum):
    """What becomes of a switch that names controllers which cannot do what is asked; the numbers are ROS's.

    BEST_EFFORT leaves those out, STRICT refuses the whole switch. AUTO and FORCE_AUTO are BEST_EFFORT, as upstream.
    """

    BEST_EFFORT = 1
    STRICT = 2
    AUTO = 3
    FORCE_AUTO = 4


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
    left_out: tuple[Message, ...] = ()

    @property
    def sentences(self) -> str:
        """What was done, once it is done: first in the words that clients of ros2_control know."""
        done = message("switched" if self.deactivate or self.activate else "nothing_to_switch")
        return " ".join(map(str, (done, *self.left_out)))


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
        raise CommandRefused(message("switch_without_effect", reasons=tuple(chooser.left_out)))
    for controller in starting:
        component.check_interfaces(controller.name, controller.required, controller.required_state)
    staying = [each for each in loaded.values() if each.state is State.ACTIVE and each not in stopping]
    owners: dict[str, str] = {}
    for controller in (*staying, *starting):
        for interface in controller.required:
            if interface in owners:
                raise CommandRefused(
                    message(
                        "interface_claimed",
                        controller=controller.name,
                        interface=interface,
                        owner=owners[interface],
                    )
                )
            owners[interface] = controller.name
    return Switch(stopping, starting, tuple(chooser.left_out))


class _Chooser:
    """Goes through the names of a switch; what cannot be done is left out or refused."""

    def __init__(self, loaded: Mapping[str, LoadedController], strictness: Strictness) -> None:
        self.left_out: list[Message] = []
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
                controller = find_loaded(self._loaded, name)
                self.known += 1
                if controller not in stopping:
                    controller.check(transition)
            except CommandRefused as refusal:
                if self._is_strict:
                    raise
                self.left_out.append(refusal.said)
            else:
                controllers.append(controller)
        return tuple(controllers)


def find_loaded(loaded: Mapping[str, LoadedController], name: str) -> LoadedController:
    """The controller of that name.

    Raises:
        CommandRefused: there is none; the sentence lists those there are.
    """
    if name not in loaded:
        raise CommandRefused(message("controller_unknown", controller=name, loaded=tuple(loaded)))
    return loaded[name]
