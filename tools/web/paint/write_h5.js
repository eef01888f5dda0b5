// Writes the subset of HDF5 that a paint file needs: groups with links and attributes, and arrays of integers in one chunk with a checksum.
// format-spec/paint.md, section 7. Blocks are consecutive; a block is written before the blocks that refer to it.
import { fletcher32, lookup3 } from './read_h5.js';

const NONE = 2n ** 64n - 1n;
const utf8 = new TextEncoder();

// An array of bytes that grows.
class Bytes {
  constructor() {
    this.array = new Uint8Array(1 << 12);
    this.length = 0;
  }

  room(count) {
    if (this.length + count > this.array.length) {
      const more = new Uint8Array(2 * (this.length + count));
      more.set(this.array.subarray(0, this.length));
      this.array = more;
    }
    this.length += count;
    return new DataView(this.array.buffer, this.length - count, count);
  }

  u8(...values) { values.forEach((v) => this.room(1).setUint8(0, v)); return this; }
  u16(...values) { values.forEach((v) => this.room(2).setUint16(0, v, true)); return this; }
  u32(...values) { values.forEach((v) => this.room(4).setUint32(0, v, true)); return this; }
  u64(...values) { values.forEach((v) => this.room(8).setBigUint64(0, BigInt(v), true)); return this; }
  bytes(other) { this.room(other.length); this.array.set(other, this.length - other.length); return this; }
  get all() { return this.array.subarray(0, this.length); }
}

const block = () => new Bytes();

// --- types and spaces ---

const integer = (size, signed = false) => block().u8(0x10, signed ? 8 : 0).u16(0).u32(size).u16(0, 8 * size).all;
const double = () => block().u8(0x11, 0x20, 0x3f, 0).u32(8).u16(0, 64).u8(52, 11, 0, 52).u32(1023).all;
const string = (size) => block().u8(0x13, 0x11).u16(0).u32(size).all;
const space = (...dims) => (dims.length ? block().u8(2, dims.length, 0, 1).u64(...dims).all : block().u8(2, 0, 0, 0).all);

/** These functions return values of attributes: { type, space, data }. */
export const text = (value) => {
  const bytes = utf8.encode(value), data = bytes.length ? bytes : Uint8Array.of(0);
  return { type: string(data.length), space: space(), data };
};
export const u64 = (value) => ({ type: integer(8), space: space(), data: block().u64(value).all });
export const i64 = (value) => ({ type: integer(8, true), space: space(), data: block().u64(value).all });
export const doubles = (values) => ({ type: double(), space: space(values.length), data: new Uint8Array(Float64Array.from(values).buffer) });

// --- objects ---

const message = (type, data, flags = 0) => block().u8(type).u16(data.length).u8(flags).bytes(data).all;

function attribute(name, { type, space: shape, data }) {
  const raw = utf8.encode(`${name}\0`);
  return message(12, block().u8(3, 0).u16(raw.length, type.length, shape.length).u8(0).bytes(raw).bytes(type).bytes(shape).bytes(data).all);
}

function link(name, address) {
  const raw = utf8.encode(name);
  return message(6, block().u8(1, 0, raw.length).bytes(raw).u64(address).all);
}

export class H5Writer {
  constructor() {
    this.out = block();
    this.out.room(48); // space for the superblock, which end() writes
  }

  #header(messages) {
    const at = this.out.length, bytes = messages.reduce((sum, m) => sum + m.length, 0), all = block().bytes(utf8.encode('OHDR')).u8(2, 2).u32(bytes);
    messages.forEach((m) => all.bytes(m));
    this.out.bytes(all.all).u32(lookup3(all.all, 0, all.length));
    return at;
  }

  /** Writes an array. `values`: a Uint8Array, Uint16Array, Uint32Array or BigUint64Array; `columns`: 0 for one dimension. Returns the array's address. */
  array(values, columns = 0) {
    const size = values.BYTES_PER_ELEMENT, rows = values.length / (columns || 1), shape = columns ? [rows, columns] : [rows];
    const data = new Uint8Array(values.buffer, values.byteOffset, values.byteLength), chunk = this.out.length; // assumes little-endian memory, as on all platforms with WebGL
    this.out.bytes(data).u32(fletcher32(data));
    const layout = block().u8(4, 2, 2, shape.length + 1, 8).u64(...shape, size).u8(1).u64(data.length + 4).u32(0).u64(chunk).all;
    return this.#header([message(1, space(...shape)), message(3, integer(size), 1), message(5, Uint8Array.of(3, 7), 1), message(8, layout), message(11, block().u8(2, 1).u16(3, 0, 0).all, 1)]);
  }

  /** Writes a group. `attributes`: [name, value] each; `links`: [name, address] each. Returns the group's address. */
  group(attributes, links = []) {
    return this.#header([message(2, block().u8(0, 0).u64(NONE, NONE).all), message(10, Uint8Array.of(0, 0)), ...links.map(([name, at]) => link(name, at)),
      ...attributes.map(([name, value]) => attribute(name, value))]);
  }

  /** Returns the file's bytes. `root`: the address of the root group. */
  end(root) {
    const head = block().u8(0x89, 0x48, 0x44, 0x46, 0x0d, 0x0a, 0x1a, 0x0a, 3, 8, 8, 0).u64(0, NONE, this.out.length, root);
    this.out.array.set(head.u32(lookup3(head.all, 0, head.length)).all);
    return this.out.all.slice();
  }
}
