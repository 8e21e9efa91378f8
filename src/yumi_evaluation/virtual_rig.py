"""Both ends of one arm's EGM in virtual time: a virtual arm, a link that may be tampered with, and our control loop.

It has no RAPID and no RWS, so that it is fast: what a controller, the limiter, the link and the robot's motion make of
a reference is there, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import radians

from yumi.clock import ManualClock
from yumi.control.controller import Controller, MemoryBuffer
from yumi.control.controller_manager import ControllerManager
from yumi.control.cycle import Cycle
from yumi.control.events import Event
from yumi.control.limiter import Limiter, SpeedScale
from yumi.control.loop import ArmLoop
from yumi.control.shared_state import Snapshot, read_snapshot
from yumi.driver.arm import EgmArm
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.codec import JointCodec
from yumi.egm.session import SILENCE, SensorSession
from yumi.egm.udp import memory_links
from yumi.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joint_names
from yumi.virtual.controller.egm import EgmClient, EgmOptions
from yumi.virtual.mechanics.arm import ArmModel, VirtualArm
from yumi.virtual.mechanics.motion import EgmActivation, EgmRun, ExternalMotionData

FULL_SPEED = EgmMotionSettings()
"""The thesis's table 4.3: 180 deg/s, no filter, raw."""

Wire = Callable[[bytes], Sequence[bytes]]
"""What becomes of a datagram on its way: itself, nothing, several, another one."""


class VirtualArmEnd:
    """The robot's end: one arm with its EGM client and what the state machine does to it.

    Args:
        side: which arm.
        model: its dynamics.
        options: what kind of controller it belongs to.
        position: where it stands at first [rad], (7,); home when left out.
    """

    def __init__(
        self,
        side: Side,
        model: ArmModel | None = None,
        options: EgmOptions | None = None,
        position: Joints | None = None,
    ) -> None:
        self.arm = VirtualArm(side, position, model)
        self.arm.switch_motors_on()
        self.egm = EgmClient(self.arm, options)

    def start(self, motion: EgmMotionSettings) -> None:
        """A session with ``motion``; one that is going on ends."""
        activation = EgmActivation(lp_filter=motion.lp_filter, max_speed_deviation=radians(motion.max_speed_deviation))
        self.egm.reset()
        self.egm.get_id()
        self.egm.setup(motion.comm_timeout, ExternalMotionData(level=int(motion.use_filtering), ramp_time=2.0))
        self.egm.activate(activation)
        self.egm.run_joint(
            EgmRun(cond_time=motion.cond_time, ramp_in_time=motion.ramp_in_time, pos_corr_gain=motion.pos_corr_gain)
        )

    def cycle(self, inbox: Sequence[bytes]) -> bytes | None:
        datagram = self.egm.cycle(inbox)
        self.arm.advance(CYCLE)
        return datagram


class VirtualArmRig:
    """A virtual arm and our control loop with some controllers; a reply arrives one cycle after its datagram.

    Args:
        controllers: by name; all are configured and none is active.
        side: which arm.
        limiter: of the control loop; one with the limits of the YuMi when left out.
        model: dynamics of the virtual arm.
        position: where it stands at first [rad], (7,); home when left out.
        speed: the factor on its speeds, which its controllers share.
        silence: EGM has ended for our end after this time without a datagram [s].

    Attributes:
        robot: the robot's end.
        manager: the controllers.
        clock: the time of everything.
        cycles: what our end did, cycle by cycle.
        events: what it reported.
        to_us, to_robot: the two directions of the link; a test may replace them.
    """

    def __init__(
        self,
        controllers: Mapping[str, Controller],
        *,
        side: Side = Side.LEFT,
        limiter: Limiter | None = None,
        model: ArmModel | None = None,
        position: Joints | None = None,
        speed: SpeedScale | None = None,
        silence: float = SILENCE,
    ) -> None:
        self.robot = VirtualArmEnd(side, model, position=position)
        self.clock = ManualClock(100.0)
        self.manager = ControllerManager(joint_names(side))
        self.cycles: list[Cycle] = []
        self.events: list[Event] = []
        self.to_us: Wire = lambda datagram: (datagram,)
        self.to_robot: Wire = lambda datagram: (datagram,)
        self._snapshots = MemoryBuffer[Snapshot]()
        for name, controller in controllers.items():
            self.manager.load(name, controller)
            self.manager.configure(name)
        self._near, self._far = memory_links()
        arm = EgmArm(self._near, SensorSession(JointCodec(), silence=silence))
        self.line = ArmLoop(side, arm, self.manager, limiter or Limiter(YUMI_LIMITS), self._snapshots, speed=speed)

    @property
    def snapshot(self) -> Snapshot:
        return read_snapshot(self._snapshots)

    def start(self, motion: EgmMotionSettings = FULL_SPEED) -> None:
        """Start EGM and wait until the robot follows."""
        self.robot.start(motion)
        self.run_until(lambda: self.snapshot.is_running, limit=1.0)

    def switch_to(self, name: str) -> None:
        """Let controller ``name`` command, and no other one."""
        commanding = [info.name for info in self.manager.controllers() if info.claimed]
        self.manager.switch((name,), commanding, self.line.state)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self.cycle()

    def run_until(self, condition: Callable[[], bool], limit: float) -> None:
        """Let time pass until the condition holds; fails after ``limit`` [s]."""
        for _ in range(round(limit / CYCLE)):
            if condition():
                return
            self.cycle()
        raise AssertionError(f"not within {limit} s: {self.robot.egm.fault}")

    def cycle(self) -> None:
        """One cycle of the robot, then of our end."""
        self.clock.advance(CYCLE)
        replies = [arriving for sent in self._far.receive() for arriving in self.to_robot(sent)]
        datagram = self.robot.cycle(replies)
        for arriving in self.to_us(datagram) if datagram is not None else ():
            self._far.send(arriving)
        while self._near.has_datagram:  # as the driver's poll says
            answered = self.line.run(self.clock.now())
            if answered is not None:
                self.cycles.append(answered)
        self.line.watch_silence(self.clock.now())
        self.events += self.line.take_events()
