// The WebAssembly module: loading, and copies between its memory and JavaScript.
import { EbpoError, EbpoLimitError, errorOf } from './errors.js';

// Pages of the heap: their size, and the number that build.sh gives the module (INITIAL_MEMORY).
const PAGE = 65536, PAGES = 128;
const SCRATCH = 4096;
const text = new TextEncoder();
const modules = new Map();

async function compile(url) {
  if (url.protocol === 'file:') {
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:fs/promises');
    return WebAssembly.compile(await readFile(url));
  }
  const response = await fetch(url);
  if (!response.ok)
    throw new EbpoError(`${url}: the server responded with status ${response.status}`);
  // Servers that do not know the type of .wasm files are common.
  return response.headers.get('content-type')?.startsWith('application/wasm') ? WebAssembly.compileStreaming(response)
    : WebAssembly.compile(await response.arrayBuffer());
}

/** Returns the compiled module, which is loaded once. */
export function loadModule(url) {
  const key = String(url);
  if (!modules.has(key))
    modules.set(key, compile(url).catch((error) => { modules.delete(key); throw error; }));
  return modules.get(key);
}

/** One instance: its own memory of at most `limit` bytes. */
export class Heap {
  #views = new Map();
  #scratch; // SCRATCH bytes for small arguments
  #used = 0; // number of SCRATCH bytes in use
  #table; // offset of the table of result arrays in an object

  constructor(module, limit = 2 ** 32) {
    this.memory = new WebAssembly.Memory({ initial: PAGES, maximum: Math.max(PAGES, Math.min(65536, Math.floor(limit / PAGE))) });
    const imports = {};
    // The library needs a clock; it opens no files by itself, so all other calls of the system fail.
    for (const { module: from, name, kind } of WebAssembly.Module.imports(module))
      (imports[from] ??= {})[name] = kind === 'memory' ? this.memory : this.#system(name);
    this.failed = false;
    this.exports = new WebAssembly.Instance(module, imports).exports;
    this.exports._initialize?.();
    this.#scratch = this.call('malloc', SCRATCH);
  }

  #system(name) {
    if (name === 'clock_time_get' || name === 'clock_res_get')
      return (id, precision, at = precision) => {
        const now = BigInt(Math.round(1e6 * (id === 0 ? Date.now() : performance.now())));
        new DataView(this.memory.buffer).setBigUint64(at, now, true);
        return 0;
      };
    if (name === 'emscripten_get_now')
      return () => performance.now();
    if (name === 'emscripten_notify_memory_growth')
      return () => {};
    if (name === 'proc_exit' || name === 'abort')
      return () => { throw new WebAssembly.RuntimeError(name); };
    return () => -52;
  }

  /** Calls an exported function. After a trap the instance is not used again. */
  call(name, ...args) {
    this.ready();
    try {
      return this.exports[name](...args);
    } catch (cause) {
      throw this.trapped(name, cause);
    }
  }

  /** Throws if a function has trapped before. */
  ready() {
    if (this.failed)
      throw new EbpoError('the module has failed before', { status: 'EBPO_E_INTERNAL' });
  }

  /** Returns the error for a trap in an exported function. */
  trapped(name, cause) {
    this.failed = true;
    return new EbpoError(`the module failed in ${name}: ${cause.message}`, { status: 'EBPO_E_INTERNAL', cause });
  }

  /** Returns a view of the whole memory. */
  #view(Type) {
    let view = this.#views.get(Type);
    if (!view?.length) // the memory has grown
      this.#views.set(Type, view = new Type(this.memory.buffer));
    return view;
  }

  /** Copies bytes, doubles or text to memory, and calls use(address), which may keep no address. */
  lend(data, use) {
    const bytes = typeof data === 'string' ? text.encode(`${data}\0`) : data, end = this.#used + (bytes.byteLength + 7 & ~7);
    const small = end <= SCRATCH, at = small ? this.#scratch + this.#used : this.call('malloc', bytes.byteLength) >>> 0;
    if (!at)
      throw new EbpoLimitError('not enough memory for the arguments', { status: 'EBPO_E_MEMORY' });
    const used = this.#used;
    try {
      this.#view(bytes instanceof Float64Array ? Float64Array : Uint8Array).set(bytes, at / bytes.BYTES_PER_ELEMENT);
      if (small)
        this.#used = end;
      return use(at);
    } finally {
      this.#used = used;
      if (!small && !this.failed)
        this.call('free', at);
    }
  }

  string(at) {
    const bytes = new Uint8Array(this.memory.buffer, at >>> 0);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  /** Returns a copy of result array n of an object, as a typed array of the class Type. */
  result(object, n, Type) {
    this.#table ??= this.call('ebpo_js_table', object) - object;
    const numbers = this.#view(Uint32Array), entry = (object + this.#table >>> 2) + 3 * n, size = Type.BYTES_PER_ELEMENT;
    const first = numbers[entry] / size;
    return this.#view(Type).slice(first, first + numbers[entry + 1] / size);
  }

  /** Returns the error of an object's last call. */
  error(object, status) {
    return errorOf(status, this.string(this.call('ebpo_js_message', object)), this.string(this.call('ebpo_js_path', object)),
      this.call('ebpo_js_offset', object));
  }
}
