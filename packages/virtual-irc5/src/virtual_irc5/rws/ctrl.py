"""The virtual controller's answers on ``/ctrl`` and ``/progress``: clock, identity, network, backup, restart."""

from __future__ import annotations

import io as bytes_io
import ipaddress
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, tzinfo
from math import inf
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from abb_protocols.errors import RapidError, SettingsError
from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import ctrl as table
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.backup import check_backup, restore_backup, write_backup
from virtual_irc5.controller.file_store import DISK_DEVICES
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes, absent_routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_BASE = "/ctrl/"
_DURATION = 2.0  # of a backup and other jobs [s]


ROUTES = Routes()


def _identity_fields(controller: Irc5) -> Mapping[str, str]:
    name, is_virtual = controller.identity.controller_name, controller.identity.is_virtual
    return table.CONTROLLER_IDENTITY.answered.write(
        table.ControllerIdentity(name, "" if is_virtual else name, is_virtual=is_virtual)
    )


@ROUTES.answer(table.CONTROLLER)
def _get_controller(controller: Irc5, call: RwsCall) -> Page:
    links = (RwsLink("self", "identity"),)
    states = (
        page_entry("ctrl-clock-info-li", "clock", **_time_fields(controller)),
        RwsState("ctrl-identity-info-li", "identity", _identity_fields(controller), links),
        *(
            page_entry(f"ctrl-{name}-info-li", name)
            for name in ("system", "backup", "compress", "diagnostics", "safety")
        ),
        page_entry("ctrl-netw-li", "network"),
    )
    return page_at("ctrl", _BASE, "", *states)


@ROUTES.answer(table.CONTROLLER_IDENTITY)
def _get_identity(controller: Irc5, call: RwsCall) -> Page:
    fields = dict(_identity_fields(controller))
    if not controller.identity.is_virtual:
        fields["ctrl-mac"] = "00:00:00:00:00:00"
    fields["ctrl-level"] = "System Level"
    return page_at("ctrl", _BASE, "identity", RwsState("ctrl-identity-info", "identity", fields))


@ROUTES.answer(table.SET_CONTROLLER_IDENTITY)
def _set_identity(controller: Irc5, call: RwsCall) -> None:
    name = call.parameter("ctrl-name", "") or call.parameter("ctrl-id", "")
    if not name:
        raise bad_call("the body lacks ctrl-name and ctrl-id; give one of them")
    controller.identity = replace(controller.identity, controller_name=name)


@ROUTES.answer(table.CONTROLLER_ENVIRONMENT)
def _get_environment(controller: Irc5, call: RwsCall) -> Mapping[str, str]:
    """What an environment variable stands for: our devices stand for themselves."""
    name = call.names["variable"].upper()
    if name not in DISK_DEVICES:
        raise CallFailure(404, RwsCode.FAIL, f"there is no environment variable ${name}")
    return {f"${name}": f"{name}:"}


@ROUTES.answer(table.RESTART_CONTROLLER)
def restart(controller: Irc5, call: RwsCall) -> None:
    """Restart in one of the modes; bstart finds the state that was saved last, which is the present one."""
    mode = call.required("restart-mode")
    if mode in ("shutdown", "xstart"):
        controller.restart(inf)
    else:
        discards = mode in ("istart", "pstart")
        controller.restart(discards_programs=discards, discards_settings=mode == "istart")


@ROUTES.answer(table.SET_CONTROLLER_LANGUAGE)
def set_language(controller: Irc5, call: RwsCall) -> None:
    controller.own_settings.language = call.parameter("lang", "") or call.required("lang-code")


# Clock


def _zone(controller: Irc5) -> tzinfo | None:
    name = controller.own_settings.timezone
    return ZoneInfo(name) if name else None


def _time_fields(controller: Irc5) -> Mapping[str, str]:
    """Local time without its zone, as on the FlexPendant."""
    return table.CLOCK.answered.write(datetime.fromtimestamp(controller.time, _zone(controller)))


@ROUTES.answer(table.CLOCK)
def _get_clock(controller: Irc5, call: RwsCall) -> Page:
    links = (page_entry(f"ctrl-{name}-li", name, f"clock/{name}") for name in ("timezone", "timeserver"))
    state = RwsState("ctrl-clock-info", "clock", _time_fields(controller))
    return page_at("ctrl", _BASE, "clock", state, *links)


@ROUTES.answer(table.SET_CLOCK)
def _set_clock(controller: Irc5, call: RwsCall) -> None:
    parts = [call.number(f"sys-clock-{part}") for part in ("year", "month", "day", "hour", "min", "sec")]
    year, month, day, hour, minute, second = (int(part) for part in parts)
    try:
        controller.time = datetime(year, month, day, hour, minute, second, tzinfo=_zone(controller)).timestamp()
    except (ValueError, OverflowError) as error:
        raise bad_call(f"there is no such time: {error}") from error


@ROUTES.answer(table.CLOCK_TIMEZONE)
def _get_timezone(controller: Irc5, call: RwsCall) -> str:
    return controller.own_settings.timezone or datetime.now().astimezone().tzname() or "UTC"


@ROUTES.answer(table.SET_CLOCK_TIMEZONE_TOO, table.SET_CLOCK_TIMEZONE)
def _set_timezone(controller: Irc5, call: RwsCall) -> None:
    name = call.required("timezone")
    try:
        ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise bad_call(f"there is no time zone {name[:50]!r}") from error
    controller.own_settings.timezone = name


@ROUTES.answer(table.CLOCK_TIMESERVER)
def _get_timeserver(controller: Irc5, call: RwsCall) -> str:
    return controller.own_settings.timeserver


@ROUTES.answer(table.CLOCK_SERVER_TIME)
def _get_server_time(controller: Irc5, call: RwsCall) -> Page:
    raise CallFailure(400, RwsCode.TIMEOUT, f"no time server answers at {call.option('server-ip') or 'that address'}")


@ROUTES.answer(table.SET_CLOCK_TIMESERVER)
def _set_timeserver(controller: Irc5, call: RwsCall) -> None:
    controller.own_settings.timeserver = call.required("timeserver")


# Network: what is set is shown, and does not change this machine's own


@ROUTES.answer(table.NETWORK)
def _get_network(controller: Irc5, call: RwsCall) -> Page:
    own = controller.own_settings
    fields = {
        "addr": own.address,
        "mask": own.mask,
        "name": "LAN",
        "dhcp": "Enabled" if own.method == "dhcp" else "Disabled",
        "gateway": own.gateway,
    }
    service = {"addr": "192.168.125.1", "mask": "255.255.255.0", "name": "Service Port"}
    states = (RwsState("ctrl-netw", "Service Port", service), RwsState("ctrl-netw", "LAN", fields))
    return page_at("ctrl", _BASE, "network", *states)


@ROUTES.answer(table.SET_NETWORK)
def _set_network(controller: Irc5, call: RwsCall) -> HttpReply:
    own, method = controller.own_settings, call.required("method")
    if method == "fixip":
        own.address, own.mask = _address(call, "address"), _address(call, "mask")
        own.gateway = _address(call, "gateway")
    own.method = method
    return HttpReply.at("/ctrl?action=show")


def _address(call: RwsCall, name: str) -> str:
    text = call.required(name)
    try:
        return str(ipaddress.IPv4Address(text))
    except ValueError as error:
        raise bad_call(f"{name} is an IPv4 address, not {text[:50]!r}") from error


@ROUTES.answer(table.NETWORK_DNS)
def _get_dns(controller: Irc5, call: RwsCall) -> Page:
    fields = {"name": controller.identity.controller_name, "addr": controller.own_settings.dns, "port": "53"}
    return page_at("ctrl", "/ctrl/network/", "dns", RwsState("ctrl-netw", "dns", fields))


@ROUTES.answer(table.NETWORK_ROUTES)
def _get_routes(controller: Irc5, call: RwsCall) -> Mapping[str, table.NetworkRoute]:
    return {
        destination: table.NetworkRoute(destination, via) for destination, via in controller.own_settings.routes.items()
    }


@ROUTES.answer(table.ADD_NETWORK_ROUTE)
def _add_route(controller: Irc5, call: RwsCall) -> None:
    controller.own_settings.routes[_destination(call)] = _address(call, "gateway")


@ROUTES.answer(table.REMOVE_NETWORK_ROUTE)
def _remove_route(controller: Irc5, call: RwsCall) -> HttpReply:
    if controller.own_settings.routes.pop(_destination(call), None) is None:
        raise bad_call("there is no route to that destination")
    return HttpReply.at("/ctrl?action=show")


def _destination(call: RwsCall) -> str:
    text = call.required("destination")
    try:
        return str(ipaddress.IPv4Network(text))
    except ValueError as error:
        raise bad_call(f"destination is an IPv4 address or network, not {text[:50]!r}") from error


@ROUTES.answer(table.ADD_NETWORK_ROUTE_OPTIONS, table.REMOVE_NETWORK_ROUTE_OPTIONS)
def _get_route_options(controller: Irc5, call: RwsCall) -> Page:
    names = ("destination", "gateway") if call.path[-1] == "add" else ("destination",)
    fields = {"method": "POST", **dict.fromkeys(names, "")}
    return page_at("ctrl", "/ctrl/network/route/", call.path[-1], RwsState("form", f"{call.path[-1]}route", fields))


# Jobs: backup, compression, diagnostics


def _begin(controller: Irc5, work: Callable[[], None]) -> HttpReply:
    """Begin a job; the answer says where its progress shows."""
    return HttpReply.at(f"/progress/{controller.jobs.begin(work, _DURATION).number}")


@ROUTES.answer(table.PROGRESS)
def _get_progress(controller: Irc5, call: RwsCall) -> Mapping[str, table.Progress]:
    job = controller.jobs.find(call.names["job"])
    if job is None:
        raise CallFailure(404, RwsCode.FAIL, f"there is no job {call.names['job'][:20]!r}")
    code = int(RwsCode.FAIL) if job.failure else table.JOB_DONE if job.is_done else table.JOB_PENDING
    return {str(job.number): table.Progress(code, job.state)}


@ROUTES.answer(table.PROGRESS_LIST)
def _get_progress_list(controller: Irc5, call: RwsCall) -> Page:
    return page_at("progress", "/", "progress")


def _backup_path(text: str) -> str:
    path = path_of_file(text)
    if path.upper().startswith("HOME:") or "/" not in path:
        raise bad_call("a backup is a directory of its own, such as /fileservice/$BACKUP/monday, and not in HOME")
    return path


@ROUTES.answer(table.BACKUP)
def _get_backup(controller: Irc5, call: RwsCall) -> Page:
    state = page_entry("ctrl-backup-li", "backup", "backup", backup_state=controller.own_settings.backup_state)
    return page_at("ctrl", _BASE, "backup", state)


@ROUTES.answer(table.BACKUP_STATE)
def _get_backup_state(controller: Irc5, call: RwsCall) -> Mapping[str, str]:
    return {"backup-state": controller.own_settings.backup_state}


@ROUTES.answer(table.CREATE_BACKUP)
def _back_up(controller: Irc5, call: RwsCall) -> HttpReply:
    path = _backup_path(call.required("backup"))
    own = controller.own_settings
    if own.backup_state == "Backup in Progress":
        raise CallFailure(409, RwsCode.RESOURCE_HELD, "another backup is under way; wait for its end")
    if any(file.lower().startswith(f"{path.lower()}/") for file in controller.files):
        raise Refused(RefusalReason.NAME_TAKEN, f"{path} exists; choose another name.")

    def work() -> None:
        own.backup_state = "Error during backup"
        write_backup(controller, path)
        own.backup_state = "Backup Ready"

    own.backup_state = "Backup in Progress"
    return _begin(controller, work)


@ROUTES.answer(table.RESTORE_BACKUP)
def _restore(controller: Irc5, call: RwsCall) -> None:
    """Become as in a backup; then the controller restarts. The backup stays unless ``delete-dir`` is true."""
    path = _backup_path(call.required("backup"))
    if controller.is_running:
        raise Refused(RefusalReason.NOT_STOPPED, "a backup is restored while RAPID is stopped: stop it first.")
    _check_origin(controller, path, call.parameter("ignore", "none"))
    include = call.parameter("include", "all")
    try:
        restore_backup(controller, path, cfg=include != "modules", modules=include != "cfg")
    except (SettingsError, RapidError) as error:
        raise bad_call(f"the backup cannot be restored: {error}") from error
    if call.parameter("delete-dir", "false").lower() == "true":
        controller.files.remove(path)
    controller.restart()


def _check_origin(controller: Irc5, path: str, ignored: str) -> None:
    name = check_backup(controller, path)
    if ignored not in ("all", "system-id") and name != controller.identity.system_name:
        raise bad_call(f"the backup is of the system {name!r}; ignore=system-id restores it all the same")


@ROUTES.answer(table.CHECK_BACKUP)
def _check_restore(controller: Irc5, call: RwsCall) -> Mapping[str, bool]:
    path = _backup_path(call.option("backup") or "")
    _check_origin(controller, path, call.option("ignore") or "none")
    return {"check-restore": True}


@ROUTES.answer(table.BACKUP_INFO)
def _get_backup_info(controller: Irc5, call: RwsCall) -> Page:
    asked = call.option("backup-path") or ""
    fields = {"system-name": check_backup(controller, _backup_path(asked))}
    return page_at("ctrl", "/ctrl/backup/", f"info?backup-path={asked}", RwsState("ctrl-backup-info", "info", fields))


@ROUTES.answer(table.COMPRESSION)
def _get_compress(controller: Irc5, call: RwsCall) -> Page:
    return page_at("ctrl", _BASE, "compress", page_entry("ctrl-compress-li", "compress"))


@ROUTES.answer(table.COMPRESS)
def _compress(controller: Irc5, call: RwsCall) -> HttpReply:
    """Pack a file or directory; the archive has the format of our own, since ABB's is not known."""
    source, target = path_of_file(call.required("srcpath")), path_of_file(call.required("dstpath"))
    files = controller.files
    found = files.get_file(source)
    if found.content is None and source.upper() == "HOME:":
        raise bad_call("HOME itself is not compressed")

    def work() -> None:
        packed = bytes_io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for each in tuple(files):
                if f"{each.lower()}/".startswith(f"{source.lower()}/"):
                    archive.writestr(each[len(source.rpartition("/")[0]) + 1 :], files.get_file(each).content or b"")
        files.write(f"{target}/{found.name}.rzo" if _is_directory(controller, target) else target, packed.getvalue())

    return _begin(controller, work)


@ROUTES.answer(table.DECOMPRESS)
def _decompress(controller: Irc5, call: RwsCall) -> HttpReply:
    source, target = path_of_file(call.required("srcpath")), path_of_file(call.required("dstpath"))
    content = controller.files.get_file(source).content
    if content is None or not zipfile.is_zipfile(bytes_io.BytesIO(content)):
        raise bad_call(f"{source} is not a compressed file")

    def work() -> None:
        with zipfile.ZipFile(bytes_io.BytesIO(content)) as archive:
            for name in archive.namelist():
                controller.files.write(f"{target}/{name}", archive.read(name))

    return _begin(controller, work)


def _is_directory(controller: Irc5, path: str) -> bool:
    try:
        return controller.files.get_file(path).content is None
    except Refused:
        return False


@ROUTES.answer(table.DIAGNOSTICS)
def _get_diagnostics(controller: Irc5, call: RwsCall) -> Page:
    return page_at("ctrl", _BASE, "diagnostics", page_entry("ctrl-diagnostics-li", "diagnostics"))


@ROUTES.answer(table.SAVE_DIAGNOSTICS)
def _save_diagnostics(controller: Irc5, call: RwsCall) -> HttpReply:
    target = path_of_file(call.required("dstpath"))

    def work() -> None:
        identity = controller.identity
        lines = [f"{identity.system_name} {identity.robotware}", f"mode {controller.mode.value}"]
        lines += [f"motors {controller.controller_state.value}"]
        lines += [f"{task.name} {task.execution.value}" for task in controller.tasks.values()]
        lines += [
            f"{event.number} {event.code} {event.title} {event.description}" for event in controller.events.entries()
        ]
        controller.files[target] = "\n".join(lines) + "\n"

    return _begin(controller, work)


# Systems, options, safety


@ROUTES.answer(table.SYSTEMS)
def _get_systems(controller: Irc5, call: RwsCall) -> Page:
    name = controller.identity.system_name
    return page_at("ctrl", _BASE, "system", page_entry("ctrl-system-li", name, f"system/{name}"))


@ROUTES.answer(table.SYSTEM)
def _get_one_system(controller: Irc5, call: RwsCall) -> table.InstalledSystem:
    _check_system(controller, call)
    own = controller.identity
    return table.InstalledSystem(own.system_name, own.system_id, own.robotware)


def _check_system(controller: Irc5, call: RwsCall) -> None:
    if call.names["system"] != controller.identity.system_name:
        raise CallFailure(404, RwsCode.FAIL, f"there is no system {call.names['system'][:50]!r}")


@ROUTES.answer(table.RENAME_SYSTEM)
def _rename_system(controller: Irc5, call: RwsCall) -> None:
    _check_system(controller, call)
    controller.identity = replace(controller.identity, system_name=call.required("newname"))


@ROUTES.answer(table.ACTIVATE_SYSTEM)
def _activate_system(controller: Irc5, call: RwsCall) -> None:
    _check_system(controller, call)
    raise CallFailure(409, RwsCode.INVALID_STATE, "the system is active already")


@ROUTES.answer(table.DELETE_SYSTEM)
def _delete_system(controller: Irc5, call: RwsCall) -> None:
    _check_system(controller, call)
    raise bad_call("the active system cannot be deleted")


@ROUTES.answer(table.CONTROLLER_OPTIONS)
def _get_options(controller: Irc5, call: RwsCall) -> None:
    """Whether there are options: which, is asked one by one."""


@ROUTES.answer(table.CONTROLLER_OPTION)
def _get_option(controller: Irc5, call: RwsCall) -> Page | HttpReply:
    """An option that is installed; no content (204) says that it is not."""
    name = call.names["option"]
    if name not in controller.identity.options:
        return HttpReply(204)
    return page_at("ctrl", "/ctrl/options/", name, RwsState("ctrl-option", name, {"option": name}))


@ROUTES.answer(table.COMPATIBLE, table.COMPATIBILITY)
def _get_compatible(controller: Irc5, call: RwsCall) -> Page:
    """Whether a version of RobotWare runs on this controller: an IRC5 runs RobotWare 5 and 6."""
    version = call.names.get("version", controller.identity.robotware)
    major = version.partition(".")[0]
    if not major.isdecimal():
        raise bad_call(f"{version[:50]!r} is not a version of RobotWare")
    compatible = "TRUE" if major in ("5", "6") else "FALSE"
    state = RwsState("ctrl-compatibility", version, {"compatible": compatible})
    return page_at("ctrl", "/ctrl/compatibility/", version, state)


@ROUTES.answer(table.SAFETY)
def _get_safety(controller: Irc5, call: RwsCall) -> Page:
    """A robot without a safety controller has the resource and nothing in it."""
    return page_at("ctrl", _BASE, "safety")


ROUTES += absent_routes(table.ABSENT_FROM_CONTROLLER)
