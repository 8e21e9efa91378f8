"""Robots on loopback for tests of the EGM server: ABB's law played by the virtual arm, or one that obeys at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import radians
from threading import Event, Thread

from abb_protocols.egm.codec import MciState, MotorState, Pose, RapidState, RobotCodec, RobotMessage, SensorMessage
from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.udp import Poller, UdpClient
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.egm_client import EgmClient
from virtual_irc5.mechanics.egm_motion import EgmActivation, EgmRun

SIX = (0.1, -0.2, 0.3, 0.0, 0.5, 0.0)
MESSAGE = RobotMessage(
    seqno=0,
    sent_ms=1000,
    measured=SIX,
    planned=SIX,
    measured_pose=Pose((0.5, 0.1, 0.7), (1.0, 0.0, 0.0, 0.0)),
    planned_pose=None,
    measured_time=100.0,
    planned_time=None,
    motors=MotorState.ON,
    mci=MciState.RUNNING,
    rapid=RapidState.RUNNING,
    is_converged=False,
)

Cycle = Callable[[Sequence[bytes]], bytes | None]
"""One cycle of a robot: takes what was answered, gives what it sends."""


class ObedientRobot:
    """A six-axis robot that is at once where it is told to be.

    Attributes:
        heard: everything it was told.
        poses: where its tool has been.
    """

    def __init__(self, message: RobotMessage = MESSAGE) -> None:
        self.heard: list[SensorMessage] = []
        self.poses: list[Pose] = []
        self._codec = RobotCodec(axes=len(message.measured))
        self._message = message

    def cycle(self, inbox: Sequence[bytes]) -> bytes:
        for datagram in inbox:
            told = self._codec.decode(datagram)
            self.heard.append(told)
            if told.tool_position is not None and told.tool_orientation is not None:
                self._message = replace(self._message, measured_pose=Pose(told.tool_position, told.tool_orientation))
        datagram = self._codec.encode(self._message)
        assert self._message.measured_pose is not None
        self.poses.append(self._message.measured_pose)
        time = self._message.measured_time + CYCLE
        self._message = replace(self._message, seqno=self._message.seqno + 1, measured_time=time)
        return datagram


class VirtualArmRig:
    """A virtual YuMi arm under EGM."""

    def __init__(self, run: EgmRun | None) -> None:
        self.arm = VirtualArm(Side.LEFT)
        self.arm.switch_motors_on()
        self.reached: list[float] = []
        self._egm = EgmClient(self.arm)
        self._egm.get_id()
        self._egm.setup(comm_timeout=10.0)
        self._egm.activate(EgmActivation(max_speed_deviation=radians(100.0)))
        if run is None:
            self._egm.stream_start()
        else:
            self._egm.run_joint(run)

    def cycle(self, inbox: Sequence[bytes]) -> bytes | None:
        datagram = self._egm.cycle(inbox)
        self.arm.advance(CYCLE)
        self.reached.append(self.arm.position[-1])
        return datagram


class Wired:
    """Runs a robot's cycles in a thread: each waits for the answer, at most ``patience`` [s]."""

    def __init__(self, port: int, cycle: Cycle, *, patience: float = 0.5) -> None:
        self._link = UdpClient("127.0.0.1", port)
        self._cycle = cycle
        self._patience = patience
        self._inbox: list[bytes] = []
        self._poller = Poller()
        self._poller.watch(self._link, lambda: self._inbox.extend(self._link.receive()))
        self._is_over = Event()
        self._thread = Thread(target=self._run, name="robot")

    def __enter__(self) -> Wired:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()
        self._poller.close()
        self._link.close()

    def _run(self) -> None:
        while not self._is_over.is_set():
            inbox = self._inbox.copy()
            self._inbox.clear()
            datagram = self._cycle(inbox)
            if datagram is not None:
                self._link.send(datagram)
            self._poller.wait(self._patience)
        self._cycle(self._inbox)  # the last answer counts too
