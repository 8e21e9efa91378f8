"""RAPID's calibrations and measurements of one arm: tools, axes, loads; joint data, test signals, counters, paths.

Tools and axes are calculated from taught positions.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import degrees, dist, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.types import RapidRuntimeError
from yumi.robot.joints import JOINT_COUNT, Joints, Pose, Side, abb_from_chain
from yumi.robot.kinematics import compose, matrix, quaternion_from_matrix
from yumi.virtual.controller.units import ArmUnit, unit_of
from yumi.virtual.instructions.data import NOT_PRESENT, chain_from_jointtarget, pose_from_rapid, unit_quaternion
from yumi.virtual.instructions.motion import FATAL, MotionInstructions
from yumi.virtual.mechanics.dynamics import ArmDynamics

Array = NDArray[np.float64]

_LOWEST_RATIO = 1e-6  # of singular values; below, positions say too little
_SHORTEST_MM = 1e-3
_TURN_OF_IDENTIFICATION = radians(30.0)  # of axes 5 and 6 from where they are, when a load is identified
_IDENTIFICATION_TIME = 2.0  # [s]
_TOOL_LOAD, _PAYLOAD = 1.0, 2.0
_ROBOT_IDENTIFIES = 10.0  # ROB_LOAD_VAL


class CalibrationInstructions:
    """The calibrations of one task."""

    def __init__(self, motion: MotionInstructions) -> None:
        self._motion = motion

    # Tools --------------------------------------------------------------------------------------------------------

    def moving_tool_point(self, call: Call) -> None:
        """MToolTCPCalib: the tool's point from four jointtargets that bring it to one place."""
        self._check_hold(call, is_held=True)
        places = [self._place(call[f"Pos{number}"]) for number in range(1, 5)]
        tip, _, errors = _common_point(call, places)
        self._set_tool(call, trans=tip)
        call["MaxErr"], call["MeanErr"] = float(errors.max()), float(errors.mean())

    def fixed_tool_point(self, call: Call) -> None:
        """SToolTCPCalib: the point of a stationary tool, from four robtargets with one point of the robot at it."""
        self._check_hold(call, is_held=False)
        targets = [call[f"Pos{number}"] for number in range(1, 5)]
        places = [(np.array(target.trans), matrix(unit_quaternion(target.rot))) for target in targets]
        _, point, errors = _common_point(call, places)
        self._set_tool(call, trans=point)
        call["MaxErr"], call["MeanErr"] = float(errors.max()), float(errors.mean())

    def moving_tool_rotation(self, call: Call) -> None:
        r"""MToolRotCalib: the tool's z axis, with \XPos its x axis, from places where points of them are at its tip."""
        self._check_hold(call, is_held=True)
        tip = np.array(call["Tool"].tframe.trans)
        point, rotation = self._place(call["RefTip"])
        there = point + rotation @ tip

        def direction(name: str) -> Array:
            """Of a point that is at the tip's place now, seen from the tip, in tool0."""
            at, turned = self._place(call[name])
            return np.asarray(turned.T @ (there - at) - tip)

        x = direction("XPos") if call.present("XPos") else np.array([1.0, 0.0, 0.0])
        self._set_tool(call, rot=_axes(call, direction("ZPos"), x))

    def fixed_tool_rotation(self, call: Call) -> None:
        r"""SToolRotCalib: the z axis of a stationary tool, with \XPos its x axis, from points on them."""
        self._check_hold(call, is_held=False)
        tip = np.array(call["RefTip"].trans)
        x = np.array(call["XPos"].trans) - tip if call.present("XPos") else np.array([1.0, 0.0, 0.0])
        self._set_tool(call, rot=_axes(call, np.array(call["ZPos"].trans) - tip, x))

    def _place(self, target: Any) -> tuple[Array, Array]:
        """Position [mm] and rotation of tool0 at a jointtarget."""
        kinematics = self._motion.arm.kinematics
        joints = chain_from_jointtarget(target, self._motion.arm.planned, kinematics.limits)
        points, rotations = kinematics.forward(np.array([joints]))
        return points[0] * 1e3, rotations[0]

    @staticmethod
    def _check_hold(call: Call, *, is_held: bool) -> None:
        if bool(call["Tool"].robhold) is not is_held:
            sentence = f"{call.name}: robhold of the tool has to be {str(is_held).upper()}."
            raise RapidRuntimeError(FATAL, sentence)

    @staticmethod
    def _set_tool(call: Call, trans: Array | None = None, rot: Any = None) -> None:
        tool = call["Tool"]
        frame = tool.tframe
        if trans is not None:
            frame = frame._replace(trans=frame.trans._make(trans.tolist()))
        if rot is not None:
            frame = frame._replace(rot=frame.rot._make(rot))
        call["Tool"] = tool._replace(tframe=frame)

    # Axes ---------------------------------------------------------------------------------------------------------

    def axis_frame(self, call: Call) -> Any:
        """CalcRotAxFrameZ: the frame of an axis of rotation, from a point that it turns and one on its positive z."""
        targets = _chosen_targets(call)
        z_point = np.array(call["PositiveZPoint"].trans)
        return _axis_frame(call, targets, lambda centre, normal: float(normal @ (z_point - centre)))

    def unit_axis_frame(self, call: Call) -> Any:
        """CalcRotAxisFrame: the same, with the positive z of the axis by the direction of its positions."""
        targets, axis = _chosen_targets(call), int(call.get("AxisNo", 1.0))
        angles = [target.extax[axis - 1] if 1 <= axis <= 6 else NOT_PRESENT for target in targets]
        if any(angle >= NOT_PRESENT for angle in angles):
            raise RapidRuntimeError("ERR_FRAME", f"{call.name}: the targets have no positions of the axis {axis}.")
        points = np.array([target.trans for target in targets])

        def sense(centre: Array, normal: Array) -> float:
            """Positive where the points go round the normal as the axis turns."""
            order = np.argsort(angles)
            first, second = points[order[0]] - centre, points[order[1]] - centre
            return float(normal @ np.cross(first, second))

        return _axis_frame(call, targets, sense)

    # Loads --------------------------------------------------------------------------------------------------------

    def can_identify(self, call: Call) -> float:
        """ParIdRobValid: the robot can identify loads of its tool and its payload."""
        if call["ParIdType"] not in (_TOOL_LOAD, _PAYLOAD):
            raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: a robot has TOOL_LOAD_ID and PAY_LOAD_ID.")
        return _ROBOT_IDENTIFIES

    def can_identify_here(self, call: Call) -> bool:
        """ParIdPosValid: whether axes 5 and 6 may turn as the identification needs; writes which of all axes may."""
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

    def identify(self, call: Call) -> Wait:
        """LoadId: mass and centre of what the virtual arm carries, into the tool; the arm stands meanwhile."""
        arm = self._motion.arm
        payload = arm.model.payload
        if call["ParIdType"] != _TOOL_LOAD or payload is None:
            raise RapidRuntimeError(
                "ERR_LOADID_FATAL", f"{call.name}: the arm carries no load that could be identified."
            )
        end = call.task.now + _IDENTIFICATION_TIME
        while not arm.is_stationary or call.task.now < end:
            yield None
        tool = call["Tool"]
        xx, _, _, yy, _, zz = payload.inertia
        centre = tool.tload.cog._make(value * 1e3 for value in payload.centre)
        call["Tool"] = tool._replace(tload=tool.tload._replace(mass=payload.mass, cog=centre, ix=xx, iy=yy, iz=zz))
        if call.present("Accuracy"):
            call["Accuracy"] = 100.0


def _common_point(call: Call, places: Sequence[tuple[Array, Array]]) -> tuple[Array, Array, Array]:
    """The point of tool0 that is in one place at all positions, that place, and the distances from it [mm]."""
    rows = np.concatenate([np.hstack([rotation, -np.eye(3)]) for _, rotation in places])
    wanted = -np.concatenate([point for point, _ in places])
    solution, _, rank, values = np.linalg.lstsq(rows, wanted, rcond=_LOWEST_RATIO)
    if rank < 6 or values[-1] < _LOWEST_RATIO * values[0]:
        sentence = f"{call.name}: the four positions have to differ more in their orientations."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    tip, place = solution[:3], solution[3:]
    errors = np.array([np.linalg.norm(point + rotation @ tip - place) for point, rotation in places])
    return tip, place, errors


def _axes(call: Call, z: Array, x: Array) -> Any:
    """The orientation with the z axis in a direction, and x as near to another one as that allows."""
    length = float(np.linalg.norm(z))
    if length < _SHORTEST_MM:
        raise RapidRuntimeError("ERR_FRAME", f"{call.name}: ZPos has to be away from RefTip.")
    z = z / length
    x = x - z * (z @ x)
    if float(np.linalg.norm(x)) < _SHORTEST_MM:
        if call.present("XPos"):
            raise RapidRuntimeError("ERR_FRAME", f"{call.name}: XPos has to be away from RefTip and the z axis.")
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
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle)[2]
    flat = (points - middle) @ axes[:2].T
    equations = np.column_stack([2.0 * flat, np.ones(len(points))])
    if np.linalg.matrix_rank(equations, tol=_SHORTEST_MM) < 3:
        raise RapidRuntimeError("ERR_FRAME", f"{call.name}: the targets are in a line, or too near to each other.")
    x, y, rest = np.linalg.lstsq(equations, (flat**2).sum(axis=1), rcond=None)[0]
    centre, normal = middle + x * axes[0] + y * axes[1], axes[2]
    normal = normal if sense(centre, normal) >= 0.0 else -normal
    errors = np.hypot(
        np.hypot(flat[:, 0] - x, flat[:, 1] - y) - np.sqrt(rest + x * x + y * y), (points - middle) @ normal
    )
    call["MaxErr"], call["MeanErr"] = float(errors.max()), float(errors.mean())
    return tuple(centre.tolist()), _axes(call, normal, points[0] - centre)


def add_calibration(library: Library, motion: MotionInstructions) -> None:
    """Register the calibrations of one task."""
    own = CalibrationInstructions(motion)
    errors = "INOUT num MaxErr, INOUT num MeanErr"
    for prefix, kind, point, rotation in (
        ("M", "jointtarget", own.moving_tool_point, own.moving_tool_rotation),
        ("S", "robtarget", own.fixed_tool_point, own.fixed_tool_rotation),
    ):
        four = ", ".join(f"{kind} Pos{number}" for number in range(1, 5))
        library.instruction(f"{prefix}ToolTCPCalib", f"{four}, INOUT tooldata Tool, {errors}")(point)
        library.instruction(f"{prefix}ToolRotCalib", rf"{kind} RefTip, {kind} ZPos, \{kind} XPos, INOUT tooldata Tool")(
            rotation
        )
    targets = "robtarget TargetList{*}, num TargetsInList"
    library.function("CalcRotAxFrameZ", f"{targets}, robtarget PositiveZPoint, {errors}", "pose")(own.axis_frame)
    library.function("CalcRotAxisFrame", rf"mecunit MechUnit, \num AxisNo, {targets}, {errors}", "pose")(
        own.unit_axis_frame
    )
    library.function("ParIdRobValid", r"paridnum ParIdType, \mecunit MechUnit, \num AxisNo", "paridvalidnum")(
        own.can_identify
    )
    library.function(
        "ParIdPosValid", r"paridnum ParIdType, jointtarget Pos, INOUT bool AxValid{*}, \num ConfAngle", "bool"
    )(own.can_identify_here)
    library.instruction(
        "LoadId",
        r"paridnum ParIdType, loadidnum LoadIdType, INOUT tooldata Tool, \INOUT loaddata PayLoad, "
        r"\INOUT wobjdata WObj, \num ConfAngle, \switch SlowTest, \INOUT num Accuracy",
    )(own.identify)
    library.refused(
        "ManLoadIdProc",
        r"\paridnum ParIdType, \mecunit MechUnit | \string MechUnitName, \num AxisNumber, \INOUT loaddata PayLoad, "
        r"\num ConfigAngle, \switch DeactAll | \switch AlreadyActive, \PERS bool DefinedFlag, \switch DoExit",
        "ERR_LOADID_FATAL",
        "no positioner is connected whose load could be identified.",
    )


MOST_CHANNELS = 12
_LENGTH_OF_PATH = "length of the path"
_STANDING = 1e-4  # [rad/s]: an axis that is slower does not move

# The signals that ABB names, and those of joints that public programs use.
_TEST_SIGNALS = {
    "resolver_angle": 1,
    "speed_ref": 4,
    "speed": 6,
    "torque_ref": 9,
    "dig_input1": 102,
    "dig_input2": 103,
}
_POSITION, _SPEED, _TORQUE, _EXTERNAL_TORQUE = 4000, 4001, 4002, 4003


@dataclass(slots=True)
class Channel:
    """A test signal: its values of the last sample time, whose mean is read."""

    read: Callable[[], float]
    sample_time: float
    values: deque[tuple[float, float]] = field(default_factory=deque)


class MeasurementInstructions:
    """The measurements of one task.

    Gear ratios are not published: what ABB measures at a motor is that of its joint here.
    """

    def __init__(self, unit: ArmUnit, robots: Sequence[ArmUnit] = ()) -> None:
        self._unit = unit
        self._robots = robots
        self._dynamics: dict[Side, ArmDynamics] = {}
        self._channels: dict[int, Channel] = {}
        self._moved: tuple[float, ...] = ()  # of each axis since it was reset [rad], (7,) in chain order
        self._moving_time: tuple[float, ...] = ()  # [s]
        self._observed_at = 0.0
        self._observed: Joints | None = None
        self._way = 0.0  # of the tool's point [m]
        self._tip: Pose | None = None

    # Joints -------------------------------------------------------------------------------------------------------

    def _axis(self, call: Call, name: str) -> int:
        """Index in chain order of an axis in ABB's numbering."""
        number, count = call[name], self._unit.arm.kinematics.joint_count
        if number != int(number) or not 1 <= number <= count:
            raise RapidRuntimeError(
                "ERR_AXIS_PAR", f"{call.name}: the robot has the axes 1 to {count}, not {number:g}."
            )
        if count < JOINT_COUNT:
            return int(number) - 1
        robax, eax_a = abb_from_chain((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
        return int((*robax, eax_a)[int(number) - 1])

    def _named(self, call: Call, name: str = "MechUnit") -> ArmUnit:
        """The arm whose mechanical unit the call names, the task's own without one."""
        return unit_of(call[name].name, self._unit, self._robots) if call.present(name) else self._unit

    def _torque(self, call: Call, index: int, unit: ArmUnit) -> float:
        arm = unit.arm
        if not arm.kinematics.is_of_yumi:
            raise RapidRuntimeError("ERR_AXIS_PAR", f"{call.name}: the torques of this robot are not known.")
        if unit.side not in self._dynamics:
            self._dynamics[unit.side] = unit.dynamics
        return self._dynamics[unit.side].torque(arm.position, arm.velocity)[index]

    def joint_data(self, call: Call) -> None:
        """GetJointData: position [deg], speed [deg/s], torque [N m] and external torque of an axis, which is none."""
        index, unit = self._axis(call, "Axis"), self._named(call)
        arm = unit.arm
        if call.present("Position"):
            call["Position"] = degrees(arm.position[index])
        if call.present("Speed"):
            call["Speed"] = degrees(arm.velocity[index])
        if call.present("Torque"):
            call["Torque"] = self._torque(call, index, unit)
        if call.present("ExtTorque"):
            call["ExtTorque"] = 0.0

    def motor_angle(self, call: Call) -> float:
        """ReadMotor [rad]."""
        return self._named(call, "MecUnit").arm.position[self._axis(call, "Axis")]

    # Test signals -------------------------------------------------------------------------------------------------

    def define_signal(self, call: Call) -> None:
        """TestSignDefine: a signal of an axis on a channel."""
        number, signal, unit = int(call["Channel"]), int(call["SignalId"]), self._named(call)
        arm = unit.arm
        if not 1 <= number <= MOST_CHANNELS:
            raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: there are the channels 1 to {MOST_CHANNELS}.")
        index = self._axis(call, "Axis")
        reads: dict[int, Callable[[], float]] = {
            _TEST_SIGNALS["resolver_angle"]: lambda: arm.position[index],
            _TEST_SIGNALS["speed_ref"]: lambda: arm.velocity[index],
            _TEST_SIGNALS["speed"]: lambda: arm.velocity[index],
            _TEST_SIGNALS["torque_ref"]: lambda: self._torque(call, index, unit),
            _POSITION: lambda: degrees(arm.position[index]),
            _SPEED: lambda: degrees(arm.velocity[index]),
            _TORQUE: lambda: self._torque(call, index, unit),
            _EXTERNAL_TORQUE: lambda: 0.0,
        }
        if signal not in reads:
            known = ", ".join(map(str, reads))
            raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: the virtual arm has the test signals {known}.")
        if signal in (_TEST_SIGNALS["torque_ref"], _TORQUE):
            self._torque(call, index, unit)  # raises here, not in the cycle, where the robot has none
        task = call.task
        self._unit.observers[f"test signals of {task.name}"] = lambda: self._sample(task.now)
        self._channels[number] = Channel(reads[signal], call["SampleTime"])

    def _sample(self, now: float) -> None:
        for channel in self._channels.values():
            channel.values.append((now, channel.read()))
            while now - channel.values[0][0] > channel.sample_time:
                channel.values.popleft()

    def read_signal(self, call: Call) -> float:
        """TestSignRead: the mean over the sample time; 0 of a channel that has no signal."""
        channel = self._channels.get(int(call["Channel"]))
        if channel is None:
            return 0.0
        values = [value for _, value in channel.values] or [channel.read()]
        return sum(values) / len(values)

    def reset_signals(self, call: Call) -> None:
        """TestSignReset."""
        self._channels.clear()
        self._unit.observers.pop(f"test signals of {call.task.name}", None)

    # Counters -----------------------------------------------------------------------------------------------------

    def _count(self, now: float) -> None:
        """Follow how far and how long the axes move."""
        position, before = self._unit.arm.position, self._observed
        dt, self._observed, self._observed_at = now - self._observed_at, position, now
        if before is None or dt <= 0.0:
            return
        steps = [abs(a - b) for a, b in zip(position, before, strict=True)]
        self._moved = tuple(total + step for total, step in zip(self._moved, steps, strict=True))
        self._moving_time = tuple(
            total + (dt if step > _STANDING * dt else 0.0) for total, step in zip(self._moving_time, steps, strict=True)
        )

    def _counting(self, call: Call) -> int:
        """The axis of a call, whose counters run from the first call on."""
        index = self._axis(call, "AxisNo")
        if not self._moved:
            self._moved = self._moving_time = (0.0,) * self._unit.arm.kinematics.joint_count
            self._observed, self._observed_at = self._unit.arm.position, call.task.now
            task = call.task
            self._unit.observers[f"counters of axes of {task.name}"] = lambda: self._count(task.now)
        return index

    def axis_distance(self, call: Call) -> float:
        """GetAxisDistance: how far an axis has turned since it was reset [deg]."""
        index = self._counting(call)
        return degrees(self._moved[index])

    def axis_time(self, call: Call) -> float:
        """GetAxisMoveTime: how long it has moved [s]."""
        index = self._counting(call)
        return self._moving_time[index]

    def reset_distance(self, call: Call) -> None:
        """ResetAxisDistance."""
        index = self._counting(call)
        self._moved = (*self._moved[:index], 0.0, *self._moved[index + 1 :])

    def reset_time(self, call: Call) -> None:
        """ResetAxisMoveTime."""
        index = self._counting(call)
        self._moving_time = (*self._moving_time[:index], 0.0, *self._moving_time[index + 1 :])

    # The path -----------------------------------------------------------------------------------------------------

    def start_way(self, call: Call) -> None:
        """PathLengthStart."""
        name = f"{_LENGTH_OF_PATH} of {call.task.name}"
        if name not in self._unit.observers:
            self._tip = None
            self._unit.observers[name] = self._measure_way

    def stop_way(self, call: Call) -> None:
        """PathLengthStop."""
        self._unit.observers.pop(f"{_LENGTH_OF_PATH} of {call.task.name}", None)

    def reset_way(self, call: Call) -> None:
        """PathLengthReset."""
        self._way = 0.0

    def way(self, call: Call) -> float:
        """PathLengthGet: how far the tool's point has gone [mm]."""
        return self._way * 1e3

    def _measure_way(self) -> None:
        unit, before = self._unit, self._tip
        tip = unit.arm.kinematics.tool0(unit.arm.planned)
        if unit.tool is not None:
            tip = compose(tip, pose_from_rapid(unit.tool.tframe))
        self._tip = tip
        if before is not None:
            self._way += dist(before.position, tip.position)


def add_measurements(library: Library, unit: ArmUnit, robots: Sequence[ArmUnit] = ()) -> None:
    """Register the measurements of one task; ``robots`` are those of all tasks."""
    own = MeasurementInstructions(unit, robots)
    library.alias("testsignal", "num")
    for name, number in _TEST_SIGNALS.items():
        library.data(name, "testsignal", float(number))
    axis = r"\mecunit MechUnit, num AxisNo"
    instructions: tuple[tuple[str, str, Callable[[Call], Any]], ...] = (
        (
            "GetJointData",
            r"\mecunit MechUnit, num Axis, \VAR num Position, \VAR num Speed, \VAR num Torque, \VAR num ExtTorque",
            own.joint_data,
        ),
        (
            "TestSignDefine",
            "num Channel, testsignal SignalId, mecunit MechUnit, num Axis, num SampleTime",
            own.define_signal,
        ),
        ("TestSignReset", "", own.reset_signals),
        ("ResetAxisDistance", axis, own.reset_distance),
        ("ResetAxisMoveTime", axis, own.reset_time),
        ("PathLengthStart", "", own.start_way),
        ("PathLengthStop", "", own.stop_way),
        ("PathLengthReset", "", own.reset_way),
    )
    for name, signature, implementation in instructions:
        library.instruction(name, signature)(implementation)
    functions: tuple[tuple[str, str, Callable[[Call], Any]], ...] = (
        ("ReadMotor", r"\mecunit MecUnit, num Axis", own.motor_angle),
        ("TestSignRead", "num Channel", own.read_signal),
        ("GetAxisDistance", axis, own.axis_distance),
        ("GetAxisMoveTime", axis, own.axis_time),
        ("PathLengthGet", "", own.way),
    )
    for name, signature, implementation in functions:
        library.function(name, signature, "num")(implementation)
