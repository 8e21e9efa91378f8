"""The signals of both hands as the controller tells them by itself, 20 times a second while something changes."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from threading import Lock
from typing import Protocol

from yumi.errors import ControllerRefused, YumiError
from yumi.robot.gripper import GripperModules
from yumi.robot.hand import HandReading, read_hand, signal_names
from yumi.robot.joints import Side
from yumi.rws.subscriptions import Change, Resource, signal_state

SignalName = tuple[Side, str]

log = logging.getLogger(__name__)


class Closable(Protocol):
    """A subscription."""

    def close(self) -> None: ...


class Subscriber(Protocol):
    """The part of a client that is needed."""

    def subscribe(
        self, resources: Sequence[Resource], on_change: Callable[[Change], None], on_lost: Callable[[str], None]
    ) -> Closable: ...

    def signals(self) -> Mapping[str, float]: ...


class HandSignals:
    """What the hands show now, as far as a subscription tells it; safe from any thread.

    A value is known from the subscription's begin to its end: what does not change is not told again. Everything is
    read once when it has begun, for whether a controller tells what changes while the WebSocket opens is not known.

    Args:
        client: a connected client.
        modules: what each hand is made of; a hand that the controller does not have stays unknown.
    """

    def __init__(self, client: Subscriber, modules: Mapping[Side, GripperModules]) -> None:
        self._client = client
        self._modules = modules
        self._lock = Lock()
        self._values: dict[SignalName, float] = {}
        self._told: set[SignalName] = set()  # since the subscription has begun
        self._subscription: Closable | None = None
        self._lost: Closable | None = None  # its group still counts at the controller, which allows two
        self._number = 0  # of the subscription that counts: one that has ended may still have something to tell

    @property
    def is_open(self) -> bool:
        """Whether the controller tells."""
        return self._subscription is not None

    def keep_open(self) -> None:
        """Subscribe unless that has been done.

        Raises:
            YumiError: the controller cannot be reached, or refuses; the message says which.
        """
        if self._subscription is not None:
            return
        self._forget_lost()
        subscription, number = self._subscribed()
        try:
            self._read(number)
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
        self._forget_lost()
        subscription = self._end(self._number)
        if subscription is not None:
            subscription.close()

    def _forget_lost(self) -> None:
        with self._lock:
            lost, self._lost = self._lost, None
        if lost is not None:
            lost.close()

    def value(self, side: Side, name: str) -> float | None:
        """A signal of a hand by its name without the arm's suffix, or None while it is not known."""
        with self._lock:
            return self._values.get((side, name))

    def reading(self, side: Side) -> HandReading | None:
        """A hand as it is now, or None while that is not known.

        Raises:
            ProtocolError: the hand reports a state that no Smart Gripper has.
        """
        modules = self._modules[side]
        with self._lock:
            known = {name: self._values.get((side, name)) for name in signal_names(modules)}
        values = {name: value for name, value in known.items() if value is not None}
        return read_hand(values.__getitem__, modules) if len(values) == len(known) else None

    def _subscribed(self) -> tuple[Closable, int]:
        """Both hands, or the one that the controller has."""
        refusal: YumiError | None = None
        for sides in (tuple(self._modules), *((side,) for side in self._modules)):
            try:
                return self._subscribed_to(sides)
            except ControllerRefused as error:
                refusal = refusal or error
        assert refusal is not None, "there are hands"
        raise refusal

    def _subscribed_to(self, sides: Sequence[Side]) -> tuple[Closable, int]:
        with self._lock:
            self._number += 1
            self._values = {}
            number = self._number
        names = {
            signal_state(f"{name}_{side.name[0]}"): (side, name)
            for side in sides
            for name in signal_names(self._modules[side])
        }
        paths = {resource.path: name for resource, name in names.items()}
        subscription = self._client.subscribe(
            tuple(names), partial(self._take, number, paths), partial(self._lose, number)
        )
        return subscription, number

    def _read(self, number: int) -> None:
        """What is told meanwhile may be newer than what is read, and counts; the controller tells all that follows."""
        with self._lock:
            self._told.clear()
            known = tuple(self._values)
        values = self._client.signals()
        read = {(side, name): values.get(f"{name}_{side.name[0]}") for side, name in known}
        with self._lock:
            if number == self._number:
                news = {name: value for name, value in read.items() if value is not None and name not in self._told}
                self._values |= news

    def _take(self, number: int, paths: Mapping[str, SignalName], change: Change) -> None:
        try:
            name, value = paths[change.path], float(change.fields["lvalue"])
        except (KeyError, ValueError):
            log.warning("a signal's change makes no sense: %s %s", change.path, dict(change.fields))
            return
        with self._lock:
            if number == self._number:
                self._values[name] = value
                self._told.add(name)

    def _lose(self, number: int, sentence: str) -> None:
        self._lost = self._end(number) or self._lost

    def _end(self, number: int) -> Closable | None:
        with self._lock:
            if number != self._number:
                return None
            self._number += 1
            self._values = {}
            subscription, self._subscription = self._subscription, None
            return subscription
