"""RAPID's execution, tasks, programs, pointers and dialogs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from yumi.rws.operations.answer import Spelling, flag, record, single
from yumi.rws.operations.motion import TURNS_OF_TARGET, joint_answer, target_answer
from yumi.rws.operations.operation import get, post
from yumi.rws.types import Grant

_TASK = "/rw/rapid/tasks/{task}"
_TASKS = "/rw/rapid/tasks"
_EXECUTION = "/rw/rapid/execution"
_DIALOGS = "/rw/rapid/uiinstr"
_LOGGING = Spelling(
    lambda state, name: state.text(name).lower() == "logging",
    lambda name, is_on: {name: "Logging" if is_on else "Not Logging"},
)
_SIX: Spelling[tuple[str, ...]] = Spelling(
    lambda state, name: tuple(state.text(f"{name}{number}") for number in range(1, 7)),
    lambda name, texts: {f"{name}{number}": text for number, text in enumerate(texts, 1)},
)
_EXTERNAL = tuple(f"ej{number}" for number in range(1, 7))


@dataclass(frozen=True, slots=True)
class Dialog:
    """A question of a program on the FlexPendant; ``stack`` names it for ``dialog_parameters``."""

    instruction: Annotated[str, "instr"]
    event: str = field(default="POST", kw_only=True)
    stack: str
    level: Annotated[str, "execlv"] = field(default="User", kw_only=True)
    message: Annotated[str, "msg"]


RAPID = get("/rw/rapid")
EXECUTION = get(_EXECUTION, "continue-on-err=0|1")
START = post(
    _EXECUTION,
    "start",
    "regain=continue|regain|clear, "
    "execmode=continue|stepin|stepover|stepout|stepback|steplast|stepmotion, "
    "cycle=forever|asis|once, condition=none|callchain, stopatbp=disabled|enabled, "
    "alltaskbytsp=true|false",
    grant=Grant.RAPID_EXECUTE,
)
STOP = post(_EXECUTION, "stop", "stopmode=cycle|instr|stop|qstop, usetsp=normal|alltsk")
START_PRODUCTION = post(_EXECUTION, "startprodentry", grant=Grant.RAPID_EXECUTE)
MOVE_PP_TO_MAIN = post(_EXECUTION, "resetpp", grant=Grant.RAPID_EXECUTE)
SET_CYCLE = post(_EXECUTION, "setcycle", "cycle=once|forever|asis", needs="rapid", grant=Grant.RAPID_EXECUTE)
HOLD_TO_RUN = post(_EXECUTION, "holdtorun-state", "state=press|held|release", grant=Grant.RAPID_DEBUG, status=403)
TASKS = get(_TASKS, "continue-on-err=0|1")
SPY = get(_TASKS, resource="spy-status").shows(single("rap-spy-status", "status", _LOGGING))
SYNC_STATE = get(_TASKS, "type=program-pointer|motion-pointer", resource="sync-state")
ACTIVATE_ALL = post(_TASKS, "activate", respects="rapid", grant=Grant.RAPID_DEBUG)
DEACTIVATE_ALL = post(_TASKS, "deactivate", respects="rapid", grant=Grant.RAPID_DEBUG)
START_SPY = post(_TASKS, "start-spy", "log-file", status=400)
STOP_SPY = post(_TASKS, "stop-spy", status=400)
TASK = get(_TASK, "continue-on-err=0|1")
STACK_FRAME = get(_TASK, "stackframe", resource="activation-record")
CHANGE_COUNT_TOO = get(_TASK, resource="task-struc-change-count")
PREFERRED_TYPES = get(_TASK, "instruction, parameter", resource="pref-data-types")
TASK_SYNC_STATE = get(_TASK, "type=program-pointer|motion-pointer", resource="task-sync-state")
ACTIVATE = post(_TASK, "activate", respects="rapid", grant=Grant.RAPID_DEBUG)
DEACTIVATE = post(_TASK, "deactivate", respects="rapid", grant=Grant.RAPID_DEBUG)
LOAD_MODULE = post(_TASK, "loadmod", "modulepath, replace=true|false", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
UNLOAD_MODULE = post(_TASK, "unloadmod", "module", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
ABORT_LEVEL = post(_TASK, "abortexeclevel", needs="rapid", grant=Grant.RAPID_EXECUTE)
BUILD = post(_TASK, "build", needs="rapid")
HOLD_TASK_TO_RUN = post(_TASK, "holdtorun", "state=press|held|release", grant=Grant.RAPID_DEBUG, status=403)
CHANGE_COUNT = get(f"{_TASK}/structural-changecount")
ACTIVATION_RECORD = get(f"{_TASK}/activation-record", "stackframe")
ROUTINES_OF_TASK = get(f"{_TASK}/serviceroutine", "start, limit, allread=TRUE|FALSE")
TASK_EXECUTION = get(f"{_TASK}/execution")
MOTION = get(f"{_TASK}/motion")
MOTION_TARGET = get(f"{_TASK}/motion", "tool, wobj", resource="robtarget").shows(
    target_answer("rapid-robtarget", TURNS_OF_TARGET, _EXTERNAL)
)
MOTION_JOINTS = get(f"{_TASK}/motion", resource="jointtarget").shows(joint_answer("rapid-jointtarget", "j", _EXTERNAL))
MOTION_UNITS = get(f"{_TASK}/motion", resource="mechunit")
EXTRA_JOINTS = get(f"{_TASK}/motion", resource="extjointstate").shows(single("rapid-extjointstate", "j", _SIX))
PROGRAM = get(f"{_TASK}/program", "continue-on-err=0|1")
LOAD_PROGRAM = post(
    f"{_TASK}/program", "loadprog", "progpath, loadmode=add|replace", needs="rapid", grant=Grant.RAPID_LOADPROGRAM
)
UNLOAD_PROGRAM = post(f"{_TASK}/program", "unloadprog", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
SAVE_PROGRAM = post(f"{_TASK}/program", "save", "path", grant=Grant.BACKUP)
SET_PROGRAM_NAME = post(f"{_TASK}/program", "setname", "name", respects="rapid", grant=Grant.RAPID_EDIT)
SET_ENTRY = post(f"{_TASK}/program", "set-entrypoint", "routine", needs="rapid", grant=Grant.RAPID_EDIT)
BUILD_ERRORS = get(f"{_TASK}/program/builderror", "start, limit")
BREAKPOINTS = get(f"{_TASK}/program/breakpoint", "start, limit")
SET_BREAKPOINT = post(
    f"{_TASK}/program/breakpoint", "set", "module, row, column", needs="rapid", grant=Grant.RAPID_DEBUG
)
TASK_BREAKPOINTS = get(f"{_TASK}/breakpoints")
POINTERS = get(f"{_TASK}/pcp")
SET_PP_CURSOR = post(
    f"{_TASK}/pcp", "set-pp-cursor", "module, routine, line, column", needs="rapid", grant=Grant.RAPID_DEBUG
)
SET_PP_ROUTINE = post(
    f"{_TASK}/pcp", "set-pp-routine", "module, routine, userlevel=true|false", needs="rapid", grant=Grant.RAPID_DEBUG
)
SET_PP_ROUTINE_FROM_URL = post(
    f"{_TASK}/pcp",
    "set-pp-routine-from-url",
    "module, routine, userlevel=true|false",
    needs="rapid",
    grant=Grant.RAPID_DEBUG,
)
SET_PP_PREV_INST = post(f"{_TASK}/pcp", "set-pp-prev-inst", grant=Grant.RAPID_DEBUG, status=400)
SET_PP_NEXT_INST = post(f"{_TASK}/pcp", "set-pp-next-inst", grant=Grant.RAPID_DEBUG, status=400)
TASK_SELECTION = get("/rw/rapid/taskselection").shows(single("rap-taskselection", "user-modify", flag()))
ALIASES = get("/rw/rapid/aliasio", "start, limit")
DIALOGS = get(_DIALOGS)
ACTIVE_DIALOG = get(f"{_DIALOGS}/active").shows(record("rap-uiactive-li", Dialog))
DIALOG_PARAMETERS = get(f"{_DIALOGS}/active/params/{{stack:.+}}")
DIALOG_PARAMETER = get(f"{_DIALOGS}/active/param/{{stack:.+}}")
ANSWER_DIALOG = post(f"{_DIALOGS}/active/param/{{stack:.+}}", "set", "value")
