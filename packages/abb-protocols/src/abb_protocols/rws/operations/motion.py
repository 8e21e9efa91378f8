"""Operations on mechanical units, their positions and calibration (``/rw/motionsystem``; reference/rws.md §8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import Annotated

from abb_protocols.robot.joints import Pose
from abb_protocols.rws.documents import (
    EXTERNAL_AXES,
    JointTarget,
    RobTarget,
    RwsState,
    joint_target_of,
    pose_of,
    rob_target_of,
)
from abb_protocols.rws.operations.operation import get, post
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
from abb_protocols.rws.values import Coordinates, Grant, JogMode

NO_AXIS = 8.9e9
"""9E9 and above stand for an axis that is not connected."""

TURNS = ("j1", "j4", "j6", "jx")
"""Quarter turns of axes 1, 4 and 6, and ABB's cfx, in most resources."""

TURNS_OF_TARGET = ("cf1", "cf4", "cf6", "cfx")
_MM = 1e3
_NO_UNIT = "NoIntegratedUnit"
_ON_OFF = flag("ON", "OFF")
_UNIT_OR_NONE = Spelling(
    lambda state, name: state.text(name).replace(_NO_UNIT, ""), lambda name, unit: {name: unit or _NO_UNIT}
)


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


def printed(value: float) -> str:
    """A number as the controller prints it: seven digits, 9E+09 for what is not there."""
    return "9E+09" if value > NO_AXIS else f"{value:.7g}"


def _pose_fields(pose: Pose) -> dict[str, str]:
    lengths = {axis: printed(value * _MM) for axis, value in zip("xyz", pose.position, strict=True)}
    return lengths | {f"q{number}": printed(value) for number, value in enumerate(pose.orientation, 1)}


def _axes_fields(names: Sequence[str], angles: Sequence[float | None]) -> dict[str, str]:
    """Angles of external axes [deg]."""
    return {name: "9E+09" if at is None else printed(at) for name, at in zip(names, angles, strict=True)}


def joint_answer(type: str, robot: str, external: Sequence[str]) -> OperationAnswer[JointTarget]:
    """Axes of a unit; the fields of the robot's axes begin with ``robot``."""
    return OperationAnswer(
        (type,),
        lambda state: joint_target_of(state, robot, external),
        lambda at: (
            {f"{robot}{axis}": printed(angle) for axis, angle in enumerate(at.robax_deg, 1)}
            | _axes_fields(external, at.extax_deg)
        ),
    )


def target_answer(type: str, turns: Sequence[str], external: Sequence[str]) -> OperationAnswer[RobTarget]:
    """A position with its configuration and, where they are named, the external axes."""
    return OperationAnswer(
        (type,),
        rob_target_of,
        lambda at: (
            _pose_fields(at.tool_to_object)
            | {name: str(value) for name, value in zip(turns, at.configuration, strict=True)}
            | _axes_fields(
                external, [None if each is None else degrees(each) for each in at.external] if external else ()
            )
        ),
    )


def pose_answer(type: str) -> OperationAnswer[Pose]:
    """A pose alone."""
    return OperationAnswer((type,), pose_of, _pose_fields)


def _read_calculated(state: RwsState) -> RobTarget:
    x, y, z = (state.number(f"position-{name}") for name in "xyz")
    w, i, j, k = (state.number(f"robtargetorientation-u{number}") for number in range(4))
    one, four, six, last = (state.whole(f"quarter-rev-{name}") for name in TURNS)
    external = tuple(state.number(name) for name in state.fields if name.startswith("extjoint-"))
    return RobTarget(Pose((x, y, z), (w, i, j, k)), (one, four, six, last), external)


def _write_calculated(at: RobTarget) -> Mapping[str, str]:
    fields = {f"position-{axis}": f"{value:.7g}" for axis, value in zip("xyz", at.tool_to_object.position, strict=True)}
    fields |= {f"robtargetorientation-u{n}": f"{value:.7g}" for n, value in enumerate(at.tool_to_object.orientation)}
    fields |= _turns_fields(at.configuration)
    return fields | {f"extjoint-{n}": f"{value:.7g}" for n, value in enumerate(at.external, 1)}


def _turns_fields(configuration: Sequence[int]) -> dict[str, str]:
    return {f"quarter-rev-{name}": str(value) for name, value in zip(TURNS, configuration, strict=False)}


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
_TRUTH = "TRUE|FALSE|true|false"
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
    f"tool_frame_position, tool_frame_orientation, rob_joints, ext_joints, robot_fixed_object={_TRUTH}, "
    f"elog_at_error={_TRUTH}"
)
_ALL = (
    "curr_position, curr_ext_joints, tool_frame_position, curr_orientation, tool_frame_orientation, "
    f"robot_configuration, robot_fixed_object={_TRUTH}"
)
_INVERSE = f"{_ALL}, old_rob_joints, old_ext_joints, elog_at_error={_TRUTH}"
_CALCULATED = OperationAnswer(("position-from-joint",), _read_calculated, _write_calculated)
_SOLUTION = OperationAnswer(("joints-from-position",), _read_solution, _write_solution)

MOTION_SYSTEM = get(
    _MOTION, "resource=modal-payload-mode|absacc-active|poll-rate|change-count|mechunit-name, continue-on-err=0|1"
).shows(record("ms", MotionSystem))
SET_ACTIVE = post(_MOTION, "set-mechunit", "mechunit-name", respects="motion")
JOG = post(_MOTION, "jog", _JOG, needs="motion")
POSITION_TARGET = post(_MOTION, "positiontarget", _POSITION, needs="motion")
SET_TARGET = post(_MOTION, "set-target", _POSITION, needs="motion")
CHANGE_COUNT = get(f"{_MOTION}/checkchangecount", "changecount").shows(single("ms-change-count", "changestate", flag()))
ERROR_STATE = get(f"{_MOTION}/errorstate").shows(record("ms-errorstate", MotionError))
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
LEAD_THROUGH = get(_UNIT, resource="lead-through").shows(
    single("ms-mechunit-complianceleadthrough", "status", flag("active", "inactive"))
)
SET_UNIT = post(_UNIT, "set", _SET_UNIT, respects="motion")
SET_LEAD_THROUGH = post(_UNIT, "set-lead-through", "status=active|inactive", respects="motion")
FINE_CALIBRATE = post(_UNIT, "fine-calibrate", "axis", status=400, grant=_CALIBRATE)
UPDATE_REVOLUTION_COUNTER = post(_UNIT, "update-revcounter", "axis", status=400, grant=Grant.REVOLUTION_COUNTER_UPDATE)
SET_POSITION = post(_UNIT, "mechunit-position", "rob_joint, ext_joint", status=400)

PHYSICAL_JOINTS = get(f"{_UNIT}/pjoints").shows(joint_answer("ms-pjoints", "rax_", EXTERNAL_AXES))
CARTESIAN = get(f"{_UNIT}/cartesian", f"{_TARGET}, elog-at-err=0|1").shows(
    target_answer("ms-mechunit-cartesian", TURNS, ())
)
ROBTARGET = get(f"{_UNIT}/robtarget", _TARGET).shows(target_answer("ms-robtargets", TURNS_OF_TARGET, EXTERNAL_AXES))
JOINT_TARGET = get(f"{_UNIT}/jointtarget", "ignore=0|1").shows(joint_answer("ms-jointtarget", "rax_", EXTERNAL_AXES))
BASE_FRAME = get(f"{_UNIT}/baseframe").shows(pose_answer("ms-mechunit-baseframe"))
SET_BASE_FRAME = post(f"{_UNIT}/baseframe", "set", _FRAME, respects="cfg", status=202, grant=_CALIBRATE)
AXES = get(f"{_UNIT}/axes").shows(single("ms-mechunit-axes", "axes", WHOLE))
AXIS = get(_AXIS).shows(record("ms-axis", Axis))
AXIS_POSE = get(_AXIS, resource="axis-pose").shows(pose_answer("ms-axis-pose"))
SET_AXIS_POSE = post(_AXIS, "set-axispose", _FRAME, status=400, grant=_CALIBRATE)
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
