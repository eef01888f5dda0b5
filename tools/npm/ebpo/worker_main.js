// The worker of worker.js: one model. Messages {id, method, args} and {id, abort}; replies {id, result} or {id, error}.
import { open } from './index.js';

let model, port;
const streams = new Map(), running = new Map();

const calls = {
  open: async (signal, from, options) => {
    model = await open(from, { ...options, signal });
    return model.info;
  },
  stats: () => model.stats,
  openLevels: (signal, options) => {
    streams.set(streams.size, model.levels(options));
    return streams.size - 1;
  },
  nextLevel: async (signal, stream) => (await streams.get(stream).next()).value ?? null,
  closeLevels: async (signal, stream) => { await streams.get(stream).return(); },
};

/** Returns the buffers of typed arrays in a result, which are moved. */
const buffersOf = (result) => result && typeof result === 'object'
  ? [...new Set((ArrayBuffer.isView(result) ? [result] : Object.values(result)).filter(ArrayBuffer.isView).map((x) => x.buffer))] : [];

async function receive({ id, method, args, abort }) {
  if (abort) {
    running.get(id)?.abort();
    return;
  }
  const controller = new AbortController(), { signal } = controller;
  running.set(id, controller);
  try {
    const result = calls[method] ? await calls[method](signal, ...args)
      : await model[method](...args.slice(0, -1), { ...args.at(-1), signal });
    port.postMessage({ id, result }, buffersOf(result));
  } catch ({ name, message, status, path, offset }) {
    port.postMessage({ id, error: { name, message, status, path, offset } });
  }
  running.delete(id);
}

// No top-level await, which bundlers of workers do not support.
if (typeof self !== 'undefined' && typeof self.postMessage === 'function') {
  port = self;
  port.onmessage = ({ data }) => receive(data);
} else {
  import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:worker_threads').then(({ parentPort }) => {
    port = parentPort;
    port.on('message', receive);
  });
}
