// Reads a file's header: root attributes, levels, and the table of arrays. format-spec/README.md, sections 5 and 6.
import { CHUNK_BYTES_MAX } from './chunk.js';
import { EbpoError, formatError } from './error.js';
import { text } from './hdf5.js';

export const LEVELS_MAX = 21, INDEX_ROWS = 4096;
const MESH_MAX = 2 ** 32 - 2, NODES_MAX = 2 ** 40;
const KNOWN_PARTS = ['levels', 'mesh', 'planes', 'maps', 'leaf-planes', 'attributes', 'colours', 'border', 'subtrees', 'gates', 'pruned'];

const WORDS = { kind: ['surface', 'solid'], winding_rule: ['nonzero', 'evenodd', 'positive'], coordinate_type: ['float32', 'float64'] };
const TEXTS = { source_name: 255, source_format: 15, unit: 31, crs: 255, date: 31 }; // most bytes
const FLAGS = ['mend_weld', 'mend_orient', 'mend_fill_holes', 'mesh_balanced', 'mesh_manifold', 'mesh_genus_known'];
const COUNTS = ['source_size', 'vertex_count', 'face_count', 'source_vertex_count', 'source_face_count', 'leaf_faces', 'mend_welded_vertices',
  'mend_flipped_faces', 'mend_unorientable', 'mend_filled_holes', 'mend_added_faces', 'mend_unfilled_holes', 'mesh_boundary_edges',
  'mesh_nonmanifold_edges', 'mesh_misoriented_edges', 'mesh_unbalanced_edges', 'mesh_bowtie_vertices', 'mesh_zero_area_faces',
  'mesh_index_repeated_faces', 'mesh_repeated_faces', 'mesh_unreferenced_vertices', 'mesh_repeated_positions', 'mesh_edges', 'mesh_components',
  'mesh_boundary_loops'];
const HINTS = ['chunk_index_offset', 'chunk_index_bytes', 'top_bytes']; // these attributes may be absent or wrong
const NUMBERS = ['grid_level', 'max_level', 'level_count'];
const REALS = ['epsilon', 'mesh_area', 'mesh_volume', 'mesh_mean_edge'];
const TRIPLES = ['box_origin', 'box_size', 'mesh_min', 'mesh_max'];
const DIGESTS = ['source_sha256', 'content_sha256'];
const LEVEL_COUNTS = ['gray', 'leaf', 'white', 'black', 'planes', 'leaf_planes', 'faces_new', 'faces_referenced'];

/** Reads attributes of one object by type. */
export class Facts {
  constructor(attributes, where) {
    this.attributes = attributes;
    this.where = where;
  }

  notAllowed(name) {
    return formatError(this.where, `attribute ${name} has a value that the format does not allow`);
  }

  fail(name, what) {
    return formatError(this.where, `attribute ${name}: ${what}`);
  }

  #get(name, count, fits, what) {
    const a = this.attributes.get(name);
    if (!a)
      throw formatError(this.where, `attribute ${name} is missing`);
    const points = a.space ? a.space.dims.reduce((product, d) => product * d, 1) : 0;
    if (!fits(a.type))
      throw this.fail(name, `it is not ${what}`);
    if (points !== count || !a.space.fixed || a.data.length < count * a.type.size)
      throw this.fail(name, 'it is damaged or has the wrong number of values');
    return new DataView(a.data.buffer, a.data.byteOffset, count * a.type.size);
  }

  has(name) {
    return this.attributes.has(name);
  }

  text(name, most = 4096) {
    const view = this.#get(name, 1, (t) => t.class === 'text' && t.size >= 1 && t.size <= 65536, 'a fixed-length UTF-8 text of an allowed length');
    const bytes = new Uint8Array(view.buffer, view.byteOffset, view.byteLength), end = bytes.indexOf(0);
    const value = text(end < 0 ? bytes : bytes.subarray(0, end));
    if (value === undefined || (end < 0 ? bytes.length : end) > most)
      throw this.fail(name, 'it is not a fixed-length UTF-8 text of an allowed length');
    return value;
  }

  count(name, most = Number.MAX_SAFE_INTEGER) {
    const view = this.#get(name, 1, (t) => t.class === 'integer' && t.size === 8 && !t.signed && t.little, 'a u64');
    const value = view.getBigUint64(0, true);
    if (value > BigInt(most))
      throw this.notAllowed(name);
    return Number(value);
  }

  /** Returns a count, or 0 when it is absent or has a type that another program wrote. */
  hint(name) {
    try {
      return this.count(name);
    } catch {
      return 0;
    }
  }

  int(name, least = 0, most = 2 ** 20) {
    const view = this.#get(name, 1, (t) => t.class === 'integer' && t.size === 8 && t.signed && t.little, 'an i64');
    const value = view.getBigInt64(0, true);
    if (value < BigInt(least) || value > BigInt(most))
      throw this.notAllowed(name);
    return Number(value);
  }

  reals(name, count) {
    const view = this.#get(name, count, (t) => t.class === 'double', 'of doubles');
    return Array.from({ length: count }, (_, i) => view.getFloat64(8 * i, true));
  }

  word(name) {
    const value = this.text(name);
    if (!WORDS[name].includes(value))
      throw this.notAllowed(name);
    return value;
  }
}

function readParts(facts) {
  const seen = new Set();
  for (const [name, required] of [['required_parts', true], ['optional_parts', false]])
    for (const word of facts.text(name) === '' ? [] : facts.text(name).split(' ')) {
      if (word === '')
        throw facts.notAllowed(name);
      if (!KNOWN_PARTS.includes(word)) {
        if (required)
          throw new EbpoError('VERSION', `the file needs the part "${word}", which this reader does not know; use a newer reader`);
      } else if (seen.has(word)) {
        throw formatError('', `part "${word}" is listed twice`);
      }
      if (KNOWN_PARTS.includes(word))
        seen.add(word);
    }
  if (!seen.has('levels'))
    throw facts.notAllowed('required_parts');
  return seen;
}

// Checks how planes were chosen; nothing else depends on it.
function readSelection(facts) {
  if (!facts.has('selection') || !['kmedoids', 'offset', 'random'].includes(facts.text('selection', 63)))
    return;
  const [percent] = facts.reals('selection_percent', 1), [kRoot] = facts.reals('selection_k_root', 1);
  facts.count('selection_seed', Number.MAX_VALUE);
  if (!(percent >= 0 && percent <= 100) || !(kRoot >= 0 && Number.isFinite(kRoot)))
    throw facts.fail('selection_percent', 'it has a value that the format does not allow');
}

// Reads the counts of the border of a surface (format-spec/border.md).
function readBorder(facts, out) {
  if (!out.parts.has('border'))
    return;
  out.border_loops = facts.count('border_loops');
  out.border_points = facts.count('border_points', 2 ** 31 - 1);
  out.border_longest = facts.count('border_longest', out.border_points);
  [out.border_area] = facts.reals('border_area', 1);
  if (out.solid || !out.parts.has('mesh') || 3 * out.border_loops > out.border_points)
    throw facts.notAllowed('border_loops');
  if (!(Number.isFinite(out.border_area) && out.border_area >= 0))
    throw facts.notAllowed('border_area');
}

/** Returns the root's attributes as an object with the attributes' names, and `parts`, a Set of words. */
export function readFacts(attributes) {
  const facts = new Facts(attributes, '/'), out = {};
  let format;
  try {
    format = facts.text('format');
  } catch { /* reported below */ }
  if (format !== 'EBP-Octree in HDF5')
    throw formatError('', 'an HDF5 file, but not an EBP-Octree (its root attribute format is not "EBP-Octree in HDF5")',
      /^EBP-Octree paint/.test(format) ? 'this is a paint file for a model: open the model, and then this file by Open in the section Paint' : 'make one with `ebpo convert`');
  out.format_version_major = facts.int('format_version_major');
  out.format_version_minor = facts.int('format_version_minor');
  if (out.format_version_major !== 1)
    throw new EbpoError('VERSION', `format version ${out.format_version_major}.${out.format_version_minor}, but this reader reads version 1; use a newer reader`);
  if (facts.has('format_version') && facts.text('format_version') === '1.0-draft') // files of the draft have the same version numbers; only this text differs
    throw new EbpoError('VERSION', 'the file was written by a draft of the format, which is no longer supported; convert the model again');
  out.parts = readParts(facts);
  out.generator = facts.text('generator', 63);
  for (const [name, most] of Object.entries(TEXTS))
    out[name] = facts.has(name) ? facts.text(name, most) || undefined : undefined;
  readSelection(facts);
  for (const name of Object.keys(WORDS))
    out[name] = facts.word(name);
  for (const name of FLAGS)
    out[name] = facts.count(name, 1) === 1;
  for (const name of COUNTS)
    out[name] = facts.count(name);
  out.mend_dropped_faces = facts.has('mend_dropped_faces') ? facts.count('mend_dropped_faces') : 0;
  if (facts.has('mend_weld_distance')) {
    [out.mend_weld_distance] = facts.reals('mend_weld_distance', 1);
    [out.mend_weld_moved] = facts.reals('mend_weld_moved', 1);
    out.mend_collapsed_faces = facts.count('mend_collapsed_faces');
    if (!(Number.isFinite(out.mend_weld_distance) && out.mend_weld_distance > 0 && out.mend_weld))
      throw facts.notAllowed('mend_weld_distance');
    if (!(Number.isFinite(out.mend_weld_moved) && out.mend_weld_moved >= 0))
      throw facts.notAllowed('mend_weld_moved');
  }
  for (const name of HINTS)
    out[name] = facts.hint(name);
  for (const name of NUMBERS)
    out[name] = facts.int(name);
  out.mesh_genus = facts.int('mesh_genus', Number.MIN_SAFE_INTEGER, Number.MAX_SAFE_INTEGER);
  for (const name of REALS)
    out[name] = facts.reals(name, 1)[0];
  for (const name of TRIPLES)
    out[name] = facts.reals(name, 3);
  const separate = ['colours', 'border'].filter((part) => out.parts.has(part)).map((part) => `${part}_sha256`);
  for (const name of [...DIGESTS, ...separate]) {
    out[name] = facts.text(name);
    if (!/^[0-9a-f]{64}$/.test(out[name]))
      throw facts.notAllowed(name);
  }
  if (out.level_count < 1 || out.level_count > LEVELS_MAX)
    throw formatError('/', `level_count is not 1 to ${LEVELS_MAX}`);
  out.solid = out.kind === 'solid';
  readBorder(facts, out);
  out.subtree_level = out.parts.has('subtrees') ? facts.int('subtree_level', 1, out.level_count - 2) : undefined;
  if (out.parts.has('pruned')) {
    out.subset_of = facts.text('subset_of');
    if (!/^[0-9a-f]{64}$/.test(out.subset_of))
      throw facts.notAllowed('subset_of');
    out.subset_levels = facts.has('subset_levels') ? facts.int('subset_levels', 1, LEVELS_MAX) : undefined;
    out.subset_error = facts.has('subset_error') ? facts.reals('subset_error', 1)[0] : undefined;
    if (out.subset_error !== undefined && !(Number.isFinite(out.subset_error) && out.subset_error > 0))
      throw facts.notAllowed('subset_error');
    out.subset_box = facts.has('subset_box') ? facts.reals('subset_box', 6) : undefined;
    if (out.subset_box && ![0, 1, 2].every((k) => Number.isFinite(out.subset_box[k]) && Number.isFinite(out.subset_box[3 + k]) && out.subset_box[k] <= out.subset_box[3 + k]))
      throw facts.notAllowed('subset_box');
  }
  return out;
}

/** Returns a level's attributes. */
export function readLevelFacts(attributes, where) {
  const facts = new Facts(attributes, where), out = {};
  for (const name of LEVEL_COUNTS)
    out[name] = facts.count(name);
  out.gray_volume = facts.reals('gray_volume', 1)[0];
  out.leaf_volume = facts.reals('leaf_volume', 1)[0];
  out.pruned = facts.has('pruned') ? facts.count('pruned') : 0;
  return out;
}

/** Returns true when an axis of the root box is on a grid of exact doubles (format-spec, section 7). Computes exactly, in integers. */
function axisValid(origin, size, gridLevel) {
  const largest = 2 ** 1002;
  if (!(Math.abs(origin) <= largest && size > 0 && size <= largest))
    return false;
  const parts = (x) => {
    const view = new DataView(new ArrayBuffer(8));
    view.setFloat64(0, Math.abs(x));
    const bits = view.getBigUint64(0), exponent = Number(bits >> 52n), fraction = bits & 0xfffffffffffffn;
    let m = exponent ? fraction | 1n << 52n : fraction, e = Math.max(exponent, 1) - 1075;
    while (m && !(m & 1n)) {
      m >>= 1n;
      e++;
    }
    return { m: x < 0 ? -m : m, e };
  };
  const o = parts(origin), s = parts(size);
  const e = Math.min(s.e - gridLevel, o.m ? o.e : Infinity);
  if (e < -1074)
    return false;
  const limit = 1n << 53n;
  if ((o.m && o.e - e > 60) || s.e - e > 60)
    return false;
  const first = o.m ? o.m << BigInt(o.e - e) : 0n, length = s.m << BigInt(s.e - e);
  return first <= limit && first >= -limit && length <= limit && first + length <= limit;
}

function checkLevelCounts(info, level) {
  const s = info.levels[level], has = (part) => info.parts.has(part);
  const nodes = level ? 8 * info.levels[level - 1].gray : 1;
  if ([s.gray, s.leaf, s.white, s.black].some((n) => n > NODES_MAX))
    return 'a level has too many nodes';
  if (s.gray + s.leaf + s.white + s.black !== nodes)
    return 'a level does not have eight nodes for each gray node above';
  const last = level === info.level_count - 1, subset = has('pruned');
  if (last ? s.gray && !subset : s.gray === 0)
    return 'a level has no gray nodes, or the deepest level has gray nodes';
  if (subset ? s.pruned > s.gray || (last && s.pruned !== s.gray) : s.pruned !== 0)
    return "a level's pruned nodes exceed its gray nodes, or differ from them at the deepest level";
  if (!last && subset && (s.pruned === s.gray || info.levels[level + 1].white < 8 * s.pruned))
    return "a level has only the empty groups of pruned nodes, or not all of them";
  if (s.planes > (has('planes') ? 255 * s.gray : 0) || s.leaf_planes > (has('leaf-planes') ? 255 * s.leaf : 0))
    return 'a level has more planes than its nodes can have';
  if (!has('mesh') && (s.faces_new || s.faces_referenced))
    return 'a level counts faces, but there is no mesh';
  if (s.leaf === 0 && (s.faces_new || s.faces_referenced))
    return 'a level has faces but no leaf';
  if (s.black && !info.solid)
    return 'a surface has black nodes';
  if (s.leaf && s.faces_referenced / s.leaf > info.face_count)
    return 'a level refers to more faces than the mesh has';
  return undefined;
}

/** Checks that the facts are consistent, before they determine the size of memory. */
export function checkFacts(info) {
  const mesh = (what) => formatError('/', what);
  if (info.parts.has('gates') && !info.parts.has('mesh'))
    throw mesh('there is a coding of faces but no mesh');
  if ([info.face_count, info.vertex_count].some((n) => n < 1 || n > MESH_MAX))
    throw mesh('face_count or vertex_count is 0 or beyond 2^32 - 2');
  if ([info.source_vertex_count, info.source_face_count, info.mend_added_faces].some((n) => n > MESH_MAX))
    throw mesh('a count of the source is beyond 2^32 - 2');
  if (info.mend_dropped_faces > info.source_face_count)
    throw mesh('more faces were dropped than the source has');
  if (info.vertex_count > info.source_vertex_count
    || info.face_count > info.source_face_count + info.mend_added_faces - info.mend_dropped_faces)
    throw mesh('the mesh has more vertices or faces than its source and the repair record explain');
  if (info.parts.has('maps') && !info.parts.has('mesh'))
    throw mesh('there are maps but no mesh');
  if (info.grid_level > 20 || info.max_level > info.grid_level || info.level_count > info.max_level + 1)
    throw mesh('grid_level, max_level and level_count contradict each other');
  if (![0, 1, 2].every((k) => axisValid(info.box_origin[k], info.box_size[k], info.grid_level)))
    throw mesh('box_origin and box_size are not on a grid of exact doubles');
  if (!(info.epsilon >= 0 && Number.isFinite(info.epsilon)))
    throw mesh('epsilon is negative or not a number');
  let faces = 0;
  for (let level = 0; level < info.level_count; level++) {
    const wrong = checkLevelCounts(info, level);
    faces += info.levels[level].faces_new;
    if (wrong || faces > info.face_count)
      throw formatError('/levels', wrong ?? 'the levels have more new faces than the mesh');
  }
  if (info.parts.has('mesh') && faces !== info.face_count)
    throw formatError('/levels', "the levels' new faces do not add up to face_count");
}

/** Returns the rows of a chunk: the largest power of two that fits, or all rows when there are fewer. */
export function chunkRows(rows, cols, elementSize) {
  const fit = 2 ** Math.floor(Math.log2(65536 / (elementSize * Math.max(cols, 1))));
  return Math.min(rows, fit);
}

const indexRows = (count) => (count > INDEX_ROWS ? Math.ceil(count / INDEX_ROWS) : 0);

// name: [columns (0: one dimension), element sizes, signed, rows, may be absent although it has rows]
const has = (info, part, rows) => (info.parts.has(part) ? rows : 0);
const LEVEL_ARRAYS = {
  types: [0, [2], false, (info, s, groups) => groups],
  plane_counts: [0, [1], false, (info, s) => has(info, 'planes', s.gray)],
  planes: [0, [4], false, (info, s) => has(info, 'planes', s.planes)],
  leaf_winding: [0, [1, 2, 4], true, (info, s) => (info.solid ? s.leaf : has(info, 'border', s.leaf))],
  black_winding: [0, [1, 2, 4], true, (info, s) => (info.solid ? s.black : 0), true],
  white_winding: [0, [1, 2, 4], true, (info, s) => (info.solid ? s.white : has(info, 'border', s.white)), true],
  leaf_skip: [0, [4], false, (info, s) => has(info, 'mesh', s.leaf)],
  leaf_new: [0, [1, 2, 4], false, (info, s) => has(info, 'mesh', s.leaf)],
  leaf_ref_count: [0, [1, 2, 4], false, (info, s) => has(info, 'mesh', s.leaf)],
  leaf_refs: [0, [4], false, (info, s) => has(info, 'mesh', s.faces_referenced)],
  types_index: [4, [8], false, (info, s, groups) => indexRows(groups)],
  gray_index: [1, [8], false, (info, s) => has(info, 'planes', indexRows(s.gray))],
  leaf_index: [3, [8], false, (info, s) => (info.parts.has('mesh') || info.parts.has('leaf-planes') ? indexRows(s.leaf) : 0)],
  leaf_plane_counts: [0, [1], false, (info, s) => has(info, 'leaf-planes', s.leaf)],
  leaf_planes: [0, [4], false, (info, s) => has(info, 'leaf-planes', s.leaf_planes)],
  gray_colours: [0, [4], false, (info, s) => has(info, 'colours', s.gray)],
};
const CODINGS = { // the coding of other arrays is plain
  leaf_skip: ['skips', 'delta'], leaf_refs: ['gap'], '/mesh/vertices': ['delta'], '/mesh/faces': ['high-water'], '/maps/vertex_source': ['delta'],
  '/maps/face_source': ['delta'], '/border/points': ['delta'],
};
const faceChunks = (info) => {
  const rows = info.subtree_level === undefined ? chunkRows(info.face_count, 3, 4) : FIXED_ROWS['/mesh/faces'];
  return info.face_count > rows ? Math.ceil(info.face_count / rows) : 0;
};
const ROOT_ARRAYS = {
  '/mesh/vertices': [3, [4, 8], false, (info) => has(info, 'mesh', info.vertex_count)],
  '/mesh/faces': [3, [4], false, (info) => has(info, 'mesh', info.face_count)],
  '/mesh/faces_index': [1, [8], false, (info) => has(info, 'mesh', faceChunks(info))],
  '/maps/vertex_source': [0, [4], false, (info) => has(info, 'maps', info.vertex_count)],
  '/maps/face_source': [0, [4], false, (info) => has(info, 'maps', info.face_count)],
  '/border/loops': [2, [4], false, (info) => has(info, 'border', info.border_loops)],
  '/border/points': [3, [4, 8], false, (info) => has(info, 'border', info.border_points)],
};

/** Throws unless an array's attribute names the coding that the format requires. Older files have `delta` for leaf_skip. */
export function checkCoding(attributes, path, gates) {
  const word = new Facts(attributes, path).text('coding', 15), name = path.startsWith('/levels/') ? path.slice(path.lastIndexOf('/') + 1) : path;
  if (!(path.startsWith('/attributes/') ? ['plain', 'column-delta'] : gates ? ['gates'] : CODINGS[name] ?? ['plain']).includes(word))
    throw formatError(path, "the array's coding is not valid for this array");
}

/** Describes the arrays of a group of attributes: `count` of the group, `text` and `range` of an array. */
export function attributesFacts(attributes, path) {
  const facts = new Facts(attributes, path);
  return { count: () => facts.count('arrays'), text: (name) => facts.text(name, 255), isList: facts.has('list'), range: facts.has('range') ? facts.reals('range', 2) : undefined };
}

/** Returns the columns of /subtrees/counts. */
export const subtreeCols = (info) => 6 + 7 * (info.level_count - 1 - info.subtree_level);

export const PLACES = '/subtrees/chunk_directory', CHUNK_SUMS = '/chunk_checksums';

/** Returns true for lists about all chunks. Such a list is itself a single chunk, and no list contains it. */
export const isList = (path) => path === PLACES || path === CHUNK_SUMS;

// The arrays of files with the part subtrees. rows: undefined when only the array's shape has the number of rows.
const subtreeArrays = (info) => (info.subtree_level === undefined ? [] : [
  { path: '/subtrees/counts', cols: subtreeCols(info), sizes: [4], rows: info.levels[info.subtree_level].gray },
  { path: '/subtrees/index', cols: subtreeCols(info), sizes: [8], rows: undefined },
  { path: '/subtrees/shared_chunks', cols: 0, sizes: [4], rows: undefined, mayBeAbsent: true },
  { path: PLACES, cols: 0, sizes: [8], rows: undefined },
]);

/** Returns the arrays of a file with these facts: [{ path, level, order, name, cols, sizes, signed, rows, mayBeAbsent }]. `order`: the array's index in its level. */
export function arraysOf(info) {
  const out = [];
  info.levels.forEach((summary, level) => {
    const folder = `/levels/${String(level).padStart(2, '0')}`, groups = level ? info.levels[level - 1].gray : 1;
    Object.entries(LEVEL_ARRAYS).forEach(([name, [cols, sizes, signed, rows, mayBeAbsent]], order) =>
      out.push({ path: `${folder}/${name}`, level, order, name, cols, sizes, signed, rows: rows(info, summary, groups), mayBeAbsent }));
  });
  for (const [path, [cols, sizes, signed, rows]] of Object.entries(ROOT_ARRAYS))
    out.push({ path, level: undefined, name: path, cols, sizes, signed, rows: rows(info), gates: path === '/mesh/faces' && info.parts.has('gates') });
  out.push(...subtreeArrays(info).map((a) => ({ ...a, level: undefined, name: a.path, signed: false })));
  out.push({ path: CHUNK_SUMS, level: undefined, name: CHUNK_SUMS, cols: 0, sizes: [8], signed: false, rows: undefined, mayBeAbsent: true });
  return out.filter((a) => a.rows !== 0);
}

/** Returns the rows of a chunk in files with the part subtrees. */
export const FIXED_ROWS = { '/mesh/faces': 2048, '/mesh/vertices': 1024 };

/** Returns true when chunks of an array may have this number of rows. */
export function chunkRowsFit(info, path, rows, cols, elementSize, chunk) {
  if (isList(path))
    return chunk === rows;
  if (info.subtree_level === undefined)
    return chunk === chunkRows(rows, cols, elementSize);
  if (FIXED_ROWS[path])
    return chunk === Math.min(rows, FIXED_ROWS[path]);
  return chunk * elementSize * Math.max(cols, 1) <= CHUNK_BYTES_MAX && (chunk === rows || (chunk < rows && Number.isInteger(Math.log2(chunk))));
}
