"""Types that are names for num or string, and the constants that programs compare their values with.

Values that ABB's manuals print are ABB's; where they print none, the constants of a type are numbered in the order the
manual lists them, since programs compare names only.
"""

from __future__ import annotations

from yumi.rapid.builtins.data import DATA
from yumi.rapid.library import Library

CONSTANTS = Library(DATA)

for _name, _base in (
    *((name, "num") for name in ("opcalc", "errdomain", "errtype", "event_type", "handler_type", "exec_level")),
    *((name, "num") for name in ("tsp_status", "sensorstate", "loadidnum", "paridnum", "paridvalidnum", "aiotrigg")),
    *((name, "num") for name in ("supervtype", "triggmode", "tunegtype", "triggflag", "cnvcmd", "pathrecnum")),
    *((name, "num") for name in ("btnres", "buttondata", "icondata", "uishownum", "inttypes")),
    *(("stringdig", "string"), ("tasksatstart", "string")),
):
    CONSTANTS.alias(_name, _base)

# By type: names with the value of the first, the others count on; `NAME=7` sets another one.
TABLE = {
    "opnum": "LT=1 LTEQ EQ NOTEQ GTEQ GT",
    "opcalc": "OpAdd=1 OpSub OpMult OpDiv OpMod",
    "symnum": "RUN_UNDEF=0 RUN_CONT_CYCLE RUN_INSTR_FWD RUN_INSTR_BWD RUN_SIM RUN_STEP_MOVE",
    "errtype": "TYPE_ALL=0 TYPE_STATE TYPE_WARN TYPE_ERR",
    "errdomain": (
        "COMMON_ERR=0 OP_STATE SYSTEM_ERR HARDWARE_ERR PROGRAM_ERR MOTION_ERR OPERATOR_ERR IO_COM_ERR USER_DEF_ERR "
        "SAFETY_ERR OPTION_PROD_ERR PROCESS_ERR CFG_ERR ARCWELD_ERR SPOTWELD_ERR PAINT_ERR PICKWARE_ERR"
    ),
    "event_type": (
        "EVENT_NONE=0 EVENT_POWERON EVENT_START EVENT_STOP EVENT_QSTOP EVENT_RESTART EVENT_RESET EVENT_STEP"
    ),
    "handler_type": "HANDLER_NONE=0 HANDLER_BWD HANDLER_ERR HANDLER_UNDO",
    "exec_level": "LEVEL_NORMAL=0 LEVEL_TRAP LEVEL_SERVICE",
    "tsp_status": (
        "TSP_STATUS_NOT_NORMAL_TASK=0 TSP_STATUS_DEACT TSP_STATUS_DEACT_SERV_ROUT TSP_STATUS_ACT "
        "TSP_UNCHECKED_RUN_SERV_ROUT=10 TSP_NORMAL_UNCHECKED TSP_STATIC_UNCHECKED TSP_SEMISTATIC_UNCHECKED "
        "TSP_NORMAL_CHECKED=20 TSP_STATIC_CHECKED TSP_SEMISTATIC_CHECKED"
    ),
    "sensorstate": "STATE_ERROR=-1 STATE_UNDEFINED STATE_CONNECTED STATE_OPERATING STATE_CLOSED",
    "num": (
        "AT_POINT=0 AT_ERRORPOINT AT_RESTARTPOINT "
        "CSS_X=1 CSS_Y CSS_Z CSS_XY CSS_XZ CSS_YZ CSS_XYZ CSS_XYRZ CSS_ARM_ANGLE "
        "CSS_POSX=1 CSS_NEGX CSS_POSY CSS_NEGY CSS_POSZ CSS_NEGZ CSS_REFFRAME_TOOL=0 CSS_REFFRAME_WOBJ "
        "CT_CONTINUOUS=1 CT_COUNT_CYCLES CT_COUNT_CYC_ACTION CT_PERIODICAL EGM_MAX_RAPID_DNUM=19 "
        "TRIGG_MODE1=1 TRIGG_MODE2 TRIGG_MODE3"
    ),
    "loadidnum": "MASS_KNOWN=1 MASS_WITH_AX3",
    "paridnum": ("TOOL_LOAD_ID=1 PAY_LOAD_ID IRBP_K IRBP_L IRBP_C IRBP_C_INDEX IRBP_T IRBP_R IRBP_A IRBP_B IRBP_D"),
    "paridvalidnum": "ROB_LOAD_VAL=10 ROB_NOT_LOAD_VAL ROB_LM1_LOAD_VAL",
    "aiotrigg": ("AIO_ABOVE_HIGH=1 AIO_BELOW_HIGH AIO_ABOVE_LOW AIO_BELOW_LOW AIO_BETWEEN AIO_OUTSIDE AIO_ALWAYS"),
}

# Speeds of external axes alone: rotating ones [deg/s], linear ones [mm/s].
for _speed in (1, 2, 5, 10, 20, 50, 100):
    CONSTANTS.data(f"vrot{_speed}", "speeddata", (0, 0, 0, _speed))
for _speed in (10, 20, 50, 100, 200, 500, 1000):
    CONSTANTS.data(f"vlin{_speed}", "speeddata", (0, 0, _speed, 0))

for _type, _names in TABLE.items():
    _next = 0
    for _entry in _names.split():
        _name, _, _value = _entry.partition("=")
        _number = int(_value) if _value else _next
        CONSTANTS.data(_name, _type, float(_number))
        _next = _number + 1
