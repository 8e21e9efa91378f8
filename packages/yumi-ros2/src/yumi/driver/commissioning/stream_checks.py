"""The part of the doctor that receives EGM's position streams: started, received, judged, ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Protocol

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import ControllerRefused, NoConnection, ProtocolError, RobotNotReady, YumiError
from abb_protocols.robot.joints import CYCLE, Joints, Side
from abb_protocols.rws.operations.service import OnProgress
from abb_runtime.clock import Clock, wait_until
from abb_runtime.rws.client import RwsClient
from yumi.driver.commissioning.findings import Finding, Verdict
from yumi.driver.commissioning.installation import foreign_mains
from yumi.driver.controller_panel import ControllerPanel
from yumi.driver.launch_checks import EgmAddress
from yumi.driver.state_machine import MAIN_MODULE, MachineState, read_machine_state
from yumi.driver.stops import StopLog
from yumi.egm.egm_session import Arrivals, SensorSession, SessionCounters
from yumi.egm.joint_codec import JointCodec

_START_STREAM, _STOP_STREAM = "EGM_START_STREAM", "EGM_STOP_STREAM"

_STREAM_POLL = 0.0005  # [s]
_FIRST_DATAGRAM = 3.0  # [s] within which the first datagram comes
_IDLE_DEADLINE = 5.0  # [s]
_SAME_POSITION = 0.02  # [rad] by which the positions in datagrams may differ from those of Robot Web Services

_NEEDED_TO_STREAM = ("robot", "modules in", "program in", "version in", "task", "reachable", "login", "answers")
_WORST_LOSS = 0.001
_WORST_JITTER = 0.5 * CYCLE  # mean; a reply that is late by a whole cycle is used in the next


class CheckedStreamLink(Protocol):
    """Our end of one arm's EGM."""

    def receive(self) -> list[bytes]:
        """All datagrams that wait, oldest first."""


@dataclass(frozen=True, slots=True)
class ArmStream:
    """What came of one arm.

    Attributes:
        counters: its datagrams.
        arrivals: how regularly they came.
        position: in the last one [rad], (7,); None where none came.
    """

    counters: SessionCounters
    arrivals: Arrivals
    position: Joints | None

    @property
    def loss(self) -> float:
        """Share of the datagrams that were lost."""
        sent = self.counters.received + self.counters.lost
        return self.counters.lost / sent if sent else 0.0

    def is_of(self, position: Joints) -> bool:
        """Whether its datagrams are those of an arm that stands at ``position`` [rad]."""
        return self.position is not None and all(
            abs(one - other) < _SAME_POSITION for one, other in zip(self.position, position, strict=True)
        )


def listen(links: Mapping[Side, CheckedStreamLink], clock: Clock, duration: float) -> dict[Side, ArmStream]:
    """Receive for ``duration`` [s] after the first datagram that comes from now on."""
    for link in links.values():
        link.receive()  # what has waited says nothing about when it came
    sessions = {side: SensorSession(JointCodec()) for side in links}
    last: dict[Side, Joints] = {}
    end = clock.now() + _FIRST_DATAGRAM
    while clock.now() < end:
        for side, link in links.items():
            message = sessions[side].accept(link.receive(), clock.now())
            if message is not None:
                if not last:
                    end = clock.now() + duration
                sessions[side].settle()
                last[side] = message.measured
        clock.wait(_STREAM_POLL)
    return {side: ArmStream(each.counters, each.arrivals, last.get(side)) for side, each in sessions.items()}


@contextmanager
def streaming(client: RwsClient, clock: Clock, on_progress: OnProgress = lambda text: None) -> Iterator[None]:
    """Position streams of both arms for the time of the block; afterwards motors and program are on or off as before.

    Where no program runs, the motors go on and the program starts at main, with its variables as they begin; its
    pointers stay where it stops. Other tasks of the user are not started: they are switched off for that time, which
    ``on_progress`` gets before. The arms do not move.

    Raises:
        RobotNotReady: a task has another program than the state machine, or a stop waits for a person's confirmation,
            and nothing was switched; or the mode or the program prevents it; or a task that was switched off could not
            be switched on again.
    """
    for side in Side:
        _refuse_other_program(client, side)
    panel = ControllerPanel(client, clock)

    def quietly(action: Callable[[], object]) -> None:
        with suppress(ControllerRefused, NoConnection, RobotNotReady):  # what failed before says more
            action()

    with ExitStack() as undo:
        were_on, was_running = panel.are_motors_on, panel.is_running
        if not was_running:
            _refuse_open_stop(client, clock)
            if not were_on:
                on_progress("motors on")
                undo.callback(quietly, panel.switch_motors_off)
                panel.switch_motors_on()
            undo.enter_context(_others_off(client, on_progress))
            on_progress("program pointers to main, start the program")
            panel.move_pp_to_main()
            undo.callback(quietly, panel.stop_rapid)
            panel.start_rapid()
        wait_until(
            clock,
            lambda: all(_machine_state(client, side) is MachineState.IDLE for side in Side),
            _IDLE_DEADLINE,
            message("state_machine_does_not_become_idle"),
        )
        on_progress("start the position streams")
        client.pulse_signal(_START_STREAM)
        undo.callback(quietly, lambda: client.pulse_signal(_STOP_STREAM))
        yield


@contextmanager
def _others_off(client: RwsClient, on_progress: OnProgress) -> Iterator[None]:
    """Keep other tasks switched off for the time of the block: all that the task panel selects would start.

    Raises:
        RobotNotReady: one could not be switched on again.
    """
    left_off: list[str] = []

    def switch_on(task: str) -> None:
        try:
            client.select_task(task, True)
        except YumiError:
            left_off.append(task)
            on_progress(str(message("tasks_left_off", tasks=(task,))))

    def report(kind: object, error: BaseException | None, trace: object) -> None:
        """The error, if there was one, comes after what is left off; a Ctrl-C stays one."""
        if left_off and (error is None or isinstance(error, YumiError)):
            if error is None:
                raise RobotNotReady(message("tasks_left_off", tasks=tuple(left_off)))
            raise RobotNotReady(
                message("tasks_left_off_after", tasks=tuple(left_off), reason=said_by(error))
            ) from error

    with ExitStack() as undo:
        undo.push(report)  # the last that is done
        for task in client.tasks():
            if task.is_active and task.starts_by_hand and task.name not in {side.task for side in Side}:
                on_progress(f"task {task.name} is switched off meanwhile")
                undo.callback(switch_on, task.name)
                client.select_task(task.name, False)
        yield


def _refuse_other_program(client: RwsClient, side: Side) -> None:
    """Refuse a task where a start at main would run something else than the state machine."""
    try:
        client.symbol(side.task, MAIN_MODULE, "current_state")
    except ControllerRefused as error:
        raise RobotNotReady(message("no_state_machine_to_start", task=side.task)) from error
    for name, _ in foreign_mains(client, side):
        raise RobotNotReady(message("other_program_not_started", task=side.task, module=name))


def _refuse_open_stop(client: RwsClient, clock: Clock) -> None:
    """Start nothing after a stop that a person must confirm; a driver that comes later would not see it any more."""
    stops = StopLog(clock)
    stops.read(client)
    if stops.stop is not None:
        raise RobotNotReady(message("stop_before_installation", causes=stops.stop.causes), stops.stop.id)


def _machine_state(client: RwsClient, side: Side) -> MachineState | None:
    try:
        return read_machine_state(client, side)
    except ProtocolError:
        return None


def obstacle_to_stream(findings: Sequence[Finding]) -> Finding | None:
    """That the position streams are not tried, where the program that would start is not surely the state machine."""
    found = next(
        (
            each
            for each in findings
            if each.verdict is Verdict.PROBLEM and each.requirement.startswith(_NEEDED_TO_STREAM)
        ),
        None,
    )
    if found is None:
        return None
    what = message("stream_not_tried", requirement=found.requirement, reason=found.said)
    return Finding("EGM stream", Verdict.NOTE, what)


def examine_stream(
    streams: Mapping[Side, ArmStream], stands: Mapping[Side, Joints], addresses: Mapping[Side, EgmAddress]
) -> Iterator[Finding]:
    """Judge what came of both arms' position streams.

    Args:
        streams: what came.
        stands: where the arms stand by Robot Web Services [rad].
        addresses: where each arm's datagrams were awaited.
    """
    for side, stream in streams.items():
        name, address = f"EGM {side.word}", addresses[side]
        if stream.position is None and stream.counters.malformed:
            yield Finding(name, Verdict.PROBLEM, message("stream_not_egm", port=address.port))
        elif stream.position is None:
            yield Finding(name, Verdict.PROBLEM, message("stream_dropped", host=address.host, port=address.port))
        elif not stream.is_of(stands[side]):
            is_other = stream.is_of(stands[side.other])
            what = message("stream_of_other_arm" if is_other else "stream_not_of_this_arm", port=address.port)
            yield Finding(name, Verdict.PROBLEM, what)
        else:
            yield from _stream_quality(name, stream)


def _stream_quality(name: str, stream: ArmStream) -> Iterator[Finding]:
    numbers = message(
        "stream_quality",
        received=stream.counters.received,
        period=stream.arrivals.cycle_time,
        lost=stream.counters.lost,
        jitter=stream.arrivals.jitter,
        worst=stream.arrivals.worst_jitter,
    )
    if stream.loss > _WORST_LOSS:
        yield Finding(name, Verdict.PROBLEM, message("stream_lossy", loss=stream.loss, quality=numbers))
    elif stream.arrivals.jitter > _WORST_JITTER:
        yield Finding(name, Verdict.NOTE, message("stream_irregular", quality=numbers))
    else:
        yield Finding(name, Verdict.OK, numbers)
