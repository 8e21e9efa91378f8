/** Teleoperation: what a person's device reports goes to the server as frames, while the tab Teleoperate is open. */

import type { Connection } from "./connection";
import { at, choice, input, press } from "abb-view/dom";
import { ClutchGate, chosenArms, Keyboard, Pad, SpaceMouse, type Device, type Hid } from "./devices";
import { Headset, type HeadsetMode } from "./headset";
import { SIDES, type Hands, type Said, type Side, type TeleoperatedMessage } from "./messages";
import type { Picture } from "./picture";
import type { HandColor } from "abb-view/scene";
import { hasControl, type DeviceName, type Page, type Store } from "./store";
import { showTeleoperation } from "./teleoperation_panel";
import { toast } from "abb-view/toast";

const PERIOD = 16; // [ms] between two frames, of a device that does not pace them itself
const IDLE = 0.05; // [s] between two frames without a held clutch; the driver takes the link as lost when the newest is 0.2 s old
const BACKLOG = 4096; // [bytes] that wait here: more frames would come late
const SHOWN = 0.25; // [s] between two times that the link is shown
const PULSE = 0.15; // [s] between two pulses of a device that feels a limit

export class Teleoperation {
  private readonly gate = new ClutchGate();
  private readonly keyboard = new Keyboard();
  private readonly spaceMouse = new SpaceMouse();
  private readonly headset: Headset;
  private readonly devices: Record<DeviceName, Device>;
  private refused: Said | null = null; // why the newest frame was that was refused, while its clutch is held
  private sentAt = 0; // [s]
  private isHeld = false; // a clutch, in the frame that was sent last
  private shownAt = 0;
  private pulsedAt = 0;

  constructor(private readonly store: Store, private readonly connection: Connection, picture: Picture) {
    const arms = () => chosenArms(store.page.teleoperatedArms);
    this.headset = new Headset(() => picture.scene, arms, (time) => this.step(time), () => this.release());
    const pad = new Pad(() => navigator.getGamepads());
    this.devices = { keyboard: this.keyboard, gamepad: pad, spacemouse: this.spaceMouse, headset: this.headset };
    this.bindChoices();
    this.bindKeys();
    this.bindConnections();
    setInterval(() => this.headset.session || this.step(performance.now() / 1000), PERIOD);
    for (const event of ["blur", "pagehide"]) window.addEventListener(event, () => this.headset.session || this.release());
    document.addEventListener("visibilitychange", () => document.hidden && !this.headset.session && this.release());
    store.show((page) => {
      if (!isOffered(page)) this.release();
      showTeleoperation(page, this.nameOf(page.device, pad), this.headset.session !== null);
    });
  }

  /** What became of a frame. */
  take(answer: TeleoperatedMessage): void {
    const { store } = this;
    if (answer.error) this.refused = answer.error;
    const message = this.withBlocked(answer);
    const now = performance.now() / 1000;
    const { teleoperated: before } = store.page;
    // Views are called for what a person must see at once, not for each of sixty frames a second.
    const isNew = JSON.stringify([before?.arms, before?.error]) !== JSON.stringify([message.arms, message.error]);
    if (message.error) {
      this.gate.pass({}, false); // what is held now must be pressed again
      if (isNew) toast(message.error.sentence);
    }
    if (isNew || now - this.shownAt > SHOWN) {
      this.shownAt = now;
      store.change({ teleoperated: { ...message, delay: Math.max(0, now - message.time) } });
    }
    this.showAtHands(message, now);
  }

  /** The same, with the clutches that the page itself does not let count. */
  private withBlocked(message: TeleoperatedMessage): TeleoperatedMessage {
    const blocked = SIDES.filter((side) => this.gate.isBlocked[side] && message.arms[side]);
    if (!blocked.length && !message.error) this.refused = null;
    const arms = blocked.map((side) => [side, { ...message.arms[side]!, clutch: "inert" as const, why: this.refused }]);
    return { ...message, arms: { ...message.arms, ...Object.fromEntries(arms) as TeleoperatedMessage["arms"] } };
  }

  private showAtHands({ arms }: TeleoperatedMessage, now: number): void {
    const colors: Partial<Record<Side, HandColor>> = {};
    const met: Side[] = [];
    for (const side of SIDES) {
      const { clutch, limited } = arms[side] ?? { clutch: "released", limited: null };
      const isLimited = clutch === "engaged" && limited !== null;
      colors[side] = isLimited ? "limited" : clutch === "engaged" || clutch === "inert" ? clutch : "idle";
      if (isLimited) met.push(side);
    }
    if (this.headset.session) this.headset.show(colors);
    if (!met.length || now - this.pulsedAt < PULSE) return;
    this.pulsedAt = now;
    for (const side of met) this.devices[this.store.page.device].pulse(side);
  }

  /** Read the device and send its frame. @param time of it, on the device's clock [s]. */
  private step(time: number): void {
    const { page } = this.store;
    if (!isOffered(page)) return;
    const hands = this.devices[page.device].read(chosenArms(page.teleoperatedArms));
    this.send(hands ?? {}, hands !== null && this.isAttended(page.device), time);
  }

  /** Whether the person is at the device: a hidden page, or one without the focus, does not see what is let go. */
  private isAttended(device: DeviceName): boolean {
    return device === "headset" ? this.headset.isVisible : !document.hidden && document.hasFocus();
  }

  private send(hands: Hands, isOpen: boolean, time: number): void {
    const { page } = this.store;
    if (this.connection.backlog > BACKLOG) return void this.gate.pass({}, false); // a release may be lost: press again
    const passed = this.gate.pass(hands, isOpen);
    const isHeld = SIDES.some((side) => passed[side].clutch);
    if (!isHeld && !this.isHeld && time - this.sentAt < IDLE) return;
    if (time <= this.sentAt) return;
    this.isHeld = isHeld;
    this.sentAt = time;
    const isHeadset = page.device === "headset";
    const settings = { scale: page.scale, yaw: page.yaw, ...(isHeadset ? {} : { speed: 0.2, turning: 1 }) };
    const frame = { time, seen: page.stateTime, ...passed, settings };
    this.connection.send({ type: "teleoperate", frame, is_headset: isHeadset });
  }

  /** Let go of every clutch, whatever is held. */
  private release(): void {
    this.keyboard.releaseAll();
    this.gate.pass({}, false);
    if (!this.isHeld) return;
    this.isHeld = false;
    const time = Math.max(performance.now() / 1000, this.sentAt + 1e-6);
    this.sentAt = time;
    if (this.connection.isOpen) this.connection.send({ type: "teleoperate", frame: { time, seen: this.store.page.stateTime } });
  }

  private bindChoices(): void {
    const { store } = this;
    choice("device").addEventListener("change", () => {
      this.release();
      if (this.headset.session) this.headset.end();
      store.change({ device: choice("device").value as DeviceName });
      if (store.page.device === "keyboard") at("keys").focus();
    });
    choice("teleop-arms").addEventListener("change", () => {
      this.release();
      store.change({ teleoperatedArms: choice("teleop-arms").value as Page["teleoperatedArms"] });
    });
    choice("stands").addEventListener("change", () => {
      this.release();
      if (this.headset.session) this.headset.end(); // in which the robot stands otherwise
      store.change({ yaw: (Number(choice("stands").value) * Math.PI) / 180 });
    });
    input("scale").addEventListener("input", () => store.change({ scale: input("scale").valueAsNumber / 100 }));
  }

  private bindKeys(): void {
    const keys = at("keys");
    keys.addEventListener("keydown", (event) => {
      if (event.metaKey) return this.release(); // macOS reports no key that is let go while Command is held
      if (event.ctrlKey || event.altKey || !Keyboard.isKnown(event.code)) return;
      event.preventDefault();
      if (!event.repeat) this.keyboard.press(event.code); // one that is held on was pressed before the focus was lost
    });
    keys.addEventListener("keyup", (event) => this.keyboard.release(event.code));
    keys.addEventListener("blur", () => this.store.page.device === "keyboard" && this.release());
    keys.addEventListener("click", () => keys.focus());
  }

  private bindConnections(): void {
    press("connect-spacemouse", async () => {
      const { hid } = navigator as { hid?: Hid };
      if (!hid) toast("This browser has no WebHID, which a SpaceMouse needs: use Chrome or Edge, or yumi teleop in a terminal.");
      else await this.spaceMouse.connect(hid).catch((error: unknown) => toast(`The SpaceMouse cannot be opened: ${String(error)}`));
      this.store.change({});
    });
    for (const [id, mode] of [["enter-vr", "immersive-vr"], ["enter-ar", "immersive-ar"]] as [string, HeadsetMode][]) {
      press(id, () => this.headset.begin(mode, this.store.page.yaw).then(
        () => this.store.change({}), (error: unknown) => toast(`The headset does not begin: ${String(error)}`)));
      void Headset.supports(mode).then((isSupported) => (at(id).dataset.supported = String(isSupported)));
    }
    for (const event of ["gamepadconnected", "gamepaddisconnected"]) window.addEventListener(event, () => this.store.change({}));
  }

  private nameOf(device: DeviceName, pad: Pad): string {
    if (device === "gamepad") return pad.pad?.id ?? "";
    return device === "spacemouse" ? this.spaceMouse.name : device;
  }
}

/** Whether the device of this page moves the arms. */
function isOffered(page: Page): boolean {
  return hasControl(page) && page.tab === "teleop";
}
