/** The stage: the scene with its tools, and what is said of arms whose positions are not known. */

import { at, input, press, text } from "./dom";
import { armsOf, type ArmName, type Joints, type Model } from "./messages";
import { Scene } from "./scene";

export class Stage {
  scene: Scene | null = null; // null without WebGL

  constructor(private readonly model: Model) {}

  async load(): Promise<void> {
    try {
      const scene = new Scene(at<HTMLCanvasElement>("scene"), this.model);
      await scene.load();
      this.scene = scene;
      for (const name of armsOf(this.model)) scene.showArm(name, this.homeOf(name), null, false); // until a state comes
    } catch (error) {
      console.error(error);
      at("no-webgl").hidden = false;
    }
    for (const what of ["trace", "frame"] as const) {
      const box = input(`show-${what}`);
      box.addEventListener("change", () => this.scene?.setShown(what, box.checked));
    }
    press("reset-view", () => this.scene?.resetCamera());
    press("clear-trace", () => this.scene?.clearTraces());
  }

  protected homeOf(name: ArmName): Joints | null {
    return this.model.arms[name]!.poses.home ?? null;
  }

  /** Where an arm is drawn that is at joint positions, or at unknown ones: there where last seen, or at home. */
  protected drawnAt(name: ArmName, joints: Joints | null): Joints | null {
    return joints ?? (this.scene?.isPlaced(name) ? null : this.homeOf(name));
  }

  protected showUnmeasured(unmeasured: readonly ArmName[]): void {
    at("not-measured").hidden = !unmeasured.length;
    const known = unmeasured.length > 1
      ? "The positions of both arms are not known: they are"
      : `The position of the ${unmeasured[0]} arm is not known: it is`;
    if (unmeasured.length) text(at("not-measured"), `${known} drawn where last seen, or at home.`);
  }
}
