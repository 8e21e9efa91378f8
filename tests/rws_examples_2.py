"""One request for each operation of Robot Web Services 2.0, and a client that sends it."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping

from rws_examples import _JOINTS, _OLD, _TOOL, DATUM, PASSWORD, SIGNALS, TASK, UNIT, USER, Session, example
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.version_2 import FORM_2, HAL_2, XHTML_2, RwsService2

MODULE = f"{TASK}/modules/TRobMain"
SYMBOL = f"/rw/rapid/symbol/{DATUM}"
BASIC = f"Basic {b64encode(f'{USER}:{PASSWORD}'.encode()).decode()}"
_RANGE = "replace-mode=After&query-mode=Force&startrow=1&startcol=1&endrow=1&endcol=-1"
_FILE = "text/plain;v=2.0"

# What an example needs before, where 2.0 does it by another request.
_SETUPS: Mapping[str, str] = {
    "hold cfg": "POST /rw/mastership/edit/request",
    "hold rapid": "POST /rw/mastership/edit/request",
    "hold motion": "POST /rw/mastership/motion/request",
    "packed": "POST /ctrl/compress srcpath=HOME/x.txt&dstpath=TEMP/x.rzo",
    "job": "POST /rw/elog/saveraw path=$TEMP/log.txt",
    "backup": "POST /ctrl/backup/create backup=/fileservice/BACKUP/monday",
    "queue": "POST /rw/dipc dipc-queue-name=q&dipc-queue-size=5&dipc-max-msg-size=444",
    "group": "POST /subscription resources=1&1=/rw/panel/opmode;opmode&1-p=0"
    "&resources=2&2=/rw/panel/ctrl-state;ctrlstate&2-p=0",
    "local": "POST /users/register username=a&application=b&location=c&ulocale=local",
    "rmmp": "POST /users/rmmp privilege=modify",
}


class Session2(Session):
    """A client of a virtual controller with RobotWare 7."""

    version = RwsService2
    form_type = FORM_2
    request_of_mastership = "/rw/mastership/request"

    def _log_in(self) -> tuple[str, str]:
        reply = self._handled(HttpRequest("GET", "/rw", (("Authorization", BASIC), ("Accept", XHTML_2))))
        return "Cookie", "; ".join(text.partition(";")[0] for name, text in reply.headers if name == "Set-Cookie")

    def ask(self, method: str, target: str, form: str = "", accept: str | None = XHTML_2, kind: str = "") -> HttpReply:
        """Send a request; ``kind`` is the type of its body, that of a form by default; None sends no ``Accept``."""
        is_file = method == "PUT" and target.startswith("/fileservice")
        body_type = kind or (_FILE if is_file else FORM_2)
        accepted = () if accept is None else (("Accept", accept),)
        headers = (self.cookie, ("Host", "memory"), *accepted, ("Content-Type", body_type))
        return self._handled(HttpRequest(method, target, headers, form.encode(), "client"))

    def show(self, method: str, target: str, body: str, form: str) -> HttpReply:
        return self.ask(method, target, body, HAL_2 if form == "json" else XHTML_2)

    def prepare(self, name: str) -> None:
        if name not in _SETUPS:
            super().prepare(name)
        elif name != "backup" or "BACKUP:/monday/BACKINFO/backinfo.txt" not in self.controller.files:
            if name == "packed":
                self.controller.files["HOME:/x.txt"] = "text"
            if name == "job":
                self.controller.jobs = type(self.controller.jobs)()
            method, target, *form = _SETUPS[name].split(" ", 2)
            reply = self.ask(method, target, *form)
            assert reply.status < 300, (name, reply.body)
            self.pass_time(3.0 if name in ("packed", "backup") else 0.0)


EXAMPLES_2 = tuple(
    map(
        example,
        f"""
GET /
GET /progress
GET /progress/{{job}} | job
GET /rw
GET /rw/retcode
GET /rw/system
GET /rw/system/energy
GET /rw/system/license
GET /rw/system/options
GET /rw/system/products
GET /rw/system/robottype
POST /rw/system/energy/reset
GET /ctrl/backup
GET /ctrl/backup/state
POST /ctrl/backup/check-restore backup=/fileservice/BACKUP/monday | backup
POST /ctrl/backup/create backup=/fileservice/BACKUP/b | no backup
POST /ctrl/backup/restore backup=/fileservice/BACKUP/monday | backup
GET /ctrl/clock
PUT /ctrl/clock sys-clock-year=2026&sys-clock-month=7&sys-clock-day=9&sys-clock-hour=1&sys-clock-min=2&sys-clock-sec=3
GET /ctrl/compatibility/7.13.0
POST /ctrl/compress srcpath=HOME/yumi&dstpath=TEMP
POST /ctrl/decompress srcpath=TEMP/x.rzo&dstpath=TEMP | packed
GET /ctrl/diagnostics
GET /ctrl/identity
POST /ctrl/lang lang=de
GET /ctrl/options
GET /ctrl/features
POST /ctrl/restart restart-mode=restart | hold cfg
GET /rw/panel
GET /rw/panel/coldetstate
GET /rw/panel/ctrl-state
POST /rw/panel/ctrl-state ctrl-state=motoron
POST /rw/panel/lang lang-code=en
GET /rw/panel/opmode
POST /rw/panel/opmode opmode=manf
POST /rw/panel/opmode/acknowledge opmode=coldet
POST /rw/panel/opmode/lock pin=1234&permanent=0 | unlocked
GET /rw/panel/opmode/lock-state
POST /rw/panel/opmode/unlock pin=1234 | locked
GET /rw/panel/speedratio
POST /rw/panel/speedratio?action=setspeedratio speed-ratio=100
GET /rw/rapid
GET /rw/rapid/aliasio
GET /rw/rapid/execution
POST /rw/rapid/execution/cycle cycle=forever | hold rapid
POST /rw/rapid/execution/holdtorun state=press
POST /rw/rapid/execution/resetpp | hold rapid
POST /rw/rapid/execution/start regain=continue&execmode=continue&cycle=once&condition=none | program, motors
POST /rw/rapid/execution/startprodentry | motors, hold rapid
POST /rw/rapid/execution/stop stopmode=stop&usetsp=normal | running
POST /rw/rapid/symbols/search view=block&vartyp=any&blockurl=RAPID/T_ROB_L&symtyp=per&recursive=true
GET {SYMBOL}/data
POST {SYMBOL}/data value=0 | hold rapid
POST /rw/rapid/symbol/RAPID/T_ROB_L/data?action=validate value=[[0,0,0],[1,0,0,0]]&dattyp=pose
GET {SYMBOL}/properties
GET /rw/rapid/tasks
POST /rw/rapid/tasks/deactivate task=T_ROB_R | hold rapid
POST /rw/rapid/tasks/activate task=T_ROB_R | hold rapid
GET /rw/rapid/tasks/spy
GET /rw/rapid/tasks/syncstate/motion-pointer
GET /rw/rapid/tasks/syncstate/program-pointer
GET {TASK}
GET {TASK}/activation-record?stackframe=1 | program
POST {TASK}/deactivate | hold rapid
POST {TASK}/activate | hold rapid
POST {TASK}/loadmod modulepath=HOME/small.mod&replace=true | hold rapid, no small
POST {TASK}/unloadmod module=Small | small, hold rapid
GET {TASK}/modules
GET {MODULE}
GET {MODULE}/changecount
POST {MODULE}/modify-position startrow=1&startcol=1&endrow=1&endcol=1
GET {MODULE}/module-extension
POST {MODULE}/save name=Saved&path=$HOME
GET {MODULE}/sync-pers
GET {MODULE}/text
POST {TASK}/modules/Small/text text=MODULE Small%0AENDMODULE | small, hold rapid
GET {MODULE}/text/range?startrow=1&startcol=1&endrow=2&endcol=-1
POST {TASK}/modules/Small/text/range {_RANGE}&text=%0A | small, hold rapid
GET {MODULE}/text/search?startrow=1&startcol=1&text=main
GET {TASK}/motion
GET {TASK}/pcp
POST {TASK}/pcp/next-inst
POST {TASK}/pcp/prev-inst
POST {TASK}/pcp/routine module=Small&routine=small&userlevel=true | program, small, hold rapid
POST {TASK}/pcp/routine-from-url module=Small&routineurl=RAPID/T_ROB_L/Small/small | program, small, hold rapid
GET {TASK}/program
GET {TASK}/program/breakpoints
POST {TASK}/program/breakpoints module=TRobMain&row=20&column=1 | program, hold rapid
POST {TASK}/program/load progpath=$HOME/small.pgf&loadmode=add | no small, pgf, hold rapid
POST {TASK}/program/save path=HOME/saved | program
GET {TASK}/serviceroutine?start=1&limit=2
GET {TASK}/structural-changecount
GET {TASK}/syncstate/motion-pointer
GET /rw/rapid/taskselection
GET /rw/rapid/uiinstr
GET /rw/rapid/uiinstr/active | question
POST /rw/rapid/uiinstr/active/param/{{dialog}}/Result value=3 | question
GET /rw/iosystem
GET /rw/iosystem/devices
POST /rw/iosystem/devices?action=search lstate=enabled
GET /rw/iosystem/devices/DeviceNet/D652_10/config
POST /rw/iosystem/devices/DeviceNet/D652_10/set-lstate lstate=enable
GET /rw/iosystem/devices/DeviceNet/D652_10
GET /rw/iosystem/networks
GET /rw/iosystem/networks/DeviceNet
GET /rw/iosystem/networks/DeviceNet/config?configtype=1
POST /rw/iosystem/networks/DeviceNet/set-lstate lstate=start
GET {SIGNALS}
POST {SIGNALS}/signal-search name=hand&type=GO
POST {SIGNALS}/signal-search-ex name=hand&type=GO&name2=R&invert2=true
POST {SIGNALS}/unblock-signal
GET {SIGNALS}/custom_DO_0/config?configtype=1
POST {SIGNALS}/DeviceNet/D652_10/custom_DO_0/set-lstate lstate=not simulated
POST {SIGNALS}/DeviceNet/D652_10/custom_DO_0/set-value lvalue=1
GET {SIGNALS}/DeviceNet/D652_10/custom_DO_0
GET /rw/motionsystem
GET /rw/motionsystem/checkchangecount/0
GET /rw/motionsystem/collisionprediction
POST /rw/motionsystem/collisionprediction mode=true
GET /rw/motionsystem/errorstate
GET /rw/motionsystem/nonmotionexecution
POST /rw/motionsystem/nonmotionexecution mode=OFF
GET /rw/motionsystem/mechunits
GET {UNIT}
POST {UNIT} tool=tool0&coord-system=Base
POST {UNIT}?action=CalcRobTFromJoints {_JOINTS}&{_TOOL}&elog_at_error=FALSE
GET {UNIT}/axes
GET {UNIT}/axes/1
GET {UNIT}/axes/1/pose
GET {UNIT}/baseframe
POST {UNIT}/baseframe x=0&y=0&z=0&q1=1&q2=0&q3=0&q4=0
GET {UNIT}/cartesian?tool=tool0&wobj=wobj0&coordinate=Base
POST {UNIT}/joints-from-cartesian {{pose}}&{_TOOL}&{_OLD}&elog_at_error=FALSE
GET {UNIT}/jointtarget
GET {UNIT}/lead-through
POST {UNIT}/lead-through status=inactive
GET {UNIT}/motionsupervision
POST {UNIT}/motionsupervision/level sensitivity=100
POST {UNIT}/motionsupervision/mode mode=True
GET {UNIT}/pathsupervision
POST {UNIT}/pathsupervision/mode mode=ON
GET {UNIT}/pjoints
POST {UNIT}/pose-from-joints {_JOINTS}&{_TOOL}&elog_at_error=FALSE
POST {UNIT}/position rob_joint=[0,0,0,0,0,0]&ext_joint=[0,0,0,0,0,0]
GET {UNIT}/robtarget?tool=tool0&wobj=wobj0&coordinate=Base
GET /rw/cfg
POST /rw/cfg/load filepath=HOME/new.cfg&action-type=add | cfg, hold cfg
POST /rw/cfg/validate-instances cfgdomain=SIO&cfgtype=COM_TRP&instances=UCdevice&instancescount=1&operation=1
GET /rw/cfg/eio
POST /rw/cfg/sio/saveas filepath=/fileservice/HOME/saved.cfg
GET /rw/cfg/SIO/COM_TRP/attributes
GET /rw/cfg/SIO/COM_TRP/instances
POST /rw/cfg/SIO/COM_TRP/instances/create-default name=NEW | cfg, hold cfg
GET /rw/cfg/SIO/COM_TRP/instances/UCdevice
POST /rw/cfg/SIO/COM_TRP/instances/UCdevice RemotePortNumber=[6510,1] | hold cfg
DELETE /rw/cfg/SIO/COM_TRP/instances/NEW | new cfg, hold cfg
GET /rw/elog?lang=en
POST /rw/elog/clearall
POST /rw/elog/saveraw path=$TEMP/log.txt
GET /rw/elog/seqnum/{{event}}?lang=en | event
GET /rw/elog/0?lang=en | event
POST /rw/elog/1/clear
GET /rw/elog/0/{{event}}?lang=en | event
GET /rw/dipc
POST /rw/dipc dipc-queue-name=r&dipc-queue-size=5&dipc-max-msg-size=444
GET /rw/dipc/q/information | queue
GET /rw/dipc/q?dipc-timeout=0 | queue
POST /rw/dipc/q dipc-src-queue-name=q&dipc-cmd=111&dipc-userdef=0&dipc-msgtype=1&dipc-data=hello | queue
DELETE /rw/dipc/q | queue
GET /fileservice
POST /fileservice/HOME/x.txt/copy fs-newname=x2.txt | files
POST /fileservice/HOME/create fs-newname=xnew | files
POST /fileservice/HOME/x.txt/rename fs-newname=x3.txt | files
GET /fileservice/HOME | files
HEAD /fileservice/HOME/x.txt | files
PUT /fileservice/$HOME/x.txt text | files
DELETE /fileservice/HOME/x.txt | files
GET /rw/mastership
POST /rw/mastership/request
POST /rw/mastership/release
GET /rw/mastership/edit
POST /rw/mastership/edit/request
POST /rw/mastership/edit/release | hold rapid
GET /users/rmmp
POST /users/rmmp privilege=modify
POST /users/rmmp/cancel | rmmp
GET /users/rmmp/poll | rmmp
POST /users/register username=a&application=b&location=c&ulocale=remote
POST /users/impersonate uid={{uid}} | local
POST /subscription resources=1&1=/rw/rapid/execution;ctrlexecstate&1-p=1
GET /subscription/{{group}} | group
PUT /subscription/{{group}} resources=1&1=/rw/panel/speedratio;speedratio&1-p=0 | group
DELETE /subscription/{{group}} | group
DELETE /subscription/{{group}}/rw/panel/ctrl-state;ctrlstate | group
GET /logout
""".strip().splitlines(),
    )
)
