"""One RAPID task with one arm, its EGM client and its gripper: what the tests of single instructions run on."""

from __future__ import annotations

from pathlib import Path

import yumi.controller_files
from yumi.rapid.program import Execution
from yumi.rapid.task import Task
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import CYCLE, Side
from yumi.virtual.controller.controller import robot_library
from yumi.virtual.controller.egm import EgmClient
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.signals import Configuration, Signals
from yumi.virtual.controller.tasks import TaskHost
from yumi.virtual.controller.units import YUMI_UNITS, ArmUnit, SyncPoints
from yumi.virtual.mechanics.arm import VirtualArm
from yumi.virtual.mechanics.gripper import VirtualGripper, Workpiece

FOLDER = Path(next(iter(yumi.controller_files.__path__)))
STOCK = FOLDER.parent / "virtual" / "controller" / "stock"

MODULE = """MODULE Program
    TASK PERS tooldata my_tool:=[TRUE,[[0,0,100],[1,0,0,0]],[0.2,[0,0,50],[1,0,0,0],0,0,0]];
    PERS tasks both{{2}}:=[["T_ROB_R"],["T_ROB_L"]];
    VAR egmident egm;
    VAR egmident other{others};
    VAR syncident meeting;
    VAR jointtarget target;
    VAR robtarget point;
    VAR robtarget tip;
    VAR wobjdata my_wobj;
    VAR string text;
    VAR num number;
    VAR bool flag;
    PROC main()
        {body}
    ENDPROC
ENDMODULE
"""


class InstructionBench:
    """Runs the body of a main procedure in virtual time."""

    def __init__(
        self, side: Side = Side.RIGHT, workpiece: Workpiece | None = None, sync_points: SyncPoints | None = None
    ) -> None:
        arm = VirtualArm(side)
        arm.switch_motors_on()
        self.unit = ArmUnit(
            arm, EgmClient(arm), VirtualGripper(workpiece, GripperModules.TWO_VACUUMS, is_calibrated=True)
        )
        paths = [*sorted(STOCK.glob("*.cfg")), *sorted(FOLDER.glob("*.cfg"))]
        self.configuration = Configuration(path.read_text(encoding="ascii") for path in paths)
        self.events = EventLog(lambda: 0.0)
        self.speed_ratio = 100
        self.host = TaskHost(Signals([], lambda *_: None), {}, self.events, is_virtual=False)
        library = robot_library(
            self.unit,
            configuration=self.configuration,
            events=self.events,
            speed_ratio=lambda: self.speed_ratio,
            units=YUMI_UNITS,
            sync_points=sync_points or SyncPoints(),
        )
        self.task = Task(side.task, self.host, library)
        self.inbox: list[bytes] = []
        self.sent: list[bytes] = []

    def start(self, body: str, others: str = "") -> None:
        self.task.lose_pp()
        self.task.load(MODULE.format(body=body, others=others), "program.mod", replace=True)
        self.task.move_pp_to_main()
        self.task.start()

    def run(self, body: str, limit: float = 30.0) -> float:
        """Run to the end; returns how long it took [s]."""
        self.start(body)
        return self.finish(limit)

    def finish(self, limit: float = 30.0) -> float:
        begin = self.task.now
        while self.task.execution is Execution.STARTED and self.task.now - begin < limit:
            self.step()
        assert self.task.execution is not Execution.STARTED, f"still running after {limit} s"
        return self.task.now - begin

    def step(self) -> None:
        self.task.advance(CYCLE)
        datagram = self.unit.egm.cycle(self.inbox)
        self.inbox = []
        if datagram is not None:
            self.sent.append(datagram)
        self.unit.gripper.advance(CYCLE)
        self.unit.arm.advance(CYCLE)

    @property
    def failure(self) -> str:
        """Why the program stopped by itself; empty when it came to its end."""
        if not self.host.events:
            return ""
        event = self.host.events[-1]
        return f"{event.error}: {event.sentence}" if event.error else ""

    def read(self, symbol: str) -> str:
        return self.task.read("Program", symbol)
