"""Round trips over ROS 2 and the wire: what the application knows of them, joined with the driver's recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from yumi.clock import SystemClock
from yumi.evaluation.loop_trips import HeardState, LoopCycle, SentGoal, Trip, join_trips
from yumi.evaluation.machine_answer import FILE_NAME, SIDE, TEXT, machine_trip, prepare
from yumi.evaluation.recording import read_recording
from yumi.evaluation.robot_place import RobotPlace
from yumi.evaluation.virtual_experiment import moved
from yumi.evaluation.virtual_trips import PERIOD, nudge
from yumi.hardware.rws_client import RwsClient
from yumi.robot.joints import Side
from yumi.ros.evaluation_node import EvaluationNode
from yumi.wire_runs import standing

AXIS_6 = 6
"""By its place in the chain: the last, by which echoes of goals are known."""

_ECHO = 0.1  # [s] until the last goal's state has come
_ALL = 1e9  # [s] of a recording


class _Unpaced(SystemClock):
    """A virtual controller bears any number of requests a second, a real one fewer than twenty."""

    def wait(self, seconds: float) -> None:
        """Do not."""


def send_nudges(node: EvaluationNode, count: int) -> tuple[SentGoal, ...]:
    """Send goals that hardly move the arm, each with a position of its own; what was heard is in ``node.states``."""
    node.start_egm()
    start = standing(node)
    with node.echoes() as echoes:
        node.states.clear()
        begin, sent = time.monotonic() + PERIOD, []
        for number in range(count):
            node.spin_until(begin + number * PERIOD)
            goal = moved(start, nudge(number), (AXIS_6,))
            sent.append((node.send(goal), goal[AXIS_6]))
        node.spin_until(time.monotonic() + _ECHO)
    heard = {value: moment for moment, value in reversed(echoes)}
    return tuple(SentGoal(value, moment, heard.get(value, moment)) for moment, value in sent)


def join_recorded(goals: Sequence[SentGoal], states: Sequence[HeardState], recording: Path) -> tuple[Trip, ...]:
    """The round trips of ``goals``, with the cycles of the driver's ``recording``, which is complete."""
    frames = read_recording(recording, before=_ALL, after=_ALL).frames.get(Side.RIGHT, ())
    cycles = [
        LoopCycle(frame.time, frame.time + frame.stations.reply, frame.reference[AXIS_6])
        for frame in frames
        if frame.reference is not None
    ]
    return join_trips(goals, cycles, states)


def state_machine_client(place: RobotPlace, address: str) -> RwsClient:
    """Asks a virtual controller as often as it answers, a real one at the pace it bears; not connected yet."""
    clock = SystemClock() if place.robot else _Unpaced()
    return RwsClient(address, user=place.user, password=place.password, clock=clock)


def service_trips(node: EvaluationNode, count: int) -> tuple[float, ...]:
    """Calls of the driver's robot manager [s]."""
    node.is_ready()  # finding each other is no round trip
    return tuple(_lasted(node.is_ready) for _ in range(count))


def machine_trips(node: EvaluationNode, client: RwsClient, count: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Round trips to the idle state machine and back: until it has been asked, and until its answer has come [s].

    Raises:
        RobotNotReady: it did not answer.
    """
    node.load_module(SIDE, FILE_NAME, TEXT)
    prepare(client)
    trips = [machine_trip(client, str(number), time.monotonic, node.check) for number in range(count)]
    requests, answers = zip(*trips, strict=True)
    return requests, answers


def _lasted(call: Callable[[], object]) -> float:
    begin = time.monotonic()
    call()
    return time.monotonic() - begin
