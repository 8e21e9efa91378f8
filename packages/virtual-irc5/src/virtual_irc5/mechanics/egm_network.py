"""The network between the arms and the driver: carries EGM datagrams, with the faults that are injected into it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf, radians
from random import Random
from typing import NamedTuple

from abb_protocols.egm.codec import RobotCodec, SensorCodec
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.faults import Fault, FaultDirection

_FORGED = {Fault.EGM_FORGE: 1, Fault.EGM_FORGE_OLD: -100, Fault.EGM_FORGE_AHEAD: 1000}
"""Sequence number of a forged datagram, minus that of the arm's last."""

SINGLE = (Fault.EGM_STALE, *_FORGED)
"""Faults that are one more datagram."""

LASTING = (
    Fault.EGM_LOSS,
    Fault.EGM_DELAY,
    Fault.EGM_DUPLICATE,
    Fault.EGM_REORDER,
    Fault.EGM_TRUNCATE,
    Fault.EGM_OFFSET,
    Fault.EGM_SWAP_ARMS,
    Fault.EGM_FOREIGN_PORT,
)
"""Faults that change the datagrams for a time."""

_MOST_REMEMBERED = 1000
"""Datagrams of an arm that can be repeated."""

_MS = 1e-3
_TIME_TOLERANCE = 1e-6  # of times [s]


class OutgoingDatagram(NamedTuple):
    """A datagram on its way to the driver.

    Attributes:
        side: to the port of which arm it goes.
        datagram: the bytes.
        is_foreign: whether it leaves from another port than the arm's.
    """

    side: Side
    datagram: bytes
    is_foreign: bool = False


class _LastingFault(NamedTuple):
    """A fault that lasts: how strong it is, which way, and until when [s]."""

    amount: float
    way: FaultDirection
    until: float


class _SingleFault(NamedTuple):
    """A datagram that is sent beside the arm's own, with its next."""

    fault: Fault
    amount: float


class EgmNetwork:
    """Carries the datagrams of both arms, each between its two ports.

    The same calls give the same datagrams: chance has a seed. What is delayed leaves in whole cycles of the robot.

    Args:
        cycle_time: of the robot [s].
        seed: of what is lost, reordered and cut at random.
        names: of the arms in sentences; those of a YuMi's arms without them.
    """

    def __init__(self, cycle_time: float = CYCLE, seed: int = 0, names: Mapping[Side, str] | None = None) -> None:
        self._cycle_time = cycle_time
        self._names = names or {side: f"{side.word} arm" for side in Side}
        self._random = Random(seed)
        self._now = 0.0
        self._effects: dict[tuple[Fault, Side], _LastingFault] = {}
        self._once: dict[Side, list[_SingleFault]] = {side: [] for side in Side}
        self._sent: dict[Side, deque[bytes]] = {side: deque(maxlen=_MOST_REMEMBERED) for side in Side}
        self._under_way: dict[tuple[FaultDirection, Side], list[tuple[float, bytes]]] = {}
        self._count = dict.fromkeys(Side, 0)
        self._reader, self._writer = SensorCodec(axes=7), RobotCodec()

    def inject(
        self,
        fault: Fault,
        side: Side,
        amount: float = 0.0,
        way: FaultDirection = FaultDirection.BOTH,
        duration: float | None = None,
    ) -> None:
        """Inject a fault; it replaces one of the same kind.

        Args:
            fault: which.
            side: to the datagrams of which arm.
            amount: how strong, in the unit of its kind; 0 is chance where :data:`Fault.EGM_TRUNCATE` cuts.
            way: in which direction.
            duration: how long it lasts [s]; None for ever.

        Raises:
            CommandRefused: the arm has not sent the datagram to repeat.
        """
        if fault in SINGLE:
            if fault is Fault.EGM_STALE and len(self._sent[side]) < amount:
                name, count = self._names[side], len(self._sent[side])
                raise CommandRefused(
                    f"The {name} has sent only {count} EGM datagrams, not {amount:g}; let it send more first."
                )
            self._once[side].append(_SingleFault(fault, amount))
        else:
            self._effects[fault, side] = _LastingFault(amount, way, self._now + (inf if duration is None else duration))

    def repair(self, side: Side) -> None:
        """Let all datagrams of an arm through as they are; what is under way is lost."""
        self._effects = {(fault, each): one for (fault, each), one in self._effects.items() if each is not side}
        self._once[side].clear()
        for way in FaultDirection:
            self._under_way.pop((way, side), None)

    def amount(self, fault: Fault, side: Side, way: FaultDirection = FaultDirection.BOTH) -> float | None:
        """Strength of a fault of an arm in a direction; None where there is none."""
        effect = self._effects.get((fault, side))
        return effect.amount if effect is not None and effect.way in (way, FaultDirection.BOTH) else None

    def advance(self, dt: float) -> None:
        """Begin the next cycle, ``dt`` [s] after the last: faults whose time is over end."""
        now = self._now = self._now + dt
        if self._effects:
            self._effects = {
                key: effect for key, effect in self._effects.items() if effect.until > now + _TIME_TOLERANCE
            }

    def arriving(self, inboxes: Mapping[Side, Sequence[bytes]]) -> Mapping[Side, Sequence[bytes]]:
        """What of the driver's datagrams reaches the arms in this cycle."""
        return {side: self._deliver(FaultDirection.TO_ROBOT, side, inboxes.get(side, ())) for side in Side}

    def leaving(self, datagrams: Mapping[Side, bytes]) -> list[OutgoingDatagram]:
        """What goes to the driver in this cycle, in its order, when the arms send ``datagrams``."""
        outgoing: list[OutgoingDatagram] = []
        for side in Side:
            fresh = self._made(side, datagrams[side]) if side in datagrams else ()
            to = side if self.amount(Fault.EGM_SWAP_ARMS, side) is None else side.other
            for datagram in self._deliver(FaultDirection.FROM_ROBOT, side, fresh):
                if self.amount(Fault.EGM_FOREIGN_PORT, side) is not None:
                    outgoing.append(OutgoingDatagram(to, datagram, is_foreign=True))
                outgoing.append(OutgoingDatagram(to, datagram))
        return outgoing

    def _made(self, side: Side, datagram: bytes) -> Iterable[bytes]:
        """What is sent in place of and beside a datagram of an arm."""
        sent = self._sent[side]
        sent.append(datagram)
        self._count[side] += 1
        beside = [
            sent[-1 - int(one.amount)]
            if one.fault is Fault.EGM_STALE
            else self._forged(sent[-1], one.amount, _FORGED[one.fault])
            for one in self._once[side]
        ]
        self._once[side].clear()
        offset = self.amount(Fault.EGM_OFFSET, side)
        if offset is not None:
            datagram = self._forged(datagram, offset, ahead=0)
        kept = self.amount(Fault.EGM_TRUNCATE, side)
        if kept is not None and self._count[side] % 2:
            datagram = datagram[: int(kept) or self._random.choice(field_borders(datagram))]
        return (datagram, *beside)

    def _forged(self, datagram: bytes, offset_deg: float, ahead: int) -> bytes:
        """A datagram with all joints elsewhere, and the number ``ahead`` of it; its time is the next cycle's then."""
        message, offset = self._reader.decode(datagram), radians(offset_deg)
        later = self._cycle_time if ahead else 0.0
        return self._writer.encode(
            replace(
                message,
                seqno=max(0, message.seqno + ahead),
                measured=tuple(value + offset for value in message.measured),
                planned=tuple(value + offset for value in message.planned),
                measured_time=message.measured_time + later,
                planned_time=None if message.planned_time is None else message.planned_time + later,
            )
        )

    def _deliver(self, way: FaultDirection, side: Side, fresh: Iterable[bytes]) -> Sequence[bytes]:
        """What of ``fresh``, and of what was under way, arrives now in one direction."""
        if not self._effects and not self._under_way:
            return tuple(fresh)
        loss = self.amount(Fault.EGM_LOSS, side, way) or 0.0
        delay = (self.amount(Fault.EGM_DELAY, side, way) or 0.0) * _MS
        copies = int(self.amount(Fault.EGM_DUPLICATE, side, way) or 0.0)
        disorder = int(self.amount(Fault.EGM_REORDER, side, way) or 0.0)
        line = self._under_way.pop((way, side), [])
        for datagram in fresh:
            if 100.0 * self._random.random() < loss:
                continue
            for _ in range(1 + copies):
                held = self._random.randint(0, disorder) * self._cycle_time
                line.append((self._now + delay + held, datagram))
        latest = self._now + _TIME_TOLERANCE
        later = [each for each in line if each[0] > latest]
        if later:
            self._under_way[way, side] = later
        return [datagram for due, datagram in sorted(line, key=lambda each: each[0]) if due <= latest]


_VARINT, _FIXED64, _LENGTH = 0, 1, 2  # wire types of Protocol Buffers; 5, the only other one, has four bytes


def field_borders(datagram: bytes) -> Sequence[int]:
    """Where the fields of a Protocol Buffers message end, each but the last [bytes]; 0 where it has one at most."""
    borders, at = [0], 0
    while at < len(datagram):
        kind = datagram[at] & 7
        _, at = _varint(datagram, at)
        if kind == _VARINT:
            _, at = _varint(datagram, at)
        elif kind == _LENGTH:
            length, at = _varint(datagram, at)
            at += length
        else:
            at += 8 if kind == _FIXED64 else 4
        borders.append(at)
    return borders[1:-1] or [0]


def _varint(datagram: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits in each byte, the lowest first, and where it ends."""
    value = shift = 0
    while datagram[at] & 0x80:
        value |= (datagram[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return value | datagram[at] << shift, at + 1
