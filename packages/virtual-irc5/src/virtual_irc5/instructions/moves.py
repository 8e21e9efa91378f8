r"""RAPID's moves: MoveAbsJ, MoveJ, MoveL, MoveC and MoveExtJ, where the robot is, and what a target means.

A move with a zone is done for the program shortly before the arm comes to the zone, so that the next one can be planned
while the arm moves; a move to a stop point is done when the arm stands there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from math import degrees, pi, radians, tau
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.confdata import Confdata
from abb_protocols.robot.joints import ORIGIN_POSE, Joints, Pose
from abb_protocols.robot.kinematics import compose_poses, matrix_from_quaternion, quaternion_from_matrix
from abb_protocols.rws.values import EventType
from virtual_irc5.controller_log import ControllerEventLog
from virtual_irc5.instructions.robot_data import (
    NOT_PRESENT,
    ROBOT_DATA,
    chain_from_jointtarget,
    jointtarget,
    pose_from_rapid,
    unit_quaternion,
    wobj_from_rapid,
)
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.path import Offset, Passage
from virtual_irc5.mechanics.path_geometry import (
    STOP_CORNER,
    CornerZone,
    Leg,
    LegFrames,
    LegPlace,
    LegSpeed,
    MotionFault,
    MotionRefused,
    PathPiece,
    circle,
    corner,
    joint_leg,
    line,
    tool_leg,
)
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.rapid import Call, Library, RapidRuntimeError, Wait
from virtual_irc5.rapid.builtins.information import OF_TASK
from virtual_irc5.rapid.task import task_of_argument
from virtual_irc5.rapid.types import raised_as

SpeedRatio = Callable[[], float]
_Build = Callable[[Joints, CornerZone], Leg]
"""Plans a leg from joint positions [rad], after a zone."""

_TipPlace = tuple[NDArray[np.float64], NDArray[np.float64], float]
"""Point [m], rotation and arm angle [rad] of the tool in the work object."""

FATAL = "ERR_MOTION"
"""Stops the program at once; not registered, so that no error handler gets it."""

_MOST_CONCURRENT = 5
"""Moves with Conc that may follow one another."""

MOVE_SPEED = r"speeddata Speed, \num V | \num T, zonedata Zone, \num Z, \stoppointdata Inpos"
MOVE_FRAMES = r"tooldata Tool, \wobjdata WObj, \switch Corr, \loaddata TLoad"
_READ_FRAMES = r"\tooldata Tool, \wobjdata WObj"
_ERRORS = {MotionFault.OUT_OF_RANGE: "ERR_ROBLIMIT", MotionFault.OUT_OF_REACH: "ERR_OUTSIDE_REACH"}
_SLOWEST = 1e-4  # [m/s]: a speed of 0 is a very low one


MOVES = Library(ROBOT_DATA)
MOVES.record("inposdata", {"position": "num", "speed": "num", "mintime": "num", "maxtime": "num"})
MOVES.alias("stoppoint", "num")
MOVES.alias("identno", "num")
MOVES.record(
    "stoppointdata",
    {
        "type": "stoppoint",
        "progsynch": "bool",
        "inpos": "inposdata",
        "stoptime": "num",
        "followtime": "num",
        "signal": "string",
        "relation": "opnum",
        "checkvalue": "num",
    },
)
MOVES.constants("stoppoint", "inpos=1 stoptime fllwtime")
for _percent in (20, 50, 100):
    MOVES.data(f"inpos{_percent}", "stoppointdata", (1, True, (_percent, _percent, 0, 2), 0, 0, "", 0, 0))
for _time in (0.5, 1.0, 1.5):
    _name = f"{_time:.1f}".replace(".", "_")
    MOVES.data(f"stoptime{_name}", "stoppointdata", (2, False, (0, 0, 0, 0), _time, 0, "", 0, 0))
    MOVES.data(f"fllwtime{_name}", "stoppointdata", (3, True, (0, 0, 0, 0), 0, _time, "", 0, 0))
_TARGETS = rf"\switch Conc, {{}}, \identno ID, \switch NoEOffs, {MOVE_SPEED}, {MOVE_FRAMES}"
_KIND = re.compile(r"(?:Move|Trigg|Search|Contact)(AbsJ|ExtJ|J|L|C)")


@dataclass(frozen=True, slots=True)
class MoveTarget:
    """A robtarget in SI units, in the work object.

    Attributes:
        point: of the tool [m], (3,).
        rotation: of the tool, (3, 3).
        angle: the arm angle [rad], None where the target leaves it as it is.
        configuration: which posture is meant.
    """

    point: NDArray[np.float64]
    rotation: NDArray[np.float64]
    angle: float | None
    configuration: Confdata


class MoveInstructions:
    r"""The moves of one task.

    Attributes:
        program_offset: reads the offset beside the path that the program has written [m], (3,), for moves with \Corr.
    """

    def __init__(
        self, unit: ArmUnit, speed_ratio: SpeedRatio, events: ControllerEventLog, units_of_tasks: Mapping[str, ArmUnit]
    ) -> None:
        self.unit = unit
        self.arm = unit.arm
        self.events = events
        self._speed_ratio = speed_ratio
        self._moved_at = -1.0  # task time [s]
        self._concurrent = 0
        self._units_of_tasks = units_of_tasks
        self.program_offset: Offset | None = None

    # What the arguments mean --------------------------------------------------------------------------------------

    def frames(self, tool: Any, wobj: Any, *, is_displaced: bool = True) -> LegFrames:
        """Tool and work object, with the program displacement."""
        robot_holds_tool = bool(tool.robhold)
        if robot_holds_tool == (wobj is not None and bool(wobj.robhold)):
            sentence = "The robot has to hold either the tool or the work object: see robhold of both."
            raise RapidRuntimeError(FATAL, sentence)
        wobj_pose = ORIGIN_POSE if wobj is None else wobj_from_rapid(wobj)
        displacement = self.unit.settings.displacement
        if displacement is not None and is_displaced:
            wobj_pose = compose_poses(wobj_pose, pose_from_rapid(displacement))
        return LegFrames(_unit_pose(pose_from_rapid(tool.tframe)), _unit_pose(wobj_pose), robot_holds_tool)

    def target(self, robtarget: Any) -> MoveTarget:
        """A robtarget with the offset of the external axes."""
        angle_deg = robtarget.extax[0]
        has_angle = self.arm.kinematics.reference is not None and angle_deg < NOT_PRESENT
        conf = robtarget.robconf
        return MoveTarget(
            np.array(robtarget.trans) * 1e-3,
            matrix_from_quaternion(unit_quaternion(robtarget.rot)),
            radians(angle_deg + self.unit.settings.offsets[0]) if has_angle else None,
            Confdata(round(conf.cf1), round(conf.cf4), round(conf.cf6), round(conf.cfx)),
        )

    def speed(self, call: Call, speed: Any) -> LegSpeed:
        """The programmed speed with VelSet."""
        settings = self.unit.settings
        factor = settings.speed_percent / 100.0
        tool = min(call.get("V", speed.v_tcp) * factor, settings.most_speed) * 1e-3
        return LegSpeed(
            max(min(tool, self.arm.kinematics.tool_speed), _SLOWEST),
            max(radians(speed.v_ori) * factor, _SLOWEST),
            call.get("T", 0.0),
        )

    def zone(self, call: Call) -> CornerZone:
        """How near the arm comes to the target; a search comes to a stop."""
        zone = call.get("Zone")
        if zone is None or zone.finep or call.get("Inpos") is not None:
            return STOP_CORNER
        return CornerZone(call.get("Z", zone.pzone_tcp) * 1e-3, radians(zone.zone_ori))

    # Moves --------------------------------------------------------------------------------------------------------

    @MOVES.instruction("MoveAbsJ", _TARGETS.format(r"jointtarget ToJointPos"))
    @MOVES.instruction("MoveJ", _TARGETS.format("robtarget ToPoint"))
    @MOVES.instruction("MoveL", _TARGETS.format("robtarget ToPoint"))
    @MOVES.instruction("MoveC", _TARGETS.format("robtarget CirPoint, robtarget ToPoint"))
    def move(self, call: Call) -> Wait:
        yield from self.passed(call, self.build(call))

    def build(self, call: Call) -> _Build:
        """How a move is planned: by what follows Move, Trigg, Search or Contact in its name."""
        kind = _KIND.search(call.name)
        assert kind is not None, "it names a move"
        return _BUILDS[kind[1]](self, call)

    def _absolute(self, call: Call) -> _Build:
        kinematics, speed, zone = self.arm.kinematics, self.speed(call, call["Speed"]), self.zone(call)
        frames = self.frames(call["Tool"], call.get("WObj"), is_displaced=False)
        target = call["ToJointPos"]
        offset = self.unit.settings.offsets[0]
        if offset and not call.present("NoEOffs") and target.extax[0] < NOT_PRESENT:
            target = target._replace(extax=target.extax._replace(eax_a=target.extax[0] + offset))

        def build(start: Joints, entry: CornerZone) -> Leg:
            end = chain_from_jointtarget(target, start, kinematics.limits)
            return joint_leg(kinematics, start, end, frames, speed, zone, entry)

        return build

    @MOVES.instruction(
        "MoveExtJ",
        r"\switch Conc, jointtarget ToJointPos, \identno ID, \switch UseEOffs, speeddata Speed, \num T, "
        r"zonedata Zone, \stoppointdata Inpos",
    )
    def move_ext_j(self, call: Call) -> Wait:
        """The seventh axis alone; robots of six axes have no other ones here."""
        if call["ToJointPos"].extax[0] < NOT_PRESENT and self.arm.kinematics.reference is not None:
            yield from self.passed(call, self._external(call))

    def _external(self, call: Call) -> _Build:
        kinematics, zone = self.arm.kinematics, self.zone(call)
        frames = self.frames(call.task.library.value("tool0"), None)
        fastest, time = call["Speed"].v_reax, call.get("T", 0.0)

        def build(start: Joints, entry: CornerZone) -> Leg:
            robax, _ = jointtarget(start)
            target = call["ToJointPos"]._replace(robax=call["ToJointPos"].robax._make(robax))
            end = chain_from_jointtarget(target, start, kinematics.limits)
            turn = max((abs(a - b) for a, b in zip(end, start, strict=True)), default=0.0)
            return joint_leg(
                kinematics, start, end, frames, LegSpeed(duration=time or turn / radians(fastest)), zone, entry
            )

        return build

    def _joint(self, call: Call) -> _Build:
        kinematics, speed, zone = self.arm.kinematics, self.speed(call, call["Speed"]), self.zone(call)
        frames, target = self.frames(call["Tool"], call.get("WObj")), self.target(call["ToPoint"])
        is_checked = self.unit.settings.checks_joints

        def build(start: Joints, entry: CornerZone) -> Leg:
            end = _posture(kinematics, target, frames, start, is_checked=is_checked)
            return joint_leg(kinematics, start, end, frames, speed, zone, entry)

        return build

    def _line(self, call: Call) -> _Build:
        return self._along(call, line)

    def _circle(self, call: Call) -> _Build:
        via, mode = self.target(call["CirPoint"]), self.unit.settings.circles
        return self._along(call, lambda here, there: circle(here, (via.point, via.rotation), there, mode))

    def _along(self, call: Call, between: Callable[[_TipPlace, _TipPlace], LegPlace]) -> _Build:
        """The tool moves on a path from where it is to the target."""
        kinematics, speed, zone = self.arm.kinematics, self.speed(call, call["Speed"]), self.zone(call)
        frames, target = self.frames(call["Tool"], call.get("WObj")), self.target(call["ToPoint"])
        is_checked, passes = self.unit.settings.checks_lines, self.unit.settings.wrist_may_turn

        def build(start: Joints, entry: CornerZone) -> Leg:
            here = place_of(kinematics, start, frames)
            path = between(here, (target.point, target.rotation, _angle(target, here[2])))
            leg = tool_leg(kinematics, start, path, frames, speed, zone, entry, passes_wrist=passes)
            return _with_configuration(kinematics, leg, target) if is_checked else leg

        return build

    def passed(
        self,
        call: Call,
        build: _Build,
        added: Callable[[Passage], None] | None = None,
        offset: Offset | None = None,
    ) -> Generator[float | None, None, None]:
        r"""Plan a leg, add it to the path, and wait as the zone and \Conc demand.

        Args:
            call: the move.
            build: plans it.
            added: called when the leg has been added to the path.
            offset: reads where the arm is to be beside the leg; None where only the program corrects paths.
        """
        check_may_move(call)
        path, is_concurrent = self.arm.path, bool(call.get("Conc", False))
        self._concurrent = self._concurrent + 1 if is_concurrent else 0
        if self._concurrent > _MOST_CONCURRENT:
            raise call.error("ERR_CONC_MAX", rf"more than {_MOST_CONCURRENT} moves with \Conc follow one another.")
        try:
            passage = yield from self._added(call, build, offset)
            if added is not None:
                added(passage)
            if self._moved_at == call.task.now:  # a loop of moves of no length leaves time to other tasks
                yield None
            self._moved_at = call.task.now
            is_stop = passage.leg.zone.is_stop
            while not is_concurrent and not (self.is_there(passage) if is_stop else path.is_due(passage)):
                yield None
                self.go_on()
        except GeneratorExit:
            path.abandon()
            raise

    def _added(self, call: Call, build: _Build, offset: Offset | None) -> Generator[float | None, None, Passage]:
        """Plan a leg behind what is planned, and add it, with a corner where there is still time for one."""
        arm, path, unit = self.arm, self.arm.path, self.unit
        self._check_ready()
        while path.is_abandoned or (path.is_empty and not arm.is_stationary):
            yield None
        self.override_speed()
        if call.get("Corr", False):
            offset = self.program_offset
        stands = path.nominal if offset is not None and path.state.position == arm.planned else arm.planned
        if path.is_empty and (path.end is None or path.end.end != stands):
            path.restart_at(arm.planned)
        before = path.end
        start = arm.planned if before is None else before.end
        work = call.task.planning(lambda: _planned(arm.kinematics, build, start, before))
        while not work.done():
            yield None
        try:
            leg, rounded = work.result()
        except MotionRefused as refused:
            code, title = refused.fault.value
            self.events.append(code, title, str(refused), EventType.ERROR)
            raise RapidRuntimeError(_ERRORS.get(refused.fault, FATAL), str(refused)) from refused
        self._check_ready()
        can_round = path.can_round()
        has_corner = before is not None and not before.zone.is_stop and path.has_corner(before)
        if has_corner and not can_round and unit.settings.warns_of_corners:
            sentence = f"{call.task.name}: the next move came too late; the corner has become a stop point."
            self.events.append(50024, "Corner path failure", sentence, EventType.WARNING)
        passage = path.append(leg, rounded if can_round else None)
        passage.offset = offset
        unit.tool, unit.wobj, unit.has_moved = call.get("Tool", unit.tool), call.get("WObj"), True
        arm.follow_path()
        return passage

    def is_there(self, passage: Passage) -> bool:
        """Whether the arm stands behind a leg."""
        path = self.arm.path
        return path.has_ended(passage) and path.has_acted and self.arm.is_stationary

    def go_on(self) -> None:
        """The program runs: the arm follows the path, also after a stop."""
        self.override_speed()
        with raised_as("ERR_PATH_STOP", RobotNotReady):
            self.arm.follow_path()

    def override_speed(self) -> None:
        """Follow the speed override of the controller and of the program."""
        self.unit.override_speed(self._speed_ratio())

    def _check_ready(self) -> None:
        with raised_as("ERR_PATH_STOP", RobotNotReady):
            self.arm.check_ready()

    @MOVES.instruction("WaitRob", r"\switch InPos | \switch ZeroSpeed")
    def wait_rob(self, call: Call) -> Wait:
        """Until the arm stands."""
        yield from standing(self.arm)

    # Where the robot is -------------------------------------------------------------------------------------------

    def read_frames(self, call: Call) -> LegFrames:
        library, unit = call.task.library, self.unit
        tool, wobj = unit.tool or library.value("tool0"), unit.wobj or library.value("wobj0")
        return self.frames(call.get("Tool", tool), call.get("WObj", wobj))

    @MOVES.function("CJointT", OF_TASK, "jointtarget")
    def joint_target(self, call: Call) -> Any:
        """Where the joints are."""
        motion = self._of_task(call)
        robax, extax = jointtarget(motion.arm.position)
        return robax, motion._without_offset(extax)

    @MOVES.function("CRobT", rf"{OF_TASK}, {_READ_FRAMES}", "robtarget")
    def robot_target(self, call: Call) -> Any:
        """Where the tool is."""
        motion = self._of_task(call)
        return motion.robtarget(motion.arm.position, motion.read_frames(call))

    @MOVES.function("CPos", _READ_FRAMES, "pos")
    def position(self, call: Call) -> Any:
        """Where the tool's point is [mm]."""
        return self.robtarget(self.arm.position, self.read_frames(call))[0]

    @MOVES.function("CTool", OF_TASK, "tooldata")
    def tool(self, call: Call) -> Any:
        """The tool of the last motion."""
        return self._of_task(call).unit.tool or call.task.library.value("tool0")

    @MOVES.function("CWObj", OF_TASK, "wobjdata")
    def wobj(self, call: Call) -> Any:
        """The work object of the last motion."""
        return self._of_task(call).unit.wobj or call.task.library.value("wobj0")

    def robtarget(self, position: Joints, frames: LegFrames) -> tuple[Any, ...]:
        """RAPID's robtarget of the tool at joint positions [rad]."""
        kinematics = self.arm.kinematics
        point, rotation, angle = place_of(kinematics, position, frames)
        angle_deg = NOT_PRESENT if kinematics.reference is None else degrees(angle)
        extax = self._without_offset((angle_deg, *(NOT_PRESENT,) * 5))
        turns = tuple(float(number) for number in kinematics.configuration(position))
        return tuple((point * 1e3).tolist()), quaternion_from_matrix(rotation), turns, extax

    @MOVES.function("CalcRobT", r"jointtarget Joint_target, tooldata Tool, \wobjdata WObj", "robtarget")
    def calculated_target(self, call: Call) -> Any:
        """The robtarget of a jointtarget."""
        frames = self.frames(call["Tool"], call.get("WObj"))
        joints = chain_from_jointtarget(call["Joint_target"], self.arm.planned, self.arm.kinematics.limits)
        return self.robtarget(joints, frames)

    @MOVES.function(
        "CalcJointT",
        r"\switch UseCurWObjPos, robtarget Rob_target, tooldata Tool, \wobjdata WObj, \VAR errnum ErrorNumber",
        "jointtarget",
    )
    def calculated_joints(self, call: Call) -> Any:
        """The jointtarget of a robtarget, in its configuration; raises ERR_ROBLIMIT, ERR_OUTSIDE_REACH."""
        kinematics = self.arm.kinematics
        frames, target = self.frames(call["Tool"], call.get("WObj")), self.target(call["Rob_target"])
        work = call.task.planning(lambda: _posture(kinematics, target, frames, self.arm.planned, is_checked=True))
        while not work.done():
            yield None
        call.give("ErrorNumber", 0.0)
        try:
            robax, extax = jointtarget(work.result())
        except MotionRefused as refused:
            name = _ERRORS.get(refused.fault, "ERR_ROBLIMIT")
            if not call.present("ErrorNumber"):
                raise call.error(name, str(refused)) from refused
            call["ErrorNumber"] = call.task.library.error_number(name)
            robax, extax = jointtarget(self.arm.planned)
        return robax, self._without_offset(extax)

    @MOVES.function("ORobT", r"robtarget OrgPoint, \switch InPDisp | \switch InEOffs", "robtarget")
    def without_displacement(self, call: Call) -> Any:
        """A robtarget read under a program displacement or offset, as it is without them."""
        target, settings = call["OrgPoint"], self.unit.settings
        if settings.displacement is not None and not call.present("InPDisp"):
            pose = compose_poses(
                pose_from_rapid(settings.displacement),
                Pose(tuple(value * 1e-3 for value in target.trans), unit_quaternion(target.rot)),
            )
            trans = tuple(value * 1e3 for value in pose.position)
            target = target._replace(trans=target.trans._make(trans), rot=target.rot._make(pose.orientation))
        if not call.present("InEOffs") and target.extax[0] < NOT_PRESENT:
            target = target._replace(extax=target.extax._replace(eax_a=target.extax[0] + settings.offsets[0]))
        return target

    def _without_offset(self, extax: Any) -> Any:
        first = extax[0]
        return (first - self.unit.settings.offsets[0] if first < NOT_PRESENT else first, *extax[1:])

    def _of_task(self, call: Call) -> MoveInstructions:
        r"""The moves of the task that \TaskRef or \TaskName names; raises ERR_TASKNAME, ERR_NOT_MOVETASK."""
        task = task_of_argument(call)
        if task is call.task:
            return self
        unit = self._units_of_tasks.get(task.name)
        if unit is None:
            raise call.error("ERR_NOT_MOVETASK", f"the task {task.name} moves no robot (MotionTask in CAB_TASKS).")
        return MoveInstructions(unit, self._speed_ratio, self.events, self._units_of_tasks)


_BUILDS: Mapping[str, Callable[[MoveInstructions, Call], _Build]] = {
    "AbsJ": MoveInstructions._absolute,
    "ExtJ": MoveInstructions._external,
    "J": MoveInstructions._joint,
    "L": MoveInstructions._line,
    "C": MoveInstructions._circle,
}


def _planned(arm: KinematicArm, build: _Build, start: Joints, before: Leg | None) -> tuple[Leg, PathPiece | None]:
    """A leg, with the corner from the one before where there is room for one."""
    leg = build(start, STOP_CORNER if before is None else before.zone)
    has_corner = before is not None and before.out < len(before.shares) - 1 and leg.into > 0
    if before is None or not has_corner:
        return leg, None
    return leg, corner(arm, before, leg)


def _posture(arm: KinematicArm, target: MoveTarget, frames: LegFrames, near: Joints, *, is_checked: bool) -> Joints:
    """The posture [rad] of a target: of its configuration, or the one nearest to ``near`` where that is not checked.

    Raises:
        MotionRefused: there is none.
    """
    here = place_of(arm, near, frames)[2]
    angle = _angle(target, here)
    points, rotations = frames.tool0(target.point[None], target.rotation[None])
    continued = arm.reached(points, rotations, angle, near)
    if continued is not None and is_checked and arm.has_configuration(continued, target.configuration):
        return continued
    x, y, z = points[0].tolist()
    found = arm.postures(Pose((x, y, z), quaternion_from_matrix(rotations[0])), float((angle + pi) % tau - pi))
    where = f"[{x * 1e3:.1f}, {y * 1e3:.1f}, {z * 1e3:.1f}] mm (tool0 in the base frame)"
    if not found:
        sentence = f"The {arm.name} does not reach {where}. Choose a target within reach."
        raise MotionRefused(MotionFault.OUT_OF_REACH, sentence)
    wanted = target.configuration
    fitting = [each for each in found if not is_checked or arm.has_configuration(each, wanted)] or [
        # A target that is moved a little may leave its quarter turn.
        each
        for each in found
        if arm.is_beside_configuration(each, wanted) and arm.configuration(each).cfx == wanted.cfx
    ]
    if not fitting:
        others = ", ".join(sorted({str(list(arm.configuration(each))) for each in found}))
        sentence = f"The {arm.name} does not reach {where} with the configuration {list(wanted)}, but with {others}."
        raise MotionRefused(MotionFault.CONFIGURATION, sentence)
    return min(fitting, key=lambda each: sum((a - b) ** 2 for a, b in zip(each, near, strict=True)))


def place_of(arm: KinematicArm, position: Joints, frames: LegFrames) -> _TipPlace:
    """Where the tool is in the work object at joint positions [rad]."""
    joints = np.array([position])
    points, rotations = frames.tip(*arm.forward(joints))
    return points[0], rotations[0], float(arm.angles(joints)[0])


def _angle(target: MoveTarget, here: float) -> float:
    """The arm angle [rad] of a target, counted on from where the arm is."""
    if target.angle is None:
        return here
    return here + (target.angle - here + pi) % tau - pi


def _with_configuration(arm: KinematicArm, leg: Leg, target: MoveTarget) -> Leg:
    """The leg, which has to end in the configuration that is programmed, or in a neighbouring quarter turn (ConfL)."""
    if not arm.is_beside_configuration(leg.end, target.configuration):
        wanted, ends = list(target.configuration), list(arm.configuration(leg.end))
        raise MotionRefused(
            MotionFault.CONFIGURATION,
            f"The {arm.name} would end in the configuration {ends}, not in the programmed {wanted}: use MoveJ, "
            r"another configuration, or ConfL\Off.",
        )
    return leg


def _unit_pose(pose: Pose) -> Pose:
    return Pose(pose.position, unit_quaternion(pose.orientation))


def check_may_move(call: Call) -> None:
    """Refuse what lets a robot move in event routines that do not belong to a start."""
    if call.task.is_event_alone:
        assert call.task.event is not None
        sentence = (
            f"{call.name} moves a robot, which an event routine of {call.task.event.name} may not: use it in the "
            "program, or in one of START, RESTART or STEP."
        )
        raise RapidRuntimeError(FATAL, sentence)


_KINDS = [f"{letter}{kind}" for letter in "JLC" for kind in ("", "AO", "DO", "GO", "Sync")]
SYNCHRONIZED_MOVES = (
    *("MoveAbsJ", "MoveExtJ", *(f"Move{each}" for each in _KINDS)),
    *("TriggAbsJ", "TriggJ", "TriggL", "TriggC", "TriggJIOs", "TriggLIOs", "SearchL", "SearchC"),
)
"""Moves that begin together with those of other tasks after SyncMoveOn."""

MOVING = (
    *SYNCHRONIZED_MOVES,
    *("SearchExtJ", "WaitRob", "StepBwdPath", "LoadId", "ContactL"),
    *("PathRecStart", "PathRecStop", "PathRecMoveBwd", "PathRecMoveFwd"),
    *("CorrCon", "CorrDiscon", "CorrClear", "CorrWrite", "CorrRead"),
    *("SpeedLimAxis", "SpeedLimCheckPoint", "TuneServo", "TuneReset"),
)
"""What a task without mechanical units may not execute."""


def refuse_motion(call: Call) -> None:
    sentence = f"{call.name} moves a robot, which the task {call.task.name} may not (MotionTask in CAB_TASKS)."
    raise RapidRuntimeError("ERR_NOT_MOVETASK", sentence)


def standing(arm: VirtualArm) -> Wait:
    """Until the arm stands."""
    while not arm.is_stationary:
        yield None
