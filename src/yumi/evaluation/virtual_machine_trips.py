"""Round trips from an application to the state machine and back in virtual time.

The real client asks a virtual controller that executes the real RAPID. Neither requests nor RAPID take time here, so
that what is left is the controller's cycle, in which it tells of changes.
"""

from __future__ import annotations

from collections.abc import Mapping

from yumi.clock import ManualClock
from yumi.errors import RobotNotReady
from yumi.evaluation.machine_answer import ANSWER, LONGEST, MODULE, SIDE, TEXT, ask, prepare, release
from yumi.evaluation.memory_rws import MemoryRws
from yumi.hardware.bringup import Bringup
from yumi.hardware.rapid_routines import RapidRoutines
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import EgmMotionSettings
from yumi.robot.cycle import CYCLE
from yumi.virtual.world import World

_EVERY = 0.0725  # [s] trips begin at any place in a cycle; the machine is idle then, and tells a change at once again


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
    robot, answers = VirtualRobot(), list[str]()
    with robot.client as client:
        bringup = Bringup(client, EgmMotionSettings(), robot, lambda step: None)
        bringup.make_ready()
        RapidRoutines(client, bringup.cabinet, bringup.machines, robot).load_module(SIDE, f"{MODULE}.mod", TEXT)
        prepare(client)
        client.subscribe([ANSWER], lambda change: answers.append(change.fields["value"]), answers.append)
        begin = robot.now() + _EVERY
        trips = [_trip(robot, client, answers, str(number), begin + _EVERY * number) for number in range(count)]
    requests, replies = zip(*trips, strict=True)
    return {"request": requests, "answer": replies}


def _trip(robot: VirtualRobot, client: RwsClient, answers: list[str], number: str, begin: float) -> tuple[float, float]:
    release(client)
    robot.wait(begin - robot.now())
    ask(client, number)
    asked = robot.now()
    while answers[-1] != number:
        robot.wait_for_cycle()
        if robot.now() - asked > LONGEST:
            raise RobotNotReady(f"The state machine did not answer within {LONGEST:g} s; it said {answers[-1]}.")
    return asked - begin, robot.now() - asked
