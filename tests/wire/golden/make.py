"""Make the golden datagrams of this folder that have a ``.txtpb``, with protobuf's own compiler.

Run from the repository: ``python tests/wire/golden/make.py``. The others (see ``index.json``) are replies recorded from
other EGM implementations, or made from the published schema; they cannot be made anew here.
"""

import subprocess
import sys
from pathlib import Path

GOLDEN = Path(__file__).parent
SCHEMA = GOLDEN.parents[2] / "packages" / "abb-protocols" / "src"


def make(text: Path) -> None:
    kind = "EgmRobot" if text.stem.startswith("robot") else "EgmSensor"
    command = [
        sys.executable,
        "-m",
        "grpc_tools.protoc",
        f"-I{SCHEMA}",
        f"--encode=yumi.egm.{kind}",
        "abb_protocols/egm/egm.proto",
    ]
    encoded = subprocess.run(command, input=text.read_bytes(), stdout=subprocess.PIPE, check=True).stdout
    text.with_suffix(".bin").write_bytes(encoded)


if __name__ == "__main__":
    for each in sorted(GOLDEN.glob("*.txtpb")):
        make(each)
