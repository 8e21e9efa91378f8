"""Loads the compiled part of :mod:`yumi.robot.collision`, and compiles it where that was not done before.

A wheel contains the library. From a clone or with colcon it is made from ``collision.cpp`` by the machine's compiler,
once for each edition of that file: in the clone's ``build`` folder, or else in the user's cache.
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
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from yumi.catalogue import message, said_by
from yumi.errors import MissingPrerequisite

SOURCE = Path(__file__).with_name("collision.cpp")
HEADERS = tuple(SOURCE.with_name(f"collision_{part}.hpp") for part in ("shapes", "paths", "limiter"))
PACKAGED = SOURCE.with_name("libcollision.so")
"""Where a wheel has the library."""

COMPILERS = ("c++", "g++", "clang++")
FLAGS = ("-std=c++17", "-O3", "-shared", "-fPIC")  # for any processor of its kind: what is compiled may be copied
PORTABLE = ("-static-libstdc++", "-static-libgcc")
"""For a library that is copied to machines with another C++ library, as in a wheel."""

NAMED = 3
"""Boundaries that a decision has at most."""


class Boundary(ctypes.Structure):
    """What an arm must not cross, where it was compared; as in ``collision.cpp``.

    Attributes:
        beyond: how far the arm is on this side of it [m].
        distance: of the parts from each other [m].
        least: the least product of ``normal`` and a position [m].
        normal: by how much a radian of each joint moves the parts apart [m/rad], (7,).
        part: the number of the arm's part.
        other: and of the other one.
    """

    _fields_ = (
        ("beyond", ctypes.c_double),
        ("distance", ctypes.c_double),
        ("least", ctypes.c_double),
        ("normal", ctypes.c_double * 7),
        ("part", ctypes.c_int64),
        ("other", ctypes.c_int64),
    )


class Decision(ctypes.Structure):
    """Why a command is clear or not; as in ``collision.cpp``.

    Attributes:
        distances: that were calculated, or what took as long.
        part: the number of the arm's part that may come too near to another one; -1 where none is known.
        other: and of the other one.
        distance: of the parts in the posture that was compared last [m].
        boundary_count: how many of ``boundaries`` there are.
        boundaries: near the arm, nearest first.
    """

    _fields_ = (
        ("distances", ctypes.c_int64),
        ("part", ctypes.c_int64),
        ("other", ctypes.c_int64),
        ("distance", ctypes.c_double),
        ("boundary_count", ctypes.c_int64),
        ("boundaries", Boundary * NAMED),
    )


@cache
def load() -> ctypes.PyDLL:
    """The library, with the types of its functions.

    Raises:
        MissingPrerequisite: it has to be compiled, and cannot be.
    """
    path = PACKAGED if PACKAGED.exists() else compiled()
    try:
        # Calls take microseconds: giving up the interpreter for them would let other threads in between.
        library = ctypes.PyDLL(str(path))
    except OSError as error:
        raise MissingPrerequisite(
            message("collision_library_not_loaded", error=said_by(error), path=str(path))
        ) from error
    address, integer, double, boolean = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double, ctypes.c_bool
    packed, decision = ctypes.c_char_p, ctypes.POINTER(Decision)
    for name, result, *arguments in (
        ("model_new", address, address, address, address, address, integer),
        ("model_delete", None, address),
        ("model_contacts", integer, address, address, double, integer, boolean, address),
        ("limiter_new", address, address, address, address),
        ("limiter_delete", None, address),
        ("limiter_permit", None, address, address),
        ("limiter_is_slow", boolean, address, packed),
        ("limiter_segments", integer, address, packed, boolean, integer, address, address),
        ("limiter_is_clear", boolean, address, integer, packed, packed, packed, double, integer, decision),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def compiled() -> Path:
    """The library compiled for this machine, from this edition of the source; compiles it where there is none."""
    made_of = [each.read_bytes() for each in (SOURCE, *HEADERS)]
    made_of.append(" ".join((*FLAGS, os.environ.get("CXX", ""), sysconfig.get_platform())).encode())
    digest = hashlib.sha256(b"".join(made_of)).hexdigest()[:16]
    root = SOURCE.parents[3]
    if (root / "pyproject.toml").exists() and os.access(root, os.W_OK):
        folder = root / "build" / "collision"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "yumi-ros2"
    library = folder / f"collision-{digest}.so"
    if not library.exists():
        compile_to(library)
    return library


def compile_to(library: Path, *flags: str) -> None:
    """Compile the source. Several processes may do so at once: each replaces the file by the same one, at once."""
    named = shlex.split(os.environ.get("CXX", ""))
    compiler = named or [found for name in COMPILERS if (found := shutil.which(name))][:1]
    if not compiler:
        raise MissingPrerequisite(message("compiler_missing"))
    try:
        library.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=library.parent) as folder:
            own = Path(folder) / library.name
            command = [*compiler, *FLAGS, *flags, "-o", str(own), str(SOURCE)]
            done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                said = message("collision_library_not_compiled", command=shlex.join(command), output=done.stderr)
                raise MissingPrerequisite(said)
            own.replace(library)
    except OSError as error:
        raise MissingPrerequisite(message("collision_library_not_written", error=said_by(error))) from error


if __name__ == "__main__":
    sys.stdout.write(f"{compiled()}\n")
