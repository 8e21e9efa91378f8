#!/bin/sh
# Driver and application in two network namespaces, as on two machines (docs/how-to/two-machines.md); needs root and iproute2.
# Prints how many joint states the "application machine" receives in five seconds, with multicast and with static peers.
set -eu
A=yumi-a B=yumi-b LINK=yumi-link
end() { kill $CHILDREN 2>/dev/null || true; wait; ip netns delete $A; ip netns delete $B; }
CHILDREN=
ip netns add $A
ip netns add $B
trap end EXIT
ip link add $LINK-a netns $A type veth peer name $LINK-b netns $B
ip -n $A address add 10.77.0.1/24 dev $LINK-a
ip -n $B address add 10.77.0.2/24 dev $LINK-b
for each in $A:$LINK-a $B:$LINK-b; do
    ip -n "${each%%:*}" link set lo up
    ip -n "${each%%:*}" link set "${each##*:}" up
done
export ROS_DOMAIN_ID=42
ip netns exec $A yumi controller > /dev/null 2>&1 &
CHILDREN="$CHILDREN $!"
ip netns exec $A sh -c 'until curl -s http://127.0.0.1:8080/ > /dev/null; do :; done'
ip netns exec $A yumi up --robot 127.0.0.1 --network > "${LOG:-/dev/null}" 2>&1 &
CHILDREN="$CHILDREN $!"
COUNT='
import sys, time
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
rclpy.init()
node, heard = rclpy.create_node("application"), []
node.create_subscription(JointState, "joint_states", heard.append, qos_profile_sensor_data)
end = time.monotonic() + 40.0
while not heard and time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
first, end = len(heard), time.monotonic() + 5.0
while time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
print(f"{sys.argv[1]}: {len(heard) - first} joint states in 5 s")
'
ip netns exec $B env ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET python -c "$COUNT" "multicast"
ip -n $B link set $LINK-b multicast off
ip netns exec $B env ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET ROS_STATIC_PEERS=10.77.0.1 python -c "$COUNT" "static peer"
ip netns exec $B env ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST python -c "$COUNT" "closed graph"
