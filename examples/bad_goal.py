"""Ask for what the right arm cannot do, and show the driver's answer; needs `yumi up` in another terminal."""

import sys

from rcl_interfaces.msg import Log

from yumi.errors import YumiError
from yumi.robot.joints import Side, joints
from yumi.ros.clients import ArmClient, RobotManagerClient, application


def main() -> None:
    with application("bad_goal") as spinner:
        manager = RobotManagerClient(spinner)
        arm = ArmClient(spinner, Side.RIGHT, on_state=lambda time, position: None)
        refusals: list[str] = []

        def take(line: Log) -> None:
            if line.msg.startswith("Goal refused"):
                refusals.append(line.msg)

        spinner.node.create_subscription(Log, "/rosout", take, 100)
        with manager.egm_running(print):
            start = arm.wait_for_state(5.0)
            bad = joints([start[0], 4.0, *start[2:]])  # yumi_joint_2_r goes from -2.5 to 0.76 rad

            def is_answered() -> bool:
                arm.move(bad)
                return bool(refusals)

            spinner.until(is_answered, 10.0, "An answer to the bad goal")
            print(refusals[0])
            print(f"the arm moved by {arm.error(start):.4f} rad")


if __name__ == "__main__":
    try:
        main()
    except YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
