// Scene besides the cells: ground grid, clouds, robot with its path, headset, measured line.

import * as shaders from "./shaders.js";
import { program } from "./renderer.js";
import { rotate, sub } from "./math.js";

const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];
// Vehicle of one metre, x forward: a wedge in the direction of travel.
const ROBOT = [
  [0.6, 0, 0.1], [-0.5, 0.38, 0], [-0.3, 0, 0.1], [0.6, 0, 0.1], [-0.3, 0, 0.1], [-0.5, -0.38, 0],
  [0.6, 0, 0.1], [-0.5, 0.38, 0], [-0.35, 0, 0.42], [0.6, 0, 0.1], [-0.35, 0, 0.42], [-0.5, -0.38, 0],
  [-0.5, 0.38, 0], [-0.3, 0, 0.1], [-0.35, 0, 0.42], [-0.5, -0.38, 0], [-0.3, 0, 0.1], [-0.35, 0, 0.42],
].flat();
// Headset frustum: edges from its eye, and the faces between them.
const CORNERS = [[1, 0.6, 0.4], [1, -0.6, 0.4], [1, -0.6, -0.4], [1, 0.6, -0.4]];
const FRUSTUM = CORNERS.flatMap((corner, i) => [[0, 0, 0], corner, corner, CORNERS[(i + 1) % 4]]).flat();
const VIEW = CORNERS.flatMap((corner, i) => [[0, 0, 0], corner, CORNERS[(i + 1) % 4]]).flat();

export class Scene {
  constructor(gl) {
    this.gl = gl;
    this.plain = program(gl, shaders.PLAIN_VERTEX, shaders.PLAIN_FRAGMENT);
    this.shapes = new Map();
    this.set("robot", ROBOT);
    this.set("frustum", FRUSTUM);
    this.set("view", VIEW);
  }

  // Stores the vertices of a shape.
  set(name, corners) {
    const { gl } = this;
    let shape = this.shapes.get(name);
    if (!shape) {
      shape = { buffer: gl.createBuffer(), array: gl.createVertexArray() };
      gl.bindVertexArray(shape.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, shape.buffer);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindVertexArray(null);
      this.shapes.set(name, shape);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, shape.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, corners instanceof Float32Array ? corners : new Float32Array(corners), gl.DYNAMIC_DRAW);
    shape.size = corners.length / 3;
  }

  begin(view) {
    const { gl } = this;
    this.view = view;
    gl.useProgram(this.plain.made);
    gl.uniformMatrix4fv(this.plain.at.u_clip, false, view.clip);
    gl.uniform1f(this.plain.at.u_reach, 0);
  }

  // Draws a shape at a map position, rotated and scaled.
  draw(name, mode, { origin, turn = IDENTITY, ink, size = 1, fade = null }) {
    const { gl, plain: { at } } = this;
    const shape = this.shapes.get(name);
    if (!shape || shape.size === 0) return;
    gl.uniform3f(at.u_origin, ...sub(origin, this.view.eye));
    gl.uniformMatrix3fv(at.u_turn, false, turn);
    gl.uniform4f(at.u_ink, ...ink);
    gl.uniform1f(at.u_size, size);
    gl.uniform1f(at.u_reach, fade ? fade.reach : 0);
    if (fade) gl.uniform3f(at.u_fade, ...sub(fade.at, this.view.eye));
    gl.bindVertexArray(shape.array);
    gl.drawArrays(mode, 0, shape.size);
    gl.bindVertexArray(null);
  }

  // Ground grid around a position, with a spacing by distance.
  grid(target, height, distance, ink) {
    const { gl } = this;
    const step = 10 ** Math.round(Math.log10(distance / 6));
    const count = 40;
    const middle = [Math.round(target[0] / step) * step, Math.round(target[1] / step) * step, height];
    if (this.gridStep !== step) {
      this.gridStep = step;
      const lines = [];
      for (let i = -count; i <= count; i++) {
        for (let k = -count; k < count; k++) {
          lines.push(i * step, k * step, 0, i * step, (k + 1) * step, 0, k * step, i * step, 0, (k + 1) * step, i * step, 0);
        }
      }
      this.set("grid", lines);
    }
    this.draw("grid", gl.LINES, { origin: middle, ink, fade: { at: [target[0], target[1], height], reach: Math.max(distance * 2.2, step * 8) } });
    return step;
  }
}

// Matrix of a scaled rotation.
export function turned(rotation, size = 1) {
  const axes = [[size, 0, 0], [0, size, 0], [0, 0, size]];
  return axes.flatMap((axis) => rotate(rotation, axis));
}
