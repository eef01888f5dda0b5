// Reads rows of arrays of an open file: finds their chunks and returns their values.
import { ChunkCache } from './cache.js';
import { decodeColours } from './colours.js';
import { decodeFaces, decodeMapChunk, decodeVertices } from './decode.js';
import { formatError } from './error.js';
import { CHUNK_SUMS } from './facts.js';
import { isListValid } from './chunk_directory.js';
import { readChecksums } from './chunk_checksums.js';

export class Store {
  /** `arrays`: descriptions by path (file.js). The chunks of requested arrays must be known. */
  constructor(info, arrays, source, head, options) {
    this.info = info;
    this.arrays = arrays;
    this.small = new Map();
    this.cache = new ChunkCache(source, head, { ...options, sums: () => this.sums(), late: () => this.#sumsAreLate(), values: (array, chunk, bytes) => this.#values(array, chunk, bytes) });
  }

  /**
   * Resolves to the chunk checksums; to undefined when the file has no list of them, or when another program rewrote the file without its list. The list is read once.
   */
  sums() {
    const list = this.arrays.get(CHUNK_SUMS);
    if (!list || list.pipeline === 'bare' || !isListValid(list, this.cache.source.size))
      return Promise.resolve(undefined);
    this.ends ??= this.#readChecksums(list);
    this.ends.catch(() => (this.ends = undefined)); // the next call tries again
    return this.ends;
  }

  async #readChecksums(list) {
    const [bytes] = await Promise.all(this.cache.decoded([{ array: list, chunk: 0 }]));
    const sums = readChecksums(new Uint32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4), [...this.arrays.values()].filter((a) => !a.list));
    this.summed = true;
    this.cache.judgeEarly(sums);
    return sums;
  }

  // Returns true while the list has not arrived. Chunks are then returned without a comparison, so that the first levels do not wait for the list.
  #sumsAreLate() {
    const [{ at, bytes }] = this.arrays.get(CHUNK_SUMS)?.chunks ?? [{ at: 0, bytes: 0 }], { head, source } = this.cache;
    return !this.summed && source.come !== undefined && at + bytes > Math.max(head.length, source.come);
  }

  async #values(array, chunk, bytes) {
    if (array.path === '/mesh/faces')
      return decodeFaces(bytes, array, chunk, await this.facesIndex(), this.info.vertex_count);
    if (array.columns)
      return decodeColours(bytes, array, Math.min(array.chunkRows, array.rows - chunk * array.chunkRows));
    if (array.path === '/maps/face_source')
      return decodeMapChunk(bytes.subarray(0, 4 * Math.min(array.chunkRows, array.rows - chunk * array.chunkRows)), array, this.info.source_face_count + this.info.mend_added_faces);
    return array.path === '/mesh/vertices' ? decodeVertices(bytes, array, chunk) : typed(array, bytes);
  }

  /** Returns the chunks with rows `from` to `to` - 1 of arrays, each once: [{ array, chunk }]. `wanted`: [{ path, from, to }]. Absent arrays have no chunks. */
  chunksOf(wanted) {
    const out = [], seen = new Set();
    for (const { path, from, to } of wanted) {
      const array = this.arrays.get(path);
      for (let chunk = array ? Math.floor(from / array.chunkRows) : 0; array && chunk * array.chunkRows < to; chunk++) {
        const key = array.number * 2 ** 32 + chunk;
        if (!seen.has(key))
          out.push({ array, chunk });
        seen.add(key);
      }
    }
    return out;
  }

  /** Reads rows `from` to `to` - 1 of arrays with one column. Returns a new typed array for each, or undefined for absent arrays. */
  async rows(wanted) {
    const chunks = this.chunksOf(wanted), values = await this.cache.get(chunks), byArray = new Map();
    chunks.forEach(({ array, chunk }, i) => {
      if (!byArray.has(array))
        byArray.set(array, new Map());
      byArray.get(array).set(chunk, values[i]);
    });
    return wanted.map(({ path, from, to }) => {
      const array = this.arrays.get(path);
      if (!array)
        return undefined;
      if (from >= to)
        return new (storedType(array))(0);
      const out = new (storedType(array))(to - from);
      for (let at = from; at < to;) {
        const chunk = Math.floor(at / array.chunkRows), begin = chunk * array.chunkRows, end = Math.min(to, begin + array.chunkRows);
        out.set(byArray.get(array).get(chunk).subarray(at - begin, end - begin), at - from);
        at = end;
      }
      return out;
    });
  }

  /** Reads rows of three numbers into `out`. */
  async triples(path, rows, out) {
    const array = this.arrays.get(path), shift = array.chunkRows, numbers = new Map();
    for (const row of rows) {
      const chunk = Math.floor(row / shift);
      if (!numbers.has(chunk))
        numbers.set(chunk, undefined);
    }
    const wanted = [...numbers.keys()], values = await this.cache.get(wanted.map((chunk) => ({ array, chunk })));
    wanted.forEach((chunk, i) => numbers.set(chunk, values[i]));
    for (let i = 0; i < rows.length; i++) {
      const chunk = Math.floor(rows[i] / shift), from = numbers.get(chunk), at = 3 * (rows[i] - chunk * shift);
      out[3 * i] = from[at];
      out[3 * i + 1] = from[at + 1];
      out[3 * i + 2] = from[at + 2];
    }
  }

  /** Reads the values of one column in rows. Values of colours are bytes (colours.js). */
  async column(path, column, rows, Type = Uint8Array) {
    const array = this.arrays.get(path), width = Math.max(array.cols, 1), chunks = new Map(), out = new Type(rows.length);
    for (const row of rows)
      chunks.set(Math.floor(row / array.chunkRows), undefined);
    const wanted = [...chunks.keys()], values = await this.cache.get(wanted.map((chunk) => ({ array, chunk })));
    wanted.forEach((chunk, i) => chunks.set(chunk, values[i]));
    for (let i = 0; i < rows.length; i++) {
      const chunk = Math.floor(rows[i] / array.chunkRows);
      out[i] = chunks.get(chunk)[width * (rows[i] - chunk * array.chunkRows) + column];
    }
    return out;
  }

  /** Reads whole arrays, as stored before filters, without caching them. Returns Map(path, bytes); absent arrays are undefined. */
  async raw(paths) {
    const arrays = paths.map((path) => this.arrays.get(path)).filter(Boolean), wanted = arrays.flatMap(everyChunk), out = new Map();
    for (const array of arrays)
      out.set(array.path, new Uint8Array(array.rows * array.rowBytes));
    await Promise.all(this.cache.decoded(wanted).map(async (promise, i) => {
      const { array, chunk } = wanted[i], all = out.get(array.path), at = chunk * array.chunkRows * array.rowBytes, bytes = await promise;
      all.set(bytes.subarray(0, all.length - at), at);
    }));
    return out;
  }

  /** Resolves to a small array of 64-bit numbers, or undefined if absent. The array is read once. */
  whole(path) {
    if (!this.small.has(path))
      this.small.set(path, this.raw([path]).then((raw) => this.integers(raw, path, Float64Array), (error) => {
        this.small.delete(path);
        throw error;
      }));
    return this.small.get(path);
  }

  async facesIndex() {
    return await this.whole('/mesh/faces_index') ?? Float64Array.of(0);
  }

  /** Converts an array's integers from raw() to Type. Integers of 64 bits become a Float64Array. */
  integers(raw, path, Type) {
    const bytes = raw.get(path);
    if (!bytes)
      return undefined;
    const values = typed(this.arrays.get(path), bytes);
    if (values instanceof Type)
      return values;
    if (!(values instanceof BigUint64Array))
      return Type.from(values);
    return Type.from(values, (v) => {
      if (v > BigInt(Number.MAX_SAFE_INTEGER))
        throw formatError(path, 'a number is too large');
      return Number(v);
    });
  }
}

const storedType = (array) => ({ 1: [Uint8Array, Int8Array], 2: [Uint16Array, Int16Array], 4: [Uint32Array, Int32Array], 8: [BigUint64Array] }[array.elementSize][+array.signed]);

function typed(array, bytes) {
  return new (storedType(array))(bytes.buffer, bytes.byteOffset, bytes.length / array.elementSize);
}

export const everyChunk = (array) => Array.from({ length: array.chunkCount }, (_, chunk) => ({ array, chunk }));
