"""Round trips from an application to the EGM loop or to the state machine and back, leg by leg.

To the EGM loop: three lists of times are joined. Every goal has a value of its own, so that it can be found again as
the reference of the cycle that took it::

    sent ─ topic ─ heard ─ buffer ─ datagram ─ cycle ─ reply ─ robot ─ the next datagram but one ─ topic ─ application

The robot takes a reply in the cycle after it and shows the motion it makes of it in the datagram after that.

To the state machine: the application gives the right arm's task a number, has the state machine run a routine that
copies it, and reads the copy until the number is there. A subscription would not do: a controller reports the next
change 50 ms later at the earliest, and round trips in a row would measure that.

All times are of one clock [s]. In virtual time topics, processors, requests and RAPID take no time: what is left are
the cycles.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from virtual_irc5.testing.memory_rws import MemoryRws
from virtual_irc5.world import World
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import MemoryBuffer, SessionGoal, write_goal
from yumi.driver.bringup import Bringup
from yumi.driver.rapid_routines import RapidRoutines
from yumi.driver.state_machine import RAPID_MODULE, RUN_RAPID_SIGNAL, EgmMotionSettings
from yumi_evaluation.experiments import AXIS_6
from yumi_evaluation.virtual_time import CONTROLLER, VirtualArmRig, moved

SHOWN_AFTER = 2
"""Datagrams from the one that was answered to the one that shows what the robot made of the answer."""

_SAME = 0.001  # [s] a state and its cycle are the same instant, but for the conversion between two clocks


class SentGoal(NamedTuple):
    """A goal.

    Attributes:
        value: by which it is known again.
        sent: when the application published it.
        heard: when it had come through the topic.
    """

    value: float
    sent: float
    heard: float


class LoopCycle(NamedTuple):
    """A cycle of the EGM loop.

    Attributes:
        arrived: when the robot's datagram came.
        replied: when the reply had left.
        value: of the goal it worked with.
    """

    arrived: float
    replied: float
    value: float


class HeardState(NamedTuple):
    """A joint state.

    Attributes:
        stamp: the time of its cycle.
        heard: when the application had it.
    """

    stamp: float
    heard: float


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """A round trip, leg by leg [s].

    Attributes:
        topic: from the application through ROS 2 to the driver.
        buffer: until a datagram of the robot came and the cycle began.
        cycle: until the reply had left.
        robot: over UDP, through the robot and back.
        state_topic: from the driver through ROS 2 to the application.
    """

    topic: float
    buffer: float
    cycle: float
    robot: float
    state_topic: float

    @property
    def total(self) -> float:
        """[s]."""
        return self.topic + self.buffer + self.cycle + self.robot + self.state_topic


LEGS = tuple(item.name for item in fields(RoundTrip))
"""The legs in their order."""


def join_trips(
    goals: Iterable[SentGoal], cycles: Sequence[LoopCycle], states: Sequence[HeardState]
) -> tuple[RoundTrip, ...]:
    """The round trips of all goals that a cycle took and whose state was heard; newer goals replaced the others."""
    taken: dict[float, int] = {}
    for index, cycle in enumerate(cycles):
        taken.setdefault(cycle.value, index)
    stamps = [state.stamp for state in states]
    trips = []
    for goal in goals:
        first = taken.get(goal.value)
        if first is None or first + SHOWN_AFTER >= len(cycles):
            continue
        cycle, shown = cycles[first], cycles[first + SHOWN_AFTER]
        index = bisect_left(stamps, shown.arrived - _SAME)
        if index == len(states) or abs(stamps[index] - shown.arrived) >= _SAME:
            continue  # its joint state was not heard
        # A goal that a cycle took before the second listener had heard it spent no time in the buffer.
        heard = min(goal.heard, cycle.arrived) if cycle.arrived >= goal.sent else cycle.replied
        trips.append(
            RoundTrip(
                topic=heard - goal.sent,
                buffer=max(0.0, cycle.arrived - heard),
                cycle=cycle.replied - max(cycle.arrived, heard),
                robot=shown.arrived - cycle.replied,
                state_topic=states[index].heard - shown.arrived,
            )
        )
    return tuple(trips)


SIDE = Side.RIGHT
"""Whose state machine is asked."""

MODULE = "EvaluationAnswer"
FILE_NAME = f"{MODULE}.mod"
TEXT = f"""MODULE {MODULE}
    VAR num asked:=-1;
    PERS num answered:=-1;

    PROC answer()
        answered:=asked;
    ENDPROC
ENDMODULE
"""
"""The module with the routine, to be loaded into the task."""

_LONGEST = 1.0  # [s] an answer that takes longer does not come
_ROUTINE = "routine_name_input"


def prepare(client: RwsClient) -> None:
    """After the module was loaded: have only our task run a routine when both see the signal's next edge."""
    client.set_symbol(SIDE.other.task, RAPID_MODULE, _ROUTINE, '""')
    client.set_signal(RUN_RAPID_SIGNAL, 0)


def machine_trip(
    client: RwsClient, number: str, now: Callable[[], float], pause: Callable[[], None]
) -> tuple[float, float]:
    """Have the idle state machine answer ``number``.

    Args:
        client: of the controller.
        number: not used before.
        now: the clock [s].
        pause: called before each reading of the answer.

    Returns:
        Until it had been asked, and from then until its answer was read [s].

    Raises:
        RobotNotReady: it did not answer.
    """
    begin = now()
    client.set_symbol(SIDE.task, MODULE, "asked", number)
    client.set_symbol(SIDE.task, RAPID_MODULE, _ROUTINE, '"answer"')
    client.set_signal(RUN_RAPID_SIGNAL, 1)
    asked = now()
    _wait_until(lambda: client.symbol(SIDE.task, MODULE, "answered") == number, now, pause)
    answered = now()
    client.set_signal(RUN_RAPID_SIGNAL, 0)
    _wait_until(lambda: client.symbol(SIDE.task, RAPID_MODULE, _ROUTINE) == '""', now, pause)
    return asked - begin, answered - asked


def _wait_until(is_so: Callable[[], bool], now: Callable[[], float], pause: Callable[[], None]) -> None:
    end = now() + _LONGEST
    pause()
    while not is_so():
        if now() > end:
            raise RobotNotReady(message("state_machine_silent", arm=SIDE.word, timeout=_LONGEST))
        pause()


_SHIFT = 0.0125  # [s] no multiple of a cycle: trips begin at any place in one


class VirtualRobot(ManualClock):
    """A whole virtual controller in virtual time: waiting is what makes it go on.

    Attributes:
        client: of it, not limited to the request rate of a real controller.
    """

    def __init__(self) -> None:
        super().__init__()
        self._world = World()
        self._link = MemoryRws(self._world.controller, self)
        self._due = CYCLE
        self.client = RwsClient(self._link, clock=self)

    def wait(self, seconds: float) -> None:
        """Let time pass, with every cycle that is due in it."""
        end = self.now() + seconds
        while self._due <= end:
            self.advance(max(0.0, self._due - self.now()))
            self._due += CYCLE
            self._world.cycle({})
            self._link.advance()
        self.advance(max(0.0, end - self.now()))

    def wait_for_cycle(self) -> None:
        """Until the controller has made its next cycle."""
        self.wait(self._due - self.now())


def virtual_machine_trips(count: int) -> Mapping[str, tuple[float, ...]]:
    """``count`` round trips, leg by leg [s]: until the state machine has been asked, and until the answer has come."""
    robot = VirtualRobot()
    with robot.client as client:
        bringup = Bringup(client, EgmMotionSettings(), robot, lambda step: None)
        bringup.make_ready()
        RapidRoutines(client, bringup.panel, bringup.machines, robot).load_module(SIDE, FILE_NAME, TEXT)
        prepare(client)
        trips = []
        for number in range(count):
            robot.wait(_SHIFT)
            trips.append(machine_trip(client, str(number), robot.now, robot.wait_for_cycle))
    requests, replies = zip(*trips, strict=True)
    return {"request": requests, "answer": replies}


PERIOD = 0.005
"""Between two goals: not that of the cycles, so that they fall into them everywhere [s]."""

NUDGE = 1e-7
"""Between the positions of two goals; so that the arm need not move, and each is known again [rad]."""


def nudge(number: int) -> float:
    """Where goal ``number``, from 0, is relative to where the joint stands [rad]; none is where it stands."""
    return (number + 1) * NUDGE


def virtual_trips(count: int) -> tuple[tuple[RoundTrip, ...], int, int]:
    """``count`` round trips to the EGM loop, the datagrams meanwhile, and how many of them were lost."""
    goals = MemoryBuffer[SessionGoal]()
    rig = VirtualArmRig({CONTROLLER: JointPositionController(goals)}, side=Side.RIGHT)
    rig.start()
    rig.run(0.1)
    rig.switch_to(CONTROLLER)
    start, session, begin = rig.robot.arm.planned, rig.snapshot.session, rig.clock.now()
    sent: list[SentGoal] = []
    cycles: list[LoopCycle] = []
    while len(sent) < count + 3:
        while (due := begin + PERIOD * len(sent)) <= rig.clock.now() + CYCLE:
            position = moved(start, nudge(len(sent)), (AXIS_6,))
            write_goal(goals, session, position, time=due)
            sent.append(SentGoal(position[AXIS_6], due, due))
        rig.cycle()
        taken, now = rig.line.manager.reference, rig.cycles[-1].state.time
        cycles.append(LoopCycle(now, now, taken[AXIS_6] if taken else start[AXIS_6]))
    states = [HeardState(cycle.arrived, cycle.arrived) for cycle in cycles]
    snapshot = rig.snapshot
    return join_trips(sent, cycles, states)[:count], len(cycles), snapshot.wire.lost + snapshot.wire.missed
