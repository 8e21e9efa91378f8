/** The table of an arm's joints: each axis with its position, as a number and within its range. */

import { at, make, text } from "./dom";
import type { Joints, Model } from "./messages";
import { DEGREES, fixed } from "./numbers";

const NEAR = 0.09; // [rad] a joint that is nearer to an end of its range is marked

export interface JointRow {
  axis: number;
  row: HTMLTableRowElement;
  bar: HTMLElement;
  marker: HTMLElement;
  value: HTMLElement;
}

export class JointTable {
  readonly rows: JointRow[];

  constructor(private readonly model: Model) {
    const longest = Object.values(model.arms).map(({ axes }) => axes).reduce((one, other) => (other.length > one.length ? other : one), []);
    this.rows = longest.map((axis, index) => this.addRow(axis, index));
  }

  private addRow(axis: number, index: number): JointRow {
    const { lower, upper } = this.model.limits;
    const marker = make("i", { className: "now", hidden: true });
    const value = make("td", { className: "number" });
    text(value, "–"); // until a state comes
    const title = lower.length ? `${(lower[index]! * DEGREES).toFixed(1)}° to ${(upper[index]! * DEGREES).toFixed(1)}°` : "";
    const bar = make("div", { className: "bar", title }, marker);
    const row = make("tr", {}, make("th", { scope: "row", textContent: String(axis) }), value, make("td", { className: "bar-cell" }, bar));
    at("joints").append(row);
    return { axis, row, bar, marker, value };
  }

  /** Where on its bar a joint is that is at an angle [rad]. */
  share(index: number, angle: number): string {
    const [least, most] = this.rangeOf(index);
    return `${Math.min(100, Math.max(0, (100 * (angle - least)) / (most - least)))}%`;
  }

  show(joints: Joints | null): void {
    this.rows.forEach(({ marker, value }, index) => {
      const position = joints?.[index];
      text(value, position === undefined ? "–" : `${fixed(position * DEGREES, 2)}°`);
      marker.hidden = position === undefined || !this.model.limits.lower.length;
      if (position === undefined) return;
      const [least, most] = this.rangeOf(index);
      marker.style.left = this.share(index, position);
      marker.classList.toggle("near", Math.min(position - least, most - position) < NEAR);
    });
  }

  private rangeOf(index: number): [number, number] {
    const { lower, upper } = this.model.limits;
    return [lower[index] ?? 0, upper[index] ?? 0];
  }
}
