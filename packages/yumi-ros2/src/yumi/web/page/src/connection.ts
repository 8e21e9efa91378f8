/** The WebSocket to yumi view: messages come in, requests go out and end. */

import { capitalised, type Failure, type PageMessage, type ServerMessage } from "./messages";
import { toast } from "./toast";

const LOST = "The connection to yumi view is lost; is it still running? Where it was started anew, open the address that it has printed.";
const NOT_SENT = "Nothing was sent: the connection to yumi view is lost. To stop the robot, press the emergency stop.";
const AGAIN = 1000; // [ms]

/** What shows the server that this page may see the robot: the token of the address that was opened; and operate it from
 * another machine: the key of a pairing, until the tab is closed. Both are kept for this origin alone, port included, and
 * in no cookie, which the servers of other ports would get, too. */
export function withToken(path: string): string {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    localStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname); // so that the token is not left in the address bar
  }
  const values = { token: localStorage.getItem("token") ?? "", paired: sessionStorage.getItem("paired") ?? "" };
  return `${path}?${new URLSearchParams(values).toString()}`;
}

interface Waiting {
  resolve: (result: unknown) => void;
  reject: (error: Pick<Failure, "sentence">) => void;
}

export class Connection {
  private socket: WebSocket | null = null;
  private lastId = 0; // of requests
  private readonly pending = new Map<number, Waiting>();

  /** @param take takes a message. @param onLoss takes why there is no connection any more. */
  constructor(private readonly take: (message: ServerMessage) => void, private readonly onLoss: (why: string) => void) {
    // The address of a server that was started anew, opened in this tab: a browser does not load the page again for it.
    window.addEventListener("hashchange", () => location.reload());
  }

  open(): void {
    this.socket = new WebSocket(withToken(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`));
    this.socket.onmessage = ({ data }: MessageEvent<string>) => this.receive(JSON.parse(data) as ServerMessage);
    this.socket.onclose = ({ reason }) => {
      for (const { reject } of this.pending.values()) reject({ sentence: "The connection to yumi view is lost." });
      this.pending.clear();
      this.onLoss(reason || LOST);
      setTimeout(() => this.open(), AGAIN);
    };
  }

  get isOpen(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** What waits here to be sent [bytes]. */
  get backlog(): number {
    return this.socket?.bufferedAmount ?? 0;
  }

  /** Send; whether it was sent: a person must not think that a stop was. */
  send(message: PageMessage): boolean {
    const { isOpen } = this;
    if (isOpen) this.socket!.send(JSON.stringify(message));
    else if (message.type !== "seen") toast(NOT_SENT);
    return isOpen;
  }

  /** Ask for something, and show how it ends; its result, or null. */
  async ask(message: PageMessage, pressed?: HTMLElement): Promise<unknown> {
    this.lastId += 1;
    const id = this.lastId;
    const end = new Promise<unknown>((resolve, reject) => this.pending.set(id, { resolve, reject }));
    if (!this.send({ ...message, id })) {
      this.pending.delete(id);
      return null;
    }
    pressed?.setAttribute("aria-busy", "true");
    try {
      const result = await end;
      const outcome = outcomeOf(result);
      if (outcome) toast(outcome, "info");
      return result;
    } catch (error) {
      toast((error as Pick<Failure, "sentence">).sentence);
      return null;
    } finally {
      pressed?.removeAttribute("aria-busy");
    }
  }

  /** Connect anew, such as with the key of a pairing. */
  reconnect(): void {
    this.socket?.close();
  }

  /** Ask the driver for a method. */
  request(method: string, values: Record<string, unknown>, pressed?: HTMLElement): Promise<unknown> {
    return this.ask({ type: "ask", request: { method, ...values } }, pressed);
  }

  private receive(message: ServerMessage): void {
    if (message.type === "step") {
      if (this.pending.has(message.id) && message.step) toast(capitalised(message.step), "info");
    } else if (message.type === "done" || message.type === "failed") {
      const waiting = this.pending.get(message.id);
      this.pending.delete(message.id);
      if (message.type === "done") waiting?.resolve(message.result);
      else waiting?.reject(message.error);
    } else {
      this.take(message);
    }
  }
}

/** What a person reads of a result; empty where there is nothing to read. */
export function outcomeOf(result: unknown): string {
  if (typeof result === "string") return result;
  const { outcome, width } = (result ?? {}) as { outcome?: string; width?: number };
  if (!outcome || width === undefined) return "";
  const size = `${(width * 1000).toFixed(1)} mm`;
  return outcome === "holding" ? `The gripper holds something ${size} wide.` : `The gripper is ${outcome}, ${size} wide.`;
}
