"""The errors of the RAPID language, and the error numbers a RAPID program can meet in ERRNO.

::

    RapidError
    ├── RapidSyntaxError     the text is not RAPID: mend the module
    ├── RapidReferenceError  a name, type or argument does not fit: mend the module, or load what it refers to
    │   ├── Unresolved           nothing declares a name: the program runs up to where it is used
    │   │   └── NotProvided          RobotWare has it, the library has not
    │   ├── ModuleNameTaken      there is a module of that name: unload it first, or replace it
    │   └── ProgramTooLarge      there is no memory for it: make it smaller, or unload others
    ├── RapidRuntimeError    an execution error with an error number, which an ERROR handler may catch
    ├── UnknownSymbol        no such module or symbol
    └── RapidValueError      a literal does not fit the symbol it was written to
"""

from __future__ import annotations

from yumi.errors import RapidError


class RapidSyntaxError(RapidError):
    """The text is not RAPID; the sentence says where, what was found and what would be allowed."""

    def __init__(self, sentence: str, *, filename: str, line: int, column: int) -> None:
        super().__init__(f"{filename}:{line}:{column}: {sentence}")
        self.filename = filename
        self.line = line
        self.column = column


class RapidReferenceError(RapidError):
    """A name is unknown or used as what it is not; the message begins with module and line.

    Attributes:
        sentence: what does not fit, without the place.
        line, column: counted from 1, 0 where the error has no position in a file.
    """

    def __init__(self, message: str, *, sentence: str = "", filename: str = "", line: int = 0, column: int = 0) -> None:
        super().__init__(message)
        self.sentence = sentence or message
        self.filename = filename
        self.line = line
        self.column = column


class Unresolved(RapidReferenceError):
    """Nothing declares a name: an error only where the program uses it, with the error number `error` then.

    Technical reference manual, RAPID kernel: references are resolved late, so that modules may be loaded in any order.
    """

    error = "ERR_REFUNKDAT"


class UnresolvedFunction(Unresolved):
    error = "ERR_REFUNKFUN"


class UnresolvedProcedure(Unresolved):
    error = "ERR_REFUNKPRC"


class UnresolvedTrap(Unresolved):
    error = "ERR_REFUNKTRP"


class NotProvided(Unresolved):
    """What RobotWare has and this library has not; the error is none of RAPID's, so that no handler takes it."""

    error = "NOT_PROVIDED"


class ModuleNameTaken(RapidReferenceError):
    """The task has a module of that name already."""


class ProgramTooLarge(RapidReferenceError):
    """The task has no memory for it."""


class UnknownSymbol(RapidError):
    """The task has no such module, or the module no such symbol."""


class RapidValueError(RapidError):
    """A literal is not a value of the type it should have; nothing was changed."""


class RapidRuntimeError(RapidError):
    """An execution error; instructions raise it to start RAPID's error handling.

    Attributes:
        name: the error's name, such as "ERR_UDPUC_COMM", or "" for a number raised by the program itself. A name that
            is not registered is fatal: no handler can take it.
        number: the value of ERRNO, or None until the task has looked the name up.
    """

    def __init__(self, name: str, sentence: str, *, number: float | None = None) -> None:
        super().__init__(sentence)
        self.name = name
        self.number = number


# ABB does not publish the values, and programs compare names only; the library counts them up from here.
FIRST_ERROR_NUMBER = 1001
FIRST_BOOKED_NUMBER = 5001  # what BookErrNo gives out
ALL_ERRORS = "LONG_JMP_ALL_ERR"  # in the list of an ERROR clause: it takes every error, from long jumps as well
LARGEST_OWN_NUMBER = 90  # 1 to 90 are the program's own

_NAMES = """
ERR_ACC_TOO_LOW ERR_ACTIV_PROF ERR_ADDR_INUSE ERR_ALIASIO_DEF ERR_ALIASIO_TYPE ERR_ALRDYCNT ERR_ALRDY_MOVING
ERR_AO_LIM ERR_ARGDUPCND ERR_ARGNAME ERR_ARGNOTPER ERR_ARGNOTVAR ERR_ARGVALERR ERR_ARRAY_SIZE ERR_AXIS_ACT
ERR_AXIS_IND ERR_AXIS_MOVING ERR_AXIS_PAR ERR_BUSSTATE ERR_BWDLIMIT ERR_CALC_DIVZERO ERR_CALC_NEG ERR_CALC_OVERFLOW
ERR_CALLIO_INTER ERR_CALLPROC ERR_CAM_BUSY ERR_CAM_COM_TIMEOUT ERR_CAM_GET_MISMATCH ERR_CAM_MAXTIME
ERR_CAM_NO_MORE_DATA ERR_CAM_NO_PROGMODE ERR_CAM_NO_RUNMODE ERR_CAM_SET_MISMATCH ERR_CFG_ILLTYPE ERR_CFG_ILL_DOMAIN
ERR_CFG_INTERNAL ERR_CFG_LIMIT ERR_CFG_NOTFND ERR_CFG_OUTOFBOUNDS ERR_CFG_WRITEFILE ERR_CNTNOTVAR ERR_CNV_CONNECT
ERR_CNV_DROPPED ERR_CNV_NOT_ACT ERR_COLL_STOP ERR_COMM_EXT ERR_COMM_INIT ERR_COMM_INIT_FAILED ERR_CONCAT
ERR_CONC_MAX ERR_CONTACTL ERR_CSV_INDEX ERR_DATA_RECV ERR_DA_UNKPROC ERR_DEV_MAXTIME ERR_DIPLAG_LIM ERR_DIVZERO
ERR_DROP_LOAD ERR_EXCRTYMAX ERR_EXECPHR ERR_FILEACC ERR_FILEEXIST ERR_FILEOPEN ERR_FILESIZE ERR_FILNOTFND
ERR_FNCNORET ERR_FRAME ERR_FRICTUNE_FATAL ERR_GLUEFLOW ERR_GO_LIM ERR_HAND_FAILEDGRIPPOS ERR_HAND_FAILEDMOVEPOS
ERR_HAND_FAILEDVACUUM ERR_HAND_NOTCALIBRATED ERR_ILLDIM ERR_ILLQUAT ERR_ILLRAISE ERR_INDCNV_ORDER ERR_INOISSAFE
ERR_INOMAX ERR_INPAR_RDONLY ERR_INT_MAXVAL ERR_INT_NOTVAL ERR_INVDIM ERR_IODISABLE ERR_IODN_TIMEOUT ERR_IOENABLE
ERR_IOERROR ERR_IPSDEVICE_UNKNOWN ERR_IPSILLEGAL_CH_OR_FAC ERR_IPS_PARAM ERR_ITMSRC_UNDEF ERR_LINKREF ERR_LOADED
ERR_LOADID_FATAL ERR_LOADID_RETRY ERR_LOADNO_INUSE ERR_LOADNO_NOUSE ERR_MAXINTVAL ERR_MOC_CNV_REC_FILE_UNKNOWN
ERR_MODULE ERR_MOD_NOTLOADED ERR_MOD_NOT_LOADED ERR_MSG_PENDING ERR_MT_ABORT ERR_MT_HOME ERR_MT_HOMERUN
ERR_NAME_INVALID ERR_NEGARG ERR_NORUNUNIT ERR_NOTARR ERR_NOTEQDIM ERR_NOTINTVAL ERR_NOTPRES ERR_NOTSAVED
ERR_NOT_MOVETASK ERR_NO_ALIASIO_DEF ERR_NO_SGUN ERR_NUM_LIMIT ERR_OUTOFBND ERR_OUTSIDE_REACH ERR_OVERFLOW ERR_PATH
ERR_PATHDIST ERR_PATH_STOP ERR_PERSSUPSEARCH ERR_PID_MOVESTOP ERR_PID_RAISE_PP ERR_PPA_TIMEOUT ERR_PRGMEMFULL
ERR_PROCSIGNAL_OFF ERR_PROGSTOP ERR_RANYBIN_CHK ERR_RANYBIN_EOF ERR_RCVDATA ERR_REFUNKDAT ERR_REFUNKFUN
ERR_REFUNKPRC ERR_REFUNKTRP ERR_RMQ_DIM ERR_RMQ_FULL ERR_RMQ_INVALID ERR_RMQ_INVMSG ERR_RMQ_MSGSIZE ERR_RMQ_NAME
ERR_RMQ_NOMSG ERR_RMQ_TIMEOUT ERR_RMQ_VALUE ERR_ROBLIMIT ERR_SC_WRITE ERR_SGUN_ESTOP ERR_SGUN_MOTOFF ERR_SGUN_NEGVAL
ERR_SGUN_NOTACT ERR_SGUN_NOTINIT ERR_SGUN_NOTOPEN ERR_SGUN_NOTSYNC ERR_SIGSUPSEARCH ERR_SIG_NAME ERR_SIG_NOT_VALID
ERR_SOCK_ADDR_INUSE ERR_SOCK_ADDR_INVALID ERR_SOCK_CLOSED ERR_SOCK_IS_BOUND ERR_SOCK_IS_CONN ERR_SOCK_NET_UNREACH
ERR_SOCK_NOT_BOUND ERR_SOCK_NOT_CONN ERR_SOCK_TIMEOUT ERR_SOCK_UNSPEC ERR_SPEEDLIM_VALUE ERR_SPEED_REFRESH_LIM
ERR_STARTMOVE ERR_STORE_PROF ERR_STRTOOLNG ERR_SYMBOL_TYPE ERR_SYM_ACCESS ERR_SYNCMOVEOFF ERR_SYNCMOVEON ERR_SYNTAX
ERR_TASKNAME ERR_TP_DIBREAK ERR_TP_DOBREAK ERR_TP_MAXTIME ERR_TP_NO_CLIENT ERR_TP_PERSBOOLBREAK ERR_TRUSTLEVEL
ERR_TXTNOEXIST ERR_UDPUC_COMM ERR_UISHOW_FATAL ERR_UISHOW_FULL ERR_UI_BUTTONS ERR_UI_INITVALUE ERR_UI_MAXMIN
ERR_UI_MAXTIME ERR_UI_NOTINT ERR_UNIT_PAR ERR_UNKINO ERR_UNKPROC ERR_UNLOAD ERR_USE_PROF ERR_WAITSYNCTASK
ERR_WAIT_MAX ERR_WAIT_MAXTIME ERR_WHLSEARCH ERR_WHL_SEARCH ERR_WOBJ_MOVING CORR_NOFREE CORR_NOOBJECT CORR_NOTCONN
SYS_ERR_ARL_INPAR_RDONLY SYS_ERR_MOC_CNV_REC_FILE_UNKNOWN
SYS_ERR_MOC_CNV_REC_NOT_READY
"""
ERROR_NAMES = tuple(_NAMES.split())
