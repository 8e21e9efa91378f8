"""Instructions and functions of options that this controller does not have, which programs may use all the same.

Those that need a device fail as where it does not answer or is not set up, so that error handlers are tried; those that
change nothing here are executed and nothing happens.
"""

from __future__ import annotations

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.rapid_library import Library

OPTIONS = Library(DATA)

OPTIONS.record("sensor", {"id": "num", "error": "num", "state": "sensorstate"})

# The FlexPendant, diagnostics, brakes.
for _name, _signature in (
    ("TPShow", "tpnum Window"),
    ("BrakeCheck", ""),
    ("CyclicBrakeCheck", ""),
    ("ResetTorqueMargin", ""),
    ("HollowWristReset", ""),
):
    OPTIONS.accepted(_name, _signature)

OPTIONS.refused(
    "UIShow",
    r"string AssemblyName, string TypeName, \string InitCmd, \VAR uishownum InstanceID, \VAR num Status, "
    r"\switch NoCloseBtn",
    "ERR_UISHOW_FATAL",
    "there is no FlexPendant on which an application could run.",
)

# Sensor Interface.
_NO_SENSOR = "no sensor is connected to this controller."
for _name, _signature in (
    ("SiConnect", r"INOUT sensor Sensor, \switch NoStop"),
    ("SiClose", "INOUT sensor Sensor"),
    ("SiGetCyclic", "INOUT sensor Sensor, anytype Data, num Rate"),
    ("SiSetCyclic", "INOUT sensor Sensor, anytype Data, num Rate"),
    ("SenDevice", "string device"),
    ("ReadBlock", r"string device, num BlockNo, string FileName, \num TaskName"),
    ("WriteBlock", r"string device, num BlockNo, string FileName, \num TaskName"),
    ("WriteVar", r"string device, num VarNo, num VarData, \num TaskName"),
    (
        "IVarValue",
        r"string device, num VarNo, INOUT num Value, VAR intnum Interrupt, \num Unit, \num DeadBand, "
        r"\switch ReportAtTool",
    ),
):
    OPTIONS.refused(_name, _signature, "ERR_COMM_INIT", _NO_SENSOR)
OPTIONS.refused("ReadVar", r"string device, num VarNo, \num TaskName", "ERR_COMM_INIT", _NO_SENSOR, "num")

# Servo tools.
_NO_GUN = "no servo tool is defined on this controller."
for _name, _signature in (
    ("STOpen", r"string ToolName, \switch WaitZeroSpeed, \switch Conc"),
    ("STClose", r"string ToolName, num TipForce, num Thickness, \VAR num RetThickness, \switch Conc"),
    ("STCalib", r"string ToolName, \switch ToolChg | \switch TipChg | \switch TipWear, \VAR num RetTipWear"),
    ("STIndGun", "string ToolName, num GunPos"),
    ("STIndGunReset", "string ToolName"),
    ("STTune", r"anytype MecUnit, num TuneValue, num Type"),
    ("STTuneReset", "anytype MecUnit"),
):
    OPTIONS.refused(_name, _signature, "ERR_NO_SGUN", _NO_GUN)
for _name, _signature, _returns in (
    ("STCalcForce", "string ToolName, num MotorTorque", "num"),
    ("STCalcTorque", "string ToolName, num TipForce", "num"),
    ("STIsCalib", r"string ToolName, \switch sguninit | \switch sgunsynch", "bool"),
    ("STIsClosed", r"string ToolName, \VAR num RetThickness", "bool"),
    ("STIsIndGun", "string ToolName", "bool"),
    ("STIsOpen", r"string ToolName, \VAR num RetTipWear, \VAR num RetThickness", "bool"),
):
    OPTIONS.refused(_name, _signature, "ERR_NO_SGUN", _NO_GUN, _returns)

# Cameras: they answer as one that is not connected does.
OPTIONS.object_type("cameradev", object)
OPTIONS.record(
    "cameratarget",
    {
        "name": "string",
        "cframe": "pose",
        **{f"val{number}": "num" for number in range(1, 6)},
        "string1": "string",
        "string2": "string",
        "type": "num",
        "cameraname": "string",
        "sceneid": "num",
    },
)
_NO_CAMERA = "ERR_CAM_COM_TIMEOUT", "no camera is connected to this controller."
OPTIONS.refused("AliasCamera", "string CameraName, string CameraAlias", "ERR_NAME_INVALID", _NO_CAMERA[1])
for _name, _signature in (
    ("CamFlush", ""),
    ("CamGetParameter", r", string ParName, \VAR num NumVar | \VAR bool BoolVar | \VAR string StrVar"),
    ("CamGetResult", r", INOUT cameratarget CamTarget, \num SceneId, \num MaxTime"),
    ("CamLoadJob", r", string JobName, \switch KeepTargets, \num MaxTime"),
    ("CamReqImage", r", \num SceneId, \switch KeepTargets, \switch AwaitComplete"),
    ("CamSetExposure", r", \num ExposureTime, \num Brightness, \num Contrast"),
    ("CamSetParameter", r", string ParName, \num NumVal | \bool BoolVal | \string StrVal"),
    ("CamSetProgramMode", ""),
    ("CamSetRunMode", ""),
    ("CamStartLoadJob", r", string Name, \switch KeepTargets"),
    ("CamWaitLoadJob", ""),
):
    OPTIONS.refused(_name, f"VAR cameradev Camera{_signature}", *_NO_CAMERA)
for _name, _signature, _returns in (
    ("CamGetExposure", r", \switch ExposureTime | \switch Brightness | \switch Contrast", "num"),
    ("CamGetLoadedJob", "", "string"),
    ("CamGetMode", "", "num"),
    ("CamGetName", "", "string"),
    ("CamNumberOfResults", r", \num SceneId", "num"),
):
    OPTIONS.refused(_name, f"VAR cameradev Camera{_signature}", *_NO_CAMERA, _returns)

# Axes and movements of robots this one is not.
_MOVED = r"anytype MecUnit, num Axis, num Position, num Speed, \num Ramp"
_REFERENCE = r"\num RefPos | \num RefNum, \switch Short | \switch Fwd | \switch Bwd"
_NOT_INDEPENDENT = "no axis of this robot can be independent."
for _name, _signature in (
    ("IndAMove", _MOVED),
    ("IndDMove", _MOVED),
    ("IndRMove", r"anytype MecUnit, num Axis, \num ToRelPos | \num ToRelNum | \num ToRelDelta, num Speed"),
    ("IndCMove", r"anytype MecUnit, num Axis, num Speed, \num Ramp"),
    ("IndReset", rf"anytype MecUnit, num Axis, {_REFERENCE}"),
):
    OPTIONS.refused(_name, _signature, "ERR_AXIS_IND", _NOT_INDEPENDENT)
for _name, _signature in (
    ("IndInpos", "anytype MecUnit, num Axis"),
    ("IndSpeed", r"anytype MecUnit, num Axis, \switch InPos"),
):
    OPTIONS.refused(_name, _signature, "ERR_AXIS_IND", _NOT_INDEPENDENT, "bool")
for _name in ("SupSyncSensorOn", "SupSyncSensorOff", "SyncToSensor", "WaitSensor", "DropSensor"):
    _signature = r"anytype MechUnit, \num RelDist, \num PredTime, \num MaxSync, \switch On | \switch Off"
    OPTIONS.refused(_name, _signature, "ERR_CNV_NOT_ACT", "no sensor or conveyor is active.")
for _name in ("FricIdInit", "FricIdEvaluate", "FricIdSetFricLevels"):
    _signature = "" if _name == "FricIdInit" else "anytype FricLevels"
    OPTIONS.refused(_name, _signature, "ERR_FRICTUNE_FATAL", "the friction of this robot cannot be identified.")
for _name in ("SafetyControllerGetChecksum", "SafetyControllerGetSWVersion", "SafetyControllerGetUserChecksum"):
    OPTIONS.refused(_name, "", "ERR_NOTPRES", "this controller has no safety controller.", "string")
OPTIONS.refused("SafetyControllerGetOpModePinCode", "", "ERR_NOTPRES", "it has no safety controller.", "string")
OPTIONS.refused("SafetyControllerSyncRequest", "", "ERR_NOTPRES", "this controller has no safety controller.")
OPTIONS.refused("SCWrite", r"\string ToNode, anytype Variable", "ERR_SC_WRITE", "no superior computer is connected.")
