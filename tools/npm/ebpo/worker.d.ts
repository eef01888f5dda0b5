import type { Info, Model, OpenOptions, Stats } from './index.js';

/** A model in a worker. Its methods are those of Model; `stats` is a function. */
export type WorkerModel = Pick<Model, 'inside' | 'distance' | 'nearest' | 'rays' | 'raysAny' | 'raysAll' | 'boxFaces'
  | 'boxTriangles' | 'measure' | 'mesh' | 'windingBounds' | 'maps' | 'corners' | 'attribute' | 'textures' | 'sample' | 'subtree'
  | 'level' | 'levels' | 'check' | 'dispose'> & { info: Info; stats(): Promise<Stats> };

/** Opens a model in a new worker. Bytes in memory are copied. */
export function openInWorker(from: string | URL | Blob | ArrayBuffer | ArrayBufferView,
  options?: Omit<OpenOptions, 'fetch' | 'beside'>): Promise<WorkerModel>;
