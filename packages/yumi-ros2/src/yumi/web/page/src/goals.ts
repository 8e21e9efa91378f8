/** Goals of the arms: a pose, joint positions or the handle; they are previewed, planned, or gone to. */

import type { Connection } from "./connection";
import { at, button, choice, input, make, numberOf, press, text } from "abb-view/dom";
import { armsOf, type ArmName, type Joints, type Plan } from "./messages";
import { DEGREES } from "abb-view/numbers";
import type { Picture } from "./picture";
import { HANDLE_GOAL, JOINT_GOAL, jointsOf, posesOf, type Handle, type Page, type Store } from "./store";
import { toast } from "abb-view/toast";

const SHOWN_ON = 0.6; // [s] the end of a plan, before it is shown again

const fields = (): HTMLInputElement[] => [...at("joint-goal").querySelectorAll("input")];

/** Where the goal of an arm is [rad]; null where it is not known here, or a field has no number. */
export function goalJoints(page: Page, name: ArmName): Joints | null {
  if (page.goal === HANDLE_GOAL) return null;
  if (page.goal !== JOINT_GOAL) return page.model.arms[name]!.poses[page.goal] ?? null;
  const angles = fields().map(numberOf);
  return angles.some((angle) => angle === null) ? null : angles.map((angle) => angle! / DEGREES);
}

/** What choosing a goal changes: a goal of the handle has its handle in the picture, another one has none. */
export function ofGoal(page: Page, goal: string): Partial<Page> {
  const isHandle = goal === HANDLE_GOAL;
  const isGoalHandle = page.handle.startsWith("goal");
  const handle: Handle = isHandle && !isGoalHandle ? "goal translate" : !isHandle && isGoalHandle ? "none" : page.handle;
  const isForBoth = page.isForBoth && posesOf(page.model).includes(goal);
  return { goal, handle, isForBoth, isPreviewed: page.isPreviewed && !isHandle };
}

/** What choosing a handle changes: that of a goal chooses the goal, too. */
export function ofHandle(page: Page, handle: Handle): Partial<Page> {
  const first = posesOf(page.model)[0] ?? JOINT_GOAL;
  const goal = handle.startsWith("goal") ? HANDLE_GOAL : page.goal === HANDLE_GOAL ? first : page.goal;
  return { ...ofGoal({ ...page, handle }, goal), handle };
}

export class Goals {
  private filledFor = ""; // the arm and goal that the fields of the joints were filled for

  constructor(private readonly store: Store, private readonly connection: Connection, private readonly picture: Picture) {
    const { model } = store.page;
    const goals = [...posesOf(model), JOINT_GOAL, HANDLE_GOAL];
    choice("pose").replaceChildren(...goals.map((name) => new Option(name, name)));
    if (model.limits.lower.length) model.arms[store.page.arm]!.axes.forEach((axis, index) => this.addField(axis, index));
    choice("pose").addEventListener("change", () => store.change(ofGoal(store.page, choice("pose").value)));
    choice("handle").addEventListener("change", () => store.change(ofHandle(store.page, choice("handle").value as Handle)));
    input("both").addEventListener("change", () => store.change({ isForBoth: input("both").checked }));
    press("preview", () => store.change({ isPreviewed: !store.page.isPreviewed }));
    press("move", (pressed) => this.move(pressed));
    press("plan", (pressed) => this.plan(pressed));
    press("discard", () => store.change({ plan: null }));
    press("execute", (pressed) => this.execute(pressed));
    input("plan-time").addEventListener("input", () => this.showPlanAt(input("plan-time").valueAsNumber));
    store.show((page) => this.show(page));
  }

  private addField(axis: number, index: number): void {
    const { lower, upper } = this.store.page.model.limits;
    const [least, most] = [lower[index]! * DEGREES, upper[index]! * DEGREES];
    const field = make("input", {
      type: "number", step: "any", min: String(least), max: String(most), ariaLabel: `Axis ${axis}, degrees`,
      title: `${least.toFixed(1)}° to ${most.toFixed(1)}°`,
    });
    field.dataset.axis = String(axis);
    field.addEventListener("input", () => this.store.change({}));
    at("joint-goal").append(make("label", {}, String(axis), field));
  }

  private show(page: Page): void {
    const isHandle = page.goal === HANDLE_GOAL;
    if (choice("pose").value !== page.goal) choice("pose").value = page.goal;
    input("both").checked = page.isForBoth;
    input("both").disabled = !posesOf(page.model).includes(page.goal);
    button("preview").disabled = isHandle;
    at("preview").setAttribute("aria-pressed", String(page.isPreviewed));
    at("joint-goal").hidden = page.goal !== JOINT_GOAL;
    const wanted = `${page.arm} ${page.goal}`;
    if (wanted !== this.filledFor && page.state) {
      this.filledFor = wanted;
      const now = jointsOf(page, page.arm); // the goal of the other arm is not meant
      fields().forEach((field, index) => (field.value = now ? (now[index]! * DEGREES).toFixed(1) : ""));
    }
    at("plan-box").hidden = page.plan === null;
    if (page.plan && document.activeElement !== at("plan-time")) {
      input("plan-time").value = String(Math.min(page.plan.time, page.plan.duration));
    }
  }

  /** The goals of the arms that are meant; null, with a reason for a person, where one is incomplete. */
  private chosen(): Partial<Record<ArmName, string | number[]>> | null {
    const { page } = this.store;
    const goalOf = (name: ArmName): string | number[] | null =>
      page.goal === HANDLE_GOAL ? this.picture.handleGoal(page) : page.goal === JOINT_GOAL ? goalJoints(page, name) : page.goal;
    const goals: Partial<Record<ArmName, string | number[]>> = {};
    for (const name of page.isForBoth ? armsOf(page.model) : [page.arm]) {
      const goal = goalOf(name);
      if (goal === null) {
        const wrong = fields().find((field) => numberOf(field) === null);
        const what = wrong ? `axis ${wrong.dataset.axis} takes a number from ${wrong.title}` : "the goal needs a number for each axis";
        toast(`Nothing was sent: ${what}.`);
        return null;
      }
      goals[name] = goal;
    }
    return goals;
  }

  private move(pressed: HTMLElement): void {
    this.store.change({ plan: null });
    const goals = this.chosen();
    if (goals) void this.connection.request("move", goals, pressed);
  }

  private async plan(pressed: HTMLElement): Promise<void> {
    this.store.change({ plan: null });
    const goals = this.chosen();
    if (!goals) return;
    const isPose = this.store.page.goal === HANDLE_GOAL;
    const made = (await this.connection.ask({ type: "plan", is_pose: isPose, ...goals }, pressed)) as Plan | null;
    if (!made) return;
    const apart = made.clearance > 0 ? `at least ${(made.clearance * 1000).toFixed(0)} mm from everything` : "touching nothing";
    const found = `A motion of ${made.duration.toFixed(1)} s, ${apart}, found in ${made.planning_time.toFixed(1)} s.`;
    text(at("plan-text"), `${found} Nothing moves before Execute.`);
    input("plan-time").max = String(made.duration);
    const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.store.change({ plan: { ...made, time: isStill ? made.duration : 0 } });
    if (!isStill) this.play(made);
  }

  /** Show the plan from its beginning to its end, again and again. */
  private play(made: Plan): void {
    let last = performance.now();
    const frame = (now: number): void => {
      const { plan } = this.store.page;
      if (plan?.plan !== made.plan) return;
      const later = plan.time + Math.min(0.2, (now - last) / 1000);
      if (document.activeElement !== at("plan-time")) this.showPlanAt(later % (made.duration + SHOWN_ON));
      last = now;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  private showPlanAt(time: number): void {
    const { plan } = this.store.page;
    if (plan) this.store.change({ plan: { ...plan, time } });
  }

  private async execute(pressed: HTMLElement): Promise<void> {
    const { plan } = this.store.page;
    if (!plan) return;
    await this.connection.ask({ type: "execute", plan: plan.plan }, pressed);
    if (this.store.page.plan?.plan === plan.plan) this.store.change({ plan: null });
  }
}
