// Queries of one point or ray a call, whose results are few numbers: no arrays are copied to and from the module's memory.

const one = (Type, value) => {
  const out = new Type(1);
  out[0] = value;
  return out;
};

const three = (numbers, at) => {
  const out = new Float64Array(3);
  out[0] = numbers[at];
  out[1] = numbers[at + 1];
  out[2] = numbers[at + 2];
  return out;
};

export class OneQuery {
  #heap;
  #query;
  #numbers; // the results, in the module's memory

  /** `query`: a query object, which is used for these queries only. */
  constructor(heap, query) {
    this.#heap = heap;
    this.#query = query;
  }

  #results(status) {
    if (status)
      throw this.#heap.error(this.#query, status);
    if (!this.#numbers?.length) // the memory has grown
      this.#numbers = new Float64Array(this.#heap.memory.buffer, this.#heap.call('ebpo_js_numbers', this.#query), 10);
    return this.#numbers;
  }

  inside(p, level) {
    const x = this.#results(this.#heap.call('ebpo_js_inside_one', this.#query, p[0], p[1], p[2], level));
    return { where: one(Int8Array, x[0]), winding: one(Int32Array, x[1]) };
  }

  distance(p, level, maxDistance, unsigned) {
    const x = this.#results(this.#heap.call('ebpo_js_distance_one', this.#query, p[0], p[1], p[2], level, maxDistance, unsigned));
    return { distance: one(Float64Array, x[0]), point: three(x, 3), normal: three(x, 6), face: one(Uint32Array, x[9]),
      lo: one(Float64Array, x[1]), hi: one(Float64Array, x[2]) };
  }

  ray(r, tMax, sides) {
    const x = this.#results(this.#heap.call('ebpo_js_ray_one', this.#query, r[0], r[1], r[2], r[3], r[4], r[5], tMax, sides));
    return { t: one(Float64Array, x[0]), face: one(Uint32Array, x[1]), side: one(Int8Array, x[2]) };
  }
}
