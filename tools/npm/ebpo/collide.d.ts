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
  /** All pairs of intersecting faces: source indices [n][2], kinds [n], and file indices [n][2] for Model.corners(). */
  all(options?: PairOptions): Promise<{ faces: Uint32Array; kind: Uint8Array; number: Uint32Array }>;
  /** Segments in which faces cross: both ends [n][2][3], and source indices of the faces [n][2]. */
  contacts(options?: PairOptions): Promise<{ segments: Float64Array; faces: Uint32Array }>;
  relation(options?: PairOptions): Promise<string>;
  distance(options?: PairOptions & { tolerance?: number }): Promise<
    { lo: number; hi: number; pointA: Float64Array; pointB: Float64Array; a: number; b: number }>;
  dispose(): void;
}

/** Makes a pair of two models that were opened with open() of this module, the second one with `beside`. */
export function pair(a: Model, b: Model, options?: QueryOptions): Promise<Pair>;
