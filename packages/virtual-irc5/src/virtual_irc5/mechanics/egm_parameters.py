"""Parameters of EGM: the settings file with which a virtual arm follows EGM as a measured one does.

`yumi compare` writes one, `yumi controller --dynamics FILE` reads it::

    position_gain: 5.0        # [1/s] k, with PosCorrGain 1: ext_motion_Kp of the system parameters
    reference_delay: 0.0040   # [s] from when EGM takes a reference until it uses it
    delay: 0.0100             # [s] from the planned to the measured position
    lag: 0.0060               # [s] time constant of the servo behind the delay
    speed_limits:             # [deg/s] of joints by ABB's number of the axis
      2: 90.0

What is left out stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, radians
from pathlib import Path
from typing import cast

from abb_protocols.catalogue import message, quoted, said_by
from abb_protocols.errors import CommandRefused, SettingsError
from abb_protocols.robot.joints import CHAIN_AXES
from abb_runtime.parameters import Parameter, read_mapping
from virtual_irc5.mechanics.arm_motion import ArmModel

_NUMBERS = {
    each.name: each
    for each in (
        Parameter("position_gain", 5.0, 0.0, 20.0, "1/s"),
        Parameter("reference_delay", 0.0, 0.0, 0.2, "s"),
        Parameter("delay", 0.0, 0.0, 0.5, "s"),
        Parameter("lag", 0.0, 0.0, 0.5, "s"),
    )
}
_SPEED_LIMITS = "speed_limits"
_SPEED_LIMIT = Parameter(_SPEED_LIMITS, 180.0, 0.1, 10_000.0, "deg/s")
_MEANINGS = {
    "position_gain": "[1/s] k, with PosCorrGain 1: ext_motion_Kp of the system parameters",
    "reference_delay": "[s] from when EGM takes a reference until it uses it",
    "delay": "[s] from the planned to the measured position",
    "lag": "[s] time constant of the servo behind the delay",
}
_HIGHEST_AXIS = max(CHAIN_AXES)


@dataclass(frozen=True, slots=True)
class EgmParameters:
    """How an arm follows EGM; None where the arm's own value stays.

    Attributes:
        position_gain: default proportional position gain of EGM [1/s].
        reference_delay: see :class:`ArmModel`, as delay and lag [s].
        delay: [s].
        lag: [s].
        speed_limits: highest speeds by ABB's number of the axis [rad/s].
    """

    position_gain: float | None = None
    reference_delay: float | None = None
    delay: float | None = None
    lag: float | None = None
    speed_limits: Mapping[int, float] = field(default_factory=dict)

    def applied(self, model: ArmModel, axes: Sequence[int]) -> ArmModel:
        """A model of an arm with these parameters.

        Args:
            model: of the arm.
            axes: ABB's numbers of the joints in chain order.
        """
        speeds = [self.speed_limits.get(axis, most) for axis, most in zip(axes, model.limits.velocity, strict=True)]
        return replace(
            model,
            limits=replace(model.limits, velocity=tuple(speeds)),
            reference_delay=model.reference_delay if self.reference_delay is None else self.reference_delay,
            delay=model.delay if self.delay is None else self.delay,
            lag=model.lag if self.lag is None else self.lag,
        )


def read_egm_parameters(path: Path) -> EgmParameters:
    """The parameters in a settings file.

    Raises:
        SettingsError: the file cannot be read, or something in it is not such a parameter.
    """
    content = read_mapping(path)
    unknown = [name for name in content if name not in {*_NUMBERS, _SPEED_LIMITS}]
    if unknown:
        raise SettingsError(
            f"{path.name}: there is no parameter {quoted(unknown[0])}; there are "
            f"{', '.join((*_NUMBERS, _SPEED_LIMITS))}."
        )
    speeds = content.pop(_SPEED_LIMITS, {})
    if not isinstance(speeds, Mapping):
        raise SettingsError(f"{path.name}: {_SPEED_LIMITS} is {quoted(speeds)}; needed are axes with speeds, 2: 90.0.")
    numbers = {name: _number(path, _NUMBERS[name], value) for name, value in content.items()}
    limits = {}
    for axis, value in speeds.items():
        if not axis.isdecimal() or not 1 <= int(axis) <= _HIGHEST_AXIS:
            raise SettingsError(
                f"{path.name}: {_SPEED_LIMITS} names axis {quoted(axis)}; allowed are 1 to {_HIGHEST_AXIS}."
            )
        limits[int(axis)] = radians(_number(path, _SPEED_LIMIT, value))
    return EgmParameters(**numbers, speed_limits=limits)


def _number(path: Path, parameter: Parameter, value: object) -> float:
    try:
        accepted = parameter.accept(value)
    except CommandRefused as error:
        raise SettingsError(message("setting_refused", place=path.name, reason=said_by(error))) from error
    return float(cast("float", accepted))


def write_egm_parameters(parameters: EgmParameters, path: Path, origin: str) -> None:
    """Write a settings file.

    Args:
        parameters: what is in it.
        path: where to; its folder is made.
        origin: where the numbers are from, one line.
    """
    lines = [f"# {origin}", "# For: yumi controller --dynamics FILE"]
    for name, meaning in _MEANINGS.items():
        value = getattr(parameters, name)
        if value is not None:
            lines.append(f"{name}: {value:.6f}  # {meaning}")
    if parameters.speed_limits:
        lines.append(f"{_SPEED_LIMITS}:  # [deg/s] of joints by ABB's number of the axis")
        lines += [f"  {axis}: {degrees(speed):.3f}" for axis, speed in sorted(parameters.speed_limits.items())]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
