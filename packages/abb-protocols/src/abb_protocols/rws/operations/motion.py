"""Operations on mechanical units (``/rw/motionsystem``): positions, solutions, jogging, supervision, calibration.

With the client's calls of them (reference/rws.md §8).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, radians
from typing import Annotated

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ProtocolError
from abb_protocols.robot.joints import ORIGIN_POSE, Joints, Pose, abb_from_chain, chain_from_abb, joints
from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.operation import UPPER_TRUTH_VALUES, get, post
from abb_protocols.rws.operations.operation_answer import (
    TEXT,
    TITLE,
    WHOLE,
    OperationAnswer,
    Spelling,
    choice,
    flag,
    record,
    single,
)
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import Coordinates, Grant, Increment, JogMode

NO_AXIS = 8.9e9
"""9E9 and above stand for an axis that is not connected."""

_EXTERNAL_AXES = tuple(f"eax_{axis}" for axis in "abcdef")
"""Fields of the external axes in pages of the motion system."""

_TURNS = ("j1", "j4", "j6", "jx")
"""Quarter turns of axes 1, 4 and 6, and ABB's cfx, in most resources."""

TURNS_OF_TARGET = ("cf1", "cf4", "cf6", "cfx")
_MM = 1e3
_NO_UNIT = "NoIntegratedUnit"
_ON_OFF = flag("ON", "OFF")
_UNIT_OR_NONE = Spelling(
    lambda state, name: state.text(name).replace(_NO_UNIT, ""), lambda name, unit: {name: unit or _NO_UNIT}
)


_SixAxes = tuple[float, float, float, float, float, float]
_Configuration = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class JointTarget:
    """Where a mechanical unit stands: axes 1-6 and external axes [deg], None where there is no axis."""

    robax_deg: _SixAxes
    extax_deg: tuple[float | None, ...]

    def chain(self) -> Joints:
        """The seven joints of a YuMi arm in chain order [rad].

        Raises:
            ProtocolError: the unit has no seventh axis.
        """
        axis_7_deg = self.extax_deg[0]
        if axis_7_deg is None:
            raise ProtocolError(message("unit_without_seventh_axis"))
        return joints([radians(angle) for angle in chain_from_abb(self.robax_deg, axis_7_deg)])


@dataclass(frozen=True, slots=True)
class RobTarget:
    """A position of the tool.

    Attributes:
        tool_to_object: of the tool in the work object, or as was asked for.
        configuration: quarter turns of axes 1, 4 and 6, and ABB's cfx.
        external: external axes [rad], None where there is no axis; of a YuMi's arm the first is the arm angle.
    """

    tool_to_object: Pose
    configuration: _Configuration
    external: tuple[float | None, ...] = ()


@dataclass(frozen=True, slots=True)
class MotionSystem:
    """What is jogged, and the count that a request to jog has to name.

    Attributes:
        change_count: rises with every change of units and their settings.
        unit: the active mechanical unit.
        poll_rate: how often a client may jog [ms].
        has_modal_payload: whether the load follows from GripLoad.
        has_absolute_accuracy: whether that is active.
    """

    change_count: int
    unit: Annotated[str, "mechunit-name"]
    poll_rate: int = 500
    has_modal_payload: Annotated[bool, "modal-payload-mode", _ON_OFF] = True
    has_absolute_accuracy: Annotated[bool, "absacc-active"] = False


@dataclass(frozen=True, slots=True)
class MotionError:
    """State of errors when jogging, ``HPJ_OK`` for none, and how many there were."""

    state: Annotated[str, "err-state"] = "HPJ_OK"
    count: Annotated[int, "err-count"] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanicalUnitState:
    """A mechanical unit.

    Attributes:
        name: such as ``ROB_R``.
        task: that moves it.
        type: ``TCPRobot``, ``Robot``, ``Single`` or ``None``.
        axes: number of its own.
        total_axes: number with those of the unit that is integrated in it.
        containing_unit: in which it is integrated, "" for none.
        integrated_unit: which is integrated in it, "" for none.
        tool, work_object, payload, total_payload: active names.
        is_synchronized: whether its revolution counters are right.
        is_active: whether it may be moved.
        jog_mode: what a joystick moves.
        coordinates: in which it is jogged.
    """

    name: Annotated[str, TITLE]
    task: Annotated[str, "task-name"]
    type: str
    axes: int
    total_axes: Annotated[int, "axes-total"]
    containing_unit: Annotated[str, "is-integrated-unit", _UNIT_OR_NONE] = ""
    integrated_unit: Annotated[str, "has-integrated-unit", _UNIT_OR_NONE]
    tool: Annotated[str, "tool-name"]
    work_object: Annotated[str, "wobj-name"]
    payload: Annotated[str, "payload-name"]
    total_payload: Annotated[str, "total-payload-name"] = ""
    is_synchronized: Annotated[bool, "status", choice("Synchronized", "Unsynchronized")]
    is_active: Annotated[bool, "mode", choice("Activated", "Deactivated")]
    jog_mode: JogMode
    coordinates: Annotated[Coordinates, "coord-system"]


@dataclass(frozen=True, slots=True)
class Supervision:
    """A supervision of an arm, and its level [%]; a higher one is less sensitive."""

    is_on: bool
    level: int


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a unit: whether its revolution counter is right, its number in the unit and that of its joint."""

    is_synchronized: Annotated[bool, "axisstatus", choice("Synchronized", "Unsynchronized")]
    number: Annotated[int, "axispose"] = 0
    logical: Annotated[int, "logicalaxis"] = 0


@dataclass(frozen=True, slots=True)
class Calibration:
    """How a joint was calibrated; ``used`` is what the controller goes by."""

    used: Annotated[str, "calibrationmethodused"] = ""
    is_shown: Annotated[bool, "showaxis", flag("1", "0")] = True
    joint: Annotated[str, "jointname"] = field(kw_only=True)
    factory_method: Annotated[str, "factorycalibrationmethod"] = field(kw_only=True)
    method: Annotated[str, "currentcalibrationmethod"] = field(kw_only=True)


@dataclass(frozen=True, slots=True)
class Solution:
    """Joint positions that the controller has calculated [rad]: axes 1 to 6, axis 7, and the configuration if shown."""

    robot: tuple[float, ...]
    axis_7: float
    configuration: Sequence[int] = ()


# How positions are spelled


def _printed(value: float) -> str:
    """A number as the controller prints it: seven digits, 9E+09 for what is not there."""
    return "9E+09" if value > NO_AXIS else f"{value:.7g}"


def _pose_fields(
    pose: Pose, spelled: Callable[[float], str] = _printed, position: Iterable[str] = "xyz", orientation: str = "q"
) -> dict[str, str]:
    """A pose [mm]: names of the fields of its position, and what those of its orientation begin with."""
    lengths = {name: spelled(value * _MM) for name, value in zip(position, pose.position, strict=True)}
    return lengths | {f"{orientation}{number}": spelled(value) for number, value in enumerate(pose.orientation, 1)}


def _axes_fields(names: Sequence[str], angles: Sequence[float | None]) -> dict[str, str]:
    """Angles of external axes [deg]."""
    return {name: "9E+09" if at is None else _printed(at) for name, at in zip(names, angles, strict=True)}


def _pose_of(state: RwsState) -> Pose:
    """Out of ``x`` to ``q4``."""
    x, y, z = (state.number(name) * 1e-3 for name in "xyz")
    w, i, j, k = (state.number(f"q{number}") for number in range(1, 5))
    return Pose((x, y, z), (w, i, j, k))


def _rob_target_of(state: RwsState) -> RobTarget:
    """A robtarget, as each of the services spells it."""
    names = TURNS_OF_TARGET if "cf1" in state.fields else _TURNS
    one, four, six, x = (state.whole(name) for name in names)
    found = [state.number(name) for name in state.fields if name.startswith(("eax", "ej"))]
    external = tuple(None if angle > NO_AXIS else radians(angle) for angle in found)
    return RobTarget(_pose_of(state), (one, four, six, x), external)


def _joint_target_of(state: RwsState, robot: str, external: Sequence[str]) -> JointTarget:
    """A jointtarget whose fields of the robot's axes begin with ``robot``."""
    a1, a2, a3, a4, a5, a6 = (state.number(f"{robot}{axis}") for axis in range(1, 7))
    found = [state.number(name) for name in external]
    return JointTarget((a1, a2, a3, a4, a5, a6), tuple(None if angle > NO_AXIS else angle for angle in found))


def joint_answer(type: str, robot: str, external: Sequence[str]) -> OperationAnswer[JointTarget]:
    """Axes of a unit; the fields of the robot's axes begin with ``robot``."""
    return OperationAnswer(
        (type,),
        lambda state: _joint_target_of(state, robot, external),
        lambda at: (
            {f"{robot}{axis}": _printed(angle) for axis, angle in enumerate(at.robax_deg, 1)}
            | _axes_fields(external, at.extax_deg)
        ),
    )


def target_answer(type: str, turns: Sequence[str], external: Sequence[str]) -> OperationAnswer[RobTarget]:
    """A position with its configuration and, where they are named, the external axes."""
    return OperationAnswer(
        (type,),
        _rob_target_of,
        lambda at: (
            _pose_fields(at.tool_to_object)
            | {name: str(value) for name, value in zip(turns, at.configuration, strict=True)}
            | _axes_fields(
                external, [None if each is None else degrees(each) for each in at.external] if external else ()
            )
        ),
    )


def _pose_answer(type: str) -> OperationAnswer[Pose]:
    """A pose alone."""
    return OperationAnswer((type,), _pose_of, _pose_fields)


def _read_calculated(state: RwsState) -> RobTarget:
    x, y, z = (state.number(f"position-{name}") for name in "xyz")
    w, i, j, k = (state.number(f"robtargetorientation-u{number}") for number in range(4))
    one, four, six, last = (state.whole(f"quarter-rev-{name}") for name in _TURNS)
    external = tuple(state.number(name) for name in state.fields if name.startswith("extjoint-"))
    return RobTarget(Pose((x, y, z), (w, i, j, k)), (one, four, six, last), external)


def _write_calculated(at: RobTarget) -> Mapping[str, str]:
    fields = {f"position-{axis}": f"{value:.7g}" for axis, value in zip("xyz", at.tool_to_object.position, strict=True)}
    fields |= {f"robtargetorientation-u{n}": f"{value:.7g}" for n, value in enumerate(at.tool_to_object.orientation)}
    fields |= _turns_fields(at.configuration)
    return fields | {f"extjoint-{n}": f"{value:.7g}" for n, value in enumerate(at.external, 1)}


def _turns_fields(configuration: Sequence[int]) -> dict[str, str]:
    return {f"quarter-rev-{name}": str(value) for name, value in zip(_TURNS, configuration, strict=False)}


def _read_solution(state: RwsState) -> Solution:
    return Solution(tuple(state.number(f"robotjoint-{n}") for n in range(1, 7)), state.number("extjoint-1"))


def _write_solution(found: Solution) -> Mapping[str, str]:
    fields = {f"robotjoint-{n}": f"{value:.7g}" for n, value in enumerate(found.robot, 1)}
    fields |= {f"extjoint-{n}": f"{value:.7g}" for n, value in enumerate((found.axis_7, *(0.0,) * 5), 1)}
    return fields | _turns_fields(found.configuration)


_MOTION = "/rw/motionsystem"
_SUPERVISION = f"{_MOTION}/motionsupervision"
_PATH_SUPERVISION = f"{_MOTION}/pathsupervision"
_NON_MOTION = f"{_MOTION}/nonmotionexecution"
_UNIT = f"{_MOTION}/mechunits/{{unit}}"
_AXIS = f"{_UNIT}/axes/{{axis}}"
_CALIBRATE = Grant.CALIBRATE
_FRAME = "x, y, z, q1, q2, q3, q4"
_TARGET = "tool, wobj, coordinate=Base|Word|World|Tool|Wobj"
_POSITION = (
    "pos-x, pos-y, pos-z, orient-q1, orient-q2, orient-q3, orient-q4, config-j1, config-j4, config-j6, config-jx, "
    "extjoint-1, extjoint-2, extjoint-3, extjoint-4, extjoint-5, extjoint-6"
)
_SET_UNIT = (
    "tool, wobj, payload, total-payload, mode=Activated|Deactivated, "
    "jog-mode=AxisGroup1|AxisGroup2|Align|GoToPos|ConfigurationJog|Cartesian, coord-system=Wobj|Base|Tool|Word|World"
)
_JOG = "axis1, axis2, axis3, axis4, axis5, axis6, ccount, inc-mode=Small|Medium|Large|User"
_FORWARD = (
    f"tool_frame_position, tool_frame_orientation, rob_joints, ext_joints, robot_fixed_object={UPPER_TRUTH_VALUES}, "
    f"elog_at_error={UPPER_TRUTH_VALUES}"
)
_ALL = (
    "curr_position, curr_ext_joints, tool_frame_position, curr_orientation, tool_frame_orientation, "
    f"robot_configuration, robot_fixed_object={UPPER_TRUTH_VALUES}"
)
_INVERSE = f"{_ALL}, old_rob_joints, old_ext_joints, elog_at_error={UPPER_TRUTH_VALUES}"
_CALCULATED = OperationAnswer(("position-from-joint",), _read_calculated, _write_calculated)
_SOLUTION = OperationAnswer(("joints-from-position",), _read_solution, _write_solution)

MOTION_SYSTEM = get(
    _MOTION, "resource=modal-payload-mode|absacc-active|poll-rate|change-count|mechunit-name, continue-on-err=0|1"
).shows(record("ms", MotionSystem))
SET_ACTIVE_UNIT = post(_MOTION, "set-mechunit", "mechunit-name", respects="motion")
JOG = post(_MOTION, "jog", _JOG, needs="motion")
POSITION_TARGET = post(_MOTION, "positiontarget", _POSITION, needs="motion")
SET_JOG_TARGET = post(_MOTION, "set-target", _POSITION, needs="motion")
MOTION_CHANGE_COUNT = get(f"{_MOTION}/checkchangecount", "changecount").shows(
    single("ms-change-count", "changestate", flag())
)
MOTION_ERROR_STATE = get(f"{_MOTION}/errorstate").shows(record("ms-errorstate", MotionError))
MOTION_SUPERVISION = get(_SUPERVISION, "mechunit").shows(
    record("ms-motionsupervision", Supervision, is_on=("mode", flag()), level=("sensitivity", WHOLE))
)
COLLISION_PREDICTION = get(_SUPERVISION, action="collision-prediction-mode").shows(
    single("ms-colpred-mode", "mode", flag("true", "false"))
)
SET_MOTION_SUPERVISION = post(
    _SUPERVISION, "set-mode", "mechunit-name, mode=True|False|TRUE|FALSE|true|false", respects="motion"
)
SET_MOTION_SENSITIVITY = post(_SUPERVISION, "set-level", "mechunit-name, sensitivity", respects="motion")
SET_COLLISION_PREDICTION = post(_SUPERVISION, "set-colpred-mode", "mode=true|false", respects="motion")
PATH_SUPERVISION = get(_PATH_SUPERVISION, "mechunit").shows(
    record("ms-pathsupervision", Supervision, is_on=("mode", _ON_OFF), level=("level", WHOLE))
)
SET_PATH_SUPERVISION = post(_PATH_SUPERVISION, "set-mode", "mechunit, mode=ON|OFF", respects="motion")
SET_PATH_LEVEL = post(_PATH_SUPERVISION, "set-level", "mechunit, level", respects="motion")
NON_MOTION = get(_NON_MOTION).shows(single("ms-nonmotionexecution", "mode", _ON_OFF))
SET_NON_MOTION = post(_NON_MOTION, "set-mode", "mode=ON|OFF", respects="motion", grant=Grant.RAPID_DEBUG)
SET_NON_MOTION_TOO = post(_NON_MOTION, "set", "mode=ON|OFF", respects="motion", grant=Grant.RAPID_DEBUG)

UNITS = get(f"{_MOTION}/mechunits")
UNIT = get(_UNIT, "resource, continue-on-err=0|1").shows(record("ms-mechunit", MechanicalUnitState))
UNIT_LEAD_THROUGH = get(_UNIT, resource="lead-through").shows(
    single("ms-mechunit-complianceleadthrough", "status", flag("active", "inactive"))
)
SET_UNIT = post(_UNIT, "set", _SET_UNIT, respects="motion")
SET_UNIT_LEAD_THROUGH = post(_UNIT, "set-lead-through", "status=active|inactive", respects="motion")
FINE_CALIBRATE = post(_UNIT, "fine-calibrate", "axis", status=400, grant=_CALIBRATE)
UPDATE_REVOLUTION_COUNTER = post(_UNIT, "update-revcounter", "axis", status=400, grant=Grant.REVOLUTION_COUNTER_UPDATE)
SET_POSITION = post(_UNIT, "mechunit-position", "rob_joint, ext_joint", status=400)

PHYSICAL_JOINTS = get(f"{_UNIT}/pjoints").shows(joint_answer("ms-pjoints", "rax_", _EXTERNAL_AXES))
CARTESIAN_POSITION = get(f"{_UNIT}/cartesian", f"{_TARGET}, elog-at-err=0|1").shows(
    target_answer("ms-mechunit-cartesian", _TURNS, ())
)
POSITION_AS_ROBTARGET = get(f"{_UNIT}/robtarget", _TARGET).shows(
    target_answer("ms-robtargets", TURNS_OF_TARGET, _EXTERNAL_AXES)
)
POSITION_AS_JOINTTARGET = get(f"{_UNIT}/jointtarget", "ignore=0|1").shows(
    joint_answer("ms-jointtarget", "rax_", _EXTERNAL_AXES)
)
UNIT_BASE_FRAME = get(f"{_UNIT}/baseframe").shows(_pose_answer("ms-mechunit-baseframe"))
SET_UNIT_BASE_FRAME = post(f"{_UNIT}/baseframe", "set", _FRAME, respects="cfg", status=202, grant=_CALIBRATE)
UNIT_AXES = get(f"{_UNIT}/axes").shows(single("ms-mechunit-axes", "axes", WHOLE))
UNIT_AXIS = get(_AXIS).shows(record("ms-axis", Axis))
UNIT_AXIS_POSE = get(_AXIS, resource="axis-pose").shows(_pose_answer("ms-axis-pose"))
SET_UNIT_AXIS_POSE = post(_AXIS, "set-axispose", _FRAME, status=400, grant=_CALIBRATE)
UPDATE_COMMUTATE = post(_AXIS, "update-commutate", status=400, grant=_CALIBRATE)
UPDATE_SYNC_COUNTER = post(
    _AXIS, "update-syncrevcounter", "syncType=1", status=400, grant=Grant.REVOLUTION_COUNTER_UPDATE
)

CALIBRATION = get(f"{_UNIT}/calibrationinfo").shows(record("ms-calibrationinfo-joint", Calibration))
SMB_DATA = get(f"{_UNIT}/smbdata")
SET_SMB_DATA = post(
    f"{_UNIT}/smbdata", "set", "type=robot-to-controller|controller-to-robot", status=400, grant=_CALIBRATE
)
CLEAR_SMB_DATA = post(f"{_UNIT}/smbdata", "clear", "type=robot|controller", status=400, grant=_CALIBRATE)
MOTOR_CALIBRATION = get(f"{_UNIT}/motorcalib").shows(single("ms-motorcalib", "name", TEXT))

POSE_FROM_JOINTS = post(_UNIT, "CalcPoseFromJoints", _FORWARD, status=200).shows(_CALCULATED)
ROBTARGET_FROM_JOINTS = post(_UNIT, "CalcRobTFromJoints", _FORWARD, status=200).shows(_CALCULATED)
JOINTS_FROM_POSE = post(_UNIT, "CalcJointsFromPose", _INVERSE, status=200).shows(_SOLUTION)
JOINTS_FROM_CARTESIAN = post(_UNIT, "JointsFromCartesian", _INVERSE, status=200).shows(_SOLUTION)
ALL_SOLUTIONS = post(_UNIT, "AllJointSolutions", _ALL, status=200).shows(
    OperationAnswer(("all-joint-solutions",), _read_solution, _write_solution)
)


class MotionService(Service):
    """``/rw/motionsystem``."""

    def joint_target(self, unit: str) -> Joints:
        """Where the arm ``ROB_R`` or ``ROB_L`` stands, chain order [rad]."""
        return self.axis_positions(unit).chain()

    def axis_positions(self, unit: str) -> JointTarget:
        """Where the axes of any mechanical unit stand."""
        return self._answer(f"reading the joints of {unit}", POSITION_AS_JOINTTARGET, unit)

    def motion_system(self) -> MotionSystem:
        """What is jogged."""
        return self._answer("reading the motion system", MOTION_SYSTEM)

    def has_motion_changed(self, change_count: int) -> bool:
        """Whether units or their settings have changed since they were read with that count."""
        return self._answer("reading the change count", MOTION_CHANGE_COUNT, changecount=change_count)

    def motion_error(self) -> tuple[str, int]:
        """State of errors when jogging, ``HPJ_OK`` for none, and how many there were."""
        error = self._answer("reading the error state", MOTION_ERROR_STATE)
        return error.state, error.count

    def mechanical_units(self) -> tuple[str, ...]:
        """Names of the mechanical units."""
        return tuple(state.title for state in self._listed("reading the mechanical units", UNITS))

    def mechanical_unit(self, unit: str) -> MechanicalUnitState:
        """One mechanical unit."""
        return self._answer(f"reading {unit}", UNIT, unit)

    def set_mechanical_unit(
        self,
        unit: str,
        *,
        tool: str | None = None,
        work_object: str | None = None,
        payload: str | None = None,
        total_payload: str | None = None,
        coordinates: Coordinates | None = None,
        jog_mode: JogMode | None = None,
        is_active: bool | None = None,
    ) -> None:
        """Change what a mechanical unit is jogged with; None leaves it as it is."""
        self._call(
            f"setting up {unit}",
            SET_UNIT,
            unit,
            tool=tool,
            wobj=work_object,
            payload=payload,
            total_payload=total_payload,
            coord_system=coordinates,
            jog_mode=jog_mode,
            mode=None if is_active is None else "Activated" if is_active else "Deactivated",
        )

    def is_lead_through_on(self, unit: str) -> bool:
        """Whether an arm follows a hand that leads it."""
        return self._answer(f"reading {unit}", UNIT_LEAD_THROUGH, unit)

    def set_lead_through(self, unit: str, is_on: bool) -> None:
        """Let an arm follow a hand that leads it, or not."""
        status = "active" if is_on else "inactive"
        self._call(f"switching the lead-through of {unit}", SET_UNIT_LEAD_THROUGH, unit, status=status)

    # Positions

    def physical_joints(self, unit: str) -> Joints:
        """Where the motors of an arm stand, chain order [rad]."""
        return self._answer(f"reading the joints of {unit}", PHYSICAL_JOINTS, unit).chain()

    def rob_target(
        self, unit: str, *, tool: str = "", work_object: str = "", coordinates: Coordinates | None = None
    ) -> RobTarget:
        """Where the tool of an arm stands; tool, work object and coordinates are the active ones if not named."""
        frames = _frames(tool, work_object, coordinates)
        return self._answer(f"reading the position of {unit}", POSITION_AS_ROBTARGET, unit, **frames)

    def cartesian(
        self, unit: str, *, tool: str = "", work_object: str = "", coordinates: Coordinates | None = None
    ) -> RobTarget:
        """As ``rob_target``, without external axes."""
        frames = _frames(tool, work_object, coordinates)
        return self._answer(f"reading the position of {unit}", CARTESIAN_POSITION, unit, **frames)

    def base_frame(self, unit: str) -> Pose:
        """Base of an arm in the world."""
        return self._answer(f"reading the base frame of {unit}", UNIT_BASE_FRAME, unit)

    def set_base_frame(self, unit: str, base_to_world: Pose) -> None:
        """Say where an arm is mounted; it acts after a restart."""
        self._call(f"setting the base frame of {unit}", SET_UNIT_BASE_FRAME, unit, **_pose_fields(base_to_world, repr))

    def axes(self, unit: str) -> int:
        """Number of axes of a mechanical unit."""
        return self._answer(f"reading {unit}", UNIT_AXES, unit)

    def is_axis_synchronized(self, unit: str, axis: int) -> bool:
        """Whether the revolution counter of an axis (from 1) is right."""
        return self._answer(f"reading axis {axis} of {unit}", UNIT_AXIS, unit, str(axis)).is_synchronized

    def axis_pose(self, unit: str, axis: int) -> Pose:
        """Where an axis (from 1) is, in the base of the arm."""
        return self._answer(f"reading {unit}", UNIT_AXIS_POSE, unit, str(axis))

    # Kinematics of the controller

    def pose_of_joints(self, unit: str, position: Joints, tool_to_flange: Pose = ORIGIN_POSE) -> RobTarget:
        """Where the tool is with the joints at ``position``, chain order [rad]."""
        form = {**_joint_fields(position, "rob_joints", "ext_joints"), **_tool_fields(tool_to_flange)}
        what = f"computing the position of {unit}"
        return self._first(what, POSE_FROM_JOINTS, unit, **form, elog_at_error="FALSE")

    def joints_of_pose(self, unit: str, target: RobTarget, near: Joints, tool_to_flange: Pose = ORIGIN_POSE) -> Joints:
        """Joints with which the tool is at ``target``, near the joints ``near``; chain order [rad]."""
        form = _search_fields(target, near, tool_to_flange)
        return _joints(self._first(f"computing the joints of {unit}", JOINTS_FROM_POSE, unit, **form))

    def joints_of_cartesian(
        self, unit: str, target: RobTarget, near: Joints, tool_to_flange: Pose = ORIGIN_POSE
    ) -> Joints:
        """As ``joints_of_pose``, whatever the configuration of ``target`` is."""
        form = _search_fields(target, near, tool_to_flange)
        return _joints(self._first(f"computing the joints of {unit}", JOINTS_FROM_CARTESIAN, unit, **form))

    def all_joints_of_pose(
        self, unit: str, target: RobTarget, tool_to_flange: Pose = ORIGIN_POSE
    ) -> tuple[Joints, ...]:
        """All joints with which the tool is at ``target``, in each configuration; chain order [rad]."""
        form = {**_target_fields(target), **_tool_fields(tool_to_flange)}
        page = self._shown(f"computing the joints of {unit}", ALL_SOLUTIONS, unit, **form)
        return tuple(_joints(ALL_SOLUTIONS.answered.read(state)) for state in page.states)

    # Jogging

    def select_unit(self, unit: str) -> None:
        """Make a mechanical unit the one that is jogged."""
        self._call(f"selecting {unit}", SET_ACTIVE_UNIT, mechunit_name=unit)

    def jog(self, axes: Sequence[int], increment: Increment, change_count: int) -> None:
        """Move the active unit by hand as a joystick does; the enabling rules of jogging hold.

        Args:
            axes: six deflections, -1000 to 1000.
            increment: length of a step.
            change_count: of ``motion_system``, which must not have changed since.

        Raises:
            CommandRefused: there are not six deflections.
        """
        if len(axes) != 6:
            raise CommandRefused(message("jog_of_other_length", count=len(axes)))
        deflections = {f"axis{number}": value for number, value in enumerate(axes, 1)}
        self._call("jogging", JOG, **deflections, ccount=change_count, inc_mode=increment)

    def jog_to(self, target: RobTarget) -> None:
        """Move the active unit to a position in its base, as jogging in GO_TO_POSITION does; RAPID must be stopped."""
        form: dict[str, object] = {**_pose_fields(target.tool_to_object, repr, ("pos_x", "pos_y", "pos_z"), "orient_q")}
        form |= {f"config_{name}": turns for name, turns in zip(_TURNS, target.configuration, strict=True)}
        external = [*target.external, *(None,) * 6][:6]
        form |= {
            f"extjoint_{number}": "9E+09" if angle is None else repr(degrees(angle))
            for number, angle in enumerate(external, 1)
        }
        self._call("jogging to a position", POSITION_TARGET, **form)

    # Supervision

    def motion_supervision(self, unit: str) -> Supervision:
        """Collision detection of an arm while it moves."""
        return self._answer(f"reading the supervision of {unit}", MOTION_SUPERVISION, mechunit=unit)

    def set_motion_supervision(self, unit: str, supervision: Supervision) -> None:
        """Switch the collision detection of an arm, and set its level."""
        what = f"setting the supervision of {unit}"
        self._call(what, SET_MOTION_SUPERVISION, mechunit_name=unit, mode=str(supervision.is_on))
        self._call(what, SET_MOTION_SENSITIVITY, mechunit_name=unit, sensitivity=supervision.level)

    def path_supervision(self, unit: str) -> Supervision:
        """Supervision that an arm is on its path."""
        return self._answer(f"reading the supervision of {unit}", PATH_SUPERVISION, mechunit=unit)

    def set_path_supervision(self, unit: str, supervision: Supervision) -> None:
        """Switch the supervision that an arm is on its path, and set its level."""
        what = f"setting the supervision of {unit}"
        self._call(what, SET_PATH_SUPERVISION, mechunit=unit, mode="ON" if supervision.is_on else "OFF")
        self._call(what, SET_PATH_LEVEL, mechunit=unit, level=supervision.level)

    def is_collision_predicted(self) -> bool:
        """Whether the controller stops before arms collide (Collision Avoidance)."""
        return self._answer("reading the collision prediction", COLLISION_PREDICTION)

    def predict_collisions(self, is_on: bool) -> None:
        """Whether the controller stops before arms collide."""
        self._call("setting the collision prediction", SET_COLLISION_PREDICTION, mode=is_on)

    def is_motion_skipped(self) -> bool:
        """Whether programs run without moving the robot (non-motion execution)."""
        return self._answer("reading non-motion execution", NON_MOTION)

    def skip_motion(self, is_on: bool) -> None:
        """Let programs run without moving the robot, or not."""
        self._call("setting non-motion execution", SET_NON_MOTION, mode="ON" if is_on else "OFF")

    # Calibration

    def calibration(self, unit: str) -> tuple[Calibration, ...]:
        """How each joint was calibrated."""
        answer = CALIBRATION.answered
        states = self._listed(f"reading the calibration of {unit}", CALIBRATION, unit)
        return tuple(answer.read(state) for state in states if state.type in answer.types)

    def is_measurement_memory_valid(self, unit: str) -> bool:
        """Whether the data in the robot's measurement board (SMB) and in the controller are the same and valid."""
        state = self._shown(f"reading the memory of {unit}", SMB_DATA, unit).one("ms-smbdata")
        return all(text in ("0", "3") for text in state.fields.values())  # 3: there is none of that kind

    def calibrated_motors(self, unit: str) -> tuple[str, ...]:
        """Names of the motors that can be calibrated."""
        return self._answers(f"reading the motors of {unit}", MOTOR_CALIBRATION, unit)


def _frames(tool: str, work_object: str, coordinates: Coordinates | None) -> dict[str, object]:
    return {"tool": tool or None, "wobj": work_object or None, "coordinate": coordinates}


def _vector(values: Iterable[float]) -> str:
    return f"[{','.join(map(repr, values))}]"


def _joint_fields(position: Joints, robot: str, external: str) -> dict[str, str]:
    axes, axis_7 = abb_from_chain(position)
    return {robot: _vector(axes), external: _vector((axis_7, 0.0, 0.0, 0.0, 0.0, 0.0))}


def _tool_fields(tool_to_flange: Pose) -> dict[str, str]:
    return {
        "tool_frame_position": _vector(tool_to_flange.position),
        "tool_frame_orientation": _vector(tool_to_flange.orientation),
        "robot_fixed_object": "FALSE",
    }


def _target_fields(target: RobTarget) -> dict[str, str]:
    external = [0.0 if angle is None else angle for angle in (*target.external, *(None,) * 6)][:6]
    return {
        "curr_position": _vector(target.tool_to_object.position),
        "curr_orientation": _vector(target.tool_to_object.orientation),
        "curr_ext_joints": _vector(external),
        "robot_configuration": f"[{','.join(map(str, target.configuration))}]",
    }


def _search_fields(target: RobTarget, near: Joints, tool_to_flange: Pose) -> dict[str, str]:
    old = _joint_fields(near, "old_rob_joints", "old_ext_joints")
    return {**_target_fields(target), **_tool_fields(tool_to_flange), **old, "elog_at_error": "FALSE"}


def _joints(found: Solution) -> Joints:
    return joints(chain_from_abb(found.robot, found.axis_7))
