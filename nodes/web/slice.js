// Height range of displayed cells, and removal of the roof.

import { clamp } from "./math.js";
import { by, metres } from "./panel.js";

const STEPS = 1000;
// Height of the roof cut: above the robot's frame, m; without a robot, as a fraction of the height range.
const OVER_ROBOT_M = 1.6;
const SHARE = 0.6;
// Step of the cut when it follows the robot, m.
const STEP_M = 0.2;

export class Slice {
  constructor(changed) {
    // Range of most cell centres, and bounds, m; null: none.
    Object.assign(this, { changed, span: [0, 1], most: [0, 1], bounds: [null, null], robot: null });
    ["low", "high"].forEach((id, end) => by(id).addEventListener("input", () => this.slid(id, end)));
    by("roof").addEventListener("change", () => {
      this.bounds[1] = null;
      this.cut();
    });
  }

  // Sets the current height range, and that of most cells.
  update(span, most) {
    if ([0, 1].every((end) => span[end] === this.span[end] && most[end] === this.most[end])) return;
    Object.assign(this, { span, most });
    this.cut();
  }

  // Sets the height of the robot; null: no robot.
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

  // Hides cells above the cut, if enabled.
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
