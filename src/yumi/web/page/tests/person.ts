/** A person with an emulated headset, for tests of the page in a browser: window.person presses grips and moves hands. */

import { metaQuest3, XRDevice } from "iwer";

const device = new XRDevice(metaQuest3, { fovy: 1 });
device.installRuntime({ forceInstall: true });
device.position.set(0, 1.6, 0);

type Side = "right" | "left";

function hand(side: Side): NonNullable<XRDevice["controllers"][Side]> {
  return device.controllers[side]!;
}

function put(side: Side, [x, y, z]: number[], [qw, qx, qy, qz]: number[] = [1, 0, 0, 0]): void {
  hand(side).position.set(x!, y!, z!);
  hand(side).quaternion.set(qx!, qy!, qz!, qw!);
}

put("right", [0.25, 1.2, -0.4]);
put("left", [-0.25, 1.2, -0.4]);

/** The frames that the page has sent, the newest last. */
const frames: { sentAt: number; frame: Record<string, unknown> }[] = [];
let isCut = false;
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (data): void {
  const message = JSON.parse(String(data)) as { type: string; frame?: Record<string, unknown> };
  if (message.type === "teleoperate") {
    if (isCut) return; // the link is lost
    frames.push({ sentAt: performance.now() / 1000, frame: message.frame! });
  }
  send.call(this, data);
};

/** The pulses that a person has felt, by hand. */
const pulses: Record<Side, number> = { right: 0, left: 0 };
for (const side of ["right", "left"] as const) {
  for (const actuator of (hand(side).inputSource.gamepad as unknown as { hapticActuators: { pulse: () => Promise<boolean> }[] }).hapticActuators) {
    actuator.pulse = () => {
      pulses[side] += 1;
      return Promise.resolve(true);
    };
  }
}

Object.assign(window, {
  person: {
    device, put, frames, pulses,
    squeeze: (side: Side, value: number) => hand(side).updateButtonValue("squeeze", value),
    pull: (side: Side, value: number) => hand(side).updateButtonValue("trigger", value),
    see: (side: Side, isSeen: boolean) => (hand(side).connected = isSeen),
    hide: (isHidden: boolean) => device.updateVisibilityState(isHidden ? "visible-blurred" : "visible"),
    cut: (isLost: boolean) => (isCut = isLost),
  },
});
