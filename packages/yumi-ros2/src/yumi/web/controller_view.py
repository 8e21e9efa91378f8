"""A controller without a driver for the pages of ``yumi view``: read over Robot Web Services, and never changed.

Any robot: a YuMi without the state machine of this package, a single arm, six axes, or one that this package has no
description of. A page gets joint positions, RAPID's tasks with their program pointers and the lines around these, and
the newest lines of the event log. A virtual controller of this package also shows what programs write to the
FlexPendant (TPWrite), which Robot Web Services do not have.
"""

from __future__ import annotations

import asyncio
import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from math import atan2, hypot, radians
from typing import Any

import msgspec
import numpy as np

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, ProtocolError, RobotNotReady, YumiError
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.irb120 import irb120
from abb_protocols.robot.joints import CHAIN_AXES, Side
from abb_protocols.robot.kinematics import matrix
from abb_protocols.robot.yumi_arms import irb14050
from abb_protocols.rws.documents import JointTarget, RwsEvent
from abb_protocols.rws.operations.rapid import TaskInfo
from abb_protocols.rws.request import BUSY
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.faults import DISPLAY_PATH
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.transport import HttpTransport
from yumi.driver.launch_checks import LaunchChecks, other_robot
from yumi.driver.reports import EventReport
from yumi.driver.settings import RobotSettings
from yumi.driver.surroundings import Surroundings
from yumi.web.page_words import said_of

LINES = 200
"""So many lines of the log are kept for a page that is opened later."""

AROUND = 5
"""Lines of RAPID that are shown before and behind that of a program pointer."""

_ARMS: Mapping[str, Callable[[], KinematicArm]] = {"IRB 120": irb120, "IRB 14050": irb14050}
_TCP_ROBOT = "TCPRobot"
_LONGEST_LINE = 160  # characters of a line of RAPID or of the log
_NEW_EVENTS = 30  # of the event log that are read at once, at most
_CLOCK = re.compile(r"\d\d:\d\d:\d\d")
_RECONNECT = 1.0  # [s]


@dataclass(frozen=True, slots=True)
class Periods:
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


REAL = Periods(joints=0.5, pointers=1.0, tasks=2.0, panel=5.0, log=2.5, changes=10.0)
"""Five requests a second, of the twenty that a controller permits to all of its clients."""

VIRTUAL = Periods(joints=0.033, pointers=0.1, tasks=0.25, panel=1.0, log=0.5, changes=1.0)


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
        is_drawn: whether this package has a description of the robot.
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
class Unit:
    """A mechanical unit that is a robot.

    Attributes:
        key: of the arm in messages: right and left for a YuMi's, else the unit.
        name: of the unit.
        axes: ABB's numbers, in the order of the positions.
        arm: its description; None where this package has none. A YuMi's arms have the URDF.
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
        why_view_only: why no driver runs for it.

    Attributes:
        address: of the controller.
        robot: ABB's name of the robot, such as ``IRB 120``; empty where no option of the system names one.
        is_virtual: whether it is a virtual controller of this package.
        units: the robots.
        on_log: called with new lines, oldest first.
    """

    def __init__(self, client: RwsClient, clock: Clock, why_view_only: Message) -> None:
        self.address = client.address
        self.on_log: Callable[[tuple[LogLine, ...]], None] = lambda lines: None
        self.robot = client.system().robot
        self._client, self._clock, self._why = client, clock, why_view_only
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
        periods = VIRTUAL if self.is_virtual else REAL
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
                if isinstance(error, ControllerRefused) and error.status == BUSY:
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
        if self.is_yumi:
            yield self._why
        else:
            what = other_robot(self.robot, self.kind.units)
            yield message("no_driver_for_robot", robot=what)
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

    def _units(self) -> Iterator[Unit]:
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
            yield Unit(sides.get(name, name), name, axes if arm is None else arm.axes, arm)

    def _turn(self, kind: str, among: int) -> int:
        return next(self._turns[kind]) % among

    def _read_joints(self, unit: Unit) -> None:
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
            if error.status == BUSY:
                raise
            pointer = None  # a task without a program
        if pointer is None or pointer.range is None:
            self._pointers.pop(task, None)
            return
        line = pointer.range.row
        lines = self._text(task, pointer.module)
        first = max(1, line - AROUND)
        shown = tuple(each[:_LONGEST_LINE] for each in lines[first - 1 : line + AROUND])
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


def open_controller(robot: RobotSettings) -> ControllerReader | None:
    """A reader of the controller, where no driver of this package can run for it; None where one can.

    The reader is to be closed.

    Args:
        robot: where the controller is, and who logs in.

    Raises:
        YumiError: nothing answers there, or it is not a controller of RobotWare 6, or it does not let us in.
    """
    clock = SystemClock()
    address = f"{robot.address}:{robot.rws_port}"

    def client_of(where: str | HttpTransport) -> RwsClient:
        client = RwsClient(where, user=robot.user, password=robot.password, timeout=robot.timeout, clock=clock)
        client.connect()
        return client

    client = client_of(address)
    try:
        why = _why_no_driver(client)
        reader = None if why is None else ControllerReader(client, clock, why)
    except YumiError:
        client.close()
        raise
    if reader is not None and not reader.is_virtual:
        return reader
    client.close()
    if reader is None or why is None:
        return None
    # A virtual controller bears more than the twenty requests a second of a real one.
    return ControllerReader(client_of(HttpTransport(address, clock, request_interval=0.0)), clock, why)


def _why_no_driver(client: RwsClient) -> Message | None:
    """Why no driver of this package can run for a controller; None where one can."""
    try:
        LaunchChecks(client).run()
    except RobotNotReady as error:
        return error.said
    return None


class ControllerView:
    """A controller for the pages, read while one is open; has what :class:`yumi.web.live.LiveRobot` has for them.

    Args:
        reader: of the controller.
        on_state: called with each :class:`ControllerMessage`, as JSON.
        on_log: called with new lines of the log.
        on_change: called when the controller does not answer any more, or answers again.

    Attributes:
        why_not: why there is no state; None while there is one.
        is_virtual: whether it is a virtual controller of this package.
        lines: the newest ones of the log, oldest first.
        reader: of the controller.
    """

    def __init__(
        self,
        reader: ControllerReader,
        on_state: Callable[[bytes], None],
        on_log: Callable[[LogMessage], None],
        on_change: Callable[[], None],
    ) -> None:
        self.why_not: Message | None = None
        self.is_virtual = reader.is_virtual
        self.events: deque[EventReport] = deque()
        self.surroundings = Surroundings()
        self.lines: deque[LogLine] = deque(maxlen=LINES)
        self.reader = reader
        self._on_state, self._on_log, self._on_change = on_state, on_log, on_change
        self._watched = asyncio.Event()
        self._new_lines: list[LogLine] = []
        reader.on_log = self._new_lines.extend  # on the reader's thread

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        if is_watched:
            self._watched.set()
        else:
            self._watched.clear()

    async def run(self) -> None:
        """Read the controller while a page is open, until cancelled."""
        reading: asyncio.Future[float] | None = None  # nothing is read any more when this has ended
        try:
            while True:
                await self._watched.wait()
                reading = asyncio.ensure_future(asyncio.to_thread(self.reader.step))
                try:
                    delay = await asyncio.shield(reading)
                except Exception as error:  # a fault of ours, too, which the log shows whole
                    self.reader.forget()
                    self._set_why_not(said_of(error))
                    await asyncio.sleep(_RECONNECT)
                    continue
                self._set_why_not(None)
                if self._new_lines:
                    lines = tuple(self._new_lines)
                    self._new_lines.clear()
                    self.lines.extend(lines)
                    self._on_log(LogMessage(lines))
                self._on_state(msgspec.json.encode(self.reader.message()))
                await asyncio.sleep(delay)
        finally:
            if reading is not None:
                await asyncio.wait([reading])

    def _set_why_not(self, why_not: Message | None) -> None:
        if why_not != self.why_not:
            self.why_not = why_not
            self._on_change()


# ---- what a page draws of a robot that has no meshes here

_COLOR = [0.86, 0.87, 0.88]
_JOINT_COLOR = [0.45, 0.48, 0.52]
_THICKEST, _THINNEST = 0.055, 0.028  # [m] radius of the first and the last link
_SHORTEST = 1e-6  # [m]
_FOOT = {
    "shape": "cylinder",
    "mesh": "",
    "radius": [0.09],
    "length": [0.02],
    "xyz": [0.0, 0.0, 0.01],
    "rpy": [0.0, 0.0, 0.0],
    "color": _JOINT_COLOR,
}


def chain_model(units: Sequence[Unit]) -> dict[str, Any]:
    """The part of the page's model that says how robots are drawn: capsules from axis to axis of a description.

    Args:
        units: one with its description; or any without, of which nothing is drawn.
    """
    arm = units[0].arm if units else None
    if arm is None:
        return {
            "links": {"base_link": []},
            "joints": [],
            "arms": {unit.key: _arm_model(unit, [], "base_link") for unit in units},
            "limits": {"lower": [], "upper": [], "velocity": []},
        }
    unit = units[0]
    names = [f"{unit.name}_{axis}" for axis in arm.axes]
    links: dict[str, list[dict[str, Any]]] = {"base_link": [_FOOT], **{name: [] for name in names}, "tool0": []}
    joints = []
    for index, (name, after) in enumerate(zip([*names, "tool0"], [*names[1:], "tool0", ""], strict=True)):
        share = index / len(names)
        radius = _THICKEST + share * (_THINNEST - _THICKEST)
        is_tool = name == "tool0"
        axis = [0.0, 0.0, 0.0] if is_tool else [float(about == arm.turns_about[index]) for about in range(3)]
        joints.append(
            {
                "name": name,
                "type": "fixed" if is_tool else "revolute",
                "parent": "base_link" if index == 0 else names[index - 1],
                "child": name,
                "axis": axis,
                "mimic": None,
                # tool0 has its z axis along the foot's x in the all-zero pose.
                "xyz": arm.offsets[index].tolist(),
                "rpy": [0.0, radians(90.0), 0.0] if is_tool else [0.0, 0.0, 0.0],
            }
        )
        parent = "base_link" if index == 0 else names[index - 1]
        links[parent] += _capsule(arm.offsets[index].tolist(), radius)
        if after:
            links[name] += _hub(axis, radius)
    x, y, z = arm.foot_to_world.position
    joints[0]["xyz"] = [a + b for a, b in zip((x, y, z), joints[0]["xyz"], strict=True)]
    assert np.allclose(matrix(arm.foot_to_world.orientation), np.eye(3)), "a foot that stands upright"
    return {
        "links": links,
        "joints": joints,
        "arms": {unit.key: _arm_model(unit, names, "tool0")},
        "limits": {"lower": arm.limits.lower, "upper": arm.limits.upper, "velocity": arm.limits.velocity},
    }


def _arm_model(unit: Unit, joints: list[str], tip: str) -> dict[str, Any]:
    home = unit.arm.home if unit.arm is not None else [0.0] * len(unit.axes)
    return {"joints": joints, "axes": unit.axes, "fingers": [], "tip": tip, "tool0": tip, "poses": {"home": home}}


def _capsule(end: list[float], radius: float) -> list[dict[str, Any]]:
    """A cylinder from a link's origin to ``end`` [m] with a ball there; nothing where that is at the origin."""
    x, y, z = end
    length = hypot(x, y, z)
    if length < _SHORTEST:
        return []
    rpy = [0.0, atan2(hypot(x, y), z), atan2(y, x)]
    return [
        {
            "shape": "cylinder",
            "mesh": "",
            "radius": [radius],
            "length": [length],
            "xyz": [x / 2.0, y / 2.0, z / 2.0],
            "rpy": rpy,
            "color": _COLOR,
        },
        {"shape": "sphere", "mesh": "", "radius": [radius], "xyz": end, "rpy": [0.0, 0.0, 0.0], "color": _COLOR},
    ]


def _hub(axis: list[float], radius: float) -> list[dict[str, Any]]:
    """A short cylinder along a joint's axis, so that its turning is seen."""
    x, y, z = axis
    return [
        {
            "shape": "cylinder",
            "mesh": "",
            "radius": [0.8 * radius],
            "length": [2.5 * radius],
            "xyz": [0.0, 0.0, 0.0],
            "rpy": [0.0, atan2(hypot(x, y), z), atan2(y, x)],
            "color": _JOINT_COLOR,
        }
    ]
