/** The page of yumi view: messages change its state, views show the state, and a person's presses become requests. */

import { ArmPanel } from "./arm_panel";
import { bindBand } from "./band";
import { Connection } from "./connection";
import { bindEvents } from "./events";
import type { Frame } from "abb-view/frames";
import { goalJoints, Goals } from "./goals";
import { Jogging } from "./jogging";
import type { Model, ServerMessage } from "./messages";
import { Picture } from "./picture";
import { Player } from "./player";
import { bindRobot } from "./robot_panel";
import { initialPage, ofEvents, ofLoss, ofState, ofView, Store } from "./store";
import { bindStrips } from "./strips";
import { bindAllTabs } from "./tabs";
import { Teleoperation } from "./teleoperation";
import { toast } from "abb-view/toast";
import { bindVirtual } from "./virtual_panel";

async function begin(): Promise<void> {
  const model = (await (await fetch("/model.json")).json()) as Model;
  const workObject = JSON.parse(localStorage.getItem("work object") ?? "null") as Frame | null;
  const store = new Store(initialPage(model, workObject));
  const connection = new Connection(model.program, take, (why) => store.change(ofLoss(store.page, why)));
  const picture = new Picture(store, goalJoints);
  const jogging = new Jogging(store, connection, picture);
  const endJog = (): void => void jogging.end();
  const teleoperation = new Teleoperation(store, connection, picture);
  let isOpened = false; // the recording

  function take(message: ServerMessage): void {
    if (message.type === "state") {
      store.change(ofState(store.page, message));
      setTimeout(() => connection.send({ type: "seen" }), 0); // after what is drawn
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
  bindVirtual(store, connection);
  bindStrips(store);
  bindEvents(store);
  store.change({});
  await picture.load();
  connection.open();
}

void begin();
