"""``/rw/motionsystem``: mechanical units, their positions, and calculations with them (reference/rws.md §8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np

from yumi.errors import CommandRefused, ProtocolError, RobotNotReady
from yumi.rapid.types import Variable
from yumi.robot.arm_kinematics import Arm
from yumi.robot.joints import JOINT_COUNT, Joints, Pose, abb_from_chain, chain_from_abb
from yumi.robot.kinematics import compose, inverse, matrix
from yumi.rws.documents import Link, Page, State, first_value
from yumi.rws.types import Code, Grant, decode
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.units import MechanicalUnit, Supervision
from yumi.virtual.instructions.data import pose_from_rapid, rapid_from_pose, robtarget, wobj_from_rapid
from yumi.virtual.mechanics.arm import VirtualArm
from yumi.virtual.rws.http import entry, resource
from yumi.virtual.rws.operations import Call, Failure, Operation, Values, invalid, refuse_in_manual_mode

_BASE = "/rw/motionsystem/"
_NO_AXIS = 8.9e9  # 9E9 and above in RAPID: not connected
_LETTERS = "abcdef"
_STEPS_DEG = {"Small": 0.005, "Medium": 0.023, "Large": 0.143, "User": 0.5}  # of incremental jogging
_CONTINUOUS_DEG = 2.0  # that an axis is jogged for each request without increments, at full deflection
_FULL = 1000.0  # deflection of the joystick
_UNIT_TOLERANCE = 1e-3  # of the length of a quaternion
_HALL = "Hall Sensor Calibration"
_LEAD_THROUGH = "Leadthrough"
_COORDINATES = ("Base", "Word", "World", "Tool", "Wobj")


def printed(value: float) -> str:
    """A number as the controller prints it: seven digits, 9E+09 for what is not there."""
    return "9E+09" if value > _NO_AXIS else f"{value:.7g}"


def get_motion_system(controller: Irc5, call: Call) -> Page:
    fields = {
        "change-count": str(controller.motion.changes),
        "mechunit-name": _active(controller).name,
        "poll-rate": "500",
        "modal-payload-mode": "ON",
        "absacc-active": "FALSE",
    }
    asked = call.option("resource")
    if asked is not None:
        return resource("motionsystem", "/rw/", "motionsystem", State("ms", "motionsystem", {asked: fields[asked]}))
    links = (
        entry("ms-change-count-li", "checkchangecount", "motionsystem/checkchangecount"),
        entry("ms-mechunit-li", "mechunits", "motionsystem/mechunits"),
        entry("ms-errorstate-li", "errorstate", "motionsystem/errorstate"),
        entry("ms-motionsupervision-li", "motionsupervision", "motionsystem/motionsupervision"),
        entry("ms-pathsupervision-li", "pathsupervision", "motionsystem/pathsupervision"),
        entry("ms-nonmotion-execution-mode-li", "nonmotionexecution", "motionsystem/nonmotionexecution"),
    )
    return resource("motionsystem", "/rw/", "motionsystem", State("ms", "motionsystem", fields), *links)


def _active(controller: Irc5) -> MechanicalUnit:
    name = controller.motion.active_unit
    return next((unit for unit in controller.units if unit.name == name), controller.units[0])


def _unit(controller: Irc5, name: str) -> MechanicalUnit:
    for unit in controller.units:
        if unit.name.upper() == name.upper():
            return unit
    raise Failure(404, Code.NO_SUCH_MECHUNIT, f"there is no mechanical unit {name[:50]}")


def _find(controller: Irc5, call: Call) -> MechanicalUnit:
    return _unit(controller, call.names["unit"])


def _asked_unit(controller: Irc5, call: Call) -> MechanicalUnit:
    return _unit(controller, call.option("mechunit") or _active(controller).name)


def _changed(controller: Irc5) -> None:
    controller.motion.changes += 1


# Jogging


def set_active(controller: Irc5, call: Call) -> None:
    controller.motion.active_unit = _unit(controller, call.required("mechunit-name")).name
    _changed(controller)


def jog(controller: Irc5, call: Call) -> None:
    """Move the axes of the active unit by a step each; the axis values are the deflection of the joystick."""
    _check_jogging(controller, call)
    values = [call.number(f"axis{number}") for number in range(1, 7)]
    if max(map(abs, values)) > _FULL:
        raise invalid(f"an axis is deflected by {-_FULL:.0f} to {_FULL:.0f}")
    if call.number("ccount") != controller.motion.changes:
        raise invalid("ccount is not the change count of the motion system; read it again")
    unit = _active(controller)
    arm = controller.arm_of(unit)
    mode = call.parameter("inc-mode", "")
    steps = [(value > 0) - (value < 0) if mode else value / _FULL for value in values]
    scale = _STEPS_DEG.get(mode, _CONTINUOUS_DEG)
    robax, eax_a = _abb(arm.planned)
    moves = [radians(step * scale) for step in steps]
    if unit.axes == 1:
        target = _chain(arm.kinematics, robax, eax_a + moves[0])
    else:
        target = _chain(arm.kinematics, [at + move for at, move in zip(robax, moves, strict=True)], eax_a)
    _move(arm, target)


def _abb(position: Joints) -> tuple[Sequence[float], float]:
    """RAPID's split, axes 1 to 6 and axis 7, of joint positions; 0 for the axis 7 that a six-axis robot lacks."""
    return (position, 0.0) if len(position) < JOINT_COUNT else abb_from_chain(position)


def _chain(kinematics: Arm, robot: Sequence[float], axis_7: float) -> Joints:
    return tuple(robot) if kinematics.joint_count < JOINT_COUNT else chain_from_abb(robot, axis_7)


def _arm_angle(kinematics: Arm, position: Joints) -> float:
    """The first extra axis of a robtarget [rad]; 0 with six axes."""
    return float(kinematics.angles(np.array([position]))[0])


def _check_jogging(controller: Irc5, call: Call) -> None:
    refuse_in_manual_mode(controller, call, "jogging")
    if controller.is_running:
        raise Failure(403, Code.EXEC_STATE, "an arm is jogged while RAPID is stopped")


def _move(arm: VirtualArm, target: Joints) -> None:
    try:
        arm.move_to(target)
    except CommandRefused as error:
        raise invalid(str(error)) from error
    except RobotNotReady as error:
        raise Failure(403, Code.INVALID_STATE, str(error)) from error


def go_to_position(controller: Irc5, call: Call) -> None:
    """Move the active unit to a robtarget in its base."""
    _check_jogging(controller, call)
    position = [call.number(f"pos-{axis}") * 1e-3 for axis in "xyz"]
    orientation = [call.number(f"orient-q{number}") for number in range(1, 5)]
    for name in ("j1", "j4", "j6", "jx"):
        call.number(f"config-{name}")
    angle = call.number("extjoint-1")
    unit = _active(controller)
    arm = controller.arm_of(unit)
    near = arm.planned
    wanted = _arm_angle(arm.kinematics, near) if angle > _NO_AXIS else radians(angle)
    _move(arm, _nearest(arm.kinematics, _pose(position, orientation), wanted, near))


def _pose(position: list[float], orientation: list[float]) -> Pose:
    """A pose in metres; raises Failure for an orientation that is no unit quaternion."""
    length = sum(value * value for value in orientation) ** 0.5
    if abs(length - 1.0) > _UNIT_TOLERANCE:
        raise invalid("the orientation is not a unit quaternion")
    (x, y, z), (w, i, j, k) = position, (value / length for value in orientation)
    return Pose((x, y, z), (w, i, j, k))


def _nearest(kinematics: Arm, pose: Pose, angle: float, near: Joints) -> Joints:
    """The posture of a pose that is nearest to another one: of its branch, or any where that does not reach it."""
    followed = kinematics.reached(np.array([pose.position]), matrix(pose.orientation)[None], angle, near)
    found = kinematics.postures(pose, angle) if followed is None else (followed,)
    if not found:
        raise Failure(400, Code.POSE_OUTSIDE_REACH, f"the {kinematics.name} does not reach the pose")
    return min(found, key=lambda each: max(abs(a - b) for a, b in zip(each, near, strict=True)))


# State and supervision


def get_change_count(controller: Irc5, call: Call) -> Page:
    has_changed = call.number_option("changecount", 0) != controller.motion.changes
    fields = {"changestate": "TRUE" if has_changed else "FALSE"}
    return resource("motionsystem", _BASE, "checkchangecount", State("ms-change-count", "checkchangecount", fields))


def get_error_state(controller: Irc5, call: Call) -> Page:
    state = State("ms-errorstate", "errorstate", {"err-state": "HPJ_OK", "err-count": "0"})
    return resource("motionsystem", _BASE, "errorstate", state)


def _supervision(controller: Irc5, unit: MechanicalUnit) -> Supervision:
    return controller.motion.supervision.setdefault(unit.name, Supervision())


def get_motion_supervision(controller: Irc5, call: Call) -> Page:
    unit = _asked_unit(controller, call)
    found = _supervision(controller, unit)
    fields = {"mode": "TRUE" if found.jogging else "FALSE", "sensitivity": str(found.jog_level)}
    return resource("motionsystem", _BASE, "motionsupervision", State("ms-motionsupervision", unit.name, fields))


def set_motion_supervision(controller: Irc5, call: Call) -> None:
    unit = _unit(controller, call.required("mechunit-name"))
    _supervision(controller, unit).jogging = call.required("mode").lower() == "true"
    _changed(controller)


def set_motion_sensitivity(controller: Irc5, call: Call) -> None:
    unit = _unit(controller, call.required("mechunit-name"))
    _supervision(controller, unit).jog_level = _level(call, "sensitivity")
    _changed(controller)


def _level(call: Call, name: str) -> int:
    level = call.number(name)
    if not 0 <= level <= 300:
        raise invalid(f"{name} is 0 to 300")
    return int(level)


def get_collision_prediction(controller: Irc5, call: Call) -> Page:
    fields = {"mode": str(controller.motion.predicts_collisions).lower()}
    state = State("ms-colpred-mode", "collision-prediction-mode", fields)
    return resource("motionsystem", _BASE, "motionsupervision", state)


def set_collision_prediction(controller: Irc5, call: Call) -> None:
    controller.motion.predicts_collisions = call.required("mode") == "true"
    _changed(controller)


def get_path_supervision(controller: Irc5, call: Call) -> Page:
    unit = _asked_unit(controller, call)
    found = _supervision(controller, unit)
    fields = {"mode": "ON" if found.path else "OFF", "level": str(found.path_level)}
    return resource("motionsystem", _BASE, "pathsupervision", State("ms-pathsupervision", unit.name, fields))


def set_path_supervision(controller: Irc5, call: Call) -> None:
    _supervision(controller, _unit(controller, call.required("mechunit"))).path = call.required("mode") == "ON"
    _changed(controller)


def set_path_level(controller: Irc5, call: Call) -> None:
    _supervision(controller, _unit(controller, call.required("mechunit"))).path_level = _level(call, "level")
    _changed(controller)


def get_non_motion(controller: Irc5, call: Call) -> Page:
    fields = {"mode": "ON" if controller.motion.is_non_motion else "OFF"}
    state = State("ms-nonmotionexecution", "nonmotionexecution", fields)
    return resource("motionsystem", _BASE, "nonmotionexecution", state)


def set_non_motion(controller: Irc5, call: Call) -> None:
    if call.required("mode") == "ON":
        raise Failure(400, Code.NOTIMPL, "this virtual controller always moves its arms")
    controller.motion.is_non_motion = False


# Units


def get_units(controller: Irc5, call: Call) -> Page:
    entries = (
        entry(
            "ms-mechunit-li",
            unit.name,
            f"mechunits/{unit.name}",
            mode=unit.mode,
            activation_allowed="True",
            drive_module=str(unit.drive_module),
        )
        for unit in controller.units
    )
    return resource("motionsystem", _BASE, "mechunits", *entries)


_SUB_RESOURCES = ("pjoints", "robtarget", "jointtarget", "cartesian", "axes", "baseframe", "calibrationinfo", "smbdata")


def get_unit(controller: Irc5, call: Call) -> Page:
    """A unit's fields: all, or the groups and single fields in ``resource``, joined by ``;``."""
    unit = _find(controller, call)
    groups = {
        "static": {
            "task-name": unit.task,
            "type": unit.type,
            "axes": str(unit.axes),
            "axes-total": str(unit.axes_total),
            "is-integrated-unit": unit.is_integrated_unit,
            "has-integrated-unit": unit.has_integrated_unit,
        },
        "dynamic": {
            "tool-name": unit.tool,
            "wobj-name": unit.wobj,
            "payload-name": unit.payload,
            "total-payload-name": unit.total_payload,
            "status": unit.status,
            "mode": unit.mode,
            "jog-mode": unit.jog_mode,
            "coord-system": unit.coord_system,
        },
    }
    asked = (call.option("resource") or "static;dynamic").split(";")
    known = {*groups, *(_short(name) for members in groups.values() for name in members)}
    unknown = [each for each in asked if each not in known and f"{each}-name" not in known]
    if unknown:
        raise invalid(f"a mechanical unit does not have the resource {unknown[0][:50]!r}")
    fields = {
        name: text
        for group, members in groups.items()
        for name, text in members.items()
        if group in asked or name in asked or _short(name) in asked
    }
    links = () if call.option("resource") else tuple(Link(name, f"{unit.name}/{name}") for name in _SUB_RESOURCES)
    state = State("ms-mechunit", unit.name, fields, links)
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, state)


def _short(name: str) -> str:
    return name.removesuffix("-name").removesuffix("-unit")


def set_unit(controller: Irc5, call: Call) -> None:
    """Change what jogging uses: tool, work object, loads, mode and coordinate system."""
    unit = _find(controller, call)
    if not call.form:
        raise invalid("the body lacks tool, wobj, payload, total-payload, mode, jog-mode and coord-system; give one")
    for kind in ("tool", "wobj"):
        if first_value(call.form, kind) is not None:
            _datum(controller, unit, call.required(kind), kind)
    mode = call.parameter("mode", unit.mode)
    if mode == "Deactivated" and unit.type == "TCPRobot":
        raise Failure(400, Code.REJECT, f"the robot {unit.name} cannot be deactivated")
    system = call.parameter("coord-system", unit.coord_system)
    changed = replace(
        unit,
        tool=call.parameter("tool", unit.tool),
        wobj=call.parameter("wobj", unit.wobj),
        payload=call.parameter("payload", unit.payload),
        total_payload=call.parameter("total-payload", unit.total_payload),
        mode=mode,
        jog_mode=call.parameter("jog-mode", unit.jog_mode),
        coord_system="World" if system == "Word" else system,
    )
    controller.units = tuple(changed if each.name == unit.name else each for each in controller.units)
    _changed(controller)


def _led_unit(controller: Irc5, call: Call) -> MechanicalUnit:
    if _LEAD_THROUGH not in controller.identity.options:
        raise Failure(400, Code.OPTION, f"the controller lacks the option {_LEAD_THROUGH}")
    return _find(controller, call)


def get_lead_through(controller: Irc5, call: Call) -> Page:
    unit = _led_unit(controller, call)
    fields = {"status": "active" if unit.name in controller.motion.lead_through else "inactive"}
    state = State("ms-mechunit-complianceleadthrough", unit.name, fields)
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, state)


def set_lead_through(controller: Irc5, call: Call) -> None:
    """Let an arm be led by hand; no hand leads this one, so that it stands still all the same."""
    unit = _led_unit(controller, call)
    if unit.type != "TCPRobot":
        raise invalid(f"{unit.name} is not a robot")
    led = controller.motion.lead_through
    led.add(unit.name) if call.required("status") == "active" else led.discard(unit.name)
    _changed(controller)


def refuse_calibration(controller: Irc5, call: Call) -> None:
    """Calibration changes what the controller takes for the arm's zero; there is nothing to be calibrated here."""
    _find(controller, call)
    if controller.mode.value == "AUTO":
        raise Failure(400, Code.NOT_MANUAL_MODE, "an axis is calibrated in manual mode")
    raise Failure(400, Code.NOTIMPL, "the axes of a virtual robot are always calibrated")


# Positions


def _axis_fields(values: list[float], prefix: str = "eax_") -> dict[str, str]:
    return {f"{prefix}{letter}": printed(value) for letter, value in zip(_LETTERS, values, strict=True)}


def joint_fields(controller: Irc5, unit: str) -> dict[str, str]:
    """The jointtarget of a unit's arm [deg]."""
    robax, extax = controller.joint_target(unit)
    return {f"rax_{axis}": printed(angle) for axis, angle in enumerate(robax, 1)} | _axis_fields(list(extax))


def get_joint_target(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    state = State("ms-jointtarget", unit.name, joint_fields(controller, unit.name))
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "jointtarget", state)


def get_physical_joints(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    state = State("ms-pjoints", unit.name, joint_fields(controller, unit.name))
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "pjoints", state)


def _datum(controller: Irc5, unit: MechanicalUnit, name: str, kind: str) -> Any:
    """The value of a tool or work object of the unit's task, predefined ones too.

    A unit that no task moves has those of the first task.
    """
    program = (controller.tasks.get(unit.task) or next(iter(controller.tasks.values()))).program
    found = program.find(name, None)
    for module in program.modules.values() if found is None else ():
        found = found or module.symbols.get(name.lower())
    type_name = {"tool": "tooldata", "wobj": "wobjdata"}[kind]
    value = found.value if isinstance(found, Variable) else found
    has_type = isinstance(found, Variable) and found.type.name == type_name
    if not has_type:
        code = Code.TOOL_ERROR if kind == "tool" else Code.WOBJ_ERROR
        raise Failure(400, code, f"{unit.task} has no {type_name} {name[:50]}")
    return value


def target_fields(
    controller: Irc5, call: Call, unit: MechanicalUnit
) -> tuple[dict[str, str], tuple[float, ...], tuple[float, ...]]:
    """Position and orientation of a unit's tool as the call asks for them, with configuration and extra axes."""
    tool = pose_from_rapid(_datum(controller, unit, call.option("tool") or unit.tool, "tool").tframe)
    system = call.option("coordinate") or unit.coord_system
    wobj = wobj_from_rapid(_datum(controller, unit, call.option("wobj") or unit.wobj, "wobj"))
    position = controller.arm_of(unit).position
    trans, rot, turns, extra = robtarget(
        controller.arm_of(unit).kinematics, position, tool, wobj if system == "Wobj" else None
    )
    fields = {axis: printed(value) for axis, value in zip("xyz", trans, strict=True)}
    return fields | {f"q{n}": printed(value) for n, value in enumerate(rot, 1)}, turns, extra


def get_robtarget(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    fields, turns, extra = target_fields(controller, call, unit)
    fields |= {name: printed(value) for name, value in zip(("cf1", "cf4", "cf6", "cfx"), turns, strict=True)}
    state = State("ms-robtargets", unit.name, fields | _axis_fields(list(extra)))
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "robtarget", state)


def get_cartesian(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    fields, turns, _ = target_fields(controller, call, unit)
    fields |= {name: printed(value) for name, value in zip(("j1", "j4", "j6", "jx"), turns, strict=True)}
    state = State("ms-mechunit-cartesian", "cartesian", fields)
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "cartesian", state)


def _frame_instance(unit: MechanicalUnit) -> tuple[str, str, str]:
    return "MOC", "ROBOT" if unit.type == "TCPRobot" else "SINGLE", unit.name


def get_base_frame(controller: Irc5, call: Call) -> Page:
    """The base frame in the world [mm], of the system parameters."""
    unit = _find(controller, call)
    instance = controller.effective.find(*_frame_instance(unit))
    given: Mapping[str, str] = instance.attributes if instance else {}
    fields = {axis: printed(1e3 * float(given.get(f"base_frame_pos_{axis}") or 0.0)) for axis in "xyz"}
    for number in range(4):
        default = "1" if number == 0 else "0"
        fields[f"q{number + 1}"] = printed(float(given.get(f"base_frame_orient_u{number}") or default))
    state = State("ms-mechunit-baseframe", unit.name, fields)
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "baseframe", state)


def set_base_frame(controller: Irc5, call: Call) -> None:
    """Change the system parameters of the base frame; they act after a restart."""
    unit = _find(controller, call)
    numbers = [call.number(f"q{number}") for number in range(1, 5)]
    _pose([0.0, 0.0, 0.0], numbers)
    changes = {f"base_frame_pos_{axis}": f"{call.number(axis) * 1e-3:.9g}" for axis in "xyz"}
    changes |= {f"base_frame_orient_u{index}": f"{value:.9g}" for index, value in enumerate(numbers)}
    controller.configuration.change(*_frame_instance(unit), changes)


def get_axes(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    states = [State("ms-mechunit-axes", "axes", {"axes": str(unit.axes)})]
    states += [entry("ms-mechunit-axis-li", str(number), f"axes/{number}") for number in range(1, unit.axes + 1)]
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "axes", *states)


def _axis(controller: Irc5, call: Call) -> tuple[MechanicalUnit, int]:
    unit, text = _find(controller, call), call.names["axis"]
    if text not in map(str, range(1, unit.axes + 1)):
        raise Failure(404, Code.UNRESOLVED_URL, f"{unit.name} has axes 1 to {unit.axes}, not {text[:20]!r}")
    return unit, int(text) if unit.axes > 1 else 7


def get_axis(controller: Irc5, call: Call) -> Page:
    unit, logical = _axis(controller, call)
    number = call.names["axis"]
    fields = {"axisstatus": unit.status, "axispose": number, "logicalaxis": str(logical)}
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/axes/", number, State("ms-axis", number, fields))


def get_axis_pose(controller: Irc5, call: Call) -> Page:
    """Where an axis is: the flange when all axes after it stand at zero, as the kinematic chain counts them."""
    unit, logical = _axis(controller, call)
    arm = controller.arm_of(unit)
    last = arm.kinematics.axes.index(logical)
    position = tuple(angle if index <= last else 0.0 for index, angle in enumerate(arm.position))
    trans, rot = rapid_from_pose(arm.kinematics.tool0(position))
    fields = {axis: printed(value) for axis, value in zip("xyz", trans, strict=True)}
    fields |= {f"q{n}": printed(value) for n, value in enumerate(rot, 1)}
    number = call.names["axis"]
    return resource(
        "motionsystem", f"{_BASE}mechunits/{unit.name}/axes/", number, State("ms-axis-pose", number, fields)
    )


def refuse_axis(controller: Irc5, call: Call) -> None:
    _axis(controller, call)
    refuse_calibration(controller, call)


def set_position(controller: Irc5, call: Call) -> None:
    """Put an arm somewhere while the motors are off; RobotStudio's controllers alone can."""
    _find(controller, call)
    raise Failure(400, Code.SERVICE_NOT_SUPPORTED, "a position is set in RobotStudio's controllers alone")


def get_calibration(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    method = _HALL if _HALL in controller.identity.options else "Undefined"
    head = State(
        "ms-calibrationinfo",
        unit.name,
        {"usecalibrationwindowtype": "0", "noactivejoints": str(unit.axes), "count": str(unit.axes)},
    )
    prefix = unit.name.replace("ROB", "rob", 1).removesuffix("_7")
    states = (
        State(
            "ms-calibrationinfo-joint",
            str(number),
            {
                "calibrationmethodused": method,
                "showaxis": "1",
                "jointname": f"{prefix}_{number if unit.axes > 1 else 7}",
                "factorycalibrationmethod": method,
                "currentcalibrationmethod": method,
            },
        )
        for number in range(1, unit.axes + 1)
    )
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "calibrationinfo", head, *states)


_SMB = ("sis", "abs_acc", "calib", "axis_cal")


def get_smb_data(controller: Irc5, call: Call) -> Page:
    """Controller and robot agree (0, SMB_VALID); there is no absolute accuracy (3, SMB_NOT_USED)."""
    unit = _find(controller, call)
    fields = {
        f"{place}_{kind}_data_status": "3" if kind == "abs_acc" else "0"
        for place in ("controller", "robot")
        for kind in _SMB
    }
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "smbdata", State("ms-smbdata", unit.name, fields))


def get_motor_calibration(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    prefix = unit.name.replace("ROB", "rob", 1).removesuffix("_7")
    numbers = range(1, unit.axes + 1) if unit.axes > 1 else (7,)
    states = (State("ms-motorcalib", f"{prefix}_{number}", {"name": f"{prefix}_{number}"}) for number in numbers)
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "motorcalib", *states)


# Calculations, in metres and radians


def _numbers(call: Call, name: str, count: int) -> list[float]:
    """A parameter ``[1,2,3]`` of a body."""
    text = call.required(name)
    try:
        value = decode(text)
    except ProtocolError as error:
        raise invalid(f"{name} is {count} numbers in brackets, not {text[:50]!r}") from error
    if not isinstance(value, tuple) or len(value) != count or not all(isinstance(each, float) for each in value):
        raise invalid(f"{name} is {count} numbers in brackets, not {text[:50]!r}")
    return [float(each) for each in value if isinstance(each, float)]


def _tool(call: Call) -> Pose:
    return _pose(_numbers(call, "tool_frame_position", 3), _numbers(call, "tool_frame_orientation", 4))


def _given(kinematics: Arm, call: Call, prefix: str = "") -> Joints:
    """The joint positions in a body."""
    robot, extra = _numbers(call, f"{prefix}rob_joints", 6), _numbers(call, f"{prefix}ext_joints", 6)
    return _chain(kinematics, robot, extra[0])


def pose_from_joints(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    kinematics = controller.arm_of(unit).kinematics
    position = _given(kinematics, call)
    pose = compose(kinematics.tool0(position), _tool(call))
    fields = {f"position-{axis}": f"{value:.7g}" for axis, value in zip("xyz", pose.position, strict=True)}
    fields |= {f"robtargetorientation-u{n}": f"{value:.7g}" for n, value in enumerate(pose.orientation)}
    fields |= _turns(kinematics, position)
    fields["extjoint-1"] = f"{_arm_angle(kinematics, position):.7g}"
    state = State("position-from-joint", "positionData", fields)
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, state)


def _turns(kinematics: Arm, position: Joints) -> dict[str, str]:
    numbers = zip(("j1", "j4", "j6", "jx"), kinematics.configuration(position), strict=True)
    return {f"quarter-rev-{name}": str(value) for name, value in numbers}


def _joints_fields(position: Joints) -> dict[str, str]:
    robax, eax_a = _abb(position)
    fields = {f"robotjoint-{n}": f"{value:.7g}" for n, value in enumerate(robax, 1)}
    return fields | {f"extjoint-{n}": f"{value:.7g}" for n, value in enumerate((eax_a, *(0.0,) * 5), 1)}


def _wanted(call: Call) -> tuple[Pose, float, list[float]]:
    """Pose of tool0 in the body, arm angle, and configuration of a calculation."""
    pose = _pose(_numbers(call, "curr_position", 3), _numbers(call, "curr_orientation", 4))
    extra = _numbers(call, "curr_ext_joints", 6)
    return compose(pose, inverse(_tool(call))), extra[0], _numbers(call, "robot_configuration", 4)


def joints_from_pose(controller: Irc5, call: Call) -> Page:
    """The posture nearest to the old one; the first extra axis of the pose is the arm angle."""
    unit = _find(controller, call)
    kinematics = controller.arm_of(unit).kinematics
    pose, angle, _ = _wanted(call)
    near = _given(kinematics, call, "old_")
    outside = kinematics.limits.outside(near)
    if outside is not None:
        number = f"{outside + 1} of {kinematics.joint_count}"
        raise invalid(f"old_rob_joints and old_ext_joints are outside of the range of joint {number}")
    state = State("joints-from-position", "jointData", _joints_fields(_nearest(kinematics, pose, angle, near)))
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, state)


def all_solutions(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    kinematics = controller.arm_of(unit).kinematics
    pose, angle, _ = _wanted(call)
    states = (
        State("all-joint-solutions", f"solution{number}", _joints_fields(each) | _turns(kinematics, each))
        for number, each in enumerate(kinematics.postures(pose, angle), 1)
    )
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, *states)


_UNIT = "/rw/motionsystem/mechunits/{unit}"
_AXIS = f"{_UNIT}/axes/{{axis}}"
_SUPERVISION = "/rw/motionsystem/motionsupervision"
_PATH_SUPERVISION = "/rw/motionsystem/pathsupervision"
_NON_MOTION = "/rw/motionsystem/nonmotionexecution"
_FRAME: Values = dict.fromkeys(("x", "y", "z", "q1", "q2", "q3", "q4"), ())
_TRUTH = ("TRUE", "FALSE", "true", "false")
_FORWARD: Values = {
    **dict.fromkeys(("tool_frame_position", "tool_frame_orientation", "rob_joints", "ext_joints"), ()),
    "robot_fixed_object": _TRUTH,
    "elog_at_error": _TRUTH,
}
_ALL: Values = {
    **dict.fromkeys(("curr_position", "curr_ext_joints", "tool_frame_position", "curr_orientation"), ()),
    **dict.fromkeys(("tool_frame_orientation", "robot_configuration"), ()),
    "robot_fixed_object": _TRUTH,
}
_INVERSE: Values = {**_ALL, "old_rob_joints": (), "old_ext_joints": (), "elog_at_error": _TRUTH}
_TARGET: Values = {"tool": (), "wobj": (), "coordinate": _COORDINATES}
_POSITION: Values = dict.fromkeys(
    (
        *(f"pos-{axis}" for axis in "xyz"),
        *(f"orient-q{number}" for number in range(1, 5)),
        *(f"config-{name}" for name in ("j1", "j4", "j6", "jx")),
        *(f"extjoint-{number}" for number in range(1, 7)),
    ),
    (),
)
_SET: Values = {
    **dict.fromkeys(("tool", "wobj", "payload", "total-payload"), ()),
    "mode": ("Activated", "Deactivated"),
    "jog-mode": ("AxisGroup1", "AxisGroup2", "Align", "GoToPos", "ConfigurationJog", "Cartesian"),
    "coord-system": ("Wobj", "Base", "Tool", "Word", "World"),
}
_JOG: Values = {**{f"axis{n}": () for n in range(1, 7)}, "ccount": (), "inc-mode": tuple(_STEPS_DEG)}
_FIELDS = ("modal-payload-mode", "absacc-active", "poll-rate", "change-count", "mechunit-name")
OPERATIONS = (
    Operation("GET", "/rw/motionsystem", get_motion_system, query={"resource": _FIELDS, "continue-on-err": ("0", "1")}),
    Operation(
        "POST", "/rw/motionsystem", set_active, "set-mechunit", {"mechunit-name": ()}, respects_mastership="motion"
    ),
    Operation("POST", "/rw/motionsystem", jog, "jog", _JOG, needs_mastership="motion"),
    Operation("POST", "/rw/motionsystem", go_to_position, "positiontarget", _POSITION, needs_mastership="motion"),
    Operation("POST", "/rw/motionsystem", go_to_position, "set-target", _POSITION, needs_mastership="motion"),
    Operation("GET", "/rw/motionsystem/checkchangecount", get_change_count, query={"changecount": ()}),
    Operation("GET", "/rw/motionsystem/errorstate", get_error_state),
    Operation("GET", _SUPERVISION, get_motion_supervision, query={"mechunit": ()}),
    Operation("GET", _SUPERVISION, get_collision_prediction, "collision-prediction-mode"),
    Operation(
        "POST",
        _SUPERVISION,
        set_motion_supervision,
        "set-mode",
        {"mechunit-name": (), "mode": ("True", "False", *_TRUTH)},
        respects_mastership="motion",
    ),
    Operation(
        "POST",
        _SUPERVISION,
        set_motion_sensitivity,
        "set-level",
        {"mechunit-name": (), "sensitivity": ()},
        respects_mastership="motion",
    ),
    Operation(
        "POST",
        _SUPERVISION,
        set_collision_prediction,
        "set-colpred-mode",
        {"mode": ("true", "false")},
        respects_mastership="motion",
    ),
    Operation("GET", _PATH_SUPERVISION, get_path_supervision, query={"mechunit": ()}),
    Operation(
        "POST",
        _PATH_SUPERVISION,
        set_path_supervision,
        "set-mode",
        {"mechunit": (), "mode": ("ON", "OFF")},
        respects_mastership="motion",
    ),
    Operation(
        "POST",
        _PATH_SUPERVISION,
        set_path_level,
        "set-level",
        {"mechunit": (), "level": ()},
        respects_mastership="motion",
    ),
    Operation("GET", _NON_MOTION, get_non_motion),
    Operation(
        "POST",
        _NON_MOTION,
        set_non_motion,
        "set-mode",
        {"mode": ("ON", "OFF")},
        respects_mastership="motion",
        needs_grant=Grant.RAPID_DEBUG,
    ),
    Operation(
        "POST",
        _NON_MOTION,
        set_non_motion,
        "set",
        {"mode": ("ON", "OFF")},
        respects_mastership="motion",
        needs_grant=Grant.RAPID_DEBUG,
    ),
    Operation("GET", "/rw/motionsystem/mechunits", get_units),
    Operation("GET", _UNIT, get_unit, query={"resource": (), "continue-on-err": ("0", "1")}),
    Operation("GET", _UNIT, get_lead_through, resource="lead-through"),
    Operation("POST", _UNIT, set_unit, "set", _SET, respects_mastership="motion"),
    Operation(
        "POST",
        _UNIT,
        set_lead_through,
        "set-lead-through",
        {"status": ("active", "inactive")},
        respects_mastership="motion",
    ),
    Operation(
        "POST", _UNIT, refuse_calibration, "fine-calibrate", {"axis": ()}, status=400, needs_grant=Grant.CALIBRATE
    ),
    Operation(
        "POST",
        _UNIT,
        refuse_calibration,
        "update-revcounter",
        {"axis": ()},
        status=400,
        needs_grant=Grant.REVOLUTION_COUNTER_UPDATE,
    ),
    Operation("POST", _UNIT, set_position, "mechunit-position", {"rob_joint": (), "ext_joint": ()}, status=400),
    Operation("POST", _UNIT, pose_from_joints, "CalcPoseFromJoints", _FORWARD, status=200),
    Operation("POST", _UNIT, pose_from_joints, "CalcRobTFromJoints", _FORWARD, status=200),
    Operation("POST", _UNIT, joints_from_pose, "CalcJointsFromPose", _INVERSE, status=200),
    Operation("POST", _UNIT, joints_from_pose, "JointsFromCartesian", _INVERSE, status=200),
    Operation("POST", _UNIT, all_solutions, "AllJointSolutions", _ALL, status=200),
    Operation("GET", f"{_UNIT}/pjoints", get_physical_joints),
    Operation("GET", f"{_UNIT}/cartesian", get_cartesian, query={**_TARGET, "elog-at-err": ("0", "1")}),
    Operation("GET", f"{_UNIT}/robtarget", get_robtarget, query=_TARGET),
    Operation("GET", f"{_UNIT}/jointtarget", get_joint_target, query={"ignore": ("0", "1")}),
    Operation("GET", f"{_UNIT}/calibrationinfo", get_calibration),
    Operation("GET", f"{_UNIT}/baseframe", get_base_frame),
    Operation(
        "POST",
        f"{_UNIT}/baseframe",
        set_base_frame,
        "set",
        _FRAME,
        respects_mastership="cfg",
        status=202,
        needs_grant=Grant.CALIBRATE,
    ),
    Operation("GET", f"{_UNIT}/axes", get_axes),
    Operation("GET", _AXIS, get_axis),
    Operation("GET", _AXIS, get_axis_pose, resource="axis-pose"),
    Operation("POST", _AXIS, refuse_axis, "set-axispose", _FRAME, status=400, needs_grant=Grant.CALIBRATE),
    Operation("POST", _AXIS, refuse_axis, "update-commutate", status=400, needs_grant=Grant.CALIBRATE),
    Operation(
        "POST",
        _AXIS,
        refuse_axis,
        "update-syncrevcounter",
        {"syncType": ("1",)},
        status=400,
        needs_grant=Grant.REVOLUTION_COUNTER_UPDATE,
    ),
    Operation("GET", f"{_UNIT}/smbdata", get_smb_data),
    Operation(
        "POST",
        f"{_UNIT}/smbdata",
        refuse_calibration,
        "set",
        {"type": ("robot-to-controller", "controller-to-robot")},
        status=400,
        needs_grant=Grant.CALIBRATE,
    ),
    Operation(
        "POST",
        f"{_UNIT}/smbdata",
        refuse_calibration,
        "clear",
        {"type": ("robot", "controller")},
        status=400,
        needs_grant=Grant.CALIBRATE,
    ),
    Operation("GET", f"{_UNIT}/motorcalib", get_motor_calibration),
)
