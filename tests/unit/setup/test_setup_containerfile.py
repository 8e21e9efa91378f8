"""The images' recipe: it copies what there is and starts what there is, as an ordinary user."""

from __future__ import annotations

import json
import re
import subprocess
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import click
import pytest
from wheel_hook import IN_AMENT_INDEX

from yumi.cli.main import main

ROOT = Path(__file__).resolve().parents[3]


class Stage(NamedTuple):
    """One FROM with its instructions: a word and its arguments each."""

    name: str
    base: str
    instructions: list[tuple[str, str]]

    def all(self, word: str) -> list[str]:
        return [arguments for each, arguments in self.instructions if each == word]


def stages() -> dict[str, Stage]:
    text = (ROOT / "Containerfile").read_text().replace("\\\n", " ")
    found: dict[str, Stage] = {}
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        word, arguments = line.split(maxsplit=1)
        if word == "FROM":
            base, name = re.fullmatch(r"(\S+) AS (\S+)", arguments).groups()  # type: ignore[union-attr]
            found[name] = stage = Stage(name, base, [])
        else:
            stage.instructions.append((word, arguments))
    return found


STAGES = stages()
IMAGES = [STAGES["controller"], STAGES["driver"]]


def test_every_instruction_is_one_of_a_containerfile() -> None:
    words = {word for stage in STAGES.values() for word, _ in stage.instructions}
    assert words <= {"RUN", "COPY", "WORKDIR", "ENV", "USER", "EXPOSE", "ENTRYPOINT", "CMD"}


def test_every_source_that_is_copied_is_in_the_clone_and_not_ignored() -> None:
    ignored = (ROOT / ".dockerignore").read_text().split()
    sources = [source for stage in STAGES.values() for each in stage.all("COPY") for source in each.split()[:-1]]
    assert {"packages", "interfaces", "pyproject.toml", "uv.lock"} <= set(sources)
    assert [source for source in sources if not (ROOT / source).exists()] == []
    assert [source for source in sources if any(fnmatch(source, pattern) for pattern in ignored)] == []


def test_everything_that_the_wheels_are_made_from_is_copied() -> None:
    copied = {source for each in STAGES["build"].all("COPY") for source in each.split()[:-1]}
    assert len(IN_AMENT_INDEX) == 5
    assert {"packages", "config", *(name.partition("/")[0] for name in IN_AMENT_INDEX)} <= copied


def test_stages_build_on_each_other_and_on_one_python() -> None:
    (outside,) = [stage.base for stage in STAGES.values() if stage.base not in STAGES]
    assert re.fullmatch(r"docker\.io/library/python:3\.12-slim@sha256:[0-9a-f]{64}", outside)
    mounts = [re.findall(r"from=(\w+)", each) for image in IMAGES for each in image.all("RUN")]
    assert mounts == [["build"], ["build"]]


@pytest.mark.parametrize("image", IMAGES, ids=lambda image: image.name)
def test_image_installs_nothing_but_the_wheel_and_what_is_pinned_with_hashes(image: Stage) -> None:
    (run,) = image.all("RUN")
    pinned, wheel = re.findall(r"pip install [^&]*", run)
    assert {"--require-hashes", "--no-deps", "--only-binary"} <= set(pinned.split())
    assert re.search(r"--requirement /dist/requirements(-ros)?\.txt", pinned)
    assert {"--no-index", "--no-deps"} <= set(wheel.split())
    assert wheel.split()[-1].endswith(".whl")


@pytest.mark.parametrize("image", IMAGES, ids=lambda image: image.name)
def test_image_runs_a_command_that_exists_as_an_ordinary_user(image: Stage) -> None:
    words = [word for word, _ in image.instructions]
    assert image.all("USER") == ["yumi"]
    assert words.index("RUN") < words.index("USER") < words.index("ENTRYPOINT")
    (entry,), (name, *arguments) = json.loads(image.all("ENTRYPOINT")[0]), json.loads(image.all("CMD")[0])
    assert entry == "yumi"
    command = main.get_command(click.Context(main), name)
    assert command is not None
    command.make_context(name, arguments, parent=click.Context(main))


def test_ports_are_those_of_the_commands() -> None:
    controller = main.get_command(click.Context(main), "controller")
    assert controller is not None
    defaults = {option.name: option.default for option in controller.params}
    assert STAGES["controller"].all("EXPOSE") == [f"{defaults['rws_port']}/tcp"]
    arms = " ".join(f"{defaults[f'{side}_egm_port']}/udp" for side in ("left", "right"))
    assert STAGES["driver"].all("EXPOSE") == [arms]


def test_wheels_are_made_where_the_images_look_for_them() -> None:
    printed = subprocess.run(
        ["make", "--dry-run", "wheels"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert printed.count(f"hatchling build -t wheel -d {ROOT}/dist") == 2
    exported = re.findall(r"export .*--no-annotate (.*)--output-file dist/(\S+)", printed)
    with_ros = "--only-group products --only-group ros --only-group record "
    assert exported == [("--only-group products ", "requirements.txt"), (with_ros, "requirements-ros.txt")]
    assert all("source=/build/dist" in image.all("RUN")[0] for image in IMAGES)
    assert STAGES["build"].all("WORKDIR") == ["/build"]
