/** The page of yumi view: messages change its state, views show the state, and a person's presses become requests. */

import { ArmPanel } from "./arm_panel";
import { bindBand } from "./band";
import { Connection } from "./connection";
import { bindEvents } from "./events";
import type { Frame } from "./frames";
import { goalJoints, Goals } from "./goals";
import { Jogging } from "./jogging";
import type { Model, ServerMessage } from "./messages";
import { Picture } from "./picture";
import { Player } from "./player";
import { bindRapid } from "./rapid_panel";
import { bindRobot } from "./robot_panel";
import { initialPage, ofController, ofEvents, ofLog, ofLoss, ofState, ofView, Store } from "./store";
import { bindStrips } from "./strips";
import { bindAllTabs } from "./tabs";
import { Teleoperation } from "./teleoperation";
import { toast } from "./toast";
import { VirtualPanel } from "./virtual_panel";

async function begin(): Promise<void> {
  const model = (await (await fetch("/model.json")).json()) as Model;
  const workObject = JSON.parse(localStorage.getItem("work object") ?? "null") as Frame | null;
  const store = new Store(initialPage(model, workObject));
  const connection = new Connection(take, (why) => store.change(ofLoss(store.page, why)));
  const picture = new Picture(store, goalJoints);
  const jogging = new Jogging(store, connection, picture);
  const endJog = (): void => void jogging.end();
  const teleoperation = new Teleoperation(store, connection, picture);
  let isOpened = false; // the recording

  function take(message: ServerMessage): void {
    if (message.type === "state") {
      store.change(ofState(store.page, message));
      setTimeout(() => connection.send({ type: "seen" }), 0); // after what is drawn
    } else if (message.type === "controller") {
      store.change(ofController(store.page, message));
      setTimeout(() => connection.send({ type: "seen" }), 0);
    } else if (message.type === "log") {
      store.change(ofLog(store.page.log, message.lines));
    } else if (message.type === "events") {
      store.change(ofEvents(store.page.events, message.events));
    } else if (message.type === "view") {
      store.change(ofView(store.page, message));
      if (message.is_recording && !isOpened) {
        isOpened = true;
        void Player.open(store);
      }
    } else if (message.type === "teleoperated") {
      teleoperation.take(message);
    } else if (message.type === "refused") {
      endJog(); // control may be lost
      toast(message.sentence);
    } else if (message.type === "jog_refused") {
      if (jogging.end(message.hold)) toast(message.error.sentence); // else it has ended already
    }
  }

  bindAllTabs(store, endJog);
  bindBand(store, connection);
  bindRobot(store, connection, endJog);
  new Goals(store, connection, picture);
  new ArmPanel(store, connection, jogging, picture);
  new VirtualPanel(store, connection);
  bindStrips(store);
  bindEvents(store);
  bindRapid(store);
  store.change({});
  await picture.load();
  connection.open();
}

void begin();
