"""One RAPID task with one arm, its EGM client and its gripper: what the tests of single instructions run on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import abb_protocols.controller_files
import virtual_irc5.controller
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import CYCLE, Joints, Side
from virtual_irc5.controller.signals import ControllerSignal, Signals
from virtual_irc5.controller.tasks import TaskHost
from virtual_irc5.controller_log import ControllerEventLog
from virtual_irc5.instructions.multimove import SyncPoints
from virtual_irc5.instructions.robot_library import robot_library
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.egm_client import EgmClient
from virtual_irc5.mechanics.units import YUMI_UNITS, ArmUnit
from virtual_irc5.mechanics.virtual_gripper import VirtualGripper, Workpiece
from virtual_irc5.rapid.states import Execution
from virtual_irc5.rapid.task import Task
from virtual_irc5.system_parameters import SystemConfiguration, SystemParameters

FOLDER = Path(next(iter(abb_protocols.controller_files.__path__)))
STOCK = Path(virtual_irc5.controller.__file__).parent / "stock"

MODULE = r"""MODULE Program
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
    VAR intnum interrupt;
    VAR triggdata event;
    VAR triggdata another;
    VAR triggdata events{{3}};
    VAR jointtarget start;
    VAR robtarget found;
    VAR pose one;
    VAR pose two;
    VAR pose three;
    VAR robtarget list_one{{4}};
    VAR robtarget list_two{{4}};
    PROC main()
        {body}
    ENDPROC
    PROC count()
        number:=number+1;
    ENDPROC
    TRAP note
        tip:=CRobT(\Tool:=tool0\WObj:=wobj0);
        number:=number+1;
    ENDTRAP
    TRAP step_aside
        StopMove;
        StorePath;
        found:=CRobT(\Tool:=tool0\WObj:=wobj0);
        MoveL Offs(found,0,30,0),v200,fine,tool0;
        MoveL found,v200,fine,tool0;
        RestoPath;
        StartMove;
        number:=number+1;
    ENDTRAP
ENDMODULE
"""


class InstructionBench:
    """Runs the body of a main procedure in virtual time."""

    def __init__(
        self,
        side: Side = Side.RIGHT,
        workpiece: Workpiece | None = None,
        sync_points: SyncPoints | None = None,
        signals: Sequence[ControllerSignal] = (),
        position: Joints | None = None,
    ) -> None:
        arm = VirtualArm(side, position)
        arm.switch_motors_on()
        self.unit = ArmUnit(
            arm, EgmClient(arm), VirtualGripper(workpiece, GripperModules.TWO_VACUUMS, is_calibrated=True)
        )
        paths = [*sorted(STOCK.glob("*.cfg")), *sorted(FOLDER.glob("*.cfg"))]
        self.configuration = SystemConfiguration(path.read_text(encoding="ascii") for path in paths)
        self.events = ControllerEventLog(lambda: 0.0)
        self.speed_ratio = 100
        self.signals = Signals(signals, self._signal_changed)
        self.host = TaskHost(self.signals, {}, self.events, is_virtual=False)
        self.host.devices.configuration = SystemParameters(self.configuration)
        library = robot_library(
            self.unit,
            configuration=self.configuration,
            events=self.events,
            speed_ratio=lambda: self.speed_ratio,
            units=YUMI_UNITS,
            sync_points=sync_points or SyncPoints(),
            is_motion_task=True,
            robots=(self.unit,),
            units_of_tasks={},
        )
        self.task = Task(side.task, self.host, library)
        self.inbox: list[bytes] = []
        self.sent: list[bytes] = []

    def _signal_changed(self, name: str, old: float, new: float) -> None:
        self.task.signal_changed(name, old, new)

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
        self.unit.observe()

    @property
    def failure(self) -> str:
        """Why the program stopped by itself; empty when it came to its end."""
        if not self.host.events:
            return ""
        event = self.host.events[-1]
        return f"{event.error}: {event.sentence}" if event.error else ""

    def read(self, symbol: str) -> str:
        return self.task.read("Program", symbol)
