"""The client's service for the motion system: mechanical units, positions, kinematics, supervision, jogging; in SI."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import degrees

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ORIGIN, Joints, Pose, abb_from_chain, chain_from_abb, joints
from abb_protocols.rws.documents import JointTarget, RobTarget
from abb_protocols.rws.operations import motion as table
from abb_protocols.rws.operations.motion import Calibration, MechanicalUnitState, MotionSystem, Solution, Supervision
from abb_protocols.rws.values import Coordinates, Increment, JogMode
from abb_runtime.rws.services.service import Service

_MM = 1000.0


class MotionService(Service):
    """``/rw/motionsystem``."""

    def joint_target(self, unit: str) -> Joints:
        """Where the arm ``ROB_R`` or ``ROB_L`` stands, chain order [rad]."""
        return self.axis_positions(unit).chain()

    def axis_positions(self, unit: str) -> JointTarget:
        """Where the axes of any mechanical unit stand."""
        return self._answer(f"reading the joints of {unit}", table.JOINT_TARGET, unit)

    def motion_system(self) -> MotionSystem:
        """What is jogged."""
        return self._answer("reading the motion system", table.MOTION_SYSTEM)

    def has_motion_changed(self, change_count: int) -> bool:
        """Whether units or their settings have changed since they were read with that count."""
        return self._answer("reading the change count", table.CHANGE_COUNT, changecount=change_count)

    def motion_error(self) -> tuple[str, int]:
        """State of errors when jogging, ``HPJ_OK`` for none, and how many there were."""
        error = self._answer("reading the error state", table.ERROR_STATE)
        return error.state, error.count

    def mechanical_units(self) -> tuple[str, ...]:
        """Names of the mechanical units."""
        return tuple(state.title for state in self._listed("reading the mechanical units", table.UNITS))

    def mechanical_unit(self, unit: str) -> MechanicalUnitState:
        """One mechanical unit."""
        return self._answer(f"reading {unit}", table.UNIT, unit)

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
            table.SET_UNIT,
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
        return self._answer(f"reading {unit}", table.LEAD_THROUGH, unit)

    def set_lead_through(self, unit: str, is_on: bool) -> None:
        """Let an arm follow a hand that leads it, or not."""
        status = "active" if is_on else "inactive"
        self._call(f"switching the lead-through of {unit}", table.SET_LEAD_THROUGH, unit, status=status)

    # Positions

    def physical_joints(self, unit: str) -> Joints:
        """Where the motors of an arm stand, chain order [rad]."""
        return self._answer(f"reading the joints of {unit}", table.PHYSICAL_JOINTS, unit).chain()

    def rob_target(
        self, unit: str, *, tool: str = "", work_object: str = "", coordinates: Coordinates | None = None
    ) -> RobTarget:
        """Where the tool of an arm stands; tool, work object and coordinates are the active ones if not named."""
        frames = _frames(tool, work_object, coordinates)
        return self._answer(f"reading the position of {unit}", table.ROBTARGET, unit, **frames)

    def cartesian(
        self, unit: str, *, tool: str = "", work_object: str = "", coordinates: Coordinates | None = None
    ) -> RobTarget:
        """As ``rob_target``, without external axes."""
        frames = _frames(tool, work_object, coordinates)
        return self._answer(f"reading the position of {unit}", table.CARTESIAN, unit, **frames)

    def base_frame(self, unit: str) -> Pose:
        """Base of an arm in the world."""
        return self._answer(f"reading the base frame of {unit}", table.BASE_FRAME, unit)

    def set_base_frame(self, unit: str, base_to_world: Pose) -> None:
        """Say where an arm is mounted; it acts after a restart."""
        frame = _pose_fields(base_to_world, ("x", "y", "z"), ("q1", "q2", "q3", "q4"))
        self._call(f"setting the base frame of {unit}", table.SET_BASE_FRAME, unit, **frame)

    def axes(self, unit: str) -> int:
        """Number of axes of a mechanical unit."""
        return self._answer(f"reading {unit}", table.AXES, unit)

    def is_axis_synchronized(self, unit: str, axis: int) -> bool:
        """Whether the revolution counter of an axis (from 1) is right."""
        return self._answer(f"reading axis {axis} of {unit}", table.AXIS, unit, str(axis)).is_synchronized

    def axis_pose(self, unit: str, axis: int) -> Pose:
        """Where an axis (from 1) is, in the base of the arm."""
        return self._answer(f"reading {unit}", table.AXIS_POSE, unit, str(axis))

    # Kinematics of the controller

    def pose_of_joints(self, unit: str, position: Joints, tool_to_flange: Pose = ORIGIN) -> RobTarget:
        """Where the tool is with the joints at ``position``, chain order [rad]."""
        form = {**_joint_fields(position, "rob_joints", "ext_joints"), **_tool_fields(tool_to_flange)}
        what = f"computing the position of {unit}"
        return self._first(what, table.POSE_FROM_JOINTS, unit, **form, elog_at_error="FALSE")

    def joints_of_pose(self, unit: str, target: RobTarget, near: Joints, tool_to_flange: Pose = ORIGIN) -> Joints:
        """Joints with which the tool is at ``target``, near the joints ``near``; chain order [rad]."""
        form = _search_fields(target, near, tool_to_flange)
        return _joints(self._first(f"computing the joints of {unit}", table.JOINTS_FROM_POSE, unit, **form))

    def joints_of_cartesian(self, unit: str, target: RobTarget, near: Joints, tool_to_flange: Pose = ORIGIN) -> Joints:
        """As ``joints_of_pose``, whatever the configuration of ``target`` is."""
        form = _search_fields(target, near, tool_to_flange)
        return _joints(self._first(f"computing the joints of {unit}", table.JOINTS_FROM_CARTESIAN, unit, **form))

    def all_joints_of_pose(self, unit: str, target: RobTarget, tool_to_flange: Pose = ORIGIN) -> tuple[Joints, ...]:
        """All joints with which the tool is at ``target``, in each configuration; chain order [rad]."""
        form = {**_target_fields(target), **_tool_fields(tool_to_flange)}
        page = self._shown(f"computing the joints of {unit}", table.ALL_SOLUTIONS, unit, **form)
        return tuple(_joints(table.ALL_SOLUTIONS.answered.read(state)) for state in page.states)

    # Jogging

    def select_unit(self, unit: str) -> None:
        """Make a mechanical unit the one that is jogged."""
        self._call(f"selecting {unit}", table.SET_ACTIVE, mechunit_name=unit)

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
        self._call("jogging", table.JOG, **deflections, ccount=change_count, inc_mode=increment)

    def jog_to(self, target: RobTarget) -> None:
        """Move the active unit to a position in its base, as jogging in GO_TO_POSITION does; RAPID must be stopped."""
        pose = target.tool_to_object
        names = ("pos_x", "pos_y", "pos_z"), [f"orient_q{number}" for number in range(1, 5)]
        form: dict[str, object] = {**_pose_fields(pose, *names)}
        form |= {f"config_{name}": turns for name, turns in zip(table.TURNS, target.configuration, strict=True)}
        external = [*target.external, *(None,) * 6][:6]
        form |= {
            f"extjoint_{number}": "9E+09" if angle is None else repr(degrees(angle))
            for number, angle in enumerate(external, 1)
        }
        self._call("jogging to a position", table.POSITION_TARGET, **form)

    # Supervision

    def motion_supervision(self, unit: str) -> Supervision:
        """Collision detection of an arm while it moves."""
        return self._answer(f"reading the supervision of {unit}", table.MOTION_SUPERVISION, mechunit=unit)

    def set_motion_supervision(self, unit: str, supervision: Supervision) -> None:
        """Switch the collision detection of an arm, and set its level."""
        what = f"setting the supervision of {unit}"
        self._call(what, table.SET_MOTION_SUPERVISION, mechunit_name=unit, mode=str(supervision.is_on))
        self._call(what, table.SET_MOTION_SENSITIVITY, mechunit_name=unit, sensitivity=supervision.level)

    def path_supervision(self, unit: str) -> Supervision:
        """Supervision that an arm is on its path."""
        return self._answer(f"reading the supervision of {unit}", table.PATH_SUPERVISION, mechunit=unit)

    def set_path_supervision(self, unit: str, supervision: Supervision) -> None:
        """Switch the supervision that an arm is on its path, and set its level."""
        what = f"setting the supervision of {unit}"
        self._call(what, table.SET_PATH_SUPERVISION, mechunit=unit, mode="ON" if supervision.is_on else "OFF")
        self._call(what, table.SET_PATH_LEVEL, mechunit=unit, level=supervision.level)

    def is_collision_predicted(self) -> bool:
        """Whether the controller stops before arms collide (Collision Avoidance)."""
        return self._answer("reading the collision prediction", table.COLLISION_PREDICTION)

    def predict_collisions(self, is_on: bool) -> None:
        """Whether the controller stops before arms collide."""
        self._call("setting the collision prediction", table.SET_COLLISION_PREDICTION, mode=is_on)

    def is_motion_skipped(self) -> bool:
        """Whether programs run without moving the robot (non-motion execution)."""
        return self._answer("reading non-motion execution", table.NON_MOTION)

    def skip_motion(self, is_on: bool) -> None:
        """Let programs run without moving the robot, or not."""
        self._call("setting non-motion execution", table.SET_NON_MOTION, mode="ON" if is_on else "OFF")

    # Calibration

    def calibration(self, unit: str) -> tuple[Calibration, ...]:
        """How each joint was calibrated."""
        answer = table.CALIBRATION.answered
        states = self._listed(f"reading the calibration of {unit}", table.CALIBRATION, unit)
        return tuple(answer.read(state) for state in states if state.type in answer.types)

    def is_measurement_memory_valid(self, unit: str) -> bool:
        """Whether the data in the robot's measurement board (SMB) and in the controller are the same and valid."""
        state = self._shown(f"reading the memory of {unit}", table.SMB_DATA, unit).one("ms-smbdata")
        return all(text in ("0", "3") for text in state.fields.values())  # 3: there is none of that kind

    def calibrated_motors(self, unit: str) -> tuple[str, ...]:
        """Names of the motors that can be calibrated."""
        return self._answers(f"reading the motors of {unit}", table.MOTOR_CALIBRATION, unit)


def _frames(tool: str, work_object: str, coordinates: Coordinates | None) -> dict[str, object]:
    return {"tool": tool or None, "wobj": work_object or None, "coordinate": coordinates}


def _pose_fields(pose: Pose, position: Iterable[str], orientation: Iterable[str]) -> dict[str, str]:
    lengths = zip(position, (repr(value * _MM) for value in pose.position), strict=True)
    return dict((*lengths, *zip(orientation, map(repr, pose.orientation), strict=True)))


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
