// Reads parts of levels. In files with subtrees, a part has the nodes and face lists of one subtree in one level. In other files, and above the
// subtrees, a part has 4,096 groups or leaves, which is one entry of the index arrays. All chunks of a batch of parts are requested at once.
import { LEAF, GRAY, WHITE, BLACK, checkColours, checkWindings, countTypes, decodeLeafBlock } from './decode.js';
import { formatError } from './error.js';
import { INDEX_ROWS } from './facts.js';
import { Segment } from './segment.js';
import { Subtrees } from './subtrees.js';

const folder = (level) => `/levels/${String(level).padStart(2, '0')}/`;
const sum = (values) => values.reduce((total, v) => total + v, 0);

export class Parts {
  constructor(store) {
    this.store = store;
    this.info = store.info;
    this.subtrees = this.info.subtree_level === undefined ? undefined : new Subtrees(store);
  }

  /** Returns true when a level's parts are subtrees. */
  bySubtree(level) {
    return this.info.subtree_level !== undefined && level > this.info.subtree_level;
  }

  // --- rows of parts ---

  /** Describes the nodes of parts. `wanted` is [{ level, part }]. */
  async nodes(wanted) {
    const rows = await this.#subtreeRows(wanted);
    const described = await Promise.all(wanted.map(({ level, part }) => (this.bySubtree(level) ? this.#ofSubtree(rows.get(part), level) : this.#ofBlock(level, part))));
    return described.map((d, i) => ({ ...d, part: wanted[i].part }));
  }

  #subtreeRows(wanted) {
    const numbers = wanted.filter(({ level }) => this.bySubtree(level)).map(({ part }) => part);
    return numbers.length ? this.subtrees.rows(numbers) : new Map();
  }

  // In the result, `planes` is { row, from, to }: rows `from` to `to` - 1 of the planes belong to gray nodes from `row` on.
  #ofSubtree(row, level) {
    const d = row.level(level), has = (name) => this.store.arrays.has(folder(level) + name);
    return { ...d, exact: true, planes: has('plane_counts') ? { row: d.first[GRAY], ...d.planes } : undefined,
      leafPlanes: has('leaf_plane_counts') ? { row: d.first[LEAF], ...d.leafPlanes } : undefined };
  }

  async #ofBlock(level, block) {
    const at = folder(level), s = this.info.levels[level], { store } = this, groups = level ? this.info.levels[level - 1].gray : 1;
    const [types, gray, leaf] = await Promise.all(['types_index', 'gray_index', 'leaf_index'].map((name) => store.whole(at + name)));
    const all = [s.white, s.black, s.leaf, s.gray], row = (i) => (types ? types.slice(4 * i, 4 * i + 4) : [0, 0, 0, 0]), group = block * INDEX_ROWS, last = group + INDEX_ROWS >= groups;
    const first = row(block), next = last ? all : row(block + 1), count = [...next].map((n, t) => n - first[t]);
    if (count.some((n, t) => n < 0 || next[t] > all[t]))
      throw formatError(at + 'types_index', 'the index contradicts the arrays that it indexes');
    const span = (index, name, cols, col, total, type) => { // returns the rows between the index's entries around the nodes of a type
      const from = Math.floor(first[type] / INDEX_ROWS), to = Math.ceil(next[type] / INDEX_ROWS);
      const value = (i) => (i * INDEX_ROWS >= all[type] ? total : index ? index[cols * i + col] : 0);
      if (value(from) > value(to) || value(to) > total)
        throw formatError(at + name, 'the index contradicts the arrays that it indexes');
      return { row: from * INDEX_ROWS, from: value(from), to: value(to) };
    };
    return { level, group, groups: Math.min(INDEX_ROWS, groups - group), first: [...first], count, exact: false,
      planes: store.arrays.has(at + 'plane_counts') ? span(gray, 'gray_index', 1, 0, s.planes, GRAY) : undefined,
      leafPlanes: store.arrays.has(at + 'leaf_plane_counts') ? span(leaf, 'leaf_index', 3, 2, s.leaf_planes, LEAF) : undefined };
  }

  /**
   * Returns the rows of arrays with a part's nodes: [{ path, from, to }]. With `planes`, the data for drawing, with colours; otherwise the data for exact queries,
   * with winding numbers of leaves.
   */
  nodeRanges(d, planes) {
    const at = folder(d.level), of = (name, type) => ({ path: at + name, from: d.first[type], to: d.first[type] + d.count[type] });
    const out = [{ path: at + 'types', from: d.group, to: d.group + d.groups }, of('black_winding', BLACK), of('white_winding', WHITE)];
    const add = (name, type, p, counts) => p && out.push({ path: at + counts, from: p.row, to: d.first[type] + d.count[type] }, { path: at + name, from: p.from, to: p.to });
    if (!planes)
      return [...out, of('leaf_winding', LEAF)];
    out.push(of('gray_colours', GRAY));
    add('planes', GRAY, d.planes, 'plane_counts');
    add('leaf_planes', LEAF, d.leafPlanes, 'leaf_plane_counts');
    return out;
  }

  // --- nodes ---

  /** Reads segments (segment.js) of described parts. */
  async segments(described, planes) {
    const wanted = described.map((d) => this.nodeRanges(d, planes)), values = await this.store.rows(wanted.flat());
    return described.map((d, i) => this.#segment(d, values.splice(0, wanted[i].length), planes));
  }

  #segment(d, [types, blackWinding, whiteWinding, ...rest], planes) {
    const [leafWinding, grayColours] = planes ? [undefined, rest.shift()] : [rest.shift()], at = folder(d.level), found = countTypes(types, d.level);
    if (found.some((n, t) => n !== d.count[t]))
      throw formatError(at + 'types', d.exact ? 'the types do not add up to the counts in /subtrees/counts' : 'the types do not add up to the counts in types_index');
    checkWindings(this.info, d.level, blackWinding, whiteWinding);
    checkColours(d.level, grayColours);
    const gray = planes && d.planes ? this.#planes(d, GRAY, d.planes, at + 'plane_counts', ...rest.splice(0, 2)) : {};
    const leaf = planes && d.leafPlanes ? this.#planes(d, LEAF, d.leafPlanes, at + 'leaf_plane_counts', ...rest) : {};
    return new Segment({ level: d.level, group: d.group, first: d.first, types, leafWinding, blackWinding, whiteWinding,
      planeCounts: gray.counts, planes: gray.planes, leafPlaneCounts: leaf.counts, leafPlanes: leaf.planes, grayColours });
  }

  // A level without nodes of the type has no such arrays.
  #planes(d, type, { row, from, to }, path, counts = new Uint8Array(0), planes = new Uint32Array(0)) {
    const own = d.first[type] - row, before = sum(counts.subarray(0, own)), n = sum(counts.subarray(own));
    if (d.exact ? before + n !== to - from : before + n > to - from)
      throw formatError(path, 'the counts do not add up to the number of planes');
    const codes = (d.exact ? planes : planes?.slice(before, before + n)) ?? new Uint32Array(0);
    for (const code of codes)
      if ((code & 1023) === 1023 || (code >>> 10 & 1023) === 1023 || code >>> 20 === 4095)
        throw formatError(path.replace('_counts', 's'), 'invalid plane code');
    return { counts: d.exact ? counts : counts.slice(own), planes: codes };
  }

  // --- face lists ---

  /** Returns the part of its level that contains a leaf. */
  partOfLeaf(leaf) {
    return this.bySubtree(leaf.level) ? leaf.subtree : Math.floor(leaf.rank / INDEX_ROWS);
  }

  /** Describes the face lists of parts. `wanted` is [{ level, part }]. */
  async lists(wanted) {
    const rows = await this.#subtreeRows(wanted);
    return Promise.all(wanted.map(async ({ level, part }) => {
      if (!this.bySubtree(level))
        return this.block(level, part);
      const row = rows.get(part), d = row.level(level);
      return { level, part, key: `lists of subtree ${part} ${level}`, first: d.first[LEAF], count: d.count[LEAF], refs: d.refs, end: d.end,
        faces: { from: row.firstFace, to: row.firstFace + row.faces } };
    }));
  }

  /** Describes the face lists of at most 4,096 leaves of a level, from leaf 4096 * block on. */
  async block(level, block) {
    const s = this.info.levels[level], first = block * INDEX_ROWS, index = await this.store.whole(folder(level) + 'leaf_index'), next = 3 * block + 3;
    const refs = { from: index ? index[3 * block + 1] : 0, to: index && next < index.length ? index[next + 1] : s.faces_referenced };
    if (refs.from > refs.to || refs.to > s.faces_referenced)
      throw formatError(folder(level) + 'leaf_index', 'the index contradicts the arrays that it indexes');
    const start = index ? index[3 * block] : 0;
    return { level, part: block, key: `lists ${block} ${level}`, first, count: Math.min(s.leaf - first, INDEX_ROWS), refs,
      end: { from: start, to: index && next < index.length ? index[next] : undefined }, faces: { from: 0, to: this.info.face_count } };
  }

  listRanges(d) {
    const at = folder(d.level);
    return [...['leaf_skip', 'leaf_new', 'leaf_ref_count'].map((name) => ({ path: at + name, from: d.first, to: d.first + d.count })), { path: at + 'leaf_refs', ...d.refs }];
  }

  /** Reads the face lists of described parts: { first, fresh, refCount, refBegin, refs }, by decodeLeafBlock() of decode.js. */
  async decodeLists(described) {
    const kept = described.map((d) => this.store.cache.recall(d.key)), missing = described.filter((_, i) => !kept[i]), fresh = new Map();
    const wanted = missing.map((d) => this.listRanges(d)), values = await this.store.rows(wanted.flat());
    missing.forEach((d, i) => {
      const lists = this.#decodeLists(d, values.splice(0, wanted[i].length));
      this.store.cache.remember(d.key, lists);
      fresh.set(d, lists);
    });
    return described.map((d, i) => kept[i] ?? fresh.get(d));
  }

  #decodeLists(d, [skip, fresh, refCount, refs]) {
    const lists = decodeLeafBlock(this.info, d.level, { start: d.end.from, skip, fresh, refCount, refs: refs ?? new Uint32Array(0) }), n = d.count;
    const end = n ? lists.first[n - 1] + lists.fresh[n - 1] : d.end.from;
    if (d.end.to !== undefined && end !== d.end.to)
      throw formatError(folder(d.level) + 'leaf_skip', 'the new faces do not end at the end that the table of subtrees has');
    if (n && (lists.first[0] < d.faces.from || end > d.faces.to))
      throw formatError(folder(d.level) + 'leaf_skip', "a leaf's new faces are outside the range of its subtree");
    return Object.assign(lists, { begin: d.first, byteLength: 8 * lists.refs.length + 20 * n });
  }
}
