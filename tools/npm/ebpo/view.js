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
      await this.#read(...call); // compares the chunks
  }

  /** Evaluates a call with numbers as its first arguments, after the first `skipped` ones in rows, and returns its result arrays. */
  async #read(name, numbers, columns, args, signal, skipped = 0) {
    this.#early?.push([name, numbers, columns, args, signal, skipped]);
    const { heap, object } = Model.parts(this), values = Float64Array.from(numbers);
    await Model.repeat([this], () => heap.lend(values, (at) => heap.call(name, object, at, (values.length - skipped) / columns, ...args)), object, signal);
    return (n, Type) => heap.result(object, n, Type);
  }

  /**
   * Reads nodes: `wanted` is [{ level, part }]. A part is the number of a subtree; in levels without subtrees, 4,096 groups
   * of siblings; -1 is the whole level. Parts of the same subtree are adjacent, with ascending levels. Reads only the first
   * parts, with about `bytes` bytes of the file.
   */
  async nodes(wanted, { bytes = Infinity, signal } = {}) {
    const array = await this.#read('ebpo_js_nodes', wanted.flatMap(({ level, part }) => [level, part]), 2, [bytes], signal);
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

  /**
   * Reads the faces of leaves: `leaves` is [{ level, group, octant, subtree }], where `group` is the number of the siblings in
   * their level, and `subtree` is -1 above the subtrees. Returns for each leaf the faces' numbers, corners (9 numbers each)
   * and colours (9 bytes each; undefined: none).
   */
  async leafFaces(leaves, { signal } = {}) {
    const array = await this.#read('ebpo_js_leaf_faces', leaves.flatMap(({ level, group, octant, subtree }) => [level, group, octant, subtree]), 4, [], signal);
    const counts = array(0, Uint32Array), numbers = array(1, Uint32Array), corners = array(2, this.#Corners), colours = array(3, Uint8Array);
    let at = 0;
    return Array.from(counts, (count) => {
      const from = at, to = at += count;
      return { numbers: numbers.subarray(from, to), corners: corners.subarray(9 * from, 9 * to), colours: this.coloured ? colours.subarray(9 * from, 9 * to) : undefined };
    });
  }

  /** Returns the table of patches of the part `surface`: [{ level, at, error, triangles, faces, child, end }]. */
  async patches({ signal } = {}) {
    const array = await this.#read('ebpo_js_patches', [], 1, [], signal), facts = array(0, Float64Array), out = [];
    for (let i = 0; i < facts.length; i += 9) {
      const [level, x, y, z, error, triangles, faces, child, end] = facts.subarray(i, i + 9);
      out.push({ level, at: [x, y, z], error, triangles, faces, child, end });
    }
    return out;
  }

  /**
   * Reads patches as one mesh without cracks: `wanted` is [{ patch, faces }], with ascending indices in the table. With `faces`, the model's faces replace the
   * patch. Positions are (coordinate - center) * scale; normals are octahedral.
   */
  async surface(wanted, { center, scale, signal }) {
    const numbers = [...center, scale, ...wanted.flatMap(({ patch, faces }) => [patch, +faces])];
    const array = await this.#read('ebpo_js_surface', numbers, 2, [], signal, 4);
    const [triangles, faces] = array(0, Float64Array), hue = array(3, Uint8Array);
    return { triangles, faces, position: array(1, Float32Array), normal: array(2, Int16Array), hue: hue.length ? hue : undefined, index: array(4, Uint32Array) };
  }

  /** Returns the number of bytes of the file for levels 0 to i. */
  async levelBytes({ signal } = {}) {
    const { heap, object } = Model.parts(this);
    await Model.repeat([this], () => heap.call('ebpo_js_level_bytes', object), object, signal);
    return heap.result(object, 0, Float64Array);
  }
}
