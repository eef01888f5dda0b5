/** Picking with three.js. */
import type { Model } from './index.js';

/** Returns a function for `raycast` of an Object3D in the model's coordinates. Rays that need bytes which are not in memory
 * have no intersections; `ready` is called when the bytes have arrived. */
export function raycastOf(model: Model, options?: { ready?: () => void }): (raycaster: any, intersects: any[]) => void;
