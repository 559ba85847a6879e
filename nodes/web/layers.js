// Layer checkboxes, for existing layers only.

import { FREE_COLOUR } from "./colours.js";
import { ROBOT_INK } from "./drawing.js";
import { by, layerBox } from "./panel.js";

// Colours of clouds in the style sheet.
const INKS = ["--cloud-a", "--cloud-b", "--cloud-c"];
const DRAWN = ["cloud", "centers", "free"];
const ROBOT_COLOUR = `rgb(${ROBOT_INK.slice(0, 3).map((x) => Math.round(255 * x)).join(" ")})`;

export class Layers {
  constructor({ state, worker, free, redraw }) {
    Object.assign(this, { state, worker, free, redraw, key: "" });
  }

  // Shows checkboxes of the robot and the headset once known, and of published topics.
  show() {
    const { state } = this;
    const own = [["cells", "Cells", true], ["grid", "Ground grid", true], ["robot", "Robot and its path", state.robot, ROBOT_COLOUR], ["headset", "Headset", state.calibrated]];
    const layers = own.filter(([, , is]) => is);
    const there = ({ kind, topic }) => DRAWN.includes(kind) && (!state.published || state.published.has(topic) || state.scansOn.has(topic));
    const channels = state.channels.filter(there).sort((a, b) => (a.kind === "free") - (b.kind === "free"));
    const key = JSON.stringify([layers.map(([name]) => name), channels.map(({ topic }) => topic), state.open]);
    // Existing checkboxes are kept, so that they keep the keyboard focus.
    if (this.key === key) return;
    this.key = key;
    const boxes = layers.map(([name, text, , colour]) => layerBox(text, state.shown[name], (on) => {
      state.shown[name] = on;
      this.redraw();
    }, colour));
    by("layers").replaceChildren(...boxes, ...channels.map((channel, i) => this.box(channel, INKS[i % INKS.length])));
  }

  box({ kind, topic }, ink) {
    const { clouds, scansOn, open } = this.state;
    const isFree = kind === "free";
    if (!isFree && !clouds.has(topic)) clouds.set(topic, { scans: [], next: 0, keep: kind === "centers" ? 1 : 64, ink });
    const box = layerBox(isFree ? "Free space" : topic, scansOn.has(topic), (on) => this.want(topic, on), isFree ? FREE_COLOUR : `var(${clouds.get(topic).ink})`);
    box.firstChild.dataset.topic = topic;
    box.firstChild.disabled = !open;
    return box;
  }

  // Subscribes to a topic, or unsubscribes.
  want(topic, on) {
    const { clouds, scansOn } = this.state;
    scansOn[on ? "add" : "delete"](topic);
    if (clouds.has(topic)) clouds.get(topic).scans = [];
    else this.free.clear();
    this.worker.postMessage({ type: "want", topic, on });
    this.redraw();
  }
}
