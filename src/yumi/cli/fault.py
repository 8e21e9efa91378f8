"""The command ``yumi fault``: injects a fault into a running virtual controller."""

from __future__ import annotations

import click

from yumi.errors import CommandRefused, NoConnection
from yumi.robot.joints import Side
from yumi.virtual.controller.fault_names import Fault, FaultKind, Way

_PATH = "/virtual/faults"
_TIMEOUT = 4.0
_WIDTH = 120


def _table(kinds: list[FaultKind]) -> str:
    """The faults, one a line; the width of the names is that of the longest. Choices that do not fit go below."""
    width = max(len(kind.name) for kind in kinds)
    lines = []
    for kind in kinds:
        line, choices = f"  {kind.name:<{width}}  {kind.meaning}", _choices(kind)
        fits = len(line + choices) < _WIDTH
        lines.append(line + choices if fits else f"{line}\n{' ' * (width + 3)}{choices}")
    return "\n".join(lines)


def _choices(kind: FaultKind) -> str:
    limit = "for ever" if kind.default_duration is None else f"{kind.default_duration:g} s"
    choices = ["--side"] * kind.has_side + [f"--duration, else {limit}"] * kind.has_duration
    if kind.amount is not None:
        usual = "at random" if kind.amount.default is None else f"{kind.amount.default:g}"
        choices.append(f"--by {kind.amount.unit}, else {usual}")
    choices += ["--way"] * kind.has_way
    return f" ({'; '.join(choices)})" if choices else ""


_LIST = _table([fault.value for fault in Fault])


@click.command(
    epilog="\b\nFaults:\n" + _LIST,
    context_settings={"max_content_width": _WIDTH},
)
@click.argument("name", required=False, type=click.Choice([fault.value.name for fault in Fault]), metavar="[NAME]")
@click.option("--rws-port", type=click.IntRange(1, 65535), default=8080, show_default=True, help="Its HTTP port.")
@click.option("--side", type=click.Choice([side.word for side in Side]), help="One arm; both without it.")
@click.option("--duration", type=float, help="How long it lasts [s].")
@click.option("--by", type=float, help="Its strength, in the unit of the list below.")
@click.option(
    "--way", type=click.Choice([way.value for way in Way]), help="Direction of the datagrams; both without it."
)
def fault(
    name: str | None, rws_port: int, side: str | None, duration: float | None, by: float | None, way: str | None
) -> None:
    """Inject a fault into a virtual controller that runs on this machine; without NAME, list the faults.

    \b
    Examples:
      yumi fault emergency-stop
      yumi fault egm-silence --side left --duration 1
      yumi fault egm-loss --by 50 --duration 2
      yumi fault egm-loss --way to-robot --duration 0.5    the robot receives nothing
      yumi fault egm-delay --by 20 --side right --duration 2
      yumi fault warm-restart --rws-port 8080
    """
    if name is None:
        click.echo(_LIST)
        return
    numbers = {"duration": duration, "by": by}
    chosen = {"side": side, "way": way, **{key: None if each is None else repr(each) for key, each in numbers.items()}}
    _post(f"127.0.0.1:{rws_port}", name, {key: text for key, text in chosen.items() if text is not None})
    click.echo(f"{name}: done")


def _post(address: str, name: str, form: dict[str, str]) -> None:
    import httpx  # noqa: PLC0415 - a quick --help

    try:
        reply = httpx.post(f"http://{address}{_PATH}/{name}", data=form, timeout=_TIMEOUT, trust_env=False)
    except httpx.HTTPError as error:
        raise NoConnection(
            f"Nothing answers at {address} ({error}). A virtual controller is started with `yumi controller`."
        ) from error
    if not reply.is_success:
        is_virtual = reply.headers.get("Content-Type", "").startswith("text/plain")
        sentence = reply.text if is_virtual else ""
        raise CommandRefused(sentence or f"What answers at {address} is not a virtual controller of this package.")
