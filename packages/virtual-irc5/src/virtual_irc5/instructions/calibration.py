"""RAPID's calibrations of one arm, tools, axes and loads, from taught positions."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.kinematics import matrix_from_quaternion, quaternion_from_matrix
from virtual_irc5.instructions.moves import FATAL, MOVES, MoveInstructions
from virtual_irc5.instructions.robot_data import NOT_PRESENT, chain_from_jointtarget, unit_quaternion
from virtual_irc5.rapid import Call, Library, RapidRuntimeError, Wait
from virtual_irc5.rapid.builtins.maths import fitted_circle

_Array = NDArray[np.float64]

_LOWEST_RATIO = 1e-6  # of singular values; below, positions say too little
_SHORTEST_MM = 1e-3
_TURN_OF_IDENTIFICATION = radians(30.0)  # of axes 5 and 6 from where they are, when a load is identified
_IDENTIFICATION_TIME = 2.0  # [s]
_TOOL_LOAD, _PAYLOAD = 1.0, 2.0
_ROBOT_IDENTIFIES = 10.0  # ROB_LOAD_VAL


CALIBRATION = Library(MOVES)
CALIBRATION.refused(
    "ManLoadIdProc",
    r"\paridnum ParIdType, \mecunit MechUnit | \string MechUnitName, \num AxisNumber, \INOUT loaddata PayLoad, "
    r"\num ConfigAngle, \switch DeactAll | \switch AlreadyActive, \PERS bool DefinedFlag, \switch DoExit",
    "ERR_LOADID_FATAL",
    "no positioner is connected whose load could be identified.",
)
_ERRORS = "INOUT num MaxErr, INOUT num MeanErr"
_TARGETS = "robtarget TargetList{*}, num TargetsInList"


def _four(kind: str) -> str:
    return ", ".join(f"{kind} Pos{number}" for number in range(1, 5))


def _frame(kind: str) -> str:
    return rf"{kind} RefTip, {kind} ZPos, \{kind} XPos, INOUT tooldata Tool"


class CalibrationInstructions:
    """The calibrations of one task."""

    def __init__(self, motion: MoveInstructions) -> None:
        self._motion = motion

    # Tools --------------------------------------------------------------------------------------------------------

    @CALIBRATION.instruction("MToolTCPCalib", f"{_four('jointtarget')}, INOUT tooldata Tool, {_ERRORS}")
    def moving_tool_point(self, call: Call) -> None:
        """The tool's point from four jointtargets that bring it to one place."""
        self._check_hold(call, is_held=True)
        places = [self._place(call[f"Pos{number}"]) for number in range(1, 5)]
        tip, _ = _common_point(call, places)
        self._set_tool(call, trans=tip)

    @CALIBRATION.instruction("SToolTCPCalib", f"{_four('robtarget')}, INOUT tooldata Tool, {_ERRORS}")
    def fixed_tool_point(self, call: Call) -> None:
        """The point of a stationary tool, from four robtargets with one point of the robot at it."""
        self._check_hold(call, is_held=False)
        targets = [call[f"Pos{number}"] for number in range(1, 5)]
        places = [(np.array(target.trans), matrix_from_quaternion(unit_quaternion(target.rot))) for target in targets]
        _, point = _common_point(call, places)
        self._set_tool(call, trans=point)

    @CALIBRATION.instruction("MToolRotCalib", _frame("jointtarget"))
    def moving_tool_rotation(self, call: Call) -> None:
        r"""The tool's z axis, with \XPos its x axis, from places where points of them are at its tip."""
        self._check_hold(call, is_held=True)
        tip = np.array(call["Tool"].tframe.trans)
        point, rotation = self._place(call["RefTip"])
        there = point + rotation @ tip

        def direction(name: str) -> _Array:
            """Of a point that is at the tip's place now, seen from the tip, in tool0."""
            at, turned = self._place(call[name])
            return np.asarray(turned.T @ (there - at) - tip)

        x = direction("XPos") if call.present("XPos") else np.array([1.0, 0.0, 0.0])
        self._set_tool(call, rot=_axes(call, direction("ZPos"), x))

    @CALIBRATION.instruction("SToolRotCalib", _frame("robtarget"))
    def fixed_tool_rotation(self, call: Call) -> None:
        r"""The z axis of a stationary tool, with \XPos its x axis, from points on them."""
        self._check_hold(call, is_held=False)
        tip = np.array(call["RefTip"].trans)
        x = np.array(call["XPos"].trans) - tip if call.present("XPos") else np.array([1.0, 0.0, 0.0])
        self._set_tool(call, rot=_axes(call, np.array(call["ZPos"].trans) - tip, x))

    def _place(self, target: Any) -> tuple[_Array, _Array]:
        """Position [mm] and rotation of tool0 at a jointtarget."""
        kinematics = self._motion.arm.kinematics
        joints = chain_from_jointtarget(target, self._motion.arm.planned, kinematics.limits)
        points, rotations = kinematics.forward(np.array([joints]))
        return points[0] * 1e3, rotations[0]

    @staticmethod
    def _check_hold(call: Call, *, is_held: bool) -> None:
        if bool(call["Tool"].robhold) is not is_held:
            raise call.error(FATAL, f"robhold of the tool has to be {str(is_held).upper()}.")

    @staticmethod
    def _set_tool(call: Call, trans: _Array | None = None, rot: Any = None) -> None:
        tool = call["Tool"]
        frame = tool.tframe
        if trans is not None:
            frame = frame._replace(trans=frame.trans._make(trans.tolist()))
        if rot is not None:
            frame = frame._replace(rot=frame.rot._make(rot))
        call["Tool"] = tool._replace(tframe=frame)

    # Axes ---------------------------------------------------------------------------------------------------------

    @CALIBRATION.function("CalcRotAxFrameZ", f"{_TARGETS}, robtarget PositiveZPoint, {_ERRORS}", "pose")
    def axis_frame(self, call: Call) -> Any:
        """The frame of an axis of rotation, from a point that it turns and one on its positive z."""
        targets = _chosen_targets(call)
        z_point = np.array(call["PositiveZPoint"].trans)
        return _axis_frame(call, targets, lambda centre, normal: float(normal @ (z_point - centre)))

    @CALIBRATION.function("CalcRotAxisFrame", rf"mecunit MechUnit, \num AxisNo, {_TARGETS}, {_ERRORS}", "pose")
    def unit_axis_frame(self, call: Call) -> Any:
        """The same, with the positive z of the axis by the direction of its positions."""
        targets, axis = _chosen_targets(call), int(call.get("AxisNo", 1.0))
        angles = [target.extax[axis - 1] if 1 <= axis <= 6 else NOT_PRESENT for target in targets]
        if any(angle >= NOT_PRESENT for angle in angles):
            raise call.error("ERR_FRAME", f"the targets have no positions of the axis {axis}.")
        points = np.array([target.trans for target in targets])

        def sense(centre: _Array, normal: _Array) -> float:
            """Positive where the points go round the normal as the axis turns."""
            order = np.argsort(angles)
            first, second = points[order[0]] - centre, points[order[1]] - centre
            return float(normal @ np.cross(first, second))

        return _axis_frame(call, targets, sense)

    # Loads --------------------------------------------------------------------------------------------------------

    @CALIBRATION.function("ParIdRobValid", r"paridnum ParIdType, \mecunit MechUnit, \num AxisNo", "paridvalidnum")
    def can_identify(self, call: Call) -> float:
        """The robot can identify loads of its tool and its payload."""
        if call["ParIdType"] not in (_TOOL_LOAD, _PAYLOAD):
            raise call.error("ERR_ARGVALERR", "a robot has TOOL_LOAD_ID and PAY_LOAD_ID.")
        return _ROBOT_IDENTIFIES

    @CALIBRATION.function(
        "ParIdPosValid", r"paridnum ParIdType, jointtarget Pos, INOUT bool AxValid{*}, \num ConfAngle", "bool"
    )
    def can_identify_here(self, call: Call) -> bool:
        """Whether axes 5 and 6 may turn as the identification needs; writes which of all axes may."""
        limits = self._motion.arm.kinematics.limits
        here = chain_from_jointtarget(call["Pos"], self._motion.arm.planned, limits)
        turn = radians(abs(call.get("ConfAngle", degrees(_TURN_OF_IDENTIFICATION))))
        # Axes 5 and 6 are the last two of the chain.
        turns = [0.0] * (len(here) - 2) + [turn, turn]
        valid = [
            low <= angle - each and angle + each <= high
            for angle, each, low, high in zip(here, turns, limits.lower, limits.upper, strict=True)
        ]
        flags = call.reference("AxValid")
        of_abb = [*valid[:2], *valid[3:], valid[2]] if len(valid) == 7 else valid
        flags.value = flags.type.convert((of_abb + [True] * len(flags.value))[: len(flags.value)])
        return all(valid)

    @CALIBRATION.instruction(
        "LoadId",
        r"paridnum ParIdType, loadidnum LoadIdType, INOUT tooldata Tool, \INOUT loaddata PayLoad, "
        r"\INOUT wobjdata WObj, \num ConfAngle, \switch SlowTest, \INOUT num Accuracy",
    )
    def identify(self, call: Call) -> Wait:
        """Mass and centre of what the virtual arm carries, into the tool; the arm stands meanwhile."""
        arm = self._motion.arm
        payload = arm.model.payload
        if call["ParIdType"] != _TOOL_LOAD or payload is None:
            raise call.error("ERR_LOADID_FATAL", "the arm carries no load that could be identified.")
        end = call.task.now + _IDENTIFICATION_TIME
        while not arm.is_stationary or call.task.now < end:
            yield None
        tool = call["Tool"]
        xx, _, _, yy, _, zz = payload.inertia
        centre = tool.tload.cog._make(value * 1e3 for value in payload.centre)
        call["Tool"] = tool._replace(tload=tool.tload._replace(mass=payload.mass, cog=centre, ix=xx, iy=yy, iz=zz))
        call.give("Accuracy", 100.0)


def _common_point(call: Call, places: Sequence[tuple[_Array, _Array]]) -> tuple[_Array, _Array]:
    """The point of tool0 that is in one place at all positions, and that place; writes the distances from it [mm]."""
    rows = np.concatenate([np.hstack([rotation, -np.eye(3)]) for _, rotation in places])
    wanted = -np.concatenate([point for point, _ in places])
    solution, _, rank, values = np.linalg.lstsq(rows, wanted, rcond=_LOWEST_RATIO)
    if rank < 6 or values[-1] < _LOWEST_RATIO * values[0]:
        raise call.error("ERR_ARGVALERR", "the four positions have to differ more in their orientations.")
    tip, place = solution[:3], solution[3:]
    errors = np.array([np.linalg.norm(point + rotation @ tip - place) for point, rotation in places])
    call["MaxErr"], call["MeanErr"] = float(errors.max()), float(errors.mean())
    return tip, place


def _axes(call: Call, z: _Array, x: _Array) -> Any:
    """The orientation with the z axis in a direction, and x as near to another one as that allows."""
    length = float(np.linalg.norm(z))
    if length < _SHORTEST_MM:
        raise call.error("ERR_FRAME", "ZPos has to be away from RefTip.")
    z = z / length
    x = x - z * (z @ x)
    if float(np.linalg.norm(x)) < _SHORTEST_MM:
        if call.present("XPos"):
            raise call.error("ERR_FRAME", "XPos has to be away from RefTip and the z axis.")
        x = np.cross([0.0, 1.0, 0.0], z)
    x = x / np.linalg.norm(x)
    return quaternion_from_matrix(np.column_stack([x, np.cross(z, x), z]))


def _chosen_targets(call: Call) -> Sequence[Any]:
    targets, count = call["TargetList"], int(call["TargetsInList"])
    if not 4 <= count <= min(10, len(targets)):
        raise RapidRuntimeError("ERR_FRAME", f"{call.name} takes 4 to 10 targets that are in the list, not {count}.")
    chosen: Sequence[Any] = targets[:count]
    return chosen


def _axis_frame(call: Call, targets: Sequence[Any], sense: Any) -> Any:
    """The frame of the circle through targets: z the axis, x through the first one; writes the errors [mm]."""
    points = np.array([target.trans for target in targets])
    circle = fitted_circle(points, _SHORTEST_MM)
    if circle is None:
        raise call.error("ERR_FRAME", "the targets are in a line, or too near to each other.")
    centre, _, normal, errors = circle
    normal = normal if sense(centre, normal) >= 0.0 else -normal
    call["MaxErr"], call["MeanErr"] = float(errors.max()), float(errors.mean())
    return tuple(centre.tolist()), _axes(call, normal, points[0] - centre)
