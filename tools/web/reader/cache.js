// Fetches and decodes chunks in batches. Neighbouring chunks share a request, several requests run at once, and chunks are decoded as they arrive.
// Decoded chunks are cached within a memory budget.
import { decodeChunk } from './chunk.js';
import { formatError } from './error.js';
import { decodeGates } from './gates.js';
import { chunkEnd } from './chunk_checksums.js';

const GAP_BYTES = 16 * 1024;            // gaps of at most this size are read rather than split into two requests
const REQUEST_BYTES = 4 * 1024 * 1024;  // most bytes of a request
const FEW = 12, SPARE_SHARE = 0.25, SPARE_BYTES = 64 * 1024; // above FEW requests per batch, wider gaps are joined, up to this share and size of extra bytes
const REQUESTS = 6;                     // concurrent requests, as browsers allow for a host
export const CACHE_BYTES = 64 * 1024 * 1024;

/** Joins ranges into requests: neighbouring ranges first, and ranges with wider gaps when many requests remain. */
export function joined(ranges) {
  const runs = [];
  for (const r of ranges.sort((a, b) => a.from - b.from)) {
    const run = runs.at(-1);
    if (run && r.from - run.to <= GAP_BYTES && Math.max(r.to, run.to) - run.from <= REQUEST_BYTES) {
      run.to = Math.max(run.to, r.to);
      run.ranges.push(r);
    } else {
      runs.push({ from: r.from, to: r.to, ranges: [r] });
    }
  }
  return runs.length > FEW ? fewer(runs) : runs;
}

// Join over the smallest gaps first, while few extra bytes are read.
function fewer(runs) {
  let left = Math.max(SPARE_BYTES, runs.reduce((sum, r) => sum + r.to - r.from, 0) * SPARE_SHARE), most = 0, joins = runs.length - FEW;
  for (const gap of runs.slice(1).map((r, i) => r.from - runs[i].to).sort((a, b) => a - b)) {
    if (joins-- === 0 || gap > left)
      break;
    left -= gap;
    most = gap;
  }
  const out = [];
  for (const r of runs) {
    const last = out.at(-1);
    if (last && r.from - last.to <= most && r.to - last.from <= REQUEST_BYTES) {
      last.to = r.to;
      last.ranges.push(...r.ranges);
    } else {
      out.push(r);
    }
  }
  return out;
}

const keyOf = ({ array, chunk }) => array.number * 2 ** 32 + chunk;

function withoutGates(bytes, array, chunk) {
  const codes = decodeGates(bytes, Math.min(array.chunkRows, array.rows - chunk * array.chunkRows));
  return codes ? { bytes: new Uint8Array(codes.buffer) } : { fault: 'the chunk\'s streams do not encode faces' };
}

export class ChunkCache {
  /**
   * `head`: the file's first bytes, which are not fetched again. `values(array, chunk, bytes)`: returns the cached value of a chunk (an object with byteLength), or a promise of it.
   * `sums()`: a promise of the expected chunk checksums (chunk_checksums.js), or of undefined; not used for lists of chunks. `late()`: true while the checksums are still loading;
   * chunks that arrived earlier are then returned first.
   */
  constructor(source, head, { zstd, values, sums, late, budget = CACHE_BYTES }) {
    Object.assign(this, { source, head, zstd, values, sums, late, budget });
    this.early = [];          // chunks that were returned before their checksums were known
    this.kept = new Map();    // values by key, oldest first
    this.bytes = 0;           // size of the cached values
    this.pending = new Map(); // promises by key
    this.busy = 0;
    this.queue = [];
  }

  /** Returns values of chunks. `wanted` is [{ array, chunk }] of any arrays; each array must have its `chunks`. */
  async get(wanted) {
    const missing = [], found = wanted.map((item) => {
      const key = keyOf(item), hit = this.recall(key);
      if (hit !== undefined)
        return hit;
      let promise = this.pending.get(key);
      if (!promise) {
        promise = new Promise((done, fail) => missing.push({ ...item, key, done, fail }));
        this.pending.set(key, promise);
      }
      return promise;
    });
    this.#load(missing);
    return Promise.all(found);
  }

  #load(missing) {
    this.decoded(missing).forEach(async (promise, i) => {
      const { array, chunk, key, done, fail } = missing[i];
      try {
        const values = await this.values(array, chunk, await promise);
        this.remember(key, values);
        done(values);
      } catch (error) {
        fail(error);
      } finally {
        this.pending.delete(key);
      }
    });
  }

  /** Returns the number of bytes that would be fetched for these chunks. */
  cost(wanted) {
    let sum = 0;
    for (const item of wanted) {
      const { at, bytes } = item.array.chunks[item.chunk], key = keyOf(item);
      if (at + bytes > this.coming && !this.kept.has(key) && !this.pending.has(key))
        sum += bytes;
    }
    return sum;
  }

  /** Returns decoded bytes of chunks without caching them: [Promise]. */
  decoded(wanted) {
    const sums = wanted.some(({ array }) => !array.list) ? this.sums?.() : undefined; // fetched in parallel with the chunks
    sums?.catch(() => {}); // the caller that awaits the checksums reports the error
    return this.fetch(wanted.map(({ array, chunk }) => array.chunks[chunk])).map(async (promise, i) => {
      const { array, chunk } = wanted[i], stored = await promise;
      if (!array.list)
        await this.#judge(sums, array, chunk, stored);
      const { elementSize, rowBytes } = array.stored, got = await decodeChunk(stored, array.pipeline, elementSize, array.chunkRows * rowBytes, await this.zstd);
      const { bytes, fault } = got.bytes && array.gates ? withoutGates(got.bytes, array, chunk) : got;
      if (fault)
        throw formatError(`${array.path}: chunk ${chunk}`, `the chunk is damaged: ${fault}`);
      return bytes;
    });
  }

  async #judge(sums, array, chunk, stored) {
    const end = chunkEnd(stored), { at, bytes } = array.chunks[chunk];
    if (this.broken)
      throw this.broken;
    if (at + bytes <= this.coming && this.late?.())
      this.early.push({ array, chunk, end });
    else
      this.#compare(await sums, array, chunk, end);
  }

  #compare(sums, array, chunk, end) {
    if (sums && sums.get(array)[chunk] !== end)
      throw formatError(`${array.path}: chunk ${chunk}`, 'the chunk is damaged: it is not the chunk that was written there');
  }

  /** Compares the chunks that were returned early with the checksums. After a mismatch no further chunks are returned. */
  judgeEarly(sums) {
    try {
      for (const { array, chunk, end } of this.early.splice(0))
        this.#compare(sums, array, chunk, end);
    } catch (error) {
      this.broken = error;
    }
  }

  // --- the cache: chunks, and other values under string keys ---

  recall(key) {
    const hit = this.kept.get(key);
    if (hit !== undefined) {
      this.kept.delete(key); // move it to the newest end
      this.kept.set(key, hit);
    }
    return hit;
  }

  remember(key, values) {
    if (this.kept.has(key))
      return;
    this.kept.set(key, values);
    this.bytes += values.byteLength;
    for (const [old, { byteLength }] of this.kept) {
      if (this.bytes <= this.budget)
        break;
      this.kept.delete(old);
      this.bytes -= byteLength;
    }
  }

  // --- bytes ---

  /** Returns how many of the file's first bytes are loaded or loading; reading them takes no request. */
  get coming() {
    return Math.max(this.head.length, this.source.coming ?? 0);
  }

  /** Reads ranges [{ at, bytes }] of the file. Returns [Promise of Uint8Array] in the same order. */
  fetch(ranges) {
    const { coming } = this, out = new Array(ranges.length), behind = [];
    ranges.forEach((r, i) => (r.at + r.bytes <= coming ? (out[i] = this.#first(r.at, r.at + r.bytes))
      : behind.push({ i, from: Math.max(r.at, coming), to: r.at + r.bytes })));
    for (const run of joined(behind)) {
      run.data = this.#turn(() => this.source.read(run.from, run.to - run.from));
      run.data.catch(() => {}); // the promises of the run's pieces report the error
      for (const { i, from, to } of run.ranges)
        out[i] = this.#piece(run, ranges[i].at, from, to);
    }
    return out;
  }

  async #piece(run, at, from, to) {
    const data = await run.data, piece = data.subarray(from - run.from, to - run.from);
    if (at === from)
      return piece;
    const out = new Uint8Array(to - at); // the range begins in the head and continues after it
    out.set(await this.#first(at, from));
    out.set(piece, from - at);
    return out;
  }

  async #first(from, to) {
    return to <= this.head.length ? this.head.subarray(from, to) : this.source.read(from, to - from);
  }

  async #turn(work) {
    if (this.busy >= REQUESTS)
      await new Promise((done) => this.queue.push(done)); // waits until another request ends, and takes its slot
    else
      this.busy++;
    try {
      return await work();
    } finally {
      if (this.queue.length)
        this.queue.shift()();
      else
        this.busy--;
    }
  }
}
