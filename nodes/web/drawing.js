// Render loop: draws a frame after each change.

import { add, length, sub } from "./math.js";
import { showCompass } from "./compass.js";
import { drawHeadset } from "./headset.js";
import * as panel from "./panel.js";
import { turned } from "./scene.js";

const { by } = panel;
// Display time of scans, ms: a laser sends many small clouds.
const SCAN_MS = 700;
// Time after the last movement until the view is at rest, ms.
const MOVING_MS = 200;
// Window width below which the panel is at the bottom, px.
const NARROW = 640;
const PANEL = 280;
const LOOP_INK = [0.1, 0.65, 0.3, 1];
export const ROBOT_INK = [1, 0.78, 0.36, 1];

export class Drawing {
  constructor(parts) {
    Object.assign(this, parts);
    this.waiting = false;
    // True while a headset draws.
    this.paused = false;
    // Frame in progress on the GPU, and true if another one must follow.
    this.fence = null;
    this.due = false;
    this.movedAt = 0;
    this.lastFrame = 0;
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.frame());
  }

  // Draws a fast frame now, and a full one once the view is at rest.
  moved() {
    this.movedAt = performance.now();
    this.redraw();
    setTimeout(() => this.redraw(), MOVING_MS + 50);
  }

  // Viewport and camera as needed by all drawing.
  view() {
    const { canvas, camera } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, 1.5);
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    [camera.width, camera.height] = [width, height];
    const [narrow, folded] = [window.innerWidth <= NARROW, by("sheet").hidden];
    camera.aside = narrow || folded ? 0 : Math.min(0.35, PANEL / canvas.clientWidth);
    camera.above = narrow && !folded ? Math.min(0.5, by("panel").offsetHeight / canvas.clientHeight) : 0;
    return {
      ratio, width, height, axes: camera.axes(), eye: camera.eye(), clip: camera.clip(), rays: camera.rays(),
      focal: camera.focal(), near: camera.near(), aside: camera.aside, above: camera.above, window: [0, 0, width, height],
    };
  }

  frame() {
    const { gl, state } = this;
    this.waiting = false;
    if (this.paused) return;
    this.due = this.fence !== null;
    if (this.due) return;
    this.drawNow();
    this.fence = { begin: performance.now(), sync: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0) };
    gl.flush();
    this.poll();
    state.frames++;
  }

  // Waits for the GPU to finish the frame and measures its time.
  poll() {
    const { gl } = this;
    setTimeout(() => {
      if (gl.clientWaitSync(this.fence.sync, 0, 0) === gl.TIMEOUT_EXPIRED) return this.poll();
      gl.deleteSync(this.fence.sync);
      this.lastFrame = performance.now() - this.fence.begin;
      this.fence = null;
      this.cells.timed(this.lastFrame);
      if (this.due) this.redraw();
    }, 4);
  }

  drawNow() {
    const { gl, cells, state } = this;
    this.view();
    this.aim();
    const seen = this.view();
    gl.viewport(0, 0, seen.width, seen.height);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.clearColor(...colourOf("--ground"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (state.shown.cells) cells.draw(seen, performance.now() - this.movedAt < MOVING_MS);
    this.drawScene(seen);
    this.showMarks(seen);
    this.compass = showCompass(by("compass"), { camera: this.camera, ratio: seen.ratio, grid: this.gridStep, css: cssColour });
  }

  // Moves the camera according to its mode.
  aim() {
    const { camera, cells, state } = this;
    if (camera.mode === "follow" && state.robot) camera.target = state.robot.position;
    else if (camera.automatic) {
      const bounds = cells.bounds();
      if (bounds) camera.fit(bounds.low, bounds.high);
    }
  }

  drawScene(seen) {
    const { gl, camera, scene, state } = this;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    scene.begin(seen);
    gl.depthMask(false);
    this.gridStep = state.shown.grid ? scene.grid(camera.target, state.heights[0] - 0.3, camera.distance, [...colourOf("--quiet"), 0.24]) : null;
    gl.depthMask(true);
    this.free.slice = this.cells.slice;
    this.free.stale = this.cells.stale;
    this.free.draw(seen);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    scene.begin(seen);
    this.drawClouds(seen);
    if (state.shown.robot && state.robot) this.drawRobot();
    if (state.shown.headset && state.headset) drawHeadset(gl, scene, camera.distance, state.headset, colourOf);
    this.planning.draw(gl, scene);
    if (state.measured.length === 2) {
      gl.disable(gl.DEPTH_TEST);
      scene.set("measured", [0, 0, 0, ...sub(state.measured[1], state.measured[0])]);
      scene.draw("measured", gl.LINES, { origin: state.measured[0], ink: [...colourOf("--ink"), 1] });
    }
  }

  drawClouds(seen) {
    const { gl, scene, state } = this;
    const now = performance.now();
    for (const [topic, { scans, ink }] of state.clouds) {
      if (!state.scansOn.has(topic)) continue;
      for (const { name, origin, at } of scans) {
        if (now - at < SCAN_MS || scans.length === 1) scene.draw(name, gl.POINTS, { origin, ink: [...colourOf(ink), 0.9], size: 2.5 * seen.ratio });
      }
    }
  }

  drawRobot() {
    const { gl, camera, scene, state: { drive, loops, robot } } = this;
    const path = drive.length > 1 ? [...drive, robot.position] : this.state.path;
    // On top, so that they are not hidden by the map.
    gl.disable(gl.DEPTH_TEST);
    if (path.length > 1) {
      scene.set("path", path.flatMap((p) => sub(p, path[0])));
      scene.draw("path", gl.LINE_STRIP, { origin: path[0], ink: [...colourOf("--accent"), 0.9] });
    }
    if (loops.length > 1) {
      scene.set("loops", loops.flatMap((p) => sub(p, loops[0])));
      scene.draw("loops", gl.LINES, { origin: loops[0], ink: LOOP_INK });
    }
    const size = Math.max(1.6, camera.distance * 0.03);
    scene.draw("robot", gl.TRIANGLES, { origin: robot.position, turn: turned(robot.rotation, size), ink: ROBOT_INK });
    gl.enable(gl.DEPTH_TEST);
  }

  // Text labels at map positions.
  showMarks(seen) {
    const marks = [];
    const mark = (point, text) => {
      const { x, y, depth } = this.camera.project(point);
      if (depth <= 0) return;
      const span = panel.element("span", { textContent: text });
      span.style.left = `${x / seen.ratio}px`;
      span.style.top = `${y / seen.ratio}px`;
      marks.push(span);
    };
    const [a, b] = this.state.measured;
    if (a && b) mark(add(a, b).map((x) => x / 2), panel.metres(length(sub(a, b))));
    else if (a) mark(a, "from here");
    const { headset, shown } = this.state;
    if (shown.headset && headset) mark(headset.position, "headset");
    if (shown.headset) for (const { end, text } of headset?.weak ?? []) mark(add(headset.position, end), text);
    by("marks").replaceChildren(...marks);
  }
}

// Colour of the style sheet, as text and as numbers 0 to 1.
export const cssColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const colourOf = (name) => {
  const hex = cssColour(name);
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
};
