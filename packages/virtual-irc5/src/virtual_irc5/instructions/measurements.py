"""RAPID's measurements of one arm: joint data, torques, test signals, counters of axes, the length of the path."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import degrees, dist

from abb_protocols.robot.joints import Joints, Pose, Side
from abb_protocols.robot.kinematics import compose_poses
from virtual_irc5.instructions.robot_data import ROBOT_DATA, axis_index, pose_from_rapid
from virtual_irc5.mechanics.dynamics import ArmDynamics
from virtual_irc5.mechanics.units import ArmUnit, unit_of
from virtual_irc5.rapid import Call, Library

_MOST_CHANNELS = 12
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
class SampledSignal:
    """A test signal: its values of the last sample time, whose mean is read."""

    read: Callable[[], float]
    sample_time: float
    values: deque[tuple[float, float]] = field(default_factory=deque)


MEASUREMENTS = Library(ROBOT_DATA)
MEASUREMENTS.alias("testsignal", "num")
for _name, _number in _TEST_SIGNALS.items():
    MEASUREMENTS.data(_name, "testsignal", float(_number))
_AXIS = r"\mecunit MechUnit, num AxisNo"


class MeasurementInstructions:
    """The measurements of one task.

    Gear ratios are not published: what ABB measures at a motor is that of its joint here.
    """

    def __init__(self, unit: ArmUnit, robots: Sequence[ArmUnit]) -> None:
        self._unit = unit
        self._robots = robots
        self._dynamics: dict[Side, ArmDynamics] = {}
        self._channels: dict[int, SampledSignal] = {}
        self._moved: list[float] = []  # of each axis since it was reset [rad], (7,) in chain order
        self._moving_time: list[float] = []  # [s]
        self._observed_at = 0.0
        self._observed: Joints | None = None
        self._way = 0.0  # of the tool's point [m]
        self._tip: Pose | None = None

    # Joints -------------------------------------------------------------------------------------------------------

    def _axis(self, call: Call, name: str) -> int:
        """Index in chain order of an axis in ABB's numbering."""
        return axis_index(call, name, self._unit.arm.kinematics)

    def _named(self, call: Call, name: str = "MechUnit") -> ArmUnit:
        """The arm whose mechanical unit the call names, the task's own without one."""
        return unit_of(call[name].name, self._unit, self._robots) if call.present(name) else self._unit

    def _dynamics_of(self, call: Call, unit: ArmUnit) -> ArmDynamics:
        if not unit.arm.kinematics.is_of_yumi:
            raise call.error("ERR_AXIS_PAR", "the torques of this robot are not known.")
        if unit.side not in self._dynamics:
            self._dynamics[unit.side] = unit.dynamics
        return self._dynamics[unit.side]

    def _torque(self, call: Call, index: int, unit: ArmUnit) -> float:
        return self._dynamics_of(call, unit).torque(unit.arm.position, unit.arm.velocity)[index]

    @MEASUREMENTS.function("GetMotorTorque", r"\mecunit MecUnit, num AxisNo", "num")
    def motor_torque(self, call: Call) -> float:
        """Of an axis [N m]: what holds the arm where it is.

        RAPID reference manual: of the motor; gear ratios are not published, so that it is that of the joint.
        """
        unit = self._named(call, "MecUnit")
        return self._dynamics_of(call, unit).torque(unit.arm.position)[self._axis(call, "AxisNo")]

    @MEASUREMENTS.instruction(
        "GetJointData",
        r"\mecunit MechUnit, num Axis, \VAR num Position, \VAR num Speed, \VAR num Torque, \VAR num ExtTorque",
    )
    def joint_data(self, call: Call) -> None:
        """Position [deg], speed [deg/s], torque [N m] and external torque of an axis, which is none."""
        index, unit = self._axis(call, "Axis"), self._named(call)
        arm = unit.arm
        call.give("Position", degrees(arm.position[index]))
        call.give("Speed", degrees(arm.velocity[index]))
        if call.present("Torque"):
            call["Torque"] = self._torque(call, index, unit)
        call.give("ExtTorque", 0.0)

    @MEASUREMENTS.function("ReadMotor", r"\mecunit MecUnit, num Axis", "num")
    def motor_angle(self, call: Call) -> float:
        """ReadMotor [rad]."""
        return self._named(call, "MecUnit").arm.position[self._axis(call, "Axis")]

    # Test signals -------------------------------------------------------------------------------------------------

    @MEASUREMENTS.instruction(
        "TestSignDefine", "num Channel, testsignal SignalId, mecunit MechUnit, num Axis, num SampleTime"
    )
    def define_signal(self, call: Call) -> None:
        """A signal of an axis on a channel."""
        number, signal, unit = int(call["Channel"]), int(call["SignalId"]), self._named(call)
        arm = unit.arm
        if not 1 <= number <= _MOST_CHANNELS:
            raise call.error("ERR_ARGVALERR", f"there are the channels 1 to {_MOST_CHANNELS}.")
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
            raise call.error("ERR_ARGVALERR", f"the virtual arm has the test signals {known}.")
        if signal in (_TEST_SIGNALS["torque_ref"], _TORQUE):
            self._torque(call, index, unit)  # raises here, not in the cycle, where the robot has none
        task = call.task
        self._unit.observers[f"test signals of {task.name}"] = lambda: self._sample(task.now)
        self._channels[number] = SampledSignal(reads[signal], call["SampleTime"])

    def _sample(self, now: float) -> None:
        for channel in self._channels.values():
            channel.values.append((now, channel.read()))
            while now - channel.values[0][0] > channel.sample_time:
                channel.values.popleft()

    @MEASUREMENTS.function("TestSignRead", "num Channel", "num")
    def read_signal(self, call: Call) -> float:
        """The mean over the sample time; 0 of a channel that has no signal."""
        channel = self._channels.get(int(call["Channel"]))
        if channel is None:
            return 0.0
        values = [value for _, value in channel.values] or [channel.read()]
        return sum(values) / len(values)

    @MEASUREMENTS.instruction("TestSignReset")
    def reset_signals(self, call: Call) -> None:
        self._channels.clear()
        self._unit.observers.pop(f"test signals of {call.task.name}", None)

    # Counters -----------------------------------------------------------------------------------------------------

    def _count(self, now: float) -> None:
        """Follow how far and how long the axes move."""
        position, before = self._unit.arm.position, self._observed
        dt, self._observed, self._observed_at = now - self._observed_at, position, now
        if before is None or dt <= 0.0:
            return
        for axis, (a, b) in enumerate(zip(position, before, strict=True)):
            self._moved[axis] += abs(a - b)
            self._moving_time[axis] += dt if abs(a - b) > _STANDING * dt else 0.0

    def _counting(self, call: Call) -> int:
        """The axis of a call, whose counters run from the first call on."""
        index = self._axis(call, "AxisNo")
        if not self._moved:
            for totals in (self._moved, self._moving_time):
                totals.extend([0.0] * self._unit.arm.kinematics.joint_count)
            self._observed, self._observed_at = self._unit.arm.position, call.task.now
            task = call.task
            self._unit.observers[f"counters of axes of {task.name}"] = lambda: self._count(task.now)
        return index

    @MEASUREMENTS.function("GetAxisDistance", _AXIS, "num")
    def axis_distance(self, call: Call) -> float:
        """How far an axis has turned since it was reset [deg]."""
        return degrees(self._moved[self._counting(call)])

    @MEASUREMENTS.function("GetAxisMoveTime", _AXIS, "num")
    def axis_time(self, call: Call) -> float:
        """How long it has moved [s]."""
        return self._moving_time[self._counting(call)]

    @MEASUREMENTS.instruction("ResetAxisDistance", _AXIS)
    def reset_distance(self, call: Call) -> None:
        self._moved[self._counting(call)] = 0.0

    @MEASUREMENTS.instruction("ResetAxisMoveTime", _AXIS)
    def reset_time(self, call: Call) -> None:
        self._moving_time[self._counting(call)] = 0.0

    # The path -----------------------------------------------------------------------------------------------------

    @MEASUREMENTS.instruction("PathLengthStart")
    def start_way(self, call: Call) -> None:
        name = f"{_LENGTH_OF_PATH} of {call.task.name}"
        if name not in self._unit.observers:
            self._tip = None
            self._unit.observers[name] = self._measure_way

    @MEASUREMENTS.instruction("PathLengthStop")
    def stop_way(self, call: Call) -> None:
        self._unit.observers.pop(f"{_LENGTH_OF_PATH} of {call.task.name}", None)

    @MEASUREMENTS.instruction("PathLengthReset")
    def reset_way(self, call: Call) -> None:
        self._way = 0.0

    @MEASUREMENTS.function("PathLengthGet", "", "num")
    def way(self, call: Call) -> float:
        """How far the tool's point has gone [mm]."""
        return self._way * 1e3

    def _measure_way(self) -> None:
        unit, before = self._unit, self._tip
        tip = unit.arm.kinematics.tool0(unit.arm.planned)
        if unit.tool is not None:
            tip = compose_poses(tip, pose_from_rapid(unit.tool.tframe))
        self._tip = tip
        if before is not None:
            self._way += dist(before.position, tip.position)
