"""What the arm tells the sensor in one datagram (reference/egm.md §3)."""

from __future__ import annotations

from yumi.egm.messages import MotorState, RapidState, RobotMessage
from yumi.robot.joints import Joints, Side
from yumi.robot.kinematics import compose, inverse, tool0_to_body
from yumi.robot.values import Pose
from yumi.virtual.arm import VirtualArm
from yumi.virtual.egm_options import RobotWare
from yumi.virtual.egm_session import EgmSession
from yumi.virtual.egm_settings import EgmActivation

FEEDBACK_AGE = 0.0045
"""How much older than its datagram a measured position is [s] (reference/egm.md §2.3)."""


def feedback(
    arm: VirtualArm,
    session: EgmSession,
    activation: EgmActivation,
    rapid: RapidState,
    *,
    now: float,
    robotware: RobotWare,
) -> RobotMessage:
    """The next datagram of ``session`` as a value, sent at controller time ``now`` [s]."""
    measured_time = now - FEEDBACK_AGE
    return RobotMessage(
        seqno=session.next_seqno(),
        sent_ms=int(now * 1000.0) % 2**32,
        measured=arm.position,
        planned=arm.planned,
        measured_pose=_tool_pose(arm.side, arm.position, activation),
        planned_pose=_tool_pose(arm.side, arm.planned, activation),
        measured_time=measured_time,
        planned_time=measured_time + arm.reaction_time,
        motors=MotorState.ON if arm.motors_on else MotorState.OFF,
        mci=session.mci,
        rapid=rapid,
        is_converged=session.is_in_band,
        utilization=_utilization(arm) if robotware is RobotWare.RW_6_10 else None,
    )


def _tool_pose(side: Side, position: Joints, activation: EgmActivation) -> Pose:
    pose = tool0_to_body(side, position, activation.tool)
    return pose if activation.wobj is None else compose(inverse(activation.wobj), pose)


def _utilization(arm: VirtualArm) -> float:
    return 0.0 if arm.egm is None else arm.egm.utilization
