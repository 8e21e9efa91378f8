"""RAPID's motion instructions: joint motions, where the arm is, waiting for it."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf, radians
from typing import Any

from yumi.errors import CommandRefused, RobotNotReady
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library, Wait
from yumi.robot.joints import Joints
from yumi.virtual.controller.units import ArmUnit
from yumi.virtual.instructions.data import (
    chain_from_jointtarget,
    jointtarget,
    pose_from_rapid,
    robtarget,
    wobj_from_rapid,
)

SpeedRatio = Callable[[], float]

_SPEED = r"speeddata Speed, \num V | \num T, zonedata Zone, \num Z, \num Inpos"
_FRAMES = r"tooldata Tool, \wobjdata WObj, \loaddata TLoad"
_READ_FRAMES = r"\tooldata Tool, \wobjdata WObj"
_SLOWEST = 0.01  # a speed ratio of 0 is a very low speed


class MotionInstructions:
    """The motion instructions of one task."""

    def __init__(self, unit: ArmUnit, speed_ratio: SpeedRatio) -> None:
        self._unit = unit
        self._speed_ratio = speed_ratio
        self._moved_at = -1.0  # task time [s]

    def move_abs_j(self, call: Call) -> Wait:
        """MoveAbsJ: done when the arm stands at the target, also after a stop and restart in between.

        A motion of no length ends at once, but only one in a cycle: a loop of them leaves time to other tasks.
        """
        arm = self._unit.arm
        target = chain_from_jointtarget(call["ToJointPos"], arm.planned, arm.model.limits)
        self._unit.tool = call["Tool"]
        self._unit.wobj = call.get("WObj")
        self._begin(call, target)
        try:
            if self._moved_at == call.task.now:
                yield None
            while not (arm.is_stationary and arm.planned == target):
                if arm.is_stationary:
                    self._begin(call, target)
                yield None
        except GeneratorExit:
            arm.stop()
            raise
        self._unit.has_moved = True
        self._moved_at = call.task.now

    def refuse(self, call: Call) -> None:
        """Cartesian motions need inverse kinematics, which the virtual controller does not have."""
        raise RapidRuntimeError(
            "ERR_ROBLIMIT",
            f"{call.name} needs inverse kinematics, which this virtual controller does not have: use MoveAbsJ.",
        )

    def wait_rob(self, call: Call) -> Wait:
        """WaitRob: until the arm stands."""
        while not self._unit.arm.is_stationary:
            yield None

    def joint_target(self, call: Call) -> Any:
        """CJointT: where the joints are."""
        return jointtarget(self._unit.arm.position)

    def robot_target(self, call: Call) -> Any:
        """CRobT: where the tool is."""
        tool = pose_from_rapid(call.get("Tool", self.tool(call)).tframe)
        wobj = wobj_from_rapid(call.get("WObj", self.wobj(call)))
        return robtarget(self._unit.side, self._unit.arm.position, tool, wobj)

    def tool(self, call: Call) -> Any:
        """CTool: the tool of the last motion."""
        return self._unit.tool or _predefined(call, "tool0")

    def wobj(self, call: Call) -> Any:
        """CWObj: the work object of the last motion."""
        return self._unit.wobj or _predefined(call, "wobj0")

    def _begin(self, call: Call, target: Joints) -> None:
        """Start towards the target at the programmed speed times the override.

        Raises:
            RapidRuntimeError: ERR_ROBLIMIT when the target is out of range; the arm cannot be moved.
        """
        ratio = max(self._speed_ratio() / 100.0, _SLOWEST)
        speed = call["Speed"]
        try:
            self._unit.arm.move_to(
                target,
                tool_speed=call.get("V", speed.v_tcp) * 1e-3 * ratio or inf,
                turn_speed=radians(speed.v_ori) * ratio or inf,
                duration=call.get("T", 0.0),
                tool=pose_from_rapid(call["Tool"].tframe),
            )
        except CommandRefused as error:
            raise RapidRuntimeError("ERR_ROBLIMIT", str(error)) from error
        except RobotNotReady as error:
            raise RapidRuntimeError("ERR_PATH_STOP", str(error)) from error


def normalized(call: Call) -> Any:
    """NOrient: the quaternion at length 1, which a cfg file's six digits may miss."""
    rotation = call["Rotation"]
    length = hypot(*rotation)
    if length == 0.0:
        raise RapidRuntimeError("ERR_ILLQUAT", "NOrient: the orientation [0,0,0,0] has no direction.")
    return tuple(part / length for part in rotation)


def forbid_motion(library: Library) -> None:
    """Let the motion instructions of a task without mechanical units be refused, as RAPID does."""

    def refuse(call: Call) -> None:
        sentence = f"{call.name} moves a robot, which the task {call.task.name} may not (MotionTask in CAB_TASKS)."
        raise RapidRuntimeError("ERR_NOT_MOVETASK", sentence)

    library.replace_implementations(("MoveAbsJ", "MoveJ", "MoveL", "MoveC", "WaitRob"), refuse)


def _predefined(call: Call, name: str) -> Any:
    datum = call.task.library.datum(name)
    assert datum is not None, f"RAPID predefines {name}"
    return datum.value


def add_motion(library: Library, unit: ArmUnit, speed_ratio: SpeedRatio) -> None:
    """Register the motion instructions of one task."""
    motion = MotionInstructions(unit, speed_ratio)
    targets = rf"\switch Conc, {{}}, \num ID, \switch NoEOffs, {_SPEED}, {_FRAMES}"
    library.instruction("MoveAbsJ", targets.format("jointtarget ToJointPos"))(motion.move_abs_j)
    for name in ("MoveJ", "MoveL"):
        library.instruction(name, targets.format("robtarget ToPoint"))(motion.refuse)
    library.instruction("MoveC", targets.format("robtarget CirPoint, robtarget ToPoint"))(motion.refuse)
    library.instruction("WaitRob", r"\switch InPos | \switch ZeroSpeed")(motion.wait_rob)
    library.function("CJointT", "", "jointtarget")(motion.joint_target)
    library.function("CRobT", _READ_FRAMES, "robtarget")(motion.robot_target)
    library.function("CTool", "", "tooldata")(motion.tool)
    library.function("CWObj", "", "wobjdata")(motion.wobj)
    library.function("NOrient", "orient Rotation", "orient")(normalized)
