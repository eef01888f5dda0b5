import type { Model, Numbers, QueryOptions } from './index.js';

export * from './index.js';

/** Transforms x to rotation (scale x) + translation; the rotation is a matrix by rows. */
export interface Pose { rotation?: Numbers; translation?: Numbers; scale?: number }
export interface PairOptions extends QueryOptions { poseA?: Pose; poseB?: Pose }

export const RELATIONS: readonly string[];

/** Two models at poses. */
export class Pair {
  private constructor();
  first(options?: PairOptions): Promise<{ a: number; b: number; kind: number } | null>;
  all(options?: PairOptions): Promise<{ faces: Uint32Array; kind: Uint8Array }>;
  relation(options?: PairOptions): Promise<string>;
  distance(options?: PairOptions & { tolerance?: number }): Promise<
    { lo: number; hi: number; pointA: Float64Array; pointB: Float64Array; a: number; b: number }>;
  dispose(): void;
}

/** Makes a pair of two models that were opened with open() of this module, the second one with `beside`. */
export function pair(a: Model, b: Model, options?: QueryOptions): Promise<Pair>;
