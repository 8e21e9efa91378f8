"""The identity of the controller, and what a person sets on it: language, clock, network."""

from __future__ import annotations

from dataclasses import dataclass, field

from virtual_irc5.controller.installed_system import ROBOTWARE_6, YUMI_OPTIONS


@dataclass(frozen=True, slots=True)
class Identity:
    """Who the controller is.

    Attributes:
        system_name: name of the RobotWare system.
        controller_name: name of the controller, usually its serial number.
        robotware: version name; clients want three groups of digits with a dot behind, and at least 6.09
            for EGM with seven axes.
        options: RobotWare options, in the order they are listed.
        is_virtual: what the controller calls itself; ours claims to be real, since its gripper is there.
        system_id: identifier of the system.
    """

    system_name: str = "YuMi"
    controller_name: str = "14000-500000"
    robotware: str = ROBOTWARE_6
    options: tuple[str, ...] = YUMI_OPTIONS
    is_virtual: bool = False
    system_id: str = "{6B6F9A2E-3B1D-4B5C-9A64-9E0D2C1F7A11}"


@dataclass(slots=True)
class OwnSettings:
    """Settings of the controller that are not system parameters.

    Attributes:
        language: of the FlexPendant, such as ``en``.
        timezone: name in the tz database; empty for that of this machine.
        timeserver: address of the time server; empty for none.
        address, mask, gateway, method: of the network connection; it is not this machine's.
        dns: address of the name server; empty for none.
        routes: gateway by destination.
        mode_lock: ``unlocked``, ``locked`` or ``permlocked``: whether the operating mode may be changed.
        pin: that unlocks it.
        backup_state: in the words of RWS.
    """

    language: str = "en"
    timezone: str = ""
    timeserver: str = ""
    address: str = "192.168.125.1"
    mask: str = "255.255.255.0"
    gateway: str = ""
    method: str = "fixip"
    dns: str = ""
    routes: dict[str, str] = field(default_factory=dict)
    mode_lock: str = "unlocked"
    pin: str = ""
    backup_state: str = "None"
