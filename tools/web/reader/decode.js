// Decodes stored arrays to values and checks the values: format-spec/README.md, sections 6, 7 and 9.
import { formatError } from './error.js';
import { INDEX_ROWS } from './facts.js';

export const WHITE = 0, BLACK = 1, LEAF = 2, GRAY = 3;

const levelPath = (level, name) => `/levels/${String(level).padStart(2, '0')}/${name}`;

/** Returns true when a winding rule classifies a winding number as inside. */
export function isInside(rule, winding) {
  return rule === 'nonzero' ? winding !== 0 : rule === 'evenodd' ? winding % 2 !== 0 : winding > 0;
}

/** Returns the number of nodes of each type (white, black, leaf, gray) in groups of a level. */
export function countTypes(types, level) {
  const counts = [0, 0, 0, 0], octants = level ? 8 : 1;
  if (level === 0 && types[0] > 3)
    throw formatError(levelPath(0, 'types'), 'the root has siblings');
  for (const group of types)
    for (let o = 0; o < octants; o++)
      counts[group >> 2 * o & 3]++;
  return counts;
}

function checkTypes(info, level) {
  const counts = countTypes(level.types, level.level), s = level.summary;
  if (counts[WHITE] !== s.white || counts[BLACK] !== s.black || counts[LEAF] !== s.leaf || counts[GRAY] !== s.gray)
    throw formatError(levelPath(level.level, 'types'), 'the types do not add up to the counts in the header');
  if (level.level && level.types.some((t) => t !== 0 && (t & 0xaaaa) === 0))
    throw formatError(levelPath(level.level, 'types'), 'a gray node has no child that is gray or a leaf');
  if (level.level && level.types.reduce((sum, t) => sum + (t === 0), 0) !== info.levels[level.level - 1].pruned)
    throw formatError(levelPath(level.level, 'types'), info.parts.has('pruned') ? 'there is not exactly one empty group for each pruned node of the level above'
      : 'a gray node has no child that is gray or a leaf');
}

/** Checks winding numbers of black and white nodes against the rule. */
export function checkWindings(info, level, black, white) {
  if (black?.some((w) => !isInside(info.winding_rule, w)))
    throw formatError(levelPath(level, 'black_winding'), 'a black node is outside by the winding rule');
  if (info.solid && white?.some((w) => isInside(info.winding_rule, w)))
    throw formatError(levelPath(level, 'white_winding'), 'a white node is inside by the winding rule');
}

function checkPlanes(level, countsName, counts, planesName, planes, total) {
  let sum = 0;
  for (const count of counts ?? [])
    sum += count;
  if (sum !== total)
    throw formatError(levelPath(level.level, countsName), 'the counts do not add up to the number of planes');
  for (const code of planes ?? [])
    if ((code & 1023) === 1023 || (code >>> 10 & 1023) === 1023 || code >>> 20 === 4095)
      throw formatError(levelPath(level.level, planesName), 'invalid plane code');
}

/** Returns the colours of gray nodes, if the file has any. */
export function checkColours(level, colours) {
  if (colours?.some((colour) => colour >= 2 ** 24))
    throw formatError(levelPath(level, 'gray_colours'), 'a colour is above 2^24 - 1');
}

/** Decodes a level's tree, planes and colours, and compares them with the counts in the header. */
export function checkLevel(info, level) {
  checkTypes(info, level);
  checkPlanes(level, 'plane_counts', level.planeCounts, 'planes', level.planes, level.summary.planes);
  checkPlanes(level, 'leaf_plane_counts', level.leafPlaneCounts, 'leaf_planes', level.leafPlanes, level.summary.leaf_planes);
  checkWindings(info, level.level, level.blackWinding, level.whiteWinding);
  checkColours(level.level, level.grayColours);
}

/** Compares types_index and gray_index with the sums that they must contain. */
export function checkIndexes(level, index) {
  const wrong = (name) => formatError(levelPath(level.level, name), 'the index contradicts the arrays that it indexes');
  if (index.types) {
    const before = [0, 0, 0, 0], order = [WHITE, BLACK, LEAF, GRAY], octants = level.level ? 8 : 1;
    level.types.forEach((types, i) => {
      if (i % INDEX_ROWS === 0 && order.some((type, k) => index.types[i / INDEX_ROWS * 4 + k] !== before[type]))
        throw wrong('types_index');
      for (let o = 0; o < octants; o++)
        before[types >> 2 * o & 3]++;
    });
  }
  if (index.gray) {
    let before = 0;
    level.planeCounts.forEach((count, i) => {
      if (i % INDEX_ROWS === 0 && index.gray[i / INDEX_ROWS] !== before)
        throw wrong('gray_index');
      before += count;
    });
  }
}

/** Adds leafFirst, leafNew, leafRefCount and leafRefs to a level. */
export function decodeLeaves(info, level, { skip, fresh, refCount, refs, index }) {
  const s = level.summary, first = new Float64Array(s.leaf), fail = (name, what) => formatError(levelPath(level.level, name), what);
  let end = 0, news = 0, at = 0, planes = 0;
  for (const count of refCount ?? [])
    at += count;
  if (at !== s.faces_referenced)
    throw fail('leaf_ref_count', 'the counts do not add up to the number of references');
  at = 0;
  for (let leaf = 0; leaf < s.leaf; leaf++) {
    if (index && leaf % INDEX_ROWS === 0) {
      const row = leaf / INDEX_ROWS * 3;
      if (index[row] !== end || index[row + 1] !== at || index[row + 2] !== planes)
        throw fail('leaf_index', 'the index contradicts the arrays that it indexes');
    }
    first[leaf] = end + skip[leaf];
    if (first[leaf] + fresh[leaf] > info.face_count)
      throw fail('leaf_skip', "a leaf's new faces are beyond the last face");
    end = first[leaf] + fresh[leaf];
    news += fresh[leaf];
    planes += level.leafPlaneCounts?.[leaf] ?? 0;
    let above = first[leaf];
    for (let k = 0; k < refCount[leaf]; k++) { // stored as descending differences; the result is ascending
      above -= refs[at + k] + 1;
      if (above < 0)
        throw fail('leaf_refs', "a reference is not to a face before the leaf's new faces");
      refs[at + k] = above;
    }
    refs?.subarray(at, at + refCount[leaf]).reverse();
    at += refCount[leaf];
  }
  if (news !== s.faces_new)
    throw fail('leaf_new', 'the counts do not add up to the number of new faces');
  Object.assign(level, { leafFirst: first, leafNew: fresh, leafRefCount: refCount, leafRefs: refs });
}

/** Decodes the face lists of a block of leaves. `start`: the end of the new faces of the previous leaf. `refs`: the references of the block. See leafBlock() in file.js. */
export function decodeLeafBlock(info, level, { start, skip, fresh, refCount, refs }) {
  const n = fresh.length, first = new Float64Array(n), refBegin = new Uint32Array(n), out = Float64Array.from(refs);
  let end = start, at = 0;
  for (let i = 0; i < n; i++) {
    first[i] = end + Number(skip[i]);
    end = first[i] + fresh[i];
    if (end > info.face_count)
      throw formatError(levelPath(level, 'leaf_skip'), "a leaf's new faces are beyond the last face");
    if (refCount[i] > refs.length - at)
      throw formatError(levelPath(level, 'leaf_ref_count'), 'the counts do not add up to the number of references');
    let above = first[i];
    refBegin[i] = at;
    for (let k = 0; k < refCount[i]; k++, at++)
      out[at] = above -= refs[at] + 1;
    if (above < 0)
      throw formatError(levelPath(level, 'leaf_refs'), "a reference is not to a face before the leaf's new faces");
  }
  if (at !== refs.length)
    throw formatError(levelPath(level, 'leaf_ref_count'), 'the counts do not add up to the number of references');
  return { first, fresh, refCount, refBegin, refs: out };
}

/** Checks that the leaves of all levels, depth first, list every face as new exactly once, in order. `levels`: all levels of the file, with face lists. */
export function checkOrder(info, levels) {
  const group = levels.map(() => 0), leaf = levels.map(() => 0);
  let seen = 0;
  const walk = (l) => {
    const level = levels[l], types = level.types[group[l]++];
    for (let o = 0; o < (l ? 8 : 1); o++) {
      const type = types >> 2 * o & 3;
      if (type === GRAY && l + 1 < levels.length) {
        walk(l + 1);
      } else if (type === LEAF) {
        const i = leaf[l]++;
        if (level.leafFirst[i] !== seen)
          throw formatError(levelPath(l, 'leaf_skip'), "the leaves' new faces are not in depth-first order");
        seen += level.leafNew[i];
      }
    }
  };
  walk(0);
  if (seen !== info.face_count)
    throw formatError(levelPath(0, 'leaf_new'), 'not every face is new in exactly one leaf');
}

const rowsIn = (array, chunk) => Math.min(array.chunkRows, array.rows - chunk * array.chunkRows);

/** Decodes the vertices of one chunk: running sums of zigzag differences of the coordinates' ordered bits, for each axis. */
export function decodeVertices(bytes, array, chunk) {
  const n = rowsIn(array, chunk) * 3;
  const values = array.elementSize === 4 ? vertices32(bytes, n) : vertices64(bytes, n);
  if (!values.every(Number.isFinite))
    throw formatError('/mesh/vertices', 'a coordinate is not a finite number');
  return values;
}

function vertices32(bytes, n) {
  const codes = new Uint32Array(bytes.buffer, bytes.byteOffset, n), bits = new Int32Array(n);
  const sum = [0, 0, 0];
  for (let i = 0; i < n; i++) {
    const code = codes[i], k = i % 3, value = sum[k] = (sum[k] + ((code >>> 1) ^ -(code & 1))) | 0;
    bits[i] = value < 0 ? value ^ 0x7fffffff : value;
  }
  return new Float32Array(bits.buffer);
}

function vertices64(bytes, n) {
  const codes = new BigUint64Array(bytes.buffer, bytes.byteOffset, n), bits = new BigInt64Array(n);
  const sum = [0n, 0n, 0n];
  for (let i = 0; i < n; i++) {
    const code = codes[i], k = i % 3, value = sum[k] = BigInt.asIntN(64, sum[k] + ((code >> 1n) ^ -(code & 1n)));
    bits[i] = value < 0n ? value ^ 0x7fffffffffffffffn : value;
  }
  return new Float64Array(bits.buffer);
}

/** Recodes differences that restart every array.chunkRows rows as differences that restart every `rows` rows. Returns bytes. */
export function recode(bytes, array, rows) {
  const wide = array.elementSize === 8, codes = new (wide ? BigUint64Array : Uint32Array)(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length)), cols = Math.max(array.cols, 1);
  const value = wide ? (code) => (code >> 1n) ^ -(code & 1n) : (code) => (code >>> 1) ^ -(code & 1), none = wide ? 0n : 0;
  const sums = new (wide ? BigInt64Array : Int32Array)(cols), zigzag = new (wide ? BigInt64Array : Int32Array)(1);
  const code = wide ? (v) => ((zigzag[0] = v) << 1n) ^ (zigzag[0] >> 63n) : (v) => ((zigzag[0] = v) << 1) ^ (zigzag[0] >> 31);
  for (let row = 0; row < array.rows; row++) {
    const anew = row % array.chunkRows === 0, stays = row % rows === 0;
    for (let k = 0, i = row * cols; k < cols; k++, i++) {
      const difference = value(codes[i]);
      if (anew && !stays)
        codes[i] = code(difference - sums[k]);
      sums[k] = (anew ? none : sums[k]) + difference;
    }
  }
  return new Uint8Array(codes.buffer);
}

/** Decodes the faces of one chunk: code 0 is the next new vertex, code k the k-th vertex before it. `index`: the number of vertices used before each chunk. */
export function decodeFaces(bytes, array, chunk, index, vertexCount) {
  const n = rowsIn(array, chunk) * 3, codes = new Uint32Array(bytes.buffer, bytes.byteOffset, n), out = new Uint32Array(n);
  let seen = index[chunk];
  if (seen > vertexCount || (chunk === 0 && seen !== 0))
    throw formatError('/mesh/faces_index', 'the index has more vertices than the mesh');
  for (let i = 0; i < n; i++) {
    const code = codes[i];
    if (code > seen)
      throw formatError('/mesh/faces', 'a face names a vertex that does not exist');
    out[i] = code ? seen - code : seen++;
  }
  if (seen > vertexCount)
    throw formatError('/mesh/faces', 'a face names a vertex that does not exist');
  if (chunk + 1 < array.chunkCount && index[chunk + 1] !== seen)
    throw formatError('/mesh/faces_index', 'the index contradicts the faces');
  return out;
}

// Decodes a map: running sums of zigzag differences, which restart in each chunk. Calls `each` with the sums.
function sumMap(codes, array, limit, each) {
  let sum = 0;
  for (let i = 0; i < codes.length; i++) {
    const code = codes[i];
    sum = ((i % array.chunkRows ? sum : 0) + ((code >>> 1) ^ -(code & 1))) >>> 0;
    if (sum >= limit || !each(i, sum))
      throw formatError(array.path, 'a source index is out of range or used twice');
  }
}

/** Decodes a whole map. */
export function decodeMap(bytes, array, limit) {
  const codes = new Uint32Array(bytes.buffer, bytes.byteOffset, array.rows), out = new Uint32Array(array.rows), used = new Uint8Array(Math.ceil(limit / 8));
  sumMap(codes, array, limit, (i, sum) => {
    const fresh = !(used[sum >>> 3] >> (sum & 7) & 1);
    used[sum >>> 3] |= 1 << (sum & 7);
    out[i] = sum;
    return fresh;
  });
  return out;
}

/** Decodes one chunk of a map. Does not detect indices that also occur in other chunks. */
export function decodeMapChunk(bytes, array, limit) {
  const codes = new Uint32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4), out = new Uint32Array(codes.length);
  sumMap(codes, array, limit, (i, sum) => {
    out[i] = sum;
    return true;
  });
  return out;
}
