// The package "ebpo": reads and queries EBP-Octree files (.ebpo.h5) in browsers and Node.
import { loadModule } from './heap.js';
import { openWith } from './model.js';
import { sourceOf } from './source.js';

export * from './errors.js';
export { Model } from './model.js';
export { ViewStream } from './view_stream.js';
export { blobSource, memorySource, urlSource } from './source.js';

export const OUT = 0, IN = 1, ON = 2, MAYBE = 3;
export const NO_FACE = 0xffffffff;

/** Opens a URL, a File or Blob, an ArrayBuffer or typed array, or a source. The module is loaded at the same time. */
export const open = (from, options = {}) =>
  openWith(loadModule(new URL('./ebpo.wasm', import.meta.url)), sourceOf(from, options, options.signal), options);
