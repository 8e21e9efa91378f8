"""A Smart Gripper behind Robot Web Services: commands through the state machine, state from its own signals.

Whatever is reported here was measured by the gripper; elapsed time decides only that it has failed.

The signals of one hand: as the controller told them last, or asked for.

The signals of both hands as the controller tells them by itself, 20 times a second while something changes.

What grippers need before they can be used: calibration, and, where it is wanted, a test whether they close.

The vacuum modules of one hand: commands through the state machine, state from the hand's own signals.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from threading import Lock
from typing import Protocol

from yumi.clock import Clock
from yumi.driver.state_machine import GripperRoutines, SgCommand
from yumi.errors import CommandRefused, ControllerRefused, GoalNotReached, ProtocolError, RobotNotReady, YumiError
from yumi.robot.gripper import (
    ALLOWANCE,
    ATMOSPHERE,
    THINNEST,
    TOP_SPEED,
    CupReading,
    Direction,
    GripperModules,
    HandCommand,
    HandOrder,
    HandReading,
    HandState,
    Outcome,
    go_to,
    hand_state,
    outcome_of,
    position_of,
    pressure_of,
    read_hand,
    signal_names,
    speed_count,
)
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient
from yumi.rws.events import Change, Resource, signal_state

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


_UNKNOWN = 404


class HandIo:
    """Signals by their names without the arm's suffix.

    What was told lags behind by what a subscription takes, 50 ms or so; what is asked for costs a request, of which
    there are few a second (see :mod:`yumi.rws.session`).

    Args:
        side: which arm carries the hand.
        client: a connected client.
        signals: what the controller tells by itself; None asks for everything.
        modules: what the hand is made of.
    """

    def __init__(
        self,
        side: Side,
        client: RwsClient,
        signals: HandSignals | None = None,
        modules: GripperModules = GripperModules.SERVO,
    ) -> None:
        self.side = side
        self.modules = modules
        self._client = client
        self._signals = signals

    @property
    def is_told(self) -> bool:
        """Whether the controller tells of this hand by itself."""
        return self._signals is not None and self._signals.value(self.side, "hand_SysState") is not None

    def value(self, name: str) -> float:
        """A signal as it was told, or else as ``ask``."""
        told = None if self._signals is None else self._signals.value(self.side, name)
        return self.ask(name) if told is None else told

    def ask(self, name: str) -> float:
        """A signal as it is now.

        Raises:
            RobotNotReady: the controller has no such signal.
        """
        full = self._full(name)
        try:
            return self._client.signal(full).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise RobotNotReady(
                f"The controller has no signal {full}; it has no {self.side.word} Smart Gripper."
            ) from error

    def write(self, name: str, value: float) -> None:
        """Write a signal of the controller to the hand."""
        self._client.set_signal(self._full(name), value)

    def reading(self) -> HandReading:
        """Everything the hand shows; raises as ``ask``."""
        return read_hand(self.value, self.modules)

    def _full(self, name: str) -> str:
        return f"{name}_{self.side.name[0]}"


CHANNELS = (1, 2)

_MOMENT = 1.0  # [s] for the hand to switch
_GLANCE = 0.05  # [s]
_VENTED = 0.95 * ATMOSPHERE

_COMMANDS = {
    ("Vacuum", 1, True): SgCommand.VACUUM_ON_1,
    ("Vacuum", 2, True): SgCommand.VACUUM_ON_2,
    ("Vacuum", 1, False): SgCommand.VACUUM_OFF_1,
    ("Vacuum", 2, False): SgCommand.VACUUM_OFF_2,
    ("Blowoff", 1, True): SgCommand.BLOW_ON_1,
    ("Blowoff", 2, True): SgCommand.BLOW_ON_2,
    ("Blowoff", 1, False): SgCommand.BLOW_OFF_1,
    ("Blowoff", 2, False): SgCommand.BLOW_OFF_2,
}


class Vacuum:
    """The vacuum modules of one hand, by their numbers 1 and 2.

    All methods raise CommandRefused where the hand has no such module.

    Args:
        io: the hand's signals.
        routines: shared by both hands.
        clock: where waiting time comes from.
        timeout: a command that was not taken after this time has failed [s].
    """

    def __init__(self, io: HandIo, routines: GripperRoutines, clock: Clock, timeout: float) -> None:
        self._io = io
        self._routines = routines
        self._clock = clock
        self._timeout = timeout

    def check(self, channel: int) -> None:
        """Refuse what the hand does not have.

        Raises:
            CommandRefused: the hand has no such module.
        """
        if channel not in CHANNELS:
            raise CommandRefused(f"A gripper has vacuum 1 and 2 at most, not {channel}.")
        channels = self._io.modules.vacuum_channels
        if channel in channels:
            return
        side = self._io.side.word
        has = f"vacuum {channels[0]} only" if channels else "no vacuum"
        raise CommandRefused(
            f"The {side} gripper has {has}: it is configured as {self._io.modules.value}. If it has vacuum {channel}, "
            f"set gripper.{side} in yumi.yaml."
        )

    def switch(self, channel: int, *, is_on: bool) -> None:
        """Switch the vacuum of a module; its blow-off ends.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self._switch("Vacuum", channel, is_on)

    def blow(self, channel: int, *, is_on: bool) -> None:
        """Switch the blow-off of a module; its vacuum ends.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self._switch("Blowoff", channel, is_on)

    def reading(self, channel: int) -> CupReading:
        """A module as it is now."""
        self.check(channel)
        return CupReading(
            sucks=self._io.value(f"hand_StatusVacuum{channel}") != 0,
            blows=self._io.value(f"hand_StatusBlowoff{channel}") != 0,
            pressure=pressure_of(self._io.value(f"hand_ActualPressure{channel}")),
        )

    def wait_until_picked(self, channel: int, threshold: float, timeout: float) -> bool:
        """Wait until the pressure shows that something closes the cup; whether it does.

        Args:
            channel: which module.
            threshold: the pressure at which it does [Pa].
            timeout: longest wait [s].
        """
        return self._becomes(lambda: self.reading(channel).has_picked(threshold), timeout)

    def drop(self, channel: int) -> None:
        """Blow off what is held: blow until the cup is vented, but no longer than a second.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self.blow(channel, is_on=True)
        self._becomes(lambda: self.reading(channel).pressure >= _VENTED, _MOMENT)
        self.blow(channel, is_on=False)

    def _switch(self, kind: str, channel: int, is_on: bool) -> None:
        self.check(channel)
        side = self._io.side
        if self._io.ask("hand_StatusCalibrated") == 0:  # the robot's routine would do nothing
            raise RobotNotReady(f"The {side.word} gripper is not calibrated; calibrate it first.")
        self._routines.run(side, _COMMANDS[kind, channel, is_on], self._timeout)
        if not self._becomes(lambda: (self._io.ask(f"hand_Status{kind}{channel}") != 0) is is_on, _MOMENT):
            word = "vacuum" if kind == "Vacuum" else "blow-off"
            raise RobotNotReady(
                f"The {side.word} gripper did not switch {word} {channel} {'on' if is_on else 'off'}; check that the "
                "module is there and look at the event log."
            )

    def _becomes(self, is_so: Callable[[], bool], timeout: float) -> bool:
        end = self._clock.now() + timeout
        while not is_so():
            if self._clock.now() >= end:
                return False
            self._clock.wait(_GLANCE)
        return True


STALL_TIME = 1.0
"""Fingers that have stood still for so long on their way to a position are stopped by something [s]."""

_JAMMED = 0.15  # [s]; what was seen standing for so long before the hand gave up was stopped by something, too
_LOOK = 0.2  # [s] between two looks that cost requests

# Not READY: the robot's routine brings the hand to READY before it sends each command.
_AT_REST = {HandState.ACTION_COMPLETED, HandState.KEEP_OBJECT}
_STANDING = _AT_REST | {HandState.READY, HandState.ERROR}
_JOGGING = {HandState.JOG_OPEN, HandState.JOG_CLOSE, HandState.CALIBRATION}


Check = Callable[[], None]
"""Raises when a hand may not move."""


def _always() -> None:
    """Nothing stands against it."""


def how_to_calibrate(side: Side) -> str:
    """The commands that calibrate a hand, for a sentence."""
    return f"service {side.value}/gripper/calibrate, or robot.{side.word}.gripper.calibrate() in a script"


class Gripper:
    """One hand.

    Attributes:
        side: which arm carries it.
        last_position: where its fingers were when it was last looked at [m].
        vacuum: its vacuum modules.

    Args:
        io: its signals.
        routines: shared by both hands.
        clock: where waiting time comes from.
        timeout: a command that has not ended after this time has failed [s].
        usual_speed: of its fingers, where an order names none [m/s].
    """

    def __init__(
        self, io: HandIo, routines: GripperRoutines, clock: Clock, timeout: float, usual_speed: float = TOP_SPEED
    ) -> None:
        self.side = io.side
        self.last_position = 0.0
        self.vacuum = Vacuum(io, routines, clock, timeout)
        self._io = io
        self._routines = routines
        self._clock = clock
        self._timeout = timeout
        self._usual_speed = usual_speed
        self._looked_at = self._stands_since = self._stood = 0.0  # the fingers, as far as they were looked at
        self._is_stopped = self._is_jogging = False

    def reading(self) -> HandReading:
        """Everything it shows now.

        Raises:
            RobotNotReady: the controller has no such gripper.
        """
        reading = self._io.reading()
        self.last_position = reading.position
        return reading

    def position(self) -> float:
        """Where its fingers are now [m]; raises as ``reading``."""
        self.last_position = position_of(self._io.value("hand_ActualPosition"))
        return self.last_position

    def is_holding(self) -> bool:
        """Whether it holds something now; raises as ``reading``."""
        return self._state() is HandState.KEEP_OBJECT and self.position() > THINNEST

    def is_calibrated(self) -> bool:
        """Whether its positions mean anything."""
        return self._io.ask("hand_StatusCalibrated") != 0

    def why_not_calibrate(self) -> str | None:
        """Why its fingers should not be closed without being asked for: they hold something, or move; else None.

        Positions mean nothing before calibration, so that a force is taken for something held.

        Raises:
            RobotNotReady: the controller has no such gripper.
        """
        state = hand_state(self._io.ask("hand_SysState"))
        if state is HandState.KEEP_OBJECT:
            return "it presses on something"
        return None if state in _STANDING else "its fingers move"

    def calibrate(self, *others: Gripper, check: Check = _always) -> None:
        """Close the fingers and call that zero; see also :meth:`RobotManager.calibrate`, which sees that they may.

        Args:
            others: hands of the same robot that are calibrated at the same time.
            check: raises when the hands may not move any more.

        Raises:
            RobotNotReady: the controller has no such gripper, its arm is guided, or it did not become calibrated.
        """
        hands = (self, *others)
        self._routines.calibrate([hand.side for hand in hands], self._timeout, check)
        for hand in hands:
            self._wait(
                hand.is_calibrated,
                _MOMENT,
                f"The {hand.side.word} gripper could not be calibrated; check its 24 V supply and its fingers.",
            )

    def begin(self, order: HandOrder, check: Check = _always) -> None:
        """Start to move the fingers.

        Args:
            order: what to do.
            check: raises when the hand may not move any more; a hold that comes after it is not forgotten.

        Raises:
            RobotNotReady: the gripper is not calibrated, in an error, or did not take the command.
        """
        self._is_stopped = self._is_jogging = False
        check()
        self._check_ready()
        # Each time: whatever was written before, the controller may have been restarted since.
        self._io.write("hand_MaxSpeed", speed_count(order.speed or self._usual_speed))
        try:
            self._send(order)
        finally:
            if self._is_stopped:  # while the command was on its way
                self.stop()
        self._stands_since, self._stood = self._clock.now(), 0.0

    def _send(self, order: HandOrder) -> None:
        if order.direction is None:
            self._routines.run(self.side, SgCommand.MOVE_TO, self._timeout, target=order.position)
        else:
            command = SgCommand.GRIP_IN if order.direction is Direction.INWARDS else SgCommand.GRIP_OUT
            self._routines.run(self.side, command, self._timeout, force=order.force)

    def wait(
        self,
        order: HandOrder,
        on_feedback: Callable[[float], None] = lambda position: None,
        is_cancelled: Callable[[], bool] = lambda: False,
    ) -> Outcome | None:
        """Wait until ``order`` has ended; None when it was cancelled, and the fingers stopped.

        Args:
            order: as given to ``begin``.
            on_feedback: told where the fingers are [m], now and then.
            is_cancelled: asked now and then.

        Raises:
            RobotNotReady: the gripper reports an error, or still moves when its time is up.
            GoalNotReached: somebody stopped it.
        """
        end = self._clock.now() + self._timeout
        while self._clock.now() <= end:
            if is_cancelled():
                self.stop()
                return None
            if self._is_stopped:
                raise GoalNotReached(f"The {self.side.word} gripper was stopped on its way.")
            outcome = self.outcome(order)
            if outcome is not None:
                return outcome
            on_feedback(self.last_position)
            self._clock.wait(_GLANCE if self._io.is_told else _LOOK)
        raise RobotNotReady(f"The {self.side.word} gripper still moves after {self._timeout:g} s; look at it.")

    def outcome(self, order: HandOrder) -> Outcome | None:
        """How ``order`` has ended, or None while it goes on.

        What was told may be older than the order, so that an end counts only when it is found by asking.

        Raises:
            RobotNotReady: the gripper reports an error.
        """
        state = self._state()
        if state in _AT_REST or state is HandState.ERROR:
            state = hand_state(self._io.ask("hand_SysState"))
        if state in _AT_REST:
            return self._outcome_at_rest(order, state)
        if state is not HandState.ERROR:
            self._look_at_fingers()
        if order.direction is None and self._is_stalled(order, state):
            self._let_go(state)
            return Outcome.STALLED
        self._check_error(state)
        return None

    def jog(self, *, opens: bool, check: Check = _always) -> None:
        """Open or close with little speed until ``stop``, calibrated or not.

        Args:
            opens: which way.
            check: as for ``begin``.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self.stop()
        self._is_stopped, self._is_jogging = False, True
        check()
        self._io.write("hand_CmdGripper", HandCommand.JOG_OPEN if opens else HandCommand.JOG_CLOSE)
        if self._is_stopped:  # while the command was on its way
            self.stop()

    def stop(self) -> None:
        """Stop the fingers: the motor lets go, and with it what the hand holds.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self._is_stopped, self._is_jogging = True, False
        self._io.write("hand_CmdGripper", HandCommand.GO_TO_READY)
        self._wait(
            lambda: hand_state(self._io.ask("hand_SysState")) is HandState.READY,
            _MOMENT,
            f"The {self.side.word} gripper does not stop; clear its error, or look at the event log.",
        )

    def hold(self) -> None:
        """Stop fingers that move, and what is on its way to them; a hand that holds something goes on holding it.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self._is_stopped = True
        if hand_state(self._io.ask("hand_SysState")) not in _STANDING:
            self.stop()

    def end_jog(self) -> None:
        """Stop a jog or a calibration, which would go on although the robot was stopped: it needs no motors.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        if self._is_jogging or hand_state(self._io.ask("hand_SysState")) in _JOGGING:
            self.hold()

    def clear_error(self) -> None:
        """Acknowledge the hand's error; nothing where there is none.

        Raises:
            RobotNotReady: it still reports one.
        """
        for level in (1, 0):
            self._io.write("hand_CmdClearErr", level)
        self._wait(
            lambda: hand_state(self._io.ask("hand_SysState")) is not HandState.ERROR,
            _MOMENT,
            f"The {self.side.word} gripper still reports an error; check its 24 V supply and look at the event log.",
        )

    def _outcome_at_rest(self, order: HandOrder, state: HandState) -> Outcome:
        position = self.last_position = position_of(self._io.ask("hand_ActualPosition"))
        is_held = order.is_held(state, position)
        is_there = abs(position - order.position) <= ALLOWANCE and not is_held
        return outcome_of(position, order.force if is_held else 0.0, stalled=not is_there, reached_goal=is_there)

    def _look_at_fingers(self) -> None:
        """See for how long they have been where they are."""
        before, now = self._looked_at, self._clock.now()
        self._looked_at = self.position()
        if self._looked_at != before:
            self._stands_since = now
        self._stood = now - self._stands_since

    def _is_stalled(self, order: HandOrder, state: HandState) -> bool:
        """A hand gives up by itself, too; an error of fingers that moved has another cause."""
        is_there = abs(self.last_position - order.position) <= ALLOWANCE
        if state is HandState.ERROR:
            return self._stood >= _JAMMED and not is_there
        return self._stood >= STALL_TIME and self._do_fingers_stand()

    def _do_fingers_stand(self) -> bool:
        """What was told may have been held up on its way: ask."""
        before, self.last_position = self.last_position, position_of(self._io.ask("hand_ActualPosition"))
        return self.last_position == before and self._io.ask("hand_ActualSpeed") == 0

    def _let_go(self, state: HandState) -> None:
        """Stop pushing against what is in the way."""
        if state is HandState.ERROR:
            self.clear_error()
        else:
            self.stop()

    def _check_ready(self) -> None:
        """What was told may be old: a refusal asks."""
        if self._io.value("hand_StatusCalibrated") == 0 and not self.is_calibrated():
            raise RobotNotReady(
                f"The {self.side.word} gripper is not calibrated; calibrate it first: {how_to_calibrate(self.side)}."
            )
        if self._state() is HandState.ERROR:
            self._check_error(hand_state(self._io.ask("hand_SysState")))

    def _check_error(self, state: HandState) -> None:
        if state is HandState.ERROR:
            raise RobotNotReady(
                f"The {self.side.word} gripper reports error {self._io.ask('hand_SysError'):g}; look at the event log, "
                "then clear it."
            )

    def _state(self) -> HandState:
        return hand_state(self._io.value("hand_SysState"))

    def _wait(self, is_so: Callable[[], bool], timeout: float, sentence: str) -> None:
        end = self._clock.now() + timeout
        while not is_so():
            if self._clock.now() >= end:
                raise RobotNotReady(sentence)
            self._clock.wait(_GLANCE)


CLOSED = go_to(0.0)

Say = Callable[[str], None]

_FAILURES = (RobotNotReady, ControllerRefused, ProtocolError, GoalNotReached)


class GripperSetup:
    """Calibrates grippers that need it, both at once, each time the robot has become ready and before EGM starts.

    A gripper loses its calibration with its 24 V supply. One that cannot be used is reported and left, since the arms
    move without it.

    Args:
        grippers: the robot's.
        is_wanted: whether they may be calibrated without being asked for (``gripper.calibrate``).
        report: told what is done, before it is done.
        complain: told which gripper cannot be used, why, and what to do; once, until that changes.
        why_not: why a gripper may not move now; None when it may.
        is_confirmed: whether nothing that stopped the robot waits for a person: an uncalibrated gripper does not know
            what is between its fingers.
    """

    def __init__(
        self,
        grippers: Mapping[Side, Gripper],
        report: Say,
        complain: Say,
        *,
        is_wanted: bool = True,
        why_not: Callable[[Side], str | None] = lambda side: None,
        is_confirmed: Callable[[], bool] = lambda: True,
    ) -> None:
        self._grippers = grippers
        self._report = report
        self._complain = complain
        self._is_wanted = is_wanted
        self._why_not = why_not
        self._is_confirmed = is_confirmed
        self._complaints: dict[Side, str] = {}

    def steps(self, *, is_tested: bool = False) -> list[str]:
        """What :meth:`run` and :func:`close_as_test` will do to the grippers as they are now, in words."""
        steps = []
        for side, gripper in self._grippers.items():
            with suppress(*_FAILURES):  # what cannot be used is not moved, and run() reports why
                if not gripper.is_calibrated() and self._why_not_now(gripper) is None:
                    steps.append(f"calibrate the {side.word} gripper (its fingers close)")
                if is_tested and not gripper.is_holding():
                    steps.append(f"close the {side.word} gripper as a test")
        return steps

    def run(self) -> None:
        """Calibrate what needs it and may be calibrated; what cannot is left uncalibrated."""
        chosen = [gripper for gripper in self._grippers.values() if self._is_to_calibrate(gripper)]
        if not chosen:
            return
        words = " and ".join(gripper.side.word for gripper in chosen)
        self._report(f"calibrate the {words} gripper{'s' if len(chosen) > 1 else ''}: the fingers close")
        try:
            chosen[0].calibrate(*chosen[1:])
        except _FAILURES as error:
            for gripper in chosen:
                self._complain_if_new(gripper.side, f"The {gripper.side.word} gripper cannot be used: {error}")
            return
        for gripper in chosen:
            self._complaints.pop(gripper.side, None)

    def _is_to_calibrate(self, gripper: Gripper) -> bool:
        side = gripper.side
        try:
            if gripper.is_calibrated():
                self._complaints.pop(side, None)
                return False
            reason = self._why_not_now(gripper)
        except _FAILURES as error:
            self._complain_if_new(side, f"The {side.word} gripper cannot be used: {error}")
            return False
        if reason is not None:
            self._complain_if_new(
                side,
                f"The {side.word} gripper is not calibrated, and is not calibrated now: {reason}. When its fingers may "
                f"close: {how_to_calibrate(side)}.",
            )
        return reason is None

    def _why_not_now(self, gripper: Gripper) -> str | None:
        if not self._is_wanted:
            return "gripper.calibrate is never"
        if not self._is_confirmed():
            return "the robot was stopped, and a gripper without calibration does not know what it holds"
        return self._why_not(gripper.side) or gripper.why_not_calibrate()

    def _complain_if_new(self, side: Side, sentence: str) -> None:
        if self._complaints.get(side) != sentence:
            self._complaints[side] = sentence
            self._complain(sentence)


def close_as_test(grippers: Mapping[Side, Gripper], report: Say, complain: Say) -> None:
    """Close each gripper to see that it does; one that holds something, or is not calibrated, is left as it is.

    Args:
        grippers: the robot's.
        report: told what was done.
        complain: told which gripper cannot be used, and why.
    """
    for side, gripper in grippers.items():
        try:
            report(f"The {side.word} gripper {_tested(gripper)}.")
        except _FAILURES as error:
            complain(f"The {side.word} gripper cannot be used: {error}")


def _tested(gripper: Gripper) -> str:
    """Close a hand; what became of it.

    Raises:
        RobotNotReady: it did not close, or reports an error.
        GoalNotReached: somebody stopped it.
    """
    if gripper.is_holding():
        return "holds something and was not closed as a test"
    gripper.begin(CLOSED)
    if gripper.wait(CLOSED) is not Outcome.CLOSED:
        raise RobotNotReady(
            f"Its test failed: it was to close, and its fingers are at {gripper.last_position * 1e3:.1f} mm; look what "
            "is between them, or calibrate it with nothing between them."
        )
    return "was closed as a test"
