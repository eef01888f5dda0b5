// Computes the approximate box of all instances at all times of their routes, for the camera. No DOM, no WebGL.
import { placed, poseAt } from './poses.js';

const BETWEEN = 32;         // times besides the keys of a route
const TIMES_MOST = 1000;    // of an instance
const POSES_MOST = 200_000; // of all instances together, so that a large scene begins soon

const evenly = (list, most) => (list.length <= most ? list : Array.from({ length: most }, (_, i) => list[Math.round(i * (list.length - 1) / (most - 1))]));

function timesOf({ keys }, { from, to }, share) {
  const between = to > from ? Array.from({ length: BETWEEN }, (_, i) => from + (to - from) * i / (BETWEEN - 1)) : [];
  return evenly([...keys.map((key) => key.time), ...between].sort((a, b) => a - b), share);
}

/**
 * Of [{ instance: { pose, route }, origin, size }], the boxes in their models' coordinates, from one time to another: { origin, size }; undefined if there are none. Throws an Error
 * where numbers do not suffice.
 */
export function boundsOf(all, { from, to }) {
  const moving = all.filter(({ instance }) => instance.route).length, share = Math.max(2, Math.min(TIMES_MOST, Math.floor(POSES_MOST / Math.max(1, moving)))), times = new Map();
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const { instance, origin, size } of all) {
    const { route } = instance;
    if (route && !times.has(route))
      times.set(route, timesOf(route, { from, to }, share));
    for (const time of route ? times.get(route) : [0]) {
      const pose = poseAt(instance, time);
      for (let c = 0; c < 8; c++)
        placed(pose, origin.map((o, k) => o + (c >> k & 1) * size[k])).forEach((x, k) => {
          low[k] = Math.min(low[k], x); // which a NaN stays in
          high[k] = Math.max(high[k], x);
        });
    }
  }
  const across = high.map((x, k) => x - low[k]), diagonal = Math.hypot(...across);
  if (!all.length)
    return undefined;
  if (!Number.isFinite(diagonal) || !(diagonal > 0) || !Number.isFinite(2 / diagonal))
    throw new Error('the models are too far apart, too large or too small to be shown together; correct their poses');
  return { origin: low, size: across };
}
