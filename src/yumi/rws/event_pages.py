"""Subscription groups and their events as documents: XHTML on one line, ASCII, short (reference/rws.md §14.1-14.2).

Clients cut them with regular expressions and receive into buffers of 1024 bytes, so spelling and length count.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from yumi.rws.pages import Page, State
from yumi.rws.representations import read_page
from yumi.rws.xhtml import CONTENT_TYPE, escaped, write_item

MAX_EVENT = 1024
"""What the receive buffers of common clients hold [byte]."""

_POLL = re.compile(r"/poll/(\d+)")


def write_group(root: str, group: int, events: Sequence[Sequence[State]]) -> bytes:
    """The answer to a subscription, with the values of this moment; ``root`` is ``host:port`` of the controller."""
    links = (
        f'<a href="subscription/{group}" rel="group"></a>'
        f'<a href="ws://{escaped(root)}/poll/{group}" rel="self"></a>'
        f'<a href="subscription/{group}?action=show" rel="action"></a>'
    )
    return _document(root, links, (state for event in events for state in event))


def write_event(root: str, group: int, event: Sequence[State]) -> str:
    """The message that tells of one event; common clients look for one only in each.

    What is too long for their buffers is told without its value, which a client can read where the link leads.
    """
    link = f'<a href="subscription/{group}" rel="group"></a>'
    text = _document(root, link, event)
    if len(text) > MAX_EVENT:
        text = _document(root, link, [replace(event[0], fields={})])
    return text.decode("ascii")


def read_event(text: str) -> Page:
    """The page in a message or in the answer to a subscription.

    Raises:
        ProtocolError: it is not the XHTML of Robot Web Services.
    """
    return read_page(CONTENT_TYPE, text.encode())


def group_of(text: str) -> int | None:
    """Number of the group in an address such as ``ws://192.168.125.1:80/poll/5``."""
    found = _POLL.search(text)
    return None if found is None else int(found[1])


def _document(root: str, links: str, states: Iterable[State]) -> bytes:
    items = "".join(map(write_item, states))
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml">'
        f'<head><title>Event</title><base href="http://{escaped(root)}/"/></head>'
        f'<body><div class="state">{links}<ul>{items}</ul></div></body></html>'
    )
    return text.encode("ascii", "xmlcharrefreplace")
