"""What RAPID tells EGM before it runs, in SI units and chain order (reference/egm.md §5, §6.3)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import radians

from yumi.robot.values import Pose

Band = tuple[float, float]
"""``egm_minmax``: lowest and highest difference from the ordered position that counts as arrived [rad]."""

Bands = tuple[Band, Band, Band, Band, Band, Band, Band]
Axes = tuple[bool, bool, bool, bool, bool, bool, bool]
ALL_AXES: Axes = (True, True, True, True, True, True, True)


class StopMode(Enum):
    """``egmstopmode``: what the arm does when EGM ends."""

    HOLD = 0
    RAMP_DOWN = 1


def same_band(low: float, high: float) -> Bands:
    """One convergence band [rad] for all seven joints."""
    band = (low, high)
    return (band, band, band, band, band, band, band)


DEFAULT_BANDS = same_band(radians(-0.5), radians(0.5))


@dataclass(frozen=True, slots=True)
class ExternalMotionData:
    """The system parameters EXT_MOTION_DATA that EGMSetupUC names (reference/egm.md §6.3).

    Attributes:
        level: 0 raw; 1 filtering, which adds delay.
        position_gain: default proportional position gain [1/s], 0 to 20.
        bandwidth: default low-pass bandwidth [Hz], 0 to 100.
        ramp_time: time in which EGM's speed goes to zero when the program stops [s].
        restarts_after_motors_off: whether an interrupted run goes on when motors and program are on again.
    """

    level: int = 1
    position_gain: float = 5.0
    bandwidth: float = 20.0
    ramp_time: float = 0.5
    restarts_after_motors_off: bool = True


@dataclass(frozen=True, slots=True)
class EgmActivation:
    """The arguments of EGMActJoint; defaults are ABB's.

    Attributes:
        tool: tool frame in tool0, for the poses the robot sends; None is tool0.
        wobj: work object in the world, in which those poses are given; None is the world.
        cond_min_max: convergence band of each joint [rad], (7,) in chain order.
        lp_filter: low-pass bandwidth [Hz]; 0 switches it off, None takes the configured one.
        sample_rate_ms: period of the datagrams in multiples of 4 ms, which stand for cycles of 4.032 ms.
        max_pos_deviation: how far any joint may go from where EGM started [rad].
        max_speed_deviation: highest joint speed EGM may ask for [rad/s].
    """

    tool: Pose | None = None
    wobj: Pose | None = None
    cond_min_max: Bands = DEFAULT_BANDS
    lp_filter: float | None = None
    sample_rate_ms: int = 4
    max_pos_deviation: float = radians(1000.0)
    max_speed_deviation: float = radians(1.0)


@dataclass(frozen=True, slots=True)
class EgmRun:
    """The arguments of EGMRunJoint; defaults are ABB's, where published.

    Attributes:
        stop_mode: what the arm does after convergence.
        axes: joints that have to converge (switches J1 to J7), (7,) in chain order.
        cond_time: how long they have to stay in their bands [s].
        ramp_in_time: time in which EGM's contribution grows from nothing to all [s].
        ramp_out_time: time of the way back with RAMP_DOWN [s].
        pos_corr_gain: share of the position gain in use; 0 is pure velocity control.
        is_waited: whether RAPID waits for the end; False with NoWaitCond, when a silent sensor stops the program.
    """

    stop_mode: StopMode = StopMode.HOLD
    axes: Axes = ALL_AXES
    cond_time: float = 1.0
    ramp_in_time: float = 0.0
    ramp_out_time: float = 1.0
    pos_corr_gain: float = 1.0
    is_waited: bool = True


@dataclass(frozen=True, slots=True)
class EgmSettings:
    """What the control law needs of all that.

    Attributes:
        gain: k of the law, PosCorrGain times the default position gain [1/s].
        bandwidth: of the low-pass on the speed [Hz]; 0 is none.
        ramp_in_time: [s].
        max_speed: MaxSpeedDeviation [rad/s].
        max_deviation: MaxPosDeviation [rad].
        level: 0 raw, 1 filtering.
    """

    gain: float = 5.0
    bandwidth: float = 20.0
    ramp_in_time: float = 0.0
    max_speed: float = radians(1.0)
    max_deviation: float = radians(1000.0)
    level: int = 0


def law_settings(data: ExternalMotionData, activation: EgmActivation, run: EgmRun) -> EgmSettings:
    """Join configuration, activation and run into the settings of the control law."""
    bandwidth = data.bandwidth if activation.lp_filter is None else activation.lp_filter
    return EgmSettings(
        gain=run.pos_corr_gain * data.position_gain,
        bandwidth=bandwidth,
        ramp_in_time=run.ramp_in_time,
        max_speed=activation.max_speed_deviation,
        max_deviation=activation.max_pos_deviation,
        level=data.level,
    )
