// Heights between which cells are shown, and the roof that is taken off.

import { clamp } from "./math.js";
import { by, metres } from "./panel.js";

const STEPS = 1000;
// The cut without a roof: so far above the robot's frame, m; where there is none, at this share of the heights.
const OVER_ROBOT_M = 1.6;
const SHARE = 0.6;
// The cut follows the robot in steps, m.
const STEP_M = 0.2;

export class Slice {
  constructor(changed) {
    // Lowest and highest centre of what is there, most of it, and the bounds, m; null: none.
    Object.assign(this, { changed, span: [0, 1], most: [0, 1], bounds: [null, null], robot: null });
    ["low", "high"].forEach((id, end) => by(id).addEventListener("input", () => this.slid(id, end)));
    by("roof").addEventListener("change", () => {
      this.bounds[1] = null;
      this.cut();
    });
  }

  // Takes the heights of what there is now, and those of most cells.
  update(span, most) {
    if ([0, 1].every((end) => span[end] === this.span[end] && most[end] === this.most[end])) return;
    Object.assign(this, { span, most });
    this.cut();
  }

  // Takes the height of the robot; null: there is none.
  follow(robot) {
    if (robot === this.robot || (robot !== null && this.robot !== null && Math.abs(robot - this.robot) < STEP_M)) return;
    this.robot = robot;
    this.cut();
  }

  slid(id, end) {
    const value = Number(by(id).value);
    const open = end ? value >= STEPS : value <= 0;
    this.bounds[end] = open ? null : this.span[0] + (value / STEPS) * (this.span[1] - this.span[0]);
    if (end) by("roof").checked = false;
    this.show();
  }

  // Height of the cut, m.
  roof() {
    const [low, high] = this.most;
    return this.robot === null ? low + SHARE * (high - low) : this.robot + OVER_ROBOT_M;
  }

  // Hides what is above the cut, while that is wanted.
  cut() {
    if (by("roof").checked) this.bounds[1] = this.roof();
    this.show();
  }

  show() {
    const [begin, end] = this.span;
    const length = Math.max(end - begin, 1e-3);
    ["low", "high"].forEach((id, i) => {
      const height = this.bounds[i] ?? this.span[i];
      by(id).value = Math.round(STEPS * clamp((height - begin) / length, 0, 1));
      by(`${id}-value`).textContent = metres(height);
    });
    by("roof-value").textContent = `above ${metres(this.roof())}`;
    this.changed([this.bounds[0] ?? -1e9, this.bounds[1] ?? 1e9]);
  }
}
