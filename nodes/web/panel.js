// Texts and numbers of the panel.

export const by = (id) => document.getElementById(id);

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

const numbers = new Intl.NumberFormat("en");
export const whole = (n) => numbers.format(n);
export const metres = (m) => `${m.toFixed(Math.abs(m) < 100 ? 2 : 1).replace("-", "−")} m`;
// Edge of the cube of equal volume.
export const cellSize = (volume) => `${Number(Math.cbrt(volume).toPrecision(3))} m`;
export const seconds = (s) => (s < 60 ? `${Math.round(s)} s` : `${Math.round(s / 60)} min`);

const NOTE_MS = 2000;
const LEVELS = ["ok", "warn", "bad", "warn"];

// Lattice and cell size.
export const latticeText = ({ lattice, volume }) => `${lattice.toUpperCase()}, cells of ${cellSize(volume)}`;

// Frame and its axes (REP 103), with the geodetic origin if known.
export function frameText(frame, { hasOrigin, origin: [latitude, longitude] }) {
  const degrees = (x, [plus, minus]) => `${Math.abs(x).toFixed(5)}° ${x < 0 ? minus : plus}`;
  return hasOrigin ? `${frame}, from ${degrees(latitude, "NS")}, ${degrees(longitude, "EW")}` : `${frame}: x east, y north`;
}

export function showFacts({ size, lattice, frame, changed, file }) {
  by("cells").textContent = whole(size);
  by("lattice").textContent = lattice ? latticeText(lattice) : "–";
  by("lattice").title = lattice ? `A cell has ${Number((lattice.volume * 1000).toPrecision(4))} litres: the volume of a cube with this edge.` : "";
  by("frame").textContent = lattice ? frameText(frame, lattice) : "–";
  by("frame").title = "Axes of the map: x east (E), y north (N), z up. Without a position on earth, they are those of the odometry.";
  by("changed").parentElement.hidden = file;
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

// Layer line with a checkbox.
export function layerBox(name, on, changed, colour) {
  const box = element("input", { type: "checkbox", checked: on });
  box.addEventListener("change", () => changed(box.checked));
  const mark = element("i", { className: "swatch" });
  mark.style.background = colour;
  return element("label", { className: "layer" }, box, ...(colour ? [mark] : []), name);
}

// Shows a note at a position of the view for a while.
export function showNote(text, x, y) {
  const note = by("note");
  Object.assign(note, { hidden: !text, textContent: text ?? "" });
  [note.style.left, note.style.top] = [`${x}px`, `${y}px`];
  clearTimeout(showNote.timer);
  if (text) showNote.timer = setTimeout(() => showNote(null), NOTE_MS);
}

export function showCell(cell) {
  by("chosen").hidden = !cell;
  if (!cell) return;
  const rows = Object.entries(cell).map(([name, value]) => element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value })));
  by("cell").replaceChildren(...rows);
}

const KEPT = 120;
const history = new Map();

const delay = (ms) => (ms < 1000 ? `${Math.round(ms)} ms` : seconds(ms / 1000));

export function showRates(rates) {
  const now = new Map(rates);
  for (const topic of now.keys()) if (!history.has(topic)) history.set(topic, []);
  const rows = [...history].sort().map(([topic, past]) => {
    const { messages, bytes, latency } = now.get(topic) ?? { messages: 0, bytes: 0, latency: 0 };
    past.push(bytes);
    if (past.length > KEPT) past.shift();
    const cells = [topic, messages, (bytes / 1000).toFixed(1), messages ? delay(Math.max(0, latency)) : "–"];
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

const known = new Map();
const MOST_TASKS = 200;
const OLD_MS = 5000;

// Recently stated diagnostic tasks.
export const tasks = () => [...known.values()].filter(({ at }) => Date.now() - at < OLD_MS);

export function showDiagnostics({ status }) {
  for (const task of status) if (known.size < MOST_TASKS || known.has(task.name)) known.set(task.name, { ...task, at: Date.now() });
  const sorted = [...known.values()].sort((a, b) => b.level - a.level || a.name.localeCompare(b.name));
  by("worst").className = `light ${LEVELS[Math.max(...sorted.map((task) => task.level), 0)] ?? ""}`;
  if (!by("nodes").parentElement.open) return;
  by("nodes").replaceChildren(...sorted.map((task) => {
    const old = Date.now() - task.at > OLD_MS ? ` (${seconds((Date.now() - task.at) / 1000)} ago)` : "";
    const drops = task.values.filter(([key, value]) => /lost|drop|refus|full|old|not_/.test(key) && Number(value) > 0);
    const words = [task.message + old, ...drops.map(([key, value]) => `${key} ${value}`)].join(" · ");
    return element("div", { className: "node" }, element("span", { className: `light ${LEVELS[task.level] ?? ""}` }), ` ${task.name}`, element("p", { textContent: words }));
  }));
}
