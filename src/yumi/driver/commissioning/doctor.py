"""The doctor: checks all that driving a robot takes, on the controller and on this machine, and leaves all as it was.

It goes on where the driver gives up at the first thing that is missing. Each finding names a requirement, whether it is
met, why it matters, what to do, and where. Three parts are examined: the controller over Robot Web Services; this
machine with its way to the robot, ports, firewall, permissions and ROS environment; and EGM's position streams, for
which the robot's program may have to run meanwhile: do the datagrams of both arms arrive, each at its port, and how
regularly? The arms do not move.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from functools import partial
from importlib.util import find_spec
from ipaddress import IPv4Interface, ip_address
from pathlib import Path
from typing import Protocol

from yumi.catalogue import Message, clause, message, remedy_of, said_by
from yumi.clock import Clock, wait_until
from yumi.driver.bringup import (
    GRIPPER_PRODUCT,
    OLDEST_ROBOTWARE,
    PROGRAM_VERSION,
    REQUIRED_OPTIONS,
    ControllerPanel,
    EgmAddress,
    LaunchChecks,
)
from yumi.driver.commissioning.installation import (
    ADD_INS,
    GRIPPER_MODULE,
    MASTERSHIPS,
    NEWEST_ROBOTWARE,
    OWN_MODULE,
    delivered,
    delivered_modules,
    essence,
    foreign_mains,
    missing_grants,
)
from yumi.driver.readiness import NO_STOP, unmet
from yumi.driver.robot_state import RobotState
from yumi.driver.state_machine import MAIN, WATCHDOG, MachineState, read_machine_state
from yumi.driver.stops import StopLog
from yumi.egm.codec import JointCodec
from yumi.egm.session import SensorSession
from yumi.egm.udp import NetworkCard, UdpServer, network_cards
from yumi.errors import ControllerRefused, LoginRefused, NoConnection, ProtocolError, RobotNotReady, YumiError
from yumi.robot.joints import CYCLE, Joints, Side
from yumi.rws.client import RwsClient
from yumi.rws.documents import SystemInfo
from yumi.rws.session import OnProgress
from yumi.rws.types import CollisionState, ControllerState, ExecutionState, Grant, OperatingMode


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


CLOCK_TOLERANCE = 60.0
"""By so much the clocks may differ before it is worth a note [s]: events are found by their times."""

NEEDED_GRANTS = {
    Grant.RAPID_EXECUTE: "start programs",
    Grant.RAPID_CURRVALUE: "write RAPID data",
    Grant.IO_WRITE: "write signals",
}
"""What the user of the driver needs, and for what; `yumi install` needs more."""

_DISPENSABLE = (GRIPPER_MODULE, WATCHDOG)
_MOST_SESSIONS, _MANY_SESSIONS = 70, 50


def examine_controller(
    client: RwsClient, addresses: Mapping[Side, EgmAddress], now: Callable[[], datetime] = datetime.now
) -> Iterator[Finding]:
    """Look at the controller; all requests are GETs, and the session is left to the caller to close.

    Args:
        client: not connected yet.
        addresses: where each arm's datagrams are awaited.
        now: this machine's local time.
    """
    try:
        system = client.connect()
    except LoginRefused as error:
        yield Finding("reachable", Verdict.OK, message("as_found", value=client.address))
        yield problem("login", error)
        return
    except YumiError as error:
        yield problem("reachable", error)
        return
    checks = LaunchChecks(client, addresses)
    other = _checked("robot", message("is_a_yumi"), partial(checks.check_robot, system))
    if other.verdict is Verdict.PROBLEM:  # first, and alone: nothing of a YuMi is missing on another robot
        yield other
        yield Finding("reachable", Verdict.OK, message("as_found", value=client.address))
        yield Finding("login", Verdict.OK, message("logged_in", system=system.name))
        return
    yield Finding("reachable", Verdict.OK, message("as_found", value=client.address))
    yield Finding("login", Verdict.OK, message("logged_in", system=system.name))
    yield from _system(system)
    for side in Side:
        yield _checked(f"arm {side.unit}", message("arm_moved_by_controller"), partial(checks.check_unit, side))
    for look in (_mode, _motors, _execution, _panel, _masterships, _grants, _sessions, _tasks):
        yield from _guarded(partial(look, client))
    for side in Side:
        yield from _guarded(partial(_foreign_program, client, side))
        yield from _guarded(partial(_modules, client, side, has_add_in=any(name in system.options for name in ADD_INS)))
    yield from _guarded(partial(_signals, client))
    yield from _guarded(partial(_motion_data, client))
    for side, address in addresses.items():
        yield _device(client, side, address)
    yield from _guarded(partial(_shared_port, client))
    for side in Side if GRIPPER_PRODUCT in system.options else ():
        yield from _guarded(partial(_gripper, client, side))
    yield _clock(client, now())


def _checked(requirement: str, found: Message, check: Callable[[], None]) -> Finding:
    try:
        check()
    except YumiError as error:
        return problem(requirement, error)
    return Finding(requirement, Verdict.OK, found)


def _guarded(look: Callable[[], list[Finding]]) -> list[Finding]:
    """What is found, or that it could not be read."""
    try:
        return look()
    except YumiError as error:
        return [Finding("answers", Verdict.PROBLEM, message("could_not_be_read", reason=said_by(error)))]


def _system(system: SystemInfo) -> Iterator[Finding]:
    version = ".".join(map(str, system.robotware))
    if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
        yield Finding("RobotWare", Verdict.PROBLEM, message("robotware_without_egm", version=version))
    elif system.robotware[0] > NEWEST_ROBOTWARE:
        yield Finding("RobotWare", Verdict.PROBLEM, message("robotware_too_new", version=version))
    else:
        yield Finding("RobotWare", Verdict.OK, message("as_found", value=version))
    for option, loss in REQUIRED_OPTIONS.items():
        if option in system.options:
            yield Finding("option", Verdict.OK, message("as_found", value=option))
        else:
            yield Finding("option", Verdict.PROBLEM, message("option_not_installed", option=option, loss=loss))
    for name in ADD_INS:
        if name in system.options:
            yield Finding("add-in", Verdict.OK, message("add_in_found", add_in=name))
    if GRIPPER_PRODUCT in system.options:
        yield Finding("gripper product", Verdict.OK, message("as_found", value=GRIPPER_PRODUCT))
    else:
        yield Finding("gripper product", Verdict.NOTE, message("gripper_product_missing", product=GRIPPER_PRODUCT))


def _mode(client: RwsClient) -> list[Finding]:
    mode = client.operating_mode()
    if mode is OperatingMode.AUTO:
        return [Finding("operating mode", Verdict.OK, message("as_found", value=mode.value))]
    return [Finding("operating mode", Verdict.PROBLEM, message("mode_keeps_programs_out", mode=mode.value))]


def _motors(client: RwsClient) -> list[Finding]:
    state = client.controller_state()
    if state is ControllerState.MOTORS_ON:
        return [Finding("motors", Verdict.OK, message("motors_are_on"))]
    robot = RobotState(controller_state=state)
    stop = unmet(NO_STOP, robot)
    if stop is not None:
        kept_off = message("motors_kept_off", state=state.value, reason=stop.reason(robot, tuple(Side)))
        return [Finding("motors", Verdict.PROBLEM, kept_off)]
    return [Finding("motors", Verdict.NOTE, message("motors_not_on_yet", state=state.value))]


def _execution(client: RwsClient) -> list[Finding]:
    if client.execution() is ExecutionState.RUNNING:
        return [Finding("RAPID program", Verdict.OK, message("program_is_running"))]
    return [Finding("RAPID program", Verdict.NOTE, message("program_not_running_yet"))]


def _panel(client: RwsClient) -> list[Finding]:
    findings = []
    state = client.collision_state()
    if state in (CollisionState.TRIGGERED, CollisionState.TRIGGERED_ACKNOWLEDGED):
        findings.append(Finding("collision", Verdict.PROBLEM, message("arm_has_collided")))
    percent = client.speed_ratio()
    if percent:
        findings.append(Finding("speed ratio", Verdict.OK, message("speed_ratio", percent=percent)))
    else:
        findings.append(Finding("speed ratio", Verdict.PROBLEM, message("speed_ratio_zero")))
    return findings


def _masterships(client: RwsClient) -> list[Finding]:
    """Who holds the right to change something; a driver needs it for moments only."""
    held = [(domain, holder) for domain in MASTERSHIPS if (holder := client.mastership(domain))]
    if not held:
        return [Finding("mastership", Verdict.OK, message("mastership_free"))]
    return [
        Finding("mastership", Verdict.PROBLEM, message("mastership_held", holder=holder, domain=domain))
        for domain, holder in held
    ]


def _grants(client: RwsClient) -> list[Finding]:
    """What the user may do; a controller that does not say it in ABB's words is not judged."""
    missing = missing_grants(client, NEEDED_GRANTS)
    if not missing:
        return [Finding("grants", Verdict.OK, message("grants_found", count=len(client.grants())))]
    return [Finding("grants", Verdict.PROBLEM, message("grants_missing", grants=tuple(missing)))]


def _sessions(client: RwsClient) -> list[Finding]:
    """How many clients there are, as far as the controller shows them."""
    used = len(client.users())
    if used <= _MANY_SESSIONS:
        return [Finding("sessions", Verdict.OK, message("sessions_found", count=used, limit=_MOST_SESSIONS))]
    return [Finding("sessions", Verdict.NOTE, message("many_sessions", count=used, limit=_MOST_SESSIONS))]


def _tasks(client: RwsClient) -> list[Finding]:
    tasks = {task.name: task for task in client.tasks()}
    ours = [tasks[side.task] for side in Side if side.task in tasks]
    idle = [task.name for task in ours if not task.is_active]
    findings = [Finding("task", Verdict.PROBLEM, message("task_switched_off", task=name)) for name in idle]
    still = [task.name for task in ours if not task.is_motion_task]
    findings += [Finding("task", Verdict.PROBLEM, message("task_moves_nothing", task=name)) for name in still]
    return findings or [Finding("task", Verdict.OK, message("tasks_found", tasks=tuple(task.name for task in ours)))]


def _foreign_program(client: RwsClient, side: Side) -> list[Finding]:
    """Modules of others with a main: two mains do not link, and another one alone is not the state machine."""
    try:
        return [
            Finding(f"program in {side.task}", Verdict.PROBLEM, message("module_has_main", module=name))
            for name, _ in foreign_mains(client, side)
        ]
    except ControllerRefused:  # there is no such task, which the modules' own finding says
        return []


def _modules(client: RwsClient, side: Side, *, has_add_in: bool) -> list[Finding]:
    """The modules of one task, their version, and whether they are this package's."""
    name = f"modules in {side.task}"
    try:
        loaded = {module.name.lower() for module in client.modules(side.task)}
    except ControllerRefused as error:
        reason = said_by(error)
        return [Finding(name, Verdict.PROBLEM, message("modules_without_task", task=side.task, reason=reason))]
    ours = delivered_modules()
    missing = [module for module in ours if module.lower() not in loaded]
    findings = []
    needed = [module for module in missing if module not in _DISPENSABLE]
    if needed:
        findings.append(Finding(name, Verdict.PROBLEM, message("modules_missing", modules=tuple(needed))))
    for module in (each for each in missing if each in _DISPENSABLE):
        what = message("gripper_module_missing" if module == GRIPPER_MODULE else "watchdog_missing", module=module)
        findings.append(Finding(name, Verdict.NOTE, what))
    if needed:
        return findings
    is_version = message("as_found", value=f"{PROGRAM_VERSION}")
    version = _checked(f"version in {side.task}", is_version, lambda: LaunchChecks(client).check_task(side))
    try:
        texts = {module: client.module_text(side.task, module) for module in ours if module not in missing}
    except (ControllerRefused, ProtocolError) as error:
        found = message("modules_not_comparable", reason=said_by(error))
        return [*findings, Finding(name, Verdict.NOTE, found), version]
    changed = [
        module for module, text in texts.items() if module != OWN_MODULE and essence(text) != essence(ours[module])
    ]
    if changed:
        if has_add_in:
            findings.append(Finding(name, Verdict.NOTE, message("modules_of_add_in", modules=tuple(changed))))
        else:
            findings.append(Finding(name, Verdict.PROBLEM, message("modules_differ", modules=tuple(changed))))
    elif not missing:
        findings.append(Finding(name, Verdict.OK, message("modules_as_delivered")))
    return [*findings, version]


def _signals(client: RwsClient) -> list[Finding]:
    """Each signal of the state machine: there, of the right kind, writable for clients, and in use since a restart."""
    nowhere = {side: EgmAddress("", 0) for side in Side}
    wanted = {key.name: each for key, each in delivered(nowhere).cfg.items() if key.type == "EIO_SIGNAL" and each}
    configured = {each.name: each.attributes for each in client.cfg("EIO", "EIO_SIGNAL")}
    in_use = {name.lower() for name in client.signals()}
    missing = [name for name in wanted if name not in configured]
    findings = []
    if missing:
        findings.append(Finding("signals", Verdict.PROBLEM, message("signals_missing", signals=tuple(missing))))
    for name, attributes in wanted.items():
        found = configured.get(name)
        if found is None:
            continue
        if found.get("Device"):
            what = message("signal_on_device", device=found["Device"])
            findings.append(Finding(f"signal {name}", Verdict.PROBLEM, what))
        for attribute in ("SignalType", "Access"):
            have, needed = found.get(attribute, ""), attributes.get(attribute, "")
            if have.lower() != needed.lower():
                what = message("signal_differs", attribute=attribute, value=have, needed=needed)
                findings.append(Finding(f"signal {name}", Verdict.PROBLEM, what))
    late = [name for name in wanted if name in configured and name.lower() not in in_use]
    if late:
        findings.append(Finding("restart", Verdict.PROBLEM, message("signals_not_in_use", signals=tuple(late))))
    return findings or [Finding("signals", Verdict.OK, message("signals_found", count=len(wanted)))]


def _motion_data(client: RwsClient) -> list[Finding]:
    try:
        there = {each.name for each in client.cfg("MOC", "EXT_MOTION_DATA")}
    except ControllerRefused:  # there is none at all
        there = set()
    missing = [name for side in Side for name in (side.unit, f"{side.unit}_RAW") if name not in there]
    if missing:
        return [Finding("motion data", Verdict.PROBLEM, message("motion_data_missing", names=tuple(missing)))]
    return [Finding("motion data", Verdict.OK, message("motion_data_found"))]


def _device(client: RwsClient, side: Side, address: EgmAddress) -> Finding:
    name = f"UDPUC device {side.unit}"
    checks = LaunchChecks(client, {side: address})
    try:
        checks.check_devices()
    except YumiError as error:
        return problem(name, error)
    if checks.remarks:
        return problem(name, RobotNotReady(checks.remarks[0]))
    return Finding(name, Verdict.OK, message("device_sends_here", host=address.host, port=address.port))


def _shared_port(client: RwsClient) -> list[Finding]:
    devices = {each.name: each.attributes for each in client.cfg("SIO", "COM_TRP")}
    ports = {devices[side.unit].get("RemotePortNumber") for side in Side if side.unit in devices}
    if len(ports) == 1 and all(side.unit in devices for side in Side):
        return [Finding("UDPUC devices", Verdict.PROBLEM, message("devices_share_port", port=ports.pop()))]
    return []


def _gripper(client: RwsClient, side: Side) -> list[Finding]:
    name = f"gripper {side.word}"
    try:
        is_calibrated = client.signal(f"hand_StatusCalibrated_{side.name[0]}").value != 0
    except ControllerRefused:
        return [Finding(name, Verdict.NOTE, message("gripper_not_there"))]
    if is_calibrated:
        return [Finding(name, Verdict.OK, message("gripper_is_calibrated"))]
    return [Finding(name, Verdict.OK, message("gripper_not_calibrated_yet"))]


def _clock(client: RwsClient, here: datetime) -> Finding:
    try:
        robot = client.clock()
    except YumiError as error:
        return Finding("clock", Verdict.NOTE, message("clock_unreadable", reason=said_by(error)))
    off = abs((robot - here).total_seconds())
    if off <= CLOCK_TOLERANCE:
        return Finding("clock", Verdict.OK, message("clock_agrees", difference=off))
    times = message("clock_differs", there=f"{robot:%Y-%m-%d %H:%M:%S}", here=f"{here:%Y-%m-%d %H:%M:%S}")
    return Finding("clock", Verdict.NOTE, times)


_UFW = Path("/etc/ufw/ufw.conf")
_SYSTEM_PATH = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"
_LISTINGS = (["nft", "list", "ruleset"], ["iptables", "-S"])
_UFW_ON = re.compile(r"(?im)^\s*ENABLED\s*=\s*\"?yes")
_CLOSES = re.compile(r"hook input[^}]*policy drop|-P INPUT DROP|\breject\b|-j (?:REJECT|DROP)")
_SMALLEST_MTU = 576
"""The smallest one of IPv4; a datagram of EGM has a few hundred bytes, so that it is never cut with this."""

_DISCOVERY = ("LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
_LAST_DOMAIN = 232
_SAFE_DOMAIN = 101
"""Above this, ports of ROS 2 lie where Linux takes those of outgoing connections."""

Run = Callable[[list[str]], "subprocess.CompletedProcess[str]"]
"""Runs a program that only reads; raises OSError or subprocess.TimeoutExpired."""


def examine_machine(
    robot: str,
    addresses: Mapping[Side, EgmAddress],
    run: Run | None = None,
    ufw: Path = _UFW,
    cards: Callable[[], tuple[NetworkCard, ...]] = network_cards,
    environment: Mapping[str, str] = os.environ,
) -> Iterator[Finding]:
    """Look at this machine.

    Args:
        robot: the controller's IP address.
        addresses: where each arm's datagrams are awaited.
        run: runs a program; by default for 5 s at most.
        ufw: its configuration.
        cards: this machine's network cards.
        environment: variables.
    """
    yield from examine_route(robot, addresses, cards())
    ports = [address.port for address in addresses.values()]
    if len({*ports}) < len(ports):
        yield Finding("UDP ports here", Verdict.PROBLEM, message("arms_share_port", port=ports[0]))
    for side, address in addresses.items():
        name = f"UDP port {address.port} here"
        try:
            UdpServer(address.host, address.port).close()
            yield Finding(name, Verdict.OK, message("port_free", arm=side.word))
        except NoConnection as error:
            yield problem(name, error)
    yield _firewall(robot, ports, run or _run_program, ufw)
    limits = (
        ("real-time priority", resource.RLIMIT_RTPRIO, message("priority_not_permitted")),
        ("locked memory", resource.RLIMIT_MEMLOCK, message("locked_memory_not_permitted")),
    )
    for name, limit, refused in limits:
        highest = resource.getrlimit(limit)[1]
        is_permitted = (
            os.geteuid() == 0 or highest == resource.RLIM_INFINITY or (highest > 0 and limit == resource.RLIMIT_RTPRIO)
        )
        yield Finding(name, Verdict.OK, message("permitted")) if is_permitted else Finding(name, Verdict.NOTE, refused)
    yield from _ros(environment)


def examine_route(
    robot: str, addresses: Mapping[Side, EgmAddress], cards: tuple[NetworkCard, ...]
) -> Iterator[Finding]:
    """The card that faces the robot, and others that could be taken for it."""
    if ip_address(robot).is_loopback:
        yield Finding("route", Verdict.OK, message("robot_on_this_machine"))
        return
    for host in dict.fromkeys(address.host for address in addresses.values()):
        card = next((card for card in cards if card.address == host), None)
        if card is None:
            yield Finding("route", Verdict.PROBLEM, message("no_card_with_address", host=host))
            continue
        network = IPv4Interface(f"{card.address}/{card.mask}").network
        named = f"{card.name} ({card.address})"
        if ip_address(robot) in network:
            yield Finding("route", Verdict.OK, message("card_in_network", card=named, network=str(network)))
        else:
            found = message("card_in_other_network", card=named, network=str(network), robot=robot)
            yield Finding("route", Verdict.NOTE, found)
        others = [
            each
            for each in cards
            if each.name != card.name and ip_address(robot) in IPv4Interface(f"{each.address}/{each.mask}").network
        ]
        if others:
            names = tuple(f"{each.name} ({each.address})" for each in others)
            yield Finding("network card", Verdict.PROBLEM, message("cards_share_network", others=names, card=named))
        faults = (
            (card.is_wireless, message("card_is_wireless", card=card.name)),
            (card.is_tunnel, message("card_is_tunnel", card=card.name)),
            (not card.is_up, message("card_not_connected", card=card.name)),
            (card.mtu < _SMALLEST_MTU, message("card_with_small_mtu", card=card.name, mtu=card.mtu)),
        )
        seen = [fault for is_so, fault in faults if is_so]
        for fault in seen:
            yield Finding("network card", Verdict.PROBLEM, fault)
        if not seen and not others:
            yield Finding("network card", Verdict.OK, message("card_found", card=card.name, mtu=card.mtu))


def _firewall(robot: str, ports: list[int], run: Run, ufw: Path) -> Finding:
    """What can be known of it without root; a firewall that drops EGM is the most frequent fault of a new set-up."""
    wanted = f"{min(ports)}:{max(ports)}"
    if ip_address(robot).is_loopback:
        return Finding("firewall", Verdict.OK, message("firewall_does_not_matter"))
    if ufw.is_file() and _UFW_ON.search(ufw.read_text(encoding="utf-8", errors="replace")):
        return Finding("firewall", Verdict.NOTE, message("ufw_is_on", robot=robot, ports=wanted))
    for name, *arguments in _LISTINGS:
        program = shutil.which(name, path=_SYSTEM_PATH)
        if program is None:
            continue
        try:
            done = run([program, *arguments])
        except (OSError, subprocess.TimeoutExpired):
            done = None
        if done is None or done.returncode != 0:
            found = message("firewall_unreadable", firewall=name, ports=wanted, robot=robot)
            return Finding("firewall", Verdict.NOTE, found)
        if _CLOSES.search(done.stdout) and not all(str(port) in done.stdout for port in ports):
            found = message("firewall_closes_something", firewall=name, ports=wanted, robot=robot)
            return Finding("firewall", Verdict.NOTE, found)
        return Finding("firewall", Verdict.OK, message("firewall_open", firewall=name, ports=wanted))
    return Finding("firewall", Verdict.OK, message("no_firewall_found"))


def _run_program(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=5.0, stdin=subprocess.DEVNULL)


def _ros(environment: Mapping[str, str]) -> Iterator[Finding]:
    if find_spec("rclpy") is None:
        yield Finding("ROS 2", Verdict.NOTE, message("ros_not_installed"))
    else:
        yield Finding("ROS 2", Verdict.OK, message("as_found", value=environment.get("ROS_DISTRO", "installed")))
    text = environment.get("ROS_DOMAIN_ID", "0") or "0"
    if not text.isdecimal() or int(text) > _LAST_DOMAIN:
        yield Finding("ROS domain", Verdict.PROBLEM, message("ros_domain_invalid", value=text, highest=_SAFE_DOMAIN))
    elif int(text) > _SAFE_DOMAIN:
        yield Finding("ROS domain", Verdict.NOTE, message("ros_domain_high", value=text, highest=_SAFE_DOMAIN))
    else:
        yield Finding("ROS domain", Verdict.OK, message("as_found", value=text))
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if environment.get("ROS_LOCALHOST_ONLY") and reach:
        yield Finding("ROS discovery", Verdict.NOTE, message("ros_discovery_overruled", value=reach))
    elif reach.upper() == "OFF":
        yield Finding("ROS discovery", Verdict.NOTE, message("ros_discovery_off"))
    elif reach and reach.upper() not in _DISCOVERY:
        yield Finding("ROS discovery", Verdict.PROBLEM, message("ros_discovery_invalid", value=reach))
    elif reach:
        yield Finding("ROS discovery", Verdict.OK, message("as_found", value=reach))
    else:
        yield Finding("ROS discovery", Verdict.OK, message("ros_discovery_of_driver"))


START_STREAM, STOP_STREAM = "EGM_START_STREAM", "EGM_STOP_STREAM"

_STREAM_POLL = 0.0005  # [s]
_FIRST_DATAGRAM = 3.0  # [s] within which the first datagram comes
_IDLE_DEADLINE = 5.0  # [s]
_SAME_POSITION = 0.02  # [rad] by which the positions in datagrams may differ from those of Robot Web Services

_NEEDED_TO_STREAM = ("robot", "modules in", "program in", "version in", "task", "reachable", "login", "answers")
_WORST_LOSS = 0.001
_WORST_JITTER = 0.5 * CYCLE  # mean; a reply that is late by a whole cycle is used in the next


class Link(Protocol):
    """Our end of one arm's EGM."""

    def receive(self) -> list[bytes]:
        """All datagrams that wait, oldest first."""


@dataclass(frozen=True, slots=True)
class ArmStream:
    """What came of one arm.

    Attributes:
        received: datagrams that count.
        lost: datagrams that the robot sent and that did not arrive.
        malformed: datagrams that are not EGM.
        period: mean time between two of them [s].
        jitter: mean difference of two datagrams' delays [s].
        worst_jitter: the largest such difference [s].
        position: in the last datagram [rad], (7,); None where none came.
    """

    received: int
    lost: int
    malformed: int
    period: float
    jitter: float
    worst_jitter: float
    position: Joints | None

    @property
    def loss(self) -> float:
        """Share of the datagrams that were lost."""
        sent = self.received + self.lost
        return self.lost / sent if sent else 0.0

    def is_of(self, position: Joints) -> bool:
        """Whether its datagrams are those of an arm that stands at ``position`` [rad]."""
        return self.position is not None and all(
            abs(one - other) < _SAME_POSITION for one, other in zip(self.position, position, strict=True)
        )


def listen(links: Mapping[Side, Link], clock: Clock, duration: float) -> dict[Side, ArmStream]:
    """Receive for ``duration`` [s] after the first datagram that comes from now on."""
    for link in links.values():
        link.receive()  # what has waited says nothing about when it came
    sessions = {side: SensorSession(JointCodec()) for side in links}
    last: dict[Side, Joints] = {}
    end = clock.now() + _FIRST_DATAGRAM
    while clock.now() < end:
        for side, link in links.items():
            message = sessions[side].accept(link.receive(), clock.now())
            if message is not None:
                if not last:
                    end = clock.now() + duration
                sessions[side].settle()
                last[side] = message.measured
        clock.wait(_STREAM_POLL)
    return {
        side: ArmStream(
            received=session.counters.received,
            lost=session.counters.lost,
            malformed=session.counters.malformed,
            period=session.arrivals.cycle_time,
            jitter=session.arrivals.jitter,
            worst_jitter=session.arrivals.worst_jitter,
            position=last.get(side),
        )
        for side, session in sessions.items()
    }


@contextmanager
def streaming(client: RwsClient, clock: Clock, on_progress: OnProgress = lambda text: None) -> Iterator[None]:
    """Position streams of both arms for the time of the block; afterwards motors and program are on or off as before.

    Where no program runs, the motors go on and the program starts at main, with its variables as they begin; its
    pointers stay where it stops. Other tasks of the user are not started: they are switched off for that time, which
    ``on_progress`` gets before. The arms do not move.

    Raises:
        RobotNotReady: a task has another program than the state machine, or a stop waits for a person's confirmation,
            and nothing was switched; or the mode or the program prevents it; or a task that was switched off could not
            be switched on again.
    """
    for side in Side:
        _refuse_other_program(client, side)
    panel = ControllerPanel(client, clock)

    def quietly(action: Callable[[], object]) -> None:
        with suppress(ControllerRefused, NoConnection, RobotNotReady):  # what failed before says more
            action()

    with ExitStack() as undo:
        were_on, was_running = panel.are_motors_on, panel.is_running
        if not was_running:
            _refuse_open_stop(client, clock)
            if not were_on:
                on_progress("motors on")
                undo.callback(quietly, panel.switch_motors_off)
                panel.switch_motors_on()
            undo.enter_context(_others_off(client, on_progress))
            on_progress("program pointers to main, start the program")
            panel.move_pp_to_main()
            undo.callback(quietly, panel.stop_rapid)
            panel.start_rapid()
        wait_until(
            clock,
            lambda: all(_machine_state(client, side) is MachineState.IDLE for side in Side),
            _IDLE_DEADLINE,
            message("state_machine_does_not_become_idle"),
        )
        on_progress("start the position streams")
        client.pulse_signal(START_STREAM)
        undo.callback(quietly, lambda: client.pulse_signal(STOP_STREAM))
        yield


@contextmanager
def _others_off(client: RwsClient, on_progress: OnProgress) -> Iterator[None]:
    """Keep other tasks switched off for the time of the block: all that the task panel selects would start.

    Raises:
        RobotNotReady: one could not be switched on again.
    """
    left_off: list[str] = []

    def switch_on(task: str) -> None:
        try:
            client.select_task(task, True)
        except YumiError:
            left_off.append(task)
            on_progress(str(message("tasks_left_off", tasks=(task,))))

    def report(kind: object, error: BaseException | None, trace: object) -> None:
        """The error, if there was one, comes after what is left off; a Ctrl-C stays one."""
        if left_off and (error is None or isinstance(error, YumiError)):
            if error is None:
                raise RobotNotReady(message("tasks_left_off", tasks=tuple(left_off)))
            raise RobotNotReady(
                message("tasks_left_off_after", tasks=tuple(left_off), reason=said_by(error))
            ) from error

    with ExitStack() as undo:
        undo.push(report)  # the last that is done
        for task in client.tasks():
            if task.is_active and task.starts_by_hand and task.name not in {side.task for side in Side}:
                on_progress(f"task {task.name} is switched off meanwhile")
                undo.callback(switch_on, task.name)
                client.select_task(task.name, False)
        yield


def _refuse_other_program(client: RwsClient, side: Side) -> None:
    """Refuse a task where a start at main would run something else than the state machine."""
    try:
        client.symbol(side.task, MAIN, "current_state")
    except ControllerRefused as error:
        raise RobotNotReady(message("no_state_machine_to_start", task=side.task)) from error
    for name, _ in foreign_mains(client, side):
        raise RobotNotReady(message("other_program_not_started", task=side.task, module=name))


def _refuse_open_stop(client: RwsClient, clock: Clock) -> None:
    """Start nothing after a stop that a person must confirm; a driver that comes later would not see it any more."""
    stops = StopLog(clock)
    stops.read(client)
    if stops.stop is not None:
        raise RobotNotReady(message("stop_before_installation", causes=stops.stop.causes), stops.stop.id)


def _machine_state(client: RwsClient, side: Side) -> MachineState | None:
    try:
        return read_machine_state(client.symbol(side.task, MAIN, "current_state"))
    except ProtocolError:
        return None


def obstacle_to_stream(findings: Sequence[Finding]) -> Finding | None:
    """That the position streams are not tried, where the program that would start is not surely the state machine."""
    found = next(
        (
            each
            for each in findings
            if each.verdict is Verdict.PROBLEM and each.requirement.startswith(_NEEDED_TO_STREAM)
        ),
        None,
    )
    if found is None:
        return None
    what = message("stream_not_tried", requirement=found.requirement, reason=found.said)
    return Finding("EGM stream", Verdict.NOTE, what)


def examine_stream(
    streams: Mapping[Side, ArmStream], stands: Mapping[Side, Joints], addresses: Mapping[Side, EgmAddress]
) -> Iterator[Finding]:
    """Judge what came of both arms' position streams.

    Args:
        streams: what came.
        stands: where the arms stand by Robot Web Services [rad].
        addresses: where each arm's datagrams were awaited.
    """
    for side, stream in streams.items():
        name, address = f"EGM {side.word}", addresses[side]
        if stream.position is None and stream.malformed:
            yield Finding(name, Verdict.PROBLEM, message("stream_not_egm", port=address.port))
        elif stream.position is None:
            yield Finding(name, Verdict.PROBLEM, message("stream_dropped", host=address.host, port=address.port))
        elif not stream.is_of(stands[side]):
            is_other = stream.is_of(stands[side.other])
            what = message("stream_of_other_arm" if is_other else "stream_not_of_this_arm", port=address.port)
            yield Finding(name, Verdict.PROBLEM, what)
        else:
            yield from _stream_quality(name, stream)


def _stream_quality(name: str, stream: ArmStream) -> Iterator[Finding]:
    numbers = message(
        "stream_quality",
        received=stream.received,
        period=stream.period,
        lost=stream.lost,
        jitter=stream.jitter,
        worst=stream.worst_jitter,
    )
    if stream.loss > _WORST_LOSS:
        yield Finding(name, Verdict.PROBLEM, message("stream_lossy", loss=stream.loss, quality=numbers))
    elif stream.jitter > _WORST_JITTER:
        yield Finding(name, Verdict.NOTE, message("stream_irregular", quality=numbers))
    else:
        yield Finding(name, Verdict.OK, numbers)
