"""What is checked when the driver starts: things that no request can mend, and things that will be missed later."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from yumi.errors import ControllerRefused, RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import MAIN
from yumi.robot.joints import Side
from yumi.rws import rapid_values
from yumi.rws.replies import SystemInfo

OLDEST_ROBOTWARE = (6, 9)
"""EGM for seven axes came with RobotWare 6.09 (reference/statemachine.md §3.5)."""

OPTIONS: Mapping[str, str] = {
    "689-1 Externally Guided Motion (EGM)": "no arm can be guided",
}
"""What the controller must have, and what does not work without.

The programs of two arms need 604-1 MultiMove, with which every YuMi is delivered; that both tasks are there is checked
itself. 623-1 Multitasking and 616-1 PC Interface are not needed.
"""

GRIPPER_PRODUCT = "SmartGripper"

PROGRAM_VERSION = 1.1
"""Of the state machine's interface; see ``controller_files/TRobMain.mod``."""


ANY_ADDRESS = "0.0.0.0"
"""A socket at this address hears what comes to any of this machine's."""


@dataclass(frozen=True, slots=True)
class EgmAddress:
    """Where the robot's datagrams are awaited.

    Attributes:
        host: our address, as the robot shall know it.
        port: UDP port.
    """

    host: str
    port: int


class LaunchChecks:
    """Checks one controller.

    Args:
        client: a connected client.
        addresses: where each arm's datagrams are awaited; left out, the devices are not looked at.

    Attributes:
        remarks: what is not as it should be, but keeps nothing from starting.
    """

    def __init__(self, client: RwsClient, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        self.remarks: list[str] = []
        self._client = client
        self._addresses = addresses or {}

    def run(self) -> None:
        """Check everything.

        Raises:
            RobotNotReady: something is missing that cannot be mended from here; the message says what and how.
        """
        self.check_program()
        self.check_devices()

    def check_program(self) -> None:
        """See that the controller can move a YuMi by EGM and that the robot-side program is there.

        Raises:
            RobotNotReady: it cannot, or it is not.
        """
        self._check_system(self._client.system())
        for side in Side:
            self.check_unit(side)
        self.check_tasks()

    def check_tasks(self) -> None:
        """See that the robot-side program is in both tasks: of all that is checked, this changes without a restart.

        Raises:
            RobotNotReady: it is not there, or in another version.
        """
        for side in Side:
            self.check_task(side)

    def check_devices(self) -> None:
        """See that the robot's datagrams come here.

        Raises:
            RobotNotReady: an arm has no UDPUC device.
        """
        if self._addresses:
            devices = {each.name: each.attributes for each in self._client.cfg("SIO", "COM_TRP")}
            for side, address in self._addresses.items():
                self._check_device(side, address, devices.get(side.unit, {}))

    def _check_system(self, system: SystemInfo) -> None:
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            version = ".".join(map(str, system.robotware))
            raise RobotNotReady(f"The controller runs RobotWare {version}; EGM for a YuMi needs 6.09 or newer.")
        for option, loss in OPTIONS.items():
            if option not in system.options:
                raise RobotNotReady(f"The controller lacks the option {option!r}; without it {loss}.")
        if GRIPPER_PRODUCT not in system.options:
            self.remarks.append(f"the controller lacks the product {GRIPPER_PRODUCT!r}; the hands cannot be used")

    def check_unit(self, side: Side) -> None:
        """See that the controller moves an arm; raises RobotNotReady."""
        try:
            self._client.joint_target(side.unit)
        except ControllerRefused as error:
            raise RobotNotReady(
                f"The controller has no mechanical unit {side.unit}; it does not move a YuMi's {side.word} arm."
            ) from error

    def check_task(self, side: Side) -> None:
        """See that an arm's task has the robot-side program, in its version; raises RobotNotReady."""
        task, remedy = side.task, "load the RAPID modules of this package on it"
        try:
            kind = self._client.symbol_type(task, MAIN, "current_state")
        except ControllerRefused as error:
            raise RobotNotReady(f"Task {task} has no state machine ({MAIN}); {remedy}.") from error
        if kind != "num":
            raise RobotNotReady(f"{task}/{MAIN}/current_state has type {kind}, not num; {remedy}.")
        version = self._version(side)
        if version != PROGRAM_VERSION:
            raise RobotNotReady(
                f"Task {task} has version {version} of the state machine, not {PROGRAM_VERSION}; {remedy}."
            )

    def _version(self, side: Side) -> rapid_values.RapidValue:
        try:
            return rapid_values.decode(self._client.symbol(side.task, MAIN, "VERSION"))
        except ControllerRefused:
            return "unknown"

    def _check_device(self, side: Side, address: EgmAddress, device: Mapping[str, str]) -> None:
        if device.get("Type") != "UDPUC":
            raise RobotNotReady(
                f"The controller has no UDPUC device {side.unit} (Communication, Transmission Protocol); load "
                "SIO.cfg of this package and restart it."
            )
        host, port = device.get("RemoteAdress", ""), device.get("RemotePortNumber", "")
        is_here = address.host in (host, ANY_ADDRESS)
        if not is_here or port != str(address.port):
            self.remarks.append(
                f"the {side.word} arm's datagrams go to {host}:{port}, here they are awaited at "
                f"{address.host}:{address.port}; make the UDPUC device {side.unit} or the settings fit"
            )
