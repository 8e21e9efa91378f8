"""One request for each operation of the virtual controller's Robot Web Services, and a client that sends it."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from math import degrees

from abb_protocols.robot.inverse_kinematics import arm_angle
from abb_protocols.robot.kinematics import tool0_to_body
from abb_protocols.rws.documents import FORM_TYPE, decode_form
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.values import GRANTS, Grant, OperatingMode
from digest_client import authorization
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World

USER, PASSWORD = "Default User", "robotics"
TASK = "/rw/rapid/tasks/T_ROB_L"
UNIT = "/rw/motionsystem/mechunits/ROB_L"
SIGNALS = "/rw/iosystem/signals"
MODULE = "/rw/rapid/modules/TRobMain"
DATUM = "RAPID/T_ROB_L/TRobMain/current_state"
PERSISTENT = "RAPID/T_ROB_L/TRobEGM/egm_presync_tasks"
_JOINTS = "rob_joints=[0,-2.2,0.5,0,0.7,0]&ext_joints=[2.3,0,0,0,0,0]"
_TOOL = "tool_frame_position=[0,0,0]&tool_frame_orientation=[1,0,0,0]&robot_fixed_object=FALSE"
_OLD = "old_rob_joints=[0,-2.26893,0.523599,0,0.698132,0]&old_ext_joints=[2.35619,0,0,0,0,0]"
_AXES = "axis1=100&axis2=0&axis3=0&axis4=0&axis5=0&axis6=0"
_RANGE = "task=T_ROB_L&replace-mode=After&query-mode=Force&startrow=1&startcol=1&endrow=1&endcol=-1"
SMALL = "/rw/rapid/modules/Small"
_SMALL = "MODULE Small\n  PROC small()\n  ENDPROC\nENDMODULE\n"
_QUESTION = """MODULE Asks
    PROC main()
        VAR num answer;
        TPReadNum answer, "How many?";
    ENDPROC
ENDMODULE
"""
_SIO = """SIO:CFG_1.0:6:1::
#
COM_TRP:

      -Name "NEW" -Type "UDPUC" -RemoteAdress "10.0.0.1" -RemotePortNumber 6515
"""


class Session:
    """A client that is logged in to a virtual controller, without sockets."""

    version: type[RwsService] = RwsService
    form_type = FORM_TYPE
    request_of_mastership = "/rw/mastership?action=request"

    def __init__(self, world: World | None = None) -> None:
        self.world = world or World()
        self.controller = self.world.controller
        self.service = self.version(self.controller, user=USER, password=PASSWORD)
        self.now = 0.0
        self.cookie = self._log_in()

    def _log_in(self) -> tuple[str, str]:
        challenge = self._handled(HttpRequest("GET", "/rw")).header("WWW-Authenticate") or ""
        proof = authorization(challenge, user=USER, password=PASSWORD, method="GET", uri="/rw")
        reply = self._handled(HttpRequest("GET", "/rw", (("Authorization", proof),)))
        return "Cookie", "; ".join(text.partition(";")[0] for name, text in reply.headers if name == "Set-Cookie")

    def _handled(self, request: HttpRequest) -> HttpReply:
        reply = self.service.handle(request, self.now)
        return reply if isinstance(reply, HttpReply) else HttpReply(101)

    def ask(self, method: str, target: str, form: str = "") -> HttpReply:
        """Send a request."""
        headers = (self.cookie, ("Host", "memory"), ("Content-Type", FORM_TYPE))
        return self._handled(HttpRequest(method, target, headers, form.encode(), "client"))

    def show(self, method: str, target: str, body: str, form: str) -> HttpReply:
        """Send a request for a representation: ``json``, or "" for XHTML."""
        mark = "&" if "?" in target else "?"
        return self.ask(method, f"{target}{mark}json=1" if form == "json" else target, body)

    def prepare(self, name: str) -> None:
        """Do what an example needs before."""
        SETUPS[name](self)

    def reset(self) -> None:
        """As at the start: nothing running, held, subscribed or asked for."""
        controller = self.controller
        controller._restart_left = 0.0  # that of an example before does not go on
        controller.stop_rapid()
        for _ in range(3):
            self.world.cycle({})
        controller.select_mode(OperatingMode.AUTO)
        if controller.controller_state.value == "motoron":
            controller.set_motors(False)
        self.service.expire_sessions()
        self.cookie = self._log_in()

    def pass_time(self, duration: float) -> None:
        """Let time pass for the server and the controller's jobs."""
        self.now += duration
        self.service.advance(self.now)
        self.controller.jobs.advance(duration)


def _run(session: Session) -> None:
    session.controller.set_motors(True)
    session.controller.move_pp_to_main()
    session.controller.start_rapid()


def _question(session: Session) -> None:
    controller = session.controller
    controller.files["HOME:/asks.mod"] = _QUESTION
    controller.replace_program({"HOME:/asks.mod": _QUESTION})
    controller.set_motors(True)
    controller.start_rapid()
    session.world.cycle({})


def _restore_program(session: Session) -> None:
    session.controller.replace_program({})


def _backup(session: Session) -> None:
    if "BACKUP:/monday/BACKINFO/backinfo.txt" not in session.controller.files:
        session.ask("POST", "/ctrl/backup?action=backup", "backup=/fileservice/$BACKUP/monday")
        session.pass_time(3.0)


def _program_file(session: Session) -> None:
    files = session.controller.files
    files["HOME:/small.mod"] = _SMALL
    files["HOME:/small.pgf"] = "<?xml version='1.0'?><Program><Module>small.mod</Module></Program>"


def _small(session: Session) -> None:
    session.controller.files["HOME:/small.mod"] = _SMALL
    task = session.controller.tasks["T_ROB_L"]
    if "Small" not in [module.name for module in task.modules]:
        task.load(_SMALL, "small.mod")


def _no_small(session: Session) -> None:
    session.controller.files["HOME:/small.mod"] = _SMALL
    task = session.controller.tasks["T_ROB_L"]
    if "Small" in [module.name for module in task.modules]:
        task.unload("Small")


def _new_cfg(session: Session) -> None:
    session.controller.files["HOME:/new.cfg"] = _SIO
    if session.controller.configuration.find("SIO", "COM_TRP", "NEW") is not None:
        session.controller.configuration.remove("SIO", "COM_TRP", "NEW")


def _with_new_cfg(session: Session) -> None:
    _new_cfg(session)
    session.controller.configuration.load(_SIO)


def _files(session: Session) -> None:
    for name in [name for name in session.controller.files if name.startswith("HOME:/x")]:
        session.controller.files.remove(name)
    session.controller.files["HOME:/x.txt"] = "text"


def _no_backup(session: Session) -> None:
    if "BACKUP:/b/BACKINFO/backinfo.txt" in session.controller.files:
        session.controller.files.remove("BACKUP:/b")
    session.controller.jobs = type(session.controller.jobs)()
    session.controller.own_settings.backup_state = "Ready"


def _rezo(session: Session) -> None:
    session.controller.files["HOME:/x.txt"] = "text"
    session.ask("POST", "/ctrl/compress?action=comp", "srcpath=$HOME/x.txt&dstpath=$TEMP/x.rzo")
    session.pass_time(3.0)


def _job(session: Session) -> None:
    session.controller.jobs = type(session.controller.jobs)()
    session.ask("POST", "/rw/elog?action=saveraw", "path=$TEMP/log.txt")


def _locked(session: Session) -> None:
    session.controller.own_settings.mode_lock, session.controller.own_settings.pin = "locked", "1234"


def _unlocked(session: Session) -> None:
    session.controller.own_settings.mode_lock = "unlocked"


def _system(session: Session) -> None:
    session.ask("POST", f"/ctrl/system/{session.controller.identity.system_name}?action=rename", "newname=YuMi")


def _one_event(session: Session) -> None:
    session.controller.events.clear()
    session.controller.events.append(10010, "Motors OFF")


SETUPS: Mapping[str, Callable[[Session], None]] = {
    "motors": lambda session: session.controller.set_motors(True),
    "running": _run,
    "program": _restore_program,
    "question": _question,
    "backup": _backup,
    "pgf": _program_file,
    "small": _small,
    "no small": _no_small,
    "cfg": _new_cfg,
    "new cfg": _with_new_cfg,
    "files": _files,
    "no backup": _no_backup,
    "packed": _rezo,
    "job": _job,
    "left": lambda session: session.ask("POST", "/rw/motionsystem?action=set-mechunit", "mechunit-name=ROB_L") and None,
    "locked": _locked,
    "unlocked": _unlocked,
    "system": _system,
    "event": _one_event,
    "route": lambda session: session.controller.own_settings.routes.update({"10.0.0.0/8": "192.168.125.2"}),
    "queue": lambda session: (
        session.ask("POST", "/rw/dipc?action=dipc-create", "dipc-queue-name=q&dipc-queue-size=5&dipc-max-msg-size=444")
        and None
    ),
    "group": lambda session: (
        session.ask(
            "POST", "/subscription", "resources=1&1=/rw/panel/opmode&1-p=0&resources=2&2=/rw/panel/ctrlstate&2-p=0"
        )
        and None
    ),
    "local": lambda session: (
        session.ask("POST", "/users", "username=a&application=b&location=c&ulocale=local") and None
    ),
    "rmmp": lambda session: session.ask("POST", "/users/rmmp", "privilege=modify") and None,
    **{
        f"hold {domain}": lambda session, domain=domain: session.ask(  # type: ignore[misc]
            "POST", f"/rw/mastership/{domain}?action=request"
        )
        for domain in ("cfg", "motion", "rapid")
    },
}


def _made(session: Session) -> dict[str, str]:
    """What stands for the placeholders of a request."""
    service, controller = session.service, session.controller
    dialog = controller.devices.pendant.active
    unit = next(unit for unit in controller.units if unit.name == "ROB_L")
    position = controller.arm_of(unit).position
    pose = tool0_to_body(unit.side, position)
    x, y, z = (f"{value:.9f}" for value in pose.position)
    q = [f"{value:.9f}" for value in pose.orientation]
    angle = arm_angle(unit.side, position)
    mm = [f"{1e3 * value:.6f}" for value in pose.position]
    target = [f"pos-{axis}={value}" for axis, value in zip("xyz", mm, strict=True)]
    target += [f"orient-q{n}={value}" for n, value in enumerate(q, 1)]
    target += [f"config-{name}={4 if name == 'jx' else 0}" for name in ("j1", "j4", "j6", "jx")]
    target += [f"extjoint-{n}={degrees(angle) if n == 1 else 9e9:.9f}" for n in range(1, 7)]
    text = controller.tasks["T_ROB_L"].program.modules.get("trobegm")
    lines = text.syntax.text.splitlines() if text else []
    row = next((n for n, line in enumerate(lines, 1) if "PERS tooldata egm_tool" in line), 1)
    return {
        "uid": str(service._users.of(next(iter(service._sessions.alive(session.now)))).uid),
        "group": str(max(service._subscriptions._groups, default=0)),
        "job": "1",
        "row": str(row),
        "col": str(lines[row - 1].find("egm_tool") + 2) if lines else "1",
        "ccount": str(controller.motion.changes),
        "target": "&".join(target),
        "pose": f"curr_position=[{x},{y},{z}]&curr_orientation=[{','.join(q)}]"
        f"&curr_ext_joints=[{angle:.9f},0,0,0,0,0]&robot_configuration=[0,0,0,4]",
        "event": str(controller.events.entries()[0].number) if controller.events.entries() else "0",
        "dialog": f"RAPID/{dialog.task}/%${dialog.number}" if dialog else "",
    }


@dataclass(frozen=True, slots=True)
class Example:
    """A request that its operation answers with success.

    Attributes:
        target: path and query; ``{uid}``, ``{group}`` and ``{job}`` stand for what a setup has made.
        form: the body.
        before: names of setups.
    """

    method: str
    target: str
    form: str = ""
    before: tuple[str, ...] = ()

    def send(self, session: Session, form: str = "", granted: Collection[Grant] = GRANTS) -> HttpReply:
        """Send it after its setups; ``form`` is ``json`` for JSON, and ``granted`` what the user may do by then."""
        session.reset()
        for name in self.before:
            session.prepare(name)
        target, body = self.target, self.form
        for name, value in _made(session).items():
            target, body = target.replace(f"{{{name}}}", value), body.replace(f"{{{name}}}", value)
        session.service._users.granted = granted
        try:
            return session.show(self.method, target, body, form)
        finally:
            session.service._users.granted = GRANTS


def example(line: str) -> Example:
    """``METHOD target form | setup, setup``."""
    request, _, before = line.partition(" | ")
    method, target, *form = request.split(" ", 2)
    names = tuple(name.strip() for name in before.split(",") if name.strip())
    return Example(method, target, form[0] if form else "", names)


def operation_of(session: Session, example: Example) -> Operation:
    path, _, query = re.sub("{[a-z]+}", "1", example.target).partition("?")
    segments = tuple(part.partition(";")[0] for part in path.split("/") if part)
    return session.service._router.find(example.method, segments, decode_form(query))[0].operation


def content_type(reply: HttpReply) -> str:
    return reply.header("Content-Type") or ""


EXAMPLES = tuple(
    map(
        example,
        f"""
GET /
GET /rw
GET /rw/system
GET /rw/system/options
GET /rw/system/robottype
GET /rw/system/license
GET /rw/system/products
GET /rw/system/energy
GET /rw/system/energy?resource=change-count
POST /rw/system/energy?action=reset
GET /rw/retcode
GET /rw/devices
GET /rw/devices/HW_DEVICES/CONTROLLER
GET /rw/vision
GET /rw/vision/camera1
POST /rw/vision?action=restart name=camera1
POST /rw/vision?action=flash-led name=camera1
POST /rw/vision?action=set-state name=camera1&state=run
POST /rw/vision?action=refresh
POST /rw/vision?action=set-hostname name=camera1&host=x
POST /rw/vision?action=set-dhcp name=camera1
POST /rw/vision?action=set-dns-settings name=camera1
POST /rw/vision?action=set-cameraname index=0&name=x
POST /rw/vision?action=set-user-credential index=0
POST /rw/vision?action=set-ip-settings name=camera1
POST /rw/vision/camera1?action=trigger
GET /ctrl
POST /ctrl restart-mode=restart
POST /ctrl?action=set-lang lang=de
GET /ctrl/$RAMDISK
GET /ctrl/identity
PUT /ctrl/identity ctrl-name=14000-500000
GET /ctrl/clock
PUT /ctrl/clock sys-clock-year=2026&sys-clock-month=7&sys-clock-day=9&sys-clock-hour=1&sys-clock-min=2&sys-clock-sec=3
GET /ctrl/clock/timezone
POST /ctrl/clock/timezone timezone=UTC
POST /ctrl/clock/timezone?action=set-timezone timezone=UTC
GET /ctrl/clock/timeserver
GET /ctrl/clock/timeserver?resource=servertime&server-ip=10.0.0.1
POST /ctrl/clock/timeserver?action=set-timeserver timeserver=10.0.0.1
GET /ctrl/network
POST /ctrl/network?action=set method=fixip&address=10.0.0.2&mask=255.0.0.0&gateway=10.0.0.1
GET /ctrl/network/dns
GET /ctrl/network/routes
POST /ctrl/network/route/add destination=10.1.0.0/16&gateway=10.0.0.1
OPTIONS /ctrl/network/route/add
POST /ctrl/network/route/remove destination=10.0.0.0/8 | route
OPTIONS /ctrl/network/route/remove
GET /ctrl/backup
GET /ctrl/backup?action=backupstate
GET /ctrl/backup?action=check-restore&backup=$BACKUP/monday | backup
POST /ctrl/backup?action=backup backup=/fileservice/$BACKUP/b | no backup
POST /ctrl/backup?action=restore backup=/fileservice/$BACKUP/monday | backup
GET /ctrl/backup/info/?backup-path=/fileservice/$BACKUP/monday | backup
GET /progress
GET /progress/{{job}} | job
GET /ctrl/compress
POST /ctrl/compress?action=comp srcpath=/fileservice/$HOME/yumi&dstpath=/fileservice/$TEMP
POST /ctrl/compress?action=dcomp srcpath=$TEMP/x.rzo&dstpath=$TEMP | packed
GET /ctrl/diagnostics
POST /ctrl/diagnostics?action=save dstpath=/fileservice/$TEMP/diagnostics.log
GET /ctrl/system
GET /ctrl/system/YuMi
POST /ctrl/system/YuMi?action=rename newname=YuMi
POST /ctrl/system/YuMi?action=activate
DELETE /ctrl/system/YuMi
GET /ctrl/options
GET /ctrl/options/Leadthrough
GET /ctrl/compatible
GET /ctrl/compatibility/6.09.0101
GET /ctrl/safety
GET /ctrl/safety/zones
POST /ctrl/safety/cyclic-brake-check
GET /ctrl/safety?resource=config-status
GET /ctrl/safety?resource=safety-mode
GET /ctrl/safety?resource=cbc-status&drivenum=1
GET /ctrl/safety?resource=loadoperation-status
GET /ctrl/safety?resource=safety-config
GET /ctrl/safety?resource=violation-info
POST /ctrl/safety?action=load filepath=$HOME/x.xml
POST /ctrl/safety?action=set-mode mode=service
POST /ctrl/safety?action=unlock
POST /ctrl/safety?action=syncack index=0
POST /ctrl/safety?action=validate-cfg validated-by=a
POST /ctrl/safety?action=invalidate-cfg
POST /ctrl/safety?action=reset
GET /ctrl/virtualtime
GET /ctrl/virtualtime/vttime
GET /ctrl/virtualtime/vtstate
GET /ctrl/virtualtime/vtspeed
GET /ctrl/virtualtime/vttimeslice
POST /ctrl/virtualtime/vtstate vtstate=VTFREERUN
POST /ctrl/virtualtime/vtspeed vtspeed=100
POST /ctrl/virtualtime/vttimeslice vttimeslice=20
POST /ctrl/virtualtime/vtrun
GET /rw/panel
POST /rw/panel?action=restart restart-mode=restart
POST /rw/panel?action=setlang lang-code=en
GET /rw/panel/ctrlstate
GET /rw/panel/opmode
GET /rw/panel/speedratio
GET /rw/panel/coldetstate
POST /rw/panel/ctrlstate?action=setctrlstate ctrl-state=motoron
POST /rw/panel/opmode opmode=man
POST /rw/panel/opmode?action=acknowledge opmode=coldet
GET /rw/panel/opmode?resource=lock-state
POST /rw/panel/opmode?action=lock pin=1234&permanent=0 | unlocked
POST /rw/panel/opmode?action=unlock pin=1234 | locked
POST /rw/panel/speedratio?action=setspeedratio speed-ratio=100
GET /rw/rapid
GET /rw/rapid/execution
POST /rw/rapid/execution?action=start regain=continue&execmode=continue&cycle=once&condition=none | program, motors
POST /rw/rapid/execution?action=stop stopmode=stop&usetsp=normal | running
POST /rw/rapid/execution?action=startprodentry | motors
POST /rw/rapid/execution?action=resetpp
POST /rw/rapid/execution?action=setcycle cycle=forever | hold rapid
POST /rw/rapid/execution?action=holdtorun-state state=press
GET /rw/rapid/tasks
GET /rw/rapid/tasks?resource=spy-status
GET /rw/rapid/tasks?resource=sync-state&type=program-pointer
POST /rw/rapid/tasks?action=deactivate
POST /rw/rapid/tasks?action=activate
POST /rw/rapid/tasks?action=start-spy log-file=log.txt
POST /rw/rapid/tasks?action=stop-spy
GET {TASK}
GET {TASK}?resource=activation-record&stackframe=1 | program
GET {TASK}?resource=task-struc-change-count
GET {TASK}?resource=pref-data-types&instruction=MoveAbsJ&parameter=Speed
GET {TASK}?resource=task-sync-state&type=motion-pointer
POST {TASK}?action=activate
POST {TASK}?action=deactivate
POST /rw/rapid/tasks?action=activate
POST {TASK}?action=loadmod modulepath=$HOME/small.mod&replace=true | hold rapid, no small
POST {TASK}?action=unloadmod module=Small | small, hold rapid
POST {TASK}?action=abortexeclevel | program, hold rapid
POST {TASK}?action=build | program, hold rapid
POST {TASK}?action=holdtorun state=press
GET {TASK}/structural-changecount
GET {TASK}/activation-record?stackframe=1 | program
GET {TASK}/serviceroutine?start=1&limit=2
GET {TASK}/execution
GET {TASK}/motion
GET {TASK}/motion?resource=robtarget&tool=tool0&wobj=wobj0
GET {TASK}/motion?resource=jointtarget
GET {TASK}/motion?resource=mechunit
GET {TASK}/motion?resource=extjointstate
GET {TASK}/program
POST {TASK}/program?action=loadprog progpath=$HOME/small.pgf&loadmode=add | no small, pgf, hold rapid
POST {TASK}/program?action=unloadprog | hold rapid
POST {TASK}/program?action=save path=$HOME/saved | program
POST {TASK}/program?action=setname name=program
POST {TASK}/program?action=set-entrypoint routine=main | program, hold rapid
GET {TASK}/program/builderror
GET {TASK}/program/breakpoint
POST {TASK}/program/breakpoint?action=set module=TRobMain&row=20&column=1 | program, hold rapid
GET {TASK}/breakpoints
GET {TASK}/pcp
POST {TASK}/pcp?action=set-pp-cursor module=Small&routine=small&line=2&column=1 | program, small, hold rapid
POST {TASK}/pcp?action=set-pp-routine module=Small&routine=small&userlevel=true | small, hold rapid
POST {TASK}/pcp?action=set-pp-routine-from-url module=Small&routine=RAPID/T_ROB_L/Small/small | small, hold rapid
POST {TASK}/pcp?action=set-pp-prev-inst
POST {TASK}/pcp?action=set-pp-next-inst
GET /rw/rapid/taskselection
GET /rw/rapid/aliasio
GET /virtual/display
GET /rw/rapid/uiinstr
GET /rw/rapid/uiinstr/active | question
GET /rw/rapid/uiinstr/active/params/{{dialog}} | question
GET /rw/rapid/uiinstr/active/param/{{dialog}}/Result | question
POST /rw/rapid/uiinstr/active/param/{{dialog}}/Result?action=set value=3 | question
GET /rw/rapid/modules?task=T_ROB_L | program
GET /rw/rapid/modules?resource=mod-possible-all
POST /rw/rapid/modules?action=modify-all-position checklimit=true&checkdeactaxes=true
GET {MODULE}?task=T_ROB_L
GET {MODULE}?task=T_ROB_L&startrow=1&startcol=1&endrow=2&endcol=-1
GET {MODULE}?task=T_ROB_L&startrow=1&startcol=1&text=main
GET {MODULE}?task=T_ROB_L&startrow=30&startcol=1&destination=Inner
GET {MODULE}?resource=module-text&task=T_ROB_L
GET {MODULE}?resource=change-count&task=T_ROB_L
GET {MODULE}?resource=module-extension&task=T_ROB_L
GET {MODULE}?resource=syncper-status&task=T_ROB_L
GET /rw/rapid/modules/TRobEGM?resource=module-symbol&task=T_ROB_L&row={{row}}&col={{col}}
GET {MODULE}?resource=mod-possible&task=T_ROB_L&startrow=1&startcol=1&endrow=1&endcol=1
POST {MODULE}?task=T_ROB_L&action=save name=Saved&path=$HOME
POST {SMALL}?action=set-text-range {_RANGE}&text=%0A | small, hold rapid
POST /rw/rapid/modules/Small?task=T_ROB_L&action=set-module-text text=MODULE Small%0AENDMODULE | small, hold rapid
POST {MODULE}?action=modify-position&task=T_ROB_L startrow=1&startcol=1&endrow=1&endcol=1
GET {MODULE}/routine?task=T_ROB_L&row=100&column=1
GET /rw/rapid/modules/T_ROB_L/TRobMain/routines
GET /rw/rapid/symbols
POST /rw/rapid/symbols?action=search-symbols view=block&vartyp=any&blockurl=RAPID/T_ROB_L&symtyp=per&recursive=true
GET /rw/rapid/symbol/data/{DATUM}
POST /rw/rapid/symbol/data/{DATUM}?action=set value=0
POST /rw/rapid/symbol/data/{PERSISTENT}?action=setInitValue value=[["T_ROB_L"],["T_ROB_R"]] | program
POST /rw/rapid/symbol/data?action=validate task=T_ROB_L&value=[[0,0,0],[1,0,0,0]]&datatype=pose
GET /rw/rapid/symbol/properties/{DATUM}
GET /rw/iosystem
GET /rw/iosystem/networks
POST /rw/iosystem/networks?action=search name=Local
GET /rw/iosystem/networks/DeviceNet
GET /rw/iosystem/networks/DeviceNet?resource=config&configtype=1
POST /rw/iosystem/networks/DeviceNet?action=set lstate=start
POST /rw/iosystem/networks/DeviceNet?action=config config-type=BITS
GET /rw/iosystem/devices
POST /rw/iosystem/devices?action=search lstate=enabled
GET /rw/iosystem/devices/DeviceNet/D652_10/upgradeinfo
GET /rw/iosystem/devices/PROFINET/PN/implicitdata
POST /rw/iosystem/devices/PROFINET/PN/implicitdata slot=1
OPTIONS /rw/iosystem/devices/PROFINET/PN/implicitdata
GET /rw/iosystem/devices/PROFINET/PN/explicitdata
POST /rw/iosystem/devices/PROFINET/PN/explicitdata slot=1
OPTIONS /rw/iosystem/devices/PROFINET/PN/explicitdata
POST /rw/iosystem/devices/PROFINET/PN/alarms/clear
OPTIONS /rw/iosystem/devices/PROFINET/PN/alarms/clear
GET /rw/iosystem/devices/PROFINET/PN/alarms
GET /rw/iosystem/devices/DeviceNet/D652_10
GET /rw/iosystem/devices/DeviceNet/D652_10?resource=config
POST /rw/iosystem/devices/D652_10?action=set lstate=enable
POST /rw/iosystem/devices/D652_10?action=set-inputdata startbyte=0&signaldata=1&datamask=255
POST /rw/iosystem/devices/D652_10?action=set-outputdata startbyte=0&signaldata=1&datamask=255
GET {SIGNALS}
POST {SIGNALS}?action=signal-search name=hand&type=GO
POST {SIGNALS}?action=signal-searchex name=hand&type=GO&name2=R&invert2=true
POST {SIGNALS}?action=unblock-signal
GET {SIGNALS}/DeviceNet/D652_10/custom_DO_0
GET {SIGNALS}/custom_DO_0?resource=config&configtype=1
POST {SIGNALS}/custom_DO_0?action=set lvalue=1
GET /rw/motionsystem
POST /rw/motionsystem?action=set-mechunit mechunit-name=ROB_R
POST /rw/motionsystem?action=jog {_AXES}&ccount={{ccount}}&inc-mode=Small | motors, hold motion
POST /rw/motionsystem?action=positiontarget {{target}} | motors, hold motion, left
POST /rw/motionsystem?action=set-target {{target}} | motors, hold motion, left
GET /rw/motionsystem/checkchangecount?changecount=0
GET /rw/motionsystem/errorstate
GET /rw/motionsystem/motionsupervision?mechunit=ROB_L
GET /rw/motionsystem/motionsupervision?action=collision-prediction-mode
POST /rw/motionsystem/motionsupervision?action=set-mode mechunit-name=ROB_L&mode=True
POST /rw/motionsystem/motionsupervision?action=set-level mechunit-name=ROB_L&sensitivity=100
POST /rw/motionsystem/motionsupervision?action=set-colpred-mode mode=true
GET /rw/motionsystem/pathsupervision?mechunit=ROB_L
POST /rw/motionsystem/pathsupervision?action=set-mode mechunit=ROB_L&mode=ON
POST /rw/motionsystem/pathsupervision?action=set-level mechunit=ROB_L&level=100
GET /rw/motionsystem/nonmotionexecution
POST /rw/motionsystem/nonmotionexecution?action=set-mode mode=OFF
POST /rw/motionsystem/nonmotionexecution?action=set mode=OFF
GET /rw/motionsystem/mechunits
GET {UNIT}
GET {UNIT}?resource=lead-through
POST {UNIT}?action=set tool=tool0&coord-system=Base
POST {UNIT}?action=set-lead-through status=inactive
POST {UNIT}?action=fine-calibrate axis=1
POST {UNIT}?action=update-revcounter axis=1
POST {UNIT}?action=mechunit-position rob_joint=[0,0,0,0,0,0]&ext_joint=[0,0,0,0,0,0]
POST {UNIT}?action=CalcPoseFromJoints {_JOINTS}&{_TOOL}&elog_at_error=FALSE
POST {UNIT}?action=CalcRobTFromJoints {_JOINTS}&{_TOOL}&elog_at_error=FALSE
POST {UNIT}?action=CalcJointsFromPose {{pose}}&{_TOOL}&{_OLD}&elog_at_error=FALSE
POST {UNIT}?action=JointsFromCartesian {{pose}}&{_TOOL}&{_OLD}&elog_at_error=FALSE
POST {UNIT}?action=AllJointSolutions {{pose}}&{_TOOL}
GET {UNIT}/pjoints
GET {UNIT}/cartesian?tool=tool0&wobj=wobj0&coordinate=Base
GET {UNIT}/robtarget?tool=tool0&wobj=wobj0&coordinate=Base
GET {UNIT}/jointtarget
GET {UNIT}/calibrationinfo
GET {UNIT}/baseframe
POST {UNIT}/baseframe?action=set x=0&y=0&z=0&q1=1&q2=0&q3=0&q4=0
GET {UNIT}/axes
GET {UNIT}/axes/1
GET {UNIT}/axes/1?resource=axis-pose
POST {UNIT}/axes/1?action=set-axispose x=0&y=0&z=0&q1=1&q2=0&q3=0&q4=0
POST {UNIT}/axes/1?action=update-commutate
POST {UNIT}/axes/1?action=update-syncrevcounter syncType=1
GET {UNIT}/smbdata
POST {UNIT}/smbdata?action=set type=robot-to-controller
POST {UNIT}/smbdata?action=clear type=robot
GET {UNIT}/motorcalib
GET /rw/cfg
POST /rw/cfg?action=load filepath=/fileservice/$HOME/new.cfg&action-type=add | cfg, hold cfg
POST /rw/cfg?action=validate filepath=$HOME/new.cfg&action-type=replace | cfg
POST /rw/cfg?action=validate-inst-at-del name=UCdevice
POST /rw/cfg?action=validate-instances cfgdomain=SIO&cfgtype=COM_TRP&instances=UCdevice&instancescount=1&operation=1
POST /rw/cfg?action=keyless state=run
GET /rw/cfg/eio
POST /rw/cfg/sio?action=saveas filepath=/fileservice/$HOME/saved.cfg
POST /rw/cfg/proc?action=reset | hold cfg
GET /rw/cfg/SIO/COM_TRP
GET /rw/cfg/SIO/COM_TRP/attributes
GET /rw/cfg/SIO/COM_TRP/instances
POST /rw/cfg/SIO/COM_TRP/instances?action=create-default name=NEW | cfg, hold cfg
POST /rw/cfg/MOC/ARM/instances?action=reset | hold cfg
GET /rw/cfg/SIO/COM_TRP/instances/UCdevice
POST /rw/cfg/SIO/COM_TRP/instances/UCdevice?action=set RemotePortNumber=6510 | hold cfg
DELETE /rw/cfg/SIO/COM_TRP/instances/NEW | new cfg, hold cfg
GET /rw/elog?lang=en&resource=count
POST /rw/elog?action=clearall
POST /rw/elog?action=saveraw path=$TEMP/log.txt
GET /rw/elog/0?lang=en | event
POST /rw/elog/1?action=clear
GET /rw/elog/0/{{event}}?lang=en | event
GET /fileservice
GET /fileservice/$home | files
HEAD /fileservice/$home/x.txt | files
PUT /fileservice/$home/x.txt text | files
POST /fileservice/$home/x.txt fs-action=copy&fs-newname=x2.txt | files
DELETE /fileservice/$home/x.txt | files
GET /users
POST /users username=a&application=b&location=c&ulocale=remote
POST /users?action=impersonate uid={{uid}} | local
POST /users?action=set-locale type=remote | local
GET /users/grants
GET /users/rmmp
POST /users/rmmp privilege=modify
POST /users/rmmp?action=set uid={{uid}}&privilege=modify | local, rmmp
POST /users/rmmp?action=cancel | rmmp
GET /users/rmmp/poll | rmmp
POST /users/remoteuser?action=remotelogin
POST /users/remoteuser?action=remotelogout
GET /rw/mastership
POST /rw/mastership?action=request
POST /rw/mastership?action=release
GET /rw/mastership/rapid
POST /rw/mastership/rapid?action=request
POST /rw/mastership/rapid?action=release | hold rapid
GET /rw/dipc
POST /rw/dipc?action=dipc-create dipc-queue-name=r&dipc-queue-size=5&dipc-max-msg-size=444
GET /rw/dipc/q | queue
GET /rw/dipc/q/?action=dipc-read&timeout=0 | queue
POST /rw/dipc/q?action=dipc-send dipc-src-queue-name=q&dipc-cmd=1&dipc-userdef=1&dipc-msgtype=1&dipc-data=hello | queue
DELETE /rw/dipc/q | queue
POST /subscription resources=1&1=/rw/panel/opmode&1-p=1
GET /subscription/{{group}} | group
PUT /subscription/{{group}} resources=1&1=/rw/panel/opmode&1-p=0 | group
DELETE /subscription/{{group}} | group
DELETE /subscription/{{group}}/rw/panel/ctrlstate | group
GET /logout
""".strip().splitlines(),
    )
)
