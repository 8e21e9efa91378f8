/** The panel of a virtual robot: its emergency stop, key and faults, and parts for its grippers. */

import { FaultPanel } from "abb-view/fault_panel";
import { press } from "abb-view/dom";
import { withNumber } from "./arm_panel";
import type { Connection } from "./connection";
import type { Store } from "./store";

export function bindVirtual(store: Store, connection: Connection): void {
  const faults = new FaultPanel(connection, () => {
    const { view, arm, state } = store.page;
    return { faults: view.faults, arm, motors: state?.motors ?? null, operating_mode: state?.operating_mode ?? null };
  });
  press("put-part", withNumber("part-width", "width", "mm", (by, pressed) => faults.inject("object-placed", { ...faults.side(), by: `${by}` }, pressed)));
  press("put-cup", (pressed) => faults.inject("object-under-cups", faults.side(), pressed));
  press("take-part", (pressed) => faults.inject("object-lost", faults.side(), pressed));
  press("push", withNumber("push-by", "angle", "degrees", (by, pressed) => faults.inject("arm-pushed", { ...faults.side(), by: `${by}` }, pressed)));
  store.show(() => faults.show());
}
