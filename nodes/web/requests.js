// CDR service requests, and decoding of responses.

import { Reader, Writer } from "./cdr.js";

// Little-endian CDR of numbers, each with its type letter.
function cdr(...parts) {
  const bytes = [0, 1, 0, 0];
  for (const [kind, value] of parts) {
    const size = kind === "d" ? 8 : 4;
    while ((bytes.length - 4) % size !== 0) bytes.push(0);
    const view = new DataView(new ArrayBuffer(size));
    if (kind === "d") view.setFloat64(0, value, true);
    else if (kind === "i") view.setInt32(0, value, true);
    else view.setUint32(0, value, true);
    bytes.push(...new Uint8Array(view.buffer));
  }
  return new Uint8Array(bytes);
}

const points = (...all) => cdr(...all.flat().map((x) => ["d", x]));

export const requests = {
  nothing: () => new Uint8Array([0, 1, 0, 0, 0]),
  clearBox: (low, high) => points(low, high),
  saveMap(path) {
    const text = new TextEncoder().encode(path);
    return new Uint8Array([...cdr(["u", text.length + 1]), ...text, 0]);
  },
  query: (point) => points(point),
  plan: (start, goal, radius, tolerance) => points(start, goal, [radius, tolerance]),
  setRate: (rate) => cdr(["d", rate]),
  // Without a guess, for a session of the headset.
  calibrate: (session) => new Writer(100 + 4 * session.length).bool(false).f64s([0, 0, 0, 0, 0, 0, 1]).string(session).done(),
  seek: (time) => cdr(["i", Math.floor(time)], ["u", Math.floor((time % 1) * 1e9)]),
};

// Success, message, and the number after them, if any.
export function outcome(bytes) {
  const r = new Reader(bytes);
  const answer = { success: r.bool(), message: r.string() };
  if (bytes.length - r.at >= 8) answer.number = Number(r.u64());
  return answer;
}

export function queried(bytes) {
  const r = new Reader(bytes);
  const answer = { success: r.bool(), message: r.string(), occupied: r.bool(), points: r.u32(), hasNearest: r.bool() };
  return Object.assign(answer, { clearance: r.f64(), nearest: r.f64s(3), distance: r.f64() });
}

export function planned(bytes) {
  const r = new Reader(bytes);
  const answer = { success: r.bool(), message: r.string(), length: r.f64() };
  return Object.assign(answer, { path: r.list(() => r.f64s(3), 24) });
}

export const said = (bytes) => new Reader(bytes).bool();
export const rated = (bytes) => new Reader(bytes).f64();
