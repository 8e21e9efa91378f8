"""How a gripper is reached over Robot Web Services: its signals by subscription, its commands by the state machine."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from threading import Lock
from typing import Protocol

from yumi.clock import Clock, wait_until
from yumi.driver.readiness import Request, RobotState, check
from yumi.driver.state_machine import GRIPPER, MAIN, RUN_GRIPPER, SgCommand, read_machine_state
from yumi.errors import ControllerRefused, RobotNotReady, YumiError
from yumi.robot.gripper import GripperModules, GripperState, read_gripper, signal_names
from yumi.robot.joints import Side
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.events import Change, Resource, signal_state

log = logging.getLogger(__name__)

SignalName = tuple[Side, str]
Check = Callable[[], None]
"""Raises when a gripper may not move."""


def forbid_nothing() -> None:
    """The check where nothing forbids a motion."""


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
        self._values: dict[SignalName, float] = {}
        self._reported: set[SignalName] = set()  # since the subscription started
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
            read = {(side, name): values.get(f"{name}_{side.name[0]}") for side, name in known}
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
                signal_state(f"{name}_{side.name[0]}"): (side, name)
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

    def _on_change(self, number: int, paths: Mapping[str, SignalName], change: Change) -> None:
        try:
            name, value = paths[change.path], float(change.fields["lvalue"])
        except (KeyError, ValueError):
            log.warning("a signal's change makes no sense: %s %s", change.path, dict(change.fields))
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


_ROUTINE_POLL = 0.1  # [s] between two polls whether a command was taken


class GripperRoutines:
    """The one signal the grippers share: its edge runs the command that each arm's task holds.

    Both tasks see every edge, so the next command waits until the task has taken this one: it would otherwise be
    run twice, or be erased while the task reads it.

    Args:
        client: a connected client.
        clock: for waiting.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock
        self._lock = Lock()
        self._are_empty = False  # the tasks' command variables, as far as we know

    def run(
        self,
        side: Side,
        command: SgCommand,
        timeout: float,
        *,
        target: float | None = None,
        force: float | None = None,
        check_may_move: Check = forbid_nothing,
    ) -> None:
        """Have one arm's task run ``command``; returns when the task has taken it.

        Args:
            side: which arm.
            command: what to do.
            timeout: longest wait for the task [s].
            target: finger position [m] for ``MOVE_TO``.
            force: holding force [N] for ``GRIP_IN`` and ``GRIP_OUT``.
            check_may_move: raises when the gripper may not move any more: the other one's calibration, which takes
                seconds, goes first.

        Raises:
            RobotNotReady: the task did not take the command.
        """
        with self._lock:
            if not self._are_empty:
                for each in Side:
                    self._write(each, "command_input", float(SgCommand.NONE))
            self._are_empty = False
            if target is not None:
                self._write(side, "target_position_input", target * 1e3)
            if force is not None:
                self._write_force(side, force)
            check_may_move()
            self._write(side, "command_input", float(command))
            self._client.pulse_signal(RUN_GRIPPER)
            self._wait_until_taken(side, timeout)
            self._are_empty = True

    def calibrate(self, sides: Sequence[Side], timeout: float, check_may_move: Check = forbid_nothing) -> None:
        """Have the tasks of these arms calibrate their grippers at the same time: one edge reaches both.

        Args:
            sides: which arms.
            timeout: longest wait for the tasks, which take the command when they have carried it out [s].
            check_may_move: raises when the grippers may not move any more, or the wait must end.

        Raises:
            RobotNotReady: a task did not take the command, or its arm is in EGM or runs a routine.
        """
        with self._lock:
            for side in sides:
                # The task calibrates in a trap, which would hold back every stop of an arm that moves.
                machine = read_machine_state(self._client.symbol(side.task, MAIN, "current_state"))
                state = RobotState(True, machines={side: machine})
                check(Request.CALIBRATE, state, (side,), f"the {side.word} gripper cannot be calibrated: ")
            for each in Side:
                command = SgCommand.CALIBRATE if each in sides else SgCommand.NONE
                self._write(each, "command_input", float(command))
            self._are_empty = False
            check_may_move()
            self._client.pulse_signal(RUN_GRIPPER)
            for side in sides:
                self._wait_until_taken(side, timeout, check_may_move)
            self._are_empty = True

    def _wait_until_taken(self, side: Side, timeout: float, check_may_move: Check = forbid_nothing) -> None:
        def is_taken() -> bool:
            return rapid_values.decode(self._client.symbol(side.task, GRIPPER, "command_input")) == SgCommand.NONE

        refusal = f"The {side.word} arm took no gripper command within {timeout:g} s; see that the RAPID program runs."
        wait_until(self._clock, is_taken, timeout, refusal, check=check_may_move, period=_ROUTINE_POLL)

    def _write(self, side: Side, symbol: str, value: float) -> None:
        self._client.set_symbol(side.task, GRIPPER, symbol, rapid_values.encode(value))

    def _write_force(self, side: Side, force: float) -> None:
        current = rapid_values.decode(self._client.symbol(side.task, GRIPPER, "settings"))
        if not isinstance(current, tuple) or len(current) != 3:
            raise RobotNotReady(f"{GRIPPER}/settings of {side.task} has an unknown layout: {current}.")
        max_speed, set_force, limit = current
        if set_force != force:
            self._client.set_symbol(side.task, GRIPPER, "settings", rapid_values.encode((max_speed, force, limit)))
