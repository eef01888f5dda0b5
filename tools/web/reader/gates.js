// Decodes the coding `gates` of faces (format-spec/gates.md), which codes faces across open edges: converts a chunk's streams to high-water codes.

export const GATES_COLS = 13;
const OPEN_MOST = 64, NEAR = 32, LOW_END = 224, LONG = 240;
const NEW = 0, AT_SECOND = 1, AT_FIRST = 2, BY_NUMBER = 3, AT_OPEN = 4; // values of `third`: the way in which the corner opposite the edge is coded

/** A list of open edges (pairs of vertices), newest last. Vertices are numbered relative to the chunk's first new vertex, modulo 2^32, because codes are relative. */
class OpenEdges {
  constructor() {
    this.a = [];
    this.b = [];
  }

  get count() {
    return this.a.length;
  }

  push(a, b) {
    this.a.push(a);
    this.b.push(b);
    if (this.a.length > OPEN_MOST) {
      this.a.shift();
      this.b.shift();
    }
  }

  remove(at) {
    this.a.splice(at, 1);
    this.b.splice(at, 1);
  }

  pass(a, b) {
    const least = Math.max(this.count - NEAR, 0);
    for (let i = this.count - 1; i >= least; i--)
      if (this.a[i] === a && this.b[i] === b)
        return this.remove(i);
    this.push(b, a);
  }

  /** Updates the open edges behind a face (a, b, c) across (a, b). `at`: the position of the edge that named c. */
  goThrough(kind, at, a, b, c) {
    if (kind === NEW) {
      this.push(c, b);
      this.push(a, c);
      return;
    }
    if (kind === AT_SECOND || kind === AT_FIRST)
      this.remove(at);
    if (kind !== AT_SECOND)
      this.pass(b, c);
    if (kind !== AT_FIRST)
      this.pass(c, a);
  }
}

class Streams {
  constructor(bytes, rows) {
    let thirds = 0, numbers = 0;
    for (let i = 0; i < rows; i++)
      thirds += bytes[i] !== 0;
    for (let i = 0; i < thirds; i++)
      numbers += Math.floor(bytes[rows + i] / 3) === BY_NUMBER;
    Object.assign(this, { bytes, gate: 0, third: rows, low: rows + thirds, more: rows + thirds + 3 * (rows - thirds) + numbers, end: GATES_COLS * rows });
  }

  /** Returns the next number, or undefined when the bytes are not a number. */
  number() {
    const { bytes } = this, low = bytes[this.low++];
    if (low < LOW_END)
      return low;
    const wide = low === LONG ? 4 : 1;
    if (low > LONG || this.more + wide > this.end)
      return undefined;
    const at = this.more;
    this.more += wide;
    return wide === 1 ? LOW_END + 256 * (low - LOW_END) + bytes[at] : (bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16 | bytes[at + 3] << 24) >>> 0;
  }
}

function alone(streams, open, seen, face) {
  for (let k = 0; k < 3; k++) {
    const number = streams.number();
    if (number === undefined)
      return false;
    face[k] = seen - number >>> 0;
    seen += number === 0;
  }
  for (let k = 0; k < 3; k++)
    open.push(face[(k + 1) % 3], face[k]);
  return true;
}

function across(streams, open, gate, seen, face) {
  if (gate > open.count)
    return false;
  const third = streams.bytes[streams.third++], kind = Math.floor(third / 3), k = third % 3, side = open.count - gate, a = open.a[side], b = open.b[side];
  open.remove(side);
  const at = kind === AT_SECOND ? open.a.lastIndexOf(b) : kind === AT_FIRST ? open.b.lastIndexOf(a) : open.count - 1 - (kind - AT_OPEN);
  if (kind !== NEW && kind !== BY_NUMBER && at < 0)
    return false;
  const number = kind === BY_NUMBER ? streams.number() : 0;
  if (number === undefined)
    return false;
  const c = kind === NEW || kind === BY_NUMBER ? seen - number >>> 0 : kind === AT_SECOND ? open.b[at] : open.a[at];
  face[k] = a;
  face[(k + 1) % 3] = b;
  face[(k + 2) % 3] = c;
  open.goThrough(kind, at, a, b, c);
  return true;
}

function withoutStreams(bytes, rows) {
  const n = 3 * rows, out = new Uint32Array(n);
  if (bytes.subarray(1 + 4 * n, GATES_COLS * rows).some((byte) => byte !== 0))
    return undefined;
  for (let k = 0; k < 4; k++)
    for (let i = 0; i < n; i++)
      out[i] |= bytes[1 + k * n + i] << 8 * k;
  return out;
}

/** Returns the high-water codes of `rows` faces, or undefined when the bytes are invalid. Numbers above `seen` become codes above `seen`, which decodeFaces() rejects. */
export function decodeGates(bytes, rows) {
  if (bytes[0] === 1)
    return withoutStreams(bytes, rows);
  const streams = new Streams(bytes, rows), open = new OpenEdges(), out = new Uint32Array(3 * rows), face = [0, 0, 0];
  let seen = 0;
  for (let i = 0; i < rows; i++) {
    const gate = bytes[streams.gate++];
    if (gate ? !across(streams, open, gate, seen, face) : !alone(streams, open, seen, face))
      return undefined;
    for (let k = 0; k < 3; k++) {
      const code = out[3 * i + k] = seen - face[k] >>> 0;
      seen = seen + (code === 0) >>> 0;
    }
  }
  return bytes.subarray(streams.more, streams.end).some((byte) => byte !== 0) ? undefined : out;
}
