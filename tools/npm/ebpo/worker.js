// Opens models in a worker, so that long queries do not block a page. The returned object has the asynchronous methods
// of Model. Node uses worker_threads.
import { EbpoArgumentError, STATUS, EbpoError } from './errors.js';

const METHODS = ['inside', 'distance', 'nearest', 'rays', 'raysAny', 'raysAll', 'boxFaces', 'boxTriangles', 'measure', 'mesh', 'level', 'check',
  'windingBounds', 'maps', 'corners', 'attribute', 'textures', 'sample', 'subtree'];

async function startWorker() {
  if (typeof Worker !== 'undefined')
    return new Worker(new URL('./worker_main.js', import.meta.url), { type: 'module' });
  const { Worker: NodeWorker } = await import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:worker_threads');
  return new NodeWorker(new URL('./worker_main.js', import.meta.url));
}

/** Makes the error of a worker again, of the same class. */
function remakeError({ name, message, status, path, offset }) {
  const Class = Object.values(STATUS).map(([, each]) => each).find((each) => each.name === name);
  return Class || name === 'EbpoError' ? new (Class ?? EbpoError)(message, { status, path, offset })
    : Object.assign(new Error(message), { name });
}

class WorkerModel {
  #worker;
  #calls = new Map();
  #next = 0;

  constructor(worker) {
    this.#worker = worker;
    const receive = ({ id, result, error }) => {
      const call = this.#calls.get(id);
      this.#calls.delete(id);
      if (error)
        call?.reject(remakeError(error));
      else
        call?.resolve(result);
    };
    if (worker.on)
      worker.on('message', receive).on('error', (error) => this.#fail(error));
    else {
      worker.onmessage = ({ data }) => receive(data);
      worker.onerror = (event) => this.#fail(new EbpoError(event.message || 'the worker failed'));
    }
  }

  #fail(error) {
    this.#calls.forEach(({ reject }) => reject(error));
    this.#calls.clear();
  }

  call(method, args, signal) {
    if (!this.#worker)
      return Promise.reject(new EbpoError('the model has been disposed of', { status: 'EBPO_E_ARGUMENT' }));
    signal?.throwIfAborted();
    const id = this.#next++;
    return new Promise((resolve, reject) => {
      const abort = () => {
        this.#worker?.postMessage({ id, abort: true });
        this.#calls.delete(id);
        reject(signal.reason);
      };
      const done = (settle) => (value) => { signal?.removeEventListener('abort', abort); settle(value); };
      this.#calls.set(id, { resolve: done(resolve), reject: done(reject) });
      signal?.addEventListener('abort', abort, { once: true });
      this.#worker.postMessage({ id, method, args });
    });
  }

  async* levels({ signal, ...options } = {}) {
    const stream = await this.call('openLevels', [options], signal);
    try {
      for (let level; (level = await this.call('nextLevel', [stream], signal));)
        yield level;
    } finally {
      if (this.#worker)
        this.call('closeLevels', [stream]).catch(() => {});
    }
  }

  stats() {
    return this.call('stats', []);
  }

  dispose() {
    this.#worker?.terminate();
    this.#worker = null;
    this.#fail(new EbpoError('the model has been disposed of', { status: 'EBPO_E_ARGUMENT' }));
  }
}

for (const method of METHODS)
  WorkerModel.prototype[method] = async function (...args) {
    const last = args.at(-1), options = last && typeof last === 'object' && !ArrayBuffer.isView(last) && !Array.isArray(last) ? args.pop() : {};
    const { signal, ...rest } = options;
    return this.call(method, [...args, rest], signal);
  };

/** Opens a URL, a Blob, or an ArrayBuffer or typed array, which is copied. */
export async function openInWorker(from, { signal, ...options } = {}) {
  const plain = typeof from === 'string' || from instanceof URL ? String(from) : from;
  if (options.fetch || typeof from?.read === 'function')
    throw new EbpoArgumentError('a worker opens no sources with functions', { status: 'EBPO_E_ARGUMENT' });
  const model = new WorkerModel(await startWorker());
  try {
    model.info = await model.call('open', [plain, options], signal);
    return model;
  } catch (error) {
    model.dispose();
    throw error;
  }
}
