// Message types of the page, decoded from CDR.

import { Reader } from "./cdr.js";

const time = (r) => r.i32() + r.u32() * 1e-9;
const header = (r) => ({ stamp: time(r), frame: r.string() });
const vector = (r) => r.f64s(3);
const pose = (r) => ({ position: vector(r), rotation: r.f64s(4) });

function latticeInfo(r) {
  const info = { lattice: r.string(), volume: r.f64(), generator: r.f64s(9), place: pose(r) };
  info.origin = r.f64s(3);
  info.hasOrigin = r.bool();
  info.epoch = r.u64();
  return info;
}

const ENCODING = "morton21_delta_leb128";
// The counts follow the keys, as LEB128 too.
const THIN_ENCODING = `${ENCODING}_counts_leb128`;
// As are the numbers of coloured points; then the colours of the cells that have some.
const COLOUR_ENCODING = `${ENCODING}_colors`;

function columns(r, encoding) {
  if (![ENCODING, THIN_ENCODING, COLOUR_ENCODING].includes(encoding)) throw new RangeError(`keys are in ${encoding}`);
  const all = {
    count: r.u32(),
    keys: r.octets(),
    counts: r.numbers(Uint32Array),
    offsetUnit: r.f64(),
    offsets: r.numbers(Int16Array),
    labels: r.numbers(Uint16Array),
    labelCounts: r.numbers(Uint32Array),
  };
  if (encoding === THIN_ENCODING) return parted(all);
  return encoding === COLOUR_ENCODING ? coloured(all) : all;
}

function coloured(all) {
  const ends = [0, 0];
  for (let part = 0, at = 0; part < 2; part++) {
    for (let left = all.count; left > 0; at++) {
      if (at >= all.keys.length) throw new RangeError("the colours end too early");
      if (all.keys[at] < 128) left--;
    }
    ends[part] = at;
  }
  const counts = all.keys.subarray(ends[0], ends[1]);
  const colours = new Uint32Array(all.count);
  // A cell without coloured points has the number 0: one byte.
  for (let i = 0, at = 0, k = ends[1]; i < all.count; i++) {
    const none = counts[at] === 0;
    while (counts[at++] > 127);
    if (none) continue;
    if (k + 3 > all.keys.length) throw new RangeError("the colours end too early");
    colours[i] = (all.keys[k] | all.keys[k + 1] << 8 | all.keys[k + 2] << 16 | 255 << 24) >>> 0;
    k += 3;
  }
  return { ...all, keys: all.keys.subarray(0, ends[0]), colours };
}

function parted(all) {
  const { keys: bytes, count } = all;
  let at = 0;
  for (let left = count; left > 0; at++) {
    if (at >= bytes.length) throw new RangeError("the keys end too early");
    if (bytes[at] < 128) left--;
  }
  const counts = [];
  for (let i = at, value = 0, scale = 1; i < bytes.length; i++) {
    value += (bytes[i] & 127) * scale;
    scale *= 128;
    if (bytes[i] < 128) {
      counts.push(value);
      [value, scale] = [0, 1];
    }
  }
  if (counts.length !== 0 && counts.length !== count) throw new RangeError("there is not one count for each key");
  return { ...all, keys: bytes.subarray(0, at), counts };
}

export function latticeMap(bytes) {
  const r = new Reader(bytes);
  const map = { header: header(r), info: latticeInfo(r), sequence: r.u64() };
  map.chunk = r.u32();
  map.chunks = r.u32();
  map.total = Number(r.u64());
  map.encoding = r.string();
  return Object.assign(map, columns(r, map.encoding));
}

export function latticeMapUpdate(bytes) {
  const r = new Reader(bytes);
  const update = { header: header(r), info: latticeInfo(r), previous: r.u64(), sequence: r.u64() };
  update.chunk = r.u32();
  update.chunks = r.u32();
  update.encoding = r.string();
  Object.assign(update, columns(r, update.encoding));
  update.removed = r.u32();
  update.removedKeys = r.octets();
  update.total = Number(r.u64());
  return update;
}

export function transforms(bytes) {
  return new Reader(bytes).list((r) => {
    const { stamp, frame } = header(r);
    return { stamp, parent: frame, child: r.string(), position: vector(r), rotation: r.f64s(4) };
  }, 64);
}

export function diagnostics(bytes) {
  const r = new Reader(bytes);
  const { stamp } = header(r);
  const status = r.list((r) => ({
    level: r.u8(),
    name: r.string(),
    message: r.string(),
    hardware: r.string(),
    values: r.list((r) => [r.string(), r.string()], 8),
  }), 16);
  return { stamp, status };
}

export function calibration(bytes) {
  const r = new Reader(bytes);
  const result = { header: header(r), frame: r.string(), session: r.string(), verdict: r.u8(), reason: r.string() };
  Object.assign(result, { position: vector(r), rotation: r.f64s(4), covariance: r.f64s(36), margin: r.f64(), inliers: r.f64(), rmse: r.f64() });
  result.weak = r.list((r) => ({ axis: vector(r), kind: r.u8(), sigma: r.f64() }), 33);
  return result;
}

// Poses of a drive as positions in a frame.
export function drive(bytes) {
  const r = new Reader(bytes);
  const { frame } = header(r);
  const points = r.list((r) => {
    header(r);
    return pose(r).position;
  }, 68);
  return { frame, points };
}

// Ends of the lines of the first marker, in its frame.
export function loops(bytes) {
  const r = new Reader(bytes);
  if (r.u32() === 0) return { frame: "", points: [] };
  const { frame } = header(r);
  r.string();
  const [, type] = [r.i32(), r.i32()];
  const action = r.i32();
  pose(r);
  vector(r);
  for (let left = 6; left > 0; left--) r.u32();
  r.bool();
  const points = r.list(vector, 24);
  return { frame, points: type === LINE_LIST && action === ADD ? points : [] };
}

const LINE_LIST = 5;
const ADD = 0;

// Names of labels.
export function names(bytes) {
  const r = new Reader(bytes);
  header(r);
  return new Map(r.list((r) => [r.u16(), r.string()], 7));
}

const FLOAT32 = 7;
const FLOAT64 = 8;

// Points of a cloud as offsets from the first one, in single precision.
export function cloud(bytes) {
  const r = new Reader(bytes);
  const { stamp, frame } = header(r);
  const [height, width] = [r.u32(), r.u32()];
  const fields = r.list((r) => ({ name: r.string(), offset: r.u32(), type: r.u8(), count: r.u32() }), 16);
  const bigEndian = r.bool();
  const [step, row] = [r.u32(), r.u32()];
  const data = r.octets();
  const of = (name) => fields.find((field) => field.name === name && (field.type === FLOAT32 || field.type === FLOAT64));
  const axes = ["x", "y", "z"].map(of);
  if (axes.some((axis) => !axis) || step === 0) return { stamp, frame, origin: [0, 0, 0], points: new Float32Array(0) };
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const value = (axis, at) => axis.type === FLOAT32
    ? view.getFloat32(at + axis.offset, !bigEndian) : view.getFloat64(at + axis.offset, !bigEndian);
  const most = Math.min(height * width, Math.floor(data.byteLength / step));
  const points = new Float32Array(3 * most);
  let origin = null;
  let n = 0;
  for (let i = 0; i < most; i++) {
    const at = Math.floor(i / width) * row + (i % width) * step;
    if (at + step > data.byteLength) break;
    const p = axes.map((axis) => value(axis, at));
    if (!p.every(Number.isFinite)) continue;
    origin ??= p;
    for (let k = 0; k < 3; k++) points[n++] = p[k] - origin[k];
  }
  return { stamp, frame, origin: origin ?? [0, 0, 0], points: points.subarray(0, n) };
}
