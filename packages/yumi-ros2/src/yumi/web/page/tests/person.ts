/** A person with an emulated headset, for tests of the page in a browser: window.person presses grips and moves hands. */

import { metaQuest3, XRDevice } from "iwer";

const device = new XRDevice(metaQuest3, { fovy: 1 });
device.installRuntime({ forceInstall: true });
device.position.set(0, 1.6, 0);

// This version of iwer takes a matrix where WebXR has a transform.
const { prototype } = (window as unknown as { XRReferenceSpace: { prototype: { getOffsetReferenceSpace(offset: unknown): unknown } } }).XRReferenceSpace;
const { getOffsetReferenceSpace } = prototype;
prototype.getOffsetReferenceSpace = function (offset: XRRigidTransform) {
  return getOffsetReferenceSpace.call(this, offset.matrix);
};

type Side = "right" | "left";

function hand(side: Side): NonNullable<XRDevice["controllers"][Side]> {
  return device.controllers[side]!;
}

function put(side: Side, [x, y, z]: number[], [qw, qx, qy, qz]: number[] = [1, 0, 0, 0]): void {
  hand(side).position.set(x!, y!, z!);
  hand(side).quaternion.set(qx!, qy!, qz!, qw!);
}

/** Whether the headset sees a hand; it guesses where one is that it does not see. */
function see(side: Side, isSeen: boolean): void {
  const space = hand(side).inputSource.gripSpace as unknown as Record<symbol, { emulated?: boolean }>;
  for (const symbol of Object.getOwnPropertySymbols(space)) {
    if ("emulated" in space[symbol]!) space[symbol]!.emulated = !isSeen;
  }
}

for (const side of ["right", "left"] as const) see(side, true);
put("right", [0.25, 1.2, -0.4]);
put("left", [-0.25, 1.2, -0.4]);

type Frame = { time: number } & Partial<Record<Side, { pose?: number[] }>>;
/** The frames that the page has sent, the newest last. */
const frames: { sentAt: number; frame: Frame }[] = [];
let onFrame: (frame: Frame) => void = () => undefined;
let isCut = false;
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (data): void {
  const message = JSON.parse(String(data)) as { type: string; frame: Frame };
  if (message.type === "teleoperate") {
    if (isCut) return; // the link is lost
    frames.push({ sentAt: performance.now() / 1000, frame: message.frame });
    onFrame(message.frame);
  }
  send.call(this, data);
};

/** Move a hand that holds the clutch; the time of the first frame of this that the page sends [s], null where it does
 * not let the clutch count. */
function move(side: Side, position: number[]): Promise<number | null> {
  const before = String(frames.at(-1)?.frame[side]?.pose);
  put(side, position);
  return new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error("The page has sent no frame of the hand for 5 s.")), 5000);
    onFrame = ({ time, [side]: hand }) => {
      if (hand?.pose && String(hand.pose) === before) return;
      onFrame = () => undefined;
      resolve(hand?.pose ? time : null);
    };
  });
}

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
    device, put, move, see, frames, pulses,
    squeeze: (side: Side, value: number) => hand(side).updateButtonValue("squeeze", value),
    pull: (side: Side, value: number) => hand(side).updateButtonValue("trigger", value),
    hide: (isHidden: boolean) => device.updateVisibilityState(isHidden ? "visible-blurred" : "visible"),
    cut: (isLost: boolean) => (isCut = isLost),
  },
});
