/** Devices with which a person teleoperates, apart from a headset: what their axes, buttons and keys mean for the arms. */

import { SIDES, type Hand, type Hands, type Side } from "./messages";

/** The tool's speed for a stick that is pushed to its end, before the scale [m/s], [rad/s]. */
export const STICK_SPEED = 0.15;
export const STICK_TURNING = 0.5;

const DEAD = 0.12; // a stick that is let go rests nearer to 0 than this
const CAP_END = 350; // counts of a SpaceMouse at the end of an axis
const SILENT = 0.2; // [s] a SpaceMouse whose cap is not at rest reports each 8 to 16 ms: a silent one is out of range, or gone
const SPACEMOUSE_VENDORS = [0x256f, 0x046d]; // 3Dconnexion, and Logitech of older ones

export interface Device {
  /** What it reports for the arms that it moves; null where there is no device. */
  read(arms: readonly Side[]): Hands | null;
  /** Have the person feel that an arm has met a limit, where the device can. */
  pulse(side: Side): void;
}

/** A clutch counts when it is pressed while the device may move the arms: what was held before must be released first. */
export class ClutchGate {
  /** The clutches that are held and do not count. */
  readonly isBlocked: Record<Side, boolean> = { right: false, left: false };
  private readonly isFree: Record<Side, boolean> = { right: false, left: false };

  /** What a device reports, with the clutches that count. @param isOpen whether the device may move the arms now. */
  pass(hands: Hands, isOpen: boolean): Record<Side, Hand> {
    const of = (side: Side): Hand => {
      const hand = hands[side];
      if (!isOpen || !hand) this.isFree[side] = false;
      else if (!hand.clutch) this.isFree[side] = true;
      this.isBlocked[side] = Boolean(hand?.clutch) && !this.isFree[side];
      return hand?.clutch && this.isFree[side] ? hand : { clutch: false };
    };
    return { right: of("right"), left: of("left") };
  }
}

/** A velocity of deflections from -1 to 1: x away from the person, y to the left, z up; and turns about them. */
export function twistOf(translation: readonly number[], turn: readonly number[]): number[] {
  return [...translation.map((each) => STICK_SPEED * each), ...turn.map((each) => STICK_TURNING * each)];
}

/** A deflection without the part in which a stick rests. */
export function beyondRest(value: number): number {
  const size = Math.max(0, Math.abs(value) - DEAD) / (1 - DEAD);
  return Math.sign(value) * Math.min(1, size);
}

const KEY_AXES: Record<string, [of: "move" | "turn" | "elbow", axis: number, sign: number]> = {
  KeyW: ["move", 0, 1], KeyS: ["move", 0, -1], KeyA: ["move", 1, 1], KeyD: ["move", 1, -1], KeyR: ["move", 2, 1], KeyF: ["move", 2, -1],
  KeyQ: ["turn", 0, -1], KeyE: ["turn", 0, 1], ArrowUp: ["turn", 1, 1], ArrowDown: ["turn", 1, -1],
  ArrowLeft: ["turn", 2, 1], ArrowRight: ["turn", 2, -1], KeyZ: ["elbow", 0, -1], KeyX: ["elbow", 0, 1],
};
const CLUTCH_KEY = "Space";
const GRIPPER_KEYS: Record<string, number> = { KeyC: 1, KeyV: 0 };

/** The keyboard, by the place of the keys: W is where a keyboard of the United States has it. */
export class Keyboard implements Device {
  private readonly held = new Set<string>();
  private gripper: number | undefined;

  /** Whether a key means something here. */
  static isKnown(code: string): boolean {
    return code === CLUTCH_KEY || code in KEY_AXES || code in GRIPPER_KEYS;
  }

  press(code: string): void {
    this.held.add(code);
    if (this.held.has(CLUTCH_KEY)) this.gripper = GRIPPER_KEYS[code] ?? this.gripper;
  }

  release(code: string): void {
    this.held.delete(code);
    if (code === CLUTCH_KEY) this.gripper = undefined;
  }

  /** A keyboard that has lost the focus does not report what is released. */
  releaseAll(): void {
    this.held.clear();
    this.gripper = undefined;
  }

  read(arms: readonly Side[]): Hands {
    const axes = { move: [0, 0, 0], turn: [0, 0, 0], elbow: [0] };
    for (const code of this.held) {
      const [of, axis, sign] = KEY_AXES[code] ?? [];
      if (of) axes[of][axis!]! += sign!;
    }
    const hand = handOf(this.held.has(CLUTCH_KEY), twistOf(axes.move, axes.turn), STICK_TURNING * axes.elbow[0]!, this.gripper);
    return Object.fromEntries(arms.map((side) => [side, hand]));
  }

  pulse(): void {} // a keyboard cannot
}

/** What is read of a gamepad. */
export interface GamepadInputs {
  axes: readonly number[];
  buttons: readonly { pressed: boolean; value: number }[];
}

const BUMPERS: Record<Side, number> = { left: 4, right: 5 };

/** A gamepad of the standard layout: the bumpers are the clutches, the sticks, triggers and cross move and turn the tool. */
export class Pad implements Device {
  private readonly grippers: Partial<Record<Side, number>> = {};

  /** @param pads of the browser, as navigator.getGamepads() has them. */
  constructor(private readonly pads: () => readonly (Gamepad | null)[]) {}

  /** The gamepad that is used: the first of the standard layout. */
  get pad(): Gamepad | null {
    return this.pads().find((each) => each?.connected && each.mapping === "standard") ?? null;
  }

  read(arms: readonly Side[]): Hands | null {
    const { pad } = this;
    return pad && this.handsOf(pad, arms);
  }

  handsOf({ axes, buttons }: GamepadInputs, arms: readonly Side[]): Hands {
    const axis = (index: number) => beyondRest(axes[index] ?? 0);
    const value = (index: number) => buttons[index]?.value ?? 0;
    const isPressed = (index: number) => buttons[index]?.pressed ?? false;
    const twist = twistOf([-axis(1), -axis(0), value(7) - value(6)], [value(15) - value(14), -axis(3), -axis(2)]);
    const hands: Hands = {};
    for (const side of arms) {
      const isHeld = isPressed(BUMPERS[side]);
      if (!isHeld) delete this.grippers[side];
      else if (isPressed(0) || isPressed(1)) this.grippers[side] = isPressed(0) ? 1 : 0;
      hands[side] = handOf(isHeld, twist, STICK_TURNING * (value(12) - value(13)), this.grippers[side]);
    }
    return hands;
  }

  pulse(): void {
    const actuator = this.pad?.vibrationActuator;
    void actuator?.playEffect("dual-rumble", { duration: 120, strongMagnitude: 0.7, weakMagnitude: 0.4 }).catch(() => undefined);
  }
}

/** A SpaceMouse over WebHID: the cap moves and turns the tool, the left button is the clutch, the right one the gripper. */
export class SpaceMouse implements Device {
  private device: HidDevice | null = null;
  private readonly axes = [0, 0, 0, 0, 0, 0]; // x to the right, y towards the person, z down; turns about them
  private buttons = 0;
  private gripper: number | undefined;
  private moved = -Infinity; // when the cap was reported last [s]

  /** @param now the time [s]. */
  constructor(private readonly now: () => number = () => performance.now() / 1000) {}

  get name(): string {
    return this.device?.productName ?? "";
  }

  /** Have a person choose it; whether there is one then. */
  async connect(hid: Hid): Promise<boolean> {
    const filters = SPACEMOUSE_VENDORS.map((vendorId) => ({ vendorId, usagePage: 1, usage: 8 }));
    const [device] = await hid.requestDevice({ filters });
    if (!device) return this.device !== null;
    if (!device.opened) await device.open();
    this.forget();
    this.device = device;
    device.addEventListener("inputreport", ({ reportId, data }) => device === this.device && this.take(reportId, data));
    hid.addEventListener("disconnect", ({ device: gone }) => gone === this.device && this.forget());
    return true;
  }

  private forget(): void {
    this.device = null;
    this.letGo();
  }

  /** Whatever is held must be pressed again. */
  private letGo(): void {
    this.axes.fill(0);
    this.buttons = 0;
    this.gripper = undefined;
  }

  /** A report: 1 has the translation, of newer devices the turn, too; 2 has the turn, 3 the buttons. */
  take(report: number, data: DataView): void {
    if (report === 3) {
      const before = this.buttons;
      this.buttons = data.getUint8(0);
      if (!(this.buttons & 1)) this.gripper = undefined;
      else if (this.buttons & ~before & 2) this.gripper = this.gripper === 1 ? 0 : 1;
      return;
    }
    const first = report === 1 ? 0 : report === 2 ? 3 : 6;
    if (first < 6) this.moved = this.now();
    const count = Math.min(6 - first, Math.floor(data.byteLength / 2));
    for (let index = 0; index < count; index += 1) {
      this.axes[first + index] = Math.max(-1, Math.min(1, data.getInt16(2 * index, true) / CAP_END));
    }
  }

  read(arms: readonly Side[]): Hands | null {
    return this.device && this.hands(arms);
  }

  hands(arms: readonly Side[]): Hands {
    if (this.axes.some((each) => beyondRest(each) !== 0) && this.now() - this.moved > SILENT) this.letGo();
    const [right, back, down, tilt, roll, twist] = this.axes.map(beyondRest) as [number, number, number, number, number, number];
    const hand = handOf(Boolean(this.buttons & 1), twistOf([-back, -right, -down], [-roll, -tilt, -twist]), 0, this.gripper);
    return Object.fromEntries(arms.map((side) => [side, hand]));
  }

  pulse(): void {} // it cannot
}

function handOf(clutch: boolean, twist: number[], elbow: number, gripper: number | undefined): Hand {
  return { clutch, twist, ...(elbow ? { elbow } : {}), ...(gripper === undefined ? {} : { gripper }) };
}

/** The arms that a device moves, of a person's choice. */
export function chosenArms(choice: "both" | Side): readonly Side[] {
  return choice === "both" ? SIDES : [choice];
}

// ---- WebHID, of which TypeScript has no types

export interface HidDevice {
  readonly opened: boolean;
  readonly productName: string;
  open(): Promise<void>;
  addEventListener(type: "inputreport", take: (event: { reportId: number; data: DataView }) => void): void;
}

export interface Hid {
  requestDevice(options: { filters: object[] }): Promise<HidDevice[]>;
  addEventListener(type: "disconnect", take: (event: { device: HidDevice }) => void): void;
}
