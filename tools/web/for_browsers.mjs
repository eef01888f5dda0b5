// Shared by bundle.mjs and package.mjs.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';

const here = import.meta.dirname ?? new URL('.', import.meta.url).pathname;

/** A plugin of esbuild: modules of Node.js, which code for browsers imports only in Node.js, are empty. */
export const withoutNode = { name: 'without-node', setup: ({ onResolve, onLoad }) => {
  onResolve({ filter: /^node:/ }, ({ path }) => ({ path, namespace: 'empty' }));
  onLoad({ filter: /./, namespace: 'empty' }, () => ({ contents: '' }));
} };

/** Returns the modules that worker.js loads from its folder, and with `pairs` that of pairs_worker.js: [name, bytes] each. */
export const wasmFiles = ({ pairs = false } = {}) => ['ebpo-view.wasm', 'ebpo.wasm', ...(pairs ? ['ebpo-collide.wasm'] : [])].map((name) => [name, readFileSync(join(here, 'ebpo', name))]);
