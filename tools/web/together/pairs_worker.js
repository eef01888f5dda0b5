// A worker that finds intersecting faces of two models, with the package's module for pairs.
// Message: { id, sides: [{ what: an address or a File, pose }, ...] }. Reply: { id, count, segments, corners } or { id, error }.
import { open, pair } from '../ebpo/collide.js';
import { KeptSource } from '../kept_source.js';
import { errorOf } from '../model_file.js';
import { sourceOf } from '../source.js';

const HEAD_BYTES = 128 * 1024;
const FACES_MOST = 100_000; // faces of a model of which corners are sent

const models = new Map(); // by `what`; all are in the memory of the first one

async function modelOf(what) {
  if (!models.has(what)) {
    const source = sourceOf(what, { ahead: HEAD_BYTES }), [beside] = models.values();
    try {
      await source.open(HEAD_BYTES);
      models.set(what, await open(new KeptSource(source), { beside }));
    } catch (error) {
      throw errorOf(error, source.name);
    }
  }
  return models.get(what);
}

const distinct = (numbers, side) => [...new Set(numbers.filter((_, i) => i % 2 === side))].slice(0, FACES_MOST);

async function intersect([a, b]) {
  const [first, second] = [await modelOf(a.what), await modelOf(b.what)], poses = { poseA: a.pose, poseB: b.pose }, both = await pair(first, second);
  try {
    const { kind, number } = await both.all(poses), { segments } = await both.contacts(poses);
    const corners = [await first.corners(distinct(number, 0)), await second.corners(distinct(number, 1))];
    return { count: kind.length, segments, corners };
  } finally {
    both.dispose();
  }
}

let last = Promise.resolve(); // one pair after the other
self.onmessage = ({ data: { id, sides } }) => {
  last = last.then(() => intersect(sides)).then((found) => self.postMessage({ id, ...found }), ({ message }) => self.postMessage({ id, error: message }));
};
