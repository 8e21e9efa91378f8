"""Checks all that driving a robot takes, on the controller and on this machine, and changes nothing.

It goes on where the driver gives up at the first thing that is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial

from yumi.driver.bringup import GRIPPER_PRODUCT, OLDEST_ROBOTWARE, OPTIONS, PROGRAM_VERSION, EgmAddress, LaunchChecks
from yumi.driver.commissioning.findings import Finding, Verdict
from yumi.driver.commissioning.installation import ADD_INS, MASTERSHIPS, delivered, missing_grants
from yumi.driver.commissioning.machine import problem
from yumi.driver.commissioning.modules import GRIPPER_MODULE, OWN_MODULE, delivered_modules, essence, foreign_mains
from yumi.driver.commissioning.stream import ArmStream
from yumi.driver.readiness import NO_STOP, RobotState, reason_of, unmet
from yumi.driver.state_machine import WATCHDOG
from yumi.errors import ControllerRefused, LoginRefused, ProtocolError, RobotNotReady, YumiError
from yumi.robot.joints import CYCLE, Joints, Side
from yumi.rws.client import RwsClient
from yumi.rws.replies import SystemInfo
from yumi.rws.types import CollisionState, ControllerState, ExecutionState, Grant, OperatingMode

NEWEST_ROBOTWARE = 6
"""RobotWare 7 has Robot Web Services 2, another protocol."""

CLOCK_TOLERANCE = 60.0
"""By so much the clocks may differ before it is worth a note [s]: events are found by their times."""

_DISPENSABLE = {
    GRIPPER_MODULE: "the grippers cannot be used",
    WATCHDOG: "the robot does not stop when the driver dies",
}
_LOAD = "load the RAPID modules of this package: yumi install"
_INSTALL = "yumi install"
_MOST_SESSIONS, _MANY_SESSIONS = 70, 50
NEEDED_GRANTS = {
    Grant.RAPID_EXECUTE: "start programs",
    Grant.RAPID_CURRVALUE: "write RAPID data",
    Grant.IO_WRITE: "write signals",
}
"""What the user of the driver needs, and for what; `yumi install` needs more."""
_NEEDED_TO_STREAM = ("modules in", "program in", "version in", "task", "reachable", "login", "answers")
_WORST_LOSS = 0.001
_WORST_JITTER = 0.5 * CYCLE  # mean; a reply that is late by a whole cycle is used in the next


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
        yield problem("login", error)
        return
    except YumiError as error:
        yield problem("reachable", error)
        return
    yield Finding("reachable", Verdict.OK, client.address)
    yield Finding("login", Verdict.OK, f"system {system.name!r}")
    yield from _system(system)
    checks = LaunchChecks(client, addresses)
    for side in Side:
        yield _checked(f"arm {side.unit}", "moved by this controller", partial(checks.check_unit, side))
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


def _clock(client: RwsClient, here: datetime) -> Finding:
    try:
        robot = client.clock()
    except YumiError as error:
        return Finding("clock", Verdict.NOTE, f"cannot be read: {error}")
    off = abs((robot - here).total_seconds())
    if off <= CLOCK_TOLERANCE:
        return Finding("clock", Verdict.OK, f"{off:.0f} s from this machine's")
    found = f"{robot:%Y-%m-%d %H:%M:%S} there, {here:%Y-%m-%d %H:%M:%S} here (local times, zones are not compared)"
    return Finding("clock", Verdict.NOTE, found, "set it on the FlexPendant, so that its event log can be matched")


def _checked(requirement: str, found: str, check: Callable[[], None]) -> Finding:
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
    for name in ADD_INS:
        if name in system.options:
            yield Finding("add-in", Verdict.OK, f"{name}: the state machine may be ABB's own")
    if GRIPPER_PRODUCT in system.options:
        yield Finding("gripper product", Verdict.OK, GRIPPER_PRODUCT)
    else:
        yield Finding("gripper product", Verdict.NOTE, f"{GRIPPER_PRODUCT} is missing: the grippers cannot be used")


def _mode(client: RwsClient) -> list[Finding]:
    mode = client.operating_mode()
    if mode is OperatingMode.AUTO:
        return [Finding("operating mode", Verdict.OK, mode.value)]
    remedy = "turn it to AUTO on the FlexPendant"
    found = f"{mode.value}: programs on a computer may change nothing, but with a privilege that a person grants (RMMP)"
    return [Finding("operating mode", Verdict.PROBLEM, found, remedy)]


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


def _panel(client: RwsClient) -> list[Finding]:
    findings = []
    state = client.collision_state()
    if state in (CollisionState.TRIGGERED, CollisionState.TRIGGERED_ACKNOWLEDGED):
        remedy = "look at the robot, then let `yumi recover` confirm it"
        findings.append(
            Finding("collision", Verdict.PROBLEM, "an arm has collided, and the program was stopped", remedy)
        )
    percent = client.speed_ratio()
    verdict, remedy = (Verdict.OK, "") if percent else (Verdict.PROBLEM, "raise it on the FlexPendant")
    findings.append(Finding("speed ratio", verdict, f"{percent} %", remedy))
    return findings


def _masterships(client: RwsClient) -> list[Finding]:
    """Who holds the right to change something; a driver needs it for moments only."""
    held = [(domain, holder) for domain in MASTERSHIPS if (holder := client.mastership(domain))]
    if not held:
        return [Finding("mastership", Verdict.OK, "free")]
    return [
        Finding(
            "mastership",
            Verdict.PROBLEM,
            f"{holder} holds that of {domain}",
            "release it there (RobotStudio, FlexPendant)",
        )
        for domain, holder in held
    ]


def _grants(client: RwsClient) -> list[Finding]:
    """What the user may do; a controller that does not say it in ABB's words is not judged."""
    missing = missing_grants(client, NEEDED_GRANTS)
    if not missing:
        return [Finding("grants", Verdict.OK, f"the user has {len(client.grants())}")]
    remedy = "give them to the user in RobotStudio (User Accounts), or log in as another user"
    return [Finding("grants", Verdict.PROBLEM, f"the user lacks {', '.join(missing)}", remedy)]


def _sessions(client: RwsClient) -> list[Finding]:
    """How many clients there are, as far as the controller shows them."""
    used = len(client.users())
    if used <= _MANY_SESSIONS:
        return [Finding("sessions", Verdict.OK, f"{used} of {_MOST_SESSIONS} clients are known")]
    remedy = "end programs that log in again and again without logging out; an idle session ends after 5 minutes"
    return [Finding("sessions", Verdict.NOTE, f"{used} of {_MOST_SESSIONS} clients are logged in", remedy)]


def _tasks(client: RwsClient) -> list[Finding]:
    tasks = {task.name: task for task in client.tasks()}
    ours = [tasks[side.task] for side in Side if side.task in tasks]
    idle = [task.name for task in ours if not task.is_active]
    findings = [
        Finding(
            "task", Verdict.PROBLEM, f"{name} is switched off, and does not start", "switch it on in the task panel"
        )
        for name in idle
    ]
    still = [task.name for task in ours if not task.is_motion_task]
    findings += [
        Finding(
            "task",
            Verdict.PROBLEM,
            f"{name} does not move a mechanical unit",
            "see Controller, Task in the configuration",
        )
        for name in still
    ]
    return findings or [Finding("task", Verdict.OK, ", ".join(task.name for task in ours))]


def _foreign_program(client: RwsClient, side: Side) -> list[Finding]:
    """Modules of others with a main: two mains do not link, and another one alone is not the state machine."""
    remedy = f"save it and remove it, or let `{_INSTALL} --replace-main` do so"
    try:
        return [
            Finding(f"program in {side.task}", Verdict.PROBLEM, f"{name} has a main of its own", remedy)
            for name, _ in foreign_mains(client, side)
        ]
    except ControllerRefused:  # there is no such task, which the modules' own finding says
        return []


def _signals(client: RwsClient) -> list[Finding]:
    """Each signal of the state machine: there, of the right kind, writable for clients, and in use since a restart."""
    nowhere = {side: EgmAddress("", 0) for side in Side}
    wanted = {key.name: each for key, each in delivered(nowhere).cfg.items() if key.type == "EIO_SIGNAL" and each}
    configured = {each.name: each.attributes for each in client.cfg("EIO", "EIO_SIGNAL")}
    in_use = {name.lower() for name in client.signals()}
    missing = [name for name in wanted if name not in configured]
    findings = []
    if missing:
        findings.append(
            Finding("signals", Verdict.PROBLEM, f"{', '.join(missing)} missing", f"load EIO.cfg: {_INSTALL}")
        )
    for name, attributes in wanted.items():
        found = configured.get(name)
        if found is None:
            continue
        if found.get("Device"):
            what = f"is on the device {found['Device']}: another signal has its name"
            findings.append(Finding(f"signal {name}", Verdict.PROBLEM, what, "rename that one, then load EIO.cfg"))
        for attribute in ("SignalType", "Access"):
            have, needed = found.get(attribute, ""), attributes.get(attribute, "")
            if have.lower() != needed.lower():
                what = f"has {attribute} {have!r}, not {needed!r}"
                findings.append(
                    Finding(f"signal {name}", Verdict.PROBLEM, what, f"change it, or load EIO.cfg: {_INSTALL}")
                )
    late = [name for name in wanted if name in configured and name.lower() not in in_use]
    if late:
        what = f"{', '.join(late)} configured, but not in use yet"
        findings.append(Finding("restart", Verdict.PROBLEM, what, "restart the controller"))
    return findings or [Finding("signals", Verdict.OK, f"all {len(wanted)} of the state machine")]


def _motion_data(client: RwsClient) -> list[Finding]:
    try:
        there = {each.name for each in client.cfg("MOC", "EXT_MOTION_DATA")}
    except ControllerRefused:  # there is none at all
        there = set()
    missing = [name for side in Side for name in (side.unit, f"{side.unit}_RAW") if name not in there]
    if missing:
        what = f"{', '.join(missing)} missing in External Motion Interface Data"
        return [Finding("motion data", Verdict.PROBLEM, what, f"load MOC.cfg: {_INSTALL}")]
    return [Finding("motion data", Verdict.OK, "filtered and raw, for both arms")]


def _shared_port(client: RwsClient) -> list[Finding]:
    devices = {each.name: each.attributes for each in client.cfg("SIO", "COM_TRP")}
    ports = {devices[side.unit].get("RemotePortNumber") for side in Side if side.unit in devices}
    if len(ports) == 1 and all(side.unit in devices for side in Side):
        what = f"ROB_R and ROB_L both send to port {ports.pop()}"
        return [Finding("UDPUC devices", Verdict.PROBLEM, what, f"give each arm a port of its own: {_INSTALL}")]
    return []


def _gripper(client: RwsClient, side: Side) -> list[Finding]:
    name = f"gripper {side.word}"
    try:
        is_calibrated = client.signal(f"hand_StatusCalibrated_{side.name[0]}").value != 0
    except ControllerRefused:
        remedy = "connect it, or leave the grippers out"
        return [Finding(name, Verdict.NOTE, "the controller has no signals of it: it is not there", remedy)]
    if is_calibrated:
        return [Finding(name, Verdict.OK, "calibrated")]
    return [Finding(name, Verdict.OK, "not calibrated yet; `yumi up` calibrates it, its fingers close")]


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
    what = f"not tried, nothing was started: {found.requirement}: {found.found}"
    return Finding("EGM stream", Verdict.NOTE, what, "solve that first")


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
            what = f"what comes to port {address.port} is not EGM of a seven-axis arm"
            yield Finding(name, Verdict.PROBLEM, what, "see what sends there: it is not this robot")
        elif stream.position is None:
            what = f"the robot sends, and nothing comes to {address.host}:{address.port}: it is dropped on the way"
            yield Finding(
                name,
                Verdict.PROBLEM,
                what,
                f"open UDP port {address.port} in this machine's firewall, and see the route",
            )
        elif not stream.is_of(stands[side]):
            other = " but those of the other arm" if stream.is_of(stands[side.other]) else ""
            what = f"the datagrams at port {address.port} are not this arm's{other}"
            yield Finding(name, Verdict.PROBLEM, what, f"exchange the ports of the UDPUC devices: {_INSTALL}")
        else:
            yield from _quality(name, stream)


def _quality(name: str, stream: ArmStream) -> Iterator[Finding]:
    numbers = (
        f"{stream.received} datagrams, one every {stream.period * 1e3:.2f} ms, {stream.lost} lost, jitter "
        f"{stream.jitter * 1e3:.2f} ms, worst {stream.worst_jitter * 1e3:.1f} ms"
    )
    if stream.loss > _WORST_LOSS:
        yield Finding(
            name, Verdict.PROBLEM, f"{stream.loss:.1%} is lost on the way: {numbers}", "use a cable, and no VPN"
        )
    elif stream.jitter > _WORST_JITTER:
        yield Finding(
            name, Verdict.NOTE, f"it comes irregularly: {numbers}", "use a cable; look at the load of this machine"
        )
    else:
        yield Finding(name, Verdict.OK, numbers)


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
    changed = [
        module for module, text in texts.items() if module != OWN_MODULE and essence(text) != essence(ours[module])
    ]
    if changed:
        verdict = Verdict.NOTE if has_add_in else Verdict.PROBLEM
        why = ", as ABB's add-in has its own" if has_add_in else ""
        found = f"{', '.join(changed)} not as in this package{why}"
        findings.append(Finding(name, verdict, found, f"unless that is meant, {_LOAD}"))
    elif not missing:
        findings.append(Finding(name, Verdict.OK, "all loaded, as in this package"))
    return [*findings, version]


def _device(client: RwsClient, side: Side, address: EgmAddress) -> Finding:
    name = f"UDPUC device {side.unit}"
    checks = LaunchChecks(client, {side: address})
    try:
        checks.check_devices()
    except YumiError as error:
        return problem(name, error)
    if checks.remarks:
        return problem(name, RobotNotReady(checks.remarks[0]))
    return Finding(name, Verdict.OK, f"sends to {address.host}:{address.port}, where it is awaited")
