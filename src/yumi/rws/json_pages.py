"""Pages and statuses as JSON, which a client asks for with ``json=1`` (reference/rws.md §3.2, §3.4)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from yumi.errors import ProtocolError
from yumi.rws.pages import Argument, Link, Page, State, Status

CONTENT_TYPE = "application/json"  # without a charset: abb_robot_client compares the whole value

# Where the controller's JSON deviates from its XHTML (reference/rws.md §3.2).
_EXTERNAL_AXES = {f"eax_{letter}": f"eax{letter}" for letter in "abcdef"}
_FIELD_NAMES: Mapping[str, Mapping[str, str]] = {
    "ms-robtargets": _EXTERNAL_AXES,
    "ms-mechunit": {
        "task-name": "task",
        "is-integrated-unit": "is-integrated-unitname",
        "has-integrated-unit": "has-integrated-unitname",
    },
}
_TYPES = {"elog-message-li": "elog-message"}
_LISTS = {"sys-option-li": "options", "cfg-ia-t-li": "attrib"}
_NUMBERS = ("lvalue", "pvalue")
_OWN_KEYS = ("_type", "_title", "_links")
_DEEPEST = 32  # states within states; a controller's pages have two
_LARGEST = 16 * 1024 * 1024  # [byte]; a page holds 100 items at most (reference/rws.md §1.1)


def write_page(page: Page) -> str:
    """The page; the title has no place in it."""
    links = {"base": {"href": page.base}} | _write_links(page.links)
    return _dump({"_links": links, "_embedded": {"_state": [_object(state) for state in page.states]}})


def write_status(status: Status, base: str) -> str:
    """An error document; its code is a number."""
    embedded = {"status": {"code": status.code, "msg": status.message}, "_state": []}
    return _dump({"_links": {"base": {"href": base}}, "_embedded": embedded})


def read_page(body: bytes) -> Page:
    """The page in a JSON document.

    Raises:
        ProtocolError: it is not the JSON of Robot Web Services.
    """
    document = _load(body)
    links = dict(_read_links(document.get("_links")))
    base = links.pop("base", "")
    states = document["_embedded"].get("_state")
    if not isinstance(states, list):
        raise ProtocolError("The controller's JSON holds no list of states.")
    return Page("", base, tuple(map(_state, states)), tuple(Link(*item) for item in links.items()))


def read_status(body: bytes) -> Status:
    """The status in a JSON error document.

    Raises:
        ProtocolError: there is none.
    """
    status = _load(body)["_embedded"].get("status")
    try:
        return Status(int(status["code"]), str(status.get("msg", "")))
    except (KeyError, TypeError, ValueError) as error:
        raise ProtocolError("The controller's error document holds no code.") from error


def _dump(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _load(body: bytes) -> dict[str, Any]:
    if len(body) > _LARGEST:
        raise ProtocolError(f"The answer is a document of {len(body)} bytes; a controller's has {_LARGEST} at most.")
    try:
        document = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise ProtocolError("The answer is not JSON.") from error
    if not isinstance(document, dict) or not isinstance(document.get("_embedded"), dict):
        raise ProtocolError("The answer is not a JSON document of Robot Web Services.")
    return document


def _object(state: State) -> dict[str, object]:
    names = _FIELD_NAMES.get(state.type, {})
    result: dict[str, object] = {"_type": _TYPES.get(state.type, state.type), "_title": state.title}
    if state.links:
        result["_links"] = _write_links(state.links)
    for name, text in state.fields.items():
        result[names.get(name, name)] = _number(text) if name in _NUMBERS else text
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LISTS.get(state.children[0].type, "state")] = [_object(child) for child in state.children]
    return result


def _number(text: str) -> object:
    try:
        return int(text) if text.lstrip("-").isdecimal() else float(text)
    except ValueError:
        return text


def _write_links(links: tuple[Link, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": _with_json(link.href)} for link in links}


def _with_json(href: str) -> str:
    return f"{href}{'&' if '?' in href else '?'}json=1"


def _without_json(href: str) -> str:
    return href.removesuffix("?json=1").removesuffix("&json=1")


def _state(value: object, depth: int = 1) -> State:
    if depth > _DEEPEST:
        raise ProtocolError(f"The answer has more than {_DEEPEST} states within each other, which no controller sends.")
    if not isinstance(value, dict):
        raise ProtocolError("A state in the controller's JSON is not an object.")
    type_ = str(value.get("_type", ""))
    lists = [item for item in value.values() if isinstance(item, list)]
    children = tuple(_state(child, depth + 1) for items in lists for child in items if _is_state(child))
    return State(
        type_,
        str(value.get("_title", "")),
        _fields(value, {theirs: ours for ours, theirs in _FIELD_NAMES.get(type_, {}).items()}),
        tuple(Link(*item) for item in _read_links(value.get("_links"))),
        children,
        tuple(Argument(str(item.get("type", "")), str(item.get("value", ""))) for item in _argv(value)),
    )


def _fields(value: Mapping[str, object], names: Mapping[str, str]) -> dict[str, str]:
    texts = {name: item for name, item in value.items() if isinstance(item, (str, int, float))}
    return {names.get(name, name): str(item) for name, item in texts.items() if name not in _OWN_KEYS}


def _is_state(value: object) -> bool:
    return isinstance(value, dict) and "_type" in value


def _argv(value: Mapping[str, object]) -> list[dict[str, object]]:
    argv = value.get("argv", [])
    return [item for item in argv if isinstance(item, dict)] if isinstance(argv, list) else []


def _read_links(value: object) -> list[tuple[str, str]]:
    if not isinstance(value, dict):
        return []
    hrefs = {rel: link.get("href", "") for rel, link in value.items() if isinstance(link, dict)}
    return [(str(rel), _without_json(str(href))) for rel, href in hrefs.items()]
