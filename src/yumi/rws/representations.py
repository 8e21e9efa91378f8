"""The two formats of an answer, XHTML and JSON, chosen and told apart in one place (reference/rws.md §3)."""

from __future__ import annotations

from enum import Enum

from yumi.errors import ProtocolError
from yumi.rws import json_pages, xhtml
from yumi.rws.pages import Page, Status


class Form(Enum):
    """A format; the value is its content type."""

    XHTML = xhtml.CONTENT_TYPE
    JSON = json_pages.CONTENT_TYPE


def write_page(page: Page, form: Form) -> bytes:
    """The page as a document."""
    text = json_pages.write_page(page) if form is Form.JSON else xhtml.write_page(page)
    return text.encode("utf-8", "replace")


def write_status(status: Status, form: Form, *, base: str, title: str = "rw") -> bytes:
    """The status as an error document."""
    is_json = form is Form.JSON
    text = json_pages.write_status(status, base) if is_json else xhtml.write_status(status, title, base)
    return text.encode("utf-8", "replace")


def read_page(content_type: str, body: bytes) -> Page:
    """The page in a document of either format.

    Raises:
        ProtocolError: it is neither, or not a document of Robot Web Services.
    """
    if _form(content_type) is Form.JSON:
        return json_pages.read_page(body)
    return xhtml.read_page(body)


def read_status(content_type: str, body: bytes) -> Status:
    """The status in an error document of either format.

    Raises:
        ProtocolError: it is neither, or holds no status.
    """
    if _form(content_type) is Form.JSON:
        return json_pages.read_status(body)
    return xhtml.read_status(body)


def _form(content_type: str) -> Form:
    kind = content_type.partition(";")[0].strip().lower()
    if kind == Form.JSON.value:
        return Form.JSON
    if kind in (Form.XHTML.value, "text/html", "text/xml", "application/xml"):
        return Form.XHTML
    raise ProtocolError(f"The answer is {kind or 'of no type'}, neither XHTML nor JSON.")
