"""What the controller does on the side: work that takes its time, and settings of its own beside the cfg."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from yumi.errors import YumiError

_REMEMBERED = 50


@dataclass(slots=True)
class Job:
    """Work that takes its time, such as a backup; a client reads how far it is at ``/progress/{number}``.

    Attributes:
        number: as in its address.
        work: done at its end; what it raises is the failure.
        left: time until then [s].
        is_done: whether it has ended.
        failure: why it has failed; empty as long as it has not.
    """

    number: int
    work: Callable[[], None]
    left: float
    is_done: bool = False
    failure: str = ""


class Jobs:
    """The jobs of a controller; it remembers the latest ones after their end."""

    def __init__(self) -> None:
        self._jobs: dict[int, Job] = {}
        self._begun = 0
        self._later: list[tuple[float, Callable[[], None]]] = []

    def begin(self, work: Callable[[], None], duration: float) -> Job:
        """Do ``work`` in ``duration`` [s]."""
        self._begun += 1
        job = self._jobs[self._begun] = Job(self._begun, work, duration)
        for number in [each for each, known in self._jobs.items() if known.is_done][:-_REMEMBERED]:
            del self._jobs[number]
        return job

    def find(self, number: str) -> Job | None:
        """The job of that number, or None."""
        return next((job for job in self._jobs.values() if str(job.number) == number), None)

    def later(self, delay: float, work: Callable[[], None]) -> None:
        """Do something of the controller's own in ``delay`` [s], such as the end of a pulse."""
        self._later.append((delay, work))

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        for job in tuple(self._jobs.values()) if self._jobs else ():
            if job.is_done:
                continue
            job.left -= dt
            if job.left <= 0.0:
                job.is_done = True
                try:
                    job.work()
                except YumiError as error:
                    job.failure = str(error)
        if self._later:
            waiting, self._later = [(left - dt, work) for left, work in self._later], []
            for left, work in waiting:
                if left > 0.0:
                    self._later.append((left, work))
                else:
                    work()


@dataclass(slots=True)
class OwnSettings:
    """Settings of the controller that are not system parameters.

    Attributes:
        language: of the FlexPendant, such as ``en``.
        timezone: name in the tz database; empty for that of this machine.
        timeserver: address of the time server; empty for none.
        address, mask, gateway, method: of the network connection; it is not this machine's.
        dns: address of the name server; empty for none.
        routes: gateway by destination.
        mode_lock: ``unlocked``, ``locked`` or ``permlocked``: whether the operating mode may be changed.
        pin: that unlocks it.
        backup_state: in the words of RWS.
    """

    language: str = "en"
    timezone: str = ""
    timeserver: str = ""
    address: str = "192.168.125.1"
    mask: str = "255.255.255.0"
    gateway: str = ""
    method: str = "fixip"
    dns: str = ""
    routes: dict[str, str] = field(default_factory=dict)
    mode_lock: str = "unlocked"
    pin: str = ""
    backup_state: str = "None"


@dataclass(slots=True)
class Supervision:
    """How one mechanical unit is supervised: while it is jogged, and on its path [%].

    Attributes:
        jogging, jog_level: motion supervision of jogging and its sensitivity.
        path, path_level: motion supervision of programs and its level.
    """

    jogging: bool = True
    jog_level: int = 100
    path: bool = True
    path_level: int = 100


@dataclass(slots=True)
class MotionState:
    """What ``/rw/motionsystem`` shows and sets beside the mechanical units.

    Attributes:
        active_unit: what is jogged; empty for the first.
        changes: rises with every change.
        supervision: by mechanical unit.
        lead_through: the units that are led by hand.
        predicts_collisions: whether collisions are predicted.
        is_non_motion: whether programs run without moving the arms.
    """

    active_unit: str = ""
    changes: int = 0
    supervision: dict[str, Supervision] = field(default_factory=dict)
    lead_through: set[str] = field(default_factory=set)
    predicts_collisions: bool = True
    is_non_motion: bool = False
