"""Measurement: three small motions of a robot that show how the robot follows EGM, recorded for a comparison.

The driver moves the arms as for any script: a trajectory controller, the limiter and what keeps the arms apart are in
between. Only positions are sent, with no speeds beside them, so that the loop of the robot itself answers.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from itertools import product
from math import degrees, pi, radians
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CHAIN_AXES, JOINT_COUNT, YUMI_LIMITS, Joints, Side, joints
from abb_runtime.parameters import ParameterFileEntry
from abb_runtime.udp import address_of_host, is_loopback
from yumi import __version__
from yumi.api.connect import controllers_for
from yumi.api.joint_positions import TimedPosition
from yumi.api.robot import Robot
from yumi.control.collisions import BODY_MARGIN
from yumi.core.collision import Distance
from yumi.driver.commissioning.controller_checks import examine_controller
from yumi.driver.commissioning.machine_checks import examine_machine
from yumi.driver.controller_names import TRAJECTORY_CONTROLLER
from yumi.driver.initial_controllers import Controllers
from yumi.driver.settings import CalibrateWhen, Settings

LARGEST = radians(2.0)
"""No joint leaves the place where the measurement began by more [rad]."""

_TRAVEL = radians(1.9)
"""Of ramp and sine [rad]: at the corners of a ramp the limiter sends a little more."""

FASTEST_DEG = 10.0
"""No joint is faster; EGM is started with this MaxSpeedDeviation [deg/s]."""

_ALTERNATELY = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
"""Directions in chain order that are tried first: the tool moves less when the joints turn against each other."""

_REST = 1.0  # [s] before a motion and after each part of it: the loop has forgotten all but e⁻⁵
_STEP = radians(1.5)
_FREQUENCY = 1.5  # [Hz] of the sine, whose highest speed is π times it and its travel: 9.0 °/s
_PERIODS = 9
_POINTS = 75  # a second, of the sine
_NEAR = 0.02  # [m] between parts that move apart from each other; the limiter keeps half of it
_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the way of an arm that are looked at


@dataclass(frozen=True, slots=True)
class MeasuredMotion:
    """One of the motions.

    Attributes:
        name: of its recording.
        words: what moves how far and how fast, after the name of the arm.
        points: time [s], how far all joints are from their start [rad], and their speed [rad/s] where it is given.
    """

    name: str
    words: str
    points: tuple[tuple[float, ...], ...]

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return self.points[-1][0]

    def trajectory(self, start: Joints, directions: Joints) -> list[TimedPosition]:
        """The motion of an arm that stands at ``start`` [rad], (7,), whose joints turn in ``directions``, 1 or -1."""
        origins, ways = (np.array(start), np.zeros(JOINT_COUNT)), np.array(directions)
        return [
            (time, *((origin + ways * value).tolist() for origin, value in zip(origins, values, strict=False)))
            for time, *values in self.points
        ]


def _ramp() -> MeasuredMotion:
    lasts = degrees(_TRAVEL)
    turns = _times(_REST, (lasts, _REST, lasts, _REST))
    places = (0.0, _TRAVEL, _TRAVEL, 0.0, 0.0)
    return MeasuredMotion("ramp", "by 1.9° at 1 °/s and back", tuple(zip(turns, places, strict=True)))


def _steps() -> MeasuredMotion:
    turns = _times(_REST, 4 * (degrees(_STEP) / FASTEST_DEG, _REST))
    places = (0.0, _STEP, _STEP, 0.0, 0.0, _STEP, _STEP, 0.0, 0.0)
    return MeasuredMotion(
        "step", "by 1.5° and back, twice, as quickly as 10 °/s allow", tuple(zip(turns, places, strict=True))
    )


def _sine() -> MeasuredMotion:
    times = np.arange(round(_PERIODS / _FREQUENCY * _POINTS) + 1) / _POINTS
    size, angle = 0.5 * _TRAVEL, 2.0 * pi * _FREQUENCY * times
    speed = size * 2.0 * pi * _FREQUENCY * np.sin(angle)
    rows = np.column_stack((_REST + times, size * (1.0 - np.cos(angle)), speed))
    end = (rows[-1, 0] + _REST, 0.0, 0.0)
    words = f"by 1.9° and back, {_PERIODS} times as a sine of 1.5 Hz, at most 9 °/s"
    return MeasuredMotion("sine", words, (*map(tuple, rows.tolist()), end))


def _times(begin: float, lasting: Sequence[float]) -> list[float]:
    return [begin, *(begin + np.cumsum(lasting)).tolist()]


MOTIONS = (_ramp(), _steps(), _sine())
"""In their order."""


def settings_for_measuring(settings: Settings) -> Settings:
    """The settings with which a robot is measured: slow, without a scale on time, and with grippers that stay.

    Raises:
        CommandRefused: EGM would not follow positions.
    """
    motion = settings.egm_motion
    if motion.pos_corr_gain <= 0.0:
        raise CommandRefused(message("follows_speeds_alone"))
    return replace(
        settings,
        robot=replace(settings.robot, speed_scale=1.0),
        egm_motion=replace(motion, max_speed_deviation=min(FASTEST_DEG, motion.max_speed_deviation)),
        gripper=replace(settings.gripper, calibrate=CalibrateWhen.NEVER, test_at_start=False),
    )


def controllers_for_measuring(settings: Settings) -> Controllers:
    """The delivered controllers, those for trajectories with positions alone and without looking ahead."""
    only_positions = {
        name: ParameterFileEntry(0.0, "yumi measure", is_general=False) for name in ("feedforward", "lookahead")
    }
    return {
        side: tuple(
            replace(each, entries={**each.entries, **only_positions}) if each.name == TRAJECTORY_CONTROLLER else each
            for each in own
        )
        for side, own in controllers_for(settings, 0.5, 0.5).items()
    }


def check_room(side: Side, position: Joints) -> None:
    """See that every joint of an arm has room for the motions.

    Raises:
        CommandRefused: one has not.
    """
    ranges = zip(CHAIN_AXES, position, YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)
    for axis, value, lower, upper in ranges:
        if not lower + LARGEST <= value <= upper - LARGEST:
            raise CommandRefused(
                message(
                    "joint_without_room",
                    axis=axis,
                    arm=side.word,
                    position=value,
                    lower=lower,
                    upper=upper,
                    room=LARGEST,
                )
            )


def clear_directions(
    settings: Settings, positions: Mapping[Side, Joints], moving: Sequence[Side]
) -> dict[Side, Joints]:
    """In which directions the joints of the arms can turn with nothing near their ways; 1 or -1 each.

    Args:
        settings: what stands around the robot, and how near an arm may come.
        positions: of both arms [rad].
        moving: the arms that move.

    Raises:
        CommandRefused: there are none: parts are too near to each other.
    """
    model = settings.collision.model({side: settings.gripper.modules(side) for side in Side})
    least = max(_NEAR, settings.collision.margin)

    def nearest(chosen: Mapping[Side, Joints]) -> Distance | None:
        """The first pair that is too near on the ways of the arms."""
        for share in _SHARES:
            turned = dict(positions)
            for side, ways in chosen.items():
                pairs = zip(positions[side], ways, strict=True)
                turned[side] = joints([value + share * LARGEST * way for value, way in pairs])
            for each in model.nearest(turned, 100, within=least):
                # The shoulders are bolted to the body, and the arms are near it wherever they are.
                is_body = "body" in each.other or "shoulder" in each.part or "shoulder" in each.other
                if each.distance < (BODY_MARGIN if is_body else least):
                    return each
        return None

    found: dict[Side, Joints] = {}
    for side in moving:
        tried = (
            joints([way * turn for way, turn in zip(_ALTERNATELY, turns, strict=True)])
            for turns in product((1.0, -1.0), repeat=JOINT_COUNT)
        )
        found[side] = next((ways for ways in tried if nearest({side: ways}) is None), joints(_ALTERNATELY))
    near = nearest(found)
    if near is not None:
        raise CommandRefused(message("part_too_near", part=near.part, other=near.other, distance=near.distance))
    return found


def question(motion: MeasuredMotion, sides: Sequence[Side]) -> str:
    """What a motion will do, in one line."""
    arms = " and ".join(f"the {side.word} arm" for side in sides)
    return f"{motion.name.capitalize()}: all joints of {arms} move {motion.words}, {motion.duration:.0f} s."


def measure(
    sides: Sequence[Side],
    settings: Settings,
    evidence: Evidence,
    confirm: Callable[[str], None],
    report: Callable[[str], None],
) -> None:
    """Do the motions one after the other, and record each to a file of its own.

    Args:
        sides: the arms that move, at the same time.
        settings: with which robots are measured.
        evidence: gets the recordings.
        confirm: asked before EGM starts and before each motion; raises where it may not be done.
        report: given each step.

    Raises:
        CommandRefused: there is no room for the motions, or one was not confirmed; nothing more has moved.
        YumiError: the robot is not ready, or a motion has ended elsewhere.
    """
    words = " and ".join(f"the {side.word} arm" for side in sides)
    confirm(f"Start: the motors go on, the RAPID program starts at main, EGM starts on {words}; nothing moves.")
    with Robot(settings, controllers_for_measuring(settings), tuple(sides), report) as robot:
        arms = {Side.RIGHT: robot.right, Side.LEFT: robot.left}
        starts = {side: arms[side].executor.snapshot(side).sent for side in sides}
        still = {side: robot.controller.joint_target(side.unit) for side in Side if side not in starts}
        for side in sides:
            check_room(side, starts[side])
        directions = clear_directions(settings, {**starts, **still}, sides)
        for motion in MOTIONS:
            confirm(question(motion, sides))
            ways = {side.word: motion.trajectory(starts[side], directions[side]) for side in sides}
            file = evidence.recordings / f"{motion.name}.mcap"
            with robot.record(file):
                robot.follow(right=ways.get("right"), left=ways.get("left"), timeout=2.0 * motion.duration)
            evidence.motions.append(motion.name)
            report(f"Recorded: {file}")


# ---- evidence


@dataclass(frozen=True, slots=True)
class Examined:
    """A robot before it is measured.

    Attributes:
        is_virtual: whether it is on this machine, or says itself that it is virtual.
        findings: of the doctor, without names and addresses of machines.
        document: kind of controller and versions.
        names: what is put in the place of each name and address.
    """

    is_virtual: bool
    findings: list[dict[str, str]]
    document: dict[str, Any]
    names: Mapping[str, str]


def examine(settings: Settings) -> Examined:
    """Look at the controller and this machine; nothing is changed.

    Raises:
        YumiError: the controller cannot be asked.
    """
    where = settings.robot
    remote = address_of_host(where.address)
    listen, addresses = settings.egm.listen_for(remote), settings.egm.addresses(remote)
    with where.client() as client:
        findings = [*examine_controller(client, addresses), *examine_machine(remote, addresses)]
        identity, system = client.identity(), client.system()
    # The virtual controller of this project calls itself real, since programs expect that.
    is_virtual = identity.is_virtual or is_loopback(remote)
    names = {
        **dict.fromkeys((listen, platform.node()), "COMPUTER"),
        **dict.fromkeys((where.address, remote, identity.serial), "ROBOT"),
        repr(system.name): "SYSTEM",
    }
    rows = [
        {key: _without_names(str(value), names) for key, value in row.items()}
        for row in ({**asdict(each), "verdict": each.verdict.value} for each in findings)
    ]
    own = {"yumi-ros2": __version__, "python": platform.python_version(), "system": platform.system()}
    kind = "virtual" if is_virtual else "real"
    document = {
        "controller": kind,
        "robotware": system.version,
        "options": list(system.options),
        "versions": own,
    }
    return Examined(is_virtual, rows, document, names)


def _without_names(text: str, names: Mapping[str, str]) -> str:
    """A text in which something else is in the place of names and addresses of machines."""
    for name in sorted(filter(None, names), key=len, reverse=True):  # 192.168.125.10 contains 192.168.125.1
        text = text.replace(name, names[name])
    return text


class Evidence:
    """The folder of a measurement: recordings, the doctor's report, with what was measured, and the archive of all.

    Args:
        folder: a new one.
        examined: the robot.
        settings: with which it is measured.
        arms: which arms move.

    Attributes:
        recordings: the folder of the recordings.
        motions: those that are over.
    """

    def __init__(self, folder: Path, examined: Examined, settings: Settings, arms: str) -> None:
        self._folder, self._examined = folder, examined
        names = ("use_filtering", "lp_filter", "sample_rate", "max_speed_deviation", "ramp_in_time", "pos_corr_gain")
        self._document = {
            "format": "yumi-measure/1",
            "date": f"{datetime.now():%Y-%m-%d %H:%M}",
            "arms": arms,
            **examined.document,
            "egm_motion": {name: getattr(settings.egm_motion, name) for name in names},
        }
        self.recordings = folder / "recordings"
        self.motions: list[str] = []
        self.recordings.mkdir(parents=True)
        write_json(folder / "doctor.json", examined.findings)

    def close(self, ended: str) -> Path:
        """Write what was measured and pack all into one file beside the folder; the name of that file.

        Args:
            ended: why it has ended early; empty where it has not.
        """
        stop = _without_names(ended, self._examined.names)
        write_json(self._folder / "measurement.json", {**self._document, "motions": self.motions, "ended": stop})
        archive = self._folder.parent / f"{self._folder.name}.zip"
        with ZipFile(archive, "w", ZIP_DEFLATED) as packed:
            for file in sorted(self._folder.rglob("*")):
                if file.is_file():
                    packed.write(file, Path(self._folder.name) / file.relative_to(self._folder))
        return archive


def write_json(path: Path, content: Any) -> None:
    """Write a document."""
    path.write_text(f"{json.dumps(content, indent=2, allow_nan=False)}\n", encoding="utf-8")
