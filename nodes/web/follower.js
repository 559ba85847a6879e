// Map follower: tiles of sorted cells, and the changes since the last pass.

import { decodeKeys, keyText, placeIndex, tileIndex } from "./keys.js";

export const NO_LABEL = 65535;

// Cells of one tile, sorted by position: parallel growable arrays.
class Tile {
  constructor(id) {
    this.id = id;
    this.size = 0;
    this.places = new Uint16Array(32);
    this.counts = new Uint32Array(32);
    this.labels = new Uint16Array(32);
    this.seen = new Uint16Array(32);
    // Red, green, blue and 255 from the lowest byte on, or 0; null until a cell has a colour.
    this.colours = null;
    // Cells of each label when last packed.
    this.labelled = new Map();
  }

  find(place) {
    let [low, high] = [0, this.size];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.places[middle] < place) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  names() { return ["places", "counts", "labels", "seen", ...(this.colours ? ["colours"] : [])]; }

  columns() { return this.names().map((name) => this[name]); }

  // True if the cell is new.
  set(place, count, label, seen, colour) {
    if (colour && !this.colours) this.colours = new Uint32Array(this.places.length);
    const last = this.size === 0 || this.places[this.size - 1] < place;
    const i = last ? this.size : this.find(place);
    const fresh = last || this.places[i] !== place;
    if (fresh) {
      if (this.size === this.places.length) this.grow();
      for (const column of this.columns()) column.copyWithin(i + 1, i, this.size);
      this.size++;
    }
    this.places[i] = place;
    this.counts[i] = count;
    this.labels[i] = label;
    this.seen[i] = seen;
    if (this.colours) this.colours[i] = colour;
    return fresh;
  }

  // True if the cell existed.
  remove(place) {
    const i = this.find(place);
    if (i >= this.size || this.places[i] !== place) return false;
    for (const column of this.columns()) column.copyWithin(i, i + 1, this.size);
    this.size--;
    return true;
  }

  grow() {
    for (const name of this.names()) {
      const grown = new this[name].constructor(2 * this[name].length);
      grown.set(this[name]);
      this[name] = grown;
    }
  }
}

const sameLattice = (a, b) => a && b && a.epoch === b.epoch && a.lattice === b.lattice
  && a.generator.every((x, i) => x === b.generator[i])
  && a.place.position.every((x, i) => x === b.place.position[i]);

export class Follower {
  constructor() {
    this.info = null;
    this.sequence = null;
    this.tiles = new Map();
    this.size = 0;
    this.dirty = new Set();
    // Cells of each label.
    this.labelled = new Map();
    this.staging = null;
    this.renewed = false;
    // True if any cell had a colour.
    this.coloured = false;
    this.frame = "map";
    this.begin = Date.now();
  }

  // Seconds since the page was loaded, as stored in cells.
  now() { return Math.min(65535, Math.round((Date.now() - this.begin) / 1000)); }

  onMap(map) {
    this.frame = map.header.frame;
    if (!sameLattice(this.info, map.info)) {
      this.info = map.info;
      this.tiles = new Map();
      this.size = 0;
      this.labelled = new Map();
      this.coloured = false;
      this.dirty.clear();
      this.sequence = null;
      this.staging = null;
      this.renewed = true;
    }
    // The geodetic origin may have become known.
    this.info = map.info;
    if (!this.staging || this.staging.sequence !== map.sequence || this.staging.chunks !== map.chunks) {
      this.staging = { sequence: map.sequence, chunks: map.chunks, come: new Set(), kept: new Map() };
    }
    const { come, kept } = this.staging;
    come.add(map.chunk);
    this.put(map);
    // Cells of the keyframe at positions that may have been occupied before.
    if (this.sequence !== null) {
      decodeKeys(map.keys, (tile, place) => {
        if (!kept.has(tile)) kept.set(tile, new Set());
        kept.get(tile).add(place);
      });
    }
    if (come.size === map.chunks) {
      if (this.sequence !== null) this.keepOnly(kept);
      this.sequence = map.sequence;
      this.staging = null;
    }
  }

  // False: a message is missing, and a keyframe is needed.
  onUpdate(update) {
    if (this.sequence === null || !sameLattice(this.info, update.info)) return this.staging !== null;
    this.info = update.info;
    if (update.sequence <= this.sequence) return true;
    if (update.previous > this.sequence) return false;
    this.put(update);
    decodeKeys(update.removedKeys, (id, place) => {
      const tile = this.tiles.get(id);
      if (!tile || !tile.remove(place)) return;
      this.size--;
      this.dirty.add(tile);
    });
    if (update.chunk + 1 < update.chunks) return true;
    this.sequence = update.sequence;
    return this.size === update.total;
  }

  put({ keys, counts, labels, colours }) {
    const seen = this.now();
    this.coloured ||= colours?.some((colour) => colour > 0) ?? false;
    let tile = null;
    decodeKeys(keys, (id, place, i) => {
      if (!tile || tile.id !== id) {
        tile = this.tiles.get(id);
        if (!tile) this.tiles.set(id, (tile = new Tile(id)));
        this.dirty.add(tile);
      }
      const label = labels.length ? labels[i] : NO_LABEL;
      if (tile.set(place, counts.length ? counts[i] : 1, label, seen, colours?.[i] ?? 0)) this.size++;
    });
  }

  keepOnly(kept) {
    for (const tile of this.tiles.values()) {
      const places = kept.get(tile.id);
      for (const place of tile.places.slice(0, tile.size)) {
        if (places?.has(place)) continue;
        tile.remove(place);
        this.size--;
        this.dirty.add(tile);
      }
    }
  }

  // Changed tiles, packed for drawing: four 16-bit numbers per cell (position, label, logarithm of
  // its count, second of its last change), then the colours, if there are some; shuffled so that any
  // prefix is a uniform sample.
  takeDirty(most) {
    const packed = [];
    for (const tile of this.dirty) {
      if (packed.length >= most) break;
      this.dirty.delete(tile);
      this.countLabels(tile);
      packed.push({ id: tile.id, index: tileIndex(tile.id), size: tile.size, cells: pack(tile), heights: this.heights(tile) });
      if (tile.size === 0) this.tiles.delete(tile.id);
    }
    return packed;
  }

  // Recounts the labels of a tile.
  countLabels(tile) {
    const change = (label, by) => {
      const cells = (this.labelled.get(label) ?? 0) + by;
      if (cells > 0) this.labelled.set(label, cells);
      else this.labelled.delete(label);
    };
    const now = new Map();
    for (let i = 0; i < tile.size; i++) {
      const label = tile.labels[i];
      if (label !== NO_LABEL) now.set(label, (now.get(label) ?? 0) + 1);
    }
    for (const [label, cells] of now) change(label, cells);
    for (const [label, cells] of tile.labelled) change(label, -cells);
    tile.labelled = now;
  }

  // Lowest and highest cell centre of a tile along the map's z, relative to the datum, m.
  heights(tile) {
    const [x, y, z] = this.rowOfHeight ?? [0, 0, 1];
    const [a, b, c] = tileIndex(tile.id);
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < tile.size; i++) {
      const [u, v, w] = placeIndex(tile.places[i]);
      const height = x * (a + u) + y * (b + v) + z * (c + w);
      low = Math.min(low, height);
      high = Math.max(high, height);
    }
    return [low, high];
  }

  cell(id, place) {
    const tile = this.tiles.get(id);
    const i = tile ? tile.find(place) : 0;
    if (!tile || i >= tile.size || tile.places[i] !== place) return null;
    return { key: keyText(id, place), count: tile.counts[i], label: tile.labels[i], age: this.now() - tile.seen[i] };
  }

  // Point counts of all cells, in key order.
  counts() { return [...this.tiles.values()].flatMap((tile) => [...tile.counts.subarray(0, tile.size)]); }

  keys() {
    const all = [];
    for (const tile of this.tiles.values()) {
      for (let i = 0; i < tile.size; i++) all.push(keyText(tile.id, tile.places[i]));
    }
    return all;
  }
}

function pack(tile) {
  const n = tile.size;
  const cells = new Uint16Array(tile.colours ? 6 * n : 4 * n);
  const colours = new Uint32Array(cells.buffer, 8 * n);
  let step = Math.max(1, Math.round(n * 0.618));
  while (gcd(step, n) > 1) step++;
  for (let k = 0, i = 0; k < n; k++, i = (i + step) % n) {
    cells[4 * k] = tile.places[i];
    cells[4 * k + 1] = tile.labels[i];
    cells[4 * k + 2] = Math.min(65535, Math.log2(tile.counts[i] + 1) * 2048);
    cells[4 * k + 3] = tile.seen[i];
    if (tile.colours) colours[k] = tile.colours[i];
  }
  return cells;
}

const gcd = (a, b) => (b === 0 ? a : gcd(b, a % b));
