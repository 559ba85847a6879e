// Path of a ball between two selected cells, planned by the mapper.

import { add, length, sub } from "./math.js";
import { by, metres } from "./panel.js";
import { planned, requests } from "./requests.js";

export class Planning {
  constructor({ services, camera, state, redraw }) {
    Object.assign(this, { services, camera, state, redraw, on: false, asked: 0, picks: [], path: [] });
    by("plan").addEventListener("click", () => this.turn(!this.on));
    by("radius").addEventListener("change", () => this.ask());
  }

  offered() {
    by("way").hidden = !this.services.find("plan_path");
    if (by("way").hidden) this.turn(false);
  }

  turn(on) {
    this.on = on;
    by("plan").setAttribute("aria-pressed", on);
    this.begin([]);
  }

  begin(picks) {
    Object.assign(this, { picks, path: [] });
    this.asked++;
    by("way-said").textContent = this.on ? ["Pick the cell to begin at.", "Pick the cell to end at.", ""][picks.length] : "";
    this.redraw();
  }

  // Handles a clicked cell; the ball starts in front of the visible face.
  picked(centre) {
    if (!this.on) return;
    const to = sub(this.camera.eye(), centre);
    const toEye = to.map((x) => x / Math.max(length(to), 1e-9));
    this.begin([...(this.picks.length === 1 ? this.picks : []), { centre, toEye }]);
    this.ask();
  }

  async ask() {
    const radius = by("radius").valueAsNumber;
    if (this.picks.length !== 2 || !(radius >= 0)) return;
    this.begin(this.picks);
    const asked = this.asked;
    const say = (text) => {
      if (asked === this.asked) by("way-said").textContent = text;
    };
    say("Searching …");
    const side = Math.cbrt(this.state.lattice.volume);
    const [start, goal] = this.picks.map(({ centre, toEye }) => add(centre, toEye.map((x) => x * (radius + side))));
    try {
      const answer = planned(await this.services.call("plan_path", requests.plan(start, goal, radius, radius + 2 * side)));
      if (asked !== this.asked) return;
      this.path = answer.path;
      say(answer.success ? metres(answer.length) : answer.message);
    } catch (error) {
      say(error.message);
    }
    this.redraw();
  }

  draw(gl, scene) {
    const [first] = this.path;
    if (!first) return;
    // On top, like the robot's path.
    gl.disable(gl.DEPTH_TEST);
    const corners = this.path.flatMap((point) => sub(point, first));
    scene.set("way", corners);
    for (const kind of [gl.LINE_STRIP, gl.POINTS]) scene.draw("way", kind, { origin: first, ink: [1, 0.45, 0.85, 1], size: 4 });
    gl.enable(gl.DEPTH_TEST);
  }
}
