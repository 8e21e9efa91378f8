"""Cfg files: the system parameters of one domain as text, read and written.

A file begins with domain and version, such as ``SIO:CFG_1.0:6:1::``; then come types (``COM_TRP:``), each with its
instances, one a line, which a backslash continues. An attribute without a value is a flag that is set.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from abb_protocols.catalogue import message
from abb_protocols.errors import SettingsError
from abb_protocols.rws.rapid_values import NUMBER

CFG_FLAG = "TRUE"
"""Value of an attribute of a cfg file that stands without one."""

# A flag has no value: what follows it is the next attribute, unless it is a negative number.
_ATTRIBUTE = re.compile(r'-(\w+)(?:\s+("[^"]*"|-[\d.]\S*|[^\s"-]\S*))?')
_LONGEST_LINE = 100
_UNSET = {"", "false", "no"}
_SET = {"true", "yes"}


@dataclass(frozen=True, slots=True)
class CfgFile:
    """The content of a cfg file.

    Attributes:
        header: its first line.
        instances: type and attributes of each, in their order; the values are text.
    """

    header: str
    instances: tuple[tuple[str, Mapping[str, str]], ...]

    @property
    def domain(self) -> str:
        """Such as ``EIO``."""
        return self.header.partition(":CFG_")[0]


def stated_attributes(attributes: Mapping[str, str]) -> dict[str, str]:
    """What a file has to state of an instance: without flags that are not set and attributes that are empty.

    Args:
        attributes: as Robot Web Services list them: all that its type has, those with their default values, too.
    """
    return {
        name: CFG_FLAG if value.strip().lower() in _SET else value
        for name, value in attributes.items()
        if value.strip().lower() not in _UNSET
    }


def read_cfg(text: str) -> CfgFile:
    """The instances in a cfg file.

    Raises:
        SettingsError: the text is not a cfg file.
    """
    # Lines that are not empty or comments; those that end in a backslash are joined with the next.
    joined = (line.strip() for line in re.sub(r"\\\s*\n", " ", text).splitlines())
    lines = [line for line in joined if line and not line.startswith("#")]
    header = lines[0] if lines else ""
    if ":CFG_" not in header:
        raise SettingsError(message("cfg_file_without_domain", header=header))
    type_name, instances = "", []
    for line in lines[1:]:
        if line.endswith(":") and not line.startswith("-"):
            type_name = line[:-1]
        else:
            found = _ATTRIBUTE.findall(line)
            instances.append((type_name, {name: value.strip('"') if value else CFG_FLAG for name, value in found}))
    return CfgFile(header, tuple(instances))


def write_cfg(header: str, instances: Iterable[tuple[str, Mapping[str, str]]]) -> str:
    """A cfg file; instances of one type come together, in the order of their types' first."""
    by_type: dict[str, list[Mapping[str, str]]] = {}
    for type_name, attributes in instances:
        by_type.setdefault(type_name, []).append(attributes)
    lines = [header]
    for type_name, entries in by_type.items():
        lines += ["#", f"{type_name}:"]
        for attributes in entries:
            line = "     "
            lines.append("")
            for name, value in attributes.items():
                plain = value if NUMBER.fullmatch(value) else f'"{value}"'
                word = f"-{name}" if value == CFG_FLAG else f"-{name} {plain}"
                if len(line) + len(word) > _LONGEST_LINE:
                    lines.append(f"{line} \\")
                    line = "     "
                line += f" {word}"
            lines.append(line)
    return "\n".join(lines) + "\n"
