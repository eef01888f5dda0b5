// Computes the approximate box of all instances at all times of their routes, for the camera. Uses neither DOM nor WebGL.
import { placed, poseAt } from './poses.js';

const BETWEEN = 32;         // number of times in addition to the keys of a route
const TIMES_MOST = 1000;    // most times of an instance
const POSES_MOST = 200_000; // most poses of all instances together, so that large scenes appear early

const evenly = (list, most) => (list.length <= most ? list : Array.from({ length: most }, (_, i) => list[Math.round(i * (list.length - 1) / (most - 1))]));

function timesOf({ keys }, { from, to }, share) {
  const between = to > from ? Array.from({ length: BETWEEN }, (_, i) => from + (to - from) * i / (BETWEEN - 1)) : [];
  return evenly([...keys.map((key) => key.time), ...between].sort((a, b) => a - b), share);
}

/**
 * Returns the box { origin, size } of all instances between two times, or undefined without instances. `all`: [{ instance: { pose, route }, origin, size }], with
 * boxes in the models' coordinates. Throws an Error when the box is too large or too small for double precision.
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
          low[k] = Math.min(low[k], x); // NaN stays NaN, and is refused below
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
