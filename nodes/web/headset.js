// Headset: its view at its pose, its verdict, and its weak directions.

import { add, cross, dot, length, scale } from "./math.js";
import { by, element, metres } from "./panel.js";
import { turned } from "./scene.js";

export const OK = 1;
export const VERDICTS = ["nothing found yet", "OK", "AMBIGUOUS", "DEGENERATE", "NO OVERLAP", "REJECTED INPUT"];
const ROTATION = 1;
const MOST_WEAK = 6;
const WEAK_INK = [0.95, 0.6, 0.95, 1];

// Displayed parts of a result; none before the first search.
export function headsetOf({ position, rotation, verdict, frame, weak }) {
  if (verdict === 0) return null;
  const sound = weak.filter(({ axis, sigma }) => length(axis) > 0 && [...axis, sigma].every(Number.isFinite));
  return { position, rotation, verdict, frame, weak: sound.slice(0, MOST_WEAK).map(drawnDirection) };
}

// Moves it to its pose from transforms, which are valid for the verdict OK only.
export function follow(headset, place) {
  if (headset?.verdict === OK && place) Object.assign(headset, { position: place.position, rotation: place.rotation });
}

export function showVerdict({ verdict: found, reason, weak }) {
  by("headset").hidden = false;
  const verdict = by("verdict");
  verdict.className = found === OK ? "ok" : found === 0 ? "" : "bad";
  verdict.textContent = `${VERDICTS[found] ?? found}: ${reason}`;
  const line = ({ axis, kind, sigma }) => element("p", { textContent: `open ${kind === ROTATION ? "about" : "along"} ${axis.map((x) => x.toFixed(2)).join(", ")}: ${spread(kind, sigma)}` });
  by("weak").replaceChildren(...(found === 0 ? [] : weak.slice(0, MOST_WEAK).map(line)));
}

const spread = (kind, sigma) => `± ${kind === ROTATION ? `${((sigma * 180) / Math.PI).toFixed(1)}°` : metres(sigma)}`;

// Lines of a weak direction from the headset: a segment of its sigma, or an arc about it; and its label.
function drawnDirection({ axis, kind, sigma }) {
  const along = scale(axis, 1 / length(axis));
  const aside = across(along);
  const lines = [];
  if (kind === ROTATION) {
    const up = cross(along, aside);
    const half = Math.min(Math.PI, Math.max(0.3, sigma));
    const at = (i) => add(scale(aside, 1.5 * Math.cos((i * half) / 24)), scale(up, 1.5 * Math.sin((i * half) / 24)));
    for (let i = -24; i < 24; i++) lines.push(...at(i), ...at(i + 1));
    lines.push(...scale(along, -1.5), ...scale(along, 1.5));
    return { lines, end: at(24), text: spread(kind, sigma) };
  }
  const reach = Math.min(20, Math.max(1.5, sigma));
  for (const way of [reach, -reach]) {
    const tip = scale(along, way);
    for (const side of [0.2, -0.2]) lines.push(...tip, ...add(scale(tip, 0.85), scale(aside, reach * side * 0.5)));
    lines.push(0, 0, 0, ...tip);
  }
  return { lines, end: scale(along, reach), text: spread(kind, sigma) };
}

// A unit vector perpendicular to another.
function across(axis) {
  const other = Math.abs(dot(axis, [0, 0, 1])) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const v = cross(axis, other);
  return scale(v, 1 / length(v));
}

// Draws the headset in the colour of its verdict, with its weak directions on top.
export function drawHeadset(gl, scene, distance, { position: origin, rotation, verdict, weak }, colourOf) {
  const ink = [...colourOf(verdict === OK ? "--good" : "--bad"), 1];
  // On top, so that it is not hidden by the map.
  gl.disable(gl.DEPTH_TEST);
  const turn = turned(rotation, Math.max(1.2, distance * 0.05));
  scene.draw("view", gl.TRIANGLES, { origin, turn, ink: [...ink.slice(0, 3), 0.4] });
  scene.draw("frustum", gl.LINES, { origin, turn, ink });
  weak.forEach(({ lines }, i) => {
    scene.set(`weak ${i}`, lines);
    scene.draw(`weak ${i}`, gl.LINES, { origin, ink: WEAK_INK });
  });
  gl.enable(gl.DEPTH_TEST);
}
