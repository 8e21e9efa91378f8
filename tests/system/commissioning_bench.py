"""A virtual controller from the factory, in virtual time that costs nothing, for tests of commissioning."""

from __future__ import annotations

from pathlib import Path

import httpx

from abb_protocols.robot.joints import Side
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.transport import ConnectionLost
from memory_http import MemoryHttp
from virtual_irc5.controller.installed_system import factory_system
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.world import World, WorldSettings
from yumi.driver.commissioning.installation import Installation, InstallationPlan
from yumi.driver.commissioning.installation_record import InstallationRecord
from yumi.driver.launch_checks import EgmAddress

HERE = {Side.LEFT: EgmAddress("192.168.125.99", 6511), Side.RIGHT: EgmAddress("192.168.125.99", 6512)}
DOMAINS = ("EIO", "MOC", "SIO", "SYS")
USER_FILE = "HOME:/user.sys"


class Interruption(BaseException):
    """The process is killed."""


class Transport(MemoryHttp):
    """A transport that is cut, or whose process is killed, at one request that changes something.

    Attributes:
        changes: so many requests have changed something.
        cut_at: the number of the one at which the link is cut.
        is_carried_out: whether that request is carried out first.
        kill_at: the number of the one before which the process is killed.
        restart_at: the number of the one before which the controller restarts.
    """

    def __init__(self, controller: Irc5, clock: ManualClock) -> None:
        super().__init__(controller, clock)
        self.changes = 0
        self.cut_at = self.kill_at = self.restart_at = -1
        self.is_carried_out = False
        self._controller = controller

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        changes = request.method != "GET" and request.url.path != "/logout"
        if changes and "Cookie" in request.headers:
            self.changes += 1
            if self.changes == self.kill_at:
                raise Interruption
            if self.changes == self.restart_at:
                self._controller.restart()
                self._controller.advance(1.0)
            if self.changes >= self.cut_at > 0:
                if self.is_carried_out and self.changes == self.cut_at:
                    super().handle_request(request)
                raise ConnectionLost("The connection was reset.")
        return super().handle_request(request)


class Site(ManualClock):
    """A controller, and a computer that installs on it; the clock of both.

    Attributes:
        controller: from the factory, unless settings say otherwise.
        transport: of the client that is made next.
    """

    def __init__(self, folder: Path, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self.controller = World(settings or WorldSettings(system=factory_system())).controller
        self.controller.files[USER_FILE] = "MODULE user(SYSMODULE)\nENDMODULE\n"
        self.folder = folder
        self.steps: list[str] = []
        self.reconnect()

    def reconnect(self) -> None:
        """A new process with a new link."""
        self.transport = Transport(self.controller, self)
        self.client = RwsClient(self.transport, clock=self)

    def wait(self, seconds: float) -> None:
        """The controller alone goes on: it needs no cycles while RAPID stands."""
        self.advance(seconds)
        self.controller.advance(seconds)
        self.controller.supervise()
        self.transport.advance()

    def installation(self) -> Installation:
        return Installation(self.client, InstallationRecord.of("yumi", self.folder), self.steps.append)

    def plan(self, **options: bool) -> InstallationPlan:
        return self.installation().plan(self.client.connect(), HERE, **options)

    def install(self, **options: bool) -> None:
        self.installation().install(self.plan(**options))

    def home(self) -> dict[str, bytes | None]:
        """Every file and directory of HOME."""
        found: dict[str, bytes | None] = {}
        folders = ["HOME:"]
        while folders:
            for file in self.controller.files.entries(folders.pop()):
                found[file.path] = file.content
                if file.content is None:
                    folders.append(file.path)
        return found

    def cfg(self) -> dict[str, str]:
        """The cfg files the controller would save."""
        return {domain: self.controller.configuration.text(domain) for domain in DOMAINS}

    def modules(self) -> dict[str, list[str]]:
        """Names of the modules of each task."""
        return {name: sorted(module.name for module in task.modules) for name, task in self.controller.tasks.items()}
