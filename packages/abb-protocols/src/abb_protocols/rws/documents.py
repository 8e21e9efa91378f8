"""Documents of Robot Web Services: pages, states and forms, and values read from them: signals, targets, events.

From inside out: forms, pages with their states, the XHTML they come in (reference/rws.md §1, §3), and what the pages
say to a client: typed values, or a refusal with ABB's code.

A *state* is ABB's word for one thing shown: an ``<li>`` of XHTML, an object of ``_state`` in JSON. A controller answers
with XHTML unless a client asks for JSON with ``json=1``. The client reads XHTML alone: the events of subscriptions come
in no other format, and the controller's JSON deviates from it in several names.

Names and values in queries and form bodies are written strictly and read as tolerantly as a controller does: ABB's own
C++ client sends values unescaped, Python clients percent-encode them; both must arrive as the same text.
"""

from __future__ import annotations

import builtins
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from math import radians
from typing import TypeVar
from urllib.parse import quote, unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, ProtocolError
from abb_protocols.robot.joints import Joints, Pose, chain_from_abb, joints
from abb_protocols.rws.values import EventType, SignalType, meaning_of, name_of

E = TypeVar("E", bound=Enum)

Pairs = tuple[tuple[str, str], ...]

FORM_TYPE = "application/x-www-form-urlencoded"

# A raw "+" is a blank in a form, except in the exponent of a number printed by a client that escapes nothing.
_BLANK_PLUS = re.compile(r"(?<![0-9.][eE])\+|\+(?![0-9])")


def encode_form(pairs: Iterable[tuple[str, str]]) -> str:
    """``name=value&…``, everything but letters, digits and ``-._~`` percent-encoded as UTF-8."""
    return "&".join(f"{quote(name, safe='')}={quote(value, safe='')}" for name, value in pairs)


def decode_form(text: str) -> Pairs:
    """The pairs of a query or form body, in order.

    The text is split only at ``&``: a ``;`` belongs to the values of subscriptions. A name without ``=`` has
    the value "".
    """
    pairs = (part.partition("=") for part in text.split("&") if part)
    return tuple((_text(name), _text(value)) for name, _, value in pairs)


def first_value(pairs: Pairs, name: str) -> str | None:
    """The first value of ``name``, or None."""
    for key, value in pairs:  # a generator takes three times as long, and requests ask often
        if key == name:
            return value
    return None


def _text(raw: str) -> str:
    return unquote(_BLANK_PLUS.sub(" ", raw)) if "%" in raw or "+" in raw else raw


def member(kind: type[E], text: str | int) -> E:
    """The member of ``kind`` with the value ``text``.

    Raises:
        ProtocolError: there is none.
    """
    try:
        return kind(text)
    except ValueError as error:
        allowed = tuple(each.value for each in kind)
        raise ProtocolError(message("word_without_meaning", word=text, allowed=allowed)) from error


def _number(field: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ProtocolError(message("field_no_number", field=field, text=text)) from error


def whole_number(field: str, text: str) -> int:
    """The whole number that ``text`` of ``field`` spells.

    Raises:
        ProtocolError: it spells none.
    """
    value = _number(field, text)
    if not value.is_integer():
        raise ProtocolError(message("field_no_whole_number", field=field, text=text))
    return int(value)


@dataclass(frozen=True, slots=True)
class RwsLink:
    """A reference from a page or a state; ``href`` is relative to the page's base, without ``json=1``."""

    rel: str
    href: str


@dataclass(frozen=True, slots=True)
class RwsArgument:
    """One argument of an event log message: its type (``string``, ``long``, ``float``) and its text."""

    type: str
    value: str


@dataclass(frozen=True, slots=True)
class RwsState:
    """One thing shown.

    Attributes:
        type: ABB's class, e.g. ``pnl-ctrlstate``; entries of lists end in ``-li``.
        title: the instance.
        fields: the texts by name, unescaped, in XHTML's spelling of the names.
        links: e.g. ``self``.
        children: a list inside the state, e.g. the attributes of a configuration instance.
        arguments: of an event log message.
    """

    type: str
    title: str
    fields: Mapping[str, str] = field(default_factory=dict)
    links: tuple[RwsLink, ...] = ()
    children: tuple[RwsState, ...] = ()
    arguments: tuple[RwsArgument, ...] = ()

    def text(self, name: str) -> str:
        """The text of field ``name``.

        Raises:
            ProtocolError: the state has no such field.
        """
        if name not in self.fields:
            raise ProtocolError(message("state_without_field", type=self.type, title=self.title, field=name))
        return self.fields[name]

    def number(self, name: str) -> float:
        """The number in field ``name``.

        Raises:
            ProtocolError: there is none.
        """
        return _number(name, self.text(name))

    def whole(self, name: str) -> int:
        """The whole number in field ``name``.

        Raises:
            ProtocolError: there is none.
        """
        return whole_number(name, self.text(name))

    def flag(self, name: str) -> bool:
        """Whether field ``name`` says yes: TRUE, On or active; False where it is missing."""
        return self.fields.get(name, "").strip().lower() in ("true", "on", "active", "1")

    def member(self, kind: builtins.type[E], name: str) -> E:
        """The member of ``kind`` that field ``name`` spells.

        Raises:
            ProtocolError: it spells none.
        """
        return member(kind, self.text(name))


@dataclass(frozen=True, slots=True)
class Page:
    """An answer with states.

    Attributes:
        title: of the page; JSON does not carry it.
        base: what the links are relative to.
        states: the things shown, in order.
        links: of the page: ``self``, ``action``, and ``next`` where a list goes on.
    """

    title: str
    base: str
    states: tuple[RwsState, ...] = ()
    links: tuple[RwsLink, ...] = ()

    def of_type(self, *types: str) -> Iterator[RwsState]:
        """The states of one of ``types``, in order."""
        return (state for state in self.states if state.type in types)

    def one(self, *types: str) -> RwsState:
        """The first state of one of ``types``.

        Raises:
            ProtocolError: there is none.
        """
        for state in self.of_type(*types):
            return state
        raise ProtocolError(message("answer_without_state", types=types))

    @property
    def first(self) -> RwsState:
        """The first state.

        Raises:
            ProtocolError: there is none.
        """
        if not self.states:
            raise ProtocolError(message("answer_without_states"))
        return self.states[0]

    def link(self, rel: str) -> str | None:
        """Where the page's link ``rel`` points, or None."""
        return next((link.href for link in self.links if link.rel == rel), None)

    @property
    def next_query(self) -> Pairs | None:
        """The query of the page on which a list goes on, or None at its end."""
        href = self.link("next")
        return None if href is None else decode_form(href.partition("?")[2])


@dataclass(frozen=True, slots=True)
class Status:
    """An answer that says no: ABB's code and the controller's own words."""

    code: int
    message: str


class Form(Enum):
    """A format; the value is its content type."""

    XHTML = "application/xhtml+xml"
    JSON = "application/json"  # without a charset: abb_robot_client compares the whole value


def read_page(content_type: str, body: bytes) -> Page:
    """The page in an XHTML document.

    Raises:
        ProtocolError: it is another kind of document, or not the XHTML of Robot Web Services.
    """
    root = _parse(content_type, body)
    division = _division(root, "state")
    states = tuple(_state(item) for item in division.findall("ul/li"))
    base = root.find("head/base")
    return Page(
        root.findtext("head/title") or "", "" if base is None else base.get("href", ""), states, _links(division)
    )


def read_status(content_type: str, body: bytes) -> Status:
    """The status in an XHTML error document.

    Raises:
        ProtocolError: it is another kind of document, or holds no status.
    """
    division = _division(_parse(content_type, body), "status")
    texts = {span.get("class"): span.text or "" for span in division.findall("span")}
    try:
        return Status(int(texts["code"]), texts.get("msg", ""))
    except (KeyError, ValueError) as error:
        raise ProtocolError(message("error_without_code")) from error


XMLNS = "http://www.w3.org/1999/xhtml"
_XHTML_TYPES = (Form.XHTML.value, "text/html", "text/xml", "application/xml")
_ARGUMENT = re.compile(r"arg\d+")
_DEEPEST = 32  # lists within lists; a controller's pages have two
_LARGEST = 16 * 1024 * 1024  # [byte]; a page holds 100 items at most (reference/rws.md §1.1)


def _parse(content_type: str, body: bytes) -> Element:
    """The document without its namespace; a DOCTYPE is refused, since entities can be made to explode."""
    kind = content_type.partition(";")[0].strip().lower()
    if kind not in _XHTML_TYPES:
        raise ProtocolError(message("answer_not_xhtml", kind=kind) if kind else message("answer_of_no_type"))
    if len(body) > _LARGEST:
        raise ProtocolError(message("document_too_long", size=len(body), most=_LARGEST))
    try:
        text = body.decode("utf-8")
        if "<!DOCTYPE" in text:
            raise ProtocolError(message("document_with_doctype"))
        root = ElementTree.fromstring(text)
    except (UnicodeDecodeError, ValueError, RecursionError, ElementTree.ParseError) as error:
        raise ProtocolError(message("document_not_well_formed")) from error
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{XMLNS}}}")
    return root


def _division(root: Element, kind: str) -> Element:
    for division in root.iterfind("body/div"):
        if division.get("class") == kind:
            return division
    raise ProtocolError(message("document_without_division", division=kind))


def _state(item: Element, depth: int = 1) -> RwsState:
    if depth > _DEEPEST:
        raise ProtocolError(message("document_nested_too_deeply", most=_DEEPEST))
    spans = item.findall("span")
    arguments = tuple(RwsArgument(span.get("type", ""), span.text or "") for span in spans if _is_argument(span))
    fields = {span.get("class", ""): span.text or "" for span in spans if not _is_argument(span)}
    children = tuple(_state(child, depth + 1) for child in item.findall("ul/li"))
    return RwsState(item.get("class", ""), item.get("title", ""), fields, _links(item), children, arguments)


def _is_argument(span: Element) -> bool:
    return span.get("type") is not None and _ARGUMENT.fullmatch(span.get("class", "")) is not None


def _links(element: Element) -> tuple[RwsLink, ...]:
    return tuple(RwsLink(anchor.get("rel", ""), anchor.get("href", "")) for anchor in element.findall("a"))


SixAxes = tuple[float, float, float, float, float, float]
Configuration = tuple[int, int, int, int]

EXTERNAL_AXES = tuple(f"eax_{axis}" for axis in "abcdef")
"""Fields of the external axes in pages of the motion system."""

_NOT_CONNECTED = 8.9e9  # 9E9 marks an external axis that does not exist; it is printed in several roundings
_MM = 1e-3
_VERSION = re.compile(r"\d+(\.\d+)+")
_ROBOT = re.compile(r"IRB \d+\w*")  # of an option such as "IRB 120-3/0.6"


@dataclass(frozen=True, slots=True)
class SystemInfo:
    """The controller's system, e.g. version (6, 13, 0, 0); a new installation of RobotWare has another ``id``."""

    name: str
    robotware: tuple[int, ...]
    options: tuple[str, ...]
    id: str = ""

    @property
    def version(self) -> str:
        """Of RobotWare, as ABB writes it: ``6.13.0.0``."""
        return ".".join(map(str, self.robotware))

    @property
    def robot(self) -> str:
        """ABB's name of the robot without its variant, such as ``IRB 120``; empty where no option names one."""
        names = (match[0] for option in self.options if (match := _ROBOT.match(option)))
        return next(names, "")


@dataclass(frozen=True, slots=True)
class RwsSignal:
    """One I/O signal and its logical value."""

    name: str
    type: SignalType
    value: float


@dataclass(frozen=True, slots=True)
class CfgInstance:
    """One instance of a configuration type, its attributes as text."""

    name: str
    attributes: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class JointTarget:
    """Where a mechanical unit stands: axes 1-6 and external axes [deg], None where there is no axis."""

    robax_deg: SixAxes
    extax_deg: tuple[float | None, ...]

    def chain(self) -> Joints:
        """The seven joints of a YuMi arm in chain order [rad].

        Raises:
            ProtocolError: the unit has no seventh axis.
        """
        axis_7_deg = self.extax_deg[0]
        if axis_7_deg is None:
            raise ProtocolError(message("unit_without_seventh_axis"))
        return joints([radians(angle) for angle in chain_from_abb(self.robax_deg, axis_7_deg)])


@dataclass(frozen=True, slots=True)
class RobTarget:
    """A position of the tool.

    Attributes:
        tool_to_object: of the tool in the work object, or as was asked for.
        configuration: quarter turns of axes 1, 4 and 6, and ABB's cfx.
        external: external axes [rad], None where there is no axis; of a YuMi's arm the first is the arm angle.
    """

    tool_to_object: Pose
    configuration: Configuration
    external: tuple[float | None, ...] = ()


@dataclass(frozen=True, slots=True)
class RwsEvent:
    """One message of the event log.

    Attributes:
        number: of the message; it rises with each.
        type: its weight.
        code: ABB's number of the event.
        time: the controller's local time as it prints it.
        title: one line.
        description: what happened, in ABB's words.
        arguments: what the controller put into those words.
    """

    number: int
    type: EventType
    code: int
    time: str
    title: str
    description: str
    arguments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One entry of a directory; ``size`` [byte] is None for a directory."""

    name: str
    size: int | None


def read_system(page: Page) -> SystemInfo:
    """``/rw/system``."""
    state = page.one("sys-system-li")
    version = state.text("rwversionname")
    if not _VERSION.fullmatch(version):
        raise ProtocolError(message("version_not_numbers", version=version))
    options = tuple(child.text("option") for each in page.of_type("sys-options-li") for child in each.children)
    robotware = tuple(int(part) for part in version.split("."))
    return SystemInfo(state.text("name"), robotware, options, state.fields.get("sysid", ""))


def read_mastership(page: Page) -> str:
    """``/rw/mastership/{domain}``: who holds it, unless that is this session."""
    state = page.one("msh-resource")
    if state.text("mastership") == "nomaster" or state.fields.get("mastershipheldbyme", "").upper() == "TRUE":
        return ""
    known = [text for name in ("application", "alias", "location") if (text := state.fields.get(name, ""))]
    return ", ".join(known) or f"another client ({state.text('mastership')})"


def read_symbol_type(page: Page) -> str:
    """``/rw/rapid/symbol/properties``: the name of the RAPID type."""
    for state in page.states:
        if state.type.startswith("rap-symprop"):
            return state.text("dattyp")
    raise ProtocolError(message("answer_without_properties"))


def read_signal(page: Page) -> RwsSignal:
    """``/rw/iosystem/signals/{name}``."""
    return signal_of(page.one("ios-signal", "ios-signal-li"))


def signal_of(state: RwsState) -> RwsSignal:
    """A signal, of whatever list."""
    return RwsSignal(state.text("name"), state.member(SignalType, "type"), state.number("lvalue"))


def read_signals(page: Page) -> Mapping[str, float]:
    """``/rw/iosystem/signals``: the values by name; an entry without a valid value is left out."""
    values: dict[str, float] = {}
    for state in page.of_type("ios-signal-li"):
        with suppress(ProtocolError):
            values[state.text("name")] = state.number("lvalue")
    return values


def read_cfg_instances(page: Page) -> tuple[CfgInstance, ...]:
    """``/rw/cfg/{domain}/{type}/instances``."""
    return tuple(map(cfg_instance_of, page.of_type("cfg-dt-instance-li")))


def cfg_instance_of(state: RwsState) -> CfgInstance:
    """An instance with the attributes in its list."""
    return CfgInstance(state.title, {each.title: each.fields.get("value", "") for each in state.children})


def pose_of(state: RwsState) -> Pose:
    """Out of ``x`` to ``q4``."""
    x, y, z = (state.number(name) * _MM for name in "xyz")
    w, i, j, k = (state.number(f"q{number}") for number in range(1, 5))
    return Pose((x, y, z), (w, i, j, k))


def rob_target_of(state: RwsState) -> RobTarget:
    """A robtarget, as each of the services spells it."""
    names = ("cf1", "cf4", "cf6", "cfx") if "cf1" in state.fields else ("j1", "j4", "j6", "jx")
    one, four, six, x = (state.whole(name) for name in names)
    external = [name for name in state.fields if name.startswith(("eax", "ej"))]
    return RobTarget(pose_of(state), (one, four, six, x), _external_axes_of(state, external))


def _external_axes_of(state: RwsState, names: Sequence[str]) -> tuple[float | None, ...]:
    """External axes [rad]."""
    found = [state.number(name) for name in names]
    return tuple(None if angle > _NOT_CONNECTED else radians(angle) for angle in found)


def joint_target_of(state: RwsState, robot: str, external: Sequence[str]) -> JointTarget:
    """A jointtarget whose fields of the robot's axes begin with ``robot``."""
    a1, a2, a3, a4, a5, a6 = (state.number(f"{robot}{axis}") for axis in range(1, 7))
    found = [state.number(name) for name in external]
    return JointTarget((a1, a2, a3, a4, a5, a6), tuple(None if angle > _NOT_CONNECTED else angle for angle in found))


EVENT_STATES = ("elog-message-li", "elog-message")
"""The types of states that show an event."""


def read_events(page: Page) -> tuple[RwsEvent, ...]:
    """``/rw/elog/{domain}``, in the controller's order."""
    return tuple(map(read_event, page.of_type(*EVENT_STATES)))


def read_event(state: RwsState) -> RwsEvent:
    """The event that a state shows."""
    number = state.title.rpartition("/")[2]
    if not number.isdecimal():
        raise ProtocolError(message("event_without_number", title=state.title))
    return RwsEvent(
        number=int(number),
        type=member(EventType, state.whole("msgtype")),
        code=state.whole("code"),
        time=state.text("tstamp"),
        title=state.text("title"),
        description=state.text("desc"),
        arguments=tuple(argument.value for argument in state.arguments),
    )


def refusal(address: str, what: str, status: int, content_type: str, body: bytes) -> ControllerRefused:
    """The error for a response of ``address`` that refuses; ``what`` is the request in a few words."""
    try:
        known = read_status(content_type, body)
    except ProtocolError:  # a body of another kind, which gateways and old versions send
        said = message("rws_refused_without_code", address=address, what=what, status=status)
        return ControllerRefused(said, status=status)
    reason = meaning_of(known.code)
    if reason is None:
        reason = message("text", text=known.message) if known.message else message("rws_no_reason")
    name = f"{name_of(known.code)} {known.code}".strip()
    said = message("rws_refused", address=address, what=what, reason=reason, status=status, name=name)
    return ControllerRefused(said, status=status, code=known.code)
