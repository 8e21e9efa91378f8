"""Where a running virtual controller is given faults: ``/virtual/faults``, which no ABB controller has.

``GET /virtual/faults`` lists them, ``POST /virtual/faults/<name>`` lets one happen; ``side`` and ``duration`` stand in
the form. Only programs of the same machine are served, without a login; a web page is not, wherever it is shown.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from ipaddress import ip_address
from math import inf, isfinite
from urllib.parse import urlsplit

from yumi.errors import CommandRefused, YumiError
from yumi.robot.joints import Side
from yumi.rws import documents as forms
from yumi.rws.http import HttpReply, HttpRequest
from yumi.rws.types import ControllerState
from yumi.virtual.controller.egm import LASTING, SINGLE, EgmClient
from yumi.virtual.controller.fault_names import Fault, FaultKind, Way, kind_of
from yumi.virtual.controller.faults import Faults
from yumi.virtual.rws.adapter import RwsAdapter
from yumi.virtual.world import World

PATH = "/virtual/faults"
_MAX_DURATION = 86_400.0
_GRIPPER_ERROR = 7  # any; the hand's numbers are not published

_OK, _NO_CONTENT, _FORBIDDEN, _NOT_FOUND, _CONFLICT = 200, 204, 403, 404, 409


class FaultDesk:
    """Lets faults happen to a world and its web services.

    Args:
        world: the virtual robot.
        adapter: its Robot Web Services.
    """

    def __init__(self, world: World, adapter: RwsAdapter) -> None:
        self._world = world
        self._adapter = adapter
        hands = Faults(world.controller)
        self._plain: Mapping[Fault, Callable[[], None]] = {
            Fault.MOTORS_OFF: hands.switch_motors_off,
            Fault.EMERGENCY_STOP: hands.press_emergency_stop,
            Fault.EMERGENCY_STOP_RESET: hands.release_emergency_stop,
            Fault.MANUAL_MODE: hands.select_manual_mode,
            Fault.AUTO_MODE: hands.select_automatic_mode,
            Fault.PROGRAM_STOP: hands.stop_program,
            Fault.WRONG_PROGRAM: hands.load_wrong_program,
            Fault.RIGHT_PROGRAM: hands.load_right_program,
            Fault.RWS_RESET: adapter.reset_connections,
            Fault.RWS_SESSIONS_EXPIRED: adapter.expire_sessions,
            Fault.WEB_SOCKET_DROP: adapter.drop_web_sockets,
        }
        self._lasting: Mapping[Fault, Callable[[float], None]] = {
            Fault.WARM_RESTART: world.controller.restart,
            Fault.RWS_BUSY: adapter.be_busy,
        }
        self._of_arm: Mapping[Fault, Callable[[Side], None]] = {
            Fault.EGM_REPAIR: world.lines.repair,
            Fault.COMM_TIMEOUT: lambda side: self._egm(side).lose_sensor(),
            Fault.EGM_CONVERGENCE: lambda side: self._egm(side).converge(),
            Fault.DYNAMIC_LOAD: lambda side: self._egm(side).overload(),
            Fault.COLLISION: self._collide,
            Fault.GRIPPER_NOT_CALIBRATED: self._forget_calibration,
            Fault.GRIPPER_ERROR: lambda side: world.grippers[side].fail(_GRIPPER_ERROR),
            Fault.OBJECT_LOST: self._lose_object,
        }

    def happen(
        self,
        fault: Fault,
        side: Side | None = None,
        duration: float | None = None,
        amount: float | None = None,
        way: Way | None = None,
    ) -> None:
        """Let a fault happen.

        Args:
            fault: which.
            side: to which arm; None for both.
            duration: how long it lasts [s]; None for its own time.
            amount: how strong it is, in the unit of its kind; None for its own strength.
            way: in which direction datagrams meet it; None for both.

        Raises:
            CommandRefused: one of these means nothing for it or is out of range, or the robot is in no state for it.
        """
        _check_choice(fault.value, side, duration)
        _check_strength(fault.value, amount, way)
        sides = tuple(Side) if side is None else (side,)
        length = fault.value.default_duration if duration is None else duration
        if fault in self._plain:
            self._plain[fault]()
        elif fault in self._lasting:
            self._lasting[fault](inf if length is None else length)
        elif fault is Fault.EGM_SILENCE:
            for each in sides:
                self._world.lines.put(Fault.EGM_LOSS, each, 100.0, duration=length)
        elif fault in LASTING:
            for each in sides:
                self._world.lines.put(fault, each, _strength(fault.value, amount), way or Way.BOTH, length)
        elif fault in SINGLE:
            send = partial(self._send_beside, fault, _strength(fault.value, amount))
            self._happen_to(send, sides, is_chosen=side is not None)
        else:
            self._happen_to(self._of_arm[fault], sides, is_chosen=side is not None)

    def answer(self, request: HttpRequest) -> HttpReply:
        """The answer to a request below :data:`PATH`."""
        if not _is_local(request.peer):
            return _sentence(_FORBIDDEN, "Faults are taken from programs on this machine only.")
        if not _is_called_local(request):
            return _sentence(
                _FORBIDDEN, "Faults are taken under the names of this machine only, such as 127.0.0.1, not for pages."
            )
        name = request.target.partition("?")[0].removeprefix(PATH).strip("/")
        if not name:
            return HttpReply(_OK, (("Content-Type", "application/json"),), json.dumps(_list()).encode())
        fault = kind_of(name)
        if fault is None or request.method != "POST":
            known = ", ".join(each.value.name for each in Fault)
            return _sentence(_NOT_FOUND, f"There is no fault {name!r} to {request.method}; POST one of {known}.")
        try:
            self.happen(fault, *_choice(forms.decode(request.body.decode("utf-8", "replace"))))
        except YumiError as error:
            return _sentence(_CONFLICT, str(error))
        return HttpReply(_NO_CONTENT)

    def _happen_to(self, happen: Callable[[Side], None], sides: Sequence[Side], *, is_chosen: bool) -> None:
        """Let a fault happen to the arms it can happen to, at least one."""
        refused: list[CommandRefused] = []
        for side in sides:
            try:
                happen(side)
            except CommandRefused as error:
                refused.append(error)
        if refused and (is_chosen or len(refused) == len(sides)):
            raise refused[0]

    def _send_beside(self, fault: Fault, amount: float, side: Side) -> None:
        self._egm(side)  # one more datagram has to be like those that are sent
        self._world.lines.put(fault, side, amount)

    def _egm(self, side: Side) -> EgmClient:
        egm = self._world.egm[side]
        if not egm.is_guiding:
            raise CommandRefused(f"EGM does not guide the {side.word} arm; start EGM first.")
        return egm

    def _collide(self, side: Side) -> None:
        if self._world.controller.controller_state is not ControllerState.MOTORS_ON:
            raise CommandRefused("An arm whose motors are off does not collide; switch the motors on first.")
        self._world.controller.collide(side)

    def _forget_calibration(self, side: Side) -> None:
        self._world.grippers[side].cut_power()

    def _lose_object(self, side: Side) -> None:
        gripper = self._world.grippers[side]
        if gripper.workpiece is None and all(cup.under is None for cup in gripper.cups.values()):
            raise CommandRefused(f"Nothing lies between the fingers or under the cups of the {side.word} arm.")
        gripper.workpiece = None
        for cup in gripper.cups.values():
            cup.under = None


def _check_choice(kind: FaultKind, side: Side | None, duration: float | None) -> None:
    if side is not None and not kind.has_side:
        raise CommandRefused(f"{kind.name} happens to the whole robot; leave the side out.")
    if duration is not None and not kind.has_duration:
        raise CommandRefused(f"{kind.name} has no duration; leave it out.")
    if duration is not None and not 0.0 < duration <= _MAX_DURATION:
        raise CommandRefused(f"A duration is above 0 and at most {_MAX_DURATION:.0f} s, not {duration:g} s.")


def _check_strength(kind: FaultKind, amount: float | None, way: Way | None) -> None:
    if way is not None and not kind.has_way:
        raise CommandRefused(f"{kind.name} has no direction; leave 'way' out.")
    if amount is None:
        return
    if kind.amount is None:
        raise CommandRefused(f"{kind.name} has no strength; leave 'by' out.")
    is_in_range = kind.amount.lowest <= amount <= kind.amount.highest
    if not is_in_range or (kind.amount.is_whole and amount != int(amount)):
        whole = "a whole number from " if kind.amount.is_whole else ""
        raise CommandRefused(f"The strength ('by') of {kind.name} is {whole}{kind.amount.range}, not {amount:g}.")


def _strength(kind: FaultKind, amount: float | None) -> float:
    """0 is chance, or nothing to choose."""
    default = kind.amount.default if kind.amount is not None else None
    return (default or 0.0) if amount is None else amount


def _choice(form: forms.Pairs) -> tuple[Side | None, float | None, float | None, Way | None]:
    side, way = forms.first(form, "side"), forms.first(form, "way")
    duration, amount = forms.first(form, "duration"), forms.first(form, "by")
    sides, ways = {each.word: each for each in Side}, {each.value: each for each in Way}
    if side is not None and side not in sides:
        raise CommandRefused(f"A side is left or right, not {side!r}.")
    if way is not None and way not in ways:
        raise CommandRefused(f"The direction ('way') is to-robot, from-robot or both, not {way!r}.")
    return (
        None if side is None else sides[side],
        None if duration is None else _number(duration, "A duration is a number of seconds"),
        None if amount is None else _number(amount, "'by' is a number"),
        None if way is None else ways[way],
    )


def _number(text: str, meaning: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = inf
    if not isfinite(number):
        raise CommandRefused(f"{meaning}, not {text!r}.")
    return number


def _list() -> list[dict[str, object]]:
    return [
        {
            "name": fault.value.name,
            "meaning": fault.value.meaning,
            "has_side": fault.value.has_side,
            "has_duration": fault.value.has_duration,
            "default_duration_s": fault.value.default_duration,
            "by": None if fault.value.amount is None else asdict(fault.value.amount),
            "has_way": fault.value.has_way,
        }
        for fault in Fault
    ]


def _is_local(peer: str) -> bool:
    return _is_loopback(peer.rpartition(":")[0])


def _is_called_local(request: HttpRequest) -> bool:
    """Whether Host and, where there is one, Origin are names of this machine.

    Else a page from elsewhere would let faults happen: by its forms, or by a name of its own that it lets lead here.
    """
    origin = request.header("Origin")
    urls = [f"http://{request.header('Host') or ''}", *([] if origin is None else [origin])]
    return all(_is_loopback(_host_of(url)) for url in urls)


def _host_of(url: str) -> str:
    try:
        return urlsplit(url).hostname or ""
    except ValueError:
        return ""


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _sentence(status: int, sentence: str) -> HttpReply:
    return HttpReply(status, (("Content-Type", "text/plain; charset=utf-8"),), sentence.encode())
