"""The controller's mechanical units, with what their programs set.

The YuMi's units are those of reference/statemachine.md §9: each arm is one of six axes, and one of its own for the
seventh. An `ArmUnit` is one arm with its EGM client and gripper, as its RAPID task sees it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from abb_protocols.errors import RapidError
from abb_protocols.robot.joints import Pose, Side
from abb_protocols.robot.kinematics import compose_poses
from abb_protocols.rws.operations.motion import MechanicalUnitState
from abb_protocols.rws.values import Coordinates, JogMode
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.contacts import Contact
from virtual_irc5.mechanics.dynamics import ArmDynamics
from virtual_irc5.mechanics.egm_client import EgmClient
from virtual_irc5.mechanics.path import NO_LIMIT, PathAcceleration, SpeedLimit, StoredPath
from virtual_irc5.mechanics.path_geometry import CircleMode
from virtual_irc5.mechanics.virtual_gripper import VirtualGripper
from virtual_irc5.mechanics.watched_zones import WorldZone


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanicalUnit(MechanicalUnitState):
    """A mechanical unit of this controller, as clients read it (reference/statemachine.md §9, reference/rws.md §8.2).

    Attributes:
        side: the arm it belongs to.
        drive_module: number of its drive module.
    """

    side: Side
    drive_module: int = 1


def mechanical_unit(
    name: str, side: Side, task: str, *, total_axes: int, containing: str = "", integrated: str = ""
) -> MechanicalUnit:
    """A unit as a new system has it: a robot of six axes, or a single axis integrated in the unit ``containing``."""
    return MechanicalUnit(
        name=name,
        task=task,
        type="Single" if containing else "TCPRobot",
        axes=1 if containing else 6,
        total_axes=total_axes,
        containing_unit=containing,
        integrated_unit=integrated,
        tool="tool0",
        work_object="wobj0",
        payload="load0",
        total_payload="load0",
        is_synchronized=True,
        is_active=True,
        jog_mode=JogMode.AXES_1_TO_3,
        coordinates=Coordinates.WORLD,
        side=side,
    )


def seven_axis_units(name: str, side: Side, task: str) -> tuple[MechanicalUnit, MechanicalUnit]:
    """The two units of an arm with seven axes: six of one, and the seventh integrated in it."""
    seventh = f"{name}_7"
    return (
        mechanical_unit(name, side, task, total_axes=7, integrated=seventh),
        mechanical_unit(seventh, side, task, total_axes=1, containing=name),
    )


_SIX_AXES, _SEVENTH_AXES = zip(*(seven_axis_units(side.unit, side, side.task) for side in Side), strict=True)
YUMI_UNITS: tuple[MechanicalUnit, ...] = (*_SIX_AXES, *_SEVENTH_AXES)


@dataclass(slots=True)
class UnitSupervision:
    """How one mechanical unit is supervised: while it is jogged, and on its path [%].

    Attributes:
        jogging, jog_level: motion supervision of jogging and its sensitivity.
        path, path_level: motion supervision of programs and its level.
    """

    jogging: bool = True
    jog_level: int = 100
    path: bool = True
    path_level: int = 100


@dataclass(slots=True)
class UnitsState:
    """What ``/rw/motionsystem`` shows and sets beside the mechanical units.

    Attributes:
        active_unit: what is jogged; empty for the first.
        changes: rises with every change.
        supervision: by mechanical unit.
        lead_through: the units that are led by hand.
        predicts_collisions: whether collisions are predicted.
        is_non_motion: whether programs run without moving the arms.
    """

    active_unit: str = ""
    changes: int = 0
    supervision: dict[str, UnitSupervision] = field(default_factory=dict)
    lead_through: set[str] = field(default_factory=set)
    predicts_collisions: bool = True
    is_non_motion: bool = False


@dataclass(slots=True)
class _MotionSettings:
    """What a program sets for the motions that follow; each PP to main restores the defaults.

    Attributes:
        checks_lines, checks_joints: whether configurations are checked (ConfL, ConfJ).
        speed_percent, most_speed: VelSet: factor on programmed speeds [%], and the highest of the tool [mm/s].
        refreshed: SpeedRefresh [%].
        displacement: the program displacement in the work object (PDispOn), as a RAPID pose; None is none.
        offsets: of the external axes (EOffsOn) [deg], the first being the seventh axis or arm angle.
        circles: how the tool turns on circles.
        wrist_may_turn: SingArea Wrist: near a singularity the orientation may differ.
        locks_axis4: SingArea LockAxis4, which lets it differ, too.
        warns_of_corners: whether corners that become stop points are logged (CornerPathWarning).
        supervision: MotionSup and its tuning [%], None where it is off.
        load: what GripLoad has set.
        softness: of the axes (SoftAct) [%], by ABB's number.
        accelerations: AccSet's two factors, and that of stops [%].
        acceleration_limit, deceleration_limit, world_limit: PathAccLim, WorldAccLim [m/s²], None where they are off.
        path_resolution: PathResol [%], kept for programs that read it.
        has_event_buffer: ActEventBuffer, likewise.
        gains: TuneServo's of position control, 1 being the usual one, by index of the joint.
        speed_limit: SpeedLimCheckPoint and SpeedLimAxis, for while the system input LimitSpeed is set.
    """

    checks_lines: bool = True
    checks_joints: bool = True
    speed_percent: float = 100.0
    most_speed: float = 5000.0
    refreshed: float = 100.0
    displacement: Any = None
    offsets: tuple[float, ...] = (0.0,) * 6
    circles: CircleMode = CircleMode.PATH
    wrist_may_turn: bool = False
    locks_axis4: bool = False
    warns_of_corners: bool = True
    supervision: float | None = 100.0
    load: Any = None
    softness: dict[int, float] = field(default_factory=dict)
    accelerations: tuple[float, float, float] = (100.0, 100.0, 100.0)
    acceleration_limit: float | None = None
    deceleration_limit: float | None = None
    world_limit: float | None = None
    path_resolution: float = 100.0
    has_event_buffer: bool = True
    gains: dict[int, float] = field(default_factory=dict)
    speed_limit: SpeedLimit = NO_LIMIT


@dataclass(slots=True)
class ArmUnit:
    """What the instructions of one task act on.

    Attributes:
        arm: the arm.
        egm: its EGM client.
        gripper: its gripper.
        has_moved: whether a RAPID motion has run since the controller started; EGM wants that before its first run.
        egm_identities: names of the variables that hold an EGM identity.
        egm_device: name of the UDPUC device EGMSetupUC chose last.
        tool, wobj: RAPID values of the last motion's tool and work object; None until there was one.
        settings: what the program has set for its motions.
        zones: the world zones that are watched.
        synchronized_tasks: whose moves begin together with its own (SyncMoveOn), its own among them.
        suspended_tasks: the same while synchronization is suspended (SyncMoveSuspend).
        stored_paths: what StorePath has put aside, until RestoPath.
        led: the mechanical units that are led by hand (SetLeadThrough), of all arms.
        observers: called in each cycle, such as those of test signals, by what they are for.
        faults: what stops RAPID, as a world zone or the removal of an observer: number and title of the event, and why.
        beginnings: called when the program begins at main, by what they are for.
        limits_speed: whether the system input LimitSpeed is set.
        contact: of ContactL, while it moves the arm; None otherwise.
        task: name of the task that moves it.
        is_started: whether that task is started.
    """

    arm: VirtualArm
    egm: EgmClient
    gripper: VirtualGripper
    has_moved: bool = False
    egm_identities: set[str] = field(default_factory=set)
    egm_device: str = ""
    tool: Any = None
    wobj: Any = None
    settings: _MotionSettings = field(default_factory=_MotionSettings)
    zones: list[WorldZone] = field(default_factory=list)
    synchronized_tasks: tuple[str, ...] = ()
    suspended_tasks: tuple[str, ...] = ()
    stored_paths: list[StoredPath] = field(default_factory=list)
    led: set[str] = field(default_factory=set)
    observers: dict[str, Callable[[], None]] = field(default_factory=dict)
    faults: list[tuple[int, str, str]] = field(default_factory=list)
    beginnings: dict[str, Callable[[], None]] = field(default_factory=dict)
    limits_speed: bool = False
    contact: Contact | None = None
    task: str = ""
    is_started: Callable[[], bool] = lambda: True

    def __post_init__(self) -> None:
        self.egm_device = self.egm_device or self.arm.unit

    def begin_program(self) -> None:
        """The program begins at main: its motion settings are the default ones, and what was planned is forgotten."""
        self.settings = _MotionSettings()
        self.zones.clear()
        self.synchronized_tasks = self.suspended_tasks = ()
        self.stored_paths.clear()
        for begin in self.beginnings.values():
            begin()
        path = self.arm.path
        path.holds.clear()
        path.acceleration = PathAcceleration()
        self.arm.tune()
        self.limit_speed()
        if self.arm.is_stationary:
            path.restart_at(self.arm.planned)
        else:
            path.abandon()

    @property
    def path_level(self) -> int:
        """2 between StorePath and RestoPath, otherwise 1."""
        return 1 + len(self.stored_paths)

    def has_unit(self, name: str) -> bool:
        """Whether a mechanical unit is this arm's: the robot, or the unit of its seventh axis."""
        return name.upper() in (self.arm.unit.upper(), f"{self.arm.unit}_7".upper())

    @property
    def dynamics(self) -> ArmDynamics:
        """Of the arm with what its tool flange carries."""
        return ArmDynamics(self.side, self.arm.model.payload)

    @property
    def mechanical_unit(self) -> str:
        """Name of the mechanical unit that the task moves."""
        return self.arm.unit

    def observe(self) -> None:
        """Follow the arm in each cycle: what measures it, and whether its tool is in a world zone."""
        for name, observer in list(self.observers.items()) if self.observers else ():
            try:
                observer()
            except RapidError as error:  # such as a signal that a restart has taken away; the cycle goes on
                del self.observers[name]
                self.faults.append((40228, "Execution error", f"The {name} are no longer followed: {error}"))
        if not self.zones:
            return
        planned = self.arm.planned
        point = self.arm.tool_pose(planned, None)
        if self.tool is not None:
            (x, y, z), (w, i, j, k) = self.tool.tframe
            point = compose_poses(point, Pose((x * 1e-3, y * 1e-3, z * 1e-3), (w, i, j, k)))
        for zone in self.zones:
            zone.watch(point.position, planned)

    def override_speed(self, ratio: float) -> None:
        """Follow the controller's speed override [%]; 0 is very slow."""
        self.arm.path.set_override(max(ratio * self.settings.refreshed / 1e4, 0.01))

    def limit_speed(self) -> None:
        """Follow the program's speed limits and the system input that makes them count."""
        self.arm.path.set_speed_limit(self.settings.speed_limit if self.limits_speed else NO_LIMIT)

    def forget_egm(self) -> None:
        """The controller restarts: all state of EGM is lost."""
        self.egm.power_down()
        self.egm_identities.clear()
        self.has_moved = False

    @property
    def side(self) -> Side:
        return self.arm.side


def unit_of(name: str, own: ArmUnit, robots: Sequence[ArmUnit]) -> ArmUnit:
    """The arm a mechanical unit belongs to, ``own`` where it is none of the robots'."""
    return next((each for each in robots if each.has_unit(name)), own)
