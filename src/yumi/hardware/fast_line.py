"""The fast line of one arm: its cycles in one thread of a process of its own.

Requests are served between two cycles, while no datagram is due. When the parent dies the arm holds until it stands,
then the process ends.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from yumi.clock import Clock, SystemClock
from yumi.control.arm_line import ArmLine
from yumi.control.flight_recorder import FLIGHT_SIZE
from yumi.control.goals import GOAL_SIZE
from yumi.control.request_desk import RequestDesk
from yumi.control.requests import CycleFailed, Event, Refusal, Reply, Request, Stop
from yumi.control.snapshot import SNAPSHOT_SIZE
from yumi.control.trajectory_feedback import FEEDBACK_SIZE
from yumi.control.trajectory_partner import PARTNER_SIZE
from yumi.errors import YumiError
from yumi.hardware.wake import Wait, WakeMode, describe, way_to_wait
from yumi.links.pipe import PipeClosed, PipeEnd
from yumi.links.poller import HasFileno, Poller
from yumi.links.realtime import prepare_process
from yumi.links.shared_memory import Bell, SharedHistory, SharedMailbox, new_bell, shared_numbers
from yumi.robot.joints import JOINT_COUNT, Side

LAST_HOLD = 2.0
"""How long an arm without a driver is held while it still moves [s]."""

_TELLING_PERIOD = 10.0  # [s]
_STATES = 64  # a quarter of a second, longer than a publisher is ever busy


class ArmBoxes:
    """What the fast line and its parent share for one arm.

    Attributes:
        states: the newest measured states, see the joint state broadcaster.
        snapshots: everything else about the arm.
        goals: where it shall go, for controllers that follow a stream of goals.
        point_goals: the same for controllers that plan the way to a single point.
        speeds: how fast it shall go.
        forward_positions: positions by index.
        forward_speeds: speeds by index.
        trajectory: how it follows a trajectory of its own.
        dual_trajectory: how it follows its part of one for both arms.
        dual_status: what it tells the other arm meanwhile.
        speed_scale: the factor on its speeds.
        flight: memory of its flight recorder.
        bell: rung after every cycle.
    """

    def __init__(self) -> None:
        self.states = SharedHistory(1 + 2 * JOINT_COUNT, _STATES)
        self.snapshots = SharedMailbox(SNAPSHOT_SIZE)
        self.goals = SharedMailbox(GOAL_SIZE)
        self.speeds = SharedMailbox(GOAL_SIZE)
        self.forward_positions = SharedMailbox(GOAL_SIZE)
        self.forward_speeds = SharedMailbox(GOAL_SIZE)
        self.trajectory = SharedMailbox(FEEDBACK_SIZE)
        self.dual_trajectory = SharedMailbox(FEEDBACK_SIZE)
        self.dual_status = SharedMailbox(PARTNER_SIZE)
        self.point_goals = SharedMailbox(GOAL_SIZE)
        self.speed_scale = SharedMailbox(1)
        self.flight = shared_numbers(FLIGHT_SIZE)
        self.bell: Bell = new_bell()


@dataclass(frozen=True, slots=True)
class WiredArm:
    """An arm of the fast line, built in its process.

    Attributes:
        line: its cycle.
        socket: what becomes readable when its robot speaks.
        rehearse: runs a cycle that reaches nobody, see :mod:`yumi.hardware.rehearsal`.
    """

    line: ArmLine
    socket: HasFileno
    rehearse: Callable[[], None] = lambda: None


class Question(NamedTuple):
    """A request on its way through the pipe, with a number that its answer bears, too."""

    number: int
    request: Request


UNREADABLE = 0
"""Stands for the number of a request that could not be read."""


class Answer(NamedTuple):
    """What became of the request of that number."""

    number: int
    reply: Reply


Build = Callable[[Side, Mapping[Side, ArmBoxes]], WiredArm]
"""Builds an arm inside its process, with the boxes of both arms; must be picklable."""


def run_fast_line(pipe: PipeEnd, build: Build, side: Side, boxes: Mapping[Side, ArmBoxes], wake: WakeMode) -> None:
    """Main function of the process."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
        signal.signal(each, signal.SIG_IGN)  # the parent decides when motion ends; its own end closes the pipe
    try:
        arm = build(side, boxes)
    except (YumiError, OSError, MemoryError) as error:  # the last two: of limits of the operating system
        pipe.send(Refusal(str(error) or type(error).__name__))
        return
    clock = SystemClock()
    wait = way_to_wait(wake, clock)
    pipe.send(f"Fast line: {prepare_process()}, {describe(wait)}.")
    FastLine(pipe, side, arm, boxes[side].bell, clock, wait).run()


class FastLine:
    """The loop inside the process."""

    def __init__(self, pipe: PipeEnd, side: Side, arm: WiredArm, bell: Bell, clock: Clock, wait: Wait) -> None:
        self._pipe = pipe
        self._side = side
        self._line = arm.line
        self._rehearsal = arm.rehearse
        self._bell = bell
        self._clock = clock
        self._wait = wait
        self._stop_at: float | None = None
        self._desk = RequestDesk({side: arm.line})
        self._has_mail = False
        self._failures: dict[str, float] = {}
        self._poller = Poller()
        self._poller.watch(arm.socket, self._answer)
        self._poller.watch(pipe, self._note_mail)
        wait.prepare(self._rehearse)

    def run(self) -> None:
        """Serve datagrams and requests until told to stop, and until the arm stands."""
        line = self._line
        while not self._may_end():
            looked = self._clock.now()  # what comes later may lie in the socket while we do something else
            self._wait.wait(self._poller, line.state is not None)
            if self._has_mail and not line.is_datagram_due(self._clock.now()):
                self._read_mail()
            line.watch_silence(looked)
            for event in line.take_events():
                self._tell(event)
        self._wait.close()
        self._poller.close()

    def _answer(self) -> None:
        arrival = self._clock.now()
        try:
            if self._line.run(arrival) is None:
                return
        except Exception as error:
            self._line.manager.deactivate_commanding()  # the next reply holds
            self._note_failure(error)
            return
        self._bell.release()
        self._wait.note_arrival(arrival)

    def _rehearse(self) -> None:
        try:
            self._rehearsal()
        except Exception as error:
            self._note_failure(error)

    def _note_failure(self, error: Exception) -> None:
        """Tell a fault now and again; at 250 Hz each telling would only bury the first."""
        sentence, now = f"{type(error).__name__}: {error}", self._clock.now()
        if now - self._failures.get(sentence, -inf) > _TELLING_PERIOD:
            self._failures[sentence] = now
            self._send(CycleFailed(self._side, sentence))

    def _may_end(self) -> bool:
        if self._stop_at is None:
            return False
        return self._clock.now() > self._stop_at or self._line.is_still

    def _note_mail(self) -> None:
        """To serve a request may take longer than a reply: no datagram should have to wait for it."""
        self._has_mail = True
        self._poller.forget(self._pipe)

    def _read_mail(self) -> None:
        self._has_mail = False
        try:
            if self._pipe.read():  # else it is a long trajectory, whose rest comes between the next cycles
                self._serve(self._pipe.receive())
        except PipeClosed:
            self._begin_to_end()
            return
        except Exception as error:  # it was read whole: the next one is sound
            self._send(Answer(UNREADABLE, Refusal(f"The request cannot be read: {type(error).__name__}: {error}.")))
        self._poller.watch(self._pipe, self._note_mail)

    def _serve(self, mail: Question | Stop) -> None:
        if isinstance(mail, Stop):
            self._begin_to_end()
        else:
            self._send(Answer(mail.number, self._desk.serve(mail.request, self._clock.now())))

    def _begin_to_end(self) -> None:
        self._stop_at = self._clock.now() + LAST_HOLD
        self._line.manager.deactivate_commanding()

    def _tell(self, event: Event) -> None:
        try:
            self._send(event)
        except Exception as error:  # a controller's notice that cannot be pickled
            self._note_failure(error)

    def _send(self, value: object) -> None:
        try:
            self._pipe.send(value)
        except PipeClosed:
            return  # the parent is gone; its end of the pipe says so to _receive
