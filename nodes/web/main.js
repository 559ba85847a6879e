// Main module of the page: connects worker, view and panel.

import { Camera } from "./camera.js";
import { Drawing, colourOf, cssColour } from "./drawing.js";
import { showNothing } from "./empty.js";
import { FreeSpace } from "./free.js";
import * as headset from "./headset.js";
import { placeIndex } from "./keys.js";
import { Layers } from "./layers.js";
import { legendOf, showLegend } from "./legend.js";
import { add, length, rotate, sub } from "./math.js";
import { MixedReality } from "./mixed.js";
import * as panel from "./panel.js";
import { pictureOf } from "./picture.js";
import { Planning } from "./planning.js";
import { Player } from "./player.js";
import { watchKeys, watchPointer } from "./pointer.js";
import { CellRenderer } from "./renderer.js";
import { Scene } from "./scene.js";
import { Services } from "./services.js";
import { Slice } from "./slice.js";
import { Transforms } from "./transforms.js";
import { Writing } from "./writing.js";

const { by } = panel;
const ROBOT = "base_link";
const HEADSET = "headset_origin";
const MODES = ["height", "count", "label", "age", "colour"];
const QUIET_MS = 5000;
// Timeout of a connection and of a reconnection before the page reports it, ms.
const START_MS = 4000;
const AGAIN_MS = 1000;
const BEGUN = Date.now();
const MOST_PATH = 4000;

const canvas = by("view");
const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: false });
if (!gl) panel.showBanner("This browser has no WebGL 2: the map cannot be drawn.");

const camera = new Camera();
const cells = new CellRenderer(gl);
const free = new FreeSpace(gl);
const scene = new Scene(gl);
let transforms = new Transforms();
const state = {
  open: false, session: null, closedAt: null, file: false, thin: false, live: false, lattice: null, frame: "map", size: 0, complete: false, sequence: null, changedAt: null, heardAt: Date.now(),
  mode: "height", heights: [0, 1], labels: new Map(), names: new Map(), robot: null, path: [], drive: [], loops: [], headset: null,
  clouds: new Map(), measuring: false, measured: [], chosen: null, shown: { cells: true, robot: true, grid: true, headset: true },
  scansOn: new Set(), channels: [], published: null, calibrated: false, problems: [], frames: 0,
};
const worker = new Worker(`/worker.js${/[?&]thin=1/.test(location.search) ? "?thin=1" : ""}`, { type: "module" });
const services = new Services(worker);
const writing = new Writing(services, worker, state);
const player = new Player(services, writing);
const drawing = new Drawing({ gl, canvas, camera, cells, free, scene, state });
const redraw = () => drawing.redraw();
const layers = new Layers({ state, worker, free, redraw });
const slice = new Slice((bounds) => {
  cells.slice = bounds;
  redraw();
});
const mixed = new MixedReality({ gl, cells, drawing, services, worker, state, transforms: () => transforms });
const planning = drawing.planning = new Planning({ services, camera, state, redraw });

// --- Messages of the worker.

const handlers = {
  open({ session, file, thin }) {
    if (session !== state.session) {
      // A restarted server: the state of robots is unknown.
      transforms = new Transforms();
      slice.follow(null);
      Object.assign(state, { session, robot: null, headset: null, calibrated: false, path: [], drive: [], loops: [], names: new Map() });
    }
    Object.assign(state, { open: true, file, thin, published: null });
    services.offered = [];
    writing.offered();
    mixed.connected();
    state.heardAt = Date.now();
  },
  closed() {
    if (state.open) state.closedAt = Date.now();
    state.open = false;
    layers.show();
  },
  channels({ channels }) {
    state.live = channels.some((channel) => channel.kind === "diagnostics");
    state.channels = channels;
    layers.show();
  },
  published({ topics }) {
    state.published = new Set(topics);
    layers.show();
  },
  lattice({ info, frame }) {
    Object.assign(state, { lattice: info, frame, size: 0, complete: false, chosen: null, measured: [], path: [] });
    state.labels.clear();
    planning.turn(false);
    cells.setLattice(info);
    chooseColour();
    panel.showCell(null);
  },
  tiles({ tiles, size, labels, coloured, earth, now, sequence, complete }) {
    if (state.lattice) Object.assign(state.lattice, earth);
    for (const tile of tiles) cells.setTile(tile);
    cells.now = now;
    Object.assign(state, { size, labels: new Map(labels), coloured, sequence, complete, changedAt: Date.now(), now });
    ranges();
    redraw();
  },
  transforms({ transforms: come, fixed }) {
    transforms.add(come);
    mixed.confirm(come);
    if (!fixed) player.heard(come.at(-1)?.stamp);
    const robot = transforms.find(state.frame, ROBOT);
    if (robot) {
      const first = !state.robot;
      state.robot = robot;
      slice.follow(robot.position[2]);
      if (first) layers.show();
      const last = state.path[state.path.length - 1];
      if (!last || length(sub(last, robot.position)) > 0.15) state.path.push(robot.position);
      if (state.path.length > MOST_PATH) state.path.shift();
    }
    headset.follow(state.headset, transforms.find(state.frame, HEADSET));
    redraw();
  },
  calibration({ said }) {
    state.headset = headset.headsetOf(said);
    headset.showVerdict(said);
    mixed.calibrated(said);
    state.calibrated = true;
    layers.show();
    redraw();
  },
  // Corrected by loops, where odometry closes them.
  drive({ said }) {
    state.drive = said.frame === state.frame ? said.points : [];
    redraw();
  },
  loops({ said }) {
    state.loops = said.frame === state.frame ? said.points : [];
    redraw();
  },
  names({ said }) {
    state.names = said;
    chooseColour();
  },
  cloud({ topic, cloud }) {
    const known = state.clouds.get(topic);
    if (!known) return;
    const place = transforms.find(state.frame, cloud.frame);
    if (!place && cloud.frame !== state.frame) return;
    const origin = place ? add(place.position, rotate(place.rotation, cloud.origin)) : cloud.origin;
    const slot = known.next++ % known.keep;
    scene.set(`${topic} ${slot}`, place ? turnPoints(cloud.points, place.rotation) : cloud.points);
    known.scans[slot] = { name: `${topic} ${slot}`, origin, at: performance.now() };
    redraw();
  },
  free(news) {
    free.take(news);
    redraw();
  },
  diagnostics({ said }) {
    panel.showDiagnostics(said);
    player.told(said);
  },
  rates({ rates }) {
    if (rates.length > 0) state.heardAt = Date.now();
    if (by("rates").closest("details").open) panel.showRates(rates);
  },
  services({ services: offered }) {
    services.offered = offered;
    writing.offered();
    planning.offered();
    player.look();
  },
  answer: (message) => services.answered(message),
  parameters: ({ parameters }) => writing.showParameters(parameters),
  problem({ text, told }) {
    if (told) writing.say(text, true);
    state.problems.push(text);
    if (state.problems.length > 50) state.problems.shift();
    console.warn(text);
  },
  cell: ({ cell, request }) => answered(cell, request),
};

worker.onmessage = ({ data }) => handlers[data.type]?.(data);

function turnPoints(points, rotation) {
  const out = new Float32Array(points.length);
  for (let i = 0; i < points.length; i += 3) out.set(rotate(rotation, points.subarray(i, i + 3)), i);
  return out;
}

// --- Colours and slice.

function ranges() {
  const bounds = cells.bounds();
  if (!bounds) return;
  const [low, high] = [bounds.low[2], Math.max(bounds.high[2], bounds.low[2] + 1)];
  const [was, wasHigh] = state.heights;
  // Stable while the map grows a little.
  if (Math.abs(low - was) > 0.2 || Math.abs(high - wasHigh) > 0.2) state.heights = [low, high];
  slice.update(cells.heights(), state.heights);
  chooseColour();
}

const legend = () => legendOf({ ...state, range: cells.colour.range, span: slice.span });

function chooseColour() {
  const { mode } = state;
  const range = { height: state.heights, count: [1, 10], label: [0, 1], age: [0, 60], colour: [0, 1] }[mode];
  cells.colour = { mode: MODES.indexOf(mode), range };
  cells.setPalette(mode);
  showLegend(legend());
  redraw();
}

// --- Selected cells, and distances between them.

function pick(x, y) {
  const seen = drawing.view();
  const found = cells.pick(seen, Math.round(x * seen.ratio), Math.round(seen.height - 1 - y * seen.ratio));
  panel.showNote(found ? null : "no cell here", x, y);
  if (!found) {
    cells.chosen = state.chosen = null;
    if (state.measured.length === 2) state.measured = [];
    panel.showCell(null);
    redraw();
    return null;
  }
  cells.chosen = { ...found, number: -1 };
  const centre = cells.centre(found.tile, placeIndex(found.place));
  state.chosen = { ...found, centre };
  if (state.measuring) state.measured = state.measured.length === 1 ? [state.measured[0], centre] : [centre];
  planning.picked(centre);
  worker.postMessage({ type: "cell", ...found, request: centre });
  redraw();
  return found;
}

function answered(cell, centre) {
  if (!cell) return panel.showCell(null);
  const shown = { key: cell.key, centre: centre.map((x) => x.toFixed(2)).join(", ") + " m", points: panel.whole(cell.count) };
  if (cell.label !== 65535) shown.label = state.names.get(cell.label) ?? cell.label;
  shown.changed = `${panel.seconds(cell.age)} ago`;
  if (state.robot) shown["from the robot"] = panel.metres(length(sub(centre, state.robot.position)));
  state.cell = cell;
  panel.showCell(shown);
  writing.query(centre).catch((error) => error.message).then((answer) => {
    if (answer && state.cell === cell) panel.showCell({ ...shown, mapper: answer });
  });
}

function measure() {
  state.measuring = !state.measuring;
  state.measured = [];
  by("measure").setAttribute("aria-pressed", state.measuring);
  canvas.classList.toggle("aim", state.measuring);
  redraw();
}

// --- Buttons, keys, timers.

// Stores the moved view in the address.
function moved() {
  drawing.moved();
  clearTimeout(moved.link);
  moved.link = setTimeout(() => history.replaceState(null, "", `#view=${camera.toText()}`), 500);
  showCamera();
}

function setCamera(mode) {
  camera.setMode(mode);
  moved();
}

function fit() {
  camera.automatic = true;
  if (camera.mode === "follow") camera.mode = "free";
  moved();
}

function showCamera() {
  for (const button of document.querySelectorAll("[data-camera]")) button.setAttribute("aria-pressed", button.dataset.camera === camera.mode);
}

function theme() {
  const light = document.documentElement.classList.toggle("light");
  by("theme").textContent = light ? "Dark" : "Light";
  localStorage.setItem("lattice-theme", light ? "light" : "dark");
  redraw();
}

function fold() {
  const hidden = (by("sheet").hidden = !by("sheet").hidden);
  by("fold").setAttribute("aria-expanded", !hidden);
  redraw();
}

function picture() {
  drawing.drawNow();
  const { lattice, frame, size } = state;
  const facts = { size, lattice: lattice ? panel.latticeText(lattice) : "no map", frame: lattice ? panel.frameText(frame, lattice) : "" };
  const { ratio } = drawing.view();
  return pictureOf({ canvas, ratio, camera, grid: drawing.gridStep, legend: legend(), css: cssColour, facts });
}

function savePicture() {
  picture().toBlob((blob) => {
    const link = panel.element("a", { href: URL.createObjectURL(blob), download: "lattice.png" });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

// Shows the state of the connection, even without messages.
function tick() {
  // A constant map sends nothing more.
  const quiet = state.live ? Date.now() - state.heardAt : 0;
  const changed = state.changedAt === null ? null : (Date.now() - state.changedAt) / 1000;
  const isEmpty = state.size === 0 && (!state.lattice || state.complete);
  cells.stale = state.open && quiet < QUIET_MS ? 0 : 1;
  if (!state.open) {
    // A first connection, and one to a restarted server, take a moment.
    const waited = state.closedAt === null ? Date.now() - BEGUN > START_MS : Date.now() - state.closedAt > AGAIN_MS;
    const since = new Date(state.changedAt ?? state.heardAt).toLocaleTimeString();
    const text = state.lattice ? `No connection: this is the map of ${since}. Trying again …` : "No connection to the viewer server. Trying again …";
    panel.showBanner(waited ? text : null);
    panel.showState(waited ? "not connected" : "connecting", waited ? "bad" : "");
  } else if (quiet >= QUIET_MS) {
    panel.showBanner(`No message for ${panel.seconds(quiet / 1000)}.`, true);
    panel.showState("quiet", "warn");
  } else {
    panel.showBanner(null);
    const words = state.file ? "file" : "live";
    panel.showState(!state.lattice ? "no map yet" : !state.complete ? "loading" : isEmpty ? "empty" : words, isEmpty ? "warn" : "ok");
  }
  showNothing(state.open && isEmpty && Date.now() - BEGUN > START_MS / 2, state.lattice, state.channels.find(({ kind }) => kind === "map")?.topic);
  panel.showFacts({ ...state, changed });
  document.querySelector("[data-camera=follow]").disabled = !state.robot;
  by("heights").hidden = by("legend").hidden = state.size === 0;
  for (const id of ["rates", "nodes"]) by(id).closest("details").hidden = state.file;
  by("colour").querySelector("[value=age]").hidden = state.file;
  // Ages of cells grow without messages.
  if (changed !== null) cells.now = state.now + changed;
  if (cells.stale !== tick.stale || state.mode === "age") redraw();
  tick.stale = cells.stale;
}

const pointer = { moved, clicked: (x, y) => { camera.automatic = false; pick(x, y); } };
watchPointer(canvas, camera, pointer);
watchKeys({
  1: () => setCamera("free"), 2: () => setCamera("follow"), 3: () => setCamera("top"), 4: () => setCamera("side"),
  f: fit, m: measure, p: savePicture, r: () => by("roof").click(), t: theme, h: fold,
  ArrowLeft: () => { camera.orbit(-25, 0); moved(); }, ArrowRight: () => { camera.orbit(25, 0); moved(); },
  ArrowUp: () => { camera.orbit(0, 20); moved(); }, ArrowDown: () => { camera.orbit(0, -20); moved(); },
  "+": () => { camera.zoom(0.85); moved(); }, "-": () => { camera.zoom(1.18); moved(); },
});
for (const button of document.querySelectorAll("[data-camera]")) button.addEventListener("click", () => setCamera(button.dataset.camera));
for (const [id, action] of Object.entries({ fit, measure, picture: savePicture, theme, fold })) by(id).addEventListener("click", action);
by("colour").addEventListener("change", (event) => {
  state.mode = event.target.value;
  chooseColour();
});
new ResizeObserver(redraw).observe(canvas);
if (localStorage.getItem("lattice-theme") === "light") theme();
const given = /#view=(.*)/.exec(location.hash);
if (given) camera.fromText(given[1]);
if (window.innerWidth <= 640) fold();
showCamera();
layers.show();
chooseColour();
slice.show();
setInterval(tick, 250);
tick();
redraw();

// For tests: the displayed state as numbers.
window.lattice = {
  state, camera, cells, drawing, free, mixed, picture, planning, player, slice, pick, frame: () => drawing.drawNow(),
  // Keys, or counts in key order.
  keys: (what = "keys") => new Promise((resolve) => {
    const take = ({ data }) => {
      if (data.type !== "keys") return;
      worker.removeEventListener("message", take);
      resolve(data[what]);
    };
    worker.addEventListener("message", take);
    worker.postMessage({ type: "keys" });
  }),
  // Fraction of pixels that are not background.
  lit() {
    drawing.drawNow();
    const [w, h] = [canvas.width, canvas.height];
    const pixels = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const ground = colourOf("--ground").map((x) => Math.round(255 * x));
    let lit = 0;
    for (let i = 0; i < pixels.length; i += 4) if (ground.some((x, k) => Math.abs(pixels[i + k] - x) > 24)) lit++;
    return lit / (w * h);
  },
  frameMs: () => drawing.lastFrame,
};
