"""Round trips from an application to the state machine and back in virtual time.

The real client asks a virtual controller that executes the real RAPID. Neither requests nor RAPID take time here, so
that what is left is the controller's cycle, at whose end the answer is looked for.
"""

from __future__ import annotations

from collections.abc import Mapping

from yumi.clock import ManualClock
from yumi.evaluation.machine_answer import FILE_NAME, SIDE, TEXT, machine_trip, prepare
from yumi.evaluation.memory_rws import MemoryRws
from yumi.hardware.bringup import Bringup
from yumi.hardware.rapid_routines import RapidRoutines
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import EgmMotionSettings
from yumi.robot.cycle import CYCLE
from yumi.virtual.world import World

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
        RapidRoutines(client, bringup.cabinet, bringup.machines, robot).load_module(SIDE, FILE_NAME, TEXT)
        prepare(client)
        trips = [_trip(robot, client, number) for number in range(count)]
    requests, replies = zip(*trips, strict=True)
    return {"request": requests, "answer": replies}


def _trip(robot: VirtualRobot, client: RwsClient, number: int) -> tuple[float, float]:
    robot.wait(_SHIFT)
    return machine_trip(client, str(number), robot.now, robot.wait_for_cycle)
