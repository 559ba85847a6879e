// Text panel with a ring, in front of the eyes in mixed reality.

import { multiply } from "./math.js";
import { program } from "./renderer.js";
import * as shaders from "./shaders.js";

const [WIDTH, HEIGHT] = [1024, 320];
// Half of the panel's size, and its centre from the eyes, m.
const HALF = [0.36, 0.1125];
const PLACE = [0, -0.22, -1.1];
const MOST_LINES = 4;
const INK = { ok: "#6cc08b", wait: "#6fb6c9", bad: "#e2766b" };

export class Sign {
  constructor(gl) {
    this.gl = gl;
    this.program = program(gl, shaders.SIGN_VERTEX, shaders.SIGN_FRAGMENT);
    this.texture = gl.createTexture();
    this.array = gl.createVertexArray();
    this.buffer = gl.createBuffer();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [WIDTH, HEIGHT];
    this.context = canvas.getContext("2d");
    this.key = null;
  }

  // Shows a title, a text, and a ring that is filled to a fraction.
  set({ title, text, kind, part }) {
    const key = JSON.stringify([title, text, kind, Math.round(part * 32)]);
    if (key === this.key) return;
    this.key = key;
    const { context: c, gl } = this;
    c.clearRect(0, 0, WIDTH, HEIGHT);
    c.fillStyle = "#12161de0";
    c.beginPath();
    c.roundRect(0, 0, WIDTH, HEIGHT, 40);
    c.fill();
    c.lineWidth = 18;
    for (const [ink, end] of [["#2c3542", 1], [INK[kind], part]]) {
      c.strokeStyle = ink;
      c.beginPath();
      c.arc(130, HEIGHT / 2, 80, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * end);
      c.stroke();
    }
    c.fillStyle = INK[kind];
    c.font = "600 46px system-ui, sans-serif";
    c.fillText(title, 260, 80, WIDTH - 300);
    c.fillStyle = "#dde3ea";
    c.font = "36px system-ui, sans-serif";
    this.lines(text).forEach((line, i) => c.fillText(line, 260, 140 + 46 * i, WIDTH - 300));
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, c.canvas);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  lines(text) {
    const lines = [""];
    for (const word of text.split(" ")) {
      const longer = `${lines.at(-1)} ${word}`.trim();
      if (this.context.measureText(longer).width <= WIDTH - 300) lines[lines.length - 1] = longer;
      else lines.push(word);
    }
    return lines.slice(0, MOST_LINES);
  }

  // Draws the panel for a view, given the transform of the viewer.
  draw(view, viewer) {
    const { gl, program: { made, at } } = this;
    const place = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...PLACE, 1]);
    const clip = multiply(view.projectionMatrix, multiply(view.transform.inverse.matrix, multiply(viewer.matrix, place)));
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.u_clip, false, clip);
    gl.uniform2f(at.u_half, ...HALF);
    gl.uniform1i(at.u_text, 0);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(this.array);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.bindVertexArray(null);
  }
}
