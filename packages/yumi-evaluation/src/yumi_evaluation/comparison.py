"""Comparison: logs of robots beside the virtual robot that is sent the same commands, with what is identified of them.

Rows in which joints are limited, slower than the loop asks of them, are compared apart: a loop that is not limited says
nothing of them. For those rows the report has how far one factor on the change of speed of all joints explains them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import degrees, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from abb_protocols.catalogue import Message, clause
from abb_protocols.robot.joints import CHAIN_AXES, JOINT_COUNT, JointLimits
from virtual_irc5.mechanics.arm_motion import ARM_MODELS
from virtual_irc5.mechanics.egm_parameters import EgmParameters, write_egm_parameters
from yumi_evaluation.identification import (
    Dynamics,
    Estimate,
    Identified,
    Mask,
    answer,
    first_comparable,
    identify,
    limited,
    limited_speeds,
    shown,
)
from yumi_evaluation.logs import Array, Logs, RobotLog

YUMI = "YuMi"
"""Whose parameters count where a log does not say whose it is."""

_ALIKE = 1.3  # times its own best: the virtual robot moves as the log says
_VISIBLE_DEG = 0.01  # a difference below this is none


@dataclass(frozen=True, slots=True)
class LimitedPart:
    """Rows in which joints are slower than they are asked to be, and those until the arm has caught up.

    Attributes:
        first_row: the first of them, as the log counts.
        rows: how many.
        joints: the joints.
        rms_deg: of the virtual robot [°].
        explained: fraction of the changes of speed that one factor for all joints explains; None where nothing changes.
    """

    first_row: int
    rows: int
    joints: tuple[str, ...]
    rms_deg: float
    explained: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """A motion beside the virtual robot's.

    Attributes:
        log: the motion.
        reported: by the virtual robot [rad], (n, k).
        is_free: rows in which no joint is limited, (n,).
        rms_deg: of those rows; None where there are none [°].
        joints_deg: the same of each joint [°], (k,).
        fitted_deg: with the identified parameters [°].
        limited: the others; None where there are none.
    """

    log: RobotLog
    reported: Array
    is_free: Mask
    rms_deg: float | None
    joints_deg: tuple[float, ...]
    fitted_deg: float | None
    limited: LimitedPart | None


@dataclass(frozen=True, slots=True)
class ComparedRobot:
    """What the records of a robot say.

    Attributes:
        name: of the robot.
        used: whose parameters the virtual robot had.
        dynamics: those.
        identified: what the records say.
        records: its records.
    """

    name: str
    used: str
    dynamics: Dynamics
    identified: Identified
    records: tuple[Record, ...]

    @property
    def verdict(self) -> str:
        """One sentence: whether the virtual robot moves so, and what to do when it does not."""
        now, best = (_mean(getattr(each, name) for each in self.records) for name in ("rms_deg", "fitted_deg"))
        reason = self.identified.lag.reason
        if reason is not None and reason.code == "no_joint_moves":
            return f"No joint of the {self.name} moves in the log: nothing can be said of how it follows."
        if now is None or best is None:
            return f"Every row of the {self.name} is limited: record a slower motion to compare."
        if now <= max(_ALIKE * best, _VISIBLE_DEG):
            return f"The virtual robot moves as the {self.name} does: {now:.2g}° rms."
        return (
            f"The virtual robot differs from the {self.name} by {now:.2g}° rms, with the fitted parameters by "
            f"{best:.2g}°: start it with the settings file."
        )

    @property
    def parameters(self) -> EgmParameters:
        """What is identified, for the virtual controller; the rest is as the virtual robot had it."""
        found, limits = self.identified, self.identified.limits
        model = found.dynamics.model
        axes = CHAIN_AXES if len(limits) == JOINT_COUNT else range(1, len(limits) + 1)
        return EgmParameters(
            found.dynamics.gain,
            model.reference_delay,
            model.delay,
            model.lag,
            {axis: each.value for axis, each in zip(axes, limits, strict=True) if each.value is not None},
        )


@dataclass(frozen=True, slots=True)
class Comparison:
    """A log beside the virtual robot.

    Attributes:
        robots: of the log.
        left_out: a sentence for each part of the log that was not read.
    """

    robots: tuple[ComparedRobot, ...]
    left_out: tuple[str, ...]


def dynamics_of(log: RobotLog, gain: float, bandwidth: float | None) -> tuple[str, Dynamics]:
    """Whose parameters the virtual robot has beside a log, and those.

    Args:
        log: the log.
        gain: k [1/s].
        bandwidth: of EGM's low-pass filter [Hz]; None is what the log says.
    """
    used = log.robot if log.robot in ARM_MODELS else YUMI
    model, count = ARM_MODELS[used], len(log.joints)
    if len(model.limits.velocity) != count:
        model = replace(model, limits=JointLimits.unlimited(count))
    return used, Dynamics(gain, model, log.bandwidth if bandwidth is None else bandwidth)


def compare(
    logs: Logs, gain: float, bandwidth: float | None = None, tick: Callable[[], None] = lambda: None
) -> Comparison:
    """Run the virtual robot with the commands of each motion, and identify each robot.

    Args:
        logs: the motions.
        gain: k with which they were made [1/s].
        bandwidth: of EGM's low-pass filter [Hz]; None is what each log says.
        tick: called with each run of the virtual robot.
    """
    of_robots: dict[tuple[str, int], list[RobotLog]] = {}
    for log in logs.motions:
        of_robots.setdefault((log.robot or YUMI, len(log.joints)), []).append(log)
    robots = []
    for (name, _), motions in of_robots.items():
        used, dynamics = dynamics_of(motions[0], gain, bandwidth)
        identified = identify(motions, dynamics, tick)
        records = []
        for log in motions:
            tick()
            records.append(_record(log, dynamics, identified.dynamics))
        robots.append(ComparedRobot(name, used, dynamics, identified, tuple(records)))
    return Comparison(tuple(robots), logs.left_out)


def _record(log: RobotLog, dynamics: Dynamics, fitted: Dynamics) -> Record:
    reported, best = answer(log, dynamics), answer(log, fitted)
    late = limited(log, fitted)
    is_late: Mask = np.asarray(late.any(axis=1))
    if is_late.any():
        # An arm that was too slow has more to catch up than any other: until its loop has forgotten that.
        times = log.times
        last = np.maximum.accumulate(np.where(is_late, times, -np.inf))
        is_late = times - last < _MEMORY / fitted.gain
    difference = np.degrees(reported - log.measured)
    is_free = ~is_late & (log.rows >= first_comparable(log))
    part = None
    if is_late.any():
        part = LimitedPart(
            int(log.rows[is_late][0]),
            int(is_late.sum()),
            tuple(name for name, own in zip(log.joints, late.T, strict=True) if own.any()),
            _rms(difference[is_late]) or 0.0,
            _explained(log, fitted, is_late),
        )
    return Record(
        log,
        reported,
        is_free,
        _rms(difference[is_free]),
        tuple(_rms(own[is_free]) or 0.0 for own in difference.T),
        _rms(np.degrees(best - log.measured)[is_free]),
        part,
    )


_MEMORY = 3.0  # times 1/k: an error of the beginning has become a twentieth


def _explained(log: RobotLog, dynamics: Dynamics, is_late: Mask) -> float | None:
    """How much of the changes of speed is one factor, in each row, on what the loop asks for beyond the speed."""
    missing, changes = limited_speeds(log, dynamics)
    missing, changes = missing[is_late], changes[is_late]
    total = float(np.square(changes).sum())
    if total == 0.0:
        return None
    factors = np.einsum("nj,nj->n", missing, changes) / np.maximum(np.square(missing).sum(axis=1), 1e-12)
    return 1.0 - float(np.square(changes - factors[:, None] * missing).sum()) / total


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.square(values).mean())) if values.size else None


def _mean(values: Iterator[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sqrt(sum(value * value for value in known) / len(known)) if known else None


# ---- as a document


def document(comparison: Comparison) -> dict[str, Any]:
    """A comparison as JSON has it."""
    return {
        "format": "yumi-compare/1",
        "records": [_of_record(robot, record) for robot in comparison.robots for record in robot.records],
        "robots": [_of_robot(robot) for robot in comparison.robots],
        "left_out": list(comparison.left_out),
    }


def _of_record(robot: ComparedRobot, record: Record) -> dict[str, Any]:
    log, part = record.log, record.limited
    return {
        "record": log.name,
        "robot": robot.name,
        "rms_deg": record.rms_deg,
        "joints_deg": list(record.joints_deg),
        "joints": list(log.joints),
        "rows": int(record.is_free.sum()),
        "section_of": log.section_of or None,
        "fitted_rms_deg": record.fitted_deg,
        "limited": None
        if part is None
        else {
            "first_row": part.first_row,
            "rows": part.rows,
            "joints": list(part.joints),
            "rms_deg": part.rms_deg,
            "explained_by_one_factor": part.explained,
        },
    }


def _of_robot(robot: ComparedRobot) -> dict[str, Any]:
    found = robot.identified
    model = robot.parameters
    return {
        "robot": robot.name,
        "parameters_of": robot.used,
        "verdict": robot.verdict,
        "k": _of_estimate(found.gain),
        "dead_time_s": _of_estimate(found.dead_time),
        "lag_s": _of_estimate(found.lag),
        "noise_deg": _of_estimate(found.noise, degrees(1.0)),
        "limits_deg_s": [_of_estimate(each, degrees(1.0)) for each in found.limits],
        "settings": {
            "position_gain": model.position_gain,
            "reference_delay": model.reference_delay,
            "delay": model.delay,
            "lag": model.lag,
        },
    }


def _of_estimate(estimate: Estimate, scale: float = 1.0) -> Mapping[str, Any]:
    if estimate.value is None:
        why = f"not determined: {clause(estimate.reason)}" if estimate.reason else "not determined"
        return {"value": None, "why": why}
    return {
        "value": scale * estimate.value,
        "error": scale * estimate.error,
        "spread": None if estimate.spread is None else scale * estimate.spread,
        "determined_by": estimate.count,
    }


def write_settings(comparison: Comparison, folder: Path, pos_corr_gain: float, origin: str) -> list[Path]:
    """Write a settings file for each robot of which something is identified; their names.

    Args:
        comparison: what is identified.
        folder: where to.
        pos_corr_gain: with which the logs were made; k is its product with the gain of the settings.
        origin: name of the log.
    """
    files = []
    for robot in comparison.robots:
        if robot.identified.lag.value is None:
            continue
        word = re.sub(r"\W+", "_", robot.name).strip("_").lower()
        files.append(folder / f"{word}.yaml")
        parameters = replace(robot.parameters, position_gain=(robot.parameters.position_gain or 0.0) / pos_corr_gain)
        write_egm_parameters(parameters, files[-1], f"Of the {robot.name}, identified by yumi compare from {origin}.")
    return files


def tables(robot: ComparedRobot) -> tuple[Table, Table]:
    """For people: the records of a robot, and what is identified of it."""
    found, dynamics, first = robot.identified, robot.dynamics, robot.records[0].log
    records = Table(
        title=f"{robot.name} beside the virtual robot with the parameters of: {robot.used}", title_justify="left"
    )
    for name in ("record", "rows", "rms [°]", "fitted [°]", "joints [°]"):
        records.add_column(name, justify="left" if name in ("record", "joints [°]") else "right")
    for record in robot.records:
        joints = " ".join(f"{each:.4f}" for each in record.joints_deg) if record.rms_deg is not None else ""
        records.add_row(
            record.log.name, str(record.is_free.sum()), _cell(record.rms_deg), _cell(record.fitted_deg), joints
        )
        part = record.limited
        if part is not None:
            explained = "" if part.explained is None else f"; one factor explains {100.0 * part.explained:.1f} %"
            text = f"slower than asked: {', '.join(part.joints)}{explained}"
            records.add_row(f"  from row {part.first_row}, limited", str(part.rows), _cell(part.rms_deg), "", text)
    parameters = Table(title="Parameters", title_justify="left")
    for name in ("parameter", "virtual robot", "robot"):
        parameters.add_column(name)
    parameters.add_row("k", f"{dynamics.gain:.4g} 1/s", shown(found.gain, "1/s"))
    parameters.add_row(
        "dead time", f"{1e3 * dynamics.dead_time(first.cycle):.4g} ms", shown(found.dead_time, "ms", 1e3)
    )
    parameters.add_row("lag on a ramp", f"{1e3 * dynamics.lag(first.cycle):.4g} ms", shown(found.lag, "ms", 1e3))
    parameters.add_row("noise", "none", shown(found.noise, "°", degrees(1.0)))
    without: dict[Message, list[str]] = {}
    for name, each in zip(first.joints, found.limits, strict=True):
        if each.reason is None:
            parameters.add_row(f"limit of {name}", "", shown(each, "°/s", degrees(1.0)))
        else:
            without.setdefault(each.reason, []).append(name)
    for reason, names in without.items():
        parameters.add_row(f"limit of {', '.join(names)}", "", f"not determined ({clause(reason)})")
    return records, parameters


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.4f}"
