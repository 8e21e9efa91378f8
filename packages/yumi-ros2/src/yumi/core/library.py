"""The library of the compiled core: compiled where needed, loaded, with the structures that cross to Python.

A wheel contains the library. From a clone or with colcon the library is made from the sources of this folder by the
machine's compiler, once for each edition of them: in the clone's ``build`` folder, or else in the user's cache.
``python -m yumi.core.library collision egm`` compiles ahead what needs no package.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory
from typing import NamedTuple
from weakref import finalize

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import MissingPrerequisite

CORE_FOLDER = Path(__file__).parent
_UNITS = ("collision", "egm", "limiter")
"""The sources that are compiled each for itself, with all headers of this folder; the last one includes Ruckig's."""

PACKAGED_LIBRARY = CORE_FOLDER / "libcore.so"
"""Where a wheel has the library."""

_COMPILERS = ("c++", "g++", "clang++")
COMPILER_FLAGS = (
    "-std=c++17",
    "-O3",
    "-fPIC",
    "-pthread",
    "-ffp-contract=off",
    "-fno-semantic-interposition",
    "-fvisibility-inlines-hidden",
)  # for any processor of its kind, and the same on each
STANDARD_LIBRARY = ("-lstdc++",)
"""Before Ruckig's library, which contains newer copies of the C++ library's functions than some machines have."""

PORTABLE_LIBRARY = ("-static-libgcc", "-static-libstdc++", "-l:libstdc++.a")
"""In place of that, for a library that is copied to machines with another C++ library, as in a wheel."""


STATE_STRUCT, COMMAND_STRUCT = Struct("2dq21dq"), Struct("14dq")
"""An arm's state: time, dt, session, 21 values, whether it follows; a command: 14 values, whether a speed is fed."""

BRAKED_STRUCT = Struct("2dq21dq14dq")
"""A cycle that the fallback thread has answered: the state, and the command."""

SAMPLED_STRUCT = Struct("4q14d")
"""A controller's formula: its session, address and number of its goals, whether it goes to the goal itself; goal and
gains."""

MOST_BRAKED = 250
"""Of these are kept: a second."""

SETTINGS_STRUCT, TABLE_STRUCT, MOTION_STRUCT, SETPOINT_STRUCT = (
    Struct("45d"),
    Struct("234s"),
    Struct("58d"),
    Struct("21d"),
)
LIMITS_STRUCT, REPORT_STRUCT, UNREADABLE_DATAGRAM_STRUCT = Struct("35d"), Struct("q15d3q"), Struct("4q7d")
"""What else crosses, as the headers declare it."""


class LimiterExchange(ctypes.Structure):
    """What crosses between the limiter of an arm and Python; as ``LimiterExchange`` in ``limiter_handle.hpp``.

    Attributes:
        state: as it was checked, :data:`STATE_STRUCT`.
        command: sent, :data:`COMMAND_STRUCT`.
        limiter_state: what is done with the arm.
        forbidden: the event that the table forbids in that state.
        is_implausible: whether the arm holds since no position can be believed.
        are_references_ignored: whether it holds since the robot does not follow.
        is_at_rest: whether the command stands, and does not lead the robot any more.
        must_settle: whether the arm is held until its command is back where the arm is.
        is_other_arm: whether ``implausible_position`` is where the other arm is.
        implausible_position: that came last [rad].
        counters: as :class:`yumi.control.counters.LimiterCounters`.
    """

    _fields_ = (
        ("state", ctypes.c_char * STATE_STRUCT.size),
        ("command", ctypes.c_char * COMMAND_STRUCT.size),
        ("limiter_state", ctypes.c_int64),
        ("forbidden", ctypes.c_int64),
        ("is_implausible", ctypes.c_int64),
        ("are_references_ignored", ctypes.c_int64),
        ("is_at_rest", ctypes.c_int64),
        ("must_settle", ctypes.c_int64),
        ("is_other_arm", ctypes.c_int64),
        ("implausible_position", ctypes.c_double * 7),
        ("counters", ctypes.c_int64 * 7),
    )


class LimitedParts(ctypes.Structure):
    """The parts that must not come nearer to each other; as ``Limited`` in ``progress_check.hpp``.

    Attributes:
        part: number of the arm's part.
        other: and of the other one.
        is_stale: whether the other arm is neither heard nor was read since.
        distance: of the parts [m].
    """

    _fields_ = (
        ("part", ctypes.c_int64),
        ("other", ctypes.c_int64),
        ("is_stale", ctypes.c_int64),
        ("distance", ctypes.c_double),
    )


class SessionValues(ctypes.Structure):
    """What others read of an EGM session; as ``SessionValues`` in ``egm_session.hpp``.

    Attributes:
        state: of the session: none, begun, resumed, open, silent.
        number: of the session.
        period: robot time since the message answered before [s].
        counters: as :class:`yumi.egm.egm_session.SessionCounters`.
        arrivals: as :class:`yumi.egm.egm_session.Arrivals`.
    """

    _fields_ = (
        ("state", ctypes.c_int64),
        ("number", ctypes.c_int64),
        ("period", ctypes.c_double),
        ("counters", ctypes.c_int64 * 6),
        ("arrivals", ctypes.c_double * 4),
    )


class ArmExchange(ctypes.Structure):
    """What Python reads of a cycle; as ``ArmExchange`` in ``arm_handle.hpp``.

    Attributes:
        begun_at, received_at, checked_at, sampled_at, limited_at, encoded_at, sent_at: when a cycle began that the core
            has sampled, and when the stages were done, by :func:`time.monotonic` [s]; sampled_at is 0 of other cycles.
        send_error: errno of the answer, 0 where the answer has left.
        answer_size: of the answer, 0 where a value of the command is not finite.
        datagram_size: of the robot's newest.
        foreign: datagrams of other senders that waited when the robot began.
        answer: to the robot.
        datagram: the robot's newest.
    """

    _fields_ = (
        ("begun_at", ctypes.c_double),
        ("received_at", ctypes.c_double),
        ("checked_at", ctypes.c_double),
        ("sampled_at", ctypes.c_double),
        ("limited_at", ctypes.c_double),
        ("encoded_at", ctypes.c_double),
        ("sent_at", ctypes.c_double),
        ("send_error", ctypes.c_int64),
        ("answer_size", ctypes.c_int64),
        ("datagram_size", ctypes.c_int64),
        ("foreign", ctypes.c_int64),
        ("answer", ctypes.c_char * 160),
        ("datagram", ctypes.c_char * 2048),
    )


SHARED_GOAL = Struct("qqqdd14d")
"""A goal in shared memory, of a ``SharedBuffer[SessionGoal]``: its write begun and finished, then its fields."""

_SIZES = (
    STATE_STRUCT.size,
    COMMAND_STRUCT.size,
    SETTINGS_STRUCT.size,
    TABLE_STRUCT.size,
    ctypes.sizeof(LimiterExchange),
    ctypes.sizeof(LimitedParts),
    MOTION_STRUCT.size,
    SETPOINT_STRUCT.size,
    LIMITS_STRUCT.size,
    REPORT_STRUCT.size,
    UNREADABLE_DATAGRAM_STRUCT.size,
    ctypes.sizeof(SessionValues),
    ctypes.sizeof(ArmExchange),
    BRAKED_STRUCT.size * MOST_BRAKED,
    SAMPLED_STRUCT.size,
    SHARED_GOAL.size,
)
"""Of what crosses, in the order of ``core_sizes`` in ``limiter.cpp``."""


@cache
def load() -> ctypes.PyDLL:
    """The library, with the types of its functions.

    Raises:
        MissingPrerequisite: it has to be compiled, and cannot be.
    """
    path = PACKAGED_LIBRARY if PACKAGED_LIBRARY.exists() else _compiled()
    try:
        # Calls take microseconds: giving up the interpreter for them would let other threads in between.
        library, released = ctypes.PyDLL(str(path)), ctypes.CDLL(str(path))
    except OSError as error:
        raise MissingPrerequisite(message("core_not_loaded", error=said_by(error), path=str(path))) from error
    address, integer, double, boolean = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double, ctypes.c_bool
    packed = ctypes.c_char_p
    for name, result, *arguments in (
        ("core_sizes", None, address),
        ("model_new", address, address, address, address, address, integer),
        ("model_delete", None, address),
        ("model_contacts", integer, address, address, double, integer, boolean, address),
        ("collisions_new", address, address, address, address),
        ("collisions_delete", None, address),
        ("arm_collisions_new", address, address, integer, double),
        ("arm_collisions_delete", None, address),
        ("arm_collisions_permit", None, address, address),
        ("arm_collisions_accepts", boolean, address, integer, packed, packed, packed, boolean),
        ("arm_collisions_note_sent", None, address, integer, packed, packed, packed),
        ("arm_collisions_note_measured", None, address, integer, packed),
        ("arm_collisions_limited", boolean, address, integer, address),
        ("limiter_new", address, packed, packed, address, integer),
        ("limiter_delete", None, address),
        ("limiter_pair", None, address, address),
        ("limiter_lose", integer, address, integer),
        ("limiter_scale_speed", None, address, double),
        ("codec_decode", boolean, packed, integer, address, address),
        ("codec_is_running", boolean, integer, integer, integer),
        ("codec_encode", integer, ctypes.c_uint32, packed, address),
        ("session_new", address, double),
        ("session_delete", None, address),
        ("session_begin_batch", None, address),
        ("session_takes", boolean, address, ctypes.c_uint32, double, double),
        ("session_note_malformed", None, address),
        ("session_next_seqno", ctypes.c_uint32, address),
        ("session_settle", None, address),
        ("session_silence", double, address, double),
        ("session_close_if_silent", boolean, address, double),
        ("arm_new", address, address, address, integer),
        ("arm_delete", None, address),
        ("arm_receive", integer, address, double),
        ("arm_accept", integer, address, packed, integer, double, boolean, boolean),
        ("arm_prepare", None, address, packed),
        ("arm_reply", integer, address, packed, boolean),
        ("arm_settle", integer, address),
        ("arm_take_braked", integer, address, address),
        ("fallback_thread_new", address),
        ("fallback_thread_add", None, address, address),
        ("fallback_thread_start", boolean, address),
        ("fallback_thread_delete", None, address),
        ("fallback_thread_wait", integer, address, integer, integer),
        ("motion_step_towards", boolean, packed, packed, packed, double, packed, address),
        ("motion_step_to_rest", None, packed, packed, double, packed, address),
        ("motion_ramp_speed", None, double, double, double, double, double, double, double, address),
        ("motion_speed_to_stop", double, double, double, double),
        ("motion_braking_path", None, double, double, double, double, address),
    ):
        function = getattr(released if name == "fallback_thread_wait" else library, name)
        function.restype, function.argtypes = result, arguments
        setattr(library, name, function)
    sizes = (integer * len(_SIZES))()
    library.core_sizes(sizes)
    if tuple(sizes) != _SIZES:  # one would read and write beside what the other has
        raise RuntimeError(f"the core at {path} has structures of {tuple(sizes)} bytes, and Python of {_SIZES}")
    return library


def new_handle(owner: object, kind: str, *arguments: object) -> int:
    """Make an object of the core that is deleted with its owner.

    Args:
        owner: what has it in Python.
        kind: how its functions are called: ``limiter`` for ``limiter_new`` and ``limiter_delete``.
        arguments: of the first of both.

    Raises:
        MemoryError: there is no memory for it.
        MissingPrerequisite: as :func:`load`.
    """
    library = load()
    handle: int | None = getattr(library, f"{kind}_new")(*arguments)
    if not handle:
        raise MemoryError(f"the core has no memory for: {kind}")
    finalize(owner, getattr(library, f"{kind}_delete"), handle).atexit = False  # threads may still use it
    return handle


def _compiled() -> Path:
    """The library compiled for this machine, from this edition of the sources; compiles it where there is none."""
    library = _folder() / f"core-{_edition(_UNITS[-1])}.so"
    if not library.exists():
        compile_to(library)
    return library


def compile_to(library: Path, standard: Sequence[str] = STANDARD_LIBRARY) -> None:
    """Compile and link the sources. Several processes may do so at once: each replaces a file by the same one, at once.

    Args:
        library: where the library goes.
        standard: how the C++ library is linked, :data:`STANDARD_LIBRARY` or :data:`PORTABLE_LIBRARY`.
    """
    objects = map(str, _compile_units(_UNITS))
    _run([[*_compiler(), "-shared", "-pthread", *objects, *standard, str(_ruckig().archive)]], [library])


def _compile_units(names: Sequence[str]) -> list[Path]:
    """The objects of some sources, those that are missing compiled at the same time."""
    objects = [_folder() / f"{name}-{_edition(name)}.o" for name in names]
    missing = [(name, file) for name, file in zip(names, objects, strict=True) if not file.exists()]
    commands = []
    for name, _ in missing:
        include = [] if name != _UNITS[-1] else ["-isystem", str(_ruckig().headers)]
        commands.append([*_compiler(), *COMPILER_FLAGS, *include, "-c", str(CORE_FOLDER / f"{name}.cpp")])
    _run(commands, [file for _, file in missing])
    return objects


def _folder() -> Path:
    root = CORE_FOLDER.parents[min(4, len(CORE_FOLDER.parents) - 1)]  # of a clone
    if (root / "pyproject.toml").exists() and os.access(root, os.W_OK):
        return root / "build" / "core"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "yumi-ros2"


def _edition(unit: str) -> str:
    """Of the sources and of what they are compiled with; Ruckig is a part of the last unit, and of the library."""
    made_of = [file.read_bytes() for file in sorted(CORE_FOLDER.glob("*.[ch]pp"))]
    made_of.append(" ".join((*COMPILER_FLAGS, os.environ.get("CXX", ""), sysconfig.get_platform())).encode())
    if unit == _UNITS[-1]:
        made_of.append(_ruckig().version.encode())
    return hashlib.sha256(b"".join(made_of)).hexdigest()[:16]


def _compiler() -> list[str]:
    named = shlex.split(os.environ.get("CXX", ""))
    compiler = named or [found for name in _COMPILERS if (found := shutil.which(name))][:1]
    if not compiler:
        raise MissingPrerequisite(message("compiler_missing"))
    return compiler


class Ruckig(NamedTuple):
    """What Ruckig's wheel contains: the folder of its headers, and its library."""

    headers: Path
    archive: Path
    version: str


def _ruckig() -> Ruckig:
    try:
        wheel = metadata.distribution("ruckig")
        found = {Path(str(file)).name: Path(str(file.locate())) for file in wheel.files or ()}
        return Ruckig(found["ruckig.hpp"].parents[1], found["libruckig.a"], wheel.version)
    except (metadata.PackageNotFoundError, KeyError) as error:
        raise MissingPrerequisite(message("ruckig_without_library")) from error


def _run(commands: Sequence[Sequence[str]], outputs: Sequence[Path]) -> None:
    """Run commands at the same time, each of which makes a file; each file appears when it is complete."""
    if not commands:
        return
    try:
        outputs[0].parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=outputs[0].parent) as folder:
            own = [Path(folder) / output.name for output in outputs]
            full = [[*command, "-o", str(file)] for command, file in zip(commands, own, strict=True)]
            running = [
                subprocess.Popen(each, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
                for each in full
            ]
            printed = [process.communicate()[0].decode(errors="replace") for process in running]
            for command, process, said in zip(full, running, printed, strict=True):
                if process.returncode != 0:
                    raise MissingPrerequisite(message("core_not_compiled", command=shlex.join(command), output=said))
            for file, output in zip(own, outputs, strict=True):
                file.replace(output)
    except OSError as error:
        raise MissingPrerequisite(message("core_not_written", error=said_by(error))) from error


if __name__ == "__main__":
    if len(sys.argv) > 1:
        _compile_units(sys.argv[1:])
    else:
        sys.stdout.write(f"{_compiled()}\n")
