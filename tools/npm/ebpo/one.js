// Queries of one point or ray a call, whose results are few numbers: no arrays are copied to and from the module's memory.

const three = (numbers, at) => {
  const out = new Float64Array(3);
  out[0] = numbers[at];
  out[1] = numbers[at + 1];
  out[2] = numbers[at + 2];
  return out;
};

/** Each method makes its arrays itself and calls its own exported function, because engines optimize calls and
 * constructors only where they see the same one each time. */
export class OneQuery {
  #heap;
  #query;
  #numbers; // the results, in the module's memory
  #insideOne;
  #distanceOne;
  #rayOne;

  /** `query`: a query object, which is used for these queries only. */
  constructor(heap, query) {
    this.#heap = heap;
    this.#query = query;
    this.#insideOne = heap.exports.ebpo_js_inside_one;
    this.#distanceOne = heap.exports.ebpo_js_distance_one;
    this.#rayOne = heap.exports.ebpo_js_ray_one;
  }

  /** Returns the numbers after a call with this status. */
  #results(status) {
    if (status)
      throw this.#heap.error(this.#query, status);
    if (!this.#numbers?.length) // the memory has grown
      this.#numbers = new Float64Array(this.#heap.memory.buffer, this.#heap.call('ebpo_js_numbers', this.#query), 10);
    return this.#numbers;
  }

  inside(p, level) {
    let status;
    this.#heap.ready();
    try {
      status = this.#insideOne(this.#query, p[0], p[1], p[2], level);
    } catch (cause) {
      throw this.#heap.trapped('ebpo_js_inside_one', cause);
    }
    const x = this.#results(status), where = new Int8Array(1), winding = new Int32Array(1);
    where[0] = x[0];
    winding[0] = x[1];
    return { where, winding };
  }

  distance(p, level, maxDistance, unsigned) {
    let status;
    this.#heap.ready();
    try {
      status = this.#distanceOne(this.#query, p[0], p[1], p[2], level, maxDistance, unsigned);
    } catch (cause) {
      throw this.#heap.trapped('ebpo_js_distance_one', cause);
    }
    const x = this.#results(status), distance = new Float64Array(1), lo = new Float64Array(1), hi = new Float64Array(1), face = new Uint32Array(1);
    distance[0] = x[0];
    lo[0] = x[1];
    hi[0] = x[2];
    face[0] = x[9];
    return { distance, point: three(x, 3), normal: three(x, 6), face, lo, hi };
  }

  ray(r, tMax, sides) {
    let status;
    this.#heap.ready();
    try {
      status = this.#rayOne(this.#query, r[0], r[1], r[2], r[3], r[4], r[5], tMax, sides);
    } catch (cause) {
      throw this.#heap.trapped('ebpo_js_ray_one', cause);
    }
    const x = this.#results(status), t = new Float64Array(1), face = new Uint32Array(1), side = new Int8Array(1);
    t[0] = x[0];
    face[0] = x[1];
    side[0] = x[2];
    return { t, face, side };
  }
}
