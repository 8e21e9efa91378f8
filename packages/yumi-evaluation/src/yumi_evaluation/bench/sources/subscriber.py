"""Subscribes to every topic of the driver and counts what comes; prints the counts as JSON when its input ends."""

from __future__ import annotations

import json
import sys
from collections import Counter
from threading import Event as Flag
from threading import Thread

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from parent import end_with_parent
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

TOPICS = {
    "/r/joint_states": JointState,
    "/l/joint_states": JointState,
    "/joint_states": JointState,
    "/r/egm_state": DiagnosticStatus,
    "/l/egm_state": DiagnosticStatus,
    "/diagnostics": DiagnosticArray,
    "/robot_description": String,
}


def main() -> None:
    counts = Counter(dict.fromkeys(TOPICS, 0))
    rclpy.init()
    node = rclpy.create_node("benchmark_subscriber")
    for topic, kind in TOPICS.items():
        qos = QoSProfile(depth=10)
        if kind is String:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        node.create_subscription(kind, topic, lambda _, topic=topic: counts.update([topic]), qos)
    is_over = Flag()
    Thread(target=lambda: (sys.stdin.read(), is_over.set()), daemon=True).start()
    print("ready", flush=True)
    while not is_over.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    print(json.dumps(counts), flush=True)
    node.destroy_node()
    rclpy.shutdown()


end_with_parent()
main()
