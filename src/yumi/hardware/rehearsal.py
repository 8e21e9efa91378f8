"""A rehearsal: one cycle of a stand-in arm shortly before a datagram is due, so that the real cycle finds warm caches.

After 4 ms of sleep every page and cache line on the way to the reply has gone cold, and a cycle takes three times as
long as the next one would (docs/explanation/performance.md). The stand-in has an arm, controllers, a guard and sockets
of its own and hears what the robot said last: the same code and the same way through the kernel, and nothing of it
reaches the robot.
"""

from __future__ import annotations

from yumi.clock import Clock
from yumi.control.cycle import run_cycle
from yumi.control.guard import Guard
from yumi.control.manager import ControllerManager
from yumi.control.stations import StationClock
from yumi.hardware.egm_arm import EgmArm
from yumi.links.poller import Poller
from yumi.links.udp import UdpClient, UdpServer
from yumi.robot.values import ArmState


class Rehearsal:
    """Rehearses the cycles of one arm.

    Args:
        heard: where the robot's datagrams come from.
        socket: the stand-in's, on this machine only.
        arm: the stand-in behind it.
        manager: the stand-in's controllers.
        guard: the stand-in's.
        clock: the machine's.
    """

    def __init__(
        self,
        heard: UdpServer,
        socket: UdpServer,
        arm: EgmArm,
        manager: ControllerManager,
        guard: Guard,
        clock: Clock,
    ) -> None:
        self._heard = heard
        self._robot = UdpClient("127.0.0.1", socket.port)
        self._arm, self._manager, self._guard = arm, manager, guard
        self._clock = clock
        self._stations = StationClock()
        self._leading = next((each.name for each in manager.controllers() if each.required), None)
        self._poller = Poller()
        self._poller.watch(socket, self._run)

    def run(self) -> None:
        """Have the stand-in answer what the robot said last."""
        if self._heard.newest is None:
            return
        self._robot.send(self._heard.newest)
        self._poller.wait(0.0)
        self._robot.receive()

    def close(self) -> None:
        """Give back its end of the stand-in's wire."""
        self._poller.close()
        self._robot.close()

    def _run(self) -> None:
        cycle = run_cycle(self._arm, self._manager, self._guard, self._clock.now(), self._stations)
        if cycle is not None:
            self._guard.settle(cycle.state)
            self._follow(cycle.state)

    def _follow(self, state: ArmState) -> None:
        if state.is_running and self._leading and not self._manager.is_commanding:
            self._manager.switch((self._leading,), (), state)
