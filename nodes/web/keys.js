// Cell keys: Morton codes of 63 bits, too large for a number. A key is split into a tile of 32 x 32 x 32
// indices (48 bits, exact in a number) and a position in it (15 bits).

const LOW = 28;
const TWO_28 = 2 ** LOW;
export const TILE = 32;
const PLACES = TILE ** 3;
const HALF = 2 ** 20;

// Calls `each(tile, place, i)` for every key of the encoding morton21_delta_leb128, in order.
export function decodeKeys(bytes, each) {
  let [low, high] = [0, 0];
  let at = 0;
  let i = 0;
  while (at < bytes.length) {
    // Low 28 bits of the difference, and the rest.
    let [less, more, scale, shift] = [0, 0, 1, 0];
    for (;;) {
      if (at >= bytes.length || shift > 63) throw new RangeError("keys end within one");
      const byte = bytes[at++];
      if (shift < LOW) less |= (byte & 127) << shift;
      else {
        more += (byte & 127) * scale;
        scale *= 128;
      }
      shift += 7;
      if (byte < 128) break;
    }
    low += less;
    high += more;
    if (low >= TWO_28) {
      low -= TWO_28;
      high += 1;
    }
    each(high * 8192 + (low >>> 15), low & (PLACES - 1), i++);
  }
  return i;
}

// Lattice index of the first position of a tile.
export function tileIndex(tile) {
  const w = [0, 0, 0];
  let bit = 1;
  for (let level = 0; level < 16; level++) {
    const three = tile % 8;
    tile = Math.floor(tile / 8);
    for (let k = 0; k < 3; k++) if (three & (1 << k)) w[k] += bit;
    bit *= 2;
  }
  return w.map((x) => x * TILE - HALF);
}

const spread = new Uint8Array(PLACES * 3);
for (let place = 0; place < PLACES; place++) {
  for (let bit = 0; bit < 15; bit++) {
    if (place & (1 << bit)) spread[3 * place + (bit % 3)] |= 1 << Math.floor(bit / 3);
  }
}

// Lattice index of a position within its tile.
export const placeIndex = (place) => [spread[3 * place], spread[3 * place + 1], spread[3 * place + 2]];

// Key as text, as in tests and other tools.
export const keyText = (tile, place) => (BigInt(tile) * BigInt(PLACES) + BigInt(place)).toString();
