"""Begin EGM on the right arm of a virtual YuMi, so that another egm_*.py example can command it.

Start `yumi controller` and the other example, with the right arm's port, in terminals of their own before:
`python examples/egm_joint.py 6512`. Then `python examples/egm_start.py joint` (or `velocity`, or `stream`).
"""

import sys

from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.clock import SystemClock
from abb_runtime.rws.client import RwsClient
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import EgmMotionSettings

MODES = ("joint", "velocity", "stream")


def main(mode: str, address: str) -> None:
    motion = EgmMotionSettings(pos_corr_gain=0.0 if mode == "velocity" else 1.0, max_speed_deviation=20.0)
    with RwsClient(address) as client:
        bringup = Bringup(client, motion, SystemClock(), print, arms=(Side.RIGHT,))
        bringup.make_ready()
        if mode == "stream":
            client.pulse_signal("EGM_START_STREAM")
        else:
            bringup.start_egm()


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in MODES:
        sys.exit(f"Usage: python examples/egm_start.py {'|'.join(MODES)} [address:port]")
    try:
        main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "127.0.0.1:8080")
    except YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
