// Controls of a log that plays: hold, steps, rate, place.

import { by } from "./panel.js";
import { rated, requests, said } from "./requests.js";

const LOOK_MS = 3000;
const JUMP_S = 10;

export class Player {
  constructor(services, writing) {
    Object.assign(this, { services, writing, paused: false, now: null, looking: false });
    const does = (id, work) => by(id).addEventListener("click", () => writing.tried(work()));
    does("pause", () => this.act(this.paused ? "resume" : "pause", requests.nothing()));
    does("step", () => this.act("play_next", requests.nothing()));
    does("back", () => this.jump(-JUMP_S));
    does("on", () => this.jump(JUMP_S));
    by("rate").addEventListener("change", () => writing.tried(this.act("set_rate", requests.setRate(Number(by("rate").value)))));
    setInterval(() => this.look(), LOOK_MS);
  }

  // The time of what is shown, in s.
  heard(stamp) {
    if (stamp > 0) this.now = stamp;
  }

  async act(name, request) {
    await this.services.call(name, request);
    await this.look();
  }

  async jump(by_s) {
    if (this.now === null) throw new Error("nothing has been played yet");
    if (!said(await this.services.call("seek", requests.seek(this.now + by_s)))) throw new Error("the log does not reach there");
  }

  // Shows what the player says of itself; nothing while there is none.
  async look() {
    if (this.looking || document.hidden || !this.services.find("pause")) return;
    this.looking = true;
    try {
      this.paused = said(await this.services.call("is_paused", requests.nothing()));
      const rate = rated(await this.services.call("get_rate", requests.nothing()));
      by("pause").textContent = this.paused ? "Play" : "Pause";
      by("step").disabled = !this.paused;
      if (document.activeElement !== by("rate")) by("rate").value = rate;
      by("player").hidden = false;
    } catch {
      by("player").hidden = true;
    }
    this.looking = false;
  }
}
