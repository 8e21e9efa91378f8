"""The tables of docs/reference/rapid-coverage.md: which of RobotWare's names RAPID has here, and what shows it.

    .venv/bin/python setup/rapid_coverage.py

prints them; docs_site.py puts them into the page when the site is built.

A name is *done* where the library has it and a test executes a program with it: the programs of effects.txt name what
they show, constants.txt the constants whose values are compared, of other tests the text of their programs counts.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from virtual_irc5.rapid import ROBOTWARE_NAMES
from virtual_irc5.rapid.rapid_library import Library, Support
from virtual_irc5.world import World

ROOT = Path(__file__).resolve().parent.parent
EFFECTS = ROOT / "tests" / "unit" / "rapid" / "effects.txt"
OF_CONTROLLER = ROOT / "tests" / "unit" / "virtual" / "instructions" / "effects.txt"
VALUES = EFFECTS.with_name("constants.txt")
TESTS = (
    "tests/unit/rapid",
    "tests/unit/virtual",
    "tests/contract",
    "tests/system",
    "tests/property",
    "tests/rapid_corpus",
)
UNTESTED, MISSING = "provided, without a test", "missing"
STATES = ("done", Support.ACCEPTED.value, Support.REFUSED.value, UNTESTED, MISSING)

# Options that a YuMi's controller does not have, and instructions of other robots: public syntax definitions list them
# among the names of RobotWare. What the stock controller names in its list of options (Path Recovery, Path Offset,
# MultiMove, EGM) counts as base.
OPTIONS = {
    "PickMaster": r"PM_\w+|PICKWARE_ERR|pnpdata",
    "Continuous Application Platform": (
        r"CAP_\w+|PRE_\w+|POST\w+|(START|END|MAIN)_\w+|FLY_\w+|PROCESS_END\w*|restartblkdata"
    ),
    "BullsEye": r"BE[A-Z]\w+",
    "laser tracking and sensor interface": (
        r"LTAPP__\w+|SEN_\w+|IVarValue|SenDevice|ReadBlock|WriteBlock|ReadVar|WriteVar|ReadVarArr|WriteVarArr|"
        r"sensorvardata|Si(Connect|Close|GetCyclic|SetCyclic)|EGMSetupLTAPP"
    ),
    "GAP and production manager": r"GAP_\w+|EE_\w+|OP_(NO_ROBOT|PRODUCTION|SERVICE)",
    "arc, spot and paint": (
        r"AW_\w+|PW_\w+|ga[A-Z]\w+|gs[A-Z]\w+|STOP_WEAVE\w+|WEAVESTART\w+|HollowWristReset|proc_times|sup_timeouts"
    ),
    "tool change": r"TC_ERR\w*",
    "force control and machining": r"FC_\w+|deflectiondata",
    "servo tools": r"ST(Calib|Close|Open|IndGun|IndGunReset|Tune|TuneReset|CalcForce|CalcTorque|Is\w+)|tunegtype",
    "conveyors and synchronized sensors": (
        r"DropSensor|SupSyncSensor\w+|SyncToSensor|WaitSensor|Prx\w+|IoCtrlAxis_\w+|cnvcmd"
    ),
    "independent axes": r"Ind([ACDR]Move|Reset|Inpos|Speed)",
    "SoftMove, and dither of an IRB 7600": r"CSS[A-Z]\w+|Dither\w+",
    "Advanced Robot Motion": r"FricId\w+|MotionProcessModeSet",
    "safety controller": r"SafetyController\w+",
    "Integrated Vision": r"AliasCamera|visiondata",
}


@dataclass(frozen=True)
class Kind:
    """One of the four kinds of names.

    Attributes:
        title: of its section.
        names: all of RobotWare 6 base.
        pattern: how a program uses a name.
    """

    title: str
    names: tuple[str, ...]
    pattern: str

    def provided(self, library: Library, name: str) -> str | None:
        """How far the library has the name, None where it has not."""
        if self.title in ("Instructions", "Functions"):
            routine = library.routine(name)
            found = name if name.lower() in LANGUAGE else routine
            return None if found is None else Support.DONE.value if routine is None else routine.support.value
        has = library.find_type(name) if self.title == "Data types" else library.datum(name)
        return None if has is None else Support.DONE.value


LANGUAGE = ("waituntil", "present", "argname")  # which the compiler itself knows
KINDS = (
    Kind("Instructions", ROBOTWARE_NAMES["instructions"], r"\b{0}\b(?!\s*\()"),
    Kind("Functions", ROBOTWARE_NAMES["functions"], r"\b{0}\s*\("),
    Kind(
        "Data types", ROBOTWARE_NAMES["types"], r"(?:\b(?:VAR|PERS|CONST|INOUT|FUNC|REF)\s+|\()\s*{0}\s+\w|\\{0}\s+\w"
    ),
    Kind("Predefined constants", ROBOTWARE_NAMES["constants"], r"\b{0}\b"),
)


def programs() -> Iterator[tuple[str, str]]:
    """The strings of all tests with what links to them, without those that explain."""
    for folder in TESTS:
        for path in sorted((ROOT / folder).rglob("*.mod")):
            yield f"{path.relative_to(ROOT)}", path.read_text(encoding="latin-1")
        for path in sorted((ROOT / folder).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            explaining = {
                id(node.body[0].value)
                for node in ast.walk(tree)
                if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
                and node.body
                and isinstance(node.body[0], ast.Expr)
            }
            for top in tree.body:
                strings = [
                    node.value
                    for node in ast.walk(top)
                    if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in explaining
                ]
                if strings:
                    yield f"{path.relative_to(ROOT)}", "\n".join(strings)


def effects() -> dict[str, str]:
    """The programs of effects.txt by the names they show."""
    found: dict[str, str] = {}
    for file in (EFFECTS, OF_CONTROLLER):
        for line in file.read_text(encoding="ascii").splitlines():
            if line.startswith("== "):
                first, *others = line.split()[1:]
                for name in (first, *others):
                    found.setdefault(name.lower(), f'{file.relative_to(ROOT)} "{first}"')
    for word in VALUES.read_text(encoding="ascii").partition("\n[")[2].split():
        found.setdefault(word.partition("=")[0].strip("[]").lower(), f"{VALUES.relative_to(ROOT)}")
    return found


def coverage() -> dict[str, dict[str, tuple[str, str]]]:
    """For each kind and name, its state and the test that shows it."""
    library = World().controller.tasks["T_ROB_R"].library
    shown, texts = effects(), list(programs())
    found: dict[str, dict[str, tuple[str, str]]] = {}
    for kind in KINDS:
        for name in kind.names:
            state, test = kind.provided(library, name), shown.get(name.lower(), "")
            if state is not None and not test:
                pattern = re.compile(kind.pattern.replace("{0}", re.escape(name)))
                test = next((where for where, text in texts if pattern.search(text)), "")
            if state == Support.DONE.value and not test:
                state = UNTESTED
            found.setdefault(kind.title, {})[name] = state or MISSING, test
    return found


def option_of(name: str) -> str:
    """The option a name belongs to, "" for what a YuMi has."""
    return next((option for option, pattern in OPTIONS.items() if re.fullmatch(pattern, name)), "")


def tables() -> str:
    """The sections with the tables, in Markdown."""
    table = coverage()
    lines = [
        "## What a YuMi has",
        "",
        "The names of RobotWare's base, and of the options in the stock controller's list.",
        "",
        _HEADER,
        _RULE,
    ]
    own = {
        title: {name: found for name, found in names.items() if not option_of(name)} for title, names in table.items()
    }
    lines += [_row(title, names) for title, names in own.items()]
    lines.append(
        _row("All", {f"{title} {name}": found for title, names in own.items() for name, found in names.items()})
    )
    others = {
        title: {name: found for name, found in names.items() if option_of(name)} for title, names in table.items()
    }
    lines += ["", "## What belongs to options that a YuMi does not have", "", _HEADER, _RULE]
    lines += [_row(title, names) for title, names in others.items()]
    for title, names in own.items():
        lines += ["", f"## {title}"]
        for state in STATES:
            chosen = [(name, test) for name, (found, test) in names.items() if found == state]
            if chosen:
                listed = ", ".join(f"[`{n}`](../../{test})" if test else f"`{n}`" for n, test in chosen)
                lines += ["", f"### {title}, {state} ({len(chosen)})", "", f"{listed}."]
    lines += ["", "## Names of options that a YuMi does not have"]
    for option in OPTIONS:
        lines += ["", f"### {option[0].upper()}{option[1:]}", ""]
        for state in STATES:
            chosen_names = [
                name
                for names in others.values()
                for name, (found, _) in names.items()
                if found == state and option_of(name) == option
            ]
            if chosen_names:
                lines += [f"{state[0].upper()}{state[1:]}: {', '.join(f'`{name}`' for name in chosen_names)}.", ""]
        lines.pop()
    return "\n".join(lines) + "\n"


_HEADER = "| | " + " | ".join(STATES) + " | all | done |"
_RULE = "|---|" + "---:|" * (len(STATES) + 2)


def _row(title: str, names: dict[str, tuple[str, str]]) -> str:
    counts = [sum(found == state for found, _ in names.values()) for state in STATES]
    share = f"{counts[0] / len(names):.1%}" if names else ""
    return f"| {title} | {' | '.join(map(str, counts))} | {len(names)} | {share} |"


if __name__ == "__main__":
    sys.stdout.write(tables())
