"""The faults that a virtual controller takes while it runs: what there is, and how another program injects one.

A fault is posted to the controller's port, at :data:`FAULTS_PATH`: :func:`inject_fault`. Who does no more than that
loads no virtual robot with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING
from urllib.parse import quote

from abb_protocols.catalogue import quoted
from abb_protocols.errors import CommandRefused, NoConnection
from abb_runtime.udp import is_loopback

if TYPE_CHECKING:
    import httpx

DISPLAY_PATH = "/virtual/display"
"""Where a virtual controller shows what its programs wrote to the FlexPendant, in a session; no ABB controller does."""

FAULTS_PATH = "/virtual/faults"
"""Where a virtual controller takes them; no ABB controller has it."""

_ANSWER_TIMEOUT = 4.0  # [s]


class FaultDirection(Enum):
    """Direction of the datagrams that a fault changes."""

    TO_ROBOT = "to-robot"
    FROM_ROBOT = "from-robot"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class FaultAmount:
    """The range of a fault's strength.

    Attributes:
        unit: of the number.
        default: None is random.
        lowest: smallest number.
        highest: largest number.
        is_whole: whether the number has no fraction.
    """

    unit: str
    default: float | None
    lowest: float
    highest: float
    is_whole: bool = False

    @property
    def range(self) -> str:
        """For a sentence, e.g. ``0 to 100 %``."""
        return f"{self.lowest:g} to {self.highest:g} {self.unit}"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """What a fault is.

    Attributes:
        name: in commands.
        meaning: what happens.
        has_side: whether it can be limited to one arm.
        has_duration: whether its duration can be chosen.
        default_duration: how long it lasts by default [s]; None is for ever.
        amount: its strength; None where there is nothing to choose.
        has_way: whether it can be limited to one direction.
    """

    name: str
    meaning: str
    has_side: bool = False
    has_duration: bool = False
    default_duration: float | None = None
    amount: FaultAmount | None = None
    has_way: bool = False


def _of_arm(name: str, meaning: str, amount: FaultAmount | None = None) -> FaultKind:
    return FaultKind(name, meaning, has_side=True, amount=amount)


def _lasting(
    name: str, meaning: str, amount: FaultAmount | None = None, duration: float | None = None, *, has_way: bool = False
) -> FaultKind:
    return FaultKind(
        name, meaning, has_side=True, has_duration=True, default_duration=duration, amount=amount, has_way=has_way
    )


_DEGREES = FaultAmount("degrees", 5.0, -360.0, 360.0)


class Fault(Enum):
    """The faults that can be injected into a running virtual controller."""

    EGM_SILENCE = _lasting("egm-silence", "the EGM datagrams of an arm are lost, both ways")
    EGM_REPAIR = _of_arm("egm-repair", "all EGM faults of an arm end")
    EGM_LOSS = _lasting(
        "egm-loss",
        "EGM datagrams are lost",
        FaultAmount("%", 100.0, 0.0, 100.0),
        has_way=True,
    )
    EGM_DELAY = _lasting("egm-delay", "EGM datagrams arrive later", FaultAmount("ms", 50.0, 0.0, 5000.0), has_way=True)
    EGM_DUPLICATE = _lasting(
        "egm-duplicate",
        "EGM datagrams arrive more than once",
        FaultAmount("copies", 1.0, 1.0, 10.0, is_whole=True),
        has_way=True,
    )
    EGM_REORDER = _lasting(
        "egm-reorder",
        "EGM datagrams overtake each other, by this many cycles at most",
        FaultAmount("cycles", 3.0, 1.0, 100.0, is_whole=True),
        has_way=True,
    )
    EGM_STALE = _of_arm(
        "egm-stale",
        "an old EGM datagram, this many before the last, comes a second time",
        FaultAmount("datagrams", 30.0, 1.0, 999.0, is_whole=True),
    )
    EGM_TRUNCATE = _lasting(
        "egm-truncate",
        "every second EGM datagram of the robot is truncated to this many bytes",
        FaultAmount("bytes", None, 1.0, 1000.0, is_whole=True),
        1.0,
    )
    EGM_FORGE = _of_arm("egm-forge", "one forged EGM datagram with the next number, all joints shifted", _DEGREES)
    EGM_FORGE_OLD = _of_arm(
        "egm-forge-old", "one forged EGM datagram with a number that is 100 lower, all joints shifted", _DEGREES
    )
    EGM_FORGE_AHEAD = _of_arm(
        "egm-forge-ahead", "one forged EGM datagram with a number that is 1000 higher, all joints shifted", _DEGREES
    )
    EGM_OFFSET = _lasting(
        "egm-offset", "the positions of all joints in the robot's EGM datagrams are shifted", _DEGREES, 0.5
    )
    EGM_SWAP_ARMS = FaultKind(
        "egm-swap-arms",
        "the EGM datagrams of each arm go to the port of the other",
        has_duration=True,
        default_duration=1.0,
    )
    EGM_FOREIGN_PORT = _lasting(
        "egm-foreign-port",
        "each EGM datagram of the robot comes from another port too, and first from there",
        duration=1.0,
    )
    COMM_TIMEOUT = _of_arm("comm-timeout", "the robot receives no datagrams for its CommTimeout")
    EGM_CONVERGENCE = _of_arm("egm-convergence", "an EGM motion ends as if it had converged")
    DYNAMIC_LOAD = _of_arm("dynamic-load", "an EGM motion overloads a drive: motors off")
    MOTORS_OFF = FaultKind("motors-off", "Motors Off is pressed")
    EMERGENCY_STOP = FaultKind("emergency-stop", "the emergency stop is pressed")
    EMERGENCY_STOP_RESET = FaultKind("emergency-stop-reset", "the emergency stop is released and acknowledged")
    MANUAL_MODE = FaultKind("manual-mode", "the key is turned to manual reduced speed")
    AUTO_MODE = FaultKind("auto-mode", "the key is turned to AUTO and confirmed")
    COLLISION = _of_arm("collision", "an arm collides: motion supervision stops the program")
    ARM_PUSHED = _of_arm(
        "arm-pushed",
        "someone pushes an arm's elbow aside and lets go",
        FaultAmount("degrees", 5.0, -20.0, 20.0),
    )
    PROGRAM_STOP = FaultKind("program-stop", "Stop is pressed on the FlexPendant")
    WRONG_PROGRAM = FaultKind("wrong-program", "another RAPID program is loaded into both tasks")
    RIGHT_PROGRAM = FaultKind("right-program", "the RAPID program of the configuration is loaded again")
    WARM_RESTART = FaultKind(
        "warm-restart", "the controller restarts: nothing answers meanwhile", has_duration=True, default_duration=20.0
    )
    RWS_RESET = FaultKind("rws-reset", "every TCP connection of Robot Web Services breaks")
    RWS_BUSY = FaultKind(
        "rws-busy", "Robot Web Services answer 503 to everything", has_duration=True, default_duration=5.0
    )
    RWS_SESSIONS_EXPIRED = FaultKind("rws-sessions-expired", "all sessions and subscriptions are forgotten")
    WEB_SOCKET_DROP = FaultKind("web-socket-drop", "every WebSocket breaks; the subscriptions stay")
    GRIPPER_NOT_CALIBRATED = _of_arm("gripper-not-calibrated", "a gripper loses its power and calibration")
    GRIPPER_ERROR = _of_arm("gripper-error", "a gripper reports an internal error")
    OBJECT_PLACED = _of_arm(
        "object-placed", "a part is put between a gripper's fingers", FaultAmount("mm", 20.0, 1.0, 50.0)
    )
    OBJECT_UNDER_CUPS = _of_arm(
        "object-under-cups",
        "an object is put under a gripper's cups; a leak of 1 is as if none",
        FaultAmount("leak", 0.0, 0.0, 1.0),
    )
    OBJECT_LOST = _of_arm("object-lost", "the object at a gripper's fingers or cups is removed")


def fault_named(name: str) -> Fault | None:
    """The fault of a name."""
    return next((fault for fault in Fault if fault.value.name == name), None)


def takes_faults(address: str) -> bool:
    """Whether a virtual controller of this package answers at ``address``: only that one has faults to inject."""
    import httpx  # noqa: PLC0415 - for this alone, of what the virtual robot imports

    try:
        reply = _ask(address, "GET", FAULTS_PATH)
    except httpx.HTTPError:
        return False
    return reply.is_success and reply.headers.get("Content-Type", "").startswith("application/json")


def inject_fault(address: str, name: str, form: Mapping[str, str]) -> Fault:
    """Inject a fault into the virtual controller at ``address``, and return it; another name is never sent.

    Raises:
        NoConnection: nothing answers there.
        CommandRefused: the fault is unknown or refused, or it is not a virtual controller.
    """
    import httpx  # noqa: PLC0415 - for this alone, of what the virtual robot imports

    fault = fault_named(name)
    if fault is None:
        raise CommandRefused(f"There is no fault {quoted(name)}; `virtual-irc5 fault` lists all faults.")
    try:
        reply = _ask(address, "POST", f"{FAULTS_PATH}/{quote(name, safe='')}", form)
    except httpx.HTTPError as error:
        raise NoConnection(
            f"Nothing answers at {address} ({error}). `virtual-irc5 run` or `yumi controller` starts a virtual one."
        ) from error
    if not reply.is_success:
        is_virtual = reply.headers.get("Content-Type", "").startswith("text/plain")
        sentence = reply.text if is_virtual else ""
        raise CommandRefused(sentence or f"What answers at {address} is not a virtual controller of this package.")
    return fault


def _ask(address: str, method: str, path: str, form: Mapping[str, str] | None = None) -> httpx.Response:
    """What answers at ``address``, over HTTP or TLS; raises httpx.HTTPError."""
    import httpx  # noqa: PLC0415 - see above

    # The certificate that a virtual controller makes itself is trusted on this machine alone.
    is_far = not is_loopback(httpx.URL(f"http://{address}").host)
    request = partial(httpx.request, method, data=form, timeout=_ANSWER_TIMEOUT, trust_env=False, verify=is_far)
    try:
        return request(f"http://{address}{path}")
    except (httpx.RemoteProtocolError, httpx.ReadError):  # it speaks TLS, with a certificate of its own
        return request(f"https://{address}{path}")
