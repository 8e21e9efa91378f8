"""The virtual controller's answers on ``/rw/motionsystem``: mechanical units, positions, calculations (rws.md §8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np

from abb_protocols.errors import CommandRefused, ProtocolError, RobotNotReady
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.joints import JOINT_COUNT, Joints, Pose, abb_from_chain, chain_from_abb
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, matrix_from_quaternion
from abb_protocols.rws.documents import Page, RwsLink, RwsState, first_value
from abb_protocols.rws.operations import motion as table
from abb_protocols.rws.operations.motion import JointTarget, RobTarget
from abb_protocols.rws.rapid_values import decode
from abb_protocols.rws.values import Coordinates, JogMode, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.instructions.robot_data import pose_from_rapid, robtarget, wobj_from_rapid
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.units import MechanicalUnit, UnitSupervision
from virtual_irc5.rapid.types import Variable
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call
from virtual_irc5.rws.users import refuse_in_manual_mode

_BASE = "/rw/motionsystem/"
_STEPS_DEG = {"Small": 0.005, "Medium": 0.023, "Large": 0.143, "User": 0.5}  # of incremental jogging
_CONTINUOUS_DEG = 2.0  # that an axis is jogged for each request without increments, at full deflection
_FULL = 1000.0  # deflection of the joystick
_UNIT_TOLERANCE = 1e-3  # of the length of a quaternion
_HALL = "Hall Sensor Calibration"
_LEAD_THROUGH = "Leadthrough"

ROUTES = Routes()


@ROUTES.answer(table.MOTION_SYSTEM)
def _get_motion_system(controller: Irc5, call: RwsCall) -> Page:
    shown = table.MotionSystem(controller.motion.changes, _active(controller).name)
    fields = table.MOTION_SYSTEM.answered.write(shown)
    asked = call.option("resource")
    if asked is not None:
        return page_at("motionsystem", "/rw/", "motionsystem", RwsState("ms", "motionsystem", {asked: fields[asked]}))
    links = (
        page_entry("ms-change-count-li", "checkchangecount", "motionsystem/checkchangecount"),
        page_entry("ms-mechunit-li", "mechunits", "motionsystem/mechunits"),
        page_entry("ms-errorstate-li", "errorstate", "motionsystem/errorstate"),
        page_entry("ms-motionsupervision-li", "motionsupervision", "motionsystem/motionsupervision"),
        page_entry("ms-pathsupervision-li", "pathsupervision", "motionsystem/pathsupervision"),
        page_entry("ms-nonmotion-execution-mode-li", "nonmotionexecution", "motionsystem/nonmotionexecution"),
    )
    return page_at("motionsystem", "/rw/", "motionsystem", RwsState("ms", "motionsystem", fields), *links)


def _active(controller: Irc5) -> MechanicalUnit:
    name = controller.motion.active_unit
    return next((unit for unit in controller.units if unit.name == name), controller.units[0])


def _unit(controller: Irc5, name: str) -> MechanicalUnit:
    for unit in controller.units:
        if unit.name.upper() == name.upper():
            return unit
    raise CallFailure(404, RwsCode.NO_SUCH_MECHUNIT, f"there is no mechanical unit {name[:50]}")


def _find(controller: Irc5, call: RwsCall) -> MechanicalUnit:
    return _unit(controller, call.names["unit"])


def _asked_unit(controller: Irc5, call: RwsCall) -> MechanicalUnit:
    return _unit(controller, call.option("mechunit") or _active(controller).name)


def _changed(controller: Irc5) -> None:
    controller.motion.changes += 1


# Jogging


@ROUTES.answer(table.SET_ACTIVE_UNIT)
def _set_active(controller: Irc5, call: RwsCall) -> None:
    controller.motion.active_unit = _unit(controller, call.required("mechunit-name")).name
    _changed(controller)


@ROUTES.answer(table.JOG)
def _jog(controller: Irc5, call: RwsCall) -> None:
    """Move the axes of the active unit by a step each; the axis values are the deflection of the joystick."""
    _check_jogging(controller, call)
    values = [call.number(f"axis{number}") for number in range(1, 7)]
    if max(map(abs, values)) > _FULL:
        raise bad_call(f"an axis is deflected by {-_FULL:.0f} to {_FULL:.0f}")
    if call.number("ccount") != controller.motion.changes:
        raise bad_call("ccount is not the change count of the motion system; read it again")
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


def _chain(kinematics: KinematicArm, robot: Sequence[float], axis_7: float) -> Joints:
    return tuple(robot) if kinematics.joint_count < JOINT_COUNT else chain_from_abb(robot, axis_7)


def _arm_angle(kinematics: KinematicArm, position: Joints) -> float:
    """The first extra axis of a robtarget [rad]; 0 with six axes."""
    return float(kinematics.angles(np.array([position]))[0])


def _check_jogging(controller: Irc5, call: RwsCall) -> None:
    refuse_in_manual_mode(controller, call, "jogging")
    if controller.is_running:
        raise CallFailure(403, RwsCode.EXEC_STATE, "an arm is jogged while RAPID is stopped")


def _move(arm: VirtualArm, target: Joints) -> None:
    try:
        arm.move_to(target)
    except CommandRefused as error:
        raise bad_call(str(error)) from error
    except RobotNotReady as error:
        raise CallFailure(403, RwsCode.INVALID_STATE, str(error)) from error


@ROUTES.answer(table.POSITION_TARGET, table.SET_JOG_TARGET)
def _go_to_position(controller: Irc5, call: RwsCall) -> None:
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
    wanted = _arm_angle(arm.kinematics, near) if angle > table.NO_AXIS else radians(angle)
    _move(arm, _nearest(arm.kinematics, _pose(position, orientation), wanted, near))


def _pose(position: list[float], orientation: list[float]) -> Pose:
    """A pose in metres; raises CallFailure for an orientation that is no unit quaternion."""
    length = sum(value * value for value in orientation) ** 0.5
    if abs(length - 1.0) > _UNIT_TOLERANCE:
        raise bad_call("the orientation is not a unit quaternion")
    (x, y, z), (w, i, j, k) = position, (value / length for value in orientation)
    return Pose((x, y, z), (w, i, j, k))


def _nearest(kinematics: KinematicArm, pose: Pose, angle: float, near: Joints) -> Joints:
    """The posture of a pose that is nearest to another one: of its branch, or any where that does not reach it."""
    followed = kinematics.reached(
        np.array([pose.position]), matrix_from_quaternion(pose.orientation)[None], angle, near
    )
    found = kinematics.postures(pose, angle) if followed is None else (followed,)
    if not found:
        raise CallFailure(400, RwsCode.POSE_OUTSIDE_REACH, f"the {kinematics.name} does not reach the pose")
    return min(found, key=lambda each: max(abs(a - b) for a, b in zip(each, near, strict=True)))


# State and supervision


@ROUTES.answer(table.MOTION_CHANGE_COUNT)
def _get_change_count(controller: Irc5, call: RwsCall) -> bool:
    return call.number_option("changecount", 0) != controller.motion.changes


@ROUTES.answer(table.MOTION_ERROR_STATE)
def _get_error_state(controller: Irc5, call: RwsCall) -> table.MotionError:
    return table.MotionError()


def _supervision(controller: Irc5, unit: MechanicalUnit) -> UnitSupervision:
    return controller.motion.supervision.setdefault(unit.name, UnitSupervision())


@ROUTES.answer(table.MOTION_SUPERVISION)
def _get_motion_supervision(controller: Irc5, call: RwsCall) -> Mapping[str, table.Supervision]:
    unit = _asked_unit(controller, call)
    found = _supervision(controller, unit)
    return {unit.name: table.Supervision(found.jogging, found.jog_level)}


@ROUTES.answer(table.SET_MOTION_SUPERVISION)
def _set_motion_supervision(controller: Irc5, call: RwsCall) -> None:
    unit = _unit(controller, call.required("mechunit-name"))
    _supervision(controller, unit).jogging = call.required("mode").lower() == "true"
    _changed(controller)


@ROUTES.answer(table.SET_MOTION_SENSITIVITY)
def _set_motion_sensitivity(controller: Irc5, call: RwsCall) -> None:
    unit = _unit(controller, call.required("mechunit-name"))
    _supervision(controller, unit).jog_level = _level(call, "sensitivity")
    _changed(controller)


def _level(call: RwsCall, name: str) -> int:
    level = call.number(name)
    if not 0 <= level <= 300:
        raise bad_call(f"{name} is 0 to 300")
    return int(level)


@ROUTES.answer(table.COLLISION_PREDICTION)
def _get_collision_prediction(controller: Irc5, call: RwsCall) -> Mapping[str, bool]:
    return {"collision-prediction-mode": controller.motion.predicts_collisions}


@ROUTES.answer(table.SET_COLLISION_PREDICTION)
def _set_collision_prediction(controller: Irc5, call: RwsCall) -> None:
    controller.motion.predicts_collisions = call.required("mode") == "true"
    _changed(controller)


@ROUTES.answer(table.PATH_SUPERVISION)
def _get_path_supervision(controller: Irc5, call: RwsCall) -> Mapping[str, table.Supervision]:
    unit = _asked_unit(controller, call)
    found = _supervision(controller, unit)
    return {unit.name: table.Supervision(found.path, found.path_level)}


@ROUTES.answer(table.SET_PATH_SUPERVISION)
def _set_path_supervision(controller: Irc5, call: RwsCall) -> None:
    _supervision(controller, _unit(controller, call.required("mechunit"))).path = call.required("mode") == "ON"
    _changed(controller)


@ROUTES.answer(table.SET_PATH_LEVEL)
def _set_path_level(controller: Irc5, call: RwsCall) -> None:
    _supervision(controller, _unit(controller, call.required("mechunit"))).path_level = _level(call, "level")
    _changed(controller)


@ROUTES.answer(table.NON_MOTION)
def _get_non_motion(controller: Irc5, call: RwsCall) -> bool:
    return controller.motion.is_non_motion


@ROUTES.answer(table.SET_NON_MOTION, table.SET_NON_MOTION_TOO)
def _set_non_motion(controller: Irc5, call: RwsCall) -> None:
    if call.required("mode") == "ON":
        raise CallFailure(400, RwsCode.NOTIMPL, "this virtual controller always moves its arms")
    controller.motion.is_non_motion = False


# Units


@ROUTES.answer(table.UNITS)
def _get_units(controller: Irc5, call: RwsCall) -> Page:
    entries = (
        page_entry(
            "ms-mechunit-li",
            unit.name,
            f"mechunits/{unit.name}",
            mode=table.UNIT.answered.write(unit)["mode"],
            activation_allowed="True",
            drive_module=str(unit.drive_module),
        )
        for unit in controller.units
    )
    return page_at("motionsystem", _BASE, "mechunits", *entries)


_SUB_RESOURCES = ("pjoints", "robtarget", "jointtarget", "cartesian", "axes", "baseframe", "calibrationinfo", "smbdata")
_STATIC_FIELDS = 6  # of a unit, which come first


@ROUTES.answer(table.UNIT)
def _get_unit(controller: Irc5, call: RwsCall) -> Page:
    """A unit's fields: all, or the groups and single fields in ``resource``, joined by ``;``."""
    unit = _find(controller, call)
    members = list(table.UNIT.answered.write(unit).items())
    groups = {"static": dict(members[:_STATIC_FIELDS]), "dynamic": dict(members[_STATIC_FIELDS:])}
    asked = (call.option("resource") or "static;dynamic").split(";")
    known = {*groups, *(_short(name) for members in groups.values() for name in members)}
    unknown = [each for each in asked if each not in known and f"{each}-name" not in known]
    if unknown:
        raise bad_call(f"a mechanical unit does not have the resource {unknown[0][:50]!r}")
    fields = {
        name: text
        for group, members in groups.items()
        for name, text in members.items()
        if group in asked or name in asked or _short(name) in asked
    }
    links = () if call.option("resource") else tuple(RwsLink(name, f"{unit.name}/{name}") for name in _SUB_RESOURCES)
    state = RwsState("ms-mechunit", unit.name, fields, links)
    return page_at("motionsystem", f"{_BASE}mechunits/", unit.name, state)


def _short(name: str) -> str:
    return name.removesuffix("-name").removesuffix("-unit")


@ROUTES.answer(table.SET_UNIT)
def _set_unit(controller: Irc5, call: RwsCall) -> None:
    """Change what jogging uses: tool, work object, loads, mode and coordinate system."""
    unit = _find(controller, call)
    if not call.form:
        raise bad_call("the body lacks tool, wobj, payload, total-payload, mode, jog-mode and coord-system; give one")
    for kind in ("tool", "wobj"):
        if first_value(call.form, kind) is not None:
            _datum(controller, unit, call.required(kind), kind)
    mode = call.parameter("mode", "")
    if mode == "Deactivated" and unit.type == "TCPRobot":
        raise CallFailure(400, RwsCode.REJECT, f"the robot {unit.name} cannot be deactivated")
    system = call.parameter("coord-system", unit.coordinates.value)
    changed = replace(
        unit,
        tool=call.parameter("tool", unit.tool),
        work_object=call.parameter("wobj", unit.work_object),
        payload=call.parameter("payload", unit.payload),
        total_payload=call.parameter("total-payload", unit.total_payload),
        is_active=mode == "Activated" if mode else unit.is_active,
        jog_mode=JogMode(call.parameter("jog-mode", unit.jog_mode.value)),
        coordinates=Coordinates("World" if system == "Word" else system),
    )
    controller.units = tuple(changed if each.name == unit.name else each for each in controller.units)
    _changed(controller)


def _led_unit(controller: Irc5, call: RwsCall) -> MechanicalUnit:
    if _LEAD_THROUGH not in controller.identity.options:
        raise CallFailure(400, RwsCode.OPTION, f"the controller lacks the option {_LEAD_THROUGH}")
    return _find(controller, call)


@ROUTES.answer(table.UNIT_LEAD_THROUGH)
def _get_lead_through(controller: Irc5, call: RwsCall) -> Mapping[str, bool]:
    unit = _led_unit(controller, call)
    return {unit.name: unit.name in controller.motion.lead_through}


@ROUTES.answer(table.SET_UNIT_LEAD_THROUGH)
def _set_lead_through(controller: Irc5, call: RwsCall) -> None:
    """Let an arm be led by hand; no hand leads this one, so that it stands still all the same."""
    unit = _led_unit(controller, call)
    if unit.type != "TCPRobot":
        raise bad_call(f"{unit.name} is not a robot")
    led = controller.motion.lead_through
    led.add(unit.name) if call.required("status") == "active" else led.discard(unit.name)
    _changed(controller)


@ROUTES.answer(table.FINE_CALIBRATE, table.UPDATE_REVOLUTION_COUNTER, table.SET_SMB_DATA, table.CLEAR_SMB_DATA)
def _refuse_calibration(controller: Irc5, call: RwsCall) -> None:
    """Calibration changes what the controller takes for the arm's zero; there is nothing to be calibrated here."""
    _find(controller, call)
    if controller.mode.value == "AUTO":
        raise CallFailure(400, RwsCode.NOT_MANUAL_MODE, "an axis is calibrated in manual mode")
    raise CallFailure(400, RwsCode.NOTIMPL, "the axes of a virtual robot are always calibrated")


# Positions


def unit_joint_target(controller: Irc5, unit: str) -> JointTarget:
    """Where the axes of a unit's arm stand."""
    robax, extax = controller.joint_target(unit)
    a1, a2, a3, a4, a5, a6 = robax
    return JointTarget((a1, a2, a3, a4, a5, a6), tuple(None if at > table.NO_AXIS else at for at in extax))


@ROUTES.answer(table.POSITION_AS_JOINTTARGET, table.PHYSICAL_JOINTS)
def _get_joint_target(controller: Irc5, call: RwsCall) -> Mapping[str, JointTarget]:
    unit = _find(controller, call)
    return {unit.name: unit_joint_target(controller, unit.name)}


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
        code = RwsCode.TOOL_ERROR if kind == "tool" else RwsCode.WOBJ_ERROR
        raise CallFailure(400, code, f"{unit.task} has no {type_name} {name[:50]}")
    return value


def unit_target(controller: Irc5, call: RwsCall, unit: MechanicalUnit) -> RobTarget:
    """The position of a unit's tool as the call asks for it."""
    tool = pose_from_rapid(_datum(controller, unit, call.option("tool") or unit.tool, "tool").tframe)
    system = call.option("coordinate") or unit.coordinates.value
    wobj = wobj_from_rapid(_datum(controller, unit, call.option("wobj") or unit.work_object, "wobj"))
    arm = controller.arm_of(unit)
    trans, rot, turns, extra = robtarget(arm.kinematics, arm.position, tool, wobj if system == "Wobj" else None)
    one, four, six, last = map(int, turns)
    external = tuple(None if angle > table.NO_AXIS else radians(angle) for angle in extra)
    return RobTarget(pose_from_rapid((trans, rot)), (one, four, six, last), external)


@ROUTES.answer(table.POSITION_AS_ROBTARGET)
def _get_robtarget(controller: Irc5, call: RwsCall) -> Mapping[str, RobTarget]:
    unit = _find(controller, call)
    return {unit.name: unit_target(controller, call, unit)}


@ROUTES.answer(table.CARTESIAN_POSITION)
def _get_cartesian(controller: Irc5, call: RwsCall) -> Mapping[str, RobTarget]:
    return {"cartesian": unit_target(controller, call, _find(controller, call))}


def _frame_instance(unit: MechanicalUnit) -> tuple[str, str, str]:
    return "MOC", "ROBOT" if unit.type == "TCPRobot" else "SINGLE", unit.name


@ROUTES.answer(table.UNIT_BASE_FRAME)
def _get_base_frame(controller: Irc5, call: RwsCall) -> Mapping[str, Pose]:
    """The base frame in the world, of the system parameters."""
    unit = _find(controller, call)
    instance = controller.effective.find(*_frame_instance(unit))
    given: Mapping[str, str] = instance.attributes if instance else {}
    x, y, z = (float(given.get(f"base_frame_pos_{axis}") or 0.0) for axis in "xyz")
    w, i, j, k = (float(given.get(f"base_frame_orient_u{number}") or (number == 0)) for number in range(4))
    return {unit.name: Pose((x, y, z), (w, i, j, k))}


@ROUTES.answer(table.SET_UNIT_BASE_FRAME)
def _set_base_frame(controller: Irc5, call: RwsCall) -> None:
    """Change the system parameters of the base frame; they act after a restart."""
    unit = _find(controller, call)
    numbers = [call.number(f"q{number}") for number in range(1, 5)]
    _pose([0.0, 0.0, 0.0], numbers)
    changes = {f"base_frame_pos_{axis}": f"{call.number(axis) * 1e-3:.9g}" for axis in "xyz"}
    changes |= {f"base_frame_orient_u{index}": f"{value:.9g}" for index, value in enumerate(numbers)}
    controller.configuration.change(*_frame_instance(unit), changes)


@ROUTES.answer(table.UNIT_AXES)
def _get_axes(controller: Irc5, call: RwsCall) -> Page:
    unit = _find(controller, call)
    states = [RwsState("ms-mechunit-axes", "axes", table.UNIT_AXES.answered.write(unit.axes))]
    states += [page_entry("ms-mechunit-axis-li", str(number), f"axes/{number}") for number in range(1, unit.axes + 1)]
    return page_at("motionsystem", f"{_BASE}mechunits/{unit.name}/", "axes", *states)


def _axis(controller: Irc5, call: RwsCall) -> tuple[MechanicalUnit, int]:
    unit, text = _find(controller, call), call.names["axis"]
    if text not in map(str, range(1, unit.axes + 1)):
        raise CallFailure(404, RwsCode.UNRESOLVED_URL, f"{unit.name} has axes 1 to {unit.axes}, not {text[:20]!r}")
    return unit, int(text) if unit.axes > 1 else 7


@ROUTES.answer(table.UNIT_AXIS)
def _get_axis(controller: Irc5, call: RwsCall) -> table.Axis:
    unit, logical = _axis(controller, call)
    return table.Axis(unit.is_synchronized, int(call.names["axis"]), logical)


@ROUTES.answer(table.UNIT_AXIS_POSE)
def _get_axis_pose(controller: Irc5, call: RwsCall) -> Pose:
    """Where an axis is: the flange when all axes after it stand at zero, as the kinematic chain counts them."""
    unit, logical = _axis(controller, call)
    arm = controller.arm_of(unit)
    last = arm.kinematics.axes.index(logical)
    position = tuple(angle if index <= last else 0.0 for index, angle in enumerate(arm.position))
    return arm.kinematics.tool0(position)


@ROUTES.answer(table.SET_UNIT_AXIS_POSE, table.UPDATE_COMMUTATE, table.UPDATE_SYNC_COUNTER)
def _refuse_axis(controller: Irc5, call: RwsCall) -> None:
    _axis(controller, call)
    _refuse_calibration(controller, call)


@ROUTES.answer(table.SET_POSITION)
def _set_position(controller: Irc5, call: RwsCall) -> None:
    """Put an arm somewhere while the motors are off; RobotStudio's controllers alone can."""
    _find(controller, call)
    raise CallFailure(400, RwsCode.SERVICE_NOT_SUPPORTED, "a position is set in RobotStudio's controllers alone")


@ROUTES.answer(table.CALIBRATION)
def _get_calibration(controller: Irc5, call: RwsCall) -> Page:
    unit = _find(controller, call)
    method = _HALL if _HALL in controller.identity.options else "Undefined"
    count = str(unit.axes)
    head = {"usecalibrationwindowtype": "0", "noactivejoints": count, "count": count}
    prefix = unit.name.replace("ROB", "rob", 1).removesuffix("_7")
    states = []
    for number in range(1, unit.axes + 1):
        joint = f"{prefix}_{number if unit.axes > 1 else 7}"
        shown = table.Calibration(method, joint=joint, factory_method=method, method=method)
        states.append(RwsState("ms-calibrationinfo-joint", str(number), table.CALIBRATION.answered.write(shown)))
    base = f"{_BASE}mechunits/{unit.name}/"
    return page_at("motionsystem", base, "calibrationinfo", RwsState("ms-calibrationinfo", unit.name, head), *states)


_SMB = ("sis", "abs_acc", "calib", "axis_cal")


@ROUTES.answer(table.SMB_DATA)
def _get_smb_data(controller: Irc5, call: RwsCall) -> Page:
    """Controller and robot agree (0, SMB_VALID); there is no absolute accuracy (3, SMB_NOT_USED)."""
    unit = _find(controller, call)
    fields = {
        f"{place}_{kind}_data_status": "3" if kind == "abs_acc" else "0"
        for place in ("controller", "robot")
        for kind in _SMB
    }
    return page_at(
        "motionsystem", f"{_BASE}mechunits/{unit.name}/", "smbdata", RwsState("ms-smbdata", unit.name, fields)
    )


@ROUTES.answer(table.MOTOR_CALIBRATION)
def _get_motor_calibration(controller: Irc5, call: RwsCall) -> Mapping[str, str]:
    unit = _find(controller, call)
    prefix = unit.name.replace("ROB", "rob", 1).removesuffix("_7")
    numbers = range(1, unit.axes + 1) if unit.axes > 1 else (7,)
    return {f"{prefix}_{number}": f"{prefix}_{number}" for number in numbers}


# Calculations, in metres and radians


def _numbers(call: RwsCall, name: str, count: int) -> list[float]:
    """A parameter ``[1,2,3]`` of a body."""
    text = call.required(name)
    try:
        value = decode(text)
    except ProtocolError as error:
        raise bad_call(f"{name} is {count} numbers in brackets, not {text[:50]!r}") from error
    if not isinstance(value, tuple) or len(value) != count or not all(isinstance(each, float) for each in value):
        raise bad_call(f"{name} is {count} numbers in brackets, not {text[:50]!r}")
    return [float(each) for each in value if isinstance(each, float)]


def _tool(call: RwsCall) -> Pose:
    return _pose(_numbers(call, "tool_frame_position", 3), _numbers(call, "tool_frame_orientation", 4))


def _given(kinematics: KinematicArm, call: RwsCall, prefix: str = "") -> Joints:
    """The joint positions in a body."""
    robot, extra = _numbers(call, f"{prefix}rob_joints", 6), _numbers(call, f"{prefix}ext_joints", 6)
    return _chain(kinematics, robot, extra[0])


@ROUTES.answer(table.POSE_FROM_JOINTS, table.ROBTARGET_FROM_JOINTS)
def _pose_from_joints(controller: Irc5, call: RwsCall) -> Mapping[str, RobTarget]:
    kinematics = controller.arm_of(_find(controller, call)).kinematics
    position = _given(kinematics, call)
    pose = compose_poses(kinematics.tool0(position), _tool(call))
    one, four, six, last = kinematics.configuration(position)
    return {"positionData": RobTarget(pose, (one, four, six, last), (_arm_angle(kinematics, position),))}


def _solution(kinematics: KinematicArm, position: Joints, *, with_configuration: bool = False) -> table.Solution:
    robot, axis_7 = _abb(position)
    return table.Solution(tuple(robot), axis_7, tuple(kinematics.configuration(position)) if with_configuration else ())


def _wanted(call: RwsCall) -> tuple[Pose, float, list[float]]:
    """Pose of tool0 in the body, arm angle, and configuration of a calculation."""
    pose = _pose(_numbers(call, "curr_position", 3), _numbers(call, "curr_orientation", 4))
    extra = _numbers(call, "curr_ext_joints", 6)
    return compose_poses(pose, inverse_pose(_tool(call))), extra[0], _numbers(call, "robot_configuration", 4)


@ROUTES.answer(table.JOINTS_FROM_POSE, table.JOINTS_FROM_CARTESIAN)
def _joints_from_pose(controller: Irc5, call: RwsCall) -> Mapping[str, table.Solution]:
    """The posture nearest to the old one; the first extra axis of the pose is the arm angle."""
    kinematics = controller.arm_of(_find(controller, call)).kinematics
    pose, angle, _ = _wanted(call)
    near = _given(kinematics, call, "old_")
    outside = kinematics.limits.outside(near)
    if outside is not None:
        number = f"{outside + 1} of {kinematics.joint_count}"
        raise bad_call(f"old_rob_joints and old_ext_joints are outside of the range of joint {number}")
    return {"jointData": _solution(kinematics, _nearest(kinematics, pose, angle, near))}


@ROUTES.answer(table.ALL_SOLUTIONS)
def _all_solutions(controller: Irc5, call: RwsCall) -> Mapping[str, table.Solution]:
    kinematics = controller.arm_of(_find(controller, call)).kinematics
    pose, angle, _ = _wanted(call)
    found = kinematics.postures(pose, angle)
    return {f"solution{n}": _solution(kinematics, each, with_configuration=True) for n, each in enumerate(found, 1)}
