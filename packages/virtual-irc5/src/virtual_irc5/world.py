"""The whole virtual robot: controller, arms, grippers and EGM clients, advanced together by one cycle at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from ipaddress import IPv4Address

from abb_protocols.errors import NoConnection
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Joints, Side
from abb_runtime.rws.login import MAX_PORT
from abb_runtime.udp import is_loopback
from virtual_irc5.controller.identity import Identity
from virtual_irc5.controller.installed_system import ROBOTWARE_6, InstalledRobot, System, delivered_system
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.contacts import ContactDetector
from virtual_irc5.mechanics.egm_client import EgmClient, EgmOptions
from virtual_irc5.mechanics.egm_network import EgmNetwork, OutgoingDatagram
from virtual_irc5.mechanics.egm_parameters import EgmParameters
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.mechanics.virtual_gripper import CupObject, VirtualGripper, Workpiece
from virtual_irc5.system_parameters import SystemConfiguration

_EGM_PORTS = {Side.LEFT: "6511", Side.RIGHT: "6512"}  # where the system parameters name none
_ADD_IN = "StateMachine Core"
"""The option whose interface our program has; clients look for it."""

_NOWHERE = "127.0.0.1", 9
"""The discard port."""

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
                settings.cup_objects.get(side),
                is_calibrated=settings.grippers_are_calibrated,
            )
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

    def exchange(self, inboxes: Mapping[Side, Sequence[bytes]]) -> list[OutgoingDatagram]:
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
        if not (port.isascii() and port.isdigit() and len(port) <= _DIGITS_OF_PORT and 1 <= int(port) <= MAX_PORT):
            raise NoConnection(f"The UDPUC device {device.name} has the port '{port}'; use 1 to {MAX_PORT}.")
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
