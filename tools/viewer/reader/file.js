// An open EBP-Octree file: its facts, its levels, its mesh. Bytes are fetched when they are asked for, neighbours in one request.
import { CHUNK_BYTES_MAX, chunkBound, decodeChunk, pipelineOf } from './chunk.js';
import { EbpoError, formatError } from './error.js';
import { INDEX_ROWS, arraysOf, checkFacts, chunkRows, readFacts, readLevelFacts } from './facts.js';
import { Hdf5, NeedBytes } from './hdf5.js';
import { checkIndexes, checkLevel, checkOrder, decodeFaces, decodeLeafBlock, decodeLeaves, decodeMap, decodeVertices } from './decode.js';
import { sourceOf } from './source.js';

const HEAD_BYTES = 128 * 1024, HEAD_BYTES_MOST = 256 * 1024 * 1024, INDEX_BYTES_MOST = 256 * 1024 * 1024;
const GAP_BYTES = 32 * 1024;            // rather read this much for nothing than ask twice
const REQUEST_BYTES = 4 * 1024 * 1024;  // a request's most
const REQUESTS = 6;                     // at once, as browsers do for a host
const CACHE_BYTES = 96 * 1024 * 1024;   // decoded chunks that parts of arrays were taken from

const FACE_TABLES = ['leaf_skip', 'leaf_new', 'leaf_ref_count', 'leaf_refs', 'leaf_index'];
const folder = (level) => `/levels/${String(level).padStart(2, '0')}/`;

/**
 * Opens a file: a URL (text or URL), a File or Blob, an ArrayBuffer, a Uint8Array (also a Node.js Buffer), or a source (source.js).
 * Options: those of UrlSource; `zstd`, a decoder as loadZstd() gives it; `headBytes`, what the first request asks for (128 KiB).
 * @returns {Promise<EbpoFile>}
 */
export async function openEbpo(what, options = {}) {
  const source = sourceOf(what, options);
  try {
    const file = new EbpoFile(source, options);
    await file.openHead(options.headBytes ?? HEAD_BYTES);
    return file;
  } catch (error) {
    throw named(source, error);
  }
}

function named(source, error) {
  if (error instanceof EbpoError && !error.message.startsWith(source.name))
    return new EbpoError(error.code, `${source.name}: ${error.message}`, { cause: error });
  return error;
}

export class EbpoFile {
  constructor(source, options = {}) {
    this.source = source;
    this.zstd = options.zstd;
    this.info = undefined;   // facts.js: attributes by name, `levels`, `parts`, `solid`
    this.arrays = new Map(); // path: { path, rows, cols, elementSize, signed, chunkRows, chunkCount, pipeline, chunks, bytes }; chunks and bytes are undefined until located
    this.cache = new Map();  // decoded chunks by path and number, oldest first
    this.cached = 0;
  }

  /** Requests made and bytes received so far. */
  get traffic() {
    return { requests: this.source.requests, bytes: this.source.bytes };
  }

  // --- the head ---

  async openHead(bytes) {
    this.head = await this.source.open(bytes);
    for (;;) {
      try {
        this.#parse();
        return;
      } catch (error) {
        if (!(error instanceof NeedBytes))
          throw error;
        const size = Math.min(this.source.size, Math.max(error.end, 2 * this.head.length));
        if (size > HEAD_BYTES_MOST)
          throw formatError('', 'its head is larger than any file needs');
        const more = await this.source.read(this.head.length, size - this.head.length), all = new Uint8Array(size);
        all.set(this.head);
        all.set(more, this.head.length);
        this.head = all;
      }
    }
  }

  #parse() {
    const hdf5 = new Hdf5(this.head, this.source.size), objects = new Map();
    const group = (path, address) => {
      const o = address === undefined ? undefined : hdf5.object(address, path);
      if (o?.kind !== 'group')
        throw formatError(path, 'a group is expected here and there is none');
      objects.set(path, o);
      return o;
    };
    const root = group('/', hdf5.root), info = readFacts(root.attributes);
    const levels = group('/levels', root.links.get('levels'));
    info.levels = Array.from({ length: info.level_count }, (_, i) => {
      const path = folder(i).slice(0, -1);
      return readLevelFacts(group(path, levels.links.get(path.slice(-2))).attributes, path);
    });
    checkFacts(info);
    for (const part of ['mesh', 'maps'])
      if (info.parts.has(part))
        group(`/${part}`, root.links.get(part));
    const arrays = new Map();
    for (const wanted of arraysOf(info)) {
      const cut = wanted.path.lastIndexOf('/'), links = objects.get(wanted.path.slice(0, cut)).links, name = wanted.path.slice(cut + 1);
      if (wanted.mayBeAbsent && !links.has(name))
        continue;
      arrays.set(wanted.path, describe(hdf5, wanted, links.has(name), links.get(name), info));
    }
    this.info = info;
    this.arrays = arrays;
    this.hdf5 = hdf5;
    this.#placeArrays((array) => !array.indexed); // a single chunk's place stands in its array's header
    try {
      this.#placeArrays((array) => array.indexed);
    } catch (error) {
      if (!(error instanceof NeedBytes)) // else the index has not come with the head
        throw error;
    }
  }

  #placeArrays(which) {
    for (const array of this.arrays.values())
      if (!array.chunks && which(array)) {
        array.chunks = this.hdf5.chunks(array.object, array.path, array.chunkCount, array.chunkRows * array.rowBytes, chunkBound(array.chunkRows * array.rowBytes));
        array.bytes = array.chunks.reduce((sum, c) => sum + c.bytes, 0);
      }
    if ([...this.arrays.values()].reduce((sum, a) => sum + (a.bytes ?? 0), 0) > this.source.size)
      throw formatError('', "the arrays' chunks take more room than the file has");
  }

  /** Whether it is known where all chunks are. Arrays of several chunks have an index, which stands behind the first levels. */
  get located() {
    return [...this.arrays.values()].every((a) => a.chunks);
  }

  /** Fetches that index, if it is not there yet. Reading does so by itself when it must. */
  async locate() {
    if (this.located)
      return;
    this.locating ??= this.#readIndex().finally(() => (this.locating = undefined));
    await this.locating;
  }

  async #readIndex() {
    const { chunk_index_offset: at, chunk_index_bytes: bytes } = this.info;
    let piece = at > 0 && bytes > 0 && bytes <= INDEX_BYTES_MOST && at + bytes <= this.source.size ? { at, end: at + bytes } : undefined;
    for (;;) {
      if (piece)
        this.hdf5.piece = { at: piece.at, data: await this.source.read(piece.at, piece.end - piece.at) };
      try {
        this.#placeArrays(() => true);
        this.hdf5.piece = undefined;
        return;
      } catch (error) {
        if (!(error instanceof NeedBytes))
          throw named(this.source, error);
        // Another program wrote the file: ever more of it around what was missed.
        const from = Math.min(piece?.at ?? error.at, error.at), to = Math.max(piece?.end ?? error.end, error.end);
        piece = { at: from, end: Math.min(this.source.size, from + 2 * (to - from) + HEAD_BYTES) };
        if (piece.end - piece.at > INDEX_BYTES_MOST)
          throw named(this.source, formatError('', 'its chunk indexes are spread over more of the file than can be read at once'));
      }
    }
  }

  /** Bytes of the file up to the end of a level: what a reader has fetched that went through it in order. NaN where that is not known yet (`located`). */
  bytesToLevel(level) {
    let end = 0;
    for (const a of this.arrays.values())
      if (a.level <= level)
        end = a.chunks ? a.chunks.reduce((most, chunk) => Math.max(most, chunk.at + chunk.bytes), end) : NaN;
    return end;
  }

  // --- bytes ---

  // ranges: [{ at, bytes }] -> [Uint8Array], in the same order. Neighbours are fetched together, and not again what the head's request brought.
  async #fetch(ranges) {
    const have = this.head.length, sorted = ranges.filter((r) => r.at + r.bytes > have).map((r) => ({ from: Math.max(r.at, have), to: r.at + r.bytes }))
      .sort((a, b) => a.from - b.from);
    const runs = [];
    for (const r of sorted) {
      const run = runs.at(-1);
      if (run && r.from - run.to <= GAP_BYTES && r.to - run.from <= REQUEST_BYTES)
        run.to = Math.max(run.to, r.to);
      else
        runs.push({ ...r });
    }
    let next = 0;
    const work = async () => {
      while (next < runs.length) {
        const run = runs[next++];
        run.data = await this.source.read(run.from, run.to - run.from);
      }
    };
    await Promise.all(Array.from({ length: Math.min(REQUESTS, runs.length) }, work));
    const piece = (from, to) => {
      if (to <= have)
        return this.head.subarray(from, to);
      const run = runs.find((r) => from >= r.from && to <= r.to);
      return run.data.subarray(from - run.from, to - run.from);
    };
    return ranges.map((r) => {
      const to = r.at + r.bytes;
      if (r.at >= have || to <= have)
        return piece(r.at, to);
      const out = new Uint8Array(r.bytes); // begins in the head's bytes and goes on behind them
      out.set(this.head.subarray(r.at, have));
      out.set(piece(have, to), have - r.at);
      return out;
    });
  }

  // Decoded chunks: wanted is [{ array, chunk }].
  async #chunks(wanted) {
    if (wanted.some(({ array }) => !array.chunks))
      await this.locate();
    const stored = await this.#fetch(wanted.map(({ array, chunk }) => array.chunks[chunk]));
    return Promise.all(stored.map(async (data, i) => {
      const { array, chunk } = wanted[i];
      const { bytes, fault } = await decodeChunk(data, array.pipeline, array.elementSize, array.chunkRows * array.rowBytes, this.zstd);
      if (fault)
        throw formatError(`${array.path}: chunk ${chunk}`, `the chunk is damaged: ${fault}`);
      return bytes;
    }));
  }

  // Whole arrays as stored before filters; absent ones are undefined. -> Map(path, bytes)
  async #raw(paths) {
    const arrays = paths.map((path) => this.arrays.get(path)).filter(Boolean);
    const wanted = arrays.flatMap(everyChunk);
    const chunks = await this.#chunks(wanted), out = new Map();
    let i = 0;
    for (const array of arrays) {
      const all = new Uint8Array(array.rows * array.rowBytes);
      for (let k = 0; k < array.chunkCount; k++, i++) {
        const at = k * array.chunkRows * array.rowBytes;
        all.set(chunks[i].subarray(0, all.length - at), at);
      }
      out.set(array.path, all);
    }
    return out;
  }

  // --- levels ---

  /**
   * Levels first .. last, in one go: as few requests as their bytes allow. With `faces`, their leaves' face lists too.
   * Each: { level, summary, groups, types, planeCounts, planes, leafWinding, blackWinding, whiteWinding, leafPlaneCounts, leafPlanes,
   *         leafFirst, leafNew, leafRefCount, leafRefs }
   * as typed arrays; undefined where the file has no such array (format-spec, section 4). Windings are Int32Array, leafRefs ascending.
   */
  async levels(first, last, { faces = false } = {}) {
    if (!(first >= 0 && first <= last && last < this.info.level_count))
      throw new EbpoError('ARGUMENT', `${this.source.name}: there are no levels ${first} to ${last}; the file has levels 0 to ${this.info.level_count - 1}`);
    try {
      const paths = [...this.arrays.values()].filter((a) => a.level >= first && a.level <= last && (faces || !FACE_TABLES.includes(a.name)));
      const raw = await this.#raw(paths.map((a) => a.path));
      return Array.from({ length: last - first + 1 }, (_, i) => this.#level(first + i, raw, faces));
    } catch (error) {
      throw named(this.source, error);
    }
  }

  /** The face lists of levels that were read without them; adds them to the levels' objects. */
  async addFaces(levels) {
    try {
      const raw = await this.#raw(levels.flatMap((l) => FACE_TABLES.map((name) => folder(l.level) + name)));
      for (const level of levels)
        this.#faces(level, raw);
    } catch (error) {
      throw named(this.source, error);
    }
  }

  #level(number, raw, faces) {
    const get = (name, Type) => this.#integers(raw, folder(number) + name, Type);
    const level = {
      level: number, summary: this.info.levels[number], groups: number ? this.info.levels[number - 1].gray : 1,
      types: get('types', Uint16Array), planeCounts: get('plane_counts', Uint8Array), planes: get('planes', Uint32Array),
      leafWinding: get('leaf_winding', Int32Array), blackWinding: get('black_winding', Int32Array), whiteWinding: get('white_winding', Int32Array),
      leafPlaneCounts: get('leaf_plane_counts', Uint8Array), leafPlanes: get('leaf_planes', Uint32Array),
    };
    checkLevel(this.info, level);
    checkIndexes(level, { types: get('types_index', Float64Array), gray: get('gray_index', Float64Array) });
    if (faces)
      this.#faces(level, raw);
    return level;
  }

  #faces(level, raw) {
    if (!this.info.parts.has('mesh'))
      return;
    const get = (name, Type) => this.#integers(raw, folder(level.level) + name, Type);
    decodeLeaves(this.info, level, { skip: get('leaf_skip', Float64Array), fresh: get('leaf_new', Uint32Array), refCount: get('leaf_ref_count', Uint32Array),
      refs: get('leaf_refs', Uint32Array), index: get('leaf_index', Float64Array) });
  }

  // An array's integers, widened to Type (Float64Array holds those of 64 bits).
  #integers(raw, path, Type) {
    const array = this.arrays.get(path), bytes = raw.get(path);
    if (!bytes)
      return undefined;
    const values = this.#typed(array, bytes);
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

  #typed(array, bytes) {
    const Stored = { 1: [Uint8Array, Int8Array], 2: [Uint16Array, Int16Array], 4: [Uint32Array, Int32Array], 8: [BigUint64Array] }[array.elementSize][+array.signed];
    return new Stored(bytes.buffer, bytes.byteOffset, bytes.length / array.elementSize);
  }

  // --- the mesh ---

  #needMesh() {
    if (!this.info.parts.has('mesh'))
      throw new EbpoError('ABSENT', `${this.source.name}: the file was written without its mesh; convert it again with it`);
  }

  /** The whole mesh: { vertices: Float32Array or Float64Array, faces: Uint32Array }, three numbers each. */
  async mesh() {
    this.#needMesh();
    try {
      const vertices = this.arrays.get('/mesh/vertices'), faces = this.arrays.get('/mesh/faces'), index = await this.#facesIndex();
      const chunks = await this.#chunks([...everyChunk(vertices), ...everyChunk(faces)]);
      const out = { vertices: new (vertices.elementSize === 8 ? Float64Array : Float32Array)(vertices.rows * 3), faces: new Uint32Array(faces.rows * 3) };
      vertices.chunks.forEach((_, i) => out.vertices.set(decodeVertices(chunks[i], vertices, i), i * vertices.chunkRows * 3));
      faces.chunks.forEach((_, i) => out.faces.set(decodeFaces(chunks[vertices.chunks.length + i], faces, i, index, this.info.vertex_count), i * faces.chunkRows * 3));
      return out;
    } catch (error) {
      throw named(this.source, error);
    }
  }

  /**
   * Some faces: `numbers` are face numbers, the answer their corners: Float64Array, nine numbers each. Fetches the chunks that hold them, twice:
   * faces, then vertices. Decoded chunks
   * stay in a cache of 96 MiB.
   */
  async facesByNumber(numbers) {
    this.#needMesh();
    try {
      const corners = new Uint32Array(numbers.length * 3), out = new Float64Array(numbers.length * 9);
      await this.#gather('/mesh/faces', numbers, corners);
      await this.#gather('/mesh/vertices', corners, out);
      return out;
    } catch (error) {
      throw named(this.source, error);
    }
  }

  // Values of chunks, through the cache: wanted is [{ array, chunk }], of any arrays; fetched together. -> [typed array]
  async #values(wanted) {
    const found = wanted.map(({ array, chunk }) => {
      const key = `${array.path} ${chunk}`, hit = this.cache.get(key);
      if (hit) {
        this.cache.delete(key); // to the young end
        this.cache.set(key, hit);
      }
      return hit;
    });
    const missing = wanted.filter((_, i) => !found[i]);
    const index = missing.some(({ array }) => array.path === '/mesh/faces') ? await this.#facesIndex() : undefined;
    const raw = await this.#chunks(missing);
    const fresh = raw.map((bytes, i) => {
      const { array, chunk } = missing[i];
      const values = array.path === '/mesh/faces' ? decodeFaces(bytes, array, chunk, index, this.info.vertex_count)
        : array.path === '/mesh/vertices' ? decodeVertices(bytes, array, chunk) : this.#typed(array, bytes);
      this.#remember(`${array.path} ${chunk}`, values);
      return values;
    });
    return found.map((values) => values ?? fresh.shift());
  }

  async #gather(path, rows, out) {
    const array = this.arrays.get(path), chunkOf = (row) => Math.floor(row / array.chunkRows), wanted = new Set();
    for (const row of rows)
      wanted.add(chunkOf(row));
    const numbers = [...wanted], values = await this.#values(numbers.map((chunk) => ({ array, chunk })));
    const chunks = new Map(numbers.map((chunk, i) => [chunk, values[i]]));
    for (let i = 0; i < rows.length; i++) {
      const chunk = chunkOf(rows[i]), from = chunks.get(chunk), at = 3 * (rows[i] - chunk * array.chunkRows);
      for (let k = 0; k < 3; k++)
        out[3 * i + k] = from[at + k];
    }
  }

  // Parts of one-dimensional arrays: wanted is [{ path, from, to }] in elements -> [typed array]; undefined for absent arrays.
  async #parts(wanted) {
    const chunks = [];
    for (const { path, from, to } of wanted) {
      const array = this.arrays.get(path);
      for (let chunk = array ? Math.floor(from / array.chunkRows) : 0; array && chunk * array.chunkRows < to; chunk++)
        chunks.push({ array, chunk });
    }
    const values = await this.#values(chunks);
    return wanted.map(({ path, from, to }) => {
      const array = this.arrays.get(path);
      if (!array)
        return undefined;
      let out;
      chunks.forEach(({ array: of, chunk }, i) => {
        const begin = chunk * array.chunkRows, low = Math.max(from, begin), high = Math.min(to, begin + array.chunkRows);
        if (of === array && low < high) {
          out ??= new values[i].constructor(to - from);
          out.set(values[i].subarray(low - begin, high - begin), low - from);
        }
      });
      return out;
    });
  }

  /**
   * The face lists of leaves 4096 * block .. of a level, without reading the others': { first, fresh, refCount, refBegin, refs }, the arrays by
   * the leaf's place in the block. A leaf's faces are first .. first + fresh - 1 and refs[refBegin] .. refs[refBegin + refCount - 1].
   */
  async leafBlock(level, block) {
    this.#needMesh();
    try {
      const s = this.info.levels[level], from = block * INDEX_ROWS, to = Math.min(s.leaf, from + INDEX_ROWS), at = folder(level);
      if (!(from >= 0 && from < to))
        throw new EbpoError('ARGUMENT', `${this.source.name}: level ${level} has no leaf ${from}`);
      const [skip, fresh, refCount] = await this.#parts(['leaf_skip', 'leaf_new', 'leaf_ref_count'].map((name) => ({ path: at + name, from, to })));
      const rows = await this.#whole(at + 'leaf_index');
      const begin = rows ? rows[block * 3 + 1] : 0, next = rows?.length > block * 3 + 3 ? rows[block * 3 + 4] : s.faces_referenced;
      if (begin > next || next > s.faces_referenced)
        throw formatError(at + 'leaf_index', 'the index contradicts the arrays that it is about');
      const [refs] = next > begin ? await this.#parts([{ path: at + 'leaf_refs', from: begin, to: next }]) : [new Uint32Array(0)];
      return decodeLeafBlock(this.info, level, { start: rows ? rows[block * 3] : 0, skip, fresh, refCount, refs });
    } catch (error) {
      throw named(this.source, error);
    }
  }

  /** The faces of leaves (nodes of tree.js), nine numbers each: [Float64Array], and their numbers as `.numbers` of each. */
  async leafFaces(leaves) {
    const keys = [...new Set(leaves.map((leaf) => `${leaf.level} ${Math.floor(leaf.rank / INDEX_ROWS)}`))];
    const blocks = new Map(await Promise.all(keys.map(async (key) => [key, await this.leafBlock(...key.split(' ').map(Number))])));
    const lists = leaves.map((leaf) => {
      const b = blocks.get(`${leaf.level} ${Math.floor(leaf.rank / INDEX_ROWS)}`), i = leaf.rank % INDEX_ROWS;
      return [...b.refs.subarray(b.refBegin[i], b.refBegin[i] + b.refCount[i]), ...Array.from({ length: b.fresh[i] }, (_, k) => b.first[i] + k)];
    });
    const all = await this.facesByNumber(lists.flat());
    let at = 0;
    return lists.map((numbers) => Object.assign(all.subarray(at * 9, (at += numbers.length) * 9), { numbers }));
  }

  // A small array of 64-bit numbers, read once.
  #whole(path) {
    this.small ??= new Map();
    if (!this.small.has(path))
      this.small.set(path, this.#raw([path]).then((raw) => this.#integers(raw, path, Float64Array)));
    return this.small.get(path);
  }

  #remember(key, values) {
    if (this.cache.has(key)) // two callers wanted it at once
      return;
    this.cache.set(key, values);
    this.cached += values.byteLength;
    for (const [old, { byteLength }] of this.cache) {
      if (this.cached <= CACHE_BYTES)
        break;
      this.cache.delete(old);
      this.cached -= byteLength;
    }
  }

  async #facesIndex() {
    return await this.#whole('/mesh/faces_index') ?? Float64Array.of(0);
  }

  /** { vertexSource, faceSource }: Uint32Array, the source's numbers. */
  async maps() {
    if (!this.info.parts.has('maps'))
      throw new EbpoError('ABSENT', `${this.source.name}: the file was written without its maps to the source's numbers; convert it again with them`);
    try {
      const raw = await this.#raw(['/maps/vertex_source', '/maps/face_source']), i = this.info;
      return { vertexSource: decodeMap(raw.get('/maps/vertex_source'), this.arrays.get('/maps/vertex_source'), i.source_vertex_count),
        faceSource: decodeMap(raw.get('/maps/face_source'), this.arrays.get('/maps/face_source'), i.source_face_count + i.mend_added_faces) };
    } catch (error) {
      throw named(this.source, error);
    }
  }

  // --- everything ---

  /** Checks that the leaves of all levels (read with `faces`) have every face as a new one once, in depth-first order. */
  checkOrder(levels) {
    try {
      checkOrder(this.info, levels);
    } catch (error) {
      throw named(this.source, error);
    }
  }

  /** Compares content_sha256 (format-spec, section 8). Reads the whole file. In a page: only over https and from localhost. */
  async verifyContent() {
    const { subtle } = globalThis.crypto ?? (await import('node:crypto')).webcrypto;
    const paths = [...this.arrays.keys()].sort(), parts = [];
    for (const path of paths) {
      const raw = await this.#raw([path]);
      parts.push(new TextEncoder().encode(path + '\0'), new Uint8Array(await subtle.digest('SHA-256', raw.get(path))));
    }
    const all = new Uint8Array(parts.reduce((sum, p) => sum + p.length, 0));
    parts.reduce((at, p) => (all.set(p, at), at + p.length), 0);
    const digest = new Uint8Array(await subtle.digest('SHA-256', all));
    if ([...digest].map((b) => b.toString(16).padStart(2, '0')).join('') !== this.info.content_sha256)
      throw named(this.source, formatError('', 'the content is not what content_sha256 says: the file was changed', 'get a fresh copy'));
  }
}

const everyChunk = (array) => Array.from({ length: array.chunkCount }, (_, chunk) => ({ array, chunk }));

// An array's object against what the facts call for.
function describe(hdf5, wanted, linked, address, info) {
  const { path, rows, cols } = wanted;
  if (!linked)
    throw formatError(path, 'the array is missing');
  const o = address === undefined ? undefined : hdf5.object(address, path);
  if (o?.kind !== 'array')
    throw formatError(path, 'this is not an array');
  if (o.type.class !== 'integer' || !o.type.little || ![1, 2, 4, 8].includes(o.type.size))
    throw formatError(path, 'the array is not of little-endian integers');
  if (o.space.rank < 1 || o.space.rank > 2 || !o.space.fixed || o.space.dims.includes(0))
    throw formatError(path, 'the array does not have one or two fixed dimensions');
  if (!o.layout.chunked)
    throw formatError(path, 'the array is not stored in chunks');
  const elementSize = o.type.size, fit = chunkRows(o.space.dims[0], o.space.dims[1] ?? 0, elementSize);
  const chunk = [fit, ...o.space.dims.slice(1)];
  if (o.layout.elementSize !== elementSize || chunk.length !== o.layout.chunk.length || chunk.some((n, i) => n !== o.layout.chunk[i]))
    throw formatError(path, "the array's chunks do not have the size that the format fixes");
  const pipeline = pipelineOf(o.filters, elementSize);
  if (!pipeline)
    throw formatError(path, "the array's filters are none of the format's");
  if (o.space.dims[0] !== rows)
    throw formatError(path, "the array's length contradicts the counts in the head");
  if ((o.space.dims[1] ?? 0) !== cols || !wanted.sizes.includes(elementSize) || o.type.signed !== wanted.signed)
    throw formatError(path, 'the array has the wrong type or the wrong number of columns');
  if (path === '/mesh/vertices' && elementSize !== (info.coordinate_type === 'float64' ? 8 : 4))
    throw formatError(path, "the array's type contradicts coordinate_type");
  const rowBytes = elementSize * Math.max(cols, 1), whole = fit * rowBytes;
  if (whole > CHUNK_BYTES_MAX)
    throw formatError(path, "the array's chunks do not have the size that the format fixes");
  return { path, level: wanted.level, name: wanted.name, rows, cols, elementSize, signed: o.type.signed, chunkRows: fit, chunkCount: Math.ceil(rows / fit), rowBytes, pipeline,
    object: o, indexed: o.layout.index !== 1, chunks: undefined, bytes: undefined };
}
