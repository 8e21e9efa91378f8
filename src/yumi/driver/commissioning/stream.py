"""EGM's position streams: do the datagrams of both arms arrive, each at its port, and how regularly? Nothing moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Protocol

from yumi.clock import Clock, wait_until
from yumi.driver.commissioning.modules import foreign_mains
from yumi.driver.panel import ControllerPanel
from yumi.driver.state_machine import MAIN, MachineState, read_machine_state
from yumi.driver.stops import StopLog
from yumi.egm.codec import JointCodec
from yumi.egm.session import SensorSession
from yumi.errors import ControllerRefused, NoConnection, ProtocolError, RobotNotReady, YumiError
from yumi.robot.joints import Joints, Side
from yumi.rws.client import RwsClient
from yumi.rws.session import OnProgress

START_STREAM, STOP_STREAM = "EGM_START_STREAM", "EGM_STOP_STREAM"

_POLL = 0.0005  # [s]
_FIRST = 3.0  # [s] within which the first datagram comes
_IDLE_DEADLINE = 5.0
_AT = 0.02  # [rad] by which the positions in datagrams may differ from those of Robot Web Services


class Link(Protocol):
    """Our end of one arm's EGM."""

    def receive(self) -> list[bytes]:
        """All datagrams that wait, oldest first."""


@dataclass(frozen=True, slots=True)
class ArmStream:
    """What came of one arm.

    Attributes:
        received: datagrams that count.
        lost: datagrams that the robot sent and that did not arrive.
        malformed: datagrams that are not EGM.
        period: mean time between two of them [s].
        jitter: mean difference of two datagrams' delays [s].
        worst_jitter: the largest such difference [s].
        position: in the last datagram [rad], (7,); None where none came.
    """

    received: int
    lost: int
    malformed: int
    period: float
    jitter: float
    worst_jitter: float
    position: Joints | None

    @property
    def loss(self) -> float:
        """Share of the datagrams that were lost."""
        sent = self.received + self.lost
        return self.lost / sent if sent else 0.0

    def is_of(self, position: Joints) -> bool:
        """Whether its datagrams are those of an arm that stands at ``position`` [rad]."""
        return self.position is not None and all(
            abs(one - other) < _AT for one, other in zip(self.position, position, strict=True)
        )


def listen(links: Mapping[Side, Link], clock: Clock, duration: float) -> dict[Side, ArmStream]:
    """Receive for ``duration`` [s] after the first datagram that comes from now on."""
    for link in links.values():
        link.receive()  # what has waited says nothing about when it came
    sessions = {side: SensorSession(JointCodec()) for side in links}
    last: dict[Side, Joints] = {}
    end = clock.now() + _FIRST
    while clock.now() < end:
        for side, link in links.items():
            message = sessions[side].accept(link.receive(), clock.now())
            if message is not None:
                if not last:
                    end = clock.now() + duration
                sessions[side].settle()
                last[side] = message.measured
        clock.wait(_POLL)
    return {
        side: ArmStream(
            received=session.counters.received,
            lost=session.counters.lost,
            malformed=session.counters.malformed,
            period=session.arrivals.cycle_time,
            jitter=session.arrivals.jitter,
            worst_jitter=session.arrivals.worst_jitter,
            position=last.get(side),
        )
        for side, session in sessions.items()
    }


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
            lambda: all(_state(client, side) is MachineState.IDLE for side in Side),
            _IDLE_DEADLINE,
            "The state machine on the robot does not become idle; look at the FlexPendant.",
        )
        on_progress("start the position streams")
        client.pulse_signal(START_STREAM)
        undo.callback(quietly, lambda: client.pulse_signal(STOP_STREAM))
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
            left_off.append(f"Task {task} is still switched off; select it on the FlexPendant (QuickSet menu, Tasks).")
            on_progress(left_off[-1])

    def report(kind: object, error: BaseException | None, trace: object) -> None:
        """The error, if there was one, comes after what is left off; a Ctrl-C stays one."""
        if left_off and (error is None or isinstance(error, YumiError)):
            raise RobotNotReady(" ".join((*left_off, *([f"Before that: {error}"] if error else [])))) from error

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
        client.symbol(side.task, MAIN, "current_state")
    except ControllerRefused as error:
        raise RobotNotReady(
            f"{side.task} has no state machine of this package, so nothing is started there; load it: yumi install."
        ) from error
    for name, _ in foreign_mains(client, side):
        raise RobotNotReady(
            f"{side.task} has another program: its module {name} has a main, so nothing is started; save and remove it."
        )


def _refuse_open_stop(client: RwsClient, clock: Clock) -> None:
    """Start nothing after a stop that a person must confirm; a driver that comes later would not see it any more."""
    stops = StopLog(clock)
    stops.read(client)
    if stops.stop is not None:
        raise RobotNotReady(
            f"The robot was stopped by {stops.stop.cause}. Nothing is started before a person has looked at it and "
            "confirmed that stop: start the driver (yumi up), then yumi recover."
        )


def _state(client: RwsClient, side: Side) -> MachineState | None:
    try:
        return read_machine_state(client.symbol(side.task, MAIN, "current_state"))
    except ProtocolError:
        return None
