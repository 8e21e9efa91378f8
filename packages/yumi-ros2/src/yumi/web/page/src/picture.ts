/** The picture: what the scene draws of the page's state, with the labels on it. */

import { at, text } from "abb-view/dom";
import { armsOf, type ArmName, type Joints } from "./messages";
import { difference } from "abb-view/numbers";
import type { HandleMode, Scene } from "abb-view/scene";
import { Stage } from "abb-view/stage";
import { HANDLE_GOAL, hasControl, jointsOf, type Page, type Store } from "./store";
import { pointOf } from "./plan";

const AWAY = 0.03; // [rad] a goal that is further away is shown as a ghost

export class Picture extends Stage {
  onDrag: (isDragged: boolean) => void = () => undefined;
  private shown: Partial<Page> = {}; // of what is not drawn anew with each state

  /** @param goalOf where an arm's goal that is previewed is [rad]; null where that is not known. */
  constructor(store: Store, private readonly goalOf: (page: Page, name: ArmName) => Joints | null) {
    super(store.page.model);
    store.show((page) => this.show(page));
  }

  override async load(): Promise<void> {
    await super.load();
    if (this.scene) this.scene.onDrag = (isDragged) => this.onDrag(isDragged);
  }

  private show(page: Page): void {
    this.showNearest(page);
    this.showUnmeasured(page.state ? armsOf(page.model).filter((name) => !jointsOf(page, name)) : []);
    const { scene } = this;
    if (!scene) return;
    const before = this.shown;
    this.shown = page;
    if (before.view?.surroundings !== page.view.surroundings) scene.showBoxes(page.view.surroundings.boxes);
    if (before.frame !== page.frame || before.workObject !== page.workObject) {
      scene.showWorkObject(page.frame === "work object" ? page.workObject : null);
    }
    if (before.plan?.plan !== page.plan?.plan) scene.showPath(page.plan?.arms ?? null);
    if (page.state) {
      for (const name of armsOf(page.model)) this.showArm(scene, page, name);
    }
    at("scene").dataset.held = scene.heldParts().join(" ");
    this.showHandle(scene, page, before);
  }

  private showArm(scene: Scene, page: Page, name: ArmName): void {
    const gripper = page.state?.grippers[name] ?? null;
    scene.showArm(name, this.drawnAt(name, jointsOf(page, name)), gripper ? gripper.width / 2 : null, Boolean(gripper?.is_holding));
    scene.showGhost(name, this.ghostOf(page, name));
    if (page.state?.arms[name]?.position && !page.recording) scene.addTrace(name);
  }

  /** The plan or goal that is previewed, or the goal of the active controller where it is not where the arm is. */
  private ghostOf(page: Page, name: ArmName): Joints | null {
    if (page.plan) {
      const points = page.plan.arms[name];
      return points ? pointOf(points, page.plan.time) : null;
    }
    if (page.isPreviewed && (name === page.arm || page.isForBoth)) return this.goalOf(page, name);
    const arm = page.state?.arms[name];
    if (!arm?.goal || !arm.position) return null;
    return difference(arm.goal, arm.position) > AWAY ? arm.goal : null;
  }

  private showHandle(scene: Scene, page: Page, before: Partial<Page>): void {
    const [use, mode] = page.handle.split(" ") as [string, HandleMode | undefined];
    const isShown = hasControl(page) && use !== "none" && page.state !== null;
    const changed = (["arm", "handle", "frame", "view"] as const).some((name) => before[name] !== page[name]);
    if (changed || (isShown && !scene.handlePlace())) scene.showHandle(isShown ? page.arm : null, mode, page.frame === "tool");
    if (isShown && use === "jog" && !scene.isDragged) scene.placeHandle(page.arm);
    at("scene").dataset.handle = String(scene.handlePlace() ?? "");
  }

  /** The line between the two parts nearest to each other, with their distance. */
  private showNearest({ nearest, limited }: Page): void {
    const place = this.scene?.showNearest(nearest && [nearest.start, nearest.end]);
    const label = at("nearest");
    label.hidden = !nearest;
    if (!nearest) return;
    const distance = nearest.distance > 0 ? `${(nearest.distance * 1000).toFixed(0)} mm` : "at the limit";
    text(label, `${nearest.part} – ${nearest.other}: ${distance}`);
    label.classList.toggle("limited", Object.keys(limited).length > 0);
    if (!place) return;
    const { clientWidth, clientHeight } = at("scene");
    const within = (value: number, most: number) => Math.min(Math.max(value, 8), most);
    label.style.left = `${within(place[0] + 10, clientWidth - label.offsetWidth - 8)}px`;
    label.style.top = `${within(place[1] - 28, clientHeight - 60)}px`;
  }

  /** The pose of the handle as a goal; null where it is no goal. */
  handleGoal(page: Page): number[] | null {
    return page.goal === HANDLE_GOAL ? (this.scene?.handlePose() ?? null) : null;
  }
}
