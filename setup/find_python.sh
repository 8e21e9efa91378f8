#!/bin/sh
# Prints the Python that sets the project up: the first on PATH that has all of what prerequisites.py asks for, else the
# one that comes nearest, so that the refusal names it. Candidates are run, not looked at: a pyenv shim exists, yet fails.
# Usage: find_python.sh [the user's choice]

if [ -n "$1" ]; then
    command -v "$1" && exit 0
    echo "setup: there is no Python named '$1'; give a path or a name on PATH, as in: make setup PYTHON=python3.12" >&2
    exit 1
fi

grade() {
    "$1" -c '
import sys, os
suitable = (3, 10) <= sys.version_info[:2] <= (3, 14)
try:
    import sysconfig
    whole = os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h"))
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(":")
    if set(prefixes) - {"", os.environ.get("VIRTUAL_ENV")}: # a sourced ROS 2, not only an activated .venv
        import rclpy
except ImportError:
    whole = False
print("whole" if suitable and whole else "suitable" if suitable else "wrong" if sys.version_info >= (3, 6) else "ancient")
' 2>/dev/null
}

if [ -f .venv/pyvenv.cfg ]; then # the Python that .venv was made with, so that nothing is searched from then on
    home=$(sed -n 's/^home = //p' .venv/pyvenv.cfg)
    version=$(sed -n 's/^version[a-z_]* = \([0-9]*\.[0-9]*\).*/\1/p' .venv/pyvenv.cfg)
    [ "$(grade "$home/python$version")" = whole ] && echo "$home/python$version" && exit 0
fi

suitable='' wrong=''
for name in python3 python3.14 python3.13 python3.12 python3.11 python3.10; do
    IFS=:
    for folder in $PATH; do
        candidate="$folder/$name"
        [ -x "$candidate" ] || continue
        case $(grade "$candidate") in
            whole) echo "$candidate"; exit 0 ;;
            suitable) suitable=${suitable:-$candidate} ;;
            wrong) wrong=${wrong:-$candidate} ;;
        esac
    done
    unset IFS
done

if [ -n "$suitable$wrong" ]; then
    echo "${suitable:-$wrong}"
    exit 0
fi
echo "setup: no Python 3 was found on PATH; install Python 3.10 to 3.14, or name one: make setup PYTHON=/path/to/python3" >&2
exit 1
