/** Jogging: the arm moves while a button or key is held, or while the handle is dragged. */

import type { Connection } from "./connection";
import { at, choice, input, make, press, text } from "abb-view/dom";
import { shortened, rotate, unit } from "abb-view/frames";
import type { Jog, Vector } from "./messages";
import type { Picture } from "./picture";
import { permissions } from "./permissions";
import { frameOf, hasControl, type Handle, type Page, type Store } from "./store";
import { toast } from "abb-view/toast";

const MAX_JOINT_SPEED = 0.5; // [rad/s] as the server allows
const MAX_LINEAR = 0.15; // [m/s]
const MAX_ANGULAR = 0.5; // [rad/s]
const JOG_PERIOD = 20; // [ms] between two messages while a key is held; 60 ms after the last one the arm brakes
const PULL = 4; // [1/s] a tool follows its handle so fast

/** Keys on the picture, with the axis and the direction in which they move the tool, or turn it. */
const KEYS: Record<string, [number, number]> = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], PageUp: [2, 1], PageDown: [2, -1],
};
const ELBOW_KEYS: Record<string, number> = { Home: -MAX_JOINT_SPEED, End: MAX_JOINT_SPEED };

/** Speeds of the tool: [m/s], [rad/s], and of the elbow [rad/s]. */
export interface ToolSpeeds {
  linear?: Vector;
  angular?: Vector;
  elbow?: number;
}

interface Held {
  hold: number;
  message: Jog;
  target: HTMLElement;
  key: string; // by its place: what it is called depends on others that are held
  timer: ReturnType<typeof setInterval>;
}

/** The message that jogs the tool in the frame that is chosen; null where the frame is none. */
export function toolJog(page: Page, { linear, angular, elbow }: ToolSpeeds): Jog | null {
  const frame = frameOf(page);
  if (!frame && page.frame !== "base" && page.frame !== "tool") return null;
  const scaled = (speeds: Vector): Vector => {
    const slow = speeds.map((each) => each * page.jogSpeed) as Vector;
    return frame ? rotate(frame.quaternion, slow) : slow;
  };
  return {
    type: "jog_tool", arm: page.arm, frame: page.frame === "tool" ? "tool" : "base",
    ...(linear ? { linear: scaled(linear) } : {}),
    ...(angular ? { angular: scaled(angular) } : {}),
    ...(elbow ? { elbow: elbow * page.jogSpeed } : {}),
  };
}

/** The same jog without motion. */
export function atRest(jog: Jog): Jog {
  if (jog.type === "jog_joints") return { ...jog, speeds: jog.speeds.map(() => 0) };
  return { type: jog.type, arm: jog.arm, frame: jog.frame };
}

export class Jogging {
  private held: Held | null = null;
  private holds = Date.now() % 1e9; // a hold has a number of its own, in each page

  constructor(private readonly store: Store, private readonly connection: Connection, private readonly picture: Picture) {
    this.buildPad();
    this.bindFrame();
    this.bindPicture();
    store.show((page) => {
      const whyNot = permissions(page).move; // a button that is disabled is let go unseen
      if (!hasControl(page)) this.end();
      else if (whyNot && this.end()) toast(whyNot);
    });
    for (const event of ["blur", "pagehide"]) window.addEventListener(event, () => this.end());
    document.addEventListener("visibilitychange", () => document.hidden && this.end());
  }

  /** End what is held; with a number, only where it is this hold. Whether something was held. */
  end(hold?: number): boolean {
    const { held } = this;
    if (!held || (hold !== undefined && held.hold !== hold)) return false;
    clearInterval(held.timer);
    held.target.classList.remove("held");
    this.held = null;
    this.send(atRest(held.message), held.hold);
    return true;
  }

  /** Two buttons that jog a joint down and up. */
  jointButtons(index: number, axis: number): HTMLButtonElement[] {
    return [-1, 1].map((sign) => {
      const made = make("button", {
        textContent: sign < 0 ? "−" : "+", className: "hold", ariaLabel: `Jog axis ${axis} ${sign < 0 ? "down" : "up"}`,
      });
      made.dataset.jog = `joint ${index} ${sign}`;
      this.holdable(made, ({ arm, jogSpeed }) => ({
        type: "jog_joints", arm, speeds: Array.from({ length: 7 }, (_, each) => (each === index ? sign * MAX_JOINT_SPEED * jogSpeed : 0)),
      }));
      return made;
    });
  }

  private send(jog: Jog, hold: number): void {
    this.connection.send({ ...jog, hold, seen: this.store.page.stateTime });
  }

  private begin(target: HTMLElement, message: (page: Page) => Jog | null, { isDragged = false, key = "" } = {}): void {
    this.end();
    if (!hasControl(this.store.page)) return;
    this.holds += 1;
    const first = message(this.store.page);
    if (!first) {
      toast("There is no work object yet: bring the fingertips to it and press “Work object here”.");
      return;
    }
    target.classList.add("held");
    // A speed that was chosen when the key was pressed stays; a handle is dragged on.
    const beat = (): void => {
      if (!this.held) return;
      if (isDragged) this.held.message = message(this.store.page) ?? this.held.message;
      this.send(this.held.message, this.held.hold);
    };
    this.held = { hold: this.holds, message: first, target, key, timer: setInterval(beat, JOG_PERIOD) };
    beat();
  }

  private holdable(target: HTMLButtonElement, message: (page: Page) => Jog | null): void {
    target.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || target.disabled) return;
      target.setPointerCapture(event.pointerId);
      this.begin(target, message);
    });
    const end = () => this.held?.target === target && this.end(); // a button loses the focus after the next one was pressed
    for (const event of ["pointerup", "pointercancel", "lostpointercapture", "blur", "keyup"]) target.addEventListener(event, end);
    target.addEventListener("keydown", (event) => {
      if (event.metaKey) return void end(); // macOS reports no key that is let go while Command is held
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) this.begin(target, message);
    });
    target.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  private buildPad(): void {
    const cells: [label: string, name: string, title: string, speeds: ToolSpeeds][] = [];
    ["x", "y", "z"].forEach((axis, index) => {
      for (const sign of [-1, 1]) {
        const label = `${axis.toUpperCase()} ${sign < 0 ? "−" : "+"}`;
        cells.push([label, `linear ${axis} ${sign}`, `Move the tool along ${axis}`, { linear: unit(index, sign * MAX_LINEAR) }]);
      }
      for (const sign of [-1, 1]) {
        const label = `R${axis} ${sign < 0 ? "−" : "+"}`;
        cells.push([label, `angular ${axis} ${sign}`, `Turn the tool about ${axis}`, { angular: unit(index, sign * MAX_ANGULAR) }]);
      }
    });
    for (const sign of [-1, 1]) {
      const title = "Turn the elbow; the tool stays";
      cells.push([`Elbow ${sign < 0 ? "−" : "+"}`, `elbow ${sign}`, title, { elbow: sign * MAX_JOINT_SPEED }]);
    }
    for (const [label, name, title, speeds] of cells) {
      const made = make("button", { textContent: label, title, className: speeds.elbow ? "hold wide" : "hold" });
      made.dataset.jog = name;
      this.holdable(made, (page) => toolJog(page, speeds));
      at("pad").append(made);
    }
  }

  private bindFrame(): void {
    const { store } = this;
    input("jog-speed").addEventListener("input", () => store.change({ jogSpeed: input("jog-speed").valueAsNumber / 100 }));
    choice("jog-frame").addEventListener("change", () => store.change({ frame: choice("jog-frame").value }));
    press("work-object", () => {
      const workObject = this.picture.scene?.tipFrame(store.page.arm);
      if (!workObject) return;
      localStorage.setItem("work object", JSON.stringify(workObject));
      store.change({ workObject });
    });
    store.show(showFrames);
  }

  private bindPicture(): void {
    const { picture, store } = this;
    const canvas = at("scene");
    choice("handle").addEventListener("change", () => store.change({ handle: choice("handle").value as Handle }));
    canvas.addEventListener("keydown", (event) => this.jogByKey(canvas, event));
    canvas.addEventListener("keyup", (event) => this.held?.key === event.code && this.end());
    for (const event of ["blur", "pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(event, () => this.held?.target === canvas && this.end());
    }
    picture.onDrag = (isDragged) => {
      if (isDragged && store.page.handle.startsWith("jog")) this.begin(canvas, (page) => this.pulled(page), { isDragged });
      else if (!isDragged && this.held?.target === canvas) this.end();
    };
  }

  /** The jog that leads the tool to its handle. */
  private pulled({ arm, handle, jogSpeed }: Page): Jog | null {
    const pull = this.picture.scene?.pull(arm);
    if (!pull) return null;
    const toward = (vector: Vector, most: number) => shortened(vector.map((each) => PULL * each) as Vector, most * jogSpeed);
    const isTurned = handle === "jog rotate";
    return {
      type: "jog_tool", arm, frame: "base",
      linear: isTurned ? [0, 0, 0] : toward(pull.offset, MAX_LINEAR),
      angular: isTurned ? toward(pull.turn, MAX_ANGULAR) : [0, 0, 0],
    };
  }

  private jogByKey(canvas: HTMLElement, event: KeyboardEvent): void {
    if (event.metaKey) return void this.end(); // as of a button
    const [axis, sign] = KEYS[event.key] ?? [];
    const elbow = ELBOW_KEYS[event.key];
    const { page } = this.store;
    if (page.view.is_recording || event.ctrlKey || event.altKey || (axis === undefined && !elbow)) return;
    event.preventDefault();
    if (event.repeat) return;
    const why = page.view.why_not_operated || "Take control first; then this key jogs the tool while it is held.";
    const whyNot = hasControl(page) ? permissions(page).move : why;
    if (whyNot) {
      toast(whyNot, "info");
      return;
    }
    const step = (most: number) => unit(axis ?? 0, (sign ?? 0) * most);
    const speeds = elbow ? { elbow } : event.shiftKey ? { angular: step(MAX_ANGULAR) } : { linear: step(MAX_LINEAR) };
    this.begin(canvas, (now) => toolJog(now, speeds), { key: event.code });
  }
}

/** What the tool may be jogged in, and how fast. */
function showFrames(page: Page): void {
  const { boxes } = page.view.surroundings;
  const list = choice("jog-frame");
  const names = ["base", "tool", "work object", ...boxes.map((each) => each.name)];
  if ([...list.options].map((each) => each.text).join() !== names.join()) {
    list.replaceChildren(...names.map((name, index) => new Option(name, index < 3 ? name : `box ${name}`)));
  }
  if (list.value !== page.frame) list.value = page.frame;
  if (choice("handle").value !== page.handle) choice("handle").value = page.handle;
  at("work-object").hidden = page.frame !== "work object";
  text(at("jog-speed-value"), `${Math.round(page.jogSpeed * 100)} %`);
}

