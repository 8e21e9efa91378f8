"""Move one joint of the right arm by 10 degrees and back; needs `yumi up` in another terminal."""

import sys
from math import radians

from yumi.errors import YumiError
from yumi.robot.joints import Side, joints
from yumi.ros.clients import ArmClient, RobotManagerClient, application


def main() -> None:
    with application("move_one_joint") as spinner:
        manager = RobotManagerClient(spinner)
        arm = ArmClient(spinner, Side.RIGHT, on_state=lambda time, position: None)

        with manager.egm_running(print):
            start = arm.wait_for_state(5.0)
            for goal in (joints([*start[:6], start[6] + radians(10.0)]), start):
                arm.reach(goal, tolerance=radians(0.1), timeout=10.0)
                print(f"arrived, largest joint error {arm.error(goal):.5f} rad")


if __name__ == "__main__":
    try:
        main()
    except YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
