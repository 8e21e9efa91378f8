"""A controller of plain values behind a real RWS server on loopback, for tests of either end of the wire."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import virtual_irc5.controller
from abb_protocols.rws.values import CollisionState, ControllerState, OperatingMode, SignalType
from abb_runtime.clock import ManualClock
from virtual_irc5.controller.file_store import FileStore
from virtual_irc5.controller.identity import Identity, OwnSettings
from virtual_irc5.controller.jobs import Jobs
from virtual_irc5.controller.signals import ControllerSignal, Signals
from virtual_irc5.controller.task_settings import TaskSettings
from virtual_irc5.controller.tasks import InstalledTask
from virtual_irc5.controller_log import ControllerEventLog, RefusalReason, Refused
from virtual_irc5.http_server import HttpServer
from virtual_irc5.mechanics.units import YUMI_UNITS, UnitsState
from virtual_irc5.rapid.ast import Module
from virtual_irc5.rapid.devices import FlexPendant, MessageQueues
from virtual_irc5.rapid.pauses import StepKind
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import Execution
from virtual_irc5.rapid.types import RapidValueError, UnknownSymbol
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import Upgrade
from virtual_irc5.system_parameters import SystemConfiguration

USER, PASSWORD = "Default User", "robotics"
CFG = Path(virtual_irc5.controller.__file__).parent / "stock"
MIDNIGHT = 1_783_555_200.0  # 2026-07-09 00:00:00 UTC

Symbol = tuple[str, str, str]


class PlainTask:
    """A RAPID task that is a dictionary; a num takes numbers only."""

    entry = "main"
    call_stack = ()
    is_empty = False
    library = Library()
    program = None

    def __init__(self, name: str) -> None:
        self.name = name
        self.execution = Execution.READY
        attributes = {"TRobMain": frozenset[str](), "TRobSystem": frozenset(("SYSMODULE",))}
        self.modules = tuple(Module(name, of_it, (), (), (), ()) for name, of_it in attributes.items())
        self.symbols: dict[tuple[str, str], Symbol] = {
            ("TRobMain", "current_state"): ("num", "var", "0"),
            ("TRobMain", "STATE_IDLE"): ("num", "con", "0"),
            ("TRobMain", "points"): ("pos", "var", "[[0,0,0],[0,0,0],[0,0,0]]"),
            ("TRobSystem", "routine_name_input"): ("string", "per", '""'),
        }

    def _symbol(self, module: str, name: str) -> Symbol:
        if (module, name) not in self.symbols:
            raise UnknownSymbol(f"{module} has no {name}.")
        return self.symbols[module, name]

    def read(self, module: str, name: str) -> str:
        return self._symbol(module, name)[2]

    def type_of(self, module: str, name: str) -> str:
        return self._symbol(module, name)[0]

    def kind_of(self, module: str, name: str) -> str:
        return self._symbol(module, name)[1]

    def dimensions_of(self, module: str, name: str) -> tuple[int, ...]:
        return (3,) if self.read(module, name).startswith("[") else ()

    def write(self, module: str, name: str, literal: str) -> None:
        type_name, kind, _ = self._symbol(module, name)
        if type_name == "num" and literal.startswith('"'):
            raise RapidValueError(f"{literal} is not a num.")
        self.symbols[module, name] = (type_name, kind, literal)


class PlainExecution:
    """Tasks that are all selected."""

    def __init__(self, tasks: Mapping[str, PlainTask]) -> None:
        settings = {name: TaskSettings(name, is_motion_task=True) for name in tasks}
        self.installed = {name: InstalledTask(task, settings[name], None) for name, task in tasks.items()}

    def select(self, task: str, *, is_active: bool) -> None:
        self.installed[task].is_active = is_active

    def unload_module(self, task: str, name: str) -> None:
        raise Refused(RefusalReason.NO_MODULE, f"The task {task} has no module '{name}'.")


class PlainController:
    """A controller whose state is set by the test; it refuses what a real one refuses in that state."""

    def __init__(self) -> None:
        self.clock = ManualClock(MIDNIGHT)
        self.identity = Identity()
        self.mode = OperatingMode.AUTO
        self.controller_state = ControllerState.MOTORS_OFF
        self.is_running = False
        self.cycle = "forever"
        self.speed_ratio = 100
        self.tasks = {name: PlainTask(name) for name in ("T_ROB_R", "T_ROB_L")}
        self.execution = PlainExecution(self.tasks)
        self.effective = SystemConfiguration()
        self.devices = SimpleNamespace(pendant=FlexPendant(), queues=MessageQueues())
        self.jobs = Jobs()
        self.own_settings = OwnSettings()
        self.motion = UnitsState()
        self.started_at = self.energy_reset_at = MIDNIGHT
        self.edges: list[tuple[str, float, float]] = []
        self.signals = Signals(_signals(), lambda *edge: self.edges.append(edge))
        self.events = ControllerEventLog(self.clock.now)
        self.units = YUMI_UNITS
        self.configuration = SystemConfiguration(path.read_text() for path in sorted(CFG.glob("*.cfg")))
        self.pp_at_main = 0
        self.requests: list[HttpRequest] = []
        self.settled = 0
        self.collision_state = CollisionState.INIT
        self.files = FileStore({"HOME:/user.sys": "MODULE user(SYSMODULE)\nENDMODULE\n"}, self.clock.now)
        self.is_restarting = False
        self.restarts = 0
        self.loaded: list[tuple[str, str, bool]] = []

    @property
    def time(self) -> float:
        return self.clock.now()

    def set_motors(self, on: bool) -> None:
        if self.mode is not OperatingMode.AUTO:
            raise Refused(RefusalReason.WRONG_MODE, "motors are switched by hand in manual mode.")
        if self.controller_state is ControllerState.EMERGENCY_STOP:
            raise Refused(RefusalReason.EMERGENCY_STOP, "the emergency stop is pressed.")
        self.controller_state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF

    def program_changes(self, task: str) -> int:
        return 0

    def start_rapid(self, cycle: str = "", step: StepKind | None = None, *, stop_at_breakpoints: bool = False) -> None:
        if self.controller_state is not ControllerState.MOTORS_ON:
            raise Refused(RefusalReason.MOTORS_OFF, "the motors are off.")
        self.is_running = True

    def stop_rapid(self) -> None:
        self.is_running = False

    def move_pp_to_main(self) -> None:
        if self.is_running:
            raise Refused(RefusalReason.NOT_STOPPED, "RAPID is running.")
        self.pp_at_main += 1

    def set_speed_ratio(self, percent: int) -> None:
        if not 0 <= percent <= 100:
            raise Refused(RefusalReason.OUT_OF_RANGE, f"the speed ratio is 0 to 100, not {percent}.")
        self.speed_ratio = percent

    def load_module(self, task: str, path: str, *, replace: bool) -> None:
        self.files.get_file(path)
        self.loaded.append((task, path, replace))

    def acknowledge_collision(self) -> None:
        self.collision_state = CollisionState.INIT

    def restart(
        self, duration: float = 0.0, *, discards_programs: bool = False, discards_settings: bool = False
    ) -> None:
        self.restarts += 1

    def joint_target(self, unit: str) -> tuple[Sequence[float], Sequence[float]]:
        return (0.0, -130.0, 30.0, 0.0, 40.0, 0.123456), (-135.0, 9e9, 9e9, 9e9, 9e9, 9e9)

    def settle(self) -> None:
        self.settled += 1


def _signals() -> list[ControllerSignal]:
    return [
        ControllerSignal("EGM_START_JOINT", SignalType.DIGITAL_INPUT, "", "All", 0.0, ""),
        ControllerSignal("OUTPUT_STATIONARY_ROB_R", SignalType.DIGITAL_OUTPUT, "", "ReadOnly", 1.0, ""),
        ControllerSignal("hand_MaxSpeed_R", SignalType.GROUP_OUTPUT, "HandRight", "All", 200.0, "Hand_R", "EtherNetIP"),
        ControllerSignal(
            "hand_ActualPosition_R", SignalType.GROUP_INPUT, "HandRight", "All", 250.0, "Hand_R", "EtherNetIP"
        ),
    ]


@contextmanager
def serving(controller: PlainController, port: int = 0) -> Iterator[str]:
    """The controller on loopback; its address. Time stands where the controller's clock stands."""
    adapter = RwsService(controller, user=USER, password=PASSWORD)

    def handle(request: HttpRequest) -> HttpReply | Upgrade | None:
        controller.requests.append(request)
        return adapter.handle(request, controller.clock.now())

    with HttpServer(handle, port) as server:
        yield server.address
