// Cell renderer: a buffer per tile; large cells are ray-cast, small ones are points.

import * as shaders from "./shaders.js";
import { cellShape, basisInMap } from "./cell.js";
import { TILE } from "./keys.js";
import { add, dot, length, scale, sub } from "./math.js";
import { paletteBytes } from "./colours.js";

const BYTES_A_CELL = 8;
// Cell size in pixels below which cells are points.
const SMALL = 1.6;
// Ray-casting time budget per frame, at rest and while the view moves, ms; above it cells are points.
const PATIENCE = { still: 1500, moving: 60 };

export function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
    gl.deleteShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    at[name.replace("[0]", "")] = gl.getUniformLocation(made, name);
  }
  return { made, at };
}

export class CellRenderer {
  constructor(gl) {
    this.gl = gl;
    this.cells = program(gl, shaders.CELL_VERTEX, shaders.CELL_FRAGMENT);
    this.picks = program(gl, shaders.CELL_VERTEX, shaders.PICK_FRAGMENT);
    this.flat = program(gl, shaders.FLAT_VERTEX, shaders.FLAT_FRAGMENT);
    this.most = gl.getParameter(gl.ALIASED_POINT_SIZE_RANGE)[1];
    this.palette = gl.createTexture();
    this.tiles = new Map();
    this.lattice = null;
    this.chosen = null;
    this.colour = { mode: 0, range: [0, 1] };
    this.slice = [-1e9, 1e9];
    this.now = 0;
    this.stale = 0;
    this.drawn = 0;
    // Measured time per million cell pixels, ms, and pixels of the last frame.
    this.pace = 1;
    this.pixels = 0;
    this.target = null;
  }

  // Starts another lattice: its tiles are dropped.
  setLattice(info) {
    this.clear();
    const basis = basisInMap(info);
    this.lattice = { basis, datum: info.place.position, ...cellShape(basis) };
  }

  clear() {
    for (const tile of this.tiles.values()) this.drop(tile);
    this.tiles.clear();
    this.chosen = null;
  }

  drop({ buffer, array }) {
    this.gl.deleteBuffer(buffer);
    this.gl.deleteVertexArray(array);
  }

  // Stores a tile packed by the worker.
  setTile({ id, index, size, cells, heights }) {
    const { gl } = this;
    let tile = this.tiles.get(id);
    if (size === 0) {
      if (tile) this.drop(tile);
      this.tiles.delete(id);
      return;
    }
    if (!tile) {
      tile = { id, number: id, buffer: gl.createBuffer(), array: gl.createVertexArray(), room: 0 };
      tile.first = add(this.lattice.datum, this.fromDatum(index));
      const half = scale(this.fromDatum([TILE - 1, TILE - 1, TILE - 1]), 0.5);
      tile.middle = add(tile.first, half);
      tile.index = index;
      gl.bindVertexArray(tile.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, tile.buffer);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribIPointer(0, 4, gl.UNSIGNED_SHORT, BYTES_A_CELL, 0);
      gl.bindVertexArray(null);
      this.tiles.set(id, tile);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, tile.buffer);
    if (cells.byteLength > tile.room) {
      tile.room = Math.ceil(cells.byteLength * (tile.room ? 1.25 : 1));
      gl.bufferData(gl.ARRAY_BUFFER, tile.room, gl.DYNAMIC_DRAW);
    }
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, cells);
    gl.bindVertexArray(tile.array);
    // Colours follow the cells; without them each cell has the constant 0.
    if (cells.byteLength > BYTES_A_CELL * size) {
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 0, BYTES_A_CELL * size);
    } else gl.disableVertexAttribArray(1);
    gl.bindVertexArray(null);
    tile.size = size;
    tile.heights = heights.map((height) => height + this.lattice.datum[2]);
  }

  fromDatum([a, b, c]) {
    const [u, v, w] = this.lattice.basis;
    return add(add(scale(u, a), scale(v, b)), scale(w, c));
  }

  // Centre of a cell in the map, m.
  centre(tile, [a, b, c]) {
    return add(this.tiles.get(tile).first, this.fromDatum([a, b, c]));
  }

  // Bounding radius of a tile, m.
  reach() {
    const corners = [[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]];
    return Math.max(...corners.map((c) => length(this.fromDatum(scale(c, TILE / 2))))) + this.lattice.radius;
  }

  setPalette(name) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.palette);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, paletteBytes(name));
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  }

  use({ made, at }, view) {
    const { gl, lattice } = this;
    gl.useProgram(made);
    gl.vertexAttrib4f(1, 0, 0, 0, 0);
    const cell = lattice.basis.flat();
    gl.uniformMatrix3fv(at.u_basis, false, cell);
    gl.uniformMatrix4fv(at.u_clip, false, view.clip);
    gl.uniformMatrix3fv(at.u_rays, false, view.rays);
    const slabs = new Float32Array(28);
    lattice.slabs.forEach(({ normal, half }, i) => slabs.set([...normal, half], 4 * i));
    gl.uniform4fv(at.u_slabs, slabs);
    gl.uniform1i(at.u_slab_count, lattice.slabs.length);
    gl.uniform1f(at.u_radius, lattice.radius);
    gl.uniform1f(at.u_focal, view.focal);
    gl.uniform1f(at.u_pixel, 1 / view.focal);
    gl.uniform1f(at.u_near, view.near);
    gl.uniform2f(at.u_screen, view.width, view.height);
    gl.uniform4f(at.u_window, ...view.window);
    gl.uniform1f(at.u_most, this.most);
    gl.uniform1i(at.u_colour, this.colour.mode);
    gl.uniform2f(at.u_range, ...this.colour.range);
    gl.uniform1f(at.u_now, this.now);
    gl.uniform1f(at.u_grey, this.stale);
    const chosen = this.chosen ? [this.chosen.number, this.chosen.place, 0] : [-1, -1, -1];
    gl.uniform3f(at.u_chosen, ...chosen);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.palette);
    gl.uniform1i(at.u_palette, 0);
  }

  place({ at }, tile, view, number) {
    const { gl } = this;
    gl.uniform3f(at.u_tile, ...sub(tile.first, view.eye));
    gl.uniform3f(at.u_row, tile.first[2], ...this.slice);
    gl.uniform1f(at.u_tile_number, number);
    gl.bindVertexArray(tile.array);
  }

  // Visible tiles, the nearest first, with their cell size in pixels.
  visible(view) {
    const reach = this.reach();
    const { right, up, back } = view.axes;
    const [halfX, halfY] = [((1 + view.aside) * view.width) / 2 / view.focal, ((1 + view.above) * view.height) / 2 / view.focal];
    const found = [];
    let number = 0;
    for (const tile of this.tiles.values()) {
      tile.number = number++;
      const p = sub(tile.middle, view.eye);
      const depth = -dot(p, back);
      if (depth < -reach) continue;
      const deep = Math.max(depth, 0);
      if (Math.abs(dot(p, right)) > deep * halfX + reach * (1 + halfX)) continue;
      if (Math.abs(dot(p, up)) > deep * halfY + reach * (1 + halfY)) continue;
      const pixels = (2 * this.lattice.radius * view.focal) / Math.max(depth, 0.1);
      found.push({ tile, depth, pixels });
    }
    return found.sort((a, b) => a.depth - b.depth);
  }

  draw(view, moving) {
    if (!this.lattice) return;
    const { gl } = this;
    const seen = this.visible(view);
    if (this.chosen) this.chosen.number = this.tiles.get(this.chosen.tile)?.number ?? -1;
    this.drawn = 0;
    this.pixels = 0;
    const near = seen.filter(({ pixels }) => pixels >= SMALL);
    for (const { tile, pixels } of near) this.pixels += tile.size * Math.min(pixels * 1.25, 400) ** 2 * 1e-6;
    const simple = this.pixels * this.pace > (moving ? PATIENCE.moving : PATIENCE.still);
    if (simple) {
      this.pixels = 0;
      // Retried later.
      this.pace *= 0.98;
    }
    if (near.length > 0 && !simple) {
      this.use(this.cells, view);
      for (const { tile } of near) {
        this.place(this.cells, tile, view, tile.number);
        gl.drawArrays(gl.POINTS, 0, tile.size);
        this.drawn += tile.size;
      }
    }
    const far = simple ? seen : seen.filter(({ pixels }) => pixels < SMALL);
    if (far.length > 0) {
      this.use(this.flat, view);
      for (const { tile, pixels } of far) {
        // Cells much smaller than a pixel are subsampled.
        const share = Math.min(1, Math.max(0.02, pixels * pixels));
        const cells = Math.ceil(tile.size * share);
        gl.uniform1f(this.flat.at.u_enlarge, 1 / Math.sqrt(Math.max(share, 0.25)));
        this.place(this.flat, tile, view, tile.number);
        gl.drawArrays(gl.POINTS, 0, cells);
        this.drawn += cells;
      }
    }
    gl.bindVertexArray(null);
  }

  // Records the time of a frame.
  timed(ms) {
    if (this.pixels > 0.5) this.pace += 0.5 * (ms / this.pixels - this.pace);
  }

  // Cell at a screen position, in pixels from the lower left corner.
  pick(view, x, y) {
    if (!this.lattice) return null;
    const { gl } = this;
    this.target ??= pickTarget(gl);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(-x, -y, view.width, view.height);
    gl.disable(gl.BLEND);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    const seen = this.visible(view);
    this.use(this.picks, { ...view, window: [-x, -y, view.width, view.height] });
    for (const { tile } of seen) {
      this.place(this.picks, tile, view, tile.number);
      gl.drawArrays(gl.POINTS, 0, tile.size);
    }
    gl.bindVertexArray(null);
    const out = new Uint32Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, out);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, view.width, view.height);
    if (out[0] === 0) return null;
    const { tile } = seen.find(({ tile }) => tile.number === out[0] - 1);
    return { tile: tile.id, place: out[1] };
  }

  // Lowest and highest cell centre, m; null without cells.
  heights() {
    let [low, high] = [Infinity, -Infinity];
    for (const { heights } of this.tiles.values()) [low, high] = [Math.min(low, heights[0]), Math.max(high, heights[1])];
    return low <= high ? [low, high] : null;
  }

  // Lowest and highest corner of the map, without the outermost few cells.
  bounds() {
    const tiles = [...this.tiles.values()];
    if (tiles.length === 0) return null;
    const share = (pick, from) => {
      const sorted = tiles.map((tile) => [pick(tile), tile.size]).sort((a, b) => a[0] - b[0]);
      let left = from * tiles.reduce((sum, tile) => sum + tile.size, 0);
      for (const [value, size] of sorted) {
        left -= size;
        if (left <= 0) return value;
      }
      return sorted[sorted.length - 1][0];
    };
    const reach = this.reach() / 2;
    const ends = [0, 1].map((axis) => [share((t) => t.middle[axis], 0.04) - reach, share((t) => t.middle[axis], 0.96) + reach]);
    ends.push([share((t) => t.heights[0], 0.1), share((t) => t.heights[1], 0.97)]);
    return { low: ends.map((end) => end[0]), high: ends.map((end) => end[1]) };
  }
}

function pickTarget(gl) {
  const buffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
  for (const [format, point] of [[gl.RGBA32UI, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
    const store = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, store);
    gl.renderbufferStorage(gl.RENDERBUFFER, format, 1, 1);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, store);
  }
  return buffer;
}

