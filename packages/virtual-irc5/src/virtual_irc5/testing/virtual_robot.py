"""A virtual robot in memory and in virtual time, for tests of RAPID programs, RWS clients and control loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import memory_links
from virtual_irc5.controller.installed_system import ROBOTS, delivered_system, with_programs
from virtual_irc5.fault_injection import FaultInjection
from virtual_irc5.testing.memory_rws import MemoryRws
from virtual_irc5.world import World, WorldSettings


def virtual_robot_settings(
    model: str = "yumi",
    programs: Mapping[str, Sequence[Path]] | None = None,
    cfg: Sequence[Path] = (),
    settings: WorldSettings | None = None,
) -> WorldSettings:
    """What a robot with programs of a user is like.

    Args:
        model: the robot, a name of ``virtual-irc5 run --model``.
        programs: RAPID modules (.mod, .sys) or programs (.pgf) by task, which take the place of what the task has.
        cfg: files of system parameters that are added.
        settings: what else the robot is like.

    Raises:
        SettingsError: a file cannot be read or is not what it should be, or there is no such task.
    """
    system = with_programs(delivered_system(ROBOTS[model]), programs or {}, cfg)
    return replace(settings or WorldSettings(), system=system)


class VirtualRobot(ManualClock):
    """A virtual robot with a clock of its own: time passes when a test waits, as fast as it can be computed.

    Attributes:
        world: the robot: its controller, arms, grippers and EGM clients.
        rws: its Robot Web Services, the transport of an ``RwsClient``; ``handle_request`` answers requests of httpx.
        egm: per arm what takes the place of the sensor's UDP socket: ``receive()`` and ``send(datagram)``.
        faults: injects faults into it.
        written: the lines that its programs have written to the FlexPendant, each with the task.

    Args:
        settings: what the robot is like; a stock YuMi when left out.
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self.world = World(settings)
        links = {side: memory_links() for side in self.world.arms}
        self.egm = {side: sensor for side, (sensor, _) in links.items()}
        self._robot_ends = {side: robot for side, (_, robot) in links.items()}
        self.rws = MemoryRws(self.world.controller, self)
        self.faults = FaultInjection(self.world, self.rws.adapter)
        self.written: list[tuple[str, str]] = []
        for installed in self.world.controller.execution.installed.values():
            installed.host.show = lambda task, line: self.written.append((task, line))

    @property
    def is_running(self) -> bool:
        """Whether RAPID runs."""
        return self.world.controller.execution.is_running

    def wait(self, seconds: float) -> None:
        """Let the robot go on for ``seconds``, in whole cycles, at least one."""
        for _ in range(max(1, round(seconds / self.world.cycle_time))):
            with self.rws.lock:
                self.advance(self.world.cycle_time)
                inboxes = {side: end.receive() for side, end in self._robot_ends.items()}
                for side, datagram, is_foreign in self.world.exchange(inboxes):
                    if not is_foreign:  # memory has one sender only
                        self._robot_ends[side].send(datagram)
                self.rws.advance()

    def client(self) -> RwsClient:
        """A client of its Robot Web Services, to be used in a ``with`` block."""
        return RwsClient(self.rws, clock=self)

    def start_rapid(self, *, once: bool = False) -> None:
        """Switch the motors on and start the programs from their program pointers.

        Args:
            once: whether the programs end with main, instead of beginning it again.

        Raises:
            Refused: the controller does not start them; the message says why.
        """
        self.world.controller.set_motors(True)
        self.world.controller.start_rapid("once" if once else "")
