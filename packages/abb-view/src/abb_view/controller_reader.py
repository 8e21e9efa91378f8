"""A controller as a page shows it: tasks, pointers and log lines, read over Robot Web Services, and never changed.

Any robot: a YuMi, a single arm, six axes, or one that abb_protocols has no description of. A page gets joint positions,
RAPID's tasks with their program pointers and the lines around these, and the newest lines of the event log. A
controller of virtual-irc5 also shows what programs write to the FlexPendant (TPWrite), which Robot Web Services do not
have.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import count
from math import radians

import msgspec

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, ProtocolError, YumiError
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.irb120 import irb120
from abb_protocols.robot.joints import CHAIN_AXES, Side
from abb_protocols.robot.yumi_arms import irb14050
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.operations.motion import JointTarget
from abb_protocols.rws.operations.rapid import TaskInfo
from abb_protocols.rws.request import BUSY_STATUS
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.faults import DISPLAY_PATH
from abb_runtime.rws.client import RwsClient

LINES_AROUND = 5
"""Lines of RAPID that are shown before and behind that of a program pointer."""

_ARMS: Mapping[str, Callable[[], KinematicArm]] = {"IRB 120": irb120, "IRB 14050": irb14050}
_TCP_ROBOT = "TCPRobot"
_LONGEST_LINE = 160  # characters of a line of RAPID or of the log
_NEW_EVENTS = 30  # of the event log that are read at once, at most
_CLOCK = re.compile(r"\d\d:\d\d:\d\d")


@dataclass(frozen=True, slots=True)
class _Periods:
    """Time between two requests of a kind [s]; several robots or tasks share it in turn.

    Attributes:
        joints: of the robots.
        pointers: where the program pointer of a task stands.
        tasks: which tasks there are and whether they run, and whether RAPID does, each.
        panel: operating mode, motors and speed ratio, each.
        log: the event log, and what programs write to the FlexPendant.
        changes: whether another program was loaded into a task.
    """

    joints: float
    pointers: float
    tasks: float
    panel: float
    log: float
    changes: float


_REAL = _Periods(joints=0.5, pointers=1.0, tasks=2.0, panel=5.0, log=2.5, changes=10.0)
"""Five requests a second, of the twenty that a controller permits to all of its clients."""

_VIRTUAL = _Periods(joints=0.033, pointers=0.1, tasks=0.25, panel=1.0, log=0.5, changes=1.0)


class PointerReport(msgspec.Struct, frozen=True):
    """Where a program pointer stands.

    Attributes:
        module: of the line.
        routine: of the line.
        line: from 1.
        first_line: number of the first one in ``text``.
        text: the lines around; empty where the controller does not show the module.
    """

    module: str
    routine: str
    line: int
    first_line: int = 1
    text: tuple[str, ...] = ()


class TaskReport(msgspec.Struct, frozen=True):
    """A RAPID task: its execution in a word, and its program pointer, None where there is none or it is not read."""

    name: str
    execution: str
    is_active: bool
    is_motion_task: bool
    pointer: PointerReport | None


class LogLine(msgspec.Struct, frozen=True):
    """A line of the event log, or one that a program wrote to the FlexPendant.

    Attributes:
        source: ``event log`` or ``TPWrite``.
        text: the line.
        level: ``information``, ``warning`` or ``error``.
        clock: the controller's time of day; empty where it is not known.
        task: that wrote it; empty in the event log.
        code: ABB's number of the event; 0 for TPWrite.
        detail: what the event log says further.
    """

    source: str
    text: str
    level: str = "information"
    clock: str = ""
    task: str = ""
    code: int = 0
    detail: str = ""


class LogMessage(msgspec.Struct, frozen=True, tag_field="type", tag="log"):
    """New lines, oldest first."""

    lines: tuple[LogLine, ...]


class ControllerKind(msgspec.Struct, frozen=True):
    """What does not change.

    Attributes:
        address: of the controller.
        robot: ABB's name, such as ``IRB 120``; empty where no option of the system names one.
        units: the mechanical units that are robots.
        is_drawn: whether abb_protocols has a description of the robot.
    """

    address: str
    robot: str
    units: tuple[str, ...]
    is_drawn: bool


class ControllerMessage(msgspec.Struct, frozen=True, tag_field="type", tag="controller"):
    """The controller now; what is not known is None.

    Attributes:
        time: on this machine's monotonic clock [s].
        operating_mode: AUTO, MANR or MANF.
        motors: motoron, motoroff, or the stop that keeps them off.
        program: whether RAPID runs: running or stopped.
        speed_ratio: override of the speeds of RAPID motions [%].
        arms: joint positions [rad] by the keys that the model has, in the order of the axes there.
        tasks: all.
        missing: in a sentence each, what is not shown and why.
    """

    time: float
    operating_mode: str | None
    motors: str | None
    program: str | None
    speed_ratio: int | None
    arms: dict[str, tuple[float, ...] | None]
    tasks: tuple[TaskReport, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ReaderUnit:
    """A mechanical unit that is a robot.

    Attributes:
        key: of the arm in messages: right and left for a YuMi's, else the unit.
        name: of the unit.
        axes: ABB's numbers, in the order of the positions.
        arm: its description; None where there is none. A YuMi's arms have the URDF.
    """

    key: str
    name: str
    axes: tuple[int, ...]
    arm: KinematicArm | None


class _Reading:
    """What is read again and again: the next time it is due, and its period [s]."""

    def __init__(self, name: str, period: float, read: Callable[[], None]) -> None:
        self.name, self.period, self.read = name, period, read
        self.due = 0.0


class ControllerReader:
    """Reads a controller one request after another, each kind as often as its period says; all requests are GETs.

    Args:
        client: connected.
        clock: that the periods pass by.

    Attributes:
        address: of the controller.
        robot: ABB's name of the robot, such as ``IRB 120``; empty where no option of the system names one.
        is_virtual: whether it is a controller of virtual-irc5.
        units: the robots.
        why_view_only: why a page can only look at it; None where there is nothing to say of that.
        on_log: called with new lines, oldest first.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self.address = client.address
        self._logins = client.login_count
        self.on_log: Callable[[tuple[LogLine, ...]], None] = lambda lines: None
        self.robot = client.system().robot
        self.why_view_only: Message | None = None
        self._client, self._clock = client, clock
        self.is_virtual = self._has_display()
        self.units = tuple(self._units())
        self._arms: dict[str, tuple[float, ...] | None] = {unit.key: None for unit in self.units}
        self._motors: ControllerState | None = None
        self._mode: OperatingMode | None = None
        self._speed_ratio: int | None = None
        self._program: ExecutionState | None = None
        self._tasks: tuple[TaskInfo, ...] = ()
        self._pointers: dict[str, PointerReport] = {}
        self._texts: dict[tuple[str, str], tuple[str, ...]] = {}
        self._changes: dict[str, int] = {}
        self._refused: dict[str, Message] = {}
        self._last_event = 0
        self._last_lines: dict[str, int] = {}
        self._turns = {kind: count() for kind in ("pointers", "changes")}
        periods = _VIRTUAL if self.is_virtual else _REAL
        self._readings = [
            *(
                _Reading(
                    f"the joints of {unit.name}", periods.joints * len(self.units), partial(self._read_joints, unit)
                )
                for unit in self.units
            ),
            _Reading("the RAPID tasks", periods.tasks, self._read_tasks),
            _Reading("the execution of RAPID", periods.tasks, self._read_execution),
            _Reading("the program pointers", periods.pointers, self._read_pointer),
            _Reading("the motors", periods.panel, self._read_motors),
            _Reading("the operating mode", periods.panel, self._read_mode),
            _Reading("the speed ratio", periods.panel, self._read_speed_ratio),
            _Reading("the event log", periods.log, self._read_events),
            _Reading("changes of the program", periods.changes, self._read_changes),
        ]
        if self.is_virtual:
            self._readings.append(_Reading("the FlexPendant", periods.log, self._read_display))

    @property
    def kind(self) -> ControllerKind:
        """What does not change."""
        is_drawn = self.is_yumi or (len(self.units) == 1 and self.units[0].arm is not None)
        return ControllerKind(self.address, self.robot, tuple(unit.name for unit in self.units), is_drawn)

    @property
    def is_yumi(self) -> bool:
        """Whether it has the two arms of a YuMi."""
        return {unit.key for unit in self.units} == {side.word for side in Side}

    @property
    def is_of_session(self) -> bool:
        """Whether the session goes on in which the robot was read; without it, another controller may answer."""
        return self._client.login_count == self._logins

    def step(self) -> float:
        """Read what is due next, if anything is due; how soon something is due again [s].

        What the controller refuses is missing, and asked for again at its next turn.

        Raises:
            YumiError: the controller does not answer, or is starting.
        """
        now = self._clock.now()
        reading = min(self._readings, key=lambda each: each.due)
        if reading.due <= now:
            reading.due = max(reading.due + reading.period, now)
            try:
                reading.read()
                self._refused.pop(reading.name, None)
            except (ControllerRefused, ProtocolError) as error:
                if isinstance(error, ControllerRefused) and error.status == BUSY_STATUS:
                    raise
                self._refused[reading.name] = error.said
        return max(0.0, min(each.due for each in self._readings) - self._clock.now())

    def message(self) -> ControllerMessage:
        """What is known now."""
        return ControllerMessage(
            time=time.monotonic(),
            operating_mode=self._mode and self._mode.value,
            motors=self._motors and self._motors.value,
            program=self._program and self._program.value,
            speed_ratio=self._speed_ratio,
            arms=dict(self._arms),
            tasks=tuple(
                TaskReport(
                    each.name,
                    each.execution.name.lower(),
                    each.is_active,
                    each.is_motion_task,
                    self._pointers.get(each.name),
                )
                for each in self._tasks
            ),
            missing=tuple(str(each) for each in self._missing()),
        )

    def forget(self) -> None:
        """Nothing that was read is known any more: the controller does not answer."""
        self._arms = dict.fromkeys(self._arms)
        self._motors = self._mode = self._speed_ratio = self._program = None
        self._tasks, self._pointers, self._texts = (), {}, {}

    def close(self) -> None:
        """End the session."""
        self._client.close()

    # What is read

    def _missing(self) -> Iterator[Message]:
        if self.why_view_only is not None:
            yield self.why_view_only
        if not self.kind.is_drawn:
            yield message("no_description_of_robot")
        for name, why in self._refused.items():
            yield message("controller_does_not_show", what=name, why=why)

    def _has_display(self) -> bool:
        try:
            self._client.call("GET", DISPLAY_PATH)
        except (ControllerRefused, ProtocolError):
            return False
        return True

    def _units(self) -> Iterator[ReaderUnit]:
        sides = {side.unit: side.word for side in Side}
        for name in self._client.mechanical_units():
            unit = self._client.mechanical_unit(name)
            if unit.type != _TCP_ROBOT:
                continue
            axes: tuple[int, ...] = (*range(1, unit.axes + 1), *((7,) if unit.total_axes > unit.axes else ()))
            if name in sides:
                axes = CHAIN_AXES
            make = _ARMS.get(self.robot)
            arm = make() if make is not None and len(axes) == make().joint_count else None
            yield ReaderUnit(sides.get(name, name), name, axes if arm is None else arm.axes, arm)

    def _turn(self, kind: str, among: int) -> int:
        return next(self._turns[kind]) % among

    def _read_joints(self, unit: ReaderUnit) -> None:
        try:
            self._arms[unit.key] = _positions(self._client.axis_positions(unit.name), unit.axes)
        except YumiError:
            self._arms[unit.key] = None
            raise

    def _read_tasks(self) -> None:
        self._tasks = self._client.tasks()

    def _read_execution(self) -> None:
        self._program = self._client.execution()

    def _read_pointer(self) -> None:
        tasks = [each.name for each in self._tasks if each.is_motion_task or each.starts_by_hand]
        if not tasks:
            return
        task = tasks[self._turn("pointers", len(tasks))]
        try:
            pointer, _ = self._client.pointers(task)
        except ControllerRefused as error:
            if error.status == BUSY_STATUS:
                raise
            pointer = None  # a task without a program
        if pointer is None or pointer.range is None:
            self._pointers.pop(task, None)
            return
        line = pointer.range.row
        lines = self._text(task, pointer.module)
        first = max(1, line - LINES_AROUND)
        shown = tuple(each[:_LONGEST_LINE] for each in lines[first - 1 : line + LINES_AROUND])
        self._pointers[task] = PointerReport(pointer.module, pointer.routine, line, first, shown)

    def _text(self, task: str, module: str) -> tuple[str, ...]:
        """The lines of a module; none where the controller does not show them, such as of an encoded one."""
        key = task, module.lower()
        if key not in self._texts:
            try:
                self._texts[key] = tuple(self._client.module_text(task, module).splitlines())
            except (ControllerRefused, ProtocolError):
                self._texts[key] = ()
        return self._texts[key]

    def _read_changes(self) -> None:
        """Modules of a task that was changed are read anew."""
        tasks = sorted({task for task, _ in self._texts})
        if not tasks:
            return
        task = tasks[self._turn("changes", len(tasks))]
        changes = self._client.task_change_count(task)
        if self._changes.setdefault(task, changes) != changes:
            self._changes[task] = changes
            self._texts = {key: lines for key, lines in self._texts.items() if key[0] != task}

    def _read_motors(self) -> None:
        self._motors = self._client.controller_state()

    def _read_mode(self) -> None:
        self._mode = self._client.operating_mode()

    def _read_speed_ratio(self) -> None:
        self._speed_ratio = self._client.speed_ratio()

    def _read_events(self) -> None:
        newest = self._client.events(count=1)
        number = newest[0].number if newest else 0
        if number < self._last_event:  # the log was cleared, or the controller is another one
            self._last_event = 0
        if number > self._last_event:
            missed = min(number - self._last_event, _NEW_EVENTS)
            found = newest if missed == 1 else self._client.events(count=missed)
            new = [event for event in reversed(found) if event.number > self._last_event]
            self._last_event = number
            self._append([_line_of(event) for event in new])

    def _read_display(self) -> None:
        shown = [
            (state.text("task"), state.whole("number"), state.text("text")[:_LONGEST_LINE])
            for state in self._client.entries(DISPLAY_PATH)
        ]
        newest = {task: number for task, number, _ in shown}  # they come in their order
        # Fewer lines than before are those of a controller that was started anew.
        known = {task: last for task, last in self._last_lines.items() if last <= newest.get(task, 0)}
        self._last_lines = newest
        self._append(
            [LogLine("TPWrite", text, task=task) for task, number, text in shown if number > known.get(task, 0)]
        )

    def _append(self, lines: list[LogLine]) -> None:
        if lines:
            self.on_log(tuple(lines))


def _positions(target: JointTarget, axes: tuple[int, ...]) -> tuple[float, ...]:
    """Joint positions [rad] in the order of ``axes``; raises ProtocolError where an axis is not there."""
    values = dict(enumerate((*target.robax_deg, target.extax_deg[0]), 1))
    found = [values[axis] for axis in axes]
    if any(value is None for value in found):
        raise ProtocolError(message("no_seventh_axis"))
    return tuple(radians(value) for value in found if value is not None)


def _line_of(event: RwsEvent) -> LogLine:
    clock = _CLOCK.search(event.time)
    return LogLine(
        "event log",
        event.title[:_LONGEST_LINE],
        level=event.type.name.lower(),
        clock=clock[0] if clock else "",
        code=event.code,
        detail=event.description,
    )


def open_reader(client: RwsClient) -> ControllerReader:
    """A reader of a controller, to be closed; ``client`` is connected to it, and belongs to the reader from now on."""
    try:
        reader = ControllerReader(client, SystemClock())
    except YumiError:
        client.close()
        raise
    if reader.is_virtual:  # it bears more than the twenty requests a second of a real one
        client.lift_rate_limit()
    return reader
