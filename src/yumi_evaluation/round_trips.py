"""Round trips from an application to the EGM loop, the robot and back, leg by leg, by joining three lists of times.

Every goal bears a value of its own, so that it can be found again as the reference of the cycle that took it::

    sent ─ topic ─ heard ─ mailbox ─ datagram ─ cycle ─ reply ─ robot ─ the next datagram but one ─ topic ─ application

The robot takes a reply in the cycle after it and shows the motion it makes of it in the datagram after that.
All times are of one clock [s].

A round trip to the state machine and back, in virtual time and over the wire: it runs a routine that answers.

The application gives the right arm's task a number, has the state machine run a routine that copies it, and reads the
copy until the number is there. A subscription would not do: a controller tells the next change 50 ms later at the
earliest, and a round trip after the other would measure that.

Round trips from an application to the state machine and back in virtual time.

The real client asks a virtual controller that executes the real RAPID. Neither requests nor RAPID take time here, so
that what is left is the controller's cycle, at whose end the answer is looked for.

Round trips in virtual time, where topics, processors and wires take none: what is left are the cycles.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

from yumi.clock import ManualClock
from yumi.control.commands import MemoryBuffer, SessionGoal, write_goal
from yumi.control.controllers.joint_position import JointPositionController
from yumi.driver.bringup import Bringup
from yumi.driver.rapid_routines import RapidRoutines
from yumi.driver.state_machine import RAPID, RUN_RAPID, EgmMotionSettings
from yumi.errors import RobotNotReady
from yumi.robot.joints import CYCLE, Side
from yumi.rws.client import RwsClient
from yumi.virtual.world import World
from yumi_evaluation.experiment import CONTROLLER
from yumi_evaluation.guided_arm import GuidedArm
from yumi_evaluation.virtual_machine import MemoryRws, moved

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
class Trip:
    """A round trip, leg by leg [s].

    Attributes:
        topic: from the application through ROS 2 to the driver.
        mailbox: until a datagram of the robot came and the cycle began.
        cycle: until the reply had left.
        robot: over UDP, through the robot and back.
        state_topic: from the driver through ROS 2 to the application.
    """

    topic: float
    mailbox: float
    cycle: float
    robot: float
    state_topic: float

    @property
    def total(self) -> float:
        """[s]."""
        return self.topic + self.mailbox + self.cycle + self.robot + self.state_topic


LEGS = tuple(item.name for item in fields(Trip))
"""The legs in their order."""


def join_trips(
    goals: Iterable[SentGoal], cycles: Sequence[LoopCycle], states: Sequence[HeardState]
) -> tuple[Trip, ...]:
    """The round trips of all goals that a cycle took and whose state was heard; newer goals replaced the others."""
    taken = _first_cycles(cycles)
    stamps = [state.stamp for state in states]
    trips = []
    for goal in goals:
        index = taken.get(goal.value)
        if index is None or index + SHOWN_AFTER >= len(cycles):
            continue
        cycle, shown = cycles[index], cycles[index + SHOWN_AFTER]
        state = _state_of(shown, states, stamps)
        if state is not None:
            trips.append(_trip(goal, cycle, shown, state))
    return tuple(trips)


def _first_cycles(cycles: Sequence[LoopCycle]) -> Mapping[float, int]:
    first: dict[float, int] = {}
    for index, cycle in enumerate(cycles):
        first.setdefault(cycle.value, index)
    return first


def _state_of(cycle: LoopCycle, states: Sequence[HeardState], stamps: Sequence[float]) -> HeardState | None:
    index = bisect_left(stamps, cycle.arrived - _SAME)
    if index < len(states) and abs(stamps[index] - cycle.arrived) < _SAME:
        return states[index]
    return None


def _trip(goal: SentGoal, cycle: LoopCycle, shown: LoopCycle, state: HeardState) -> Trip:
    """A goal that a cycle took before the second listener had heard it spent no time in the mailbox."""
    heard = min(goal.heard, cycle.arrived) if cycle.arrived >= goal.sent else cycle.replied
    return Trip(
        topic=heard - goal.sent,
        mailbox=max(0.0, cycle.arrived - heard),
        cycle=cycle.replied - max(cycle.arrived, heard),
        robot=shown.arrived - cycle.replied,
        state_topic=state.heard - shown.arrived,
    )


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
    client.set_symbol(SIDE.other.task, RAPID, _ROUTINE, '""')
    client.set_signal(RUN_RAPID, 0)


def machine_trip(
    client: RwsClient, number: str, now: Callable[[], float], pause: Callable[[], None]
) -> tuple[float, float]:
    """Have the idle state machine answer ``number``.

    Args:
        client: asks the controller.
        number: one that it was not asked before.
        now: tells the time [s].
        pause: called before each look for the answer.

    Returns:
        Until it had been asked, and from then until its answer was read [s].

    Raises:
        RobotNotReady: it did not answer.
    """
    begin = now()
    client.set_symbol(SIDE.task, MODULE, "asked", number)
    client.set_symbol(SIDE.task, RAPID, _ROUTINE, '"answer"')
    client.set_signal(RUN_RAPID, 1)
    asked = now()
    _wait_until(lambda: client.symbol(SIDE.task, MODULE, "answered") == number, now, pause)
    answered = now()
    client.set_signal(RUN_RAPID, 0)
    _wait_until(lambda: client.symbol(SIDE.task, RAPID, _ROUTINE) == '""', now, pause)
    return asked - begin, answered - asked


def _wait_until(is_so: Callable[[], bool], now: Callable[[], float], pause: Callable[[], None]) -> None:
    end = now() + _LONGEST
    pause()
    while not is_so():
        if now() > end:
            raise RobotNotReady(f"The state machine of the {SIDE.word} arm did not answer within {_LONGEST:g} s.")
        pause()


_SHIFT = 0.0125  # [s] no multiple of a cycle: trips begin at any place in one


class VirtualRobot(ManualClock):
    """A whole virtual controller in virtual time: waiting is what makes it go on.

    Attributes:
        client: asks it, without the pace that a real controller wants.
    """

    def __init__(self) -> None:
        super().__init__()
        self._world = World()
        self._link = MemoryRws(self._world.controller, self)
        self._due = CYCLE
        self.client = RwsClient(self._link, clock=_Unpaced(self))

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


class _Unpaced:
    """A virtual controller bears any number of requests at once."""

    def __init__(self, clock: ManualClock) -> None:
        self._clock = clock

    def now(self) -> float:
        return self._clock.now()

    def wait(self, seconds: float) -> None:
        """Do not."""


def virtual_machine_trips(count: int) -> Mapping[str, tuple[float, ...]]:
    """``count`` round trips, leg by leg [s]: until the state machine has been asked, and until the answer has come."""
    robot = VirtualRobot()
    with robot.client as client:
        bringup = Bringup(client, EgmMotionSettings(), robot, lambda step: None)
        bringup.make_ready()
        RapidRoutines(client, bringup.panel, bringup.machines, robot).load_module(SIDE, FILE_NAME, TEXT)
        prepare(client)
        trips = [_virtual_machine_trips_trip(robot, client, number) for number in range(count)]
    requests, replies = zip(*trips, strict=True)
    return {"request": requests, "answer": replies}


def _virtual_machine_trips_trip(robot: VirtualRobot, client: RwsClient, number: int) -> tuple[float, float]:
    robot.wait(_SHIFT)
    return machine_trip(client, str(number), robot.now, robot.wait_for_cycle)


PERIOD = 0.005
"""Between two goals: not that of the cycles, so that they fall into them everywhere [s]."""

NUDGE = 1e-7
"""Between the positions of two goals; so that the arm need not move, and each is known again [rad]."""

_JOINT = 6


def nudge(number: int) -> float:
    """Where goal ``number``, from 0, is relative to where the joint stands [rad]; none is where it stands."""
    return (number + 1) * NUDGE


def virtual_trips(count: int) -> tuple[tuple[Trip, ...], int, int]:
    """``count`` round trips to the EGM loop, the datagrams meanwhile, and how many of them were lost."""
    goals = MemoryBuffer[SessionGoal]()
    arm = GuidedArm({CONTROLLER: JointPositionController(goals)}, side=Side.RIGHT)
    arm.start()
    arm.run(0.1)
    arm.switch_to(CONTROLLER)
    start, session, begin = arm.robot.arm.planned, arm.snapshot.session, arm.clock.now()
    sent: list[SentGoal] = []
    cycles: list[LoopCycle] = []
    while len(sent) < count + 3:
        while (due := begin + PERIOD * len(sent)) <= arm.clock.now() + CYCLE:
            position = moved(start, nudge(len(sent)), (_JOINT,))
            write_goal(goals, session, position, time=due)
            sent.append(SentGoal(position[_JOINT], due, due))
        arm.cycle()
        taken, now = arm.line.manager.reference, arm.cycles[-1].state.time
        cycles.append(LoopCycle(now, now, taken[_JOINT] if taken else start[_JOINT]))
    states = [HeardState(cycle.arrived, cycle.arrived) for cycle in cycles]
    snapshot = arm.snapshot
    return join_trips(sent, cycles, states)[:count], len(cycles), snapshot.lost + snapshot.missed
