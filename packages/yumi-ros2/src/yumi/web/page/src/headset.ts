/** A WebXR headset or telephone with which a person teleoperates: grip is the clutch, trigger the gripper. */

import { beyondRest, type Device } from "./devices";
import { SIDES, type Hands, type Side } from "./messages";
import type { HandColor, Scene } from "abb-view/scene";

const ELBOW_SPEED = 0.5; // [rad/s] of the arm angle, for a thumbstick at its end
const THUMBSTICK = 2; // its first axis in the layout xr-standard
const TRIGGER = 0;
const SQUEEZE = 1;
const LONGEST = 0.1; // [s] between two frames, for the elbow

export type HeadsetMode = "immersive-vr" | "immersive-ar";

/** The pose of a hand in the operator's frame, x away, y to the left, z up: x, y, z [m] and w, x, y, z. */
export function operatorPose({ position: p, orientation: q }: Pick<XRRigidTransform, "position" | "orientation">): number[] {
  return [-p.z, -p.x, p.y, q.w, -q.z, -q.x, q.y];
}

/** Where a person's eyes are at first, and where they look to, its -z; upright. */
export function placeOf({ position: p, orientation: q }: Pick<XRRigidTransform, "position" | "orientation">): {
  position: DOMPointInit; orientation: DOMPointInit;
} {
  const forward = { x: -2 * (q.x * q.z + q.w * q.y), z: -(1 - 2 * (q.x * q.x + q.y * q.y)) };
  const heading = Math.atan2(-forward.x, -forward.z);
  return {
    position: { x: p.x, y: p.y, z: p.z },
    orientation: { x: 0, y: Math.sin(heading / 2), z: 0, w: Math.cos(heading / 2) },
  };
}

export class Headset implements Device {
  session: XRSession | null = null;
  private readonly elbows: Record<Side, number> = { right: 0, left: 0 };
  private hands: Hands = {};
  private space: XRReferenceSpace | null = null; // the person's, once it is known where they look to
  private time = 0; // of the last frame [s]

  /** @param onFrame takes the time of each frame, on the headset's clock [s]. @param onEnd the session is over. */
  constructor(
    private readonly scene: () => Scene | null,
    private readonly arms: () => readonly Side[],
    private readonly onFrame: (time: number) => void,
    private readonly onEnd: () => void,
  ) {}

  static async supports(mode: HeadsetMode): Promise<boolean> {
    return (await navigator.xr?.isSessionSupported(mode).catch(() => false)) ?? false;
  }

  /** Whether the person sees the page's picture and nothing before it, such as a menu of the headset. */
  get isVisible(): boolean {
    return this.session?.visibilityState === "visible" && this.space !== null;
  }

  /** @param yaw of the person from the robot [rad]: the robot stands before them, turned so. */
  async begin(mode: HeadsetMode, yaw: number): Promise<void> {
    const scene = this.scene();
    if (!scene || !navigator.xr || this.session) return;
    const session = await navigator.xr.requestSession(mode);
    this.session = session;
    session.addEventListener("end", () => this.forget());
    const origin = await scene.enter(session, yaw, mode === "immersive-vr", (time, frame) => this.take(time / 1000, frame));
    // A headset that has moved its origin reports a hand that stands somewhere else: the reference is lost.
    origin.addEventListener("reset", () => (this.space = null));
  }

  end(): void {
    void this.session?.end().catch(() => undefined);
  }

  private forget(): void {
    this.session = this.space = null;
    this.hands = {};
    this.onEnd();
  }

  read(): Hands | null {
    return this.session && this.hands;
  }

  private take(time: number, frame: XRFrame): void {
    const scene = this.scene();
    if (!scene || !this.session) return;
    this.hands = {};
    const dt = Math.min(LONGEST, time - this.time);
    this.time = time;
    if (!this.space) {
      const pose = frame.getViewerPose(scene.origin());
      if (pose) {
        const { position, orientation } = placeOf(pose.transform);
        this.space = scene.moveOrigin(new XRRigidTransform(position, orientation));
      }
    } else if ((this.session as { interactionMode?: string }).interactionMode === "screen-space") {
      this.takeTelephone(frame, this.space);
    } else {
      for (const source of this.session.inputSources) this.takeSource(source, frame, this.space, dt);
    }
    this.onFrame(time);
  }

  /** A telephone is the hand itself; a finger on it holds the clutch. */
  private takeTelephone(frame: XRFrame, space: XRReferenceSpace): void {
    const pose = frame.getViewerPose(space);
    if (!pose || pose.emulatedPosition) return;
    const clutch = [...this.session!.inputSources].some((source) => source.targetRayMode === "screen");
    for (const side of this.arms()) this.hands[side] = { clutch, pose: operatorPose(pose.transform) };
  }

  private takeSource(source: XRInputSource, frame: XRFrame, space: XRReferenceSpace, dt: number): void {
    const side = SIDES.find((each) => each === source.handedness);
    const { gripSpace, gamepad } = source;
    if (!side || !gripSpace || !gamepad || !this.arms().includes(side)) return;
    const pose = frame.getPose(gripSpace, space);
    if (!pose || pose.emulatedPosition) return; // it is not seen, and is somewhere else
    this.elbows[side] += ELBOW_SPEED * dt * beyondRest(gamepad.axes[THUMBSTICK] ?? 0);
    this.hands[side] = {
      clutch: gamepad.buttons[SQUEEZE]?.pressed ?? false,
      pose: operatorPose(pose.transform),
      gripper: gamepad.buttons[TRIGGER]?.value ?? 0,
      elbow: this.elbows[side],
    };
    this.scene()!.showHand(side, pose.transform.matrix);
  }

  /** How the arms take the clutches, as a person sees it at their hands. */
  show(colors: Partial<Record<Side, HandColor>>): void {
    for (const side of SIDES) this.scene()?.colorHand(side, colors[side] ?? "idle");
  }

  pulse(side: Side): void {
    for (const source of this.session?.inputSources ?? []) {
      if (source.handedness !== side) continue;
      const [actuator] = (source.gamepad as unknown as { hapticActuators?: { pulse(share: number, ms: number): unknown }[] })?.hapticActuators ?? [];
      actuator?.pulse(0.6, 60);
    }
  }
}
