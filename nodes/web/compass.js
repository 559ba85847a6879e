// Map axes and a scale bar, on the page and in saved images.

import { dot } from "./math.js";

// REP 103: x east, y north, z up.
const AXES = [["E", [1, 0, 0], "--east"], ["N", [0, 1, 0], "--north"], ["up", [0, 0, 1], "--up"]];
const LONGEST_BAR = 120;

// Largest round length whose bar has at most so many pixels, with that of the bar, at the centre of the view.
export function scaleBar(pixelsOfMetre, longest = LONGEST_BAR) {
  const most = longest / pixelsOfMetre;
  const ten = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((n) => n * ten).find((n) => n <= most) ?? ten;
  return { length, pixels: length * pixelsOfMetre };
}

// Formats a length with a suitable unit.
export const lengthText = (m) => (m >= 1000 ? `${m / 1000} km` : m >= 1 ? `${m} m` : m >= 0.01 ? `${+(m * 100).toPrecision(2)} cm` : `${+(m * 1000).toPrecision(2)} mm`);

// Draws both into the lower right corner of an area; `ratio`: view pixels per area pixel.
export function paintCompass(ctx, { width, height, camera, ratio, grid, css }) {
  const { right, up, back } = camera.axes();
  const [x, y, size] = [width - 66, height - 80, 34];
  ctx.lineCap = "round";
  ctx.lineJoin = "round";
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  const ground = css("--ground");
  const outlined = (text, left, top, ink) => {
    [ctx.strokeStyle, ctx.lineWidth, ctx.fillStyle] = [ground, 3, ink];
    ctx.strokeText(text, left, top);
    ctx.fillText(text, left, top);
  };
  // Axes that point away from the eye first.
  const seen = AXES.map(([name, along, ink]) => ({ name, ink, dx: dot(along, right), dy: -dot(along, up), depth: dot(along, back) }));
  for (const { name, ink, dx, dy } of seen.sort((a, b) => a.depth - b.depth)) {
    for (const [colour, wide] of [[ground, 5], [css(ink), 2.5]]) {
      [ctx.strokeStyle, ctx.lineWidth] = [colour, wide];
      ctx.beginPath();
      ctx.moveTo(x, y);
      ctx.lineTo(x + dx * size, y + dy * size);
      ctx.stroke();
    }
    // An axis towards the eye has no label.
    if (Math.hypot(dx, dy) > 0.3) outlined(name, x + dx * (size + 12), y + dy * (size + 9), css(ink));
  }
  const { length, pixels } = scaleBar(camera.focal() / camera.distance / ratio);
  const [left, end, base] = [width - 10 - pixels, width - 10, height - 8];
  for (const [colour, wide] of [[ground, 4], [css("--ink"), 1.5]]) {
    [ctx.strokeStyle, ctx.lineWidth] = [colour, wide];
    ctx.beginPath();
    ctx.moveTo(left, base - 5);
    ctx.lineTo(left, base);
    ctx.lineTo(end, base);
    ctx.lineTo(end, base - 5);
    ctx.stroke();
  }
  ctx.textAlign = "right";
  outlined(grid ? `${lengthText(length)} · grid ${lengthText(grid)}` : lengthText(length), end, base - 14, css("--ink"));
  return { length, pixels, axes: seen.map(({ name, dx, dy }) => [name, dx, dy]) };
}

// Draws them on the page's own canvas.
export function showCompass(canvas, parts) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const density = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * density), Math.round(height * density)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const ctx = canvas.getContext("2d");
  ctx.setTransform(density, 0, 0, density, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = "600 12px system-ui, sans-serif";
  return paintCompass(ctx, { width, height, ...parts });
}
