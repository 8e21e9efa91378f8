/** The arm that is shown: its joints, where its tool is, its gripper, and its controllers. */

import type { Connection } from "./connection";
import { readable } from "./band";
import { at, choice, input, make, numberOf, press, text } from "abb-view/dom";
import { seenFrom } from "abb-view/frames";
import type { Jogging } from "./jogging";
import type { GripperState, Vector } from "./messages";
import { JointTable, type JointRow } from "abb-view/joint_table";
import { coordinates, DEGREES, fixed, millimetres } from "abb-view/numbers";
import type { Picture } from "./picture";
import { frameOf, jointsOf, type Page, type Store } from "./store";
import { toast } from "abb-view/toast";

/** What stands beside a row of the table of joints. */
interface Row {
  goal: HTMLElement;
  error: HTMLElement;
  short: HTMLElement;
}

export class ArmPanel {
  private readonly joints: JointTable;
  private readonly rows: Row[];

  constructor(private readonly store: Store, private readonly connection: Connection, jogging: Jogging, private readonly picture: Picture) {
    this.joints = new JointTable(store.page.model);
    this.rows = this.joints.rows.map((row, index) => this.extendRow(row, index, jogging));
    press("activate", (pressed) => this.activate(pressed));
    this.bindGripper();
    store.show((page) => this.show(page));
  }

  private extendRow({ axis, row, bar }: JointRow, index: number, jogging: Jogging): Row {
    const goal = make("i", { className: "goal", hidden: true });
    const error = make("td", { className: "number error" });
    text(error, "–"); // until a state comes
    bar.prepend(goal);
    row.append(error, make("td", { className: "jog-cell" }, ...jogging.jointButtons(index, axis)));
    const short = make("b");
    at("joint-line").append(make("span", {}, `${axis}`, short));
    return { goal, error, short };
  }

  private show(page: Page): void {
    if (!page.state) return;
    const commanding = page.commanding[page.arm] ?? "";
    text(at("commanding"), commanding);
    at("commanding").hidden = !commanding;
    this.showJoints(page);
    this.showTool(page);
    showGripper(page);
    showControllers(page);
  }

  private showJoints(page: Page): void {
    const arm = page.state!.arms[page.arm]!;
    const now = jointsOf(page, page.arm);
    this.joints.show(now);
    this.rows.forEach(({ goal, error, short }, index) => {
      const position = now?.[index];
      text(short, position === undefined ? "–" : `${fixed(position * DEGREES, 1)}°`);
      goal.hidden = !arm.goal;
      if (arm.goal) goal.style.left = this.joints.share(index, arm.goal[index]!);
      const isRunning = arm.position && arm.sent && page.state!.egm[page.arm] === "running";
      text(error, isRunning ? `${fixed((arm.sent![index]! - arm.position![index]!) * DEGREES, 2)}°` : "–");
    });
  }

  private showTool(page: Page): void {
    const { scene } = this.picture;
    const isMeasured = Boolean(page.state!.arms[page.arm]!.position);
    const isKnown = scene && jointsOf(page, page.arm);
    const nothing = isMeasured ? "" : "No positions: EGM does not run on this arm.";
    text(at("tool-pose"), isKnown ? this.whereTool(page) : nothing);
  }

  private whereTool(page: Page): string {
    const scene = this.picture.scene!;
    const frame = frameOf(page);
    const seen = (point: Vector): string => coordinates(frame ? seenFrom(frame, point) : point);
    const where = frame ? ` from the ${page.frame}` : "";
    const source = page.state!.arms[page.arm]!.position ? "" : ", as the controller reports while EGM is off";
    const tool0 = ` (tool0: ${seen(scene.flange(page.arm))})`;
    return `Fingertips ${seen(scene.tipFrame(page.arm).position)} mm${where}${tool0}${source}`;
  }

  private activate(pressed: HTMLElement): void {
    const { arm, state } = this.store.page;
    if (!state) return;
    const leading = state.controllers[arm]!.filter((each) => each.commands).map((each) => each.name);
    const activate = choice("controller").value;
    const deactivate = leading.filter((name) => name !== activate);
    void this.connection.request("switch_controllers", { arm, activate: [activate], deactivate }, pressed);
  }

  private bindGripper(): void {
    const grip = (asked: Record<string, unknown>, pressed: HTMLElement) =>
      this.connection.request("grip", { arm: this.store.page.arm, ...asked }, pressed);
    press("open", withNumber("open-width", "width", "mm", (width, pressed) => grip({ action: "open", width: width / 1000 }, pressed)));
    press("close", withNumber("grip-force", "force", "N", (force, pressed) => grip({ action: "close", force }, pressed)));
  }
}

/** An action that takes the number of a field; without one nothing is sent, and a person reads why. */
export function withNumber(
  id: string, what: string, unit: string, action: (value: number, pressed: HTMLElement) => unknown,
): (pressed: HTMLElement) => void {
  return (pressed) => {
    const field = input(id);
    const value = numberOf(field);
    if (value !== null) action(value, pressed);
    else toast(`Nothing was sent: the ${what} must be a number from ${field.min} to ${field.max} ${unit}.`);
  };
}

/** A gripper in words. */
export function gripperWords(gripper: GripperState | null): string {
  if (!gripper) return "unknown";
  const width = `${millimetres(gripper.width)} mm`;
  return [
    ...(gripper.is_holding ? [width, `holding with ${gripper.force.toFixed(0)} N`] : [gripper.state, width]),
    ...(gripper.is_calibrated ? [] : ["not calibrated"]),
    ...(gripper.error ? [`error ${gripper.error}`] : []),
  ].join(", ");
}

function showGripper(page: Page): void {
  const gripper = page.state!.grippers[page.arm] ?? null;
  text(at("gripper-text"), gripperWords(gripper));
  const apart = gripper ? Math.min(1, gripper.width / (2 * page.model.gripper.travel)) : 0;
  [...at("gripper-bar").children].forEach((finger, index) => {
    (finger as HTMLElement).style.left = `${50 + (index ? 42 : -42) * apart}%`;
  });
  at("gripper-bar").classList.toggle("holding", Boolean(gripper?.is_holding));
}

function showControllers(page: Page): void {
  const controllers = page.state!.controllers[page.arm]!.filter(({ name }) => !name.includes("broadcaster"));
  const list = choice("controller");
  if ([...list.options].map((each) => each.value).join() !== controllers.map(({ name }) => name).join()) {
    list.replaceChildren(...controllers.map(({ name }) => new Option("", name)));
  }
  controllers.forEach(({ name, commands }, index) => text(list.options[index]!, `${readable(name)}${commands ? " ✓" : ""}`));
}
