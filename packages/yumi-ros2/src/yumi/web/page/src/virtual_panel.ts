/** The panel of a virtual robot: its emergency stop and key, parts for its grippers, and its faults. */

import type { Connection } from "./connection";
import { withNumber } from "./arm_panel";
import { at, choice, input, make, press, text } from "./dom";
import { explanation, faultGroups } from "./faults";
import type { Fault } from "./messages";
import type { Page, Store } from "./store";

export class VirtualPanel {
  private shown: Partial<Page> = {};

  constructor(private readonly store: Store, private readonly connection: Connection) {
    const side = () => ({ side: store.page.arm });
    press("press-stop", (pressed) => this.inject("emergency-stop", {}, pressed));
    press("release-stop", (pressed) => this.inject("emergency-stop-reset", {}, pressed));
    press("key", (pressed) => this.inject(store.page.state?.operating_mode === "AUTO" ? "manual-mode" : "auto-mode", {}, pressed));
    press("put-part", withNumber("part-width", "width", "mm", (by, pressed) => this.inject("object-placed", { ...side(), by: `${by}` }, pressed)));
    press("put-cup", (pressed) => this.inject("object-under-cups", side(), pressed));
    press("take-part", (pressed) => this.inject("object-lost", side(), pressed));
    press("push", withNumber("push-by", "angle", "degrees", (by, pressed) => this.inject("arm-pushed", { ...side(), by: `${by}` }, pressed)));
    press("inject", (pressed) => this.injectChosen(pressed));
    choice("fault").addEventListener("change", () => this.explain(store.page));
    store.show((page) => this.show(page));
  }

  private inject(name: string, form: Record<string, string>, pressed: HTMLElement): void {
    void this.connection.ask({ type: "inject", name, form }, pressed);
  }

  private chosen({ view }: Page): Fault | undefined {
    return view.faults.find((each) => each.name === choice("fault").value);
  }

  private injectChosen(pressed: HTMLElement): void {
    const fault = this.chosen(this.store.page);
    if (!fault) return;
    const form: Record<string, string> = fault.has_side ? { side: this.store.page.arm } : {};
    if (fault.unit && input("fault-by").value) form.by = input("fault-by").value;
    if (fault.has_duration && input("fault-duration").value) form.duration = input("fault-duration").value;
    this.inject(fault.name, form, pressed);
  }

  private show(page: Page): void {
    const before = this.shown;
    this.shown = page;
    const isPressed = page.state?.motors === "emergencystop";
    at("press-stop").hidden = isPressed;
    at("release-stop").hidden = !isPressed;
    text(at("key"), page.state?.operating_mode === "AUTO" ? "Turn the key to MANUAL" : "Turn the key to AUTO");
    const names = (faults: readonly Fault[] = []) => faults.map((each) => each.name).join();
    if (names(before.view?.faults) !== names(page.view.faults)) {
      choice("fault").replaceChildren(
        ...faultGroups(page.view.faults).map((group) =>
          make("optgroup", { label: group.label }, ...group.faults.map(({ name, label }) => new Option(label, name)))),
      );
      this.explain(page);
    } else if (before.arm !== page.arm) {
      this.explain(page);
    }
  }

  private explain(page: Page): void {
    const fault = this.chosen(page);
    text(at("fault-meaning"), fault ? explanation(fault, page.arm) : "");
    at("fault-strength").hidden = !fault?.unit;
    input("fault-by").value = String(fault?.default ?? "");
    text(at("fault-unit"), fault?.unit ?? "");
    at("fault-time").hidden = !fault?.has_duration;
    input("fault-duration").value = String(fault?.default_duration ?? "");
  }
}
