"""The instructions a host builds on: what RAPID provides here, and the names of what RobotWare 6 base has besides.

Names of RobotWare's options are left out.
"""

from __future__ import annotations

from yumi.rapid.builtins.data import DATA, MATHS
from yumi.rapid.builtins.signals import SIGNALS
from yumi.rapid.builtins.strings import STRINGS
from yumi.rapid.builtins.system import SYSTEM
from yumi.rapid.library import Library

_INSTRUCTIONS = """
AccSet ActEventBuffer ActUnit Add AliasCamera AliasIO AliasIOReset BitClear BitSet BookErrNo BrakeCheck Break
CallByVar CancelLoad CheckProgRef CirPathMode Clear ClearIOBuff ClearPath ClearRawBytes ClkReset ClkStart ClkStop
Close CloseDir ConfJ ConfL CopyFile CopyRawBytes CornerPathWarning CorrClear CorrCon CorrDiscon CorrWrite CSSAct
CSSDeact CSSForceOffsetAct CSSForceOffsetDeact CSSOffsetTune CyclicBrakeCheck DeactEventBuffer DeactUnit Decr
DitherAct DitherDeact DropSensor EGMActJoint EGMActMove EGMActPose EGMGetId EGMMoveC EGMMoveL EGMReset EGMRunJoint
EGMRunPose EGMSetupAI EGMSetupAO EGMSetupGI EGMSetupLTAPP EGMSetupUC EGMStop EGMStreamStart EGMStreamStop
EGMWaitCond EOffsOff EOffsOn EOffsSet EraseModule ErrLog ErrRaise ErrWrite ExitCycle FitCircle FricIdEvaluate
FricIdInit FricIdSetFricLevels GetDataVal GetGroupSignalInfo GetJointData GetSysData GetTorqueMargin GetTrapData
GripLoad HollowWristReset IDelete IDisable IEnable IError Incr IndAMove IndCMove IndDMove IndReset IndRMove InvertDO
IOBusStart IOBusState IoCtrlAxis_RefSync IoCtrlAxis_RefSyncOff IoCtrlAxis_RefSyncOn IODisable IOEnable IPers
IRMQMessage ISignalAI ISignalAO ISignalDI ISignalDO ISignalGI ISignalGO ISleep ITimer IVarValue IWatch Load LoadId
MakeDir ManLoadIdProc MatrixSolve MatrixSolveQR MatrixSVD MechUnitLoad MotionProcessModeSet MotionSup MoveAbsJ MoveC
MoveCAO MoveCDO MoveCGO MoveCSync MoveExtJ MoveJ MoveJAO MoveJDO MoveJGO MoveJSync MoveL MoveLAO MoveLDO MoveLGO
MoveLSync MToolRotCalib MToolTCPCalib Open OpenDir PackDNHeader PackRawBytes PathAccLim PathLengthReset
PathLengthStart PathLengthStop PathRecMoveBwd PathRecMoveFwd PathRecStart PathRecStop PathResol PDispOff PDispOn
PDispSet ProcerrRecovery PrxActivAndStoreRecord PrxActivRecord PrxDbgStoreRecord PrxDeactRecord PrxResetPos
PrxResetRecords PrxSetPosOffset PrxSetRecordSampleTime PrxSetSyncalarm PrxStartRecord PrxStopRecord PrxStoreRecord
PrxUseFileRecord PulseDO RaiseToUser ReadAnyBin ReadBlock ReadCfgData ReadErrData ReadRawBytes ReadVarArr
RemoveAllCyclicBool RemoveCyclicBool RemoveDir RemoveFile RenameFile Reset ResetAxisDistance ResetAxisMoveTime
ResetPPMoved ResetRetryCount ResetTorqueMargin RestoPath Rewind RMQEmptyQueue RMQFindSlot RMQGetMessage
RMQGetMsgData RMQGetMsgHeader RMQReadWait RMQSendMessage RMQSendWait SafetyControllerSyncRequest Save SaveCfgData
SCWrite SearchC SearchExtJ SearchL SenDevice Set SetAllDataVal SetAO SetDataSearch SetDataVal SetDO SetGO
SetLeadThrough SetSysData SetupCyclicBool SiClose SiConnect SiGetCyclic SingArea SiSetCyclic SkipWarn SocketAccept
SocketBind SocketClose SocketConnect SocketCreate SocketListen SocketReceive SocketReceiveFrom SocketSend
SocketSendTo SoftAct SoftDeact SoftElbow SpeedLimAxis SpeedLimCheckPoint SpeedRefresh SpyStart SpyStop StartLoad
StartMove StartMoveRetry STCalib STClose StepBwdPath STIndGun STIndGunReset SToolRotCalib SToolTCPCalib Stop STOpen
StopMove StopMoveReset StorePath STTune STTuneReset SupSyncSensorOff SupSyncSensorOn SyncMoveOff SyncMoveOn
SyncMoveResume SyncMoveSuspend SyncMoveUndo SyncToSensor SystemStopAction TestSignDefine TestSignReset
TextTabInstall TPErase TPReadDnum TPReadFK TPReadNum TPShow TPWrite TriggAbsJ TriggC TriggCheckIO TriggDataCopy
TriggDataReset TriggEquip TriggInt TriggIO TriggJ TriggJIOs TriggL TriggLIOs TriggRampAO TriggSpeed TriggStopProc
TryInt TuneReset TuneServo UIMsgBox UIMsgWrite UIMsgWriteAbort UIShow UnLoad UnpackRawBytes VelSet WaitAI WaitAO
WaitDI WaitDO WaitGI WaitGO WaitLoad WaitRob WaitSensor WaitSyncTask WaitTestAndSet WaitTime WaitUntil WarmStart
WorldAccLim Write WriteAnyBin WriteBin WriteBlock WriteCfgData WriteRawBytes WriteStrBin WriteVar WriteVarArr
WZBoxDef WZCylDef WZDisable WZDOSet WZEnable WZFree WZHomeJointDef WZLimJointDef WZLimSup WZSphDef
"""
_FUNCTIONS = """
Abs AbsDnum ACos ACosDnum AInput AOutput ArgName ASin ASinDnum ATan ATan2 ATan2Dnum ATanDnum BitAnd BitAndDnum
BitCheck BitCheckDnum BitLSh BitLShDnum BitNeg BitNegDnum BitOr BitOrDnum BitRSh BitRShDnum BitXOr BitXOrDnum
ByteToStr CalcJointT CalcRobT CalcRotAxFrameZ CalcRotAxisFrame CDate CJointT ClkRead CorrRead Cos CosDnum CPos CRobT
CrossProd CSpeedOverride CTime CTool CWObj DecToHex DefAccFrame DefDFrame DefFrame Dim DInput Distance DnumToNum
DnumToStr DotProd DOutput EGMGetState EulerZYX EventType ExecHandler ExecLevel Exp FileSize FileTime FileTimeDnum
FSSize GetAxisDistance GetAxisMoveTime GetMaxNumberOfCyclicBool GetMecUnitName GetModalPayLoadMode GetMotorTorque
GetNextCyclicBool GetNextMechUnit GetNextSym GetNumberOfCyclicBool GetServiceInfo GetSignalOrigin GetSysInfo
GetTaskName GetTime GetTSPStatus GetUASUserName GInput GInputDnum GOutput GOutputDnum HexToDec IndInpos IndSpeed
IOUnitState IsBrakeCheckActive IsCyclicBool IsFile IsLeadThrough IsMechUnitActive IsPers IsStopMoveAct
IsStopStateEvent IsSyncMoveOn IsSysId IsVar Max MaxExtLinearSpeed MaxExtReorientSpeed MaxRobReorientSpeed
MaxRobSpeed Min MirPos ModExist ModTime ModTimeDnum MotionPlannerNo NonMotionMode NOrient NumToDnum NumToStr Offs
OpMode OrientZYX ORobT ParIdPosValid ParIdRobValid PathLengthGet PathLevel PathRecValidBwd PathRecValidFwd PFRestart
PoseInv PoseMult PoseVect Pow PowDnum PPMovedInManMode Present ProgMemFree PrxGetMaxRecordpos RawBytesLen ReadBin
ReadDir ReadMotor ReadNum ReadStr ReadStrBin ReadVar RelTool RemainingRetries RMQGetSlotName RobName RobOS Round
RoundDnum RunMode SafetyControllerGetChecksum SafetyControllerGetOpModePinCode SafetyControllerGetSWVersion
SafetyControllerGetUserChecksum Sin SinDnum SocketGetStatus SocketPeek Sqrt SqrtDnum STCalcForce STCalcTorque
STIsCalib STIsClosed STIsIndGun STIsOpen StrDigCalc StrDigCmp StrFind StrLen StrMap StrMatch StrMemb StrOrder
StrPart StrToByte StrToVal Tan TanDnum TaskIsActive TaskIsExecuting TaskRunMec TaskRunRob TasksInSync TestAndSet
TestDI TestSignRead TextGet TextTabFreeToUse TextTabGet TriggDataValid Trunc TruncDnum Type UIAlphaEntry
UIClientExist UIDnumEntry UIDnumTune UIListView UIMessageBox UINumEntry UINumTune ValidIO ValToStr Vectmagn
"""
INSTRUCTIONS = tuple(_INSTRUCTIONS.split())
FUNCTIONS = tuple(_FUNCTIONS.split())


STANDARD = Library(DATA)
for _part in (MATHS, STRINGS, SIGNALS, SYSTEM):
    STANDARD.include(_part)
STANDARD.missing(*INSTRUCTIONS, *FUNCTIONS)  # except those that are provided


class InstructionSet(Library):
    """The names every module of a task sees: RAPID's own, and what the host registers on top of them."""

    def __init__(self, base: Library = STANDARD) -> None:
        super().__init__(base)
