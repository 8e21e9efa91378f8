"""The motion system: mechanical units, positions, kinematics, supervision, jogging; metres and radians."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import degrees

from yumi.catalogue import message
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints, Pose, abb_from_chain, chain_from_abb, joints
from yumi.rws import documents
from yumi.rws.documents import (
    EXTERNAL_AXES,
    JointTarget,
    Pairs,
    RobTarget,
    State,
    joint_target_of,
    pose_of,
    rob_target_of,
)
from yumi.rws.session import Requests, get, given, post

_MOTION = "/rw/motionsystem"
_UNITS = "/rw/motionsystem/mechunits"
_MM = 1000.0
_TURNS = ("j1", "j4", "j6", "jx")
_NO_TOOL = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


class Coordinates(Enum):
    """In which coordinates a position is."""

    BASE = "Base"
    WORLD = "World"
    TOOL = "Tool"
    WORK_OBJECT = "Wobj"


class JogMode(Enum):
    """What the axes of a joystick move."""

    AXES_1_TO_3 = "AxisGroup1"
    AXES_4_TO_6 = "AxisGroup2"
    CARTESIAN = "Cartesian"
    ALIGN = "Align"
    GO_TO_POSITION = "GoToPos"
    CONFIGURATION = "ConfigurationJog"


class Increment(Enum):
    """Length of a step when jogging."""

    SMALL = "Small"
    MEDIUM = "Medium"
    LARGE = "Large"
    USER = "User"


@dataclass(frozen=True, slots=True)
class MotionSystem:
    """What is jogged, and the count that a request to jog has to name.

    Attributes:
        unit: the active mechanical unit.
        change_count: rises with every change of units and their settings.
        has_absolute_accuracy: whether that is active.
    """

    unit: str
    change_count: int
    has_absolute_accuracy: bool


@dataclass(frozen=True, slots=True)
class MechanicalUnit:
    """A mechanical unit.

    Attributes:
        name: such as ``ROB_R``.
        task: that moves it.
        type: ``TCPRobot``, ``Robot``, ``Single`` or ``None``.
        axes: number of its own.
        total_axes: number with those of the unit that is integrated in it.
        integrated_unit: which that is, "" for none.
        tool, work_object, payload: active names.
        coordinates: in which it is jogged.
        jog_mode: what a joystick moves.
        is_active: whether it may be moved.
        is_synchronized: whether its revolution counters are right.
    """

    name: str
    task: str
    type: str
    axes: int
    total_axes: int
    integrated_unit: str
    tool: str
    work_object: str
    payload: str
    coordinates: Coordinates
    jog_mode: JogMode
    is_active: bool
    is_synchronized: bool


@dataclass(frozen=True, slots=True)
class Supervision:
    """A supervision of an arm, and its level [%]; a higher one is less sensitive."""

    is_on: bool
    level: int


@dataclass(frozen=True, slots=True)
class Calibration:
    """How a joint was calibrated."""

    joint: str
    method: str
    factory_method: str


class Motion(Requests):
    """``/rw/motionsystem``."""

    def joint_target(self, unit: str) -> Joints:
        """Where the arm ``ROB_R`` or ``ROB_L`` stands, chain order [rad]."""
        return self.axis_positions(unit).chain()

    def axis_positions(self, unit: str) -> JointTarget:
        """Where the axes of any mechanical unit stand."""
        return self._read(
            get(f"{_UNITS}/{unit}/jointtarget"), documents.read_joint_target, f"reading the joints of {unit}"
        )

    def motion_system(self) -> MotionSystem:
        """What is jogged."""
        state = self._state("reading the motion system", _MOTION, "ms")
        return MotionSystem(state.text("mechunit-name"), state.whole("change-count"), state.flag("absacc-active"))

    def has_motion_changed(self, change_count: int) -> bool:
        """Whether units or their settings have changed since they were read with that count."""
        query = ("changecount", str(change_count))
        state = self._state("reading the change count", f"{_MOTION}/checkchangecount", "ms-change-count", query)
        return state.flag("changestate")

    def motion_error(self) -> tuple[str, int]:
        """State of errors when jogging, ``HPJ_OK`` for none, and how many there were."""
        state = self._state("reading the error state", f"{_MOTION}/errorstate", "ms-errorstate")
        return state.text("err-state"), state.whole("err-count")

    def mechanical_units(self) -> tuple[str, ...]:
        """Names of the mechanical units."""
        return tuple(state.title for state in self._states("reading the mechanical units", _UNITS))

    def mechanical_unit(self, unit: str) -> MechanicalUnit:
        """One mechanical unit."""
        state = self._state(f"reading {unit}", f"{_UNITS}/{unit}", "ms-mechunit")
        integrated = state.text("has-integrated-unit")
        return MechanicalUnit(
            name=state.title,
            task=state.text("task-name"),
            type=state.text("type"),
            axes=state.whole("axes"),
            total_axes=state.whole("axes-total"),
            integrated_unit="" if integrated == "NoIntegratedUnit" else integrated,
            tool=state.text("tool-name"),
            work_object=state.text("wobj-name"),
            payload=state.text("payload-name"),
            coordinates=state.member(Coordinates, "coord-system"),
            jog_mode=state.member(JogMode, "jog-mode"),
            is_active=state.text("mode") == "Activated",
            is_synchronized=state.text("status") == "Synchronized",
        )

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
        form = given(
            tool=tool,
            wobj=work_object,
            payload=payload,
            total_payload=total_payload,
            coord_system=None if coordinates is None else coordinates.value,
            jog_mode=None if jog_mode is None else jog_mode.value,
            mode=None if is_active is None else "Activated" if is_active else "Deactivated",
        )
        self._do(post(f"{_UNITS}/{unit}", "set", *form), f"setting up {unit}")

    def is_lead_through_on(self, unit: str) -> bool:
        """Whether an arm follows a hand that leads it."""
        query = ("resource", "lead-through")
        state = self._state(f"reading {unit}", f"{_UNITS}/{unit}", "ms-mechunit-complianceleadthrough", query)
        return state.flag("status")

    def set_lead_through(self, unit: str, is_on: bool) -> None:
        """Let an arm follow a hand that leads it, or not."""
        form = ("status", "active" if is_on else "inactive")
        self._do(post(f"{_UNITS}/{unit}", "set-lead-through", form), f"switching the lead-through of {unit}")

    # Positions

    def physical_joints(self, unit: str) -> Joints:
        """Where the motors of an arm stand, chain order [rad]."""
        state = self._state(f"reading the joints of {unit}", f"{_UNITS}/{unit}/pjoints", "ms-pjoints")
        return joint_target_of(state, "rax_", EXTERNAL_AXES).chain()

    def rob_target(
        self, unit: str, *, tool: str = "", work_object: str = "", coordinates: Coordinates | None = None
    ) -> RobTarget:
        """Where the tool of an arm stands; tool, work object and coordinates are the active ones if not named."""
        path = f"{_UNITS}/{unit}/robtarget"
        query = _frames(tool, work_object, coordinates)
        return rob_target_of(self._state(f"reading the position of {unit}", path, "ms-robtargets", *query))

    def cartesian(
        self, unit: str, *, tool: str = "", work_object: str = "", coordinates: Coordinates | None = None
    ) -> RobTarget:
        """As ``rob_target``, without external axes."""
        path = f"{_UNITS}/{unit}/cartesian"
        query = _frames(tool, work_object, coordinates)
        return rob_target_of(self._state(f"reading the position of {unit}", path, "ms-mechunit-cartesian", *query))

    def base_frame(self, unit: str) -> Pose:
        """Base of an arm in the world."""
        path = f"{_UNITS}/{unit}/baseframe"
        return pose_of(self._state(f"reading the base frame of {unit}", path, "ms-mechunit-baseframe"))

    def set_base_frame(self, unit: str, base_to_world: Pose) -> None:
        """Say where an arm is mounted; it acts after a restart."""
        form = _pose_fields(base_to_world, ("x", "y", "z"), ("q1", "q2", "q3", "q4"))
        self._do(post(f"{_UNITS}/{unit}/baseframe", "set", *form), f"setting the base frame of {unit}")

    def axes(self, unit: str) -> int:
        """Number of axes of a mechanical unit."""
        return self._state(f"reading {unit}", f"{_UNITS}/{unit}/axes", "ms-mechunit-axes").whole("axes")

    def is_axis_synchronized(self, unit: str, axis: int) -> bool:
        """Whether the revolution counter of an axis (from 1) is right."""
        state = self._state(f"reading axis {axis} of {unit}", f"{_UNITS}/{unit}/axes/{axis}", "ms-axis")
        return state.text("axisstatus") == "Synchronized"

    def axis_pose(self, unit: str, axis: int) -> Pose:
        """Where an axis (from 1) is, in the base of the arm."""
        path = f"{_UNITS}/{unit}/axes/{axis}"
        return pose_of(self._state(f"reading {unit}", path, "ms-axis-pose", ("resource", "axis-pose")))

    # Kinematics of the controller

    def pose_of_joints(self, unit: str, position: Joints, tool_to_flange: Pose = _NO_TOOL) -> RobTarget:
        """Where the tool is with the joints at ``position``, chain order [rad]."""
        form = (*_joint_fields(position, "rob_joints", "ext_joints"), *_tool_fields(tool_to_flange))
        request = post(f"{_UNITS}/{unit}", "CalcPoseFromJoints", *form, ("elog_at_error", "FALSE"))
        return self._read(request, lambda page: _calculated(page.states[0]), f"computing the position of {unit}")

    def joints_of_pose(self, unit: str, target: RobTarget, near: Joints, tool_to_flange: Pose = _NO_TOOL) -> Joints:
        """Joints with which the tool is at ``target``, near the joints ``near``; chain order [rad]."""
        form = (
            *_target_fields(target),
            *_tool_fields(tool_to_flange),
            *_joint_fields(near, "old_rob_joints", "old_ext_joints"),
        )
        request = post(f"{_UNITS}/{unit}", "CalcJointsFromPose", *form, ("elog_at_error", "FALSE"))
        return self._read(request, lambda page: _solution(page.states[0]), f"computing the joints of {unit}")

    def joints_of_cartesian(
        self, unit: str, target: RobTarget, near: Joints, tool_to_flange: Pose = _NO_TOOL
    ) -> Joints:
        """As ``joints_of_pose``, whatever the configuration of ``target`` is."""
        form = (
            *_target_fields(target),
            *_tool_fields(tool_to_flange),
            *_joint_fields(near, "old_rob_joints", "old_ext_joints"),
        )
        request = post(f"{_UNITS}/{unit}", "JointsFromCartesian", *form, ("elog_at_error", "FALSE"))
        return self._read(request, lambda page: _solution(page.states[0]), f"computing the joints of {unit}")

    def all_joints_of_pose(self, unit: str, target: RobTarget, tool_to_flange: Pose = _NO_TOOL) -> tuple[Joints, ...]:
        """All joints with which the tool is at ``target``, in each configuration; chain order [rad]."""
        request = post(f"{_UNITS}/{unit}", "AllJointSolutions", *_target_fields(target), *_tool_fields(tool_to_flange))
        return self._read(request, lambda page: tuple(map(_solution, page.states)), f"computing the joints of {unit}")

    # Jogging

    def select_unit(self, unit: str) -> None:
        """Make a mechanical unit the one that is jogged."""
        self._do(post(_MOTION, "set-mechunit", ("mechunit-name", unit)), f"selecting {unit}")

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
        form = [(f"axis{number}", str(value)) for number, value in enumerate(axes, 1)]
        form += [("ccount", str(change_count)), ("inc-mode", increment.value)]
        with self.holding("motion"):
            self._do(post(_MOTION, "jog", *form), "jogging")

    def jog_to(self, target: RobTarget) -> None:
        """Move the active unit to a position in its base, as jogging in GO_TO_POSITION does; RAPID must be stopped."""
        pose = target.tool_to_object
        form = list(_pose_fields(pose, ("pos-x", "pos-y", "pos-z"), (f"orient-q{number}" for number in range(1, 5))))
        form += zip(
            (f"config-{name}" for name in ("j1", "j4", "j6", "jx")), map(str, target.configuration), strict=True
        )
        external = [*target.external, *(None,) * 6][:6]
        form += [
            (f"extjoint-{number}", "9E+09" if angle is None else repr(degrees(angle)))
            for number, angle in enumerate(external, 1)
        ]
        with self.holding("motion"):
            self._do(post(_MOTION, "positiontarget", *form), "jogging to a position")

    # Supervision

    def motion_supervision(self, unit: str) -> Supervision:
        """Collision detection of an arm while it moves."""
        path = f"{_MOTION}/motionsupervision"
        state = self._state(f"reading the supervision of {unit}", path, "ms-motionsupervision", ("mechunit", unit))
        return Supervision(state.flag("mode"), state.whole("sensitivity"))

    def set_motion_supervision(self, unit: str, supervision: Supervision) -> None:
        """Switch the collision detection of an arm, and set its level."""
        path, name = f"{_MOTION}/motionsupervision", ("mechunit-name", unit)
        what = f"setting the supervision of {unit}"
        self._do(post(path, "set-mode", name, ("mode", str(supervision.is_on))), what)
        self._do(post(path, "set-level", name, ("sensitivity", str(supervision.level))), what)

    def path_supervision(self, unit: str) -> Supervision:
        """Supervision that an arm is on its path."""
        path = f"{_MOTION}/pathsupervision"
        state = self._state(f"reading the supervision of {unit}", path, "ms-pathsupervision", ("mechunit", unit))
        return Supervision(state.flag("mode"), state.whole("level"))

    def set_path_supervision(self, unit: str, supervision: Supervision) -> None:
        """Switch the supervision that an arm is on its path, and set its level."""
        path, name, what = f"{_MOTION}/pathsupervision", ("mechunit", unit), f"setting the supervision of {unit}"
        self._do(post(path, "set-mode", name, ("mode", "ON" if supervision.is_on else "OFF")), what)
        self._do(post(path, "set-level", name, ("level", str(supervision.level))), what)

    def is_collision_predicted(self) -> bool:
        """Whether the controller stops before arms collide (Collision Avoidance)."""
        path, query = f"{_MOTION}/motionsupervision", ("action", "collision-prediction-mode")
        return self._state("reading the collision prediction", path, "ms-colpred-mode", query).flag("mode")

    def predict_collisions(self, is_on: bool) -> None:
        """Whether the controller stops before arms collide."""
        form = ("mode", "true" if is_on else "false")
        self._do(post(f"{_MOTION}/motionsupervision", "set-colpred-mode", form), "setting the collision prediction")

    def is_motion_skipped(self) -> bool:
        """Whether programs run without moving the robot (non-motion execution)."""
        path = f"{_MOTION}/nonmotionexecution"
        return self._state("reading non-motion execution", path, "ms-nonmotionexecution").flag("mode")

    def skip_motion(self, is_on: bool) -> None:
        """Let programs run without moving the robot, or not."""
        form = ("mode", "ON" if is_on else "OFF")
        self._do(post(f"{_MOTION}/nonmotionexecution", "set-mode", form), "setting non-motion execution")

    # Calibration

    def calibration(self, unit: str) -> tuple[Calibration, ...]:
        """How each joint was calibrated."""
        states = self._states(f"reading the calibration of {unit}", f"{_UNITS}/{unit}/calibrationinfo")
        names = ("jointname", "currentcalibrationmethod", "factorycalibrationmethod")
        return tuple(
            Calibration(*(state.text(name) for name in names))
            for state in states
            if state.type == "ms-calibrationinfo-joint"
        )

    def is_measurement_memory_valid(self, unit: str) -> bool:
        """Whether the data in the robot's measurement board (SMB) and in the controller are the same and valid."""
        state = self._state(f"reading the memory of {unit}", f"{_UNITS}/{unit}/smbdata", "ms-smbdata")
        return all(text in ("0", "3") for text in state.fields.values())  # 3: there is none of that kind

    def calibrated_motors(self, unit: str) -> tuple[str, ...]:
        """Names of the motors that can be calibrated."""
        states = self._states(f"reading the motors of {unit}", f"{_UNITS}/{unit}/motorcalib")
        return tuple(state.text("name") for state in states)


def _frames(tool: str, work_object: str, coordinates: Coordinates | None) -> Pairs:
    return given(
        tool=tool or None, wobj=work_object or None, coordinate=None if coordinates is None else coordinates.value
    )


def _pose_fields(pose: Pose, position: Iterable[str], orientation: Iterable[str]) -> Pairs:
    lengths = zip(position, (repr(value * _MM) for value in pose.position), strict=True)
    return (*lengths, *zip(orientation, map(repr, pose.orientation), strict=True))


def _vector(values: Iterable[float]) -> str:
    return f"[{','.join(map(repr, values))}]"


def _joint_fields(position: Joints, robot: str, external: str) -> Pairs:
    axes, axis_7 = abb_from_chain(position)
    return ((robot, _vector(axes)), (external, _vector((axis_7, 0.0, 0.0, 0.0, 0.0, 0.0))))


def _tool_fields(tool_to_flange: Pose) -> Pairs:
    return (
        ("tool_frame_position", _vector(tool_to_flange.position)),
        ("tool_frame_orientation", _vector(tool_to_flange.orientation)),
        ("robot_fixed_object", "FALSE"),
    )


def _target_fields(target: RobTarget) -> Pairs:
    external = [0.0 if angle is None else angle for angle in (*target.external, *(None,) * 6)][:6]
    return (
        ("curr_position", _vector(target.tool_to_object.position)),
        ("curr_orientation", _vector(target.tool_to_object.orientation)),
        ("curr_ext_joints", _vector(external)),
        ("robot_configuration", f"[{','.join(map(str, target.configuration))}]"),
    )


def _calculated(state: State) -> RobTarget:
    x, y, z = (state.number(f"position-{name}") for name in "xyz")
    w, i, j, k = (state.number(f"robtargetorientation-u{number}") for number in range(4))
    one, four, six, last = (state.whole(f"quarter-rev-{name}") for name in _TURNS)
    external = tuple(state.number(name) for name in state.fields if name.startswith("extjoint-"))
    return RobTarget(Pose((x, y, z), (w, i, j, k)), (one, four, six, last), external)


def _solution(state: State) -> Joints:
    axes = [state.number(f"robotjoint-{number}") for number in range(1, 7)]
    return joints(chain_from_abb(axes, state.number("extjoint-1")))
