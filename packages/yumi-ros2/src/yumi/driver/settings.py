"""Settings of the user: two YAML files, read once into frozen values; an unknown key is refused.

Each group is a dataclass; a field's metadata gives its unit and bounds, which the refusals quote.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields, is_dataclass, replace
from enum import Enum
from functools import partial
from ipaddress import ip_address
from math import hypot, inf
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints

from abb_protocols.catalogue import Message, message, quoted, said_by
from abb_protocols.errors import CommandRefused, SettingsError
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Pose, Side, Vector, by_side
from abb_protocols.robot.kinematics import quaternion_from_euler_zyx
from abb_runtime.parameters import (
    Parameter,
    ParameterFile,
    ParameterFileEntry,
    ParameterType,
    Values,
    bounded,
    read_mapping,
    read_parameter_file,
)
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.login import MAX_PORT, VIRTUAL_RWS_PORT
from abb_runtime.udp import address_of_host, address_towards, is_loopback
from yumi.control.collisions import COLLISION_MARGIN
from yumi.control.speed_scale import FULL_SPEED
from yumi.control.tool_limits import TOP_TOOL_SPEED, ToolLimits, Wall
from yumi.core.collision import TOOL_FRAME, CollisionModel, CollisionPart, Obstacle, check_declared
from yumi.driver.control_process import WakeMode
from yumi.driver.controller_names import STREAM_CONTROLLER
from yumi.driver.launch_checks import EgmAddress
from yumi.driver.recovery import RecoverySettings
from yumi.driver.speed_setting import FIRST_SPEED_SCALE, LOWEST_SPEED_SCALE
from yumi.driver.state_machine import EgmMotionSettings
from yumi.driver.watchdog import WatchdogSettings

_AUTO = "auto"
_NAMESPACE = re.compile(r"/?(?:[A-Za-z_][A-Za-z0-9_]*/)*(?:[A-Za-z_][A-Za-z0-9_]*)?/?")
_PREFIX = re.compile(r"(?:[A-Za-z][A-Za-z0-9_]*)?")
_UPDATE_RATE = 250  # [Hz] as ros2_control's files give it

MANAGER_SETTINGS = (".type", ".initial_state", "update_rate")
"""How the settings of a controller manager end; the first two come after a controller's name."""


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """Where the robot is and how to log in.

    Attributes:
        address: the controller's address; 192.168.125.1 is the service port of every IRC5.
        rws_port: HTTP port of Robot Web Services.
        user: user name; ABB's default is public knowledge.
        password: its password; never shown, as no field that has no part in ``repr``.
        timeout: longest wait for one answer [s].
        speed_scale: the factor on the speed of every controller; None (``auto``) is 1 for a robot on this machine and
            0.1 for any other.
    """

    address: str = "192.168.125.1"
    rws_port: int = bounded(80, 1, MAX_PORT)
    user: str = "Default User"
    password: str = field(default="robotics", repr=False)
    timeout: float = bounded(2.0, 0.1, 4.0, "s")
    speed_scale: float | None = bounded(None, LOWEST_SPEED_SCALE, FULL_SPEED)

    @property
    def host_and_port(self) -> str:
        """Where Robot Web Services are, as commands and messages say it."""
        return f"{self.address}:{self.rws_port}"

    @property
    def is_on_this_machine(self) -> bool:
        """Whether it has an address of this machine, and is no real one unless a tunnel begins there."""
        return ip_address(address_of_host(self.address)).is_loopback

    @property
    def first_speed_scale(self) -> float:
        """What speeds begin with: slow at a robot that is not on this machine, unless the settings say otherwise."""
        if self.speed_scale is not None:
            return self.speed_scale
        return FULL_SPEED if self.is_on_this_machine else FIRST_SPEED_SCALE

    def client(self) -> RwsClient:
        """A client of the controller, not connected yet."""
        return RwsClient(self.host_and_port, user=self.user, password=self.password, timeout=self.timeout)


@dataclass(frozen=True, slots=True)
class EgmSettings:
    """Our end of EGM.

    Attributes:
        listen: local address for the robot's datagrams; ``auto`` takes the one that faces the robot.
        left_port: UDP port of the left arm, as in the controller's UDPUC device ROB_L.
        right_port: UDP port of the right arm, as in ROB_R.
        silence: the robot is lost after this time without a datagram [s].
        wake: how the control process waits: ``auto`` or ``blocking``.
    """

    listen: str = _AUTO
    left_port: int = bounded(6511, 1, MAX_PORT)
    right_port: int = bounded(6512, 1, MAX_PORT)
    silence: float = bounded(0.08, 0.02, 0.09, "s")
    wake: WakeMode = WakeMode.AUTO

    def port(self, side: Side) -> int:
        """The UDP port of one arm."""
        return self.left_port if side is Side.LEFT else self.right_port

    def listen_for(self, robot: str) -> str:
        """The local address for the datagrams of the robot at an IP address."""
        return address_towards(robot) if self.listen == _AUTO else self.listen

    def addresses(self, robot: str) -> dict[Side, EgmAddress]:
        """Where each arm's datagrams are awaited of the robot at an IP address."""
        host = self.listen_for(robot)
        return {side: EgmAddress(host, self.port(side)) for side in Side}


class CalibrateWhen(Enum):
    """When a gripper is calibrated without being asked for."""

    AT_START = "at_start"
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class GripperSettings:
    """Both grippers.

    Attributes:
        right: modules of the right gripper.
        left: modules of the left gripper.
        force: holding force where a goal names none [N].
        speed: of each finger where a goal names none [m/s].
        timeout: a gripper that has not come to rest after this time has failed [s].
        picked_pressure: a vacuum module whose pressure is not above this has picked something [Pa].
        calibrate: whether a gripper that needs it is calibrated when the robot becomes ready, which closes its fingers.
        test_at_start: whether each gripper is closed once when the driver starts, to see that it does.
    """

    right: GripperModules = GripperModules.SERVO
    left: GripperModules = GripperModules.SERVO
    force: float = bounded(10.0, 0.1, 20.0, "N")
    speed: float = bounded(0.025, 0.003, 0.025, "m/s")
    timeout: float = bounded(10.0, 0.5, 60.0, "s")
    picked_pressure: float = bounded(70_000.0, 5_000.0, 95_000.0, "Pa")
    calibrate: CalibrateWhen = CalibrateWhen.AT_START
    test_at_start: bool = False

    def modules(self, side: Side) -> GripperModules:
        """Modules of one gripper."""
        return self.left if side is Side.LEFT else self.right


@dataclass(frozen=True, slots=True)
class BoxSettings:
    """Something that stands around the robot.

    Attributes:
        position: of its middle in ``yumi_body``, the robot's foot [m], (3,).
        size: its edges along its own x, y, z [m], (3,).
        rpy: how it is turned: roll, pitch, yaw about fixed axes [rad], (3,).

    Raises:
        SettingsError: there are not three values, or an edge has no length.
    """

    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    size: tuple[float, ...] = (0.0, 0.0, 0.0)
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("position", "size", "rpy"):
            _three("collision: boxes", name, getattr(self, name))
        if min(self.size) <= 0.0:
            raise SettingsError(message("box_without_size", place="collision: boxes", size=self.size))


@dataclass(frozen=True, slots=True)
class ToolSettings:
    """A part that an arm carries: a finger, a tool, an object that it holds; a capsule.

    Attributes:
        start: one end of its axis in ``yumi_tool0`` of the arm [m], (3,).
        end: the other end [m], (3,).
        radius: around the axis, as measured [m].

    Raises:
        SettingsError: there are not three values.
    """

    start: tuple[float, ...] = (0.0, 0.0, 0.0)
    end: tuple[float, ...] = (0.0, 0.0, 0.0)
    radius: float = bounded(0.01, 0.001, 0.5, "m")

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            _three("collision: tools", name, getattr(self, name))


def _three(place: str, name: str, values: tuple[float, ...]) -> None:
    if len(values) != len(("x", "y", "z")):
        raise SettingsError(message("setting_is_no_vector", place=place, setting=name, count=len(values)))


@dataclass(frozen=True, slots=True)
class CollisionSettings:
    """What keeps both arms apart from each other, from the body and from what stands around the robot.

    Attributes:
        enabled: whether commands are limited by it; without it the arms can hit each other.
        margin: no two parts come nearer to each other [m]; from the robot's own body half of the padding is kept.
        boxes: what stands around the robot, by name.
        right_tools: what the right arm carries beside its gripper, by name.
        left_tools: the same of the left arm.

    Raises:
        CommandRefused: there are too many boxes or tools, or the name of one means something else.
    """

    enabled: bool = True
    margin: float = bounded(COLLISION_MARGIN, 0.0, 0.2, "m")
    boxes: Mapping[str, BoxSettings] = field(default_factory=dict)
    right_tools: Mapping[str, ToolSettings] = field(default_factory=dict)
    left_tools: Mapping[str, ToolSettings] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_declared(self.tools(), self.obstacles())

    @property
    def remarks(self) -> tuple[Message, ...]:
        """What a person is to know of it at every start."""
        return () if self.enabled else (message("nothing_keeps_arms_apart"),)

    def tools(self) -> Mapping[Side, tuple[CollisionPart, ...]]:
        """What each arm carries beside its gripper."""
        return {
            side: tuple(
                CollisionPart(name, TOOL_FRAME, _vector(it.start), _vector(it.end), it.radius)
                for name, it in own.items()
            )
            for side, own in by_side(self.right_tools, self.left_tools).items()
        }

    def obstacles(self) -> tuple[Obstacle, ...]:
        """What stands around the robot."""
        return tuple(
            Obstacle(name, Pose(_vector(it.position), quaternion_from_euler_zyx(_vector(it.rpy))), _vector(it.size))
            for name, it in self.boxes.items()
        )

    def model(self, grippers: Mapping[Side, GripperModules]) -> CollisionModel:
        """The shapes of a robot with these grippers."""
        return CollisionModel(grippers, tools=self.tools(), obstacles=self.obstacles())


def _vector(values: tuple[float, ...]) -> Vector:
    x, y, z = values
    return (x, y, z)


@dataclass(frozen=True, slots=True)
class WallSettings:
    """A plane behind which the tools stay.

    Attributes:
        point: on it, in ``yumi_body`` [m], (3,).
        normal: to the side where the tools may be, of any length, (3,).

    Raises:
        SettingsError: there are not three values, or the normal has no direction.
    """

    point: tuple[float, ...] = (0.0, 0.0, 0.0)
    normal: tuple[float, ...] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for name in ("point", "normal"):
            _three("tool_limits: walls", name, getattr(self, name))
        if not 1e-6 < hypot(*self.normal) < inf:
            raise SettingsError(message("wall_without_direction", place="tool_limits: walls", normal=self.normal))


@dataclass(frozen=True, slots=True)
class ToolLimitSettings:
    """What the tools keep on lines and streams of ``cartesian_controller``; motions in joints are not limited by it.

    Attributes:
        speed: of the tool's centre point, at most [m/s].
        walls: behind which it stays, by name.
    """

    speed: float = bounded(TOP_TOOL_SPEED, 0.01, TOP_TOOL_SPEED, "m/s")
    walls: Mapping[str, WallSettings] = field(default_factory=dict)

    @property
    def limits(self) -> ToolLimits:
        """The same for controllers and planners."""
        walls = []
        for name, wall in self.walls.items():
            length = hypot(*wall.normal)
            x, y, z = wall.normal
            walls.append(Wall(name, _vector(wall.point), (x / length, y / length, z / length)))
        return ToolLimits(self.speed, tuple(walls))


@dataclass(frozen=True, slots=True)
class RosSettings:
    """The ROS 2 side.

    Attributes:
        merged_rate: how often ``joint_states`` of both arms and fingers is published [Hz].
        bringup: whether the driver brings the robot to ready at start; else it only reads until it is asked for more.
            None (``auto``) is a robot on this machine only: a real one is brought up where a call or a file says so.
        initial_joint_controller: the controller that commands an arm after EGM has started, unless another one did
            before EGM ended by itself.
        namespace: of the robot, before ``r`` and ``l``, such as ``cell1``; empty for the only robot of a ROS graph.
        prefix: before the names of all joints and links, such as ``a_``.
        publish_tf: whether ``/tf`` and ``/tf_static`` are published; else the user's robot_state_publisher does it.
        tf_rate: how often ``/tf`` and ``tcp_pose`` are published [Hz].
        frame_prefix: before the names of all frames on ``/tf``; None (``auto``) is the namespace and a slash.

    Raises:
        SettingsError: a name is not one of ROS's.
    """

    merged_rate: float = bounded(100.0, 1.0, 250.0, "Hz")
    bringup: bool | None = None
    initial_joint_controller: str = STREAM_CONTROLLER
    namespace: str = ""
    prefix: str = ""
    publish_tf: bool = True
    tf_rate: float = bounded(50.0, 1.0, 250.0, "Hz")
    frame_prefix: str | None = None

    def __post_init__(self) -> None:
        if not _NAMESPACE.fullmatch(self.namespace):
            raise SettingsError(message("namespace_not_of_ros", setting="ros: namespace", value=self.namespace))
        if not _PREFIX.fullmatch(self.prefix):
            raise SettingsError(message("prefix_not_of_ros", setting="ros: prefix", value=self.prefix))

    def brings_up(self, *, is_real: bool) -> bool:
        """Whether the driver brings the robot to ready when it starts: a real one only where that is named."""
        return not is_real if self.bringup is None else self.bringup

    @property
    def root(self) -> str:
        """The namespace from the root of the ROS graph, ``/cell1``; empty without one."""
        name = self.namespace.strip("/")
        return f"/{name}" if name else ""

    @property
    def frames(self) -> str:
        """What stands before the name of each frame."""
        return self.root[1:] + "/" * bool(self.root) if self.frame_prefix is None else self.frame_prefix


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """Flight records: ten seconds of an arm before something stops its motion, and two after it.

    Attributes:
        folder: where they go, from where the driver was started.
        keep: how many stay; the oldest ones make room.
    """

    folder: str = "build/flight_records"
    keep: int = bounded(50, 1, 10_000)


class InitialState(Enum):
    """State of a controller when the driver starts."""

    UNLOADED = "unloaded"
    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    ACTIVE = "active"


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """One controller of ``controllers.yaml``.

    Attributes:
        name: its name.
        kind: its type string.
        entries: its parameters.
        state: its state when the driver starts; None: active when it only reads, else inactive.
        place: where in the file it is listed.
    """

    name: str
    kind: str
    entries: Mapping[str, ParameterFileEntry] = field(default_factory=dict)
    state: InitialState | None = None
    place: str = ""

    @property
    def values(self) -> Values:
        """Its parameters' values."""
        return {key: entry.value for key, entry in self.entries.items()}


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything a user may set."""

    robot: RobotSettings = field(default_factory=RobotSettings)
    egm: EgmSettings = field(default_factory=EgmSettings)
    egm_motion: EgmMotionSettings = field(default_factory=EgmMotionSettings)
    gripper: GripperSettings = field(default_factory=GripperSettings)
    watchdog: WatchdogSettings = field(default_factory=WatchdogSettings)
    recovery: RecoverySettings = field(default_factory=RecoverySettings)
    collision: CollisionSettings = field(default_factory=CollisionSettings)
    tool_limits: ToolLimitSettings = field(default_factory=ToolLimitSettings)
    ros: RosSettings = field(default_factory=RosSettings)
    recorder: RecorderSettings = field(default_factory=RecorderSettings)


def config_folder() -> Path:
    """The folder with the delivered ``yumi.yaml`` and ``controllers.yaml``."""
    package = Path(__file__).resolve().parents[1]  # colcon may have linked the package, not the folder beside it
    installed = package / "config"
    return installed if installed.is_dir() else package.parents[3] / "config"


def read_settings(path: Path | None = None) -> Settings:
    """Settings from ``path``, by default the delivered ``yumi.yaml``.

    Raises:
        SettingsError: the file is missing, not YAML, or a key or value in it is not allowed.
    """
    path = path or config_folder() / "yumi.yaml"
    return Settings(**_checked(Settings, read_mapping(path), path.name))


def read_controllers(side: Side, path: Path | None = None) -> tuple[ControllerSettings, ...]:
    """The controllers of one arm from ``path``, by default the delivered ``controllers.yaml``.

    The file has ros2_control's format: ``/<namespace>/controller_manager: ros__parameters`` lists names and types,
    ``/<namespace>/<name>: ros__parameters`` their parameters; see :mod:`abb_runtime.parameters` for wildcards.

    Raises:
        SettingsError: the file is missing, not YAML, or a key or value in it is not allowed.
    """
    file = read_parameter_file(path or config_folder() / "controllers.yaml")
    listed = {each: _listed_controllers(file, each) for each in Side}
    file.check_nodes(
        f"/{each.value}/{name}" for each, entries in listed.items() for name in ("controller_manager", *entries)
    )
    if not listed[side]:
        raise SettingsError(message("no_controller_listed", file=file.name, name=f"/{side.value}/controller_manager"))
    return tuple(
        replace(settings, entries=file.parameters(f"/{side.value}/{name}")) for name, settings in listed[side].items()
    )


def _listed_controllers(file: ParameterFile, side: Side) -> dict[str, ControllerSettings]:
    """Names, types and initial states; other parameters of the controller manager are refused."""
    entries = file.parameters(f"/{side.value}/controller_manager")
    names = [
        key.removesuffix(".type")
        for key, entry in entries.items()
        # Under a wildcard it may be a parameter of another node; types of controllers have a slash in them.
        if key.endswith(".type") and (not entry.is_general or "/" in str(entry.value))
    ]
    for key, entry in entries.items():
        name, _, word = key.rpartition(".")
        if entry.is_general or (name in names and f".{word}" in MANAGER_SETTINGS):
            continue
        if key == "update_rate" and entry.value == _UPDATE_RATE:
            continue
        raise SettingsError(
            message(
                "controller_manager_setting_unknown",
                place=entry.place,
                setting=key,
                value=quoted(entry.value),
                rate=_UPDATE_RATE,
            )
        )
    states = {each.value: each for each in InitialState}
    listed: dict[str, ControllerSettings] = {}
    for name in names:
        kind, state = entries[f"{name}.type"], entries.get(f"{name}.initial_state")
        if not isinstance(kind.value, str):
            raise SettingsError(_at(kind.place, _wrong_type(f"{name}.type", kind.value, ParameterType.STRING)))
        if state is not None and state.value not in states:
            no_choice = message(
                "value_not_a_choice",
                parameter=f"{name}.initial_state",
                value=quoted(state.value),
                choices=tuple(states),
            )
            raise SettingsError(_at(state.place, no_choice))
        initial = None if state is None else states[str(state.value)]
        listed[name] = ControllerSettings(name, kind.value, state=initial, place=kind.place)
    return listed


def address_values(address: str) -> dict[str, Any]:
    """The values of :class:`RobotSettings` that an address gives, ``host`` or ``host:port``.

    Without a port it is 8080 on this machine, where ``yumi controller`` serves; for any other it stays what it is, 80.

    Raises:
        SettingsError: it is no address.
    """
    host, colon, port = address.rpartition(":") if address.count(":") == 1 else (address, "", "")
    if not host or (colon and not port.isdigit()):
        raise SettingsError(message("no_address", address=address))
    if colon:
        return {"address": host, "rws_port": int(port)}
    return {"address": host, "rws_port": VIRTUAL_RWS_PORT} if is_loopback(host) else {"address": host}


def override(settings: Settings, values: Mapping[str, Mapping[str, Any]], place: str) -> Settings:
    """``settings`` with some values replaced, which keep the same bounds as those in a file.

    Args:
        settings: what holds where nothing is replaced.
        values: group by name, each with its values by name.
        place: where the values come from, for the refusal.

    Raises:
        SettingsError: a name or value is not allowed.
    """
    groups = {}
    for name, group in values.items():
        given = _checked(type(getattr(settings, name)), group, f"{place}: {name}")
        groups[name] = _made(partial(replace, getattr(settings, name)), given, f"{place}: {name}")
    return replace(settings, **groups)


def _made(kind: Callable[..., Any], values: Mapping[str, Any], place: str) -> Any:
    """A group of ``values``; what else refuses them does not know where they stand."""
    try:
        return kind(**values)
    except CommandRefused as refusal:
        raise SettingsError(_at(place, said_by(refusal))) from refusal


def _at(place: str, reason: Message) -> Message:
    return message("setting_refused", place=place, reason=reason)


def _wrong_type(name: str, value: object, kind: ParameterType) -> Message:
    return message("value_of_wrong_type", parameter=name, value=quoted(value), type=kind.value)


def _checked(kind: type, values: object, place: str) -> dict[str, Any]:
    """The arguments of the dataclass ``kind`` that ``values`` of a file make."""
    if not isinstance(values, dict):
        raise SettingsError(message("setting_needs_mapping", place=place, value=quoted(values)))
    hints = get_type_hints(kind)
    known = {item.name: item for item in fields(kind)}
    for key in values:
        if key not in known:
            raise SettingsError(message("setting_unknown", place=place, setting=str(key), known=tuple(known)))
    return {key: _value(known[key], hints[key], value, place) for key, value in values.items()}


def _value(item: Field[Any], kind: Any, value: object, group: str) -> object:
    place = f"{group}: {item.name}"
    if isinstance(kind, type) and is_dataclass(kind):
        return _made(kind, _checked(kind, value, place), place)
    if get_origin(kind) is Mapping:  # by names of the user's own
        if not isinstance(value, dict):
            raise SettingsError(message("setting_needs_names", place=place, value=quoted(value)))
        _, element = get_args(kind)
        return {str(name): element(**_checked(element, each, f"{place}: {name}")) for name, each in value.items()}
    if NoneType in get_args(kind):
        if value is None or value == _AUTO:
            return None
        (kind,) = (each for each in get_args(kind) if each is not NoneType)
    if get_origin(kind) is tuple:
        numbers = Parameter(item.name, (0.0,))
        try:
            return numbers.accept(value)
        except CommandRefused as refusal:
            raise SettingsError(_at(group, said_by(refusal))) from refusal
    is_choice = issubclass(kind, Enum)
    rule = Parameter(
        item.name,
        next(iter(kind)).value if is_choice else kind(),
        item.metadata.get("lowest", -inf),
        item.metadata.get("highest", inf),
        item.metadata.get("unit", ""),
        choices=tuple(each.value for each in kind) if is_choice else (),
    )
    try:
        accepted = rule.accept(value)
    except CommandRefused as refusal:
        if not item.repr:  # a password: its value is not shown
            raise SettingsError(message("secret_is_no_text", place=place)) from None
        raise SettingsError(_at(group, said_by(refusal))) from refusal
    return kind(accepted)
