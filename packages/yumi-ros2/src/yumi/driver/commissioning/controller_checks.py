"""The part of the doctor that looks at the controller over Robot Web Services."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import datetime
from functools import partial

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import ControllerRefused, LoginRefused, ProtocolError, RobotNotReady, YumiError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.system import SystemInfo
from abb_protocols.rws.values import CollisionState, ControllerState, ExecutionState, Grant, OperatingMode
from abb_runtime.rws.client import RwsClient
from yumi.driver.commissioning.contents import essence
from yumi.driver.commissioning.delivery import (
    GRIPPER_MODULE,
    OWN_MODULE,
    STATE_MACHINE_ADD_INS,
    delivered,
    delivered_modules,
)
from yumi.driver.commissioning.findings import Finding, Verdict, problem
from yumi.driver.commissioning.installation import MASTERSHIPS, NEWEST_ROBOTWARE, foreign_mains, missing_grants
from yumi.driver.gripper_signals import full_signal_name
from yumi.driver.launch_checks import (
    GRIPPER_PRODUCT,
    OLDEST_ROBOTWARE,
    PROGRAM_VERSION,
    REQUIRED_OPTIONS,
    EgmAddress,
    LaunchChecks,
)
from yumi.driver.readiness import NO_STOP, unmet
from yumi.driver.robot_state import RobotState
from yumi.driver.state_machine import WATCHDOG_MODULE

_CLOCK_TOLERANCE = 60.0
"""By so much the clocks may differ before it is worth a note [s]: events are found by their times."""

NEEDED_GRANTS = {
    Grant.RAPID_EXECUTE: "start programs",
    Grant.RAPID_CURRVALUE: "write RAPID data",
    Grant.IO_WRITE: "write signals",
}
"""What the user of the driver needs, and for what; `yumi install` needs more."""

_DISPENSABLE = (GRIPPER_MODULE, WATCHDOG_MODULE)
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
    robot = _checked("robot", message("is_a_yumi"), partial(checks.check_robot, system))
    is_another = robot.verdict is Verdict.PROBLEM
    if is_another:  # first, and alone: nothing of a YuMi is missing on another robot
        yield robot
    yield Finding("reachable", Verdict.OK, message("as_found", value=client.address))
    yield Finding("login", Verdict.OK, message("logged_in", system=system.name))
    if is_another:
        return
    yield from _system(system)
    for side in Side:
        yield _checked(f"arm {side.unit}", message("arm_moved_by_controller"), partial(checks.check_unit, side))
    for look in (_mode, _motors, _execution, _panel, _masterships, _grants, _sessions, _tasks):
        yield from _guarded(partial(look, client))
    for side in Side:
        yield from _guarded(partial(_foreign_program, client, side))
        yield from _guarded(
            partial(_modules, client, side, has_add_in=any(name in system.options for name in STATE_MACHINE_ADD_INS))
        )
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


def _guarded(look: Callable[[], Iterable[Finding]]) -> list[Finding]:
    """What is found, or that it could not be read."""
    try:
        return list(look())
    except YumiError as error:
        return [Finding("answers", Verdict.PROBLEM, message("could_not_be_read", reason=said_by(error)))]


def _system(system: SystemInfo) -> Iterator[Finding]:
    if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
        yield Finding("RobotWare", Verdict.PROBLEM, message("robotware_without_egm", version=system.version))
    elif system.robotware[0] > NEWEST_ROBOTWARE:
        yield Finding("RobotWare", Verdict.PROBLEM, message("robotware_too_new", version=system.version))
    else:
        yield Finding("RobotWare", Verdict.OK, message("as_found", value=system.version))
    for option, loss in REQUIRED_OPTIONS.items():
        if option in system.options:
            yield Finding("option", Verdict.OK, message("as_found", value=option))
        else:
            yield Finding("option", Verdict.PROBLEM, message("option_not_installed", option=option, loss=loss))
    for name in STATE_MACHINE_ADD_INS:
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


def _panel(client: RwsClient) -> Iterator[Finding]:
    if client.collision_state() in (CollisionState.TRIGGERED, CollisionState.TRIGGERED_ACKNOWLEDGED):
        yield Finding("collision", Verdict.PROBLEM, message("arm_has_collided"))
    percent = client.speed_ratio()
    if percent:
        yield Finding("speed ratio", Verdict.OK, message("speed_ratio", percent=percent))
    else:
        yield Finding("speed ratio", Verdict.PROBLEM, message("speed_ratio_zero"))


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


def _modules(client: RwsClient, side: Side, *, has_add_in: bool) -> Iterator[Finding]:
    """The modules of one task, their version, and whether they are this package's."""
    name = f"modules in {side.task}"
    try:
        loaded = {module.name.lower() for module in client.modules(side.task)}
    except ControllerRefused as error:
        what = message("modules_without_task", task=side.task, reason=said_by(error))
        yield Finding(name, Verdict.PROBLEM, what)
        return
    ours = delivered_modules()
    missing = [module for module in ours if module.lower() not in loaded]
    needed = tuple(module for module in missing if module not in _DISPENSABLE)
    if needed:
        yield Finding(name, Verdict.PROBLEM, message("modules_missing", modules=needed))
    for module in (each for each in missing if each in _DISPENSABLE):
        what = message("gripper_module_missing" if module == GRIPPER_MODULE else "watchdog_missing", module=module)
        yield Finding(name, Verdict.NOTE, what)
    if needed:
        return
    is_version = message("as_found", value=f"{PROGRAM_VERSION}")
    version = _checked(f"version in {side.task}", is_version, lambda: LaunchChecks(client).check_task(side))
    compared = {module: text for module, text in ours.items() if module not in (*missing, OWN_MODULE)}
    try:
        changed = tuple(
            module
            for module, text in compared.items()
            if essence(client.module_text(side.task, module)) != essence(text)
        )
    except (ControllerRefused, ProtocolError) as error:
        yield Finding(name, Verdict.NOTE, message("modules_not_comparable", reason=said_by(error)))
    else:
        if changed and has_add_in:
            yield Finding(name, Verdict.NOTE, message("modules_of_add_in", modules=changed))
        elif changed:
            yield Finding(name, Verdict.PROBLEM, message("modules_differ", modules=changed))
        elif not missing:
            yield Finding(name, Verdict.OK, message("modules_as_delivered"))
    yield version


def _signals(client: RwsClient) -> Iterator[Finding]:
    """Each signal of the state machine: there, of the right kind, writable for clients, and in use since a restart."""
    nowhere = {side: EgmAddress("", 0) for side in Side}
    wanted = {key.name: each for key, each in delivered(nowhere).cfg.items() if key.type == "EIO_SIGNAL" and each}
    configured = {each.name: each.attributes for each in client.cfg("EIO", "EIO_SIGNAL")}
    in_use = {name.lower() for name in client.signals()}
    there = {name: configured[name] for name in wanted if name in configured}
    missing = tuple(name for name in wanted if name not in there)
    late = tuple(name for name in there if name.lower() not in in_use)
    faults = [
        (name, message("signal_on_device", device=found["Device"]))
        for name, found in there.items()
        if found.get("Device")
    ]
    faults += [
        (name, message("signal_differs", attribute=attribute, value=found.get(attribute, ""), needed=needed))
        for name, found in there.items()
        for attribute in ("SignalType", "Access")
        if found.get(attribute, "").lower() != (needed := wanted[name].get(attribute, "")).lower()
    ]
    if missing:
        yield Finding("signals", Verdict.PROBLEM, message("signals_missing", signals=missing))
    yield from (Finding(f"signal {name}", Verdict.PROBLEM, fault) for name, fault in faults)
    if late:
        yield Finding("restart", Verdict.PROBLEM, message("signals_not_in_use", signals=late))
    if not (missing or faults or late):
        yield Finding("signals", Verdict.OK, message("signals_found", count=len(wanted)))


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
        is_calibrated = client.signal(full_signal_name(side, "hand_StatusCalibrated")).value != 0
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
    if off <= _CLOCK_TOLERANCE:
        return Finding("clock", Verdict.OK, message("clock_agrees", difference=off))
    times = message("clock_differs", there=f"{robot:%Y-%m-%d %H:%M:%S}", here=f"{here:%Y-%m-%d %H:%M:%S}")
    return Finding("clock", Verdict.NOTE, times)
