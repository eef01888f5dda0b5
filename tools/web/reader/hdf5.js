// Reads the subset of HDF5's file format that EBP-Octree files use: superblock 3, version 2 object headers with all links and
// attributes in them, arrays of fixed size in chunks with the single-chunk or the fixed-array index. Other features are rejected with an error that names the feature.
// Every block's checksum is compared, and every count and address is checked before it is used.
// Source: The HDF Group, "HDF5 File Format Specification Version 3.0".
import { EbpoError, formatError } from './error.js';

const UNDEFINED = 0xffffffffffffffffn;
const SIGNATURE = [0x89, 0x48, 0x44, 0x46, 0x0d, 0x0a, 0x1a, 0x0a];
const MESSAGES_MOST = 8192, BLOCKS_MOST = 256; // limits of one object header: far above written files, low enough for untrusted input

const NIL = 0x00, DATASPACE = 0x01, LINK_INFO = 0x02, DATATYPE = 0x03, FILL_OLD = 0x04, FILL = 0x05, LINK = 0x06, LAYOUT = 0x08, GROUP_INFO = 0x0a,
  EXTERNAL = 0x07, PIPELINE = 0x0b, ATTRIBUTE = 0x0c, CONTINUATION = 0x10, ATTRIBUTE_INFO = 0x15;

/** Thrown when bytes `at` to `end` are needed and not loaded. */
export class NeedBytes extends Error {
  constructor(at, end) {
    super('more of the metadata is needed');
    this.at = at;
    this.end = end;
  }
}

function rotate(x, k) {
  return (x << k) | (x >>> (32 - k));
}

/** Jenkins' lookup3 ("hashlittle", from 0), which guards HDF5's metadata. Returns an unsigned 32-bit number. */
export function lookup3(bytes, start, length) {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  let a = (0xdeadbeef + length) | 0, b = a, c = a, at = start, left = length;
  while (left > 12) {
    a = (a + view.getUint32(at, true)) | 0;
    b = (b + view.getUint32(at + 4, true)) | 0;
    c = (c + view.getUint32(at + 8, true)) | 0;
    a = (a - c) ^ rotate(c, 4); c = (c + b) | 0;
    b = (b - a) ^ rotate(a, 6); a = (a + c) | 0;
    c = (c - b) ^ rotate(b, 8); b = (b + a) | 0;
    a = (a - c) ^ rotate(c, 16); c = (c + b) | 0;
    b = (b - a) ^ rotate(a, 19); a = (a + c) | 0;
    c = (c - b) ^ rotate(b, 4); b = (b + a) | 0;
    at += 12;
    left -= 12;
  }
  if (left === 0)
    return c >>> 0;
  const word = (from) => {
    let value = 0;
    for (let i = 0; i < 4 && from + i < left; i++)
      value |= bytes[at + from + i] << 8 * i;
    return value;
  };
  a = (a + word(0)) | 0;
  b = (b + word(4)) | 0;
  c = (c + word(8)) | 0;
  c = ((c ^ b) - rotate(b, 14)) | 0;
  a = ((a ^ c) - rotate(c, 11)) | 0;
  b = ((b ^ a) - rotate(a, 25)) | 0;
  c = ((c ^ b) - rotate(b, 16)) | 0;
  a = ((a ^ c) - rotate(c, 4)) | 0;
  b = ((b ^ a) - rotate(a, 14)) | 0;
  c = ((c ^ b) - rotate(b, 24)) | 0;
  return c >>> 0;
}

/** A cursor in a block that ends at `end`. `where` names the object in errors. */
class Cursor {
  constructor(bytes, at, end, where) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = at;
    this.end = end;
    this.where = where;
  }

  take(count) {
    if (count > this.end - this.at)
      throw formatError(this.where, 'its description is truncated');
    this.at += count;
    return this.at - count;
  }

  u8() { return this.bytes[this.take(1)]; }
  u16() { return this.view.getUint16(this.take(2), true); }
  u32() { return this.view.getUint32(this.take(4), true); }
  u64() { return this.view.getBigUint64(this.take(8), true); }

  /** Reads an unsigned integer of 1 to 8 bytes. */
  uint(size) {
    let value = 0;
    const from = this.take(size);
    for (let i = size - 1; i >= 0; i--)
      value = value * 256 + this.bytes[from + i];
    if (!Number.isSafeInteger(value))
      throw formatError(this.where, 'a number in its description is too large');
    return value;
  }

  /** Reads an address or length of 8 bytes; undefined for HDF5's undefined address. */
  address() {
    const value = this.u64();
    if (value === UNDEFINED)
      return undefined;
    if (value > BigInt(Number.MAX_SAFE_INTEGER))
      throw formatError(this.where, 'an address in its description is too large');
    return Number(value);
  }

  must(condition, what) {
    if (!condition)
      throw formatError(this.where, what);
  }
}

/** The metadata of a file of `size` bytes. The first `head.length` bytes are loaded, and optionally a `piece` { at, data } elsewhere. */
export class Hdf5 {
  constructor(head, size) {
    this.head = head;
    this.size = size;
    this.root = this.#superblock();
  }

  #need(at, length, where) {
    if (at + length > this.size)
      throw formatError(where, 'it is beyond the end of the file');
    if (at + length <= this.head.length)
      return { bytes: this.head, at };
    const { piece } = this;
    if (piece && at >= piece.at && at + length <= piece.at + piece.data.length)
      return { bytes: piece.data, at: at - piece.at };
    throw new NeedBytes(at, at + length);
  }

  #cursor(at, length, where) {
    const { bytes, at: from } = this.#need(at, length, where);
    return new Cursor(bytes, from, from + length, where);
  }

  #superblock() {
    const foreign = () => new EbpoError('FORMAT', 'not a whole HDF5 file; check whether it was truncated by copying, or is another kind of file');
    if (this.size < 48)
      throw foreign();
    this.#need(0, 48, '');
    if (SIGNATURE.some((byte, i) => this.head[i] !== byte))
      throw foreign();
    const c = new Cursor(this.head, 8, 48, '');
    if (c.u8() !== 3)
      throw formatError('', 'the superblock version differs from that of EBP-Octree files', 'convert it again with ebpo');
    const sizes = [c.u8(), c.u8()];
    c.u8(); // consistency flags: a writer has or had the file open
    const [base, extension, end, root] = [c.address(), c.address(), c.address(), c.address()];
    this.#checksum(0, 44, '');
    c.must(sizes[0] === 8 && sizes[1] === 8 && base === 0 && extension === undefined, 'the HDF5 layout differs from that of EBP-Octree files');
    if (end === undefined || end > this.size || root === undefined)
      throw foreign();
    this.end = end; // of the HDF5 file: the stored file may have more bytes
    return root;
  }

  #checksum(at, length, where) {
    const { bytes, at: from } = this.#need(at, length + 4, where);
    const stored = new DataView(bytes.buffer, bytes.byteOffset + from + length, 4).getUint32(0, true);
    if (stored !== lookup3(bytes, from, length))
      throw formatError(where, 'its description is damaged: the checksum differs');
  }

  /** Returns all messages of an object header as [{ type, cursor }]. */
  #messages(address, where) {
    this.#need(address, 16, where);
    let c = new Cursor(this.head, address, this.head.length, where);
    c.must(c.u32() === 0x5244484f && c.u8() === 2, 'there is no object header where one is expected'); // "OHDR"
    const flags = c.u8();
    c.must((flags & 0xc0) === 0, 'its object header has unknown flags');
    c.take((flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0));
    const size = c.uint(1 << (flags & 3));
    const out = [], blocks = [[c.at, size, c.at - address]];
    for (let i = 0; i < blocks.length; i++) {
      const [at, length, before] = blocks[i];
      c.must(i < BLOCKS_MOST, 'its object header has too many pieces');
      this.#checksum(at - before, before + length, where);
      c = new Cursor(this.head, at, at + length, where);
      const header = 4 + (flags & 4 ? 2 : 0);
      while (c.end - c.at >= header) {
        const type = c.u8(), bytes = c.u16(), own = c.u8();
        c.take(header - 4);
        const message = new Cursor(this.head, c.take(bytes), c.at, where);
        c.must((own & 2) === 0, 'its description is shared with another object');
        c.must(out.push({ type, cursor: message }) <= MESSAGES_MOST, 'its object header has too many messages');
        if (type === CONTINUATION)
          blocks.push(this.#continuation(message, where));
      }
    }
    return out;
  }

  #continuation(c, where) {
    const at = c.address(), length = c.uint(8);
    c.must(at !== undefined && length >= 8, 'its object header goes on nowhere');
    this.#need(at, length, where);
    c.must(new DataView(this.head.buffer, this.head.byteOffset + at, 4).getUint32(0, true) === 0x4b48434f, 'its object header goes on nowhere'); // "OCHK"
    return [at + 4, length - 8, 4];
  }

  /** Reads a group or an array: { kind: 'group', links: Map(name, address | undefined), attributes } or { kind: 'array', shape, attributes }. */
  object(address, where) {
    const attributes = new Map(), links = new Map(), parts = {};
    let group = false;
    for (const { type, cursor } of this.#messages(address, where)) {
      switch (type) {
        case NIL: case CONTINUATION: case FILL: case FILL_OLD: break;
        case GROUP_INFO: group = true; break;
        case LINK_INFO: group = true; this.#compact(cursor, 'links'); break;
        case ATTRIBUTE_INFO: this.#compact(cursor, 'attributes'); break;
        case LINK: this.#link(cursor, links); break;
        case ATTRIBUTE: this.#attribute(cursor, attributes); break;
        case DATASPACE: parts.space = dataspace(cursor); break;
        case DATATYPE: parts.type = datatype(cursor); break;
        case PIPELINE: parts.filters = pipeline(cursor); break;
        case LAYOUT: parts.layout = layout(cursor); break;
        case EXTERNAL: parts.external = true; break;
        default: break; // times, comments and reference counts do not affect the data
      }
    }
    if (group)
      return { kind: 'group', links, attributes };
    return parts.space && parts.type && parts.layout ? { kind: 'array', ...parts, filters: parts.filters ?? [], attributes } : { kind: 'other', attributes };
  }

  #compact(c, what) {
    c.must(c.u8() === 0, `its ${what} are stored in an unknown way`);
    const flags = c.u8();
    c.take(flags & 1 ? (what === 'links' ? 8 : 2) : 0);
    c.must(c.address() === undefined, `its ${what} are not stored in its object header`);
  }

  #link(c, links) {
    c.must(c.u8() === 1, 'a link is stored in an unknown way');
    const flags = c.u8(), type = flags & 8 ? c.u8() : 0;
    c.take((flags & 4 ? 8 : 0) + (flags & 16 ? 1 : 0));
    const length = c.uint(1 << (flags & 3)), name = text(c.bytes.subarray(c.take(length), c.at));
    c.must(name !== undefined && !links.has(name), 'a link has no proper name');
    links.set(name, type === 0 ? c.address() : undefined); // soft and external links are not followed
  }

  #attribute(c, attributes) {
    c.must(c.u8() === 3, 'an attribute is stored in an unknown way');
    const shared = c.u8(), [nameSize, typeSize, spaceSize] = [c.u16(), c.u16(), c.u16()];
    c.u8(); // character set of the name
    const raw = c.bytes.subarray(c.take(nameSize), c.at);
    const name = nameSize && raw[nameSize - 1] === 0 ? text(raw.subarray(0, nameSize - 1)) : undefined;
    c.must(name !== undefined && !attributes.has(name), 'an attribute has no proper name');
    const piece = (size) => new Cursor(c.bytes, c.take(size), c.at, c.where);
    const type = piece(typeSize), space = piece(spaceSize);
    attributes.set(name, shared ? { type: { class: 'other' } } : { type: datatype(type), space: dataspace(space), data: c.bytes.subarray(c.at, c.end) });
  }

  /**
   * Returns the offsets of an array's chunks: [{ at, bytes }], in order. `count` chunks are expected, each of at most `most` bytes; `whole` is a
   * chunk's size before filters.
   */
  chunks(array, where, count, whole, most) {
    const { layout: l, filters } = array;
    if (count > 1 && count > this.size / 4)
      throw formatError(where, 'the array has more chunks than the file can hold');
    const found = l.index === 1 ? this.#singleChunk(l, where, count, filters, whole) : this.#fixedArray(l, where, count, filters, whole);
    let total = 0;
    found.forEach(({ at, bytes, mask }, i) => {
      const chunk = `${where}: chunk ${i}`;
      if (at === undefined || bytes === 0)
        throw formatError(chunk, 'the chunk is missing');
      if (mask)
        throw formatError(chunk, 'the chunk was stored without its filters');
      if (bytes > most)
        throw formatError(chunk, 'the chunk is larger than the format allows');
      if (at + bytes > this.end)
        throw formatError(chunk, 'the chunk is beyond the end of the file');
      total += bytes;
    });
    if (total > this.end)
      throw formatError(where, "the array's chunks are larger than the file");
    return found;
  }

  #singleChunk(l, where, count, filters, whole) {
    if (count !== 1 || (filters.length > 0) !== (l.single !== undefined))
      throw formatError(where, "the array's index contradicts its shape");
    return [{ at: l.address, bytes: l.single?.bytes ?? whole, mask: l.single?.mask ?? 0 }];
  }

  #fixedArray(l, where, count, filters, whole) {
    if (l.address === undefined)
      throw formatError(where, 'the array was never written');
    let c = this.#cursor(l.address, 28, where);
    c.must(c.u32() === 0x44484146 && c.u8() === 0, "there is no chunk index where one is expected"); // "FAHD"
    this.#checksum(l.address, 24, where);
    const client = c.u8(), entry = c.u8(), pageBits = c.u8(), entries = c.uint(8), data = c.address();
    const filtered = filters.length > 0, sizeBytes = filtered ? entry - 12 : 0;
    c.must(client === (filtered ? 1 : 0) && (filtered ? sizeBytes >= 1 && sizeBytes <= 8 : entry === 8), "the array's index contradicts its filters");
    c.must(entries === count && pageBits === l.pageBits && pageBits >= 1 && pageBits <= 20 && data !== undefined, "the array's index contradicts its shape");
    c = this.#cursor(data, 14, where);
    c.must(c.u32() === 0x42444146 && c.u8() === 0 && c.u8() === client && c.address() === l.address, "there is no chunk index where one is expected"); // "FADB"
    const perPage = 2 ** pageBits, pages = count > perPage ? Math.ceil(count / perPage) : 0, prefix = 14 + Math.ceil(pages / 8);
    this.#checksum(data, pages ? prefix : prefix + count * entry, where);
    const out = [];
    let at = data + prefix + (pages ? 4 : 0);
    for (let page = 0; page < (pages || 1); page++) {
      const here = pages ? Math.min(perPage, count - page * perPage) : count;
      if (pages) {
        if (!(this.#cursor(data + 14 + (page >> 3), 1, where).u8() >> (7 - page % 8) & 1))
          throw formatError(where, 'the array was never written');
        this.#checksum(at, here * entry, where);
      }
      c = this.#cursor(at, here * entry, where);
      for (let i = 0; i < here; i++)
        out.push({ at: c.address(), bytes: filtered ? c.uint(sizeBytes) : whole, mask: filtered ? c.u32() : 0 });
      at += here * entry + 4;
    }
    return out;
  }
}

function dataspace(c) {
  c.must(c.u8() === 2, 'its dimensions are stored in an unknown way');
  const rank = c.u8(), flags = c.u8(), type = c.u8();
  if (rank > 2 || type > 1)
    return { rank: 99, dims: [], fixed: false };
  const dims = [], most = [];
  for (let i = 0; i < rank; i++)
    dims.push(c.address());
  for (let i = 0; i < rank && flags & 1; i++)
    most.push(c.address());
  return { rank, dims, fixed: most.every((m, i) => m === dims[i]) && dims.every((d) => d !== undefined) };
}

/** Reads a type: { class: 'integer', size, signed, little }, { class: 'float' ... }, { class: 'text', size } or { class: 'other' }. */
function datatype(c) {
  const kind = c.u8(), bits = c.uint(3), size = c.u32();
  if ((kind & 15) === 0) {
    const offset = c.u16(), precision = c.u16();
    const plain = (bits & ~0x08) === (bits & 1) && offset === 0 && precision === 8 * size;
    return { class: plain ? 'integer' : 'other', size, signed: (bits & 8) !== 0, little: (bits & 1) === 0 };
  }
  if ((kind & 15) === 1) {
    const at = c.take(12), ieee = [0, 0, 64, 0, 52, 11, 0, 52, 255, 3, 0, 0];
    return { class: size === 8 && bits === 0x3f20 && ieee.every((byte, i) => c.bytes[at + i] === byte) ? 'double' : 'other', size };
  }
  if ((kind & 15) === 3)
    return { class: 'text', size }; // with any padding, the text ends at its first zero byte
  return { class: 'other', size };
}

function pipeline(c) {
  c.must(c.u8() === 2, "the array's filters are stored in an unknown way");
  const filters = [];
  for (let n = c.u8(); n > 0; n--) {
    const id = c.u16(), nameLength = id >= 256 ? c.u16() : 0;
    c.u16(); // flags; all filters are required, also optional ones
    const count = c.u16(), values = [];
    c.take(nameLength);
    for (let i = 0; i < count; i++)
      values.push(c.u32());
    filters.push({ id, values });
  }
  return filters;
}

function layout(c) {
  const version = c.u8(), kind = c.u8();
  if (version !== 4 || kind !== 2)
    return { chunked: false, elsewhere: kind === 3 }; // virtual
  const flags = c.u8(), rank = c.u8(), size = c.u8();
  c.must(rank >= 2 && rank <= 3 && size >= 1 && size <= 8 && (flags & ~2) === 0, 'the array is stored in an unknown way');
  const chunk = [];
  for (let i = 0; i < rank; i++)
    chunk.push(c.uint(size));
  const index = c.u8(), out = { chunked: true, chunk: chunk.slice(0, -1), elementSize: chunk[rank - 1], index };
  if (index === 1 && flags & 2)
    out.single = { bytes: c.uint(8), mask: c.u32() };
  else if (index === 3)
    out.pageBits = c.u8();
  else if (index > 3)
    return { ...out, grows: true };
  else
    c.must(index === 1, "the array's chunks have an unknown index");
  out.address = c.address();
  return out;
}

const strict = new TextDecoder('utf-8', { fatal: true });

/** Decodes UTF-8 without control characters; returns undefined for other bytes. */
export function text(bytes) {
  try {
    const out = strict.decode(bytes);
    // eslint-disable-next-line no-control-regex
    return /[\u0000-\u001f\u007f-\u009f]/.test(out) ? undefined : out;
  } catch {
    return undefined;
  }
}
