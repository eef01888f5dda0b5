// Pairs of models: intersecting faces, relations and distances. This part has its own module, which also contains all of
// the package's other functions; both models of a pair must be opened with open() of this file, the second one
// with the option `beside`.
import { loadModule } from './heap.js';
import { EbpoArgumentError, errorOf } from './errors.js';
import { Model, openWith } from './model.js';
import { sourceOf } from './source.js';

export * from './index.js';

export const RELATIONS = ['disjoint', 'touching', 'intersecting', 'a inside b', 'b inside a', 'equal'];
const IDENTITY = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0], scale: 1 };

/** Opens a model, as open() of the package does. `beside`: another model, which can then be paired with this one. */
export const open = (from, options = {}) =>
  openWith(loadModule(new URL('./ebpo-collide.wasm', import.meta.url)), sourceOf(from, options, options.signal), options);

const posesOf = ({ poseA = {}, poseB = {} } = {}) => Float64Array.from([poseA, poseB].flatMap((pose) => {
  const { rotation, translation, scale } = { ...IDENTITY, ...pose };
  return [...rotation, ...translation, scale];
}));

/** Two models, for queries of pairs. */
export class Pair {
  #models;
  #objects;
  #heap;
  #pair;

  /** Use pair(). */
  constructor(a, b) {
    const parts = [a, b].map(Model.parts);
    this.#models = a === b ? [a] : [a, b];
    this.#objects = parts.map(({ object }) => object);
    this.#heap = parts[0].heap;
    if (parts[1].heap !== this.#heap || !this.#heap.exports.ebpo_js_pair_new)
      throw new EbpoArgumentError('open both models with open() of ebpo/collide, the second one with the option beside', { status: 'EBPO_E_ARGUMENT' });
    this.#pair = this.#heap.call('ebpo_js_pair_new');
    if (!this.#pair)
      throw errorOf(-1, 'not enough memory for the pair', '', -1);
  }

  #run(call, signal) {
    return Model.repeat(this.#models, call, this.#pair, signal);
  }

  /** Makes the pair. */
  async make(signal) {
    await this.#run(() => this.#heap.call('ebpo_js_pair_make', this.#pair, ...this.#objects), signal);
    return this;
  }

  #query(name, options, ...more) {
    const poses = posesOf(options);
    return this.#run(() => this.#heap.lend(poses, (at) => this.#heap.call(name, this.#pair, at, ...more)), options?.signal);
  }

  #array(n, Type) {
    return this.#heap.result(this.#pair, n, Type);
  }

  /** One pair of intersecting faces {a, b, kind}, or null. */
  async first(options) {
    await this.#query('ebpo_js_pair_first', options);
    const faces = this.#array(0, Uint32Array);
    return faces.length ? { a: faces[0], b: faces[1], kind: this.#array(1, Uint8Array)[0] } : null;
  }

  /** All pairs of intersecting faces: source indices [n][2], kinds [n] and file indices [n][2]. */
  async all(options) {
    await this.#query('ebpo_js_pair_all', options);
    return { faces: this.#array(0, Uint32Array), kind: this.#array(1, Uint8Array), number: this.#array(2, Uint32Array) };
  }

  /** Segments in which faces cross: both ends [n][2][3], and the faces [n][2]. */
  async contacts(options) {
    await this.#query('ebpo_js_pair_contacts', options);
    return { segments: this.#array(0, Float64Array), faces: this.#array(1, Uint32Array) };
  }

  /** One of RELATIONS. */
  async relation(options) {
    await this.#query('ebpo_js_pair_relation', options);
    return RELATIONS[this.#array(0, Int32Array)[0]];
  }

  /** Minimum distance of the faces. */
  async distance(options) {
    await this.#query('ebpo_js_pair_distance', options, options?.tolerance ?? 0);
    const x = this.#array(0, Float64Array), faces = this.#array(1, Uint32Array);
    return { lo: x[0], hi: x[1], pointA: x.slice(2, 5), pointB: x.slice(5, 8), a: faces[0], b: faces[1] };
  }

  dispose() {
    if (this.#pair && !this.#heap.failed)
      this.#heap.call('ebpo_js_pair_free', this.#pair);
    this.#pair = 0;
  }
}

/** Makes a pair of two models, or of one model twice. */
export const pair = (a, b, { signal } = {}) => new Pair(a, b).make(signal);
