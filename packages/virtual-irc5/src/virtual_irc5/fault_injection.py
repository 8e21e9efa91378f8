"""The injection of faults into a virtual robot while it runs.

Faults come over HTTP at ``/virtual/faults``, which no ABB controller has: ``GET /virtual/faults`` lists them, ``POST
/virtual/faults/<name>`` injects one; ``side``, ``duration``, ``by`` and ``way`` are in the form. Only programs of the
same machine are served, without a login; web pages are not.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from math import inf, isfinite, radians

from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.documents import Pairs, first_value
from abb_protocols.rws.values import ControllerState, OperatingMode
from abb_runtime.faults import FAULTS_PATH, Fault, FaultDirection, FaultKind, fault_named
from abb_runtime.udp import host_of_url, is_loopback
from virtual_irc5.mechanics.egm_client import EgmClient
from virtual_irc5.mechanics.egm_network import LASTING, SINGLE
from virtual_irc5.mechanics.virtual_gripper import CupObject, Workpiece
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World

_LONGEST_FAULT = 86_400.0  # [s]
_GRIPPER_ERROR = 7  # any; the gripper's numbers are not published
_OTHER_FILE = "HOME:/Pick.mod"
_OTHER_PROGRAM = """MODULE Pick
    PROC main()
        WHILE TRUE DO
            WaitTime 1;
        ENDWHILE
    ENDPROC
ENDMODULE
"""


class FaultInjection:
    """Injects faults into a world and its web services; what would change nothing is refused."""

    def __init__(self, world: World, service: RwsService) -> None:
        self._world = world
        controller = world.controller
        self._of_robot: Mapping[Fault, Callable[[], None]] = {
            Fault.MOTORS_OFF: lambda: controller.set_motors(False),
            Fault.EMERGENCY_STOP: controller.press_emergency_stop,
            Fault.EMERGENCY_STOP_RESET: controller.release_emergency_stop,
            Fault.MANUAL_MODE: lambda: controller.select_mode(OperatingMode.MANUAL_REDUCED),
            Fault.AUTO_MODE: lambda: controller.select_mode(OperatingMode.AUTO),
            Fault.PROGRAM_STOP: controller.stop_rapid,
            Fault.WRONG_PROGRAM: lambda: controller.replace_program({_OTHER_FILE: _OTHER_PROGRAM}),
            Fault.RIGHT_PROGRAM: lambda: controller.replace_program({}),
            Fault.RWS_RESET: service.reset_connections,
            Fault.RWS_SESSIONS_EXPIRED: service.expire_sessions,
            Fault.WEB_SOCKET_DROP: service.drop_web_sockets,
        }
        self._lasting: Mapping[Fault, Callable[[float], None]] = {
            Fault.WARM_RESTART: controller.restart,
            Fault.RWS_BUSY: service.be_busy,
        }
        self._with_strength: Mapping[Fault, Callable[[Side, float], None]] = {
            Fault.ARM_PUSHED: lambda side, degrees: world.arms[side].push(radians(degrees)),
            Fault.OBJECT_PLACED: self._place_object,
            Fault.OBJECT_UNDER_CUPS: self._put_under_cups,
        }
        self._of_arm: Mapping[Fault, Callable[[Side], None]] = {
            Fault.EGM_REPAIR: world.network.repair,
            Fault.COMM_TIMEOUT: lambda side: self._running_egm(side).lose_sensor(),
            Fault.EGM_CONVERGENCE: lambda side: self._running_egm(side).converge(),
            Fault.DYNAMIC_LOAD: lambda side: self._running_egm(side).overload(),
            Fault.COLLISION: controller.collide,
            Fault.GRIPPER_NOT_CALIBRATED: lambda side: world.grippers[side].cut_power(),
            Fault.GRIPPER_ERROR: lambda side: world.grippers[side].fail(_GRIPPER_ERROR),
            Fault.OBJECT_LOST: self._lose_object,
        }

    def inject(
        self,
        fault: Fault,
        side: Side | None = None,
        duration: float | None = None,
        amount: float | None = None,
        way: FaultDirection | None = None,
    ) -> None:
        """Inject a fault.

        Args:
            fault: which.
            side: to which arm; None for both.
            duration: how long it lasts [s]; None for its own time.
            amount: how strong it is, in the unit of its kind; None for its own strength.
            way: in which direction datagrams meet it; None for both.

        Raises:
            CommandRefused: one of these means nothing for it or is out of range, or the robot is in no state for it.
        """
        _check_options(fault.value, side, duration, amount, way)
        self._check_effect(fault)
        network, kind = self._world.network, fault.value
        sides = tuple(self._world.arms) if side is None else (side,)
        length = kind.default_duration if duration is None else duration
        usual = kind.amount.default if kind.amount is not None else None
        strength = (usual or 0.0) if amount is None else amount  # 0 is chance, or nothing to choose
        if fault in self._of_robot:
            self._of_robot[fault]()
        elif fault in self._lasting:
            self._lasting[fault](inf if length is None else length)
        elif fault is Fault.EGM_SILENCE:
            for each in sides:
                network.inject(Fault.EGM_LOSS, each, 100.0, duration=length)
        elif fault in LASTING:
            for each in sides:
                network.inject(fault, each, strength, way or FaultDirection.BOTH, length)
        else:
            self._inject_into_arms(fault, strength, sides)

    def answer(self, request: HttpRequest) -> HttpReply:
        """The answer to a request below :data:`FAULTS_PATH`."""
        if not is_loopback(request.peer.rpartition(":")[0]):
            return _plain_reply(403, "Faults are taken from programs on this machine only.")
        # Without this check a page from elsewhere could inject faults: by its forms, or by a host name of its own that
        # leads to this machine.
        origin = request.header("Origin")
        urls = [f"http://{request.header('Host') or ''}", *([] if origin is None else [origin])]
        if not all(is_loopback(host_of_url(url)) for url in urls):
            return _plain_reply(
                403, "Faults are taken under the names of this machine only, such as 127.0.0.1, not for pages."
            )
        name = request.target.partition("?")[0].removeprefix(FAULTS_PATH).strip("/")
        if not name:
            kinds = [asdict(fault.value) for fault in Fault]
            for kind in kinds:  # "by" as in the form
                kind |= {"default_duration_s": kind.pop("default_duration"), "by": kind.pop("amount")}
            return HttpReply(200, (("Content-Type", "application/json"),), json.dumps(kinds).encode())
        fault = fault_named(name)
        if fault is None or request.method != "POST":
            known = ", ".join(each.value.name for each in Fault)
            return _plain_reply(404, f"There is no fault {name!r} to {request.method}; POST one of {known}.")
        try:
            self.inject(fault, *_read_options(request.form()))
        except YumiError as error:
            return _plain_reply(409, str(error))
        return HttpReply(204)

    def _inject_into_arms(self, fault: Fault, strength: float, sides: Sequence[Side]) -> None:
        """Inject a fault into the arms that are in a state for it, at least one."""
        refused: list[CommandRefused] = []
        for side in sides:
            try:
                if fault in SINGLE:
                    self._running_egm(side)  # an additional datagram is a changed copy of one that was sent
                    self._world.network.inject(fault, side, strength)
                elif fault in self._with_strength:
                    self._with_strength[fault](side, strength)
                else:
                    self._of_arm[fault](side)
            except CommandRefused as error:
                refused.append(error)
        if len(refused) == len(sides):
            raise refused[0]

    def _check_effect(self, fault: Fault) -> None:
        """Refuse a fault of the controller that would change nothing.

        Raises:
            CommandRefused: says why.
        """
        controller = self._world.controller
        state, mode = controller.controller_state, controller.mode
        is_pressed, motors_on = state is ControllerState.EMERGENCY_STOP, state is ControllerState.MOTORS_ON
        same_mode = f"The key stands at {mode.value} already."
        refusals: Mapping[Fault, tuple[bool, str]] = {
            Fault.EMERGENCY_STOP: (
                is_pressed,
                "The emergency stop is pressed already; emergency-stop-reset releases it.",
            ),
            Fault.EMERGENCY_STOP_RESET: (
                not is_pressed,
                "The emergency stop is not pressed; there is nothing to reset.",
            ),
            Fault.MOTORS_OFF: (not motors_on, "The motors are off already."),
            Fault.PROGRAM_STOP: (not controller.is_running, "No RAPID program runs; there is nothing to stop."),
            Fault.MANUAL_MODE: (mode is OperatingMode.MANUAL_REDUCED, same_mode),
            Fault.AUTO_MODE: (mode is OperatingMode.AUTO, same_mode),
            Fault.COLLISION: (
                not motors_on,
                "An arm whose motors are off does not collide; switch the motors on first.",
            ),
        }
        is_refused, sentence = refusals.get(fault, (False, ""))
        if is_refused:
            raise CommandRefused(sentence)

    def _running_egm(self, side: Side) -> EgmClient:
        egm = self._world.egm[side]
        if not egm.is_running:
            name = self._world.arms[side].kinematics.name
            raise CommandRefused(f"EGM does not move the {name}; start EGM first.")
        return egm

    def _place_object(self, side: Side, width_mm: float) -> None:
        gripper, width = self._world.grippers[side], width_mm * 1e-3
        if 2.0 * gripper.position < width:
            raise CommandRefused(
                f"The {side.word} gripper is open by {2e3 * gripper.position:.1f} mm; open it further than "
                f"{width_mm:g} mm first."
            )
        gripper.workpiece = Workpiece(width)

    def _put_under_cups(self, side: Side, leak: float) -> None:
        cups = self._world.grippers[side].cups
        if not cups:
            raise CommandRefused(f"The {side.word} gripper has no vacuum module.")
        for cup in cups.values():
            cup.under = CupObject(leak)

    def _lose_object(self, side: Side) -> None:
        gripper = self._world.grippers[side]
        if gripper.workpiece is None and all(cup.under is None for cup in gripper.cups.values()):
            raise CommandRefused(f"Nothing lies between the fingers or under the cups of the {side.word} arm.")
        gripper.workpiece = None
        for cup in gripper.cups.values():
            cup.under = None


def _check_options(
    kind: FaultKind, side: Side | None, duration: float | None, amount: float | None, way: FaultDirection | None
) -> None:
    if side is not None and not kind.has_side:
        raise CommandRefused(f"{kind.name} happens to the whole robot; leave the side out.")
    if duration is not None and not kind.has_duration:
        raise CommandRefused(f"{kind.name} has no duration; leave it out.")
    if duration is not None and not 0.0 < duration <= _LONGEST_FAULT:
        raise CommandRefused(f"A duration is above 0 and at most {_LONGEST_FAULT:.0f} s, not {duration:g} s.")
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


def _read_options(form: Pairs) -> tuple[Side | None, float | None, float | None, FaultDirection | None]:
    side, way = first_value(form, "side"), first_value(form, "way")
    duration, amount = first_value(form, "duration"), first_value(form, "by")
    sides, ways = {each.word: each for each in Side}, {each.value: each for each in FaultDirection}
    if side is not None and side not in sides:
        raise CommandRefused(f"A side is left or right, not {side!r}.")
    if way is not None and way not in ways:
        raise CommandRefused(f"The direction ('way') is to-robot, from-robot or both, not {way!r}.")
    return (
        None if side is None else sides[side],
        None if duration is None else _finite_number(duration, "A duration is a number of seconds"),
        None if amount is None else _finite_number(amount, "'by' is a number"),
        None if way is None else ways[way],
    )


def _finite_number(text: str, meaning: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = inf
    if not isfinite(number):
        raise CommandRefused(f"{meaning}, not {text!r}.")
    return number


def _plain_reply(status: int, sentence: str) -> HttpReply:
    return HttpReply(status, (("Content-Type", "text/plain; charset=utf-8"),), sentence.encode())
