/** Cycle health: the last ten seconds of some numbers, of both arms. */

import { at, make, text } from "abb-view/dom";
import { armsOf, type ArmName, type ArmState, type DriverState, type PerArm } from "./messages";
import { DEGREES, difference, indexAt } from "abb-view/numbers";
import type { Page, Store } from "./store";

const SAMPLES = 300; // of a strip
const PERIOD = 6; // states between two drawings

interface Kind {
  name: string;
  unit: string;
  digits: number;
  of: (arm: ArmState, before: ArmState | undefined) => number | null;
  total?: (arm: ArmState) => number | null; // what is written, where it is another number
}

const lost = ({ cycles }: ArmState): number | null => (cycles ? cycles.missed + cycles.lost : null);

const KINDS: Kind[] = [
  { name: "tracking error", unit: "°", digits: 2, of: ({ position, sent }) => (position && sent ? difference(sent, position) * DEGREES : null) },
  {
    name: "missed cycles", unit: "", digits: 0, total: lost,
    of: (arm, before) => {
      const [now, then] = [lost(arm), before ? lost(before) : null];
      return now === null || then === null ? null : Math.max(0, now - then);
    },
  },
  { name: "jitter", unit: " ms", digits: 2, of: ({ cycles, mode }) => (cycles && mode !== "no_egm" ? cycles.jitter * 1000 : null) },
  { name: "period", unit: " ms", digits: 2, of: ({ cycles, mode }) => (cycles && mode !== "no_egm" ? cycles.period * 1000 : null) },
];

class Strip {
  private readonly values: PerArm<(number | null)[]>;
  private readonly canvas = make("canvas", { width: 300, height: 40, className: "strip", role: "img" });
  private readonly label = make("span", { className: "strip-value" });
  private readonly row: HTMLElement;

  constructor(private readonly kind: Kind, private readonly arms: readonly ArmName[]) {
    this.values = Object.fromEntries(arms.map((name) => [name, []]));
    this.canvas.setAttribute("aria-label", kind.name);
    this.row = make("div", { className: "strip-row" }, make("span", { className: "strip-name", textContent: kind.name }), this.canvas, this.label);
    at("strips").append(this.row);
  }

  sample(state: DriverState, before: DriverState | null): void {
    for (const name of this.arms) {
      const values = this.values[name]!;
      values.push(this.kind.of(state.arms[name]!, before?.arms[name]));
      if (values.length > SAMPLES) values.shift();
    }
  }

  /** The whole of a recording; what it has no numbers of is not shown. */
  fill(values: PerArm<(number | null)[]> | null): void {
    this.row.hidden = values === null;
    Object.assign(this.values, values);
  }

  draw(state: DriverState | null): void {
    const style = getComputedStyle(document.documentElement);
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const { width, height } = this.canvas;
    context.clearRect(0, 0, width, height);
    const all = this.arms.flatMap((name) => this.values[name]!).filter((value) => value !== null);
    const top = Math.max(1e-3, ...all) * 1.15;
    for (const name of this.arms) {
      context.strokeStyle = style.getPropertyValue(`--${name}`);
      context.lineWidth = 1.5;
      context.beginPath();
      const values = this.values[name]!;
      values.forEach((value, index) => {
        if (value === null) return;
        const x = width - (values.length - index) * (width / SAMPLES);
        context.lineTo(x, height - 2 - ((height - 4) * value) / top);
      });
      context.stroke();
    }
    const shown = (name: ArmName): string => {
      const { total } = this.kind;
      const value = total && state ? total(state.arms[name]!) : this.values[name]!.at(-1);
      return `${name} ${value === null || value === undefined ? "–" : `${value.toFixed(this.kind.digits)}${this.kind.unit}`}`;
    };
    text(this.label, this.arms.map(shown).join("\n"));
  }
}

export function bindStrips(store: Store): void {
  const strips = KINDS.map((kind) => new Strip(kind, armsOf(store.page.model)));
  let [before, count, isFilled] = [null as DriverState | null, 0, false];
  store.show((page) => {
    if (page.recording) {
      if (!isFilled) fill(strips, page);
      isFilled = true;
    } else if (page.state && page.state !== before) {
      for (const strip of strips) strip.sample(page.state, before);
      before = page.state;
      count += 1;
      if (count % PERIOD === 0) for (const strip of strips) strip.draw(page.state);
    }
  });
}

function fill([error, ...others]: Strip[], { recording, state }: Page): void {
  const { arms, duration } = recording!;
  const ofArm = (name: ArmName) => Array.from({ length: SAMPLES }, (_, index) => {
    const { time, position: positions, sent: references } = arms[name]!;
    const found = indexAt(time, (duration * index) / (SAMPLES - 1));
    const [position, sent] = [positions[found], references[found]];
    return position && sent ? difference(sent, position) * DEGREES : null;
  });
  error?.fill({ right: ofArm("right"), left: ofArm("left") });
  error?.draw(state);
  for (const strip of others) strip.fill(null);
}
