"""``virtual-irc5 fault`` and ``yumi fault``: injects faults into a virtual controller."""

from __future__ import annotations

import json

import click

from abb_runtime.faults import Fault, FaultDirection, FaultKind, inject_fault
from abb_runtime.options import JsonOutput, SharedCommand, arm_option, json_option, robot_option
from abb_runtime.rws.login import with_usual_port

_FAULT_WIDTH = 120


def _fault_table(kinds: list[FaultKind]) -> str:
    """The faults, one a line; the width of the names is that of the longest. Choices that do not fit go below."""
    width = max(len(kind.name) for kind in kinds)
    lines = []
    for kind in kinds:
        line, choices = f"  {kind.name:<{width}}  {kind.meaning}", _options_of(kind)
        fits = len(line + choices) < _FAULT_WIDTH
        lines.append(line + choices if fits else f"{line}\n{' ' * (width + 3)}{choices}")
    return "\n".join(lines)


def _options_of(kind: FaultKind) -> str:
    limit = "for ever" if kind.default_duration is None else f"{kind.default_duration:g} s"
    choices = ["--arm"] * kind.has_side + [f"--duration, else {limit}"] * kind.has_duration
    if kind.amount is not None:
        usual = "at random" if kind.amount.default is None else f"{kind.amount.default:g}"
        choices.append(f"--by {kind.amount.unit}, else {usual}")
    choices += ["--way"] * kind.has_way
    return f" ({'; '.join(choices)})" if choices else ""


_FAULTS = _fault_table([fault.value for fault in Fault])


@click.command(
    cls=SharedCommand,
    epilog="\b\nFaults:\n" + _FAULTS,
    context_settings={"max_content_width": _FAULT_WIDTH},
)
@click.argument("name", required=False, type=click.Choice([fault.value.name for fault in Fault]), metavar="[NAME]")
@robot_option(default="127.0.0.1")
@arm_option("both")
@click.option("--duration", type=float, help="How long it lasts [s].")
@click.option("--by", type=float, help="Its strength, in the unit of the list below.")
@click.option(
    "--way",
    type=click.Choice([way.value for way in FaultDirection]),
    help="Direction of the datagrams, both without it; with to-robot the robot does not receive the driver.",
)
@json_option
def fault(
    name: str | None,
    robot: str,
    arm: str | None,
    duration: float | None,
    by: float | None,
    way: str | None,
    json_output: JsonOutput,
) -> None:
    """Inject a fault into a virtual controller, or list them.

    Without NAME it lists the faults.

    \b
    Examples:
      {command} emergency-stop
      {command} egm-silence --arm left --duration 1
      {command} egm-loss --by 50 --duration 2
      {command} egm-loss --way to-robot --duration 0.5    robot receives nothing
      {command} egm-delay --by 20 --arm right --duration 2
      {command} warm-restart --robot 127.0.0.1:8080
    """
    if name is None:
        json_output.write(json.dumps({kind.name: kind.meaning for kind in (fault.value for fault in Fault)}, indent=2))
        json_output.say(_FAULTS)
        return
    numbers = {"duration": duration, "by": by}
    chosen = {"side": arm, "way": way, **{key: None if each is None else repr(each) for key, each in numbers.items()}}
    given = {key: text for key, text in chosen.items() if text is not None}
    from abb_runtime.rws.transport import check_address  # noqa: PLC0415 - a quick --help

    address = with_usual_port(robot)
    check_address(address)
    inject_fault(address, name, given)
    json_output.write(json.dumps({"fault": name, **given}))
    json_output.say(f"{name}: done")
