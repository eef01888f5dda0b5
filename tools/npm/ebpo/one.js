// Queries of one point or ray a call, whose results are few numbers: no arrays are copied to and from the module's memory.

const three = (numbers, at) => {
  const out = new Float64Array(3);
  out[0] = numbers[at];
  out[1] = numbers[at + 1];
  out[2] = numbers[at + 2];
  return out;
};

/** Each method makes its arrays itself and calls its own exported function, because engines optimize calls and
 * constructors only where they see the same one each time. Arguments are converted to numbers before the call, so
 * that an exception in the conversion is not taken for a trap of the module. */
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
      this.#numbers = new Float64Array(this.#heap.memory.buffer, this.#heap.call('ebpo_js_numbers', this.#query) >>> 0, 10);
    return this.#numbers;
  }

  inside(p, level) {
    const px = +p[0], py = +p[1], pz = +p[2], deepest = +level;
    let status;
    this.#heap.ready();
    try {
      status = this.#insideOne(this.#query, px, py, pz, deepest);
    } catch (cause) {
      throw this.#heap.trapped('ebpo_js_inside_one', cause);
    }
    const x = this.#results(status), where = new Int8Array(1), winding = new Int32Array(1);
    where[0] = x[0];
    winding[0] = x[1];
    return { where, winding };
  }

  distance(p, level, maxDistance, unsigned) {
    const px = +p[0], py = +p[1], pz = +p[2], deepest = +level, farthest = +maxDistance;
    let status;
    this.#heap.ready();
    try {
      status = this.#distanceOne(this.#query, px, py, pz, deepest, farthest, unsigned);
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
    const ox = +r[0], oy = +r[1], oz = +r[2], dx = +r[3], dy = +r[4], dz = +r[5], end = +tMax;
    let status;
    this.#heap.ready();
    try {
      status = this.#rayOne(this.#query, ox, oy, oz, dx, dy, dz, end, sides);
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
