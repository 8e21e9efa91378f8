/** The WebSocket to the server: messages come in, requests go out and end. */

import { capitalised, type Answer, type Failure, type PageMessage } from "./messages";
import { toast } from "./toast";

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

/** What a server sends; answers to requests end here, `T` are the others. */
export class Connection<T extends { type: string }> {
  private socket: WebSocket | null = null;
  private lastId = 0; // of requests
  private readonly pending = new Map<number, Waiting>();

  /** @param program serves the page. @param take takes a message. @param onLoss takes why there is no connection any more. */
  constructor(private readonly program: string, private readonly take: (message: T) => void, private readonly onLoss: (why: string) => void) {
    // The address of a server that was started anew, opened in this tab: a browser does not load the page again for it.
    window.addEventListener("hashchange", () => location.reload());
  }

  open(): void {
    this.socket = new WebSocket(withToken(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`));
    this.socket.onmessage = ({ data }: MessageEvent<string>) => this.receive(JSON.parse(data) as T | Answer);
    this.socket.onclose = ({ reason }) => {
      for (const { reject } of this.pending.values()) reject({ sentence: `The connection to ${this.program} is lost.` });
      this.pending.clear();
      this.onLoss(reason || `The connection to ${this.program} is lost; is it still running? Where it was started anew, open the address that it has printed.`);
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
    else if (message.type !== "seen") toast(`Nothing was sent: the connection to ${this.program} is lost. To stop the robot, press the emergency stop.`);
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
      const outcome = this.outcomeOf(result);
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

  /** What a person reads of a result; empty where there is nothing to read. */
  protected outcomeOf(result: unknown): string {
    return typeof result === "string" ? result : "";
  }

  private receive(message: T | Answer): void {
    if (isAnswer(message)) this.end(message);
    else this.take(message);
  }

  private end(message: Answer): void {
    if (message.type === "step") {
      if (this.pending.has(message.id) && message.step) toast(capitalised(message.step), "info");
      return;
    }
    const waiting = this.pending.get(message.id);
    this.pending.delete(message.id);
    if (message.type === "done") waiting?.resolve(message.result);
    else waiting?.reject(message.error);
  }
}

function isAnswer(message: { type: string }): message is Answer {
  return ["step", "done", "failed"].includes(message.type);
}
