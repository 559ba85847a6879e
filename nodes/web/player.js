// Bag playback: its position and time, and controls if offered by the server.

import { by } from "./panel.js";
import { rated, requests, said } from "./requests.js";

const LOOK_MS = 3000;
const SHOW_MS = 500;
// Time without status after which a player counts as ended, ms.
const OLD_MS = 8000;
const JUMP_S = 10;
const ROUNDED_S = 1e-5;
// Earlier times are simulated and shown without a date, s.
const NO_DATE_S = 1e8;

const two = (n) => String(n).padStart(2, "0");
const clock = (s) => {
  const [h, m] = [Math.floor(s / 3600), Math.floor(s / 60) % 60];
  return `${h ? `${h}:${two(m)}` : m}:${two(Math.floor(s) % 60)}`;
};
const date = (s) => (s < NO_DATE_S ? `${s.toFixed(1)} s` : new Date(s * 1000).toISOString().slice(0, 19).replace("T", " ") + " UTC");

export class Player {
  constructor(services, writing) {
    // `log`: status of the player; `answers`: true if a player replies to calls; `now`: time of the displayed data, s.
    Object.assign(this, { services, writing, log: null, answers: false, paused: false, now: null, looking: false, dragged: false });
    const does = (id, work) => by(id).addEventListener("click", () => writing.tried(work()));
    does("pause", () => this.act(this.paused ? "resume" : "pause", requests.nothing()));
    does("step", () => this.act("play_next", requests.nothing()));
    does("back", () => this.jump(-JUMP_S));
    does("on", () => this.jump(JUMP_S));
    by("rate").addEventListener("change", () => writing.tried(this.act("set_rate", requests.setRate(Number(by("rate").value)))));
    by("seek").addEventListener("input", () => {
      this.dragged = true;
      this.show();
    });
    by("seek").addEventListener("change", () => {
      this.dragged = false;
      writing.tried(this.seek(this.slid()));
    });
    setInterval(() => this.look(), LOOK_MS);
    setInterval(() => this.show(), SHOW_MS);
  }

  // Time of the displayed data, s.
  heard(stamp) {
    if (stamp > 0) this.now = stamp;
  }

  // Handles diagnostics: a player states its position in the log.
  told({ status }) {
    for (const { name, level, values } of status) {
      if (!name.endsWith(": log")) continue;
      const of = new Map(values);
      const [begin, end, now, rate] = ["begin_ns", "end_ns", "now_ns", "rate"].map((key) => Number(of.get(key)));
      if (level > 2 || ![begin, end, now, rate].every(Number.isFinite)) continue;
      this.paused = of.get("paused") === "true";
      this.log = { begin: begin / 1e9, end: end / 1e9, now: now / 1e9, rate, at: Date.now() };
      this.show();
    }
  }

  // Current log time, s; the stamp of the newest transform if the player states none.
  time() {
    const { log } = this;
    if (!log) return this.now;
    const since = this.paused ? 0 : ((Date.now() - log.at) / 1000) * log.rate;
    return Math.min(log.end, Math.max(log.begin, log.now + since));
  }

  // Log time at the position of the slider, s.
  slid() {
    const { begin, end } = this.log;
    return begin + (Number(by("seek").value) / 1000) * (end - begin);
  }

  async act(name, request) {
    await this.services.call(name, request);
    await this.look();
  }

  jump(by_s) {
    const now = this.time();
    if (now === null) return Promise.reject(new Error("nothing has been played yet"));
    return this.seek(now + by_s);
  }

  async seek(to) {
    // Kept within the log by more than the rounding error of a number of this size.
    const { begin, end } = this.log ?? { begin: -Infinity, end: Infinity };
    const time = Math.max(begin + ROUNDED_S, Math.min(end - ROUNDED_S, to));
    if (!said(await this.services.call("seek", requests.seek(time)))) throw new Error("the log does not reach there");
    if (this.log) Object.assign(this.log, { now: time, at: Date.now() });
    this.show();
  }

  show() {
    if (this.log && Date.now() - this.log.at > OLD_MS) this.log = null;
    by("player").hidden = !this.log && !this.answers;
    if (by("player").hidden) return;
    const now = this.dragged && this.log ? this.slid() : this.time();
    by("log-date").textContent = now === null ? "–" : date(now);
    by("log-time").parentElement.hidden = !this.log;
    by("log-time").textContent = this.log ? `${clock(now - this.log.begin)} of ${clock(this.log.end - this.log.begin)}` : "";
    by("seek").hidden = !this.log;
    by("seek").disabled = !this.services.find("seek");
    if (this.log && !this.dragged) by("seek").value = Math.round((1000 * (now - this.log.begin)) / Math.max(1e-9, this.log.end - this.log.begin));
    by("play").hidden = !this.services.find("pause") || !this.answers;
    by("pause").textContent = this.paused ? "Play" : "Pause";
    by("step").disabled = !this.paused;
  }

  // Requests the state of the player; there is no reply without a player.
  async look() {
    if (this.looking || document.hidden || !this.services.find("is_paused")) return;
    this.looking = true;
    try {
      this.paused = said(await this.services.call("is_paused", requests.nothing()));
      const rate = rated(await this.services.call("get_rate", requests.nothing()));
      if (document.activeElement !== by("rate")) by("rate").value = rate;
      this.answers = true;
    } catch {
      this.answers = false;
    }
    this.show();
    this.looking = false;
  }
}
