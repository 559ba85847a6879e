// Cell shape of a lattice from its generator: the Voronoi cell as slabs, pairs of parallel faces.

import { add, dot, length, rotate, scale } from "./math.js";

// Basis vectors of the lattice in the axes of the map, m.
export function basisInMap({ generator: g, place }) {
  return [0, 1, 2].map((k) => rotate(place.rotation, [g[k], g[3 + k], g[6 + k]]));
}

// Obtuse superbase: four vectors of sum 0 with non-positive dot products, which span the lattice (Selling 1874).
function obtuseSuperbase(basis) {
  const b = [...basis, scale(add(add(basis[0], basis[1]), basis[2]), -1)];
  const tiny = 1e-9 * Math.max(...basis.map((v) => dot(v, v)));
  for (let round = 0; round < 1000; round++) {
    let done = true;
    for (let i = 0; i < 4; i++) {
      for (let j = i + 1; j < 4; j++) {
        if (dot(b[i], b[j]) <= tiny) continue;
        const turned = b[i];
        for (let k = 0; k < 4; k++) if (k !== i && k !== j) b[k] = add(b[k], turned);
        b[i] = scale(turned, -1);
        done = false;
      }
    }
    if (done) break;
  }
  return b;
}

// Slabs of the cell around the origin: unit normals with half the distance of their faces, m; and the
// radius of a bounding ball.
export function cellShape(basis) {
  const [a, b, c, d] = obtuseSuperbase(basis);
  const candidates = [a, b, c, d, add(a, b), add(a, c), add(b, c)];
  const both = candidates.flatMap((v) => [v, scale(v, -1)]);
  // A face exists if its centre is closer to its two cells than to any other.
  const isFace = (v) => both.every((u) => {
    const same = Math.abs(Math.abs(dot(u, v)) - dot(v, v)) < 1e-9 * dot(v, v) && Math.abs(dot(u, u) - dot(v, v)) < 1e-9 * dot(v, v);
    return same || dot(u, u) - dot(u, v) > 1e-9 * dot(v, v);
  });
  const slabs = candidates.filter(isFace).map((v) => ({ normal: scale(v, 1 / length(v)), half: length(v) / 2 }));
  return { slabs, radius: radius(slabs) };
}

// Farthest vertex of the slabs: three planes intersect in one if it is within all others.
function radius(slabs) {
  let farthest = 0;
  const planes = slabs.flatMap(({ normal, half }) => [{ normal, half }, { normal: scale(normal, -1), half }]);
  const n = planes.length;
  for (let i = 0; i < n; i++) for (let j = i + 1; j < n; j++) for (let k = j + 1; k < n; k++) {
    const corner = meeting(planes[i], planes[j], planes[k]);
    if (corner && planes.every(({ normal, half }) => dot(normal, corner) <= half * (1 + 1e-9))) farthest = Math.max(farthest, length(corner));
  }
  return farthest;
}

function meeting(p, q, r) {
  const [a, b, c] = [p.normal, q.normal, r.normal];
  const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const det = dot(a, cross(b, c));
  if (Math.abs(det) < 1e-9) return null;
  const sum = add(add(scale(cross(b, c), p.half), scale(cross(c, a), q.half)), scale(cross(a, b), r.half));
  return scale(sum, 1 / det);
}
