"""A limiter whose robot reports what a test says: in datagrams, by the calls that the control loop makes."""

from __future__ import annotations

from math import degrees, inf, radians

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.robot.joints import CYCLE, ArmCommand, ArmState, Joints, joints
from abb_runtime.udp import memory_links
from yumi.control.limiter import Limiter
from yumi.control.limiter_state import LimiterEvent
from yumi.core.library import load
from yumi.driver.egm_arm import EgmArm
from yumi.egm.egm_session import Session

_EVER = 1e9  # [s] no session ends for its silence


class _Datagrams:
    """A robot's, with positions in full precision: a real one rounds them to single."""

    def __init__(self) -> None:
        self._message = pb.EgmRobot()
        self._message.header.mtype = pb.EgmHeader.MSGTYPE_DATA
        self._message.motorState.state = pb.EgmMotorState.MOTORS_ON
        self._message.mciState.state = pb.EgmMCIState.MCI_RUNNING

    def encode(self, seqno: int, microseconds: int, state: ArmState) -> bytes:
        robot = self._message
        robot.header.seqno = seqno
        for part, position in ((robot.feedBack, state.position), (robot.planned, state.planned)):
            a1, a2, a7, *others = map(degrees, position)
            part.joints.joints[:], part.externalJoints.joints[:] = [a1, a2, *others], [a7]
            part.time.sec, part.time.usec = divmod(microseconds, 1_000_000)
        states = pb.EgmRapidCtrlExecState
        robot.rapidExecState.state = states.RAPID_RUNNING if state.is_running else states.RAPID_STOPPED
        return robot.SerializeToString()


class ReportedLimiter(Limiter):
    """Arguments as of :class:`.Limiter`.

    A robot reports whole microseconds, positions whose last digit degrees have rounded, and no speed but that of its
    positions. It begins with a time of 0, and so it does after a silence: with a state whose ``dt`` is 0.
    """

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        ours, self._robot = memory_links()
        self._session, self._datagrams = Session(_EVER), _Datagrams()
        self._arm = EgmArm(ours, self._session, self)
        self._number, self._seqno, self._microseconds = 0, 0, 0
        self._checked: ArmState | None = None  # what is to be answered

    def check(self, state: ArmState) -> ArmState | None:
        """What the limiter makes of a state; None where no reply is safe."""
        passed = round(1e6 * state.dt)
        if state.session != self._number:
            self._number, self._seqno, passed = state.session, 0, max(passed, 1_000_000)
        elif passed <= 0:
            self._session.close_if_silent(inf)
            passed = round(1e6 * CYCLE)
        self._microseconds += passed
        self._robot.send(self._datagrams.encode(self._seqno, self._microseconds, state))
        self._seqno += 1
        self._checked = self._arm.receive(state.time)
        return self._checked

    def limit(self, state: ArmState, desired: ArmCommand | None) -> ArmCommand:
        """What answers ``state``, which is checked first where that was not done; else the command before counts on."""
        if self._checked is None and self.check(state) is None:
            return self.sent()
        sent, self._checked = self._arm.reply(desired), None
        assert sent is not None
        self._robot.receive()
        return sent

    def observe(self, state: ArmState) -> None:
        """After the reply to ``state``."""
        self._arm.settle(state)

    def go(self, event: LimiterEvent) -> None:
        """An event, by the call for those that come without a datagram."""
        self.done(load().limiter_lose(self.handle, event))


def reportable(position: Joints) -> Joints:
    """The position next to this one that comes through a datagram as it is."""
    for _ in range(3):
        position = joints([radians(degrees(each)) for each in position])
    return position
