"""Checks all that driving a robot takes, on the controller and on this machine, and changes nothing.

It goes on where the driver gives up at the first thing that is missing.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from functools import partial
from importlib.resources import files
from ipaddress import ip_address
from pathlib import Path

from yumi.driver.bringup import GRIPPER_PRODUCT, OLDEST_ROBOTWARE, OPTIONS, PROGRAM_VERSION, EgmAddress, LaunchChecks
from yumi.driver.readiness import NO_STOP, RobotState, reason_of, unmet
from yumi.driver.state_machine import WATCHDOG
from yumi.egm.udp import UdpServer
from yumi.errors import ControllerRefused, LoginRefused, NoConnection, ProtocolError, RobotNotReady, YumiError
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient
from yumi.rws.replies import SystemInfo
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

NEWEST_ROBOTWARE = 6
"""RobotWare 7 has Robot Web Services 2, another protocol."""

CLOCK_TOLERANCE = 60.0
"""By so much the clocks may differ before it is worth a note [s]: events are found by their times."""

ADD_IN = "StateMachine Core"
"""The product of ABB's add-in, which brings modules of these names, with other texts."""

GRIPPER_MODULE = "TRobSG"
_DISPENSABLE = {
    GRIPPER_MODULE: "the grippers cannot be used",
    WATCHDOG: "the robot does not stop when the driver dies",
}
_LOAD = "load the RAPID modules of this package (controller_files/README.md)"
_UFW = Path("/etc/ufw/ufw.conf")
_SYSTEM_PATH = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"


_LISTINGS = (["nft", "list", "ruleset"], ["iptables", "-S"])
_UFW_ON = re.compile(r"(?im)^\s*ENABLED\s*=\s*\"?yes")
_CLOSES = re.compile(r"hook input[^}]*policy drop|-P INPUT DROP|\breject\b|-j (?:REJECT|DROP)")


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
        found: what was found.
        remedy: what to do about it; empty where nothing is to be done.
    """

    requirement: str
    verdict: Verdict
    found: str
    remedy: str = ""


Run = Callable[[list[str]], "subprocess.CompletedProcess[str]"]
"""Runs a program that only reads; raises OSError or subprocess.TimeoutExpired."""


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
        yield Finding("reachable", Verdict.OK, client.address)
        yield _problem("login", error)
        return
    except YumiError as error:
        yield _problem("reachable", error)
        return
    yield Finding("reachable", Verdict.OK, client.address)
    yield Finding("login", Verdict.OK, f"system {system.name!r}")
    yield from _system(system)
    checks = LaunchChecks(client, addresses)
    for side in Side:
        yield _checked(f"arm {side.unit}", "moved by this controller", partial(checks.check_unit, side))
    for look in (_mode, _motors, _execution):
        yield from _guarded(partial(look, client))
    for side in Side:
        yield from _guarded(partial(_modules, client, side, has_add_in=ADD_IN in system.options))
    for side, address in addresses.items():
        yield _device(client, side, address)
    try:
        robot, here = client.clock(), now()
    except YumiError as error:
        yield Finding("clock", Verdict.NOTE, f"cannot be read: {error}")
        return
    off = abs((robot - here).total_seconds())
    if off <= CLOCK_TOLERANCE:
        yield Finding("clock", Verdict.OK, f"{off:.0f} s from this machine's")
    else:
        found = f"{robot:%Y-%m-%d %H:%M:%S} there, {here:%Y-%m-%d %H:%M:%S} here (local times, zones are not compared)"
        remedy = "set it on the FlexPendant, so that its event log can be matched"
        yield Finding("clock", Verdict.NOTE, found, remedy)


def examine_machine(
    robot: str, addresses: Mapping[Side, EgmAddress], run: Run | None = None, ufw: Path = _UFW
) -> Iterator[Finding]:
    """Look at this machine: EGM's ports, the firewall as far as it can be read, permission for real time.

    Args:
        robot: the controller's IP address.
        addresses: where each arm's datagrams are awaited.
        run: runs a program; by default for 5 s at most.
        ufw: its configuration.
    """
    for side, address in addresses.items():
        name = f"UDP port {address.port} here"
        try:
            UdpServer(address.host, address.port).close()
            yield Finding(name, Verdict.OK, f"free for the {side.word} arm")
        except NoConnection as error:
            yield _problem(name, error)
    yield _firewall(robot, [address.port for address in addresses.values()], run or _run, ufw)
    has_priority = os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[1] > 0
    yield Finding(
        "real-time priority",
        Verdict.OK if has_priority else Verdict.NOTE,
        "permitted" if has_priority else "not permitted to this user; EGM works, with more jitter under load",
        "" if has_priority else "add 'rtprio 99' and 'memlock unlimited' for the user to /etc/security/limits.d",
    )


def _problem(requirement: str, error: Exception) -> Finding:
    """The finding of an error; its message has the remedy after a semicolon."""
    found, _, remedy = str(error).rstrip(".").partition("; ")
    return Finding(requirement, Verdict.PROBLEM, found, remedy)


def _checked(requirement: str, found: str, check: Callable[[], None]) -> Finding:
    try:
        check()
    except YumiError as error:
        return _problem(requirement, error)
    return Finding(requirement, Verdict.OK, found)


def _guarded(look: Callable[[], list[Finding]]) -> list[Finding]:
    """What is found, or that it could not be read."""
    try:
        return look()
    except YumiError as error:
        return [Finding("answers", Verdict.PROBLEM, str(error), "look at the controller's event log")]


def _system(system: SystemInfo) -> Iterator[Finding]:
    version = ".".join(map(str, system.robotware))
    if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
        remedy = "have it updated to RobotWare 6.09 or newer, but not 7"
        yield Finding("RobotWare", Verdict.PROBLEM, f"{version}, which has no EGM for seven axes", remedy)
    elif system.robotware[0] > NEWEST_ROBOTWARE:
        yield Finding("RobotWare", Verdict.PROBLEM, f"{version}; this driver speaks to RobotWare 6", "")
    else:
        yield Finding("RobotWare", Verdict.OK, version)
    for option, loss in OPTIONS.items():
        if option in system.options:
            yield Finding("option", Verdict.OK, option)
        else:
            yield Finding("option", Verdict.PROBLEM, f"{option} is missing: {loss}", "have ABB add it to the system")
    if GRIPPER_PRODUCT in system.options:
        yield Finding("gripper product", Verdict.OK, GRIPPER_PRODUCT)
    else:
        yield Finding("gripper product", Verdict.NOTE, f"{GRIPPER_PRODUCT} is missing: the grippers cannot be used")


def _mode(client: RwsClient) -> list[Finding]:
    mode = client.operating_mode()
    if mode is OperatingMode.AUTO:
        return [Finding("operating mode", Verdict.OK, mode.value)]
    return [Finding("operating mode", Verdict.PROBLEM, mode.value, "turn it to AUTO on the FlexPendant")]


def _motors(client: RwsClient) -> list[Finding]:
    state = client.controller_state()
    if state is ControllerState.MOTORS_ON:
        return [Finding("motors", Verdict.OK, "on")]
    robot = RobotState(controller_state=state)
    stop = unmet(NO_STOP, robot)
    if stop is not None:
        return [Finding("motors", Verdict.PROBLEM, f"{state.value}: {reason_of(stop, robot)}", stop.remedy)]
    return [Finding("motors", Verdict.NOTE, f"{state.value}; `yumi up` switches them on")]


def _execution(client: RwsClient) -> list[Finding]:
    if client.execution() is ExecutionState.RUNNING:
        return [Finding("RAPID program", Verdict.OK, "runs")]
    return [Finding("RAPID program", Verdict.NOTE, "stopped; `yumi up` moves its pointers to main and starts it")]


def _modules(client: RwsClient, side: Side, *, has_add_in: bool) -> list[Finding]:
    """The modules of one task, their version, and whether they are this package's."""
    name = f"modules in {side.task}"
    try:
        loaded = {module.name.lower() for module in client.modules(side.task)}
    except ControllerRefused as error:
        return [Finding(name, Verdict.PROBLEM, f"there is no such task ({error})", "see that this is a YuMi")]
    ours = delivered_modules()
    missing = [module for module in ours if module.lower() not in loaded]
    findings = []
    needed = [module for module in missing if module not in _DISPENSABLE]
    if needed:
        findings.append(Finding(name, Verdict.PROBLEM, f"{', '.join(needed)} missing", _LOAD))
    for module in (each for each in missing if each in _DISPENSABLE):
        findings.append(Finding(name, Verdict.NOTE, f"{module} missing: {_DISPENSABLE[module]}", _LOAD))
    if needed:
        return findings
    version = _checked(f"version in {side.task}", f"{PROGRAM_VERSION}", lambda: LaunchChecks(client).check_task(side))
    try:
        texts = {module: client.module_text(side.task, module) for module in ours if module not in missing}
    except (ControllerRefused, ProtocolError) as error:
        found = f"all needed are loaded; their texts cannot be compared: {error}"
        return [*findings, Finding(name, Verdict.NOTE, found), version]
    changed = [module for module, text in texts.items() if essence(text) != essence(ours[module])]
    if changed:
        verdict = Verdict.NOTE if has_add_in else Verdict.PROBLEM
        why = ", as ABB's add-in has its own" if has_add_in else ""
        found = f"{', '.join(changed)} not as in this package{why}"
        findings.append(Finding(name, verdict, found, f"unless that is meant, {_LOAD}"))
    elif not missing:
        findings.append(Finding(name, Verdict.OK, "all loaded, as in this package"))
    return [*findings, version]


def delivered_modules() -> dict[str, str]:
    """The RAPID modules of this package by name."""
    folder = files("yumi.controller_files")
    paths = sorted(each.name for each in folder.iterdir() if each.name.endswith((".mod", ".sys")))
    return {Path(path).stem: (folder / path).read_text(encoding="latin-1") for path in paths}


_CODE = re.compile(r'(?:"[^"]*"|[^"!])*')
"""A line up to its comment."""

_PERSISTENT = re.compile(r"\b(pers\s+\w+\s+\w+(?:\{[^}]*\})?)\s*:=[^;]*;", re.IGNORECASE)


def essence(text: str) -> str:
    """A RAPID text to compare: without comments, spaces, letter case and the present values of PERS data."""
    code = "\n".join(match[0] for line in text.splitlines() if (match := _CODE.match(line)))
    return "".join(_PERSISTENT.sub(r"\1;", code).split()).lower()


def _device(client: RwsClient, side: Side, address: EgmAddress) -> Finding:
    name = f"UDPUC device {side.unit}"
    checks = LaunchChecks(client, {side: address})
    try:
        checks.check_devices()
    except YumiError as error:
        return _problem(name, error)
    if checks.remarks:
        return _problem(name, RobotNotReady(checks.remarks[0]))
    return Finding(name, Verdict.OK, f"sends to {address.host}:{address.port}, where it is awaited")


def _firewall(robot: str, ports: list[int], run: Run, ufw: Path) -> Finding:
    """What can be known of it without root; a firewall that drops EGM is the most frequent fault of a new set-up."""
    wanted = f"{min(ports)}:{max(ports)}"
    if ip_address(robot).is_loopback:
        return Finding("firewall", Verdict.OK, "does not matter to this machine's own address")
    if ufw.is_file() and _UFW_ON.search(ufw.read_text(encoding="utf-8", errors="replace")):
        remedy = f"sudo ufw allow from {robot} to any port {wanted} proto udp"
        return Finding("firewall", Verdict.NOTE, "ufw is on, its rules are not readable without root", remedy)
    for name, *arguments in _LISTINGS:
        program = shutil.which(name, path=_SYSTEM_PATH)
        if program is None:
            continue
        try:
            done = run([program, *arguments])
        except (OSError, subprocess.TimeoutExpired):
            done = None
        if done is None or done.returncode != 0:
            remedy = f"see with sudo that UDP ports {wanted} are open to {robot}"
            return Finding("firewall", Verdict.NOTE, f"{name}: not readable without root", remedy)
        if _CLOSES.search(done.stdout) and not all(str(port) in done.stdout for port in ports):
            found = f"{name} closes something, and does not name all of the ports {wanted}"
            return Finding("firewall", Verdict.NOTE, found, f"see that UDP ports {wanted} are open to {robot}")
        return Finding("firewall", Verdict.OK, f"{name} shows nothing that closes UDP ports {wanted}")
    return Finding("firewall", Verdict.OK, "none found (ufw, nft, iptables)")


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=5.0, stdin=subprocess.DEVNULL)
