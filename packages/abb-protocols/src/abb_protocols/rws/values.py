"""Values of Robot Web Services: enumerations of modes, states, types and grants; return codes; subscribed resources.

States are spelled as on the wire (reference/rws.md §5-6), return codes as in ABB's table (§3.4-3.5).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from abb_protocols.catalogue import Message, clause, message, remedy_of

# A login: the realm of the digest, and the cookies a session is kept by (reference/rws.md §2.1-2.2).
REALM = "validusers@robapi.abb"
SESSION_COOKIE = "-http-session-"
CONNECTION_COOKIE = "ABBCX"

PROTOCOL = "robapi2_subscription"
"""Sub-protocol of a subscription's WebSocket."""


class OperatingMode(Enum):
    """The mode switch of the controller, ``/rw/panel/opmode``."""

    INIT = "INIT"
    AUTO_REQUESTED = "AUTO_CH"
    MANUAL_FULL_REQUESTED = "MANF_CH"
    MANUAL_REDUCED = "MANR"
    MANUAL_FULL = "MANF"
    AUTO = "AUTO"
    UNDEFINED = "UNDEF"


class ControllerState(Enum):
    """Motors and stops, ``/rw/panel/ctrlstate``."""

    INIT = "init"
    MOTORS_OFF = "motoroff"
    MOTORS_ON = "motoron"
    GUARD_STOP = "guardstop"
    EMERGENCY_STOP = "emergencystop"
    EMERGENCY_STOP_RESET = "emergencystopreset"
    SYSTEM_FAILURE = "sysfail"


class CollisionState(Enum):
    """State of the collision detection, ``/rw/panel/coldetstate``."""

    INIT = "INIT"
    TRIGGERED = "TRIGGERED"
    CONFIRMED = "CONFIRMED"
    TRIGGERED_ACKNOWLEDGED = "TRIGGERED_ACK"


class RestartMode(Enum):
    """What a restart keeps."""

    WARM = "restart"
    """All: programs and configuration; a changed configuration takes effect."""
    RESET_SYSTEM = "istart"
    """Nothing: the system becomes as it was installed."""
    RESET_RAPID = "pstart"
    """The configuration; programs are removed."""
    LAST_SAVED = "bstart"
    """The state of the last good shutdown."""


class ExecutionState(Enum):
    """Whether RAPID runs, ``/rw/rapid/execution``."""

    RUNNING = "running"
    STOPPED = "stopped"


class TaskExecution(Enum):
    """Execution of one task, ``excstate`` of ``/rw/rapid/tasks``; four letters on the wire."""

    READY = "read"
    STOPPED = "stop"
    STARTED = "star"
    UNINITIALIZED = "unin"


class RunCycle(Enum):
    """Whether a program begins again at its end."""

    FOREVER = "forever"
    AS_IS = "asis"
    ONCE = "once"
    ONCE_DONE = "oncedone"


class Regain(Enum):
    """What happens first where a robot has left its path."""

    CONTINUE = "continue"
    REGAIN = "regain"
    CLEAR = "clear"


class Step(Enum):
    """How far a start executes."""

    CONTINUE = "continue"
    IN = "stepin"
    OVER = "stepover"
    OUT = "stepout"
    BACK = "stepback"
    LAST = "steplast"
    MOTION = "stepmotion"


class StopMode(Enum):
    """Where execution stops: at the end of the cycle, of the instruction, at once on the path, or beside it."""

    CYCLE = "cycle"
    INSTRUCTION = "instr"
    STOP = "stop"
    QUICK = "qstop"


class SignalType(Enum):
    """Digital, analog or group; input or output."""

    DIGITAL_INPUT = "DI"
    DIGITAL_OUTPUT = "DO"
    ANALOG_INPUT = "AI"
    ANALOG_OUTPUT = "AO"
    GROUP_INPUT = "GI"
    GROUP_OUTPUT = "GO"

    @property
    def is_output(self) -> bool:
        return self.value.endswith("O")

    @property
    def is_digital(self) -> bool:
        return self.value.startswith("D")


class SignalChange(Enum):
    """How a write changes a signal."""

    VALUE = "value"
    INVERT = "invert"
    PULSE = "pulse"
    TOGGLE = "toggle"
    DELAY = "delay"


class SymbolKind(Enum):
    """What a RAPID symbol is."""

    ATOMIC = "atm"
    RECORD = "rec"
    ALIAS = "ali"
    COMPONENT = "rcp"
    CONSTANT = "con"
    VARIABLE = "var"
    PERSISTENT = "per"
    PARAMETER = "par"
    LABEL = "lab"
    FOR = "for"
    FUNCTION = "fun"
    PROCEDURE = "prc"
    TRAP = "trp"
    MODULE = "mod"
    TASK = "tsk"
    ANY = "any"


class Coordinates(Enum):
    """In which coordinates a position is."""

    BASE = "Base"
    WORLD = "World"
    TOOL = "Tool"
    WORK_OBJECT = "Wobj"


class JogMode(Enum):
    """What the axes of a joystick move."""

    AXES_1_TO_3 = "AxisGroup1"
    AXES_4_TO_6 = "AxisGroup2"
    CARTESIAN = "Cartesian"
    ALIGN = "Align"
    GO_TO_POSITION = "GoToPos"
    CONFIGURATION = "ConfigurationJog"


class Increment(Enum):
    """Length of a step when jogging."""

    SMALL = "Small"
    MEDIUM = "Medium"
    LARGE = "Large"
    USER = "User"


class EventType(IntEnum):
    """How serious a message of the event log is."""

    INFORMATION = 1
    WARNING = 2
    ERROR = 3


class Priority(IntEnum):
    """How soon a change is sent."""

    LOW = 0
    MEDIUM = 1
    HIGH = 2


@dataclass(frozen=True, slots=True)
class Resource:
    """One thing that can be subscribed; ``path`` as the controller spells it, e.g. ``/rw/panel/opmode``."""

    path: str
    priority: Priority = Priority.MEDIUM


class Grant(Enum):
    """What a user may do (ABB: User Authorization System); the value is the name in ``/users/grants``.

    Reading needs no grant, except of files.
    """

    FULL_ACCESS = "UAS_FULL_ACCESS"
    """All others."""

    BACKUP = "UAS_BACKUP"
    """Back up; save modules, programs and system parameters."""

    CALIBRATE = "UAS_CALIBRATE"
    CFG_WRITE = "UAS_CFG_WRITE"
    CONTROLLER_PROPERTIES_WRITE = "UAS_CONTROLLER_PROPERTIES_WRITE"
    """Set the controller's name and clock."""

    EVENTLOG_CLEAR = "UAS_EVENTLOG_CLEAR"
    FTP_READ = "UAS_FTP_READ"
    FTP_WRITE = "UAS_FTP_WRITE"
    """Write to the controller's disks."""

    IO_WRITE = "UAS_IO_WRITE"
    RAPID_CURRVALUE = "UAS_RAPID_CURRVALUE"
    """Write data of programs."""

    RAPID_DEBUG = "UAS_RAPID_DEBUG"
    """Move the program pointer to a routine or line, select tasks, ask for write access (mastership)."""

    RAPID_EDIT = "UAS_RAPID_EDIT"
    RAPID_EXECUTE = "UAS_RAPID_EXECUTE"
    """Start programs and move the program pointer to main; a stop needs no grant."""

    RAPID_LOADPROGRAM = "UAS_RAPID_LOADPROGRAM"
    RAPID_MODPOS = "UAS_RAPID_MODPOS"
    REMOTE_LOGIN = "UAS_REMOTE_LOGIN"
    REMOTE_WARMSTART = "UAS_REMOTE_WARMSTART"
    RESTORE = "UAS_RESTORE"
    REVOLUTION_COUNTER_UPDATE = "UAS_REVOLUTION_COUNTER_UPDATE"
    SPEED_DECREASE = "UAS_SPEED_DECREASE"
    """Reduce the speed from 100 % in automatic mode."""

    SYSTEM_ADMINISTRATION = "UAS_SYSTEM_ADMINISTRATION"
    """Install and select systems, and restart with another state than the present one."""


class Privilege(Enum):
    """What a client may do in manual mode."""

    MODIFY = "modify"
    """Write data and programs."""
    EXECUTE = "exec"
    """Start programs, too."""


class RmmpStatus(Enum):
    """What became of a request for the remote manual mode privilege."""

    PENDING = "PENDING"
    GRANTED = "GRANTED"
    DENIED = "DENIED"


GRANTS = tuple(each for each in Grant if each is not Grant.FULL_ACCESS)
"""All, each by its own name."""


class RwsCode(IntEnum):
    """Return codes of the controller that a client meets; names as in ABB's table."""

    OUTOFMEMORY = -1073445887
    NOTIMPL = -1073445886
    SERVICE_NOT_SUPPORTED = -1073445885
    NO_DATA = -1073445883
    REJECT = -1073445881
    RESOURCE_NOT_HELD = -1073445880
    INVALIDARG = -1073445879
    LOCAL_NOT_ALLOWED = -1073445875
    NOT_LOGGED_ON = -1073445873
    RESOURCE_ALREADY_HELD = -1073445872
    MAX_LIMIT_REACHED = -1073445871
    NO_SUCH_REQUEST = -1073445870
    TIMEOUT = -1073445869
    UAS_REJECT = -1073445867
    UNRESOLVED_URL = -1073445866
    BUFFER_OVERFLOW = -1073445865
    UI_NOT_ACTIVE = -1073445864
    DENIED = -1073445863
    RESOURCE_HELD = -1073445862
    MODE_REJECT = -1073445860
    MASTER_REJECT = -1073445859
    SYNC_STATE_REJECT = -1073445857
    NOT_ACTIVE_REJECT = -1073445856
    TASK_SELECTION_PANEL_DISABLED = -1073445852
    NAMEEXIST = -1073445839
    SYSFAIL_REJECT = -1073445851
    NO_SUCH_SYMBOL = -1073442816
    SOURCEPOS = -1073442815
    MODULE_READ_PROTECTED = -1073442811
    NOT_ON_PATH = -1073442807
    EXEC_LEVEL = -1073442806
    ILLEGAL_ENTRYPOINT = -1073442801
    ILLEGAL_PCP_MOVE = -1073442800
    EXEC_STATE_BGTSK = -1073442785
    UI_INSTRUCTION_NOT_ACTIVE = -1073442784
    GENERAL_FILE_ERROR = -1073438720
    DEVICE_FULL = -1073438719
    INVALID_PATH = -1073438716
    NO_DEVICE = -1073438715
    DIR_NOT_EXIST = -1073438713
    DIR_EXIST = -1073438712
    DIR_NOT_EMPTY = -1073438711
    CREATE_FILE = -1073438709
    UNIT_DISABLE_NOT_ALLOWED = -1073438208
    UNIT_NOT_RUNNING = -1073438207
    CROSS_RESULTANT = -1073438205
    CFG_ATTRIBUTE_INVALID = -1073437694
    CFG_OUT_OF_RANGE = -1073437693
    CFG_NAME_EXIST = -1073437689
    CFG_DATA_INCORRECT = -1073437688
    TOOL_ERROR = -1073436672
    WOBJ_ERROR = -1073436671
    MECHUNIT_DEACTIVATED = -1073436670
    NO_TCPROBOT_ACTIVE = -1073436666
    POSE_OUTSIDE_REACH = -1073436654
    OPTION = -1073435901
    NOT_MANUAL_MODE = -1073435895
    NOT_MOTORS_OFF = -1073435894
    MODULE_NAME_TAKEN = -1073442813
    MODULE_WRITE_PROTECTED = -1073442810
    EXEC_STATE = -1073442809
    TASK_STATE = -1073442808
    SYNTAX = -1073442803
    SEMANTIC = -1073442802
    SYMBOL_NOT_PERSISTENT = -1073442786
    NO_PP = -1073442783
    FILE_NOT_FOUND = -1073438708
    CFG_DOMAIN_INVALID = -1073437696
    CFG_TYPE_INVALID = -1073437695
    CFG_INSTANCE_INVALID = -1073437691
    NO_SUCH_MECHUNIT = -1073436668
    UNBLOCKED_INSIGNAL = -1073438206
    INVALID_STATE = -1073435887
    FAIL = -1073414146
    UNEXPECTED = -1073414145


_MEANINGS: Mapping[int | None, Message] = {
    RwsCode.REJECT: message("rws_reject"),
    RwsCode.UNEXPECTED: message("rws_reject"),
    RwsCode.INVALIDARG: message("rws_invalidarg"),
    RwsCode.UAS_REJECT: message("rws_uas_reject"),
    RwsCode.UNRESOLVED_URL: message("rws_unresolved_url"),
    RwsCode.DENIED: message("rws_denied"),
    RwsCode.RESOURCE_HELD: message("rws_resource_held"),
    RwsCode.MODE_REJECT: message("rws_mode_reject"),
    RwsCode.MASTER_REJECT: message("rws_master_reject"),
    RwsCode.SYSFAIL_REJECT: message("rws_sysfail_reject"),
    RwsCode.NO_SUCH_SYMBOL: message("rws_no_such_symbol"),
    RwsCode.EXEC_STATE: message("rws_exec_state"),
    RwsCode.TASK_STATE: message("rws_task_state"),
    RwsCode.SYNTAX: message("rws_syntax"),
    RwsCode.MODULE_NAME_TAKEN: message("rws_module_name_taken"),
    RwsCode.FILE_NOT_FOUND: message("rws_file_not_found"),
    RwsCode.MAX_LIMIT_REACHED: message("rws_max_limit_reached"),
    RwsCode.SYMBOL_NOT_PERSISTENT: message("rws_symbol_not_persistent"),
    RwsCode.SEMANTIC: message("rws_semantic"),
    RwsCode.NO_PP: message("rws_no_pp"),
    RwsCode.CFG_TYPE_INVALID: message("rws_cfg_type_invalid"),
    RwsCode.CFG_DOMAIN_INVALID: message("rws_cfg_domain_invalid"),
    RwsCode.NO_SUCH_MECHUNIT: message("rws_no_such_mechunit"),
    RwsCode.UNBLOCKED_INSIGNAL: message("rws_unblocked_insignal"),
    RwsCode.INVALID_STATE: message("rws_invalid_state"),
}


def code_name(code: int) -> str:
    """ABB's name of ``code``, or "" for one we do not know."""
    return next((known.name for known in RwsCode if known == code), "")


def code_meaning(code: int | None) -> Message | None:
    """What ``code`` means and what to do about it, or None when we have no words of our own for it."""
    return _MEANINGS.get(code)


def code_sentence(code: int | None) -> str | None:
    """The same as a text, as the virtual controller describes its return codes."""
    meaning = code_meaning(code)
    return None if meaning is None else "; ".join(filter(None, (clause(meaning), remedy_of(meaning))))
