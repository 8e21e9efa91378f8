"""What the virtual controller says it is: names, version, options (reference/statemachine.md §9)."""

from __future__ import annotations

from dataclasses import dataclass

# The strings clients compare with are exact; without 604-1 they take the two arms for one group.
YUMI_OPTIONS = (
    "RobotWare Base",
    "English",
    "623-1 Multitasking",
    "604-1 MultiMove Coordinated",
    "709-1 DeviceNet Master/Slave",
    "617-1 FlexPendant Interface",
    "616-1 PC Interface",
    "841-1 EtherNet/IP Scanner/Adapter",
    "613-1 Collision Detection",
    "611-1 Path Recovery",
    "612-1 Path Offset",
    "988-1 RW Add-In Prepared",
    "Leadthrough",
    "689-1 Externally Guided Motion (EGM)",
    "UDPUC Driver",
    "Drive System IRB 14000",
    "Hall Sensor Calibration",
    "IRB 14000-0.5/0.5",
    "SmartGripper",
    "StateMachine Core",
)


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
    robotware: str = "6.13.00.00"
    options: tuple[str, ...] = YUMI_OPTIONS
    is_virtual: bool = False
    system_id: str = "{6B6F9A2E-3B1D-4B5C-9A64-9E0D2C1F7A11}"
