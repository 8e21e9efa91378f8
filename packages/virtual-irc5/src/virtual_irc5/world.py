"""The whole virtual robot: controller, arms, grippers and EGM clients, advanced together by one cycle at a time.

Faults are injected into it over HTTP at ``/virtual/faults``, which no ABB controller has: ``GET /virtual/faults`` lists
them, ``POST /virtual/faults/<name>`` injects one; ``side``, ``duration``, ``by`` and ``way`` are in the form. Only
programs of the same machine are served, without a login; web pages are not.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from ipaddress import IPv4Address
from math import inf, isfinite, radians
from typing import TYPE_CHECKING

from abb_protocols.errors import CommandRefused, NoConnection, YumiError
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Joints, Side
from abb_protocols.rws.documents import Pairs, decode_form, first_value
from abb_protocols.rws.values import ControllerState, OperatingMode
from abb_runtime.faults import FAULTS_PATH, Fault, FaultDirection, FaultKind, fault_named
from abb_runtime.udp import host_of_url, is_loopback
from virtual_irc5.controller.identity import Identity
from virtual_irc5.controller.installed_system import ROBOTWARE_6, InstalledRobot, System, delivered_system
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.contacts import ContactDetector
from virtual_irc5.mechanics.egm_client import EgmClient, EgmOptions
from virtual_irc5.mechanics.egm_network import LASTING, SINGLE, EgmNetwork, Outgoing
from virtual_irc5.mechanics.egm_parameters import EgmParameters
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.mechanics.virtual_gripper import CupObject, VirtualGripper, Workpiece
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.system_parameters import SystemConfiguration

if TYPE_CHECKING:
    from virtual_irc5.rws.rws_service import RwsService

_EGM_PORTS = {Side.LEFT: "6511", Side.RIGHT: "6512"}  # where the system parameters name none
_ADD_IN = "StateMachine Core"
"""The option whose interface our program has; clients look for it."""

_NOWHERE = "127.0.0.1", 9
"""The discard port."""

LARGEST_PORT = 65535
_DIGITS_OF_PORT = 5


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """What kind of robot there is.

    Attributes:
        robot_name: name of controller and system; that of a new robot of the kind where it is empty.
        robotware: version that the controller names.
        workpieces: what each gripper's fingers find; an arm that is left out finds nothing.
        gripper_modules: modules of each gripper; servo alone for an arm that is left out.
        cup_objects: what lies under the cups of each gripper's vacuum modules; an arm that is left out finds nothing.
        positions: where the arms stand at first, chain order [rad], (7,); home for an arm that is left out.
        arm_model: dynamics of both arms.
        egm_parameters: what of the dynamics under EGM is otherwise.
        egm_host: address the arms send their datagrams to.
        egm_ports: UDP ports of arms that do not use those of ``SIO.cfg`` (left 6511, right 6512).
        egm: what kind of EGM clients the arms have; their cycle is that of the whole robot.
        grippers_are_calibrated: whether the grippers start calibrated.
        start_time: what the controller's clock shows at first [s]; seconds since 1970 where people read it.
        system: programs and parameters; the state machine of this package when it is None.
    """

    robot_name: str = ""
    robotware: str = ROBOTWARE_6
    workpieces: Mapping[Side, Workpiece] = field(default_factory=dict)
    gripper_modules: Mapping[Side, GripperModules] = field(default_factory=dict)
    cup_objects: Mapping[Side, CupObject] = field(default_factory=dict)
    positions: Mapping[Side, Joints] = field(default_factory=dict)
    arm_model: ArmModel = field(default_factory=ArmModel)
    egm_parameters: EgmParameters = field(default_factory=EgmParameters)
    egm_host: str = "127.0.0.1"
    egm_ports: Mapping[Side, int] = field(default_factory=dict)
    egm: EgmOptions = field(default_factory=EgmOptions)
    grippers_are_calibrated: bool = False
    start_time: float = 0.0
    system: System | None = None


class World:
    """The virtual robot; nothing in it reads a clock.

    Attributes:
        controller: the IRC5.
        arms: the arms by side.
        grippers: the grippers by side.
        egm: the EGM clients by side.
        network: carries the datagrams of both arms.
        cycle_time: how long a cycle is [s].
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        settings = settings or WorldSettings()
        self.cycle_time = settings.egm.cycle_time
        system = settings.system or delivered_system()
        self._units: dict[Side, ArmUnit] = {}
        robot = system.robot
        for side, kinematics_of in robot.arms.items():
            arm = _virtual_arm(robot, side, kinematics_of(), settings)
            gripper = VirtualGripper(
                settings.workpieces.get(side),
                settings.gripper_modules.get(side, GripperModules.SERVO),
                is_calibrated=settings.grippers_are_calibrated,
            )
            for cup in gripper.cups.values():
                cup.under = settings.cup_objects.get(side)
            self._units[side] = ArmUnit(arm, EgmClient(arm, settings.egm), gripper)
        self.arms: Mapping[Side, VirtualArm] = {side: one.arm for side, one in self._units.items()}
        self.grippers: Mapping[Side, VirtualGripper] = {side: one.gripper for side, one in self._units.items()}
        self.egm: Mapping[Side, EgmClient] = {side: one.egm for side, one in self._units.items()}
        self.network = EgmNetwork(self.cycle_time, names={side: arm.kinematics.name for side, arm in self.arms.items()})
        self._egm_host = settings.egm_host
        name = settings.robot_name or robot.system_name
        options = tuple(each for each in robot.options if not (system.is_factory and each == _ADD_IN))
        self.controller = Irc5(
            tuple(self._units.values()),
            system,
            _configured(system.configuration(), settings, robot),
            Identity(
                system_name=name,
                controller_name=name,
                robotware=settings.robotware,
                options=options,
            ),
            settings.start_time,
        )
        self._contacts: ContactDetector | None = None
        if robot.is_yumi and len(self.arms) > 1:
            modules = {side: gripper.modules for side, gripper in self.grippers.items()}
            self._contacts = ContactDetector(modules, self._positions)

    def exchange(self, inboxes: Mapping[Side, Sequence[bytes]]) -> list[Outgoing]:
        """One cycle with what can go wrong between the robot and the driver.

        Args:
            inboxes: datagrams of the driver that came for each arm since the last cycle, oldest first.

        Returns:
            The datagrams to the driver, in this order.
        """
        self.network.advance(self.cycle_time)
        return self.network.leaving(self.cycle(self.network.arriving(inboxes)))

    def cycle(self, inboxes: Mapping[Side, Sequence[bytes]]) -> dict[Side, bytes]:
        """One cycle, of 4.032 ms unless the settings say otherwise.

        Args:
            inboxes: datagrams that came for each arm since the last cycle, oldest first.

        Returns:
            The datagram of each arm that has one to send.
        """
        self.controller.advance(self.cycle_time)
        datagrams = {}
        for side, unit in self._units.items():
            # A controller that restarts neither receives nor sends.
            datagram = None if self.controller.is_restarting else unit.egm.cycle(inboxes.get(side, ()))
            if datagram is not None:
                datagrams[side] = datagram
            unit.gripper.advance(self.cycle_time)
            unit.arm.advance(self.cycle_time)
        if self._contacts is not None:
            # An arm that meets something stands where it met it.
            fingers = {side: gripper.position for side, gripper in self.grippers.items()}
            supervised = [side for side in self.arms if self.controller.supervises_motion(side)]
            for side, met in self._contacts.touched(self._positions, fingers, supervised).items():
                self.controller.collide(side, met)
                self.arms[side].strike(self._contacts.free[side])
        self.controller.supervise()
        return datagrams

    @property
    def _positions(self) -> dict[Side, Joints]:
        return {side: arm.position for side, arm in self.arms.items()}

    def egm_destination(self, side: Side) -> tuple[str, int]:
        """Address and port of the UDPUC device the arm sends its datagrams to.

        Programs may change the device (WriteCfgData), and clients too: an address elsewhere than on this machine
        stands for the host of the settings, the only other one anything is sent to. Names are not looked up.

        Raises:
            NoConnection: the device names no IP address, or no port.
        """
        device = self.controller.effective.find("SIO", "COM_TRP", self._units[side].egm_device)
        if device is None:  # from the factory: EGM cannot be set up, so that nothing is sent
            return _NOWHERE
        host, port = device.attributes.get("RemoteAdress", ""), device.attributes.get("RemotePortNumber", "")
        if not (port.isascii() and port.isdigit() and len(port) <= _DIGITS_OF_PORT and 1 <= int(port) <= LARGEST_PORT):
            raise NoConnection(f"The UDPUC device {device.name} has the port '{port}'; use 1 to {LARGEST_PORT}.")
        if host == self._egm_host or is_loopback(host):
            return host, int(port)
        try:
            IPv4Address(host)
        except ValueError as error:
            sentence = f"The UDPUC device {device.name} has the address '{host}'; use an IP address, such as 10.0.0.2."
            raise NoConnection(sentence) from error
        return self._egm_host, int(port)


def _virtual_arm(robot: InstalledRobot, side: Side, kinematics: KinematicArm, settings: WorldSettings) -> VirtualArm:
    """An arm of the robot: a YuMi's has the dynamics of the settings, others have limits of their own."""
    if robot.is_yumi:
        model = settings.egm_parameters.applied(settings.arm_model, kinematics.axes)
        return VirtualArm(side, settings.positions.get(side), model)
    model = replace(settings.arm_model, limits=kinematics.limits, supervises_load=False)
    model = settings.egm_parameters.applied(model, kinematics.axes)
    return VirtualArm(side, settings.positions.get(side), model, kinematics, robot.unit_of(side))


def _configured(
    configuration: SystemConfiguration, settings: WorldSettings, robot: InstalledRobot
) -> SystemConfiguration:
    """The addresses of this machine instead of the robot cell's, and the gain of EGM that is set."""
    gain = settings.egm_parameters.position_gain
    for each in configuration.instances("MOC", "EXT_MOTION_DATA") if gain is not None else ():
        configuration.change("MOC", "EXT_MOTION_DATA", each.name, {"ext_motion_Kp": f"{gain:g}"})
    for side in () if settings.system and settings.system.is_factory else robot.arms:
        unit = robot.unit_of(side)
        address = {"RemoteAdress": settings.egm_host}
        if side in settings.egm_ports:
            address["RemotePortNumber"] = str(settings.egm_ports[side])
        if configuration.find("SIO", "COM_TRP", unit) is None:
            configuration.put("SIO", "COM_TRP", {"Name": unit, "Type": "UDPUC", "RemotePortNumber": _EGM_PORTS[side]})
        configuration.change("SIO", "COM_TRP", unit, address)
    return configuration


_LONGEST_FAULT = 86_400.0  # [s]
_GRIPPER_ERROR = 7  # any; the gripper's numbers are not published
_OTHER_FILE = "HOME:/Pick.mod"
_OTHER_PROGRAM = """MODULE Pick
    PROC main()
        WHILE TRUE DO
            WaitTime 1;
        ENDWHILE
    ENDPROC
ENDMODULE
"""


class FaultInjection:
    """Injects faults into a world and its web services; what would change nothing is refused."""

    def __init__(self, world: World, service: RwsService) -> None:
        self._world = world
        controller = world.controller
        self._of_robot: Mapping[Fault, Callable[[], None]] = {
            Fault.MOTORS_OFF: lambda: controller.set_motors(False),
            Fault.EMERGENCY_STOP: controller.press_emergency_stop,
            Fault.EMERGENCY_STOP_RESET: controller.release_emergency_stop,
            Fault.MANUAL_MODE: lambda: controller.select_mode(OperatingMode.MANUAL_REDUCED),
            Fault.AUTO_MODE: lambda: controller.select_mode(OperatingMode.AUTO),
            Fault.PROGRAM_STOP: controller.stop_rapid,
            Fault.WRONG_PROGRAM: lambda: controller.replace_program({_OTHER_FILE: _OTHER_PROGRAM}),
            Fault.RIGHT_PROGRAM: lambda: controller.replace_program({}),
            Fault.RWS_RESET: service.reset_connections,
            Fault.RWS_SESSIONS_EXPIRED: service.expire_sessions,
            Fault.WEB_SOCKET_DROP: service.drop_web_sockets,
        }
        self._lasting: Mapping[Fault, Callable[[float], None]] = {
            Fault.WARM_RESTART: controller.restart,
            Fault.RWS_BUSY: service.be_busy,
        }
        self._with_strength: Mapping[Fault, Callable[[Side, float], None]] = {
            Fault.ARM_PUSHED: lambda side, degrees: world.arms[side].push(radians(degrees)),
            Fault.OBJECT_PLACED: self._place_object,
            Fault.OBJECT_UNDER_CUPS: self._put_under_cups,
        }
        self._of_arm: Mapping[Fault, Callable[[Side], None]] = {
            Fault.EGM_REPAIR: world.network.repair,
            Fault.COMM_TIMEOUT: lambda side: self._running_egm(side).lose_sensor(),
            Fault.EGM_CONVERGENCE: lambda side: self._running_egm(side).converge(),
            Fault.DYNAMIC_LOAD: lambda side: self._running_egm(side).overload(),
            Fault.COLLISION: controller.collide,
            Fault.GRIPPER_NOT_CALIBRATED: lambda side: world.grippers[side].cut_power(),
            Fault.GRIPPER_ERROR: lambda side: world.grippers[side].fail(_GRIPPER_ERROR),
            Fault.OBJECT_LOST: self._lose_object,
        }

    def inject(
        self,
        fault: Fault,
        side: Side | None = None,
        duration: float | None = None,
        amount: float | None = None,
        way: FaultDirection | None = None,
    ) -> None:
        """Inject a fault.

        Args:
            fault: which.
            side: to which arm; None for both.
            duration: how long it lasts [s]; None for its own time.
            amount: how strong it is, in the unit of its kind; None for its own strength.
            way: in which direction datagrams meet it; None for both.

        Raises:
            CommandRefused: one of these means nothing for it or is out of range, or the robot is in no state for it.
        """
        _check_options(fault.value, side, duration, amount, way)
        self._check_effect(fault)
        network, kind = self._world.network, fault.value
        sides = tuple(self._world.arms) if side is None else (side,)
        length = kind.default_duration if duration is None else duration
        strength = amount
        if strength is None:  # 0 is chance, or nothing to choose
            strength = (kind.amount.default if kind.amount is not None else None) or 0.0
        if fault in self._of_robot:
            self._of_robot[fault]()
        elif fault in self._lasting:
            self._lasting[fault](inf if length is None else length)
        elif fault is Fault.EGM_SILENCE:
            for each in sides:
                network.inject(Fault.EGM_LOSS, each, 100.0, duration=length)
        elif fault in LASTING:
            for each in sides:
                network.inject(fault, each, strength, way or FaultDirection.BOTH, length)
        else:
            self._inject_into_arms(fault, strength, sides)

    def answer(self, request: HttpRequest) -> HttpReply:
        """The answer to a request below :data:`FAULTS_PATH`."""
        if not is_loopback(request.peer.rpartition(":")[0]):
            return _plain_reply(403, "Faults are taken from programs on this machine only.")
        # Without this check a page from elsewhere could inject faults: by its forms, or by a host name of its own that
        # leads to this machine.
        origin = request.header("Origin")
        urls = [f"http://{request.header('Host') or ''}", *([] if origin is None else [origin])]
        if not all(is_loopback(host_of_url(url)) for url in urls):
            return _plain_reply(
                403, "Faults are taken under the names of this machine only, such as 127.0.0.1, not for pages."
            )
        name = request.target.partition("?")[0].removeprefix(FAULTS_PATH).strip("/")
        if not name:
            kinds = [
                {
                    "name": fault.value.name,
                    "meaning": fault.value.meaning,
                    "has_side": fault.value.has_side,
                    "has_duration": fault.value.has_duration,
                    "default_duration_s": fault.value.default_duration,
                    "by": None if fault.value.amount is None else asdict(fault.value.amount),
                    "has_way": fault.value.has_way,
                }
                for fault in Fault
            ]
            return HttpReply(200, (("Content-Type", "application/json"),), json.dumps(kinds).encode())
        fault = fault_named(name)
        if fault is None or request.method != "POST":
            known = ", ".join(each.value.name for each in Fault)
            return _plain_reply(404, f"There is no fault {name!r} to {request.method}; POST one of {known}.")
        try:
            self.inject(fault, *_read_options(decode_form(request.body.decode("utf-8", "replace"))))
        except YumiError as error:
            return _plain_reply(409, str(error))
        return HttpReply(204)

    def _inject_into_arms(self, fault: Fault, strength: float, sides: Sequence[Side]) -> None:
        """Inject a fault into the arms that are in a state for it, at least one."""
        refused: list[CommandRefused] = []
        for side in sides:
            try:
                if fault in SINGLE:
                    self._running_egm(side)  # an additional datagram is a changed copy of one that was sent
                    self._world.network.inject(fault, side, strength)
                elif fault in self._with_strength:
                    self._with_strength[fault](side, strength)
                else:
                    self._of_arm[fault](side)
            except CommandRefused as error:
                refused.append(error)
        if len(refused) == len(sides):
            raise refused[0]

    def _check_effect(self, fault: Fault) -> None:
        """Refuse a fault of the controller that would change nothing.

        Raises:
            CommandRefused: says why.
        """
        controller = self._world.controller
        state, mode = controller.controller_state, controller.mode
        is_pressed, motors_on = state is ControllerState.EMERGENCY_STOP, state is ControllerState.MOTORS_ON
        same_mode = f"The key stands at {mode.value} already."
        refusals: Mapping[Fault, tuple[bool, str]] = {
            Fault.EMERGENCY_STOP: (
                is_pressed,
                "The emergency stop is pressed already; emergency-stop-reset releases it.",
            ),
            Fault.EMERGENCY_STOP_RESET: (
                not is_pressed,
                "The emergency stop is not pressed; there is nothing to reset.",
            ),
            Fault.MOTORS_OFF: (not motors_on, "The motors are off already."),
            Fault.PROGRAM_STOP: (not controller.is_running, "No RAPID program runs; there is nothing to stop."),
            Fault.MANUAL_MODE: (mode is OperatingMode.MANUAL_REDUCED, same_mode),
            Fault.AUTO_MODE: (mode is OperatingMode.AUTO, same_mode),
            Fault.COLLISION: (
                not motors_on,
                "An arm whose motors are off does not collide; switch the motors on first.",
            ),
        }
        is_refused, sentence = refusals.get(fault, (False, ""))
        if is_refused:
            raise CommandRefused(sentence)

    def _running_egm(self, side: Side) -> EgmClient:
        egm = self._world.egm[side]
        if not egm.is_running:
            name = self._world.arms[side].kinematics.name
            raise CommandRefused(f"EGM does not move the {name}; start EGM first.")
        return egm

    def _place_object(self, side: Side, width_mm: float) -> None:
        gripper, width = self._world.grippers[side], width_mm * 1e-3
        if 2.0 * gripper.position < width:
            raise CommandRefused(
                f"The {side.word} gripper is open by {2e3 * gripper.position:.1f} mm; open it further than "
                f"{width_mm:g} mm first."
            )
        gripper.workpiece = Workpiece(width)

    def _put_under_cups(self, side: Side, leak: float) -> None:
        cups = self._world.grippers[side].cups
        if not cups:
            raise CommandRefused(f"The {side.word} gripper has no vacuum module.")
        for cup in cups.values():
            cup.under = CupObject(leak)

    def _lose_object(self, side: Side) -> None:
        gripper = self._world.grippers[side]
        if gripper.workpiece is None and all(cup.under is None for cup in gripper.cups.values()):
            raise CommandRefused(f"Nothing lies between the fingers or under the cups of the {side.word} arm.")
        gripper.workpiece = None
        for cup in gripper.cups.values():
            cup.under = None


def _check_options(
    kind: FaultKind, side: Side | None, duration: float | None, amount: float | None, way: FaultDirection | None
) -> None:
    if side is not None and not kind.has_side:
        raise CommandRefused(f"{kind.name} happens to the whole robot; leave the side out.")
    if duration is not None and not kind.has_duration:
        raise CommandRefused(f"{kind.name} has no duration; leave it out.")
    if duration is not None and not 0.0 < duration <= _LONGEST_FAULT:
        raise CommandRefused(f"A duration is above 0 and at most {_LONGEST_FAULT:.0f} s, not {duration:g} s.")
    if way is not None and not kind.has_way:
        raise CommandRefused(f"{kind.name} has no direction; leave 'way' out.")
    if amount is None:
        return
    if kind.amount is None:
        raise CommandRefused(f"{kind.name} has no strength; leave 'by' out.")
    is_in_range = kind.amount.lowest <= amount <= kind.amount.highest
    if not is_in_range or (kind.amount.is_whole and amount != int(amount)):
        whole = "a whole number from " if kind.amount.is_whole else ""
        raise CommandRefused(f"The strength ('by') of {kind.name} is {whole}{kind.amount.range}, not {amount:g}.")


def _read_options(form: Pairs) -> tuple[Side | None, float | None, float | None, FaultDirection | None]:
    side, way = first_value(form, "side"), first_value(form, "way")
    duration, amount = first_value(form, "duration"), first_value(form, "by")
    sides, ways = {each.word: each for each in Side}, {each.value: each for each in FaultDirection}
    if side is not None and side not in sides:
        raise CommandRefused(f"A side is left or right, not {side!r}.")
    if way is not None and way not in ways:
        raise CommandRefused(f"The direction ('way') is to-robot, from-robot or both, not {way!r}.")
    return (
        None if side is None else sides[side],
        None if duration is None else _finite_number(duration, "A duration is a number of seconds"),
        None if amount is None else _finite_number(amount, "'by' is a number"),
        None if way is None else ways[way],
    )


def _finite_number(text: str, meaning: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = inf
    if not isfinite(number):
        raise CommandRefused(f"{meaning}, not {text!r}.")
    return number


def _plain_reply(status: int, sentence: str) -> HttpReply:
    return HttpReply(status, (("Content-Type", "text/plain; charset=utf-8"),), sentence.encode())
