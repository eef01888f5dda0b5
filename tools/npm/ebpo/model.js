// A model: queries, levels and the bytes that they need. Asynchronous methods fetch missing bytes and repeat the call;
// methods that end in Sync throw an EbpoPendingError instead.
import { Heap } from './heap.js';
import { EbpoArgumentError, EbpoError, EbpoReadError, errorOf } from './errors.js';

const PENDING = -11;
const BATCH = 16384; // points of one call
const TURN = 50; // milliseconds after which a long query lets other events run
const SIDES = { both: 0, front: 1, back: 2 };
const LARGE = 4 << 20;

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
  #flights = new Set(); // ranges that are being fetched
  #disposed = false;
  #info;

  /** Use open(). */
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

  /** Opens the file and makes the model. */
  async load({ memory = 0, level = -1, whole = false, signal } = {}) {
    const { size, name } = this.#source;
    if (whole) {
      const ranges = [];
      for (let offset = 0; offset < size; offset += LARGE)
        ranges.push({ offset, size: Math.min(LARGE, size - offset) });
      await this.#fetch(ranges, signal);
    }
    await this.#run(() => this.#heap.lend(name ?? 'model', (text) => this.#heap.call('ebpo_js_open', this.#object, text, +!whole)), signal);
    if (this.info.hasMesh || this.info.levels.length)
      await this.#run(() => this.#heap.call('ebpo_js_load', this.#object, memory, level), signal);
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

  /** Calls until the bytes that the call needs have arrived. */
  async #run(call, signal, object = this.#object) {
    this.#alive();
    signal?.throwIfAborted();
    const operation = this.#heap.call('ebpo_js_begin', this.#object);
    try {
      for (let status; (status = call());) {
        if (status !== PENDING)
          this.#check(status, object);
        await this.#fetch(this.#needed(), signal);
        signal?.throwIfAborted();
        this.#alive();
      }
    } finally {
      if (!this.#disposed && !this.#heap.failed)
        this.#heap.call('ebpo_js_end', this.#object, operation);
    }
  }

  #runNow(call) {
    this.#alive();
    const operation = this.#heap.call('ebpo_js_begin', this.#object);
    try {
      this.#check(call());
    } finally {
      if (!this.#heap.failed)
        this.#heap.call('ebpo_js_end', this.#object, operation);
    }
  }

  // ---- queries ----

  /** Evaluates a query of many items in batches; `query` is {values, columns, call, read}. */
  async #many({ values, columns, call, read }, signal) {
    const parts = [];
    let began = performance.now();
    for (let first = 0; first === 0 || first < values.length; first += BATCH * columns) {
      const part = values.subarray(first, first + BATCH * columns);
      await this.#run(() => this.#heap.lend(part, (at) => call(at, part.length / columns)), signal);
      parts.push(read());
      if (performance.now() - began > TURN) {
        await turn();
        began = performance.now();
      }
    }
    return parts;
  }

  #manyNow({ values, columns, call, read }) {
    const parts = [];
    for (let first = 0; first === 0 || first < values.length; first += BATCH * columns) {
      const part = values.subarray(first, first + BATCH * columns);
      this.#runNow(() => this.#heap.lend(part, (at) => call(at, part.length / columns)));
      parts.push(read());
    }
    return parts;
  }

  #array(n, Type) {
    return this.#heap.result(this.#object, n, Type);
  }

  #inside(points, { level = -1 } = {}) {
    return { values: doubles(points, 3, 'point'), columns: 3,
      call: (at, count) => this.#heap.call('ebpo_js_inside', this.#object, at, count, level),
      read: () => ({ where: this.#array(0, Int8Array), winding: this.#array(1, Int32Array) }) };
  }

  async inside(points, options = {}) {
    return join(await this.#many(this.#inside(points, options), options.signal));
  }

  insideSync(points, options = {}) {
    return join(this.#manyNow(this.#inside(points, options)));
  }

  #distance(points, { level = -1, maxDistance = Infinity, unsigned = false } = {}) {
    return { values: doubles(points, 3, 'point'), columns: 3,
      call: (at, count) => this.#heap.call('ebpo_js_distance', this.#object, at, count, level, maxDistance, +unsigned),
      read: () => ({ distance: this.#array(0, Float64Array), point: this.#array(2, Float64Array), normal: this.#array(3, Float64Array),
        face: this.#array(4, Uint32Array), lo: this.#array(5, Float64Array), hi: this.#array(1, Float64Array) }) };
  }

  async distance(points, options = {}) {
    return join(await this.#many(this.#distance(points, options), options.signal));
  }

  distanceSync(points, options = {}) {
    return join(this.#manyNow(this.#distance(points, options)));
  }

  #nearest(point, { radius = Infinity, most = radius === Infinity ? 1 : 0 } = {}) {
    const values = doubles(point, 3, 'point');
    return { call: () => this.#heap.lend(values, (at) => this.#heap.call('ebpo_js_within', this.#object, at, radius, most)),
      read: () => ({ distance: this.#array(0, Float64Array), point: this.#array(2, Float64Array), normal: this.#array(3, Float64Array),
        face: this.#array(4, Uint32Array) }) };
  }

  async nearest(point, options = {}) {
    const query = this.#nearest(point, options);
    await this.#run(query.call, options.signal);
    return query.read();
  }

  nearestSync(point, options = {}) {
    const query = this.#nearest(point, options);
    this.#runNow(query.call);
    return query.read();
  }

  #rays(name, rays, { tMax = Infinity, sides = 'both' } = {}) {
    if (!(sides in SIDES))
      throw new EbpoArgumentError(`sides is both, front or back, not ${sides}`, { status: 'EBPO_E_ARGUMENT' });
    return { values: doubles(rays, 6, 'ray'), columns: 6, call: (at, count) => this.#heap.call(name, this.#object, at, count, tMax, SIDES[sides]),
      read: () => name === 'ebpo_js_ray_any' ? { hit: this.#array(0, Uint8Array) }
        : { t: this.#array(0, Float64Array), face: this.#array(1, Uint32Array), side: this.#array(2, Int8Array),
          ...(name === 'ebpo_js_ray_all' ? { begin: this.#array(3, Uint32Array) } : {}) } };
  }

  async rays(rays, options = {}) {
    return join(await this.#many(this.#rays('ebpo_js_ray_first', rays, options), options.signal));
  }

  raysSync(rays, options = {}) {
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

  #box(name, min, max) {
    const box = Float64Array.of(...min, ...max);
    if (box.length !== 6)
      throw new EbpoArgumentError('expected three numbers for each corner of the box', { status: 'EBPO_E_ARGUMENT' });
    return () => this.#heap.lend(box, (at) => this.#heap.call(name, this.#object, at));
  }

  async boxFaces(min, max, { signal } = {}) {
    await this.#run(this.#box('ebpo_js_box_faces', min, max), signal);
    return this.#array(0, Uint32Array);
  }

  boxFacesSync(min, max) {
    this.#runNow(this.#box('ebpo_js_box_faces', min, max));
    return this.#array(0, Uint32Array);
  }

  async boxTriangles(min, max, { signal } = {}) {
    await this.#run(this.#box('ebpo_js_box_triangles', min, max), signal);
    return { face: this.#array(0, Uint32Array), corners: this.#array(1, Float64Array) };
  }

  // ---- the file ----

  get info() {
    if (!this.#info) {
      this.#alive();
      this.#check(this.#heap.call('ebpo_js_info', this.#object));
      this.#info = JSON.parse(new TextDecoder().decode(this.#array(0, Uint8Array)));
    }
    return this.#info;
  }

  get stats() {
    this.#alive();
    this.#check(this.#heap.call('ebpo_js_stats', this.#object));
    const [memory, memoryPeak, budget, resident, cutLevel, hits, loads, evicted, bytesRead, reads, suppliedBytes] = this.#array(0, Float64Array);
    return { memory, memoryPeak, budget, resident: !!resident, cutLevel, hits, loads, evicted, bytesRead, reads, suppliedBytes,
      heap: this.#heap.memory.buffer.byteLength };
  }

  async measure({ signal } = {}) {
    await this.#run(() => this.#heap.call('ebpo_js_measure', this.#object), signal);
    const x = this.#array(0, Float64Array);
    return { area: x[0], volume: x[1], centroid: x.slice(2, 5), inertia: x.slice(5, 14), volumeLo: x[14], volumeHi: x[15], integral: x[16] };
  }

  async mesh({ signal } = {}) {
    await this.#run(() => this.#heap.call('ebpo_js_mesh', this.#object), signal);
    const floats = this.#array(0, Float32Array);
    return { vertices: floats.length ? floats : this.#array(1, Float64Array), faces: this.#array(2, Uint32Array) };
  }

  async level(level, { cellFaces = true, signal } = {}) {
    await this.#run(() => this.#heap.call('ebpo_js_level', this.#object, level, +cellFaces), signal);
    return { level, vertices: this.#array(0, Float64Array), triangles: this.#array(1, Uint32Array), corners: this.#array(2, Uint8Array),
      normals: this.#array(3, Float32Array), octcode: this.#array(4, BigUint64Array), type: this.#array(5, Uint8Array),
      winding: this.#array(6, Int32Array), nodeVolume: this.#array(7, Float64Array), vertexCount: this.#array(8, Uint32Array),
      polygonCount: this.#array(9, Uint32Array), colour: this.#array(10, Uint32Array), volume: this.#array(11, Float64Array)[0] };
  }

  async* levels({ planes = true, polygons = false, signal } = {}) {
    this.#alive();
    const heap = this.#heap, stream = heap.call('ebpo_js_stream', this.#object, +planes, +polygons);
    if (!stream)
      throw errorOf(-1, 'not enough memory for the stream', '', -1);
    const array = (n, Type) => heap.result(stream, n, Type);
    try {
      for (;;) {
        await this.#run(() => heap.call('ebpo_js_next_level', stream), signal, stream);
        const facts = array(13, Float64Array);
        if (!facts.length)
          return;
        yield { level: facts[0], bytes: facts[2], volume: facts[3], octcode: array(0, BigUint64Array), type: array(1, Uint8Array),
          winding: array(2, Int32Array), cell: array(3, Float64Array), nodeVolume: array(4, Float64Array), colour: array(5, Uint32Array),
          planeCount: array(6, Uint32Array), planes: array(7, Float64Array),
          ...(polygons ? { vertexCount: array(8, Uint32Array), vertices: array(9, Float64Array), polygonCount: array(10, Uint32Array),
            polygonFirst: array(11, Uint32Array), corners: array(12, Uint32Array) } : {}) };
      }
    } finally {
      if (!this.#disposed && !heap.failed)
        heap.call('ebpo_js_stream_free', stream);
    }
  }

  /** Frees the model. The heap of models that were opened alone is collected with them. */
  dispose() {
    if (!this.#disposed && !this.#heap.failed)
      this.#heap.call('ebpo_js_free', this.#object);
    this.#disposed = true;
  }

  /** For collide.js: heap and object of a model. */
  static parts(model) {
    model.#alive();
    return { heap: model.#heap, object: model.#object, run: (call, signal) => model.#run(call, signal) };
  }
}

if (Symbol.dispose)
  Model.prototype[Symbol.dispose] = Model.prototype.dispose;

/** Opens a model with a compiled module. */
export async function openWith(loading, sourcing, options = {}) {
  const { signal, heap: limit, beside } = options;
  const [module, source] = await Promise.all([loading, sourcing]);
  signal?.throwIfAborted();
  const whole = options.whole ?? !!source.inMemory;
  const model = new Model(beside ? Model.parts(beside).heap : new Heap(module, limit), source, { ...options, whole });
  try {
    return await model.load({ ...options, whole });
  } catch (error) {
    model.dispose();
    throw error;
  }
}
