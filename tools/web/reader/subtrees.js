// Reads the table of subtrees: the counts and the first rows of each subtree in every array. format-spec/subtrees.md, section 1.
import { formatError } from './error.js';
import { FIXED_ROWS, subtreeCols } from './facts.js';

const FACES = 1, VERTICES = 3, OUTER = 4, BELOW = 6, LEVEL_COLS = 7; // columns; columns 0 and 2 count new faces and vertices before the subtree
const GRAY = 0, LEAF = 1, BLACK = 2, PLANES = 3, LEAF_PLANES = 4, REFS = 5, END = 6;
const INDEX = '/subtrees/index', COUNTS = '/subtrees/counts';

/** Returns [greatest sum, exact] of each column, by the counts in the header; exact: the total must equal this sum. */
function limits(info, outer) {
  const C = info.subtree_level, faces = (levels) => levels.reduce((sum, l) => sum + l.faces_new, 0);
  const mesh = info.parts.has('mesh'), vertices = mesh ? info.vertex_count : 0;
  const out = [[faces(info.levels.slice(0, C + 1)), false], [faces(info.levels.slice(C + 1)), true], [vertices, false], [vertices, false], [outer, false], [outer, false]];
  for (const l of info.levels.slice(C + 1))
    out.push([l.gray, true], [l.leaf, true], [l.black, true], [l.planes, true], [l.leaf_planes, true], [l.faces_referenced, true], [mesh ? info.face_count : 0, false]);
  return out;
}

export class Subtrees {
  constructor(store) {
    this.store = store;
    this.info = store.info;
    this.cols = subtreeCols(store.info);
    this.counts = store.arrays.get(COUNTS);
    this.outer = store.arrays.get('/subtrees/shared_chunks');
    this.limits = limits(store.info, this.outer?.rows ?? 0);
    this.checked = new Set(); // chunks of counts whose sums were checked
  }

  #index() {
    this.index ??= this.store.whole(INDEX).then((index) => this.#checkIndex(index));
    return this.index.catch((error) => {
      this.index = undefined;
      throw error;
    });
  }

  #checkIndex(index) {
    for (let i = 0; i < index.length; i++) {
      if (i < this.cols && index[i] !== 0)
        throw formatError(INDEX, 'the first row of the index is not 0');
      if (index[i] > this.limits[i % this.cols][0])
        throw formatError(INDEX, "a sum is greater than the header's counts allow");
    }
    return index;
  }

  // Checks a chunk of counts: its row of the index plus its counts must be the next row of the index, or for the last chunk the counts in the header.
  #checkChunk(chunk, counts, index) {
    const { cols } = this, last = chunk + 1 === this.counts.chunkCount, n = Math.min(this.counts.chunkRows, this.counts.rows - chunk * this.counts.chunkRows);
    const fail = () => formatError(COUNTS, last ? "the counts do not add up to the header's" : 'the counts do not add up to the next row of the index');
    const sum = index.slice(chunk * cols, (chunk + 1) * cols);
    for (let i = 0; i < n * cols; i++)
      sum[i % cols] += counts[i];
    for (let k = 0; k < cols; k++) {
      const [most, exact] = this.limits[k];
      if (last ? sum[k] > most || (exact && sum[k] !== most) : sum[k] !== index[(chunk + 1) * cols + k])
        throw fail();
    }
    if (sum[0] + sum[FACES] > this.info.face_count || sum[2] + sum[VERTICES] > this.info.vertex_count || (last && sum[OUTER] + sum[OUTER + 1] !== (this.outer?.rows ?? 0)))
      throw fail();
    this.checked.add(chunk);
  }

  /** Reads rows of the table. Resolves to a Map from the subtrees' numbers to SubtreeRow. */
  async rows(numbers) {
    const { cols, counts } = this, wanted = [...new Set(numbers.map((i) => Math.floor(i / counts.chunkRows)))];
    const requested = this.store.cache.get(wanted.map((chunk) => ({ array: counts, chunk }))), mesh = this.info.parts.has('mesh');
    const [index, values] = await Promise.all([this.#index(), requested, mesh && this.store.facesIndex()]); // facesIndex() is stored beside the index and will be needed for faces
    const chunks = new Map(wanted.map((chunk, i) => [chunk, values[i]])), out = new Map();
    for (const [chunk, rows] of chunks)
      if (!this.checked.has(chunk))
        this.#checkChunk(chunk, rows, index);
    let chunk, done, before;
    for (const number of [...new Set(numbers)].sort((a, b) => a - b)) {
      if (Math.floor(number / counts.chunkRows) !== chunk) {
        chunk = Math.floor(number / counts.chunkRows);
        done = chunk * counts.chunkRows;
        before = index.slice(chunk * cols, (chunk + 1) * cols);
      }
      const rows = chunks.get(chunk), at = (i) => (i - chunk * counts.chunkRows) * cols;
      for (; done < number; done++)
        for (let k = 0, from = at(done); k < cols; k++)
          before[k] += rows[from + k];
      out.set(number, new SubtreeRow(this.info, number, before.slice(), rows.slice(at(number), at(number) + cols)));
    }
    return out;
  }

  /** Returns the chunks of faces and vertices of subtrees that the table names: [{ array, chunk }]. */
  async blocks(rows) {
    const ranges = rows.map((r) => ({ path: '/subtrees/shared_chunks', from: r.outer, to: r.outer + r.outerFaces + r.outerVertices })), { store } = this;
    const outer = await store.rows(ranges), out = new Map();
    const add = (path, first, count, distances) => {
      const array = store.arrays.get(path), rows = FIXED_ROWS[path], block = Math.floor(first / rows); // `block` may be beyond the end of a short array
      const put = (chunk) => chunk >= 0 && chunk < array.chunkCount && out.set(array.number * 2 ** 32 + chunk, { array, chunk });
      for (let chunk = block; count && chunk * rows < first + count; chunk++)
        put(chunk);
      distances?.forEach((d) => put(block - d));
    };
    rows.forEach((r, i) => {
      if (!r.leaves)
        return;
      add('/mesh/faces', r.firstFace, r.faces, outer[i]?.subarray(0, r.outerFaces));
      add('/mesh/vertices', r.firstVertex, r.vertices, outer[i]?.subarray(r.outerFaces));
    });
    return [...out.values()];
  }
}

/** The counts and first rows of one subtree. */
class SubtreeRow {
  constructor(info, subtree, before, counts) {
    Object.assign(this, { info, subtree, before, counts });
    this.firstFace = before[0] + before[FACES] + counts[0];
    this.firstVertex = before[2] + before[VERTICES] + counts[2];
    this.faces = counts[FACES];
    this.vertices = counts[VERTICES];
    this.outer = before[OUTER] + before[OUTER + 1];
    this.outerFaces = counts[OUTER];
    this.outerVertices = counts[OUTER + 1];
  }

  get leaves() {
    let sum = 0;
    for (let at = BELOW + LEAF; at < this.counts.length; at += LEVEL_COLS)
      sum += this.counts[at];
    return sum;
  }

  #gray(level) {
    const { subtree_level: C } = this.info, at = BELOW + LEVEL_COLS * (level - C - 1) + GRAY;
    return level === C ? [this.subtree, 1] : [this.before[at], this.counts[at]];
  }

  /** Returns the row's data of a level below subtree_level. `first` and `count` are by type: white, black, leaf, gray. */
  level(level) {
    const at = BELOW + LEVEL_COLS * (level - this.info.subtree_level - 1), [group, groups] = this.#gray(level - 1);
    const by = (of, n) => [n * 8 - of[at + BLACK] - of[at + LEAF] - of[at + GRAY], of[at + BLACK], of[at + LEAF], of[at + GRAY]];
    const span = (column) => ({ from: this.before[at + column], to: this.before[at + column] + this.counts[at + column] });
    const first = by(this.before, group), count = by(this.counts, groups);
    if (first[0] < 0 || count[0] < 0)
      throw formatError(COUNTS, 'a level of a subtree has more nodes than the gray nodes above have children');
    return { level, group, groups, first, count, planes: span(PLANES), leafPlanes: span(LEAF_PLANES), refs: span(REFS), end: span(END) };
  }
}
