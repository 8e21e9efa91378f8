/** The panel of a virtual controller: its emergency stop and key, and its faults. */

import { at, choice, input, make, press, text } from "./dom";
import { explanation, faultGroups } from "./faults";
import { SIDES, type ArmName, type Fault, type PageMessage } from "./messages";

/** What the panel is for now: the faults that the controller takes, the arm that is chosen, and the controller's panel. */
export interface FaultTarget {
  faults: readonly Fault[];
  arm: ArmName;
  motors: string | null;
  operating_mode: string | null;
}

/** Sends what a page asks for. */
export interface Asked {
  ask(message: PageMessage, pressed?: HTMLElement): Promise<unknown>;
}

export class FaultPanel {
  private shown: Partial<FaultTarget> = {};

  constructor(private readonly connection: Asked, private readonly target: () => FaultTarget) {
    press("press-stop", (pressed) => this.inject("emergency-stop", {}, pressed));
    press("release-stop", (pressed) => this.inject("emergency-stop-reset", {}, pressed));
    press("key", (pressed) => this.inject(target().operating_mode === "AUTO" ? "manual-mode" : "auto-mode", {}, pressed));
    press("inject", (pressed) => this.injectChosen(pressed));
    choice("fault").addEventListener("change", () => this.explain(target()));
  }

  inject(name: string, form: Record<string, string>, pressed: HTMLElement): void {
    void this.connection.ask({ type: "inject", name, form }, pressed);
  }

  /** Which arm a fault is for: the chosen one of a YuMi, else the only one there is. */
  side(): Record<string, string> {
    const { arm } = this.target();
    return isSide(arm) ? { side: arm } : {};
  }

  private chosen({ faults }: FaultTarget): Fault | undefined {
    return faults.find((each) => each.name === choice("fault").value);
  }

  private injectChosen(pressed: HTMLElement): void {
    const fault = this.chosen(this.target());
    if (!fault) return;
    const form: Record<string, string> = fault.has_side ? this.side() : {};
    if (fault.unit && input("fault-by").value) form.by = input("fault-by").value;
    if (fault.has_duration && input("fault-duration").value) form.duration = input("fault-duration").value;
    this.inject(fault.name, form, pressed);
  }

  show(): void {
    const before = this.shown;
    const target = this.target();
    this.shown = target;
    const isPressed = target.motors === "emergencystop";
    at("press-stop").hidden = isPressed;
    at("release-stop").hidden = !isPressed;
    text(at("key"), target.operating_mode === "AUTO" ? "Turn the key to MANUAL" : "Turn the key to AUTO");
    const names = (faults: readonly Fault[] = []) => faults.map((each) => each.name).join();
    if (names(before.faults) !== names(target.faults)) {
      choice("fault").replaceChildren(
        ...faultGroups(target.faults).map((group) =>
          make("optgroup", { label: group.label }, ...group.faults.map(({ name, label }) => new Option(label, name)))),
      );
      this.explain(target);
    } else if (before.arm !== target.arm) {
      this.explain(target);
    }
  }

  private explain(target: FaultTarget): void {
    const fault = this.chosen(target);
    text(at("fault-meaning"), fault ? explanation(fault, isSide(target.arm) ? target.arm : null) : "");
    at("fault-strength").hidden = !fault?.unit;
    input("fault-by").value = String(fault?.default ?? "");
    text(at("fault-unit"), fault?.unit ?? "");
    at("fault-time").hidden = !fault?.has_duration;
    input("fault-duration").value = String(fault?.default_duration ?? "");
  }
}

function isSide(arm: ArmName): boolean {
  return (SIDES as readonly string[]).includes(arm);
}
