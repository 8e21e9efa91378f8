"""A finding of the doctor: a requirement of driving a robot, whether it is met, and what to do.

The doctor goes on where the driver gives up at the first thing that is missing. Each finding names a requirement,
whether it is met, why it matters, what to do, and where. Three parts are examined: the controller over Robot Web
Services; this machine with its way to the robot, ports, firewall, permissions and ROS environment; and EGM's position
streams, for which the robot's program may have to run meanwhile: do the datagrams of both arms arrive, each at its
port, and how regularly? The arms do not move.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from abb_protocols.catalogue import Message, clause, remedy_of, said_by


class Verdict(Enum):
    """Whether a requirement is met."""

    OK = "ok"
    NOTE = "note"
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Finding:
    """One requirement.

    Attributes:
        requirement: what is needed, in two or three words.
        verdict: whether it is met; a note keeps nothing from working.
        said: what was found, and what to do about it.
    """

    requirement: str
    verdict: Verdict
    said: Message

    @property
    def found(self) -> str:
        """What was found."""
        return clause(self.said)

    @property
    def remedy(self) -> str:
        """What to do about it; empty where nothing is to be done."""
        return remedy_of(self.said)

    @property
    def why(self) -> str:
        """Why it matters."""
        return self._background()[0]

    @property
    def where(self) -> str:
        """Where it is on the FlexPendant; empty for what is not."""
        return self._background()[1]

    def _background(self) -> tuple[str, str]:
        return next((each for start, each in _BACKGROUND.items() if self.requirement.startswith(start)), ("", ""))


_CONFIGURATION = "Control Panel, Configuration"
_BACKGROUND = {
    "link": ("EGM needs an answer within milliseconds", ""),
    "route": (
        "the robot sends its datagrams to one address of this machine, on the network it is in",
        "System Info, Network",
    ),
    "network card": ("a second way to the robot, a small MTU or a radio link loses datagrams", ""),
    "reachable": ("everything but EGM goes over Robot Web Services", "System Info, Network connections"),
    "login": ("the controller lets in its users only", "Control Panel, Controller Settings, Users (RobotStudio)"),
    "RobotWare": (
        "EGM for seven axes came with 6.09; RobotWare 7 has another protocol",
        "System Info, System properties",
    ),
    "option": ("without 689-1 the controller knows no instruction of EGM", "System Info, System properties, Options"),
    "add-in": ("it brings the state machine by itself", "System Info, System properties, Options"),
    "gripper": ("the grippers are commanded by their RAPID driver", "ABB menu, SmartGripper"),
    "robot": ("this driver moves an IRB 14000 only", ""),
    "arm": ("each arm is a mechanical unit of its own", "Jogging, Mechanical unit"),
    "operating mode": (
        "only in AUTO may a program on a computer change anything",
        "mode switch, or the mode button of the FlexPendant",
    ),
    "motors": ("the arms move with motors on only; a stop keeps them off", "status bar; Motors On button"),
    "collision": ("a collision stops the program, which starts again when a person has looked", "Event Log"),
    "speed ratio": ("motions of RAPID are slower by it", "QuickSet menu, Speed"),
    "mastership": (
        "who holds it is the only one who can change programs or the configuration",
        "logout of the other client, RobotStudio",
    ),
    "RAPID program": ("the state machine on the robot starts EGM", "Production Window"),
    "task": ("each arm has a task of its own, and both have to run", "QuickSet menu, Tasks"),
    "program in": ("a task has one main only", "Program Editor, Tasks and Programs"),
    "modules in": ("the driver reads and writes the symbols of these modules", "Program Editor, Modules"),
    "version in": ("the interface differs from version to version", "Program Editor, TRobMain"),
    "signal": ("they start and stop EGM; a client may write those with Access All", f"{_CONFIGURATION}, I/O, Signal"),
    "UDPUC device": (
        "the UDPUC device says where an arm sends its datagrams",
        f"{_CONFIGURATION}, Communication, Transmission Protocol",
    ),
    "motion data": ("EGM is set up with it", f"{_CONFIGURATION}, Motion, External Motion Interface Data"),
    "restart": ("a changed configuration acts after a restart", "Restart"),
    "clock": ("events of both sides are found by their times", "Control Panel, Date and Time"),
    "grants": (
        "a user may do what the controller's administrator has granted",
        "Control Panel, Controller Settings, Users (RobotStudio)",
    ),
    "sessions": ("a controller has 70 sessions; one that is left idle ends after five minutes", ""),
    "UDP port": ("one program can listen at a port", ""),
    "firewall": ("a firewall that drops EGM is the most frequent fault of a new set-up", ""),
    "EGM": ("the arms follow what comes over EGM, 250 times a second", f"{_CONFIGURATION}, Communication; Event Log"),
    "real-time priority": ("without it other programs delay the control loop", ""),
    "locked memory": ("a page that has to be read back from disk delays the control loop", ""),
    "ROS": ("ROS 2 nodes find those of their domain and discovery range only", ""),
}
"""Why it matters, and where it is on the FlexPendant, by how the requirement begins."""


def problem(requirement: str, error: Exception) -> Finding:
    """The finding of an error."""
    return Finding(requirement, Verdict.PROBLEM, said_by(error))
