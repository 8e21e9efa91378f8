"""RAPID's predefined types, data and constants.

Constants whose values ABB's manuals print have these; where they print none, the constants of a type are numbered in
the order the manual lists them, since programs compare names only.
"""

from __future__ import annotations

import math

from virtual_irc5.rapid.rapid_library import Library, core_library

# Types and data of motion -------------------------------------------------------------------------------------------

_JOINTS = tuple(f"rax_{n}" for n in range(1, 7))
_EXTERNAL_AXES = tuple(f"eax_{axis}" for axis in "abcdef")
_NUM_TYPES = ("dionum", "intnum", "byte", "symnum", "tpnum", "opnum", "stoppointnum")

_RECORDS: dict[str, dict[str, str]] = {
    "pos": dict.fromkeys(("x", "y", "z"), "num"),
    "orient": dict.fromkeys(("q1", "q2", "q3", "q4"), "num"),
    "pose": {"trans": "pos", "rot": "orient"},
    "confdata": dict.fromkeys(("cf1", "cf4", "cf6", "cfx"), "num"),
    "robjoint": dict.fromkeys(_JOINTS, "num"),
    "extjoint": dict.fromkeys(_EXTERNAL_AXES, "num"),
    "robtarget": {"trans": "pos", "rot": "orient", "robconf": "confdata", "extax": "extjoint"},
    "jointtarget": {"robax": "robjoint", "extax": "extjoint"},
    "speeddata": dict.fromkeys(("v_tcp", "v_ori", "v_leax", "v_reax"), "num"),
    "zonedata": {
        "finep": "bool",
        **dict.fromkeys(("pzone_tcp", "pzone_ori", "pzone_eax", "zone_ori", "zone_leax", "zone_reax"), "num"),
    },
    "loaddata": {"mass": "num", "cog": "pos", "aom": "orient", "ix": "num", "iy": "num", "iz": "num"},
    "tooldata": {"robhold": "bool", "tframe": "pose", "tload": "loaddata"},
    "wobjdata": {"robhold": "bool", "ufprog": "bool", "ufmec": "string", "uframe": "pose", "oframe": "pose"},
}

_SPEEDS_MM_S = (
    *(5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500, 3000),
    *(4000, 5000, 6000, 7000),
)
_REORIENTATION_DEG_S, LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S = 500, 5000, 1000

# Radius around the point for path [mm], reorientation [mm] and [deg].
_ZONES_MM = {
    0: (0.3, 0.3, 0.03),
    1: (1, 1, 0.1),
    5: (5, 8, 0.8),
    10: (10, 15, 1.5),
    15: (15, 23, 2.3),
    20: (20, 30, 3),
    30: (30, 45, 4.5),
    40: (40, 60, 6),
    50: (50, 75, 7.5),
    60: (60, 90, 9),
    80: (80, 120, 12),
    100: (100, 150, 15),
    150: (150, 225, 23),
    200: (200, 300, 30),
}
_NO_POSE = ((0, 0, 0), (1, 0, 0, 0))
_LOAD0 = (0.001, (0, 0, 0.001), (1, 0, 0, 0), 0, 0, 0)
DATA = Library(core_library())
for _name in _NUM_TYPES:
    DATA.alias(_name, "num")
for _name, _components in _RECORDS.items():
    DATA.record(_name, _components)
DATA.record("taskid", {"taskname": "string"})
DATA.data("pi", "num", math.pi)
DATA.data("stEmpty", "string", "")
DATA.constants("dionum", "low=0 high edge")
DATA.constants("symnum", "OP_UNDEF=0 OP_AUTO OP_MAN_PROG OP_MAN_TEST")
# Technical reference manual, RAPID: data types: persistents of the system module BASE, which no program changes.
DATA.persistent("load0", "loaddata", _LOAD0)
DATA.persistent("tool0", "tooldata", (True, _NO_POSE, _LOAD0))
DATA.persistent("wobj0", "wobjdata", (False, True, "", _NO_POSE, _NO_POSE))
for _name, _speed in (*((f"v{each}", each) for each in _SPEEDS_MM_S), ("vmax", _SPEEDS_MM_S[-1])):
    DATA.data(_name, "speeddata", (_speed, _REORIENTATION_DEG_S, LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S))
DATA.data("fine", "zonedata", (True, 0, 0, 0, 0, 0, 0))
for _radius, (_path, _reorientation, _angle) in _ZONES_MM.items():
    _zone = (False, _path, _reorientation, _reorientation, _angle, _reorientation, _angle)
    DATA.data(f"z{_radius}", "zonedata", _zone)


# Constants that programs compare their values with, and types that are names for num or string ----------------------

for _name, _base in (
    *((name, "num") for name in ("opcalc", "errdomain", "errtype", "event_type", "handler_type", "exec_level")),
    *((name, "num") for name in ("tsp_status", "sensorstate", "loadidnum", "paridnum", "paridvalidnum", "aiotrigg")),
    *((name, "num") for name in ("supervtype", "triggmode", "tunegtype", "triggflag", "cnvcmd", "pathrecnum")),
    *((name, "num") for name in ("btnres", "buttondata", "icondata", "uishownum", "inttypes")),
    *(("stringdig", "string"), ("tasksatstart", "string")),
):
    DATA.alias(_name, _base)

for _type, _names in {
    "opnum": "LT=1 LTEQ EQ GT GTEQ NOTEQ",
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
}.items():
    DATA.constants(_type, _names)

# Speeds of external axes alone: rotating ones [deg/s], linear ones [mm/s].
for _speed in (1, 2, 5, 10, 20, 50, 100):
    DATA.data(f"vrot{_speed}", "speeddata", (0, 0, 0, _speed))
for _speed in (10, 20, 50, 100, 200, 500, 1000):
    DATA.data(f"vlin{_speed}", "speeddata", (0, 0, _speed, 0))
