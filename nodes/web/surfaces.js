// Surfaces of a headset from WebXR meshes or planes: labels, and chunks of lattice_msgs/HeadsetMesh.

import { Writer } from "./cdr.js";
import { length, multiplyQuaternions, rotate, sub } from "./math.js";

// Semantic labels of WebXR; the class of a label is its index.
export const LABELS = [
  "wall", "floor", "ceiling", "table", "couch", "door", "window", "shelf", "bed", "screen", "lamp", "plant", "wall art", "other",
];
const NO_CLASS = 65535;
// Triangles of a box: some devices give boxes about furniture as meshes.
const BOX = 12;
// Numbers of each array in a chunk, which has 50 kB then.
const CHUNK = 5000;
// Limits of a session: surfaces, triangles of all of them, and vertices of one.
const MOST_SURFACES = 256;
const MOST_TRIANGLES = 300000;
const MOST_VERTICES = 300000;
// Bytes sent per second, and the smallest time between two states of a surface, ms.
const BYTES_A_SECOND = 400000;
const AGAIN_MS = 4000;
// Change of a surface's pose that is sent, m and rad.
const MOVED = { position: 0.02, angle: 0.01 };
// Distance from a labelled plane or box within which a triangle has its label, m.
const NEAR = 0.1;

// Axes of ROS (forward, left, up) from those of WebXR (right, up, backward).
export const ROS_FROM_WEBXR = { position: [0, 0, 0], rotation: [0.5, -0.5, -0.5, 0.5] };
const toRos = ([x, y, z]) => [-z, -x, y];

export function classOf(label) {
  const words = (label ?? "").toLowerCase().replaceAll("_", " ").replace(/ (face|frame)$/, "").replace("storage", "shelf");
  const found = LABELS.indexOf(words);
  return found < 0 ? NO_CLASS : found;
}

const xyz = ({ x, y, z }) => [x, y, z];
const conjugate = ({ x, y, z, w }) => [-x, -y, -z, w];

// Box of a plane or mesh in its own axes, grown by NEAR, with its pose and class.
function regionOf({ vertices, pose, label }) {
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (let i = 0; i < vertices.length; i++) {
    low[i % 3] = Math.min(low[i % 3], vertices[i] - NEAR);
    high[i % 3] = Math.max(high[i % 3], vertices[i] + NEAR);
  }
  const { position, orientation } = pose.transform;
  return { low, high, position: xyz(position), inverse: conjugate(orientation), label: classOf(label) };
}

function classAt(point, regions) {
  for (const { low, high, position, inverse, label } of regions) {
    const own = rotate(inverse, sub(point, position));
    if (own.every((x, k) => x >= low[k] && x <= high[k])) return label;
  }
  return NO_CLASS;
}

// Triangles of a plane: a fan about the centre of its polygon.
function ofPlane({ polygon }) {
  const corners = [...polygon].map(xyz);
  const n = corners.length;
  const centre = [0, 1, 2].map((k) => corners.reduce((sum, corner) => sum + corner[k], 0) / Math.max(1, n));
  const indices = corners.flatMap((_, i) => [i, (i + 1) % n, n]);
  return { vertices: new Float32Array([...corners, centre].flat()), indices: new Uint32Array(indices) };
}

// Vertices in the axes of ROS, m, in the reference space.
function placed(vertices, { transform: { position, orientation } }) {
  const [at, turn] = [xyz(position), [orientation.x, orientation.y, orientation.z, orientation.w]];
  const out = new Float32Array(vertices.length);
  for (let i = 0; i + 2 < vertices.length; i += 3) {
    const [x, y, z] = rotate(turn, vertices.subarray(i, i + 3));
    out.set(toRos([x + at[0], y + at[1], z + at[2]]), i);
  }
  return out;
}

// Classes of triangles: that of the surface, else of the labelled region about each.
function classesOf({ vertices, indices, pose, label }, regions) {
  const triangles = Math.floor(indices.length / 3);
  const own = classOf(label);
  if (own !== NO_CLASS) return new Uint16Array(triangles).fill(own);
  const { position, orientation: o } = pose.transform;
  const corner = (i) => vertices.subarray(3 * i, 3 * i + 3);
  return Uint16Array.from({ length: triangles }, (_, t) => {
    const [a, b, c] = [0, 1, 2].map((k) => corner(indices[3 * t + k]));
    const centre = rotate([o.x, o.y, o.z, o.w], [0, 1, 2].map((k) => (a[k] + b[k] + c[k]) / 3));
    return classAt(centre.map((x, k) => x + xyz(position)[k]), regions);
  });
}

// Surfaces that the device shows in a frame, by their object: meshes; without them planes, else boxes. Boxes and planes give
// their labels to meshes without one.
function surfacesOf(frame, reference) {
  const found = (all) => [...all ?? []].map((object) => ({ object, pose: frame.getPose(object.meshSpace ?? object.planeSpace, reference) })).filter(({ pose }) => pose);
  const meshes = found(frame.detectedMeshes).map(({ object, pose }) => ({
    object, pose, vertices: object.vertices, indices: object.indices, label: object.semanticLabel, changed: object.lastChangedTime,
  }));
  const planes = found(frame.detectedPlanes).map(({ object, pose }) => ({ object, pose, ...ofPlane(object), label: object.semanticLabel, changed: object.lastChangedTime }));
  const isBox = ({ indices }) => indices.length <= 3 * BOX;
  const boxes = meshes.filter(isBox);
  const surfaces = [meshes.filter((mesh) => !isBox(mesh)), planes, boxes].find((all) => all.length > 0) ?? [];
  return { surfaces, regions: () => [...boxes, ...planes].map(regionOf) };
}

function isMoved(a, b) {
  const [p, q] = [a.transform, b.transform];
  const turn = multiplyQuaternions(conjugate(p.orientation), [q.orientation.x, q.orientation.y, q.orientation.z, q.orientation.w]);
  return length(sub(xyz(p.position), xyz(q.position))) > MOVED.position || 2 * length(turn) > MOVED.angle;
}

function checksum(numbers) {
  const bits = new Uint32Array(numbers.buffer, numbers.byteOffset, numbers.length);
  let sum = 2166136261;
  for (let i = 0; i < bits.length; i++) sum = Math.imul(sum ^ bits[i], 16777619);
  return sum;
}

// Queue of surfaces for the robot, with its limits.
export class SurfaceSender {
  // `publish` sends the bytes of a message; `frame` is the frame of the headset's origin.
  constructor({ publish, frame }) {
    Object.assign(this, { publish, frame, sentBytes: 0 });
    this.begin();
  }

  // Begins a session: its origin is another, and every surface is sent again.
  begin() {
    this.session = `page ${Date.now()} ${Math.random().toString(36).slice(2, 8)}`;
    this.known = new Map();
    this.queue = [];
    this.next = 1;
    this.budget = BYTES_A_SECOND / 2;
    this.refilledAt = performance.now();
    this.counts = { surfaces: 0, triangles: 0, left: 0 };
    this.doneAt = null;
  }

  // Queues surfaces of a frame that are new, changed or gone.
  look(frame, reference, now) {
    const { surfaces, regions } = surfacesOf(frame, reference);
    const seen = new Set(surfaces.map(({ object }) => object));
    for (const [object, { name }] of this.known) {
      if (seen.has(object)) continue;
      this.known.delete(object);
      this.queue = this.queue.filter((waiting) => waiting.name !== name);
      this.queue.push({ name, removed: true, chunk: 0, chunks: 1 });
    }
    let labels = null;
    Object.assign(this.counts, { surfaces: 0, triangles: 0, left: 0 });
    for (const surface of surfaces) {
      const triangles = surface.indices.length / 3;
      const isLarge = surface.vertices.length > 3 * MOST_VERTICES || this.counts.triangles + triangles > MOST_TRIANGLES;
      if (isLarge || this.counts.surfaces >= MOST_SURFACES) {
        this.counts.left++;
        continue;
      }
      this.counts.surfaces++;
      this.counts.triangles += triangles;
      const known = this.known.get(surface.object);
      if (known && (known.changed === surface.changed && !isMoved(known.pose, surface.pose) || now - known.at < AGAIN_MS)) continue;
      const sum = checksum(surface.vertices);
      if (known && known.sum === sum && !isMoved(known.pose, surface.pose)) {
        known.changed = surface.changed;
        continue;
      }
      const name = known?.name ?? `surface ${this.next++}`;
      this.known.set(surface.object, { name, sum, changed: surface.changed, pose: surface.pose, at: now });
      labels ??= regions();
      this.queue = this.queue.filter((waiting) => waiting.name !== name);
      this.queue.push(this.parts(name, surface, labels));
    }
  }

  parts(name, surface, regions) {
    const arrays = [placed(surface.vertices, surface.pose), Uint32Array.from(surface.indices), classesOf(surface, regions)];
    return { name, removed: false, arrays, stamp: Date.now(), chunk: 0, chunks: Math.max(1, ...arrays.map((of) => Math.ceil(of.length / CHUNK))) };
  }

  // Sends as many chunks as the rate allows.
  pump(now) {
    this.budget = Math.min(BYTES_A_SECOND, this.budget + ((now - this.refilledAt) / 1000) * BYTES_A_SECOND);
    this.refilledAt = now;
    while (this.queue.length > 0 && this.budget > 0) {
      const [part] = this.queue;
      const bytes = this.message(part);
      this.publish(bytes);
      this.budget -= bytes.length;
      this.sentBytes += bytes.length;
      if (++part.chunk === part.chunks) this.queue.shift();
      if (this.queue.length === 0) this.doneAt = now;
    }
  }

  message({ name, removed, arrays, stamp, chunk, chunks }) {
    const parts = (arrays ?? [[], [], []]).map((all) => all.slice(chunk * CHUNK, (chunk + 1) * CHUNK));
    const w = new Writer(600 + 4 * (this.session.length + this.frame.length + name.length) + 4 * parts.reduce((sum, part) => sum + part.length, 0));
    const time = stamp ?? Date.now();
    w.i32(Math.floor(time / 1000)).u32((time % 1000) * 1e6).string(this.frame);
    w.string(this.session).string(name).bool(removed).u32(chunk).u32(chunks);
    w.f64s([0, 0, 0, 0, 0, 0, 1]);
    w.numbers("f32", parts[0]).numbers("u32", parts[1]).numbers("u16", parts[2]);
    return w.done();
  }
}

// A vision_msgs/LabelInfo message with the names of the classes.
export function labelNames(frame) {
  const w = new Writer(1000);
  w.i32(0).u32(0).string(frame).u32(LABELS.length);
  LABELS.forEach((label, i) => w.u16(i).string(label));
  return w.number("f32", 0).done();
}
