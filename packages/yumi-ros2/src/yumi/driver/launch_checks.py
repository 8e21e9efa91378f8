"""What a controller must have before it is brought up: RobotWare, options, program version, EGM address.

No request can repair what these checks miss.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, RobotNotReady
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.system import SystemInfo
from abb_runtime.rws.client import RwsClient
from yumi.driver.state_machine import MAIN_MODULE

OLDEST_ROBOTWARE = (6, 9)
"""EGM for seven axes came with RobotWare 6.09 (reference/statemachine.md §3.5)."""

_SINGLE_ARM_YUMI = "IRB 14050"

REQUIRED_OPTIONS: Mapping[str, str] = {"689-1 Externally Guided Motion (EGM)": "EGM can move no arm"}
"""What the controller must have, and what does not work without.

The programs of two arms need 604-1 MultiMove, with which every YuMi is delivered; that both tasks are there is checked
itself. 623-1 Multitasking and 616-1 PC Interface are not needed.
"""

GRIPPER_PRODUCT = "SmartGripper"
"""What the grippers need; the arms move without."""

PROGRAM_VERSION = 1.1
"""Of the state machine's interface; see ``controller_files/TRobMain.mod``."""

_ANY_ADDRESS = "0.0.0.0"
"""A socket at this address receives what comes to any of this machine's."""


@dataclass(frozen=True, slots=True)
class EgmAddress:
    """Where the robot's datagrams are awaited: our address as the robot must know it, and the UDP port."""

    host: str
    port: int


def other_robot(robot: str, units: Sequence[str]) -> str:
    """A robot that is not a YuMi, in a sentence.

    Args:
        robot: ABB's name of it; empty where the controller does not name it.
        units: its mechanical units.
    """
    name = f"an {robot}" if robot else "another robot"
    listed = f"mechanical unit{'s' * (len(units) > 1)} {', '.join(units)}" if units else "no mechanical unit"
    return f"{name} ({listed}), not a YuMi{' with two arms' * (robot == _SINGLE_ARM_YUMI)}"


class LaunchChecks:
    """Checks one controller for what no request can repair, and for what will be missed later.

    Args:
        client: a connected client.
        addresses: where each arm's datagrams are awaited; left out, the devices are not checked.

    Attributes:
        remarks: what is not as it should be, but prevents nothing.
        misdirected: those of them that say that an arm's datagrams go elsewhere.
    """

    def __init__(self, client: RwsClient, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        self.remarks: list[Message] = []
        self.misdirected: dict[Side, Message] = {}
        self._client = client
        self._addresses = addresses or {}

    def run(self) -> None:
        """Check everything.

        Raises:
            RobotNotReady: something is missing that cannot be repaired from here; the message says what and how.
        """
        system = self._client.system()
        self.check_robot(system)
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            raise RobotNotReady(message("robotware_too_old", version=system.version, oldest="6.09"))
        for option, loss in REQUIRED_OPTIONS.items():
            if option not in system.options:
                raise RobotNotReady(message("option_missing", option=option, loss=loss))
        if GRIPPER_PRODUCT not in system.options:
            self.remarks.append(message("grippers_missing", product=GRIPPER_PRODUCT))
        for side in Side:
            self.check_unit(side)
        self.check_tasks()
        self.check_devices()

    def check_robot(self, system: SystemInfo) -> None:
        """See that the controller moves a YuMi.

        Args:
            system: of the controller.

        Raises:
            RobotNotReady: it moves another robot; the message names the robot and what to use instead.
        """
        units = self._client.mechanical_units()
        if any(side.unit in units for side in Side):
            return
        address = self._client.address
        raise RobotNotReady(message("not_a_yumi", address=address, robot=other_robot(system.robot, units)))

    def check_unit(self, side: Side) -> None:
        """See that the controller moves an arm; raises RobotNotReady."""
        try:
            self._client.joint_target(side.unit)
        except ControllerRefused:
            raise RobotNotReady(message("unit_missing", unit=side.unit, arm=side.word)) from None

    def check_tasks(self) -> None:
        """See that the program is in both tasks: of all that is checked, this changes without a restart."""
        for side in Side:
            self.check_task(side)

    def check_task(self, side: Side) -> None:
        """See that an arm's task has the robot-side program, in its version; raises RobotNotReady."""
        task = side.task
        try:
            kind = self._client.symbol_type(task, MAIN_MODULE, "current_state")
        except ControllerRefused:
            raise RobotNotReady(message("state_machine_missing", task=task, module=MAIN_MODULE)) from None
        if kind != "num":
            raise RobotNotReady(message("state_has_wrong_type", task=task, module=MAIN_MODULE, kind=kind))
        try:
            version = self._client.value(task, MAIN_MODULE, "VERSION")
        except ControllerRefused:
            version = "unknown"
        if version != PROGRAM_VERSION:
            raise RobotNotReady(
                message("state_machine_of_other_version", task=task, version=str(version), expected=PROGRAM_VERSION)
            )

    def check_devices(self) -> None:
        """See that the robot's datagrams come here; raises RobotNotReady when an arm has no UDPUC device."""
        if not self._addresses:
            return
        devices = {each.name: each.attributes for each in self._client.cfg("SIO", "COM_TRP")}
        for side, address in self._addresses.items():
            device = devices.get(side.unit, {})
            if device.get("Type") != "UDPUC":
                raise RobotNotReady(message("udpuc_device_missing", device=side.unit))
            host, port = device.get("RemoteAdress", ""), device.get("RemotePortNumber", "")
            if address.host not in (host, _ANY_ADDRESS) or port != str(address.port):
                self.misdirected[side] = message(
                    "datagrams_go_elsewhere",
                    arm=side.word,
                    there=f"{host}:{port}",
                    here=f"{address.host}:{address.port}",
                    device=side.unit,
                )
                self.remarks.append(self.misdirected[side])
