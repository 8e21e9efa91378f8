"""The virtual robot in virtual time: a clock of its own, Robot Web Services and EGM in memory."""

from __future__ import annotations

import logging

from yumi.clock import ManualClock
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.udp import memory_links
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient
from yumi.virtual.fault_injection import FaultInjection
from yumi.virtual.memory import MemoryRws
from yumi.virtual.world import World, WorldSettings

log = logging.getLogger(__name__)


class VirtualYumi(ManualClock):
    """A virtual robot with a clock of its own: time passes when a test waits, as fast as it can be computed.

    Attributes:
        world: the robot: its controller, arms, grippers and EGM clients.
        rws: its Robot Web Services, the transport of an ``RwsClient``; ``handle_request`` answers requests of httpx.
        egm: per arm what takes the place of the sensor's UDP socket: ``receive()`` and ``send(datagram)``.
        faults: injects faults into it.

    Args:
        settings: what the robot is like; a stock YuMi when left out.
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self.world = World(settings)
        links = {side: memory_links() for side in Side}
        self.egm = {side: sensor for side, (sensor, _) in links.items()}
        self._robot_ends = {side: robot for side, (_, robot) in links.items()}
        self.rws = MemoryRws(self.world.controller, self)
        self.faults = FaultInjection(self.world, self.rws.adapter)

    def wait(self, seconds: float) -> None:
        """Let the robot go on for ``seconds``, in whole cycles, at least one."""
        for _ in range(max(1, round(seconds / self.world.cycle_time))):
            self.advance(self.world.cycle_time)
            inboxes = {side: end.receive() for side, end in self._robot_ends.items()}
            for side, datagram, is_foreign in self.world.exchange(inboxes):
                if not is_foreign:  # memory has one sender only
                    self._robot_ends[side].send(datagram)
            self.rws.advance()

    def client(self) -> RwsClient:
        """A client of its Robot Web Services, to be used in a ``with`` block."""
        return RwsClient(self.rws, clock=self)

    def start_egm(self, motion: EgmMotionSettings | None = None) -> None:
        """Bring the robot to ready and start EGM on both arms, as the driver does.

        Args:
            motion: of EGM; the driver's own when left out.

        Raises:
            RobotNotReady: it did not become ready, or EGM did not start; the message says why.
        """
        with self.client() as client:
            bringup = Bringup(client, motion or EgmMotionSettings(), self, log.info)
            bringup.make_ready()
            bringup.start_egm()
