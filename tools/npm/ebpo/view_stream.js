// Nodes in the order of their importance to an observer.
import { EbpoArgumentError } from './errors.js';

const PRIORITIES = ['level', 'distance', 'pixels', 'front-to-back'];
const UNSEEN = ['last', 'never'];
const ENDS = ['', 'done', 'bytes', 'nodes'];
const OBSERVER = { eye: [0, 0, 0], direction: [0, 0, 0], up: [0, 1, 0], fov: 45, width: 1280, height: 720 };
const DEFAULTS = { priority: 'level', unseen: 'last', pixels: 0, distance: Infinity, level: -1, bytes: 0, nodes: 0, planes: true, polygons: false,
  windings: false, memory: 0, faces: false };
const OPTIONS = 25; // numbers of ebpo_js_view_set
const FACTS = 20; // result array of the end and the number of nodes

function indexOf(words, word) {
  if (!words.includes(word))
    throw new EbpoArgumentError(`expected one of ${words.join(', ')}, got ${word}`, { status: 'EBPO_E_ARGUMENT' });
  return words.indexOf(word);
}

/** Returns the results of a stream of nodes as typed arrays; see put_node in levels.c. */
export const nodeArrays = (array, polygons) => ({
  octcode: array(0, BigUint64Array), type: array(1, Uint8Array), winding: array(2, Int32Array), cell: array(3, Float64Array),
  nodeVolume: array(4, Float64Array), colour: array(5, Uint32Array), planeCount: array(6, Uint32Array), planes: array(7, Float64Array),
  ...(polygons ? { vertexCount: array(8, Uint32Array), vertices: array(9, Float64Array), polygonCount: array(10, Uint32Array),
    polygonFirst: array(11, Uint32Array), corners: array(12, Uint32Array) } : {}),
});

export class ViewStream {
  #access;
  #query;
  #options;
  /** Why next() returned null. */
  end;

  /** Use Model.view(). `access`: functions of the model. */
  constructor(access, options) {
    this.#access = access;
    this.#query = access.begin();
    try {
      this.change(options);
    } catch (error) {
      this.dispose();
      throw error;
    }
  }

  /** The query object. */
  get #object() {
    if (!this.#query)
      throw new EbpoArgumentError('the view has been disposed of', { status: 'EBPO_E_ARGUMENT' });
    return this.#query;
  }

  #call(name, ...args) {
    this.#access.call(this.#object, name, ...args);
  }

  /** Sets other options; options that are not given are kept. */
  change(options = {}) {
    const all = { ...DEFAULTS, ...this.#options, ...options }, observer = { ...OBSERVER, ...all.observer };
    const numbers = Float64Array.of(indexOf(PRIORITIES, all.priority), indexOf(UNSEEN, all.unseen), all.pixels, all.distance, all.level, all.bytes, all.nodes,
      +all.planes, +all.polygons, +all.windings, all.memory, +all.faces, all.observer ? 1 : 0, ...observer.eye, ...observer.direction, ...observer.up,
      observer.fov, observer.width, observer.height);
    if (numbers.length !== OPTIONS)
      throw new EbpoArgumentError('eye, direction and up are three numbers each', { status: 'EBPO_E_ARGUMENT' });
    this.#access.lend(numbers, (at) => this.#call('ebpo_js_view_set', at));
    this.#options = all;
  }

  #nodes() {
    const array = this.#access.array(this.#object), [end, count] = array(FACTS, Float64Array), flags = array(14, Uint8Array), sizes = array(15, Float64Array);
    const nodes = { count, ...nodeArrays(array, this.#options.polygons), level: array(13, Uint8Array), complete: flags.map((x) => x & 1), seen: flags.map((x) => x >> 1),
      distance: sizes.filter((_, i) => i % 2 === 0), pixels: sizes.filter((_, i) => i % 2 === 1) };
    const faces = () => ({ faceCount: array(16, Uint32Array), faceCorners: array(17, Float64Array), faceNumber: array(18, Uint32Array), faceRepeated: array(19, Uint8Array) });
    return [end, this.#options.faces && array(16, Uint32Array).length ? { ...nodes, ...faces() } : nodes];
  }

  async next({ most = 4096, signal } = {}) {
    await this.#access.repeat(['ebpo_js_view_next', most], this.#object, signal);
    const [end, nodes] = this.#nodes();
    this.end = ENDS[end] || undefined;
    return nodes.count ? nodes : null;
  }

  /** Iterates over the results of next(). */
  async* [Symbol.asyncIterator]() {
    for (let nodes; (nodes = await this.next());)
      yield nodes;
  }

  cut() {
    this.#call('ebpo_js_view_cut');
    return this.#nodes()[1];
  }

  get stats() {
    this.#call('ebpo_js_view_stats');
    const [nodes, white, black, leaves, gray, waiting, pixels, bytesRead] = this.#access.array(this.#object)(0, Float64Array);
    return { nodes, cut: { white, black, leaves, gray }, waiting, pixels, bytesRead };
  }

  async surface({ signal } = {}) {
    await this.#access.repeat(['ebpo_js_view_surface'], this.#object, signal);
    const array = this.#access.array(this.#object), [error, pixels, patches, faces] = array(4, Float64Array), colours = array(2, Uint8Array);
    return { vertices: array(0, Float64Array), normals: array(1, Float32Array), triangles: array(3, Uint32Array), ...(colours.length ? { colours } : {}),
      error, pixels, patches, faces };
  }

  dispose() {
    if (this.#query)
      this.#access.end(this.#query);
    this.#query = 0;
  }
}
