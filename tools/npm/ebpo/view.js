// Nodes and faces for drawing. This part has its own small module, without queries, so that a first picture does not wait
// for the large one.
import { loadModule } from './heap.js';
import { Model, openWith } from './model.js';
import { sourceOf } from './source.js';

export { partsOf } from './parts.js';

/** Returns a promise of the compiled module, which is loaded once. */
export const viewModule = () => loadModule(new URL('./ebpo-view.wasm', import.meta.url));

/** Opens a file for drawing, as open() of the package does. `memory`: size of the cache of decoded data in bytes. */
export const openView = (from, options = {}) => openWith(viewModule(), sourceOf(from, options, options.signal), options, View);

function nodesOf(array) {
  const facts = array(0, Float64Array), types = array(1, Uint16Array), out = [];
  const counts = array(2, Uint8Array), planes = array(3, Uint32Array), leafCounts = array(4, Uint8Array), leafPlanes = array(5, Uint32Array), colours = array(6, Uint32Array);
  const at = [0, 0, 0, 0, 0, 0], next = (values, k, n) => values.subarray(at[k], at[k] += n);
  for (let i = 0; i < facts.length; i += 13) {
    const [level, part, group, groups] = facts.subarray(i, i + 4), [c, p, lc, lp, cl] = facts.subarray(i + 8, i + 13);
    out.push({ level, part, group, first: [...facts.subarray(i + 4, i + 8)], types: next(types, 0, groups), planeCounts: next(counts, 1, c), planes: next(planes, 2, p),
      leafPlaneCounts: next(leafCounts, 3, lc), leafPlanes: next(leafPlanes, 4, lp), grayColours: cl ? next(colours, 5, cl) : undefined });
  }
  return out;
}

function patchesOf(array) {
  const facts = array(0, Float64Array), out = [];
  for (let i = 0; i < facts.length; i += 9) {
    const [level, x, y, z, error, triangles, faces, child, end] = facts.subarray(i, i + 9);
    out.push({ level, at: [x, y, z], error, triangles, faces, child, end });
  }
  return out;
}

function surfaceOf(array) {
  const [triangles, faces] = array(0, Float64Array), hue = array(3, Uint8Array);
  return { triangles, faces, position: array(1, Float32Array), normal: array(2, Int16Array), hue: hue.length ? hue : undefined, index: array(4, Uint32Array) };
}

/** A file opened for drawing. */
export class View extends Model {
  #Corners; // class of arrays of coordinates
  #early;   // calls before the list of chunk checksums was read; undefined when it is read
  /** Resolves when all data returned so far are compared with the list of chunk checksums, which may arrive late. */
  sums;

  /** Use openView(). */
  async load({ memory = 64 << 20, whole = false, signal } = {}) {
    await this.openFile({ whole, signal });
    const { heap, object } = Model.parts(this);
    if (heap.call('ebpo_js_view', object, memory))
      this.#early = [];
    this.coloured = Boolean(heap.call('ebpo_js_coloured', object));
    this.#Corners = this.info.doubles ? Float64Array : Float32Array;
    this.sums = this.#early && this.#readSums(signal);
    this.sums?.catch(() => {}); // who awaits it reports the error
    return this;
  }

  async #readSums(signal) {
    const { heap, object } = Model.parts(this);
    await Model.repeat([this], () => heap.call('ebpo_js_sums', object), object, signal);
    const early = this.#early;
    this.#early = undefined;
    for (const call of early)
      await this.#read({ ...call, read: () => {} }); // compares the chunks
  }

  /**
   * Repeats call(heap, object) until no bytes are missing, and returns read(array) of its results; array(n, Type): result array n. The result arrays belong to all
   * calls of this view, of which several may wait for bytes, so they are read before another call can run.
   */
  async #results(call, read, signal) {
    const { heap, object } = Model.parts(this), array = (n, Type) => heap.result(object, n, Type);
    let out;
    await Model.repeat([this], () => {
      const status = call(heap, object);
      out = status ? undefined : read(array);
      return status;
    }, object, signal);
    return out;
  }

  /** Returns read(array) of a call with numbers as its first arguments: rows of `columns` numbers after the first `skipped` ones. */
  async #read({ name, numbers, columns = 1, skipped = 0, args = [], signal, read }) {
    this.#early?.push({ name, numbers, columns, skipped, args, signal });
    const values = Float64Array.from(numbers), count = (values.length - skipped) / columns;
    return this.#results((heap, object) => heap.lend(values, (at) => heap.call(name, object, at, count, ...args)), read, signal);
  }

  /**
   * Reads nodes: `wanted` is [{ level, part }]. A part is the number of a subtree; in levels without subtrees, 4,096 groups
   * of siblings; -1 is the whole level. Parts of the same subtree are adjacent, with ascending levels. Reads only the first
   * parts, with about `bytes` bytes of the file.
   */
  nodes(wanted, { bytes = Infinity, signal } = {}) {
    return this.#read({ name: 'ebpo_js_nodes', numbers: wanted.flatMap(({ level, part }) => [level, part]), columns: 2, args: [bytes], signal, read: nodesOf });
  }

  /**
   * Reads the faces of leaves: `leaves` is [{ level, group, octant, subtree }], where `group` is the number of the siblings in
   * their level, and `subtree` is -1 above the subtrees. Returns for each leaf the faces' numbers, corners (9 numbers each)
   * and colours (9 bytes each; undefined: none).
   */
  leafFaces(leaves, { signal } = {}) {
    const numbers = leaves.flatMap(({ level, group, octant, subtree }) => [level, group, octant, subtree]);
    return this.#read({ name: 'ebpo_js_leaf_faces', numbers, columns: 4, signal, read: (array) => this.#facesOf(array) });
  }

  #facesOf(array) {
    const counts = array(0, Uint32Array), numbers = array(1, Uint32Array), corners = array(2, this.#Corners), colours = array(3, Uint8Array);
    let at = 0;
    return Array.from(counts, (count) => {
      const from = at, to = at += count;
      return { numbers: numbers.subarray(from, to), corners: corners.subarray(9 * from, 9 * to), colours: this.coloured ? colours.subarray(9 * from, 9 * to) : undefined };
    });
  }

  /** Returns the table of patches of the part `surface`: [{ level, at, error, triangles, faces, child, end }]. */
  patches({ signal } = {}) {
    return this.#read({ name: 'ebpo_js_patches', numbers: [], signal, read: patchesOf });
  }

  /**
   * Reads patches as one mesh without cracks: `wanted` is [{ patch, faces }], with ascending indices in the table. With `faces`, the model's faces replace the
   * patch. Positions are (coordinate - center) * scale; normals are octahedral.
   */
  surface(wanted, { center, scale, signal }) {
    const place = [...center, scale], numbers = [...place, ...wanted.flatMap(({ patch, faces }) => [patch, +faces])];
    return this.#read({ name: 'ebpo_js_surface', numbers, columns: 2, skipped: place.length, signal, read: surfaceOf });
  }

  /** Reads the triangles that close the holes of a surface with the part `border`; like surface(), with flat normals and no colours. */
  caps({ center, scale, signal }) {
    return this.#read({ name: 'ebpo_js_caps', numbers: [...center, scale], signal, read: surfaceOf });
  }

  /** Returns the number of bytes of the file for levels 0 to i. */
  levelBytes({ signal } = {}) {
    return this.#results((heap, object) => heap.call('ebpo_js_level_bytes', object), (array) => array(0, Float64Array), signal);
  }
}
