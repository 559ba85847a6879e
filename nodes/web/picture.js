// Saved image: the view with legend, axes and scale bar.

import { paintCompass } from "./compass.js";
import { paintLegend } from "./legend.js";
import { whole } from "./panel.js";

const WIDTH = 220;
const PAD = 12;

// The image as a canvas; the view has just been drawn.
export function pictureOf({ canvas, ratio, camera, grid, legend, css, facts: { size, lattice, frame } }) {
  const out = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const ctx = out.getContext("2d");
  ctx.drawImage(canvas, 0, 0);
  ctx.scale(ratio, ratio);
  const [width, height] = [canvas.width / ratio, canvas.height / ratio];
  ctx.font = "13px system-ui, sans-serif";
  const lines = [`${whole(size)} cells · ${lattice}`, frame];
  const [ink, quiet] = [css("--ink"), css("--quiet")];
  const text = { x: 2 * PAD, y: 2 * PAD + 18 * lines.length + 4, width: WIDTH, ink, quiet };
  // Height of the legend, before the card behind it is drawn.
  const trial = document.createElement("canvas").getContext("2d");
  trial.font = ctx.font;
  const below = paintLegend(trial, legend, text);
  ctx.globalAlpha = 0.9;
  ctx.fillStyle = css("--ground");
  ctx.fillRect(PAD, PAD, WIDTH + 2 * PAD, text.y + below);
  ctx.globalAlpha = 1;
  [ctx.textBaseline, ctx.textAlign] = ["top", "left"];
  lines.forEach((line, i) => {
    ctx.fillStyle = i ? quiet : ink;
    ctx.fillText(line, 2 * PAD, 2 * PAD + 18 * i, WIDTH);
  });
  paintLegend(ctx, legend, text);
  ctx.font = "600 12px system-ui, sans-serif";
  paintCompass(ctx, { width: width - PAD, height: height - PAD, camera, ratio, grid, css });
  return out;
}
