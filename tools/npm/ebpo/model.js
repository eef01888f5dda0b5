// A model: queries, levels and the bytes that they need. Asynchronous methods fetch missing bytes and repeat the call;
// methods that end in Sync throw an EbpoPendingError instead.
import { Heap } from './heap.js';
import { EbpoArgumentError, EbpoError, EbpoReadError, errorOf } from './errors.js';
import { OneQuery } from './one.js';
import { columnOf, findAttribute, partsOf, pickRows, queryAttribute, querySubtree, sortedRows, textureArrays, texturesOf } from './parts.js';
import { nodeArrays, ViewStream } from './view_stream.js';

const PENDING = -11;
const BATCH = 16384; // points of one call
const TURN = 50; // milliseconds for which a long query runs before it lets other events run
const SIDES = { both: 0, front: 1, back: 2 };
const LARGE = 4 << 20; // bytes of one request when the whole file is read
const NO_FACE = 0xffffffff;
const KEPT = 4; // query objects that are kept for later queries

/** Lets the event loop run. */
const turn = () => new Promise((resolve) => setTimeout(resolve));

/** Returns doubles of a typed array or an array of numbers, a multiple of `columns`. */
function doubles(values, columns, what) {
  const out = values instanceof Float64Array ? values : Float64Array.from(values);
  if (out.length % columns)
    throw new EbpoArgumentError(`expected ${columns} numbers for each ${what}, got ${out.length} numbers in all`, { status: 'EBPO_E_ARGUMENT' });
  return out;
}

/** Joins the parts of a query's batches: typed arrays of the same names. */
function join(parts) {
  if (parts.length === 1)
    return parts[0];
  const out = {};
  for (const [name, first] of Object.entries(parts[0])) {
    out[name] = new first.constructor(parts.reduce((n, part) => n + part[name].length, 0));
    let at = 0;
    for (const part of parts) {
      out[name].set(part[name], at);
      at += part[name].length;
    }
  }
  return out;
}

export class Model {
  #heap;
  #object;
  #source;
  #version;
  #flights = new Set(); // ranges that are being fetched, each with the promise `done`
  #samplers = new Map(); // query objects with the samplers of attributes
  #idle = []; // query objects that are not in use
  #used = new Set(); // query objects in use
  #one; // for queries of one point or ray
  #roundTrips = 0;
  #disposed = false;
  #info;

  /** Makes a model whose file is not open yet; callers use open(). */
  constructor(heap, source, { memory = 0, whole = false } = {}) {
    this.#heap = heap;
    this.#source = source;
    this.#version = source.version ?? '';
    // Supplied bytes are kept in addition to the budget of the model.
    const held = whole ? 2 ** 40 : Math.max(16 << 20, memory ? memory / 4 : 64 << 20);
    this.#object = heap.lend(source.name ?? 'model', (name) => heap.lend(this.#version, (version) => heap.call('ebpo_js_new', source.size, name, version, held)));
    if (!this.#object)
      throw errorOf(-1, 'not enough memory to open the file', '', -1);
  }

  /** Opens the file. `whole`: reads all of it first. */
  async openFile({ whole, signal }) {
    const { size, name } = this.#source;
    if (whole) {
      const ranges = [];
      for (let offset = 0; offset < size; offset += LARGE)
        ranges.push({ offset, size: Math.min(LARGE, size - offset) });
      await this.#fetch(ranges, signal);
    }
    await this.#repeat(() => this.#heap.lend(name ?? 'model', (text) => this.#heap.call('ebpo_js_open', this.#object, text, +whole)), this.#object, signal);
  }

  /** Opens the file and makes the model. */
  async load({ memory = 0, level = -1, whole = false, signal } = {}) {
    await this.openFile({ whole, signal });
    await this.#repeat(() => this.#heap.call('ebpo_js_load', this.#object, memory, level), this.#object, signal);
    return this;
  }

  // ---- bytes ----

  #alive() {
    if (this.#disposed)
      throw new EbpoError('the model has been disposed of', { status: 'EBPO_E_ARGUMENT' });
  }

  #supply({ offset, size }, bytes) {
    if (bytes.length !== size)
      throw new EbpoReadError(`the source returned ${bytes.length} bytes at ${offset}, expected ${size}`);
    const heap = this.#heap;
    this.#check(heap.lend(bytes, (at) => heap.lend(this.#version, (version) => heap.call('ebpo_js_supply', this.#object, offset, size, at, version))));
  }

  async #fetch(ranges, signal) {
    const wanted = ranges.filter((r) => ![...this.#flights].some((f) => f.offset <= r.offset && r.offset + r.size <= f.offset + f.size));
    const others = [...this.#flights].map((flight) => flight.done.catch(() => {}));
    if (wanted.length) {
      const flights = wanted.map((range) => ({ ...range }));
      const done = this.#source.read(wanted, signal);
      this.#roundTrips++;
      for (const flight of flights)
        this.#flights.add(Object.assign(flight, { done }));
      let parts;
      try {
        parts = await done;
      } finally {
        flights.forEach((flight) => this.#flights.delete(flight));
      }
      this.#alive();
      parts.forEach((bytes, i) => this.#supply(wanted[i], bytes));
    } else {
      await Promise.all(others);
    }
  }

  #needed() {
    this.#check(this.#heap.call('ebpo_js_needed', this.#object));
    const numbers = this.#heap.result(this.#object, 0, Float64Array), out = [];
    for (let i = 0; i < numbers.length; i += 2)
      out.push({ offset: numbers[i], size: numbers[i + 1] });
    return out;
  }

  #check(status, object = this.#object) {
    if (status)
      throw this.#heap.error(object, status);
  }

  #begin() {
    return this.#heap.call('ebpo_js_begin', this.#object);
  }

  #end(operation) {
    if (!this.#disposed && !this.#heap.failed)
      this.#heap.call('ebpo_js_end', this.#object, operation);
  }

  /** Repeats call(), and fetches the bytes of all models that it needs, until its status is not pending. `completed` returns
   * the number of results that need no more bytes. */
  static async repeat(models, call, object, signal, completed = () => 0) {
    signal?.throwIfAborted();
    const begin = () => models.map((model) => model.#begin()), end = (operations) => models.forEach((model, i) => model.#end(operations[i]));
    let kept = begin(), results = 0; // bytes used since `kept` began stay available
    try {
      for (;;) {
        const repetition = begin(), status = call(), now = status === PENDING ? completed() : results;
        if (now > results) { // bytes of completed results that this repetition did not use need not stay
          end(kept);
          kept = repetition;
          results = now;
        } else {
          end(repetition);
        }
        if (!status)
          return;
        if (status !== PENDING)
          throw models[0].#heap.error(object, status);
        const needed = models.map((model) => model.#needed());
        await Promise.all(models.map((model, i) => model.#fetch(needed[i], signal)));
        models.forEach((model) => model.#alive());
        signal?.throwIfAborted();
      }
    } finally {
      end(kept);
    }
  }

  #repeat(call, object, signal, completed) {
    return Model.repeat([this], call, object, signal, completed);
  }

  // ---- query objects: each has the results of one query at a time ----

  #take() {
    this.#alive();
    const query = this.#idle.pop() ?? this.#heap.call('ebpo_js_query', this.#object);
    if (!query)
      throw errorOf(-1, 'not enough memory for a query', '', -1);
    this.#heap.call('ebpo_js_start', query);
    this.#used.add(query);
    return query;
  }

  #give(query) {
    if (this.#disposed || this.#heap.failed)
      return;
    this.#used.delete(query);
    if (this.#idle.length < KEPT)
      this.#idle.push(query);
    else
      this.#heap.call('ebpo_js_query_free', query);
  }

  #results(query) {
    return (n, Type) => this.#heap.result(query, n, Type);
  }

  /** Repeats call(query) until no bytes are missing, and returns read(array) of its results; array(n, Type): result array n. */
  async #run({ call, read, completed }, signal) {
    const query = this.#take();
    try {
      await this.#repeat(() => call(query), query, signal, completed && (() => this.#heap.call('ebpo_js_completed', query)));
      return read(this.#results(query));
    } finally {
      this.#give(query);
    }
  }

  #runNow({ call, read }) {
    const query = this.#take();
    try {
      this.#check(call(query), query);
      return read(this.#results(query));
    } finally {
      this.#give(query);
    }
  }

  /** Returns a call of an exported function with a query object. */
  #of(name, ...args) {
    return (query) => this.#heap.call(name, query, ...args);
  }

  #oneQuery() {
    this.#alive();
    this.#one ??= new OneQuery(this.#heap, this.#take());
    return this.#one;
  }

  // ---- queries ----

  /** Returns queries of batches of values, which are {name, values, columns, args, read, completed, most}. */
  #batches({ name, values, columns, args, read, completed = true, most = BATCH }) {
    const out = [];
    for (let first = 0; first === 0 || first < values.length; first += most * columns) {
      const part = values.subarray(first, first + most * columns);
      out.push({ read, completed, call: (query) => this.#heap.lend(part, (at) => this.#heap.call(name, query, at, part.length / columns, ...args)) });
    }
    return out;
  }

  async #many(batches, signal) {
    const parts = [];
    let began = performance.now();
    for (const batch of this.#batches(batches)) {
      parts.push(await this.#run(batch, signal));
      if (performance.now() - began > TURN) {
        await turn();
        began = performance.now();
      }
    }
    return parts;
  }

  #manyNow(batches) {
    return this.#batches(batches).map((batch) => this.#runNow(batch));
  }

  #inside(points, { level = -1 } = {}) {
    return { name: 'ebpo_js_inside', values: doubles(points, 3, 'point'), columns: 3, args: [level],
      read: (array) => ({ where: array(0, Int8Array), winding: array(1, Int32Array) }) };
  }

  async inside(points, options = {}) {
    return join(await this.#many(this.#inside(points, options), options.signal));
  }

  insideSync(points, options = {}) {
    if (points.length === 3)
      return this.#oneQuery().inside(points, options.level ?? -1);
    return join(this.#manyNow(this.#inside(points, options)));
  }

  async windingBounds(points, { width = 1e-9, signal } = {}) {
    const read = (array) => ({ bounds: array(0, Float64Array) });
    const { bounds } = join(await this.#many({ name: 'ebpo_js_winding', values: doubles(points, 3, 'point'), columns: 3, args: [width], completed: false, read }, signal));
    return { lo: bounds.filter((_, i) => i % 2 === 0), hi: bounds.filter((_, i) => i % 2 === 1) };
  }

  #distance(points, { level = -1, maxDistance = Infinity, unsigned = false } = {}) {
    return { name: 'ebpo_js_distance', values: doubles(points, 3, 'point'), columns: 3, args: [level, maxDistance, +unsigned],
      read: (array) => ({ distance: array(0, Float64Array), point: array(2, Float64Array), normal: array(3, Float64Array),
        face: array(4, Uint32Array), lo: array(5, Float64Array), hi: array(1, Float64Array) }) };
  }

  async distance(points, options = {}) {
    return join(await this.#many(this.#distance(points, options), options.signal));
  }

  distanceSync(points, options = {}) {
    if (points.length === 3)
      return this.#oneQuery().distance(points, options.level ?? -1, options.maxDistance ?? Infinity, options.unsigned ? 1 : 0);
    return join(this.#manyNow(this.#distance(points, options)));
  }

  #nearest(point, { radius = Infinity, most = radius === Infinity ? 1 : 0 } = {}) {
    const values = doubles(point, 3, 'point');
    return { call: (query) => this.#heap.lend(values, (at) => this.#heap.call('ebpo_js_within', query, at, radius, most)),
      read: (array) => ({ distance: array(0, Float64Array), point: array(2, Float64Array), normal: array(3, Float64Array), face: array(4, Uint32Array) }) };
  }

  async nearest(point, options = {}) {
    return this.#run(this.#nearest(point, options), options.signal);
  }

  nearestSync(point, options = {}) {
    return this.#runNow(this.#nearest(point, options));
  }

  #rays(name, rays, { tMax = Infinity, sides = 'both' } = {}) {
    if (!(sides in SIDES))
      throw new EbpoArgumentError(`sides is both, front or back, not ${sides}`, { status: 'EBPO_E_ARGUMENT' });
    const all = name === 'ebpo_js_ray_all';
    return { name, values: doubles(rays, 6, 'ray'), columns: 6, args: [tMax, SIDES[sides]], completed: !all, most: all ? BATCH / 16 : BATCH,
      read: (array) => name === 'ebpo_js_ray_any' ? { hit: array(0, Uint8Array) }
        : { t: array(0, Float64Array), face: array(1, Uint32Array), side: array(2, Int8Array), ...(all ? { begin: array(3, Uint32Array) } : {}) } };
  }

  async rays(rays, options = {}) {
    return join(await this.#many(this.#rays('ebpo_js_ray_first', rays, options), options.signal));
  }

  raysSync(rays, options = {}) {
    const sides = options.sides ?? 'both';
    if (rays.length === 6 && sides in SIDES)
      return this.#oneQuery().ray(rays, options.tMax ?? Infinity, SIDES[sides]);
    return join(this.#manyNow(this.#rays('ebpo_js_ray_first', rays, options)));
  }

  async raysAny(rays, options = {}) {
    return join(await this.#many(this.#rays('ebpo_js_ray_any', rays, options), options.signal)).hit;
  }

  raysAnySync(rays, options = {}) {
    return join(this.#manyNow(this.#rays('ebpo_js_ray_any', rays, options))).hit;
  }

  /** Joins batches of all hits: `begin` counts from the first batch. */
  #joinAll(parts) {
    let hits = 0;
    const begin = [0];
    for (const part of parts) {
      for (let i = 1; i < part.begin.length; i++)
        begin.push(hits + part.begin[i]);
      hits += part.t.length;
      delete part.begin;
    }
    return { ...join(parts), begin: Uint32Array.from(begin) };
  }

  async raysAll(rays, options = {}) {
    return this.#joinAll(await this.#many(this.#rays('ebpo_js_ray_all', rays, options), options.signal));
  }

  raysAllSync(rays, options = {}) {
    return this.#joinAll(this.#manyNow(this.#rays('ebpo_js_ray_all', rays, options)));
  }

  #box(name, min, max, ...args) {
    const box = Float64Array.of(...min, ...max);
    if (box.length !== 6)
      throw new EbpoArgumentError('expected three numbers for each corner of the box', { status: 'EBPO_E_ARGUMENT' });
    return { call: (query) => this.#heap.lend(box, (at) => this.#heap.call(name, query, at, ...args)),
      read: (array) => name === 'ebpo_js_box_faces' ? array(0, Uint32Array) : { face: array(0, Uint32Array), corners: array(1, Float64Array) } };
  }

  async boxFaces(min, max, { signal } = {}) {
    return this.#run(this.#box('ebpo_js_box_faces', min, max), signal);
  }

  boxFacesSync(min, max) {
    return this.#runNow(this.#box('ebpo_js_box_faces', min, max));
  }

  async boxTriangles(min, max, { most = Infinity, signal } = {}) {
    return this.#run(this.#box('ebpo_js_box_triangles', min, max, most), signal);
  }

  // ---- the file ----

  get info() {
    this.#info ??= JSON.parse(new TextDecoder().decode(this.#fact('ebpo_js_info', Uint8Array)));
    return this.#info;
  }

  get stats() {
    const [memory, memoryPeak, budget, resident, cutLevel, hits, loads, evicted, bytesRead, reads, suppliedBytes] =
      this.#fact('ebpo_js_stats', Float64Array);
    return { memory, memoryPeak, budget, resident: !!resident, cutLevel, hits, loads, evicted, bytesRead, reads, suppliedBytes, roundTrips: this.#roundTrips,
      heap: this.#heap.memory.buffer.byteLength };
  }

  #fact(name, Type) {
    this.#alive();
    this.#check(this.#heap.call(name, this.#object));
    return this.#heap.result(this.#object, 0, Type);
  }

  async measure({ signal } = {}) {
    const read = (array) => array(0, Float64Array), x = await this.#run({ call: this.#of('ebpo_js_measure'), read }, signal);
    return { area: x[0], volume: x[1], centroid: x.slice(2, 5), inertia: x.slice(5, 14), volumeLo: x[14], volumeHi: x[15], integral: x[16] };
  }

  async check({ signal } = {}) {
    await this.#run({ call: this.#of('ebpo_js_check'), read: () => {} }, signal);
  }

  async mesh({ order = 'source', signal } = {}) {
    const read = (array) => ({ vertices: array(0, Float32Array).length ? array(0, Float32Array) : array(1, Float64Array), faces: array(2, Uint32Array) });
    return this.#run({ call: this.#of('ebpo_js_mesh', +this.#isSource(order)), read }, signal);
  }

  #isSource(order) {
    if (order !== 'source' && order !== 'file')
      throw new EbpoArgumentError(`order is source or file, not ${order}`, { status: 'EBPO_E_ARGUMENT' });
    return order === 'source';
  }

  async maps({ signal } = {}) {
    return this.#run({ call: this.#of('ebpo_js_maps'), read: (array) => ({ vertex: array(0, Uint32Array), face: array(1, Uint32Array) }) }, signal);
  }

  async corners(numbers, { signal } = {}) {
    const values = Float64Array.from(numbers), Type = this.info.doubles ? Float64Array : Float32Array;
    return this.#run({ call: (query) => this.#heap.lend(values, (at) => this.#heap.call('ebpo_js_corners', query, at, values.length)), read: (array) => array(0, Type) }, signal);
  }

  async attribute(name, { order = 'source', signal } = {}) {
    const { info } = this, { index, column } = findAttribute(info, name), { element, list } = info.attributes[index];
    const sorted = this.#isSource(order) && partsOf(info).includes('maps') && (element === 'vertex' || element === 'face');
    const values = columnOf(await this.#run(queryAttribute(this.#heap, info, index), signal), column, list);
    return sorted ? pickRows(values, sortedRows((await this.maps({ signal }))[element])) : values;
  }

  async textures({ bytes = true, signal } = {}) {
    const { info } = this, arrays = textureArrays(info), values = {};
    for (const [name, n] of Object.entries(arrays))
      if (bytes || name !== 'bytes')
        values[name] = await this.#run(queryAttribute(this.#heap, info, n), signal);
    return texturesOf(info.attributes[arrays.name]?.rows ?? 0, values);
  }

  async sample(names, points, faces, { signal } = {}) {
    const values = doubles(points, 3, 'point'), numbers = Float64Array.from(faces, (face) => face === NO_FACE ? -1 : face);
    if (values.length !== 3 * numbers.length)
      throw new EbpoArgumentError(`expected a face for each of ${values.length / 3} points, got ${numbers.length} faces`, { status: 'EBPO_E_ARGUMENT' });
    const heap = this.#heap, known = this.#samplers.get(names), sampler = known ?? this.#take();
    try {
      await this.#repeat(() => heap.lend(names, (text) => heap.call('ebpo_js_sampler', sampler, text)), sampler, signal);
    } catch (error) {
      if (!known)
        this.#give(sampler);
      throw error;
    }
    if (!this.#samplers.has(names))
      this.#samplers.set(names, sampler);
    this.#check(heap.lend(values, (at) => heap.lend(numbers, (of) => heap.call('ebpo_js_sample', sampler, at, of, numbers.length))), sampler);
    return heap.result(sampler, 0, Float64Array);
  }

  async subtree(octcode = 1n, options = {}) {
    return this.#run(querySubtree(this.#heap, this.info, octcode, options), options.signal);
  }

  octcode([x, y, z], level) {
    this.#alive();
    return BigInt.asUintN(64, this.#heap.call('ebpo_js_octcode', this.#object, x, y, z, level));
  }

  view(options = {}) {
    return new ViewStream({
      begin: () => this.#take(),
      end: (query) => this.#drop(query),
      array: (query) => this.#results(query),
      call: (query, name, ...args) => { this.#alive(); this.#check(this.#heap.call(name, query, ...args), query); },
      lend: (numbers, use) => this.#heap.lend(numbers, use),
      repeat: (call, query, signal) => { this.#alive(); return this.#repeat(() => this.#heap.call(call[0], query, ...call.slice(1)), query, signal); },
    }, options);
  }

  /** Frees a query object. */
  #drop(query) {
    if (!this.#disposed && !this.#heap.failed) {
      this.#used.delete(query);
      this.#heap.call('ebpo_js_query_free', query);
    }
  }

  async level(level, { cellFaces = true, signal } = {}) {
    const read = (array) => ({ level, vertices: array(0, Float64Array), triangles: array(1, Uint32Array), corners: array(2, Uint8Array),
      normals: array(3, Float32Array), octcode: array(4, BigUint64Array), type: array(5, Uint8Array), winding: array(6, Int32Array),
      nodeVolume: array(7, Float64Array), vertexCount: array(8, Uint32Array), polygonCount: array(9, Uint32Array),
      colour: array(10, Uint32Array), volume: array(11, Float64Array)[0] });
    return this.#run({ call: this.#of('ebpo_js_level', level, +cellFaces), read }, signal);
  }

  async* levels({ planes = true, polygons = false, signal } = {}) {
    const query = this.#take(), heap = this.#heap, array = this.#results(query);
    try {
      this.#check(heap.call('ebpo_js_stream', query, +planes, +polygons), query);
      for (;;) {
        this.#alive();
        await this.#repeat(() => heap.call('ebpo_js_next_level', query), query, signal);
        const facts = array(13, Float64Array);
        if (!facts.length)
          return;
        yield { level: facts[0], bytes: facts[2], volume: facts[3], ...nodeArrays(array, polygons) };
      }
    } finally {
      this.#drop(query);
    }
  }

  /** Frees the model. The heap of models that were opened alone is collected with them. */
  dispose() {
    if (!this.#disposed && !this.#heap.failed) {
      [...this.#idle, ...this.#used].forEach((query) => this.#heap.call('ebpo_js_query_free', query));
      if (this.#heap.exports.ebpo_js_unload) // not in the module for drawing
        this.#heap.call('ebpo_js_unload', this.#object);
      this.#heap.call('ebpo_js_free', this.#object);
    }
    this.#disposed = true;
  }

  /** For collide.js: heap and object of a model. */
  static parts(model) {
    model.#alive();
    return { heap: model.#heap, object: model.#object };
  }
}

if (Symbol.dispose)
  Model.prototype[Symbol.dispose] = Model.prototype.dispose;

/** Opens a model with a compiled module. */
export async function openWith(loading, sourcing, options = {}, Kind = Model) {
  const { signal, heap: limit, beside } = options;
  const [module, source] = await Promise.all([loading, sourcing]);
  signal?.throwIfAborted();
  const whole = options.whole ?? !!source.inMemory;
  const model = new Kind(beside ? Model.parts(beside).heap : new Heap(module, limit), source, { ...options, whole });
  try {
    return await model.load({ ...options, whole });
  } catch (error) {
    model.dispose();
    throw error;
  }
}
