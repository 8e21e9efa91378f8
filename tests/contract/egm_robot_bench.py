"""A left arm with its EGM client, in virtual time, and datagrams as any sensor may build them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import degrees, radians

from state_machine_bench import Bench

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import RobotMessage, SensorCodec
from abb_protocols.robot.joints import Joints, Side, abb_from_chain, home
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_client import EgmClient, EgmOptions
from virtual_irc5.mechanics.egm_motion import EgmActivation, EgmRun, ExternalMotionData

HOME = home(Side.LEFT)
RAW = ExternalMotionData(level=0)
FULL_SPEED = EgmActivation(lp_filter=0.0, max_speed_deviation=radians(400.0))
KEEP_ALIVE = pb.EgmSensor(header=pb.EgmHeader(seqno=1, mtype=pb.EgmHeader.MSGTYPE_CORRECTION)).SerializeToString()

Answer = Callable[[RobotMessage], Sequence[bytes]]


def turned(index: int, by: float) -> Joints:
    """Home with one joint turned [rad]."""
    return tuple(value + (by if index == at else 0.0) for at, value in enumerate(HOME))


def speed(index: int, value: float) -> Joints:
    return tuple(value if index == at else 0.0 for at in range(7))


def sensor(position: Joints | None = None, velocity: Joints | None = None) -> pb.EgmSensor:
    """A sensor's message without a header; chain order [rad], [rad/s]."""
    message = pb.EgmSensor()
    for part, values in ((message.planned, position), (message.speedRef, velocity)):
        if values is not None:
            robax, eax_a = abb_from_chain(values)
            part.joints.joints.extend(degrees(value) for value in robax)
            part.externalJoints.joints.append(degrees(eax_a))
    return message


def order(position: Joints | None = None, velocity: Joints | None = None) -> bytes:
    return sensor(position, velocity).SerializeToString()


def always(datagram: bytes) -> Answer:
    return lambda _: (datagram,)


def call_by_name(robot: Bench, name: str, body: str) -> None:
    """Let the state machine of the left arm call a procedure that consists of ``body``."""
    task = robot.controller.tasks[Side.LEFT.task]
    declarations = "VAR egmident egm; CONST pose frame := [[0,0,0],[1,0,0,0]];"
    task.load(f"MODULE {name}\n{declarations}\nPROC {name}0()\n{body}\nENDPROC\nENDMODULE", f"{name}.mod")
    task.write("TRobRAPID", "callbyvar_name_input", f'"{name}"')
    task.write("TRobRAPID", "routine_name_input", '"runCallByVar"')
    robot.pulse("RUN_RAPID_ROUTINE")


@dataclass
class RobotBench:
    """The arm, and what it sent: as bytes, as protobuf, as values."""

    options: EgmOptions = field(default_factory=EgmOptions)
    model: ArmModel = field(default_factory=ArmModel)

    def __post_init__(self) -> None:
        self.arm = VirtualArm(Side.LEFT, model=self.model)
        self.arm.switch_motors_on()
        self.egm = EgmClient(self.arm, self.options)
        self.raw: list[bytes] = []
        self.sent: list[RobotMessage] = []
        self._codec = SensorCodec()

    def prepare(
        self,
        activation: EgmActivation = FULL_SPEED,
        *,
        comm_timeout: float = 1.0,
        data: ExternalMotionData = RAW,
    ) -> RobotBench:
        """EGMGetId, EGMSetupUC, EGMActJoint."""
        self.egm.get_id()
        self.egm.setup(comm_timeout, data)
        self.egm.activate(activation)
        return self

    def run(self, **arguments: object) -> RobotBench:
        """EGMRunJoint, for as long as it takes unless the arguments say otherwise."""
        self.egm.run_joint(EgmRun(**{"cond_time": 1000.0, **arguments}))
        return self

    def cycle(self, *inbox: bytes) -> RobotMessage | None:
        datagram = self.egm.cycle(inbox)
        self.arm.advance(self.options.cycle_time)
        if datagram is None:
            return None
        self.raw.append(datagram)
        self.sent.append(self._codec.decode(datagram))
        return self.sent[-1]

    def pass_time(self, seconds: float, answer: Answer | None = None) -> RobotBench:
        """Let time pass; ``answer`` gives what arrives a cycle after each datagram, nothing when left out."""
        inbox: Sequence[bytes] = ()
        for _ in range(round(seconds / self.options.cycle_time)):
            message = self.cycle(*inbox)
            inbox = answer(message) if message is not None and answer is not None else ()
        return self

    @property
    def last(self) -> pb.EgmRobot:
        """The newest datagram with all its protobuf fields."""
        return pb.EgmRobot.FromString(self.raw[-1])
