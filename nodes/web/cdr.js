// CDR reader: the body of a ROS message, after its encapsulation header of four bytes.

const HEADER = 4;
const text = new TextDecoder();

export class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    if (bytes.byteLength < HEADER || this.view.getUint8(0) !== 0 || this.view.getUint8(1) > 1) {
      throw new RangeError("no plain CDR");
    }
    this.little = this.view.getUint8(1) === 1;
    this.at = HEADER;
  }

  // Offset of the next value of `size` bytes, aligned to its size.
  take(size, align = size) {
    const at = Math.ceil((this.at - HEADER) / align) * align + HEADER;
    this.at = at + size;
    return at;
  }

  u8() { return this.view.getUint8(this.take(1)); }
  bool() { return this.u8() !== 0; }
  u16() { return this.view.getUint16(this.take(2), this.little); }
  i32() { return this.view.getInt32(this.take(4), this.little); }
  u32() { return this.view.getUint32(this.take(4), this.little); }
  u64() { return this.view.getBigUint64(this.take(8), this.little); }
  f64() { return this.view.getFloat64(this.take(8), this.little); }

  string() {
    const length = this.u32();
    const at = this.take(length, 1);
    // Without the terminating zero.
    return text.decode(this.slice(at, Math.max(0, length - 1)));
  }

  slice(at, length) {
    if (at + length > this.bytes.byteLength) throw new RangeError("the message ends too early");
    return this.bytes.subarray(at, at + length);
  }

  octets() {
    const length = this.u32();
    return this.slice(this.take(length, 1), length);
  }

  f64s(count) { return Array.from({ length: count }, () => this.f64()); }

  // A sequence of 2-byte or 4-byte numbers as a typed array.
  numbers(type) {
    const count = this.u32();
    const size = type.BYTES_PER_ELEMENT;
    if (count === 0) return new type(0);
    const bytes = this.slice(this.take(count * size, size), count * size);
    if (this.little) return new type(bytes.slice().buffer);
    const swapped = bytes.slice().reverse();
    return new type(swapped.buffer).reverse();
  }

  // A sequence; `least` is the smallest size of an element in bytes.
  list(read, least) {
    const count = this.u32();
    if (count * least > this.bytes.byteLength - this.at) throw new RangeError("a list ends too early");
    return Array.from({ length: count }, () => read(this));
  }
}

const SIZES = { u16: 2, u32: 4, i32: 4, f32: 4, f64: 8 };
const SETTERS = { u16: "setUint16", u32: "setUint32", i32: "setInt32", f32: "setFloat32", f64: "setFloat64" };
const utf8 = new TextEncoder();

// CDR writer: little-endian, with a capacity in bytes.
export class Writer {
  constructor(capacity) {
    this.bytes = new Uint8Array(capacity);
    this.view = new DataView(this.bytes.buffer);
    this.bytes[1] = 1;
    this.at = HEADER;
  }

  number(kind, value) {
    const size = SIZES[kind];
    this.at = Math.ceil((this.at - HEADER) / size) * size + HEADER;
    this.view[SETTERS[kind]](this.at, value, true);
    this.at += size;
    return this;
  }

  bool(value) {
    this.bytes[this.at++] = value ? 1 : 0;
    return this;
  }

  u16(value) { return this.number("u16", value); }
  u32(value) { return this.number("u32", value); }
  i32(value) { return this.number("i32", value); }

  f64s(values) {
    for (const value of values) this.number("f64", value);
    return this;
  }

  string(words) {
    const bytes = utf8.encode(words);
    this.u32(bytes.length + 1);
    this.bytes.set(bytes, this.at);
    this.at += bytes.length + 1;
    return this;
  }

  // A sequence of numbers.
  numbers(kind, values) {
    this.u32(values.length);
    for (const value of values) this.number(kind, value);
    return this;
  }

  done() { return this.bytes.subarray(0, this.at); }
}
