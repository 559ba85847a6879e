// Colour legend of each mode, in the panel and in saved images.

import { gradient, labelColour } from "./colours.js";
import { by, element, metres, seconds, whole } from "./panel.js";

const UNLABELLED = "rgb(115 115 115)";
// Limits of listed labels, in the panel and in an image.
const MOST_NAMES = 500;
const MOST_PAINTED = 24;

// Legend of a mode: a title, and ticks of a bar (positions 0 to 1) or colours with names and cell counts.
export function legendOf({ mode, range: [low, high], span, labels, names, size, thin, coloured }) {
  const at = (value) => (value - low) / (high - low);
  if (mode === "count") {
    const ticks = [1, 10, 100, 2 ** high - 1].map((n) => [at(Math.log2(n + 1)), whole(Math.round(n))]);
    ticks.at(-1)[1] = `≥ ${ticks.at(-1)[1]}`;
    return { title: "points in a cell", mode, ticks };
  }
  if (mode === "age") {
    return { title: "time since the last change", mode, ticks: [[0, "0 s"], [0.5, seconds((low + high) / 2)], [1, `≥ ${seconds(high)}`]] };
  }
  if (mode === "height") {
    const beyond = ["≤ ", "≥ "].map((sign, end) => (end ? span[1] > high + 0.01 : span[0] < low - 0.01) ? sign : "");
    const ticks = [[0, beyond[0] + metres(low)], [0.5, metres((low + high) / 2)], [1, beyond[1] + metres(high)]];
    return { title: "height in the frame of the map", mode, ticks };
  }
  if (mode === "colour") {
    const note = thin ? "The thin form of the map has no colours."
      : coloured ? "Cells without a colour are grey." : "The cells of this map have no colours: keep_color of the mapper keeps them.";
    return { title: "mean colour of the points in a cell", note };
  }
  const title = "most frequent label of a cell";
  if (thin) return { title, note: "The thin form of the map has no labels." };
  if (labels.size === 0) return { title, note: "The cells of this map have no labels." };
  const sorted = [...labels].sort((a, b) => b[1] - a[1] || a[0] - b[0]);
  const rows = sorted.map(([label, cells]) => [labelColour(label), names.get(label) || `label ${label}`, cells]);
  const rest = size - sorted.reduce((sum, [, cells]) => sum + cells, 0);
  if (rest > 0) rows.push([UNLABELLED, "no label", rest]);
  return { title, rows };
}

// Shows it in the panel.
export function showLegend(legend) {
  const key = JSON.stringify(legend);
  if (showLegend.key === key) return;
  showLegend.key = key;
  const { title, mode, ticks, rows, note } = legend;
  const parts = [element("p", { textContent: title })];
  if (ticks) {
    const bar = element("div", { className: "bar" });
    bar.style.background = gradient(mode);
    const texts = ticks.map(([at, textContent]) => {
      const text = element("span", { textContent });
      text.style.left = `${100 * at}%`;
      return text;
    });
    parts.push(bar, element("div", { className: "ticks" }, ...texts));
  }
  if (rows) {
    const cells = rows.slice(0, MOST_NAMES).flatMap(([colour, name, count]) => [
      element("span", {}, swatch(colour), name), element("span", { textContent: whole(count) }),
    ]);
    if (rows.length > MOST_NAMES) cells.push(element("span", { textContent: `${whole(rows.length - MOST_NAMES)} more` }));
    parts.push(element("div", { className: "names" }, ...cells));
  }
  if (note) parts.push(element("div", { textContent: note }));
  by("legend").replaceChildren(...parts);
}

// Colour swatch.
export function swatch(colour) {
  const made = element("i", { className: "swatch" });
  made.style.background = colour;
  return made;
}

// Draws it into an image, with its upper left corner at x, y; returns its height.
export function paintLegend(ctx, { title, mode, ticks, rows, note }, { x, y, width, ink, quiet }) {
  const line = 18;
  const write = (text, left, top, colour, align = "left") => {
    [ctx.fillStyle, ctx.textAlign] = [colour, align];
    ctx.fillText(text, left, top, width);
  };
  ctx.textBaseline = "top";
  write(title, x, y, quiet);
  let at = y + line;
  if (ticks) {
    const colours = gradient(mode).match(/#\w{6}/g);
    const bar = ctx.createLinearGradient(x, 0, x + width, 0);
    colours.forEach((colour, i) => bar.addColorStop(i / (colours.length - 1), colour));
    ctx.fillStyle = bar;
    ctx.fillRect(x, at, width, 10);
    at += 13;
    ticks.forEach(([place, text], i) => write(text, x + place * width, at, ink, i === 0 ? "left" : i === ticks.length - 1 ? "right" : "center"));
    at += line;
  }
  const painted = rows?.slice(0, MOST_PAINTED) ?? [];
  for (const [colour, name, count] of painted) {
    ctx.fillStyle = colour;
    ctx.fillRect(x, at + 2, 10, 10);
    write(shortened(ctx, name, width - 90), x + 16, at, ink);
    write(whole(count), x + width, at, quiet, "right");
    at += line;
  }
  if (rows?.length > painted.length) {
    write(`${whole(rows.length - painted.length)} more`, x + 16, at, quiet);
    at += line;
  }
  if (note) {
    write(note, x, at, ink);
    at += line;
  }
  return at - y;
}

function shortened(ctx, text, width) {
  if (ctx.measureText(text).width <= width) return text;
  let short = text.slice(0, 60);
  while (short && ctx.measureText(`${short}…`).width > width) short = short.slice(0, -1);
  return `${short}…`;
}
