// Camera: an orbit around a target.

import { add, clamp, cross, dot, multiply, scale, sub } from "./math.js";

const FIELD_OF_VIEW = 0.9;
// Margin of a fitted view around the map.
const MARGIN = 1.12;

export class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.distance = 40;
    // Direction from the target to the eye: azimuth, and elevation above the horizon.
    this.yaw = -2.2;
    this.pitch = 0.6;
    // free, follow, top or side.
    this.mode = "free";
    // True until the user moves the camera: the view then fits the map.
    this.automatic = true;
    this.width = 1;
    this.height = 1;
    // Horizontal offset of the view's centre, as a fraction of half the screen: beside the panel.
    this.aside = 0;
    // Vertical offset: above the panel of a narrow window.
    this.above = 0;
  }

  // Unit vectors of the view: right, up, and back to the eye.
  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const back = [cp * cy, cp * sy, sp];
    const right = [-sy, cy, 0];
    return { right, up: cross(back, right), back };
  }

  eye() { return add(this.target, scale(this.axes().back, this.distance)); }

  // Pixels of a length of 1 m at a distance of 1 m.
  focal() { return this.height / 2 / Math.tan(FIELD_OF_VIEW / 2); }

  // Projection from map coordinates relative to the eye to the screen.
  clip() {
    const { right, up, back } = this.axes();
    const view = new Float32Array([
      right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, 0, 0, 0, 1,
    ]);
    const near = this.near();
    const far = this.distance * 50 + 2000;
    const f = 1 / Math.tan(FIELD_OF_VIEW / 2);
    const projection = new Float32Array(16);
    projection[0] = (f * this.height) / this.width;
    projection[5] = f;
    projection[8] = -this.aside;
    projection[9] = -this.above;
    projection[10] = (near + far) / (near - far);
    projection[11] = -1;
    projection[14] = (2 * near * far) / (near - far);
    return multiply(projection, view);
  }

  near() { return clamp(this.distance * 0.02, 0.05, 20); }

  // Viewing direction of a screen position (-1 to 1).
  rays() {
    const { right, up, back } = this.axes();
    const t = Math.tan(FIELD_OF_VIEW / 2);
    const [x, y] = [scale(right, (t * this.width) / this.height), scale(up, t)];
    return new Float32Array([...x, ...y, ...sub(sub(scale(back, -1), scale(x, this.aside)), scale(y, this.above))]);
  }

  orbit(dx, dy) {
    this.automatic = false;
    if (this.mode === "top" || this.mode === "side") this.mode = "free";
    this.yaw -= dx * 0.006;
    this.pitch = clamp(this.pitch + dy * 0.006, -0.2, Math.PI / 2 - 1e-3);
  }

  pan(dx, dy) {
    this.automatic = false;
    if (this.mode === "follow") this.mode = "free";
    const { right, up, back } = this.axes();
    const s = this.distance / this.focal();
    // Along the ground, except in the side view.
    const flat = Math.abs(back[2]) < 0.3 ? up : cross([0, 0, 1], right);
    this.target = add(this.target, add(scale(right, -dx * s), scale(flat, dy * s)));
  }

  zoom(factor) {
    this.automatic = false;
    this.distance = clamp(this.distance * factor, 0.5, 20000);
  }

  setMode(mode) {
    this.mode = mode;
    this.automatic &&= mode !== "follow";
    if (mode === "top") [this.yaw, this.pitch] = [-Math.PI / 2, Math.PI / 2 - 1e-3];
    if (mode === "side") [this.yaw, this.pitch] = [-Math.PI / 2, 0.02];
    if (mode === "free") this.pitch = clamp(this.pitch, 0.35, 1.2);
  }

  // Fits the view to a box, given by its lowest and highest corner.
  fit(low, high) {
    this.target = scale(add(low, high), 0.5);
    const { right, up, back } = this.axes();
    const t = Math.tan(FIELD_OF_VIEW / 2);
    const [wide, tall] = [(t * (1 - this.aside) * this.width) / this.height, t * (1 - this.above)];
    let distance = 0;
    for (let corner = 0; corner < 8; corner++) {
      const c = sub([0, 1, 2].map((k) => (corner & (1 << k) ? high : low)[k]), this.target);
      distance = Math.max(distance, dot(c, back) + MARGIN * Math.max(Math.abs(dot(c, right)) / wide, Math.abs(dot(c, up)) / tall));
    }
    this.distance = clamp(distance, 3, 20000);
  }

  // Screen position of a point in pixels from the upper left corner, and its depth in m.
  project(point) {
    const p = sub(point, this.eye());
    const m = this.clip();
    const row = (r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
    const w = row(3);
    return { x: ((row(0) / w + 1) / 2) * this.width, y: ((1 - row(1) / w) / 2) * this.height, depth: w };
  }

  toText() {
    return [...this.target, this.distance, this.yaw, this.pitch].map((x) => x.toFixed(3)).join(",");
  }

  fromText(text) {
    const numbers = text.split(",").map(Number);
    if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return;
    this.target = numbers.slice(0, 3);
    [this.distance, this.yaw, this.pitch] = numbers.slice(3);
    this.automatic = false;
  }
}
