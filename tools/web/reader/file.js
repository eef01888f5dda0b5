// Reads an EBP-Octree file: facts, levels, mesh. Bytes are fetched when needed; neighbouring ranges share a request.
import { CHUNK_BYTES_MAX, chunkBound, pipelineOf } from './chunk.js';
import { EbpoError, foreignError, formatError } from './error.js';
import { chooseColours, columnPaths, describeColumns } from './colours.js';
import { CHUNK_SUMS, INDEX_ROWS, PLACES, arraysOf, attributesFacts, checkCoding, checkFacts, chunkRows, chunkRowsFit, isList, readFacts, readLevelFacts } from './facts.js';
import { GATES_COLS } from './gates.js';
import { Hdf5, NeedBytes } from './hdf5.js';
import { checkIndexes, checkLevel, checkOrder, decodeFaces, decodeLeaves, decodeMap, decodeVertices, recode } from './decode.js';
import { Parts } from './parts.js';
import { arrayNumber, isListValid, readDirectory, statesSize } from './chunk_directory.js';
import { sourceOf } from './source.js';
import { Store, everyChunk } from './store.js';

const AHEAD_BYTES = 1024 * 1024, HEAD_BYTES = 128 * 1024, HEAD_BYTES_MOST = 256 * 1024 * 1024, INDEX_BYTES_MOST = 256 * 1024 * 1024;
const LIST_BYTES_MOST = 128 * 1024 * 1024;

const FACE_TABLES = ['leaf_skip', 'leaf_new', 'leaf_ref_count', 'leaf_refs', 'leaf_index'];
const folder = (level) => `/levels/${String(level).padStart(2, '0')}/`;

/**
 * Opens a file: a URL (text or URL), a File or Blob, an ArrayBuffer, a Uint8Array (also a Node.js Buffer), or a source (source.js).
 * Options: those of UrlSource, and
 *   `ahead`       bytes of the first request, 1 MiB by default; its response contains small files completely, and the upper levels of large files
 *   `zstd`        a decoder from loadZstd(), or a promise of a decoder
 *   `headBytes`   number of bytes of the first response to wait for, 128 KiB by default
 *   `cacheBytes`  size limit of the cache of decoded chunks, 64 MiB by default
 * @returns {Promise<EbpoFile>}
 */
export async function openEbpo(what, options = {}) {
  const source = sourceOf(what, { ahead: options.headBytes ?? AHEAD_BYTES, ...options });
  try {
    const file = new EbpoFile(source, options);
    await file.openHead(options.headBytes ?? HEAD_BYTES);
    if (file.arrays.get('/levels/00/types').pipeline === 'bare') // chunks without checksums: only the checksum of all content detects damage
      await file.verifyContent();
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
    this.options = options;
    this.info = undefined;   // facts.js: attributes by name, `levels`, `parts`, `solid`
    this.colours = undefined; // colours.js: the arrays of the mesh's colours
    this.arrays = new Map(); // path: { path, rows, cols, elementSize, signed, chunkRows, chunkCount, pipeline, chunks, bytes }; chunks and bytes are undefined until located
  }

  /** Returns the requests made and bytes received so far. */
  get traffic() {
    return { requests: this.source.requests, bytes: this.source.bytes };
  }

  // --- the header ---

  async openHead(bytes) {
    const { source } = this;
    this.head = await source.open(bytes);
    for (let known = false; !known;)
      try {
        this.#parse();
        known = true;
      } catch (error) {
        if (!(error instanceof NeedBytes))
          throw error;
        const { length } = this.head, coming = source.coming > length ? source.coming : source.size; // prefer bytes that are already loading to another request
        await this.#moreHead(Math.min(source.size, Math.max(error.end, Math.min(2 * length, coming))));
      }
    this.store = new Store(this.info, this.arrays, source, this.head, { zstd: this.options.zstd, budget: this.options.cacheBytes });
    this.parts = new Parts(this.store);
  }

  async #moreHead(size) {
    if (size > HEAD_BYTES_MOST)
      throw formatError('', 'its header is larger than any valid file needs');
    const more = await this.source.read(this.head.length, size - this.head.length), all = new Uint8Array(size);
    all.set(this.head);
    all.set(more, this.head.length);
    this.head = all;
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
    for (const part of ['mesh', 'maps', 'subtrees'])
      if (info.parts.has(part))
        group(`/${part}`, root.links.get(part));
    const arrays = new Map();
    for (const wanted of arraysOf(info)) {
      const cut = wanted.path.lastIndexOf('/'), links = objects.get(wanted.path.slice(0, cut) || '/').links, name = wanted.path.slice(cut + 1);
      if (wanted.mayBeAbsent && !links.has(name))
        continue;
      if (wanted.path === CHUNK_SUMS && !statesSize(hdf5, links.get(name), wanted.path, this.source.size))
        continue; // left by a program that rewrote the file
      arrays.set(wanted.path, describe(hdf5, wanted, links.has(name), links.get(name), info));
    }
    if (info.parts.has('attributes') && arrays.get('/levels/00/types').pipeline !== 'bare') // without chunk checksums, the attributes' checksum would have to be compared
      this.colours = this.#findColours(hdf5, group('/attributes', root.links.get('attributes')), info, arrays);
    for (const array of arrays.values())
      if (array.pipeline !== arrays.get('/levels/00/types').pipeline &&
          (array.path !== CHUNK_SUMS || isListValid(array, this.source.size)))
        throw foreignError(array.path, "the array's filters differ from those of the file's first array");
    const counts = arrays.get('/subtrees/counts');
    if (counts && arrays.get('/subtrees/index').rows !== counts.chunkCount)
      throw formatError('/subtrees/index', "the array's length contradicts the chunks of counts");
    this.info = info;
    this.arrays = arrays;
    this.hdf5 = hdf5;
    this.#placeArrays((array) => !array.indexed); // the header of an array with a single chunk has the chunk offset
    if (arrays.has(PLACES))
      return; // the file has a list of all chunks
    try {
      this.#placeArrays((array) => array.indexed);
    } catch (error) {
      if (!(error instanceof NeedBytes)) // otherwise the index is not part of the loaded header
        throw error;
    }
  }

  // Only colours are read from the attributes.
  #findColours(hdf5, group, info, arrays) {
    const described = columnPaths(attributesFacts(group.attributes, '/attributes').count()).map((path) => {
      const address = group.links.get(path.slice(-3)), o = address === undefined ? undefined : hdf5.object(address, path);
      if (o?.kind !== 'array')
        throw formatError(path, 'this is not an array');
      const { text, isList, range } = attributesFacts(o.attributes, path), columns = describeColumns(path, text, isList);
      return columns && { ...columns, address, range };
    }).filter(Boolean);
    const colours = chooseColours(described);
    for (const path of new Set(colours?.channels.map((c) => c.path))) {
      const columns = described.find((d) => d.path === path), { names, element, elementSize } = columns;
      const wanted = { path, name: path, cols: names.length > 1 ? names.length : 0, sizes: [elementSize], signed: false, rows: element === 'face' ? info.face_count : info.vertex_count };
      arrays.set(path, { ...describe(hdf5, wanted, true, columns.address, info), columns });
    }
    return colours;
  }

  #placeArrays(which) {
    for (const array of this.arrays.values())
      if (!array.chunks && which(array))
        place(array, this.hdf5.chunks(array.object, array.path, array.chunkCount, array.chunkRows * array.stored.rowBytes, array.chunkMost));
    this.#checkRoom();
  }

  #checkRoom() {
    if ([...this.arrays.values()].reduce((sum, a) => sum + (a.bytes ?? 0), 0) > this.source.size)
      throw formatError('', "the arrays' chunks take more space than the file has");
  }

  /** Returns true when all chunk offsets are known. Arrays of several chunks have an index; files with subtrees have a directory of all chunks. */
  get located() {
    return [...this.arrays.values()].every((a) => a.chunks);
  }

  /** Fetches the chunk offsets unless they are known. Reading does this automatically when needed. */
  async locate() {
    if (this.located)
      return;
    this.locating ??= this.#readDirectory().then((found) => found || this.#readIndex()).finally(() => (this.locating = undefined));
    await this.locating;
  }

  async #readDirectory() {
    const places = this.arrays.get(PLACES);
    if (!places || !isListValid(places, this.source.size))
      return false;
    try {
      const [bytes] = await Promise.all(this.store.cache.decoded([{ array: places, chunk: 0 }]));
      const others = [...this.arrays.values()].filter((a) => !a.list);
      for (const [array, chunks] of readDirectory(new Uint32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4), others, this.source.size))
        if (!array.chunks)
          place(array, chunks);
      this.#checkRoom();
      return true;
    } catch (error) {
      throw named(this.source, error);
    }
  }

  async #readIndex() {
    const { chunk_index_offset: at, chunk_index_bytes: bytes } = this.info;
    let piece = at > 0 && bytes > 0 && bytes <= INDEX_BYTES_MOST && at + bytes <= this.source.size ? { at, end: at + bytes } : undefined;
    for (;;) {
      if (piece) {
        const [data] = await Promise.all(this.store.cache.fetch([{ at: piece.at, bytes: piece.end - piece.at }]));
        this.hdf5.piece = { at: piece.at, data };
      }
      try {
        this.#placeArrays(() => true);
        this.hdf5.piece = undefined;
        return;
      } catch (error) {
        if (!(error instanceof NeedBytes))
          throw named(this.source, error);
        // Another program wrote the file: read growing ranges around the missing bytes.
        const from = Math.min(piece?.at ?? error.at, error.at), to = Math.max(piece?.end ?? error.end, error.end);
        piece = { at: from, end: Math.min(this.source.size, from + 2 * (to - from) + 128 * 1024) };
        if (piece.end - piece.at > INDEX_BYTES_MOST)
          throw named(this.source, formatError('', 'its chunk indexes are too far apart to be read at once'));
      }
    }
  }

  /** Returns the bytes from the beginning of the file to the end of a level. NaN while the chunk offsets are unknown (`located`). */
  bytesToLevel(level) {
    const arrays = [...this.arrays.values()].filter((a) => a.level <= level), places = (a) => a.chunks?.map((c) => c.at + c.bytes) ?? [NaN];
    if (!this.info.parts.has('subtrees'))
      return arrays.reduce((end, a) => places(a).reduce((most, at) => Math.max(most, at), end), 0); // NaN stays NaN
    const begin = Math.min(...arrays.map((a) => a.chunks?.[0].at ?? Infinity));
    return arrays.reduce((sum, a) => sum + (a.bytes ?? NaN), begin);
  }

  // Reads whole arrays as stored; absent arrays are undefined. Returns Map(path, bytes).
  async #raw(paths) {
    await this.#findChunks(paths);
    return this.store.raw(paths);
  }

  async #findChunks(paths) {
    if (paths.some((path) => this.arrays.has(path) && !this.arrays.get(path).chunks))
      await this.locate();
  }

  // Adds the file's name to errors.
  async #named(work) {
    try {
      return await work();
    } catch (error) {
      throw named(this.source, error);
    }
  }

  // --- levels ---

  /**
   * Reads levels first .. last in as few requests as possible. With `faces`, reads the face lists of their leaves too.
   * Each: { level, summary, groups, types, planeCounts, planes, leafWinding, blackWinding, whiteWinding, leafPlaneCounts, leafPlanes,
   *         leafFirst, leafNew, leafRefCount, leafRefs }
   * as typed arrays; undefined where the file has no such array (format-spec, section 6). Windings are Int32Array, leafRefs ascending.
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

  /** Reads the face lists of levels that were read without them, and adds the lists to the levels' objects. */
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
    const get = (name, Type) => this.store.integers(raw, folder(number) + name, Type);
    const level = {
      level: number, summary: this.info.levels[number], groups: number ? this.info.levels[number - 1].gray : 1,
      types: get('types', Uint16Array), planeCounts: get('plane_counts', Uint8Array), planes: get('planes', Uint32Array),
      leafWinding: get('leaf_winding', Int32Array), blackWinding: get('black_winding', Int32Array), whiteWinding: get('white_winding', Int32Array),
      leafPlaneCounts: get('leaf_plane_counts', Uint8Array), leafPlanes: get('leaf_planes', Uint32Array),
      grayColours: get('gray_colours', Uint32Array),
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
    const get = (name, Type) => this.store.integers(raw, folder(level.level) + name, Type);
    decodeLeaves(this.info, level, { skip: get('leaf_skip', Float64Array), fresh: get('leaf_new', Uint32Array), refCount: get('leaf_ref_count', Uint32Array),
      refs: get('leaf_refs', Uint32Array), index: get('leaf_index', Float64Array) });
  }

  // --- parts of levels ---

  /**
   * Reads nodes of parts of levels in one batch, as segments for Tree.addPart(). `wanted` is [{ level, part }] from Tree.partOf(). With `planes`, reads the
   * data for drawing; otherwise the data for exact queries, which include the winding numbers of leaves.
   */
  async nodeParts(wanted, { planes = true } = {}) {
    return this.#named(async () => {
      await this.locate();
      return this.parts.segments(await this.parts.nodes(wanted), planes);
    });
  }

  /** Returns the number of bytes that nodeParts() would fetch. */
  async costOfParts(wanted, { planes = true } = {}) {
    return this.#named(async () => {
      await this.locate();
      const described = await this.parts.nodes(wanted);
      return this.store.cache.cost(this.store.chunksOf(described.flatMap((d) => this.parts.nodeRanges(d, planes))));
    });
  }

  /**
   * Reads the data of subtrees for exact queries in one batch. Subtrees are numbered by the ranks of their roots in level `subtree_level`. Returns their nodes,
   * [{ level, part, segment }], without planes; lists, faces and vertices are kept for leafFaces().
   */
  async subtrees(numbers) {
    return this.#named(async () => {
      await this.locate();
      const { info, parts, store } = this, below = Array.from({ length: info.level_count - 1 - info.subtree_level }, (_, i) => info.subtree_level + 1 + i);
      const rows = [...(await parts.subtrees.rows(numbers)).values()], wanted = rows.flatMap((row) => below.filter((l) => row.level(l).groups).map((level) => ({ level, part: row.subtree })));
      const nodes = await parts.nodes(wanted), lists = info.parts.has('mesh') ? (await parts.lists(wanted)).filter((d) => d.count) : [];
      const prefetched = store.cache.get([...store.chunksOf(lists.flatMap((d) => parts.listRanges(d))), ...(lists.length ? await parts.subtrees.blocks(rows) : [])]);
      const [segments] = await Promise.all([parts.segments(nodes, false), prefetched]);
      return wanted.map((w, i) => ({ ...w, segment: segments[i] }));
    });
  }

  // --- the mesh ---

  #needMesh() {
    if (!this.info.parts.has('mesh'))
      throw new EbpoError('ABSENT', `${this.source.name}: the file has no mesh; convert the model again with its mesh`);
  }

  /** Reads the whole mesh: { vertices: Float32Array or Float64Array, faces: Uint32Array }, three numbers each. */
  async mesh() {
    this.#needMesh();
    return this.#named(async () => {
      const vertices = this.arrays.get('/mesh/vertices'), faces = this.arrays.get('/mesh/faces');
      await this.#findChunks([vertices.path, faces.path, '/mesh/faces_index']);
      const index = await this.store.facesIndex();
      const out = { vertices: new (vertices.elementSize === 8 ? Float64Array : Float32Array)(vertices.rows * 3), faces: new Uint32Array(faces.rows * 3) };
      const wanted = [...everyChunk(vertices), ...everyChunk(faces)];
      await Promise.all(this.store.cache.decoded(wanted).map(async (promise, i) => {
        const { array, chunk } = wanted[i], bytes = await promise;
        const values = array === vertices ? decodeVertices(bytes, array, chunk) : decodeFaces(bytes, array, chunk, index, this.info.vertex_count);
        (array === vertices ? out.vertices : out.faces).set(values, chunk * array.chunkRows * 3);
      }));
      return out;
    });
  }

  /** Reads faces by their face numbers. Returns their corners: Float64Array, nine numbers each. Fetches the chunks of faces, then those of vertices. */
  async facesByNumber(numbers) {
    this.#needMesh();
    return this.#named(async () => {
      await this.#findChunks(['/mesh/faces', '/mesh/vertices', '/mesh/faces_index']);
      const corners = new Uint32Array(numbers.length * 3), out = new Float64Array(numbers.length * 9);
      await this.store.triples('/mesh/faces', numbers, corners);
      const colours = this.#coloursOf(numbers, corners);
      await this.store.triples('/mesh/vertices', corners, out);
      out.colours = await colours;
      return out;
    });
  }

  // Reads red, green and blue of each corner: nine bytes for each face.
  async #coloursOf(numbers, corners) {
    if (!this.colours)
      return undefined;
    const { element, channels } = this.colours, rows = element === 'vertex' ? corners : numbers, out = new Uint8Array(9 * numbers.length);
    const values = await Promise.all(channels.map(({ path, column }) => this.store.column(path, column, rows)));
    for (let corner = 0; corner < corners.length; corner++)
      for (let k = 0; k < 3; k++)
        out[3 * corner + k] = values[k][element === 'vertex' ? corner : Math.floor(corner / 3)];
    return out;
  }

  // Returns the rows of colours that subtrees own.
  #colourRanges(rows) {
    const own = this.colours?.element === 'vertex' ? (r) => [r.firstVertex, r.vertices] : (r) => [r.firstFace, r.faces];
    return (this.colours?.channels ?? []).flatMap(({ path }) => rows.map((r) => ({ path, from: own(r)[0], to: own(r)[0] + own(r)[1] })));
  }

  /**
   * Reads only the face lists of at most 4,096 leaves of a level, from leaf 4096 * block on: { first, fresh, refCount, refBegin, refs }, arrays indexed by
   * the leaf's position in the block. A leaf's faces are first to first + fresh - 1, and refs[refBegin] to refs[refBegin + refCount - 1].
   */
  async leafBlock(level, block) {
    this.#needMesh();
    if (!(block >= 0 && block * INDEX_ROWS < this.info.levels[level]?.leaf))
      throw new EbpoError('ARGUMENT', `${this.source.name}: level ${level} has no leaf ${block * INDEX_ROWS}`);
    return this.#named(async () => {
      await this.locate();
      return (await this.parts.decodeLists([await this.parts.block(level, block)]))[0];
    });
  }

  /**
   * Reads the faces of leaves (nodes of tree.js): one Float64Array for each leaf, with nine numbers for each face. The member `numbers` of each array has the
   * face indices, and `colours`, if the file has colours, red, green and blue of each corner, 0 to 255. The lists, faces and vertices of a subtree are fetched
   * in one batch.
   */
  async leafFaces(leaves) {
    this.#needMesh();
    return this.#named(async () => {
      await this.locate();
      const { parts, store } = this, wanted = new Map(), keyOf = (leaf) => leaf.level * 2 ** 40 + parts.partOfLeaf(leaf);
      for (const leaf of leaves)
        wanted.set(keyOf(leaf), { level: leaf.level, part: parts.partOfLeaf(leaf) });
      const described = await parts.lists([...wanted.values()]);
      const subtrees = [...new Set(described.filter((d) => parts.bySubtree(d.level)).map((d) => d.part))];
      if (subtrees.length) {
        const rows = [...(await parts.subtrees.rows(subtrees)).values()];
        await store.cache.get([...store.chunksOf([...described.flatMap((d) => parts.listRanges(d)), ...this.#colourRanges(rows)]), ...await parts.subtrees.blocks(rows)]);
      }
      const decoded = await parts.decodeLists(described), lists = new Map([...wanted.keys()].map((key, i) => [key, decoded[i]]));
      const numbers = leaves.map((leaf) => numbersOf(lists.get(keyOf(leaf)), leaf.rank)), all = new Uint32Array(numbers.reduce((sum, n) => sum + n.length, 0));
      numbers.reduce((at, n) => (all.set(n, at), at + n.length), 0);
      const faces = await this.facesByNumber(all);
      let at = 0;
      return numbers.map((n) => {
        const from = at * 9, to = (at += n.length) * 9;
        return Object.assign(faces.subarray(from, to), { numbers: n, colours: faces.colours?.subarray(from, to) });
      });
    });
  }

  /** Reads the maps { vertexSource, faceSource }: Uint32Array, indices in the source mesh. */
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

  /** Returns the source indices of faces from their indices in the file, without reading the whole map. Indices from `source_face_count` on are faces that the repair added. */
  async sourceFaces(numbers) {
    if (!this.info.parts.has('maps'))
      throw new EbpoError('ABSENT', `${this.source.name}: the file was written without its maps to the source's numbers; convert it again with them`);
    return this.#named(async () => {
      await this.#findChunks(['/maps/face_source']);
      return this.store.column('/maps/face_source', 0, numbers, Uint32Array);
    });
  }

  // --- checks of the whole file ---

  /** Checks that the leaves of all levels (read with `faces`) list every face as new exactly once, in depth-first order. */
  checkOrder(levels) {
    try {
      checkOrder(this.info, levels);
    } catch (error) {
      throw named(this.source, error);
    }
  }

  /** Compares content_sha256, colours_sha256 and border_sha256 (format-spec/checksums.md). Reads the whole file. Pages can use it only over https and from localhost. */
  async verifyContent() {
    const isBorder = (path) => path.startsWith('/border/') || (!this.info.solid && path.endsWith('_winding'));
    const of = (path) => (isBorder(path) ? 'border_sha256' : path.endsWith('/gray_colours') ? 'colours_sha256' : 'content_sha256');
    const paths = [...this.arrays.keys()].filter((p) => !isList(p) && !/^\/(subtrees|attributes)\//.test(p)).sort();
    for (const name of ['content_sha256', 'colours_sha256', 'border_sha256'].filter((n) => this.info[n])) {
      if (await this.#checksum(paths.filter((p) => of(p) === name)) !== this.info[name])
        throw named(this.source, formatError('', `the content does not match ${name}: the file was changed`, 'get a fresh copy'));
    }
  }

  async #checksum(paths) {
    const digest = await sha256(), parts = [];
    for (const path of paths) {
      const bytes = this.#digested(path, (await this.#raw([path])).get(path));
      if (bytes)
        parts.push(new TextEncoder().encode(path + '\0'), await digest(bytes));
    }
    const all = new Uint8Array(parts.reduce((sum, p) => sum + p.length, 0));
    parts.reduce((at, p) => (all.set(p, at), at + p.length), 0);
    return [...await digest(all)].map((b) => b.toString(16).padStart(2, '0')).join('');
  }

  // Returns the bytes of an array for the digest: the array as stored in a file without subtrees. Files with subtrees have smaller chunks.
  #digested(path, bytes) {
    const array = this.arrays.get(path), rows = chunkRows(array.rows, array.cols, array.elementSize);
    if (!this.info.parts.has('subtrees'))
      return bytes;
    if (path === '/mesh/faces_index')
      return this.info.face_count > 4096 ? new Uint8Array(new BigUint64Array(bytes.buffer).filter((_, i) => i % 2 === 0).buffer) : undefined;
    return path === '/mesh/vertices' || path === '/border/points' || path.startsWith('/maps/') ? recode(bytes, array, rows) : bytes;
  }
}

// Computes SHA-256 with the platform's function: bytes -> Uint8Array. Only old Node.js lacks the global; browser bundlers need not resolve this import.
async function sha256() {
  const node = 'node:crypto', { subtle } = globalThis.crypto ?? (await import(/* @vite-ignore */ /* webpackIgnore: true */ node)).webcrypto;
  return async (bytes) => new Uint8Array(await subtle.digest('SHA-256', bytes));
}

// Returns the indices of a leaf's faces, ascending.
function numbersOf(lists, rank) {
  const i = rank - lists.begin, refs = lists.refCount[i], out = new Uint32Array(refs + lists.fresh[i]);
  for (let k = 0; k < refs; k++)
    out[k] = lists.refs[lists.refBegin[i] + refs - 1 - k];
  for (let k = 0; k < lists.fresh[i]; k++)
    out[refs + k] = lists.first[i] + k;
  return out;
}

function place(array, chunks) {
  array.chunks = chunks;
  array.bytes = chunks.reduce((sum, c) => sum + c.bytes, 0);
}

// Checks an array's object against the facts.
function describe(hdf5, wanted, linked, address, info) {
  const { path, cols, gates } = wanted;
  if (!linked)
    throw formatError(path, 'the array is missing');
  const o = address === undefined ? undefined : hdf5.object(address, path);
  if (o?.kind !== 'array')
    throw formatError(path, 'this is not an array');
  if (o.type.class !== 'integer' || ![1, 2, 4, 8].includes(o.type.size))
    throw formatError(path, 'the array is not of little-endian integers');
  if (!o.type.little)
    throw foreignError(path, 'the array is not of little-endian integers');
  if (o.space.rank <= 2 && !o.space.fixed)
    throw foreignError(path, 'the array does not have fixed dimensions');
  if (o.space.rank < 1 || o.space.rank > 2 || !o.space.fixed || o.space.dims.includes(0))
    throw formatError(path, 'the array does not have one or two fixed dimensions');
  if (o.external)
    throw formatError(path, "the array's values are in another file (external storage), which is never read");
  if (o.layout.elsewhere)
    throw formatError(path, 'the array is virtual: its values are in other arrays, which are never read');
  if (!o.layout.chunked)
    throw foreignError(path, 'the array is not stored in chunks');
  if (o.layout.grows)
    throw foreignError(path, "the array's chunks have an index for extensible arrays");
  const elementSize = o.type.size, rows = wanted.rows ?? o.space.dims[0], [fit] = o.layout.chunk, chunk = [fit, ...o.space.dims.slice(1)];
  if (o.layout.elementSize !== elementSize || chunk.length !== o.layout.chunk.length || chunk.some((n, i) => n !== o.layout.chunk[i]) ||
      !chunkRowsFit(info, path, o.space.dims[0], o.space.dims[1] ?? 0, elementSize, fit))
    throw foreignError(path, "the array's chunks do not have the size that the format requires");
  const pipeline = pipelineOf(o.filters, elementSize);
  if (!pipeline)
    throw foreignError(path, "the array's filters are not supported by the format");
  if (o.space.dims[0] !== rows)
    throw formatError(path, "the array's length contradicts the counts in the header");
  if ((o.space.dims[1] ?? 0) !== (gates ? GATES_COLS : cols) || !(gates ? [1] : wanted.sizes).includes(elementSize) || o.type.signed !== wanted.signed)
    throw formatError(path, 'the array has the wrong type or the wrong number of columns');
  if ((path === '/mesh/vertices' || path === '/border/points') && elementSize !== (info.coordinate_type === 'float64' ? 8 : 4))
    throw formatError(path, "the array's type contradicts coordinate_type");
  checkCoding(o.attributes, path, gates);
  const storedRow = elementSize * Math.max(gates ? GATES_COLS : cols, 1), whole = fit * storedRow;
  if (whole > (isList(path) ? Math.min(LIST_BYTES_MOST, 2 * hdf5.size) : CHUNK_BYTES_MAX))
    throw formatError(path, "the array's chunks do not have the size that the format requires");
  return { path, number: arrayNumber(path, wanted.level, wanted.order), level: wanted.level, name: wanted.name, rows, cols,
    elementSize: gates ? 4 : elementSize, signed: o.type.signed, chunkRows: fit, chunkCount: Math.ceil(rows / fit), chunkMost: chunkBound(whole), gates,
    stored: { elementSize, rowBytes: storedRow }, rowBytes: gates ? 4 * cols : storedRow, pipeline,
    list: isList(path), object: o, indexed: o.layout.index !== 1, chunks: undefined, bytes: undefined };
}
