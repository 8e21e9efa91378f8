"""The signals of both Smart Grippers by subscription."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from threading import Lock
from typing import Protocol

from abb_protocols.errors import ControllerRefused, YumiError
from abb_protocols.robot.gripper_values import GripperModules, GripperState, read_gripper, signal_names
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import Resource
from abb_runtime.rws.client import Change, signal_state

_log = logging.getLogger(__name__)

_SignalName = tuple[Side, str]
"""A gripper, and one of its signals without the arm's suffix."""


def full_signal_name(side: Side, name: str) -> str:
    """A gripper's signal as the controller names it."""
    return f"{name}_{side.name[0]}"


class Closable(Protocol):
    """A subscription."""

    def close(self) -> None: ...


class Subscriber(Protocol):
    """The part of a client that is needed."""

    def subscribe(
        self, resources: Sequence[Resource], on_change: Callable[[Change], None], on_lost: Callable[[str], None]
    ) -> Closable: ...

    def signals(self) -> Mapping[str, float]: ...


class GripperSignals:
    """The signals of both grippers by subscription, 20 times a second while something changes; safe from any thread.

    A value is known from the subscription's start to its end: what does not change is not reported again. Everything is
    read once after its start, for it is unknown whether a controller reports what changes while the WebSocket opens.

    Args:
        client: a connected client.
        modules: what each gripper is made of; one that the controller does not have stays unknown.
    """

    def __init__(self, client: Subscriber, modules: Mapping[Side, GripperModules]) -> None:
        self._client = client
        self._modules = modules
        self._lock = Lock()
        self._values: dict[_SignalName, float] = {}
        self._reported: set[_SignalName] = set()  # since the subscription started
        self._subscription: Closable | None = None
        self._lost: Closable | None = None  # its group still counts at the controller, which allows two
        self._number = 0  # of the subscription that counts: one that has ended may still report something

    @property
    def is_open(self) -> bool:
        """Whether the controller reports changes."""
        return self._subscription is not None

    def keep_open(self) -> None:
        """Subscribe unless that has been done.

        Raises:
            YumiError: the controller cannot be reached, or refuses; the message says which.
        """
        if self._subscription is not None:
            return
        self._close_lost()
        subscription, number = self._subscribed()
        try:
            # What is reported meanwhile may be newer than what is read, and counts.
            with self._lock:
                self._reported.clear()
                known = tuple(self._values)
            values = self._client.signals()
            read = {(side, name): values.get(full_signal_name(side, name)) for side, name in known}
            with self._lock:
                if number == self._number:
                    self._values |= {
                        name: value for name, value in read.items() if value is not None and name not in self._reported
                    }
        except YumiError:
            self._end(number)
            subscription.close()
            raise
        with self._lock:
            if number == self._number:
                self._subscription = subscription
            else:  # lost meanwhile
                self._lost = subscription

    def close(self) -> None:
        """End the subscription; nothing is known any more."""
        self._close_lost()
        subscription = self._end(self._number)
        if subscription is not None:
            subscription.close()

    def value(self, side: Side, name: str) -> float | None:
        """A signal of a gripper by its name without the arm's suffix, or None while it is unknown."""
        with self._lock:
            return self._values.get((side, name))

    def state(self, side: Side) -> GripperState | None:
        """A gripper as it is now, or None while that is unknown.

        Raises:
            ProtocolError: the gripper reports a state that no Smart Gripper has.
        """
        modules = self._modules[side]
        with self._lock:
            known = {name: self._values.get((side, name)) for name in signal_names(modules)}
        values = {name: value for name, value in known.items() if value is not None}
        return read_gripper(values.__getitem__, modules) if len(values) == len(known) else None

    def _subscribed(self) -> tuple[Closable, int]:
        """Both grippers, or the one that the controller has."""
        refusal: YumiError | None = None
        for sides in (tuple(self._modules), *((side,) for side in self._modules)):
            with self._lock:
                self._number += 1
                self._values = {}
                number = self._number
            names = {
                signal_state(full_signal_name(side, name)): (side, name)
                for side in sides
                for name in signal_names(self._modules[side])
            }
            paths = {resource.path: name for resource, name in names.items()}
            try:
                on_change, on_lost = partial(self._on_change, number, paths), partial(self._on_lost, number)
                return self._client.subscribe(tuple(names), on_change, on_lost), number
            except ControllerRefused as error:
                refusal = refusal or error
        assert refusal is not None, "there are grippers"
        raise refusal

    def _on_change(self, number: int, paths: Mapping[str, _SignalName], change: Change) -> None:
        try:
            name, value = paths[change.path], float(change.fields["lvalue"])
        except (KeyError, ValueError):
            _log.warning("a signal's change makes no sense: %s %s", change.path, dict(change.fields))
            return
        with self._lock:
            if number == self._number:
                self._values[name] = value
                self._reported.add(name)

    def _on_lost(self, number: int, sentence: str) -> None:
        self._lost = self._end(number) or self._lost

    def _close_lost(self) -> None:
        with self._lock:
            lost, self._lost = self._lost, None
        if lost is not None:
            lost.close()

    def _end(self, number: int) -> Closable | None:
        with self._lock:
            if number != self._number:
                return None
            self._number += 1
            self._values = {}
            subscription, self._subscription = self._subscription, None
            return subscription
