/** The page of a controller: messages change its state, and views show the state. */

import { chip, measureBand, panelChips, showVerdict, speedChip } from "abb-view/banner";
import { Connection } from "abb-view/connection";
import { initialPage, isOther, nameOf, ofLog, ofLoss, ofView, verdict, type ControllerPage } from "./controller";
import { at, make, text } from "abb-view/dom";
import { FaultPanel } from "abb-view/fault_panel";
import { JointTable } from "abb-view/joint_table";
import { armsOf, type ArmName, type ControllerServerMessage, type Model } from "./messages";
import { coordinates } from "abb-view/numbers";
import { bindRapid } from "./rapid_panel";
import { Stage } from "abb-view/stage";
import { Store } from "abb-view/store";
import { closeToast, toast } from "abb-view/toast";

const ARMS: Record<string, string> = { right: "Right arm", left: "Left arm" };

class Picture extends Stage {
  constructor(private readonly store: Store<ControllerPage>) {
    super(store.page.model);
    store.show((page) => this.show(page));
  }

  private show({ model, state }: ControllerPage): void {
    this.showUnmeasured(state ? armsOf(model).filter((name) => !state.arms[name]) : []);
    const { scene } = this;
    if (!scene || !state) return;
    for (const name of armsOf(model)) {
      const joints = state.arms[name] ?? null;
      scene.showArm(name, this.drawnAt(name, joints), null, false);
      if (joints) scene.addTrace(name);
    }
  }

  /** Where the tip of an arm is, in words; empty where that is not known. */
  whereTip(name: ArmName): string {
    const { scene } = this;
    const { model, state } = this.store.page;
    if (!scene || !state?.arms[name]) return "";
    const tool0 = model.tip === "tool0" ? "" : ` (tool0: ${coordinates(scene.flange(name))})`;
    return `${model.tip ?? "Fingertips"} ${coordinates(scene.tipFrame(name).position)} mm${tool0}`;
  }
}

/** One tab for each robot; none where there is one robot alone. */
function bindArms(store: Store<ControllerPage>): void {
  const arms = armsOf(store.page.model);
  at("arm-tabs").hidden = arms.length < 2;
  const tabs = arms.map((name) => {
    const tab = make("button", { id: `tab-${name}`, textContent: ARMS[name] ?? name, role: "tab" });
    tab.setAttribute("aria-controls", "arm-panel");
    tab.addEventListener("click", () => store.change({ arm: name }));
    return tab;
  });
  at("arm-tabs").replaceChildren(...tabs);
  store.show(({ arm }) => arms.forEach((name, index) => tabs[index]!.setAttribute("aria-selected", String(name === arm))));
}

function showChips({ view, state }: ControllerPage): void {
  at("chips").hidden = !state || Boolean(view.why_no_robot); // what was last seen may not be so any more
  if (!state || view.why_no_robot || !view.controller) return;
  const robot = nameOf(view.controller);
  chip("robot", view.is_virtual ? `${robot}, virtual` : robot);
  panelChips(state);
  if (state.speed_ratio === null) chip("speed", "unknown", "warn");
  else speedChip(state.speed_ratio / 100);
}

async function begin(): Promise<void> {
  const model = (await (await fetch("/model.json")).json()) as Model;
  const store = new Store(initialPage(model));
  const connection = new Connection<ControllerServerMessage>(model.program, take, (why) => store.change(ofLoss(store.page, why)));
  const picture = new Picture(store);
  const joints = new JointTable(model);

  function take(message: ControllerServerMessage): void {
    if (message.type === "controller") {
      store.change({ state: message });
      setTimeout(() => connection.send({ type: "seen" }), 0); // after what is drawn
    } else if (message.type === "log") {
      store.change(ofLog(store.page.log, message.lines));
    } else if (message.type === "view") {
      if (isOther(model, message.controller)) location.reload();
      else store.change(ofView(message));
    } else if (message.type === "refused") {
      toast(message.sentence);
    }
  }

  const faults = new FaultPanel(connection, () => {
    const { view, arm, state } = store.page;
    return { faults: view.faults, arm, motors: state?.motors ?? null, operating_mode: state?.operating_mode ?? null };
  });
  measureBand();
  bindArms(store);
  bindRapid(store);
  at("toast").addEventListener("click", closeToast);
  document.addEventListener("keydown", (event) => event.key === "Escape" && closeToast());
  store.show((page) => {
    showVerdict(verdict(page));
    showChips(page);
    document.body.classList.toggle("last-seen", Boolean(page.view.why_no_robot && page.state));
    joints.show(page.state?.arms[page.arm] ?? null);
    text(at("tool-pose"), picture.whereTip(page.arm));
    at("virtual-panel").hidden = !page.view.faults.length || Boolean(page.view.why_no_robot);
    faults.show();
  });
  store.change({});
  await picture.load();
  connection.open();
}

void begin();
