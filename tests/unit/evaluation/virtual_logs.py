"""Logs of virtual robots with random parameters, noise and lost datagrams, for tests of identification."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, pi, radians

import numpy as np

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from virtual_irc5.mechanics.servo import follow_references
from yumi_evaluation.identification import Dynamics
from yumi_evaluation.logs import Array, RobotLog

HOME = np.radians([0.0, -60.0, 30.0, 20.0, 0.0, 40.0, 0.0])


@dataclass(frozen=True)
class VirtualRobot:
    """A robot as it is, which a log of it is to tell.

    Attributes:
        dynamics: with which it moves.
        noise: standard deviation of what it reports [rad].
        lost: fraction of its datagrams that do not arrive, and are not answered.
        unseen: fraction of the commands that are lost on their way, which no log shows.
        limits: highest speeds of its joints, inf where none [rad/s].
    """

    dynamics: Dynamics
    noise: float
    lost: float
    unseen: float = 0.0

    def log(self, commands: Array, random: np.random.Generator, name: str = "virtual") -> RobotLog:
        """What is recorded when it is sent ``commands`` [rad], (m, 7), one a cycle."""
        arrives = random.random(len(commands)) >= self.unseen
        arrives[0] = True
        settings = EgmMotionParameters(gain=self.dynamics.gain, bandwidth=0.0, max_speed=inf)
        seen = random.random(len(commands)) >= self.lost
        seen[:6] = True
        arrives &= seen  # what is lost is not answered either
        held = np.maximum.accumulate(np.where(arrives, np.arange(len(commands)), 0))
        references = [HOME, *commands[held][:-1]]
        answers = follow_references([tuple(each) for each in references], tuple(HOME), self.dynamics.model, settings)
        reported = np.array([each.measured for each in answers])
        reported += random.normal(0.0, self.noise, reported.shape)
        rows = np.flatnonzero(seen)
        sent = np.full_like(commands, np.nan)
        sent[rows] = commands[rows]
        names = tuple(f"joint_{number}" for number in range(1, 8))
        start = reported[:6].mean(axis=0)
        return RobotLog(name, "", names, CYCLE, rows.astype(float), reported[rows], sent, None, start)


def random_robot(random: np.random.Generator) -> VirtualRobot:
    model = ArmModel(
        limits=replace(YUMI_LIMITS, velocity=(radians(1e4),) * 7),
        reference_delay=float(random.uniform(0.0, 0.008)),
        delay=float(random.uniform(0.006, 0.024)),
        lag=float(random.uniform(0.004, 0.014)),
    )
    noise = radians(10.0 ** random.uniform(-4.0, -2.5))
    return VirtualRobot(Dynamics(float(random.uniform(2.5, 10.0)), model), noise, float(random.uniform(0.0, 0.03)))


def times(seconds: float) -> Array:
    return np.arange(round(seconds / CYCLE)) * CYCLE


def motions(random: np.random.Generator, speed_deg: float = 15.0) -> Array:
    """A ramp, a step and a sine of some joints, with rests between them [rad], (m, 7)."""
    time = times(9.0)
    moved = np.zeros((len(time), 7))
    for joint in random.choice(7, size=int(random.integers(1, 4)), replace=False):
        speed = radians(speed_deg) * random.uniform(0.5, 1.0)
        size = radians(random.uniform(1.5, 2.0))
        frequency = random.uniform(0.7, 1.5)
        ramp = speed * (np.clip(time - 0.2, 0.0, 1.5) - np.clip(time - 2.5, 0.0, 1.5))
        step = size * sum((time > begin) & (time < begin + 0.6) for begin in (4.2, 5.0, 5.8))
        sine = size * np.sin(2.0 * pi * frequency * np.clip(time - 6.5, 0.0, None)) * (time > 6.5)
        moved[:, joint] = random.choice((-1.0, 1.0)) * (ramp + step + sine)
    return HOME + moved
