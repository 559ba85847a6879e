// The panel's words and figures.

import { gradient, labelColour } from "./colours.js";

export const by = (id) => document.getElementById(id);

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

const numbers = new Intl.NumberFormat("en");
export const whole = (n) => numbers.format(n);
export const metres = (m) => `${m.toFixed(Math.abs(m) < 100 ? 2 : 1)} m`;
export const seconds = (s) => (s < 60 ? `${Math.round(s)} s` : `${Math.round(s / 60)} min`);

const LEVELS = ["ok", "warn", "bad", "warn"];

export function showFacts({ size, lattice, volume, changed }) {
  by("cells").textContent = whole(size);
  by("lattice").textContent = lattice ? lattice.toUpperCase() : "–";
  by("side").textContent = volume ? (volume < 0.01 ? `${(volume * 1000).toPrecision(2)} L` : `${volume.toPrecision(3)} m³`) : "–";
  by("changed").textContent = changed === null ? "–" : changed < 2 ? "now" : `${seconds(changed)} ago`;
}

export function showState(text, light) {
  by("state").textContent = text;
  by("light").className = `light ${light}`;
}

export function showBanner(text, warn = false) {
  const banner = by("banner");
  banner.hidden = !text;
  banner.className = warn ? "warn" : "";
  if (banner.textContent !== text) banner.textContent = text ?? "";
}

export function showLegend(mode, range, labels, names) {
  const legend = by("legend");
  if (mode === "label") {
    const entries = labels.map((label) => {
      const swatch = element("i");
      swatch.style.background = labelColour(label);
      return element("span", {}, swatch, names.get(label) ?? String(label));
    });
    legend.replaceChildren(element("div", { className: "names" }, ...(entries.length ? entries : ["this map has no labels"])));
    return;
  }
  const bar = element("div", { className: "bar" });
  bar.style.background = gradient(mode);
  const text = { height: metres, count: (v) => whole(Math.round(2 ** v - 1)), age: seconds }[mode];
  const ends = range.map((value) => element("span", { textContent: text(value) }));
  legend.replaceChildren(bar, element("div", { className: "ends" }, ...ends));
}

// A line for a layer, with a box that turns it on and off.
export function layerBox(name, on, changed) {
  const box = element("input", { type: "checkbox", checked: on });
  box.addEventListener("change", () => changed(box.checked));
  return element("label", { className: "layer" }, box, name);
}

export function showCell(cell) {
  by("chosen").hidden = !cell;
  if (!cell) return;
  const rows = Object.entries(cell).map(([name, value]) => element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value })));
  by("cell").replaceChildren(...rows);
}

const KEPT = 120;
const history = new Map();

export function showRates(rates) {
  const now = new Map(rates);
  for (const topic of now.keys()) if (!history.has(topic)) history.set(topic, []);
  const rows = [...history].sort().map(([topic, past]) => {
    const { messages, bytes, latency } = now.get(topic) ?? { messages: 0, bytes: 0, latency: 0 };
    past.push(bytes);
    if (past.length > KEPT) past.shift();
    const cells = [topic, messages, (bytes / 1000).toFixed(1), messages ? `${Math.max(0, Math.round(latency))} ms` : "–"];
    const row = element("tr", { title: topic }, ...cells.map((text) => element("td", { textContent: text })), element("td"));
    row.lastChild.append(plot(past));
    return row;
  });
  by("rates").replaceChildren(...rows);
}

function plot(past) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  const most = Math.max(...past, 1);
  line.setAttribute("points", past.map((v, i) => `${((i / Math.max(1, KEPT - 1)) * 44).toFixed(1)},${(13 - (12 * v) / most).toFixed(1)}`).join(" "));
  svg.setAttribute("viewBox", "0 0 44 14");
  svg.append(line);
  return svg;
}

const tasks = new Map();
const MOST_TASKS = 200;

export function showDiagnostics({ status }) {
  for (const task of status) if (tasks.size < MOST_TASKS || tasks.has(task.name)) tasks.set(task.name, { ...task, at: Date.now() });
  const sorted = [...tasks.values()].sort((a, b) => b.level - a.level || a.name.localeCompare(b.name));
  by("worst").className = `light ${LEVELS[Math.max(...sorted.map((task) => task.level), 0)] ?? ""}`;
  if (!by("nodes").parentElement.open) return;
  by("nodes").replaceChildren(...sorted.map((task) => {
    const old = Date.now() - task.at > 5000 ? ` (${seconds((Date.now() - task.at) / 1000)} ago)` : "";
    const drops = task.values.filter(([key, value]) => /lost|drop|refus|full|old|not_/.test(key) && Number(value) > 0);
    const words = [task.message + old, ...drops.map(([key, value]) => `${key} ${value}`)].join(" · ");
    return element("div", { className: "node" }, element("span", { className: `light ${LEVELS[task.level] ?? ""}` }), ` ${task.name}`, element("p", { textContent: words }));
  }));
}
