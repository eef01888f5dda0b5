// Evaluates a million points of a model with the npm package "ebpo", in Node:
//   node million_points.mjs MODEL
// MODEL is a file or a URL. Run `npm install ebpo` first.
import { open as openFile } from 'node:fs/promises';
import { IN, open } from 'ebpo';

/** Returns a source of the bytes of a local file, which is read in parts. */
async function fileSource(path) {
  const file = await openFile(path), { size, mtimeMs } = await file.stat();
  const read = async ({ offset, size }) => (await file.read(new Uint8Array(size), 0, size, offset)).buffer;
  return { size, name: path, version: String(mtimeMs), read: (ranges) => Promise.all(ranges.map(read)), close: () => file.close() };
}

const [address] = process.argv.slice(2);
const source = /^https?:/.test(address) ? address : await fileSource(address);
const model = await open(source), { origin, size, solid } = model.info;
const points = new Float64Array(3e6).map((_, i) => origin[i % 3] + size[i % 3] * Math.random());

const began = performance.now();
const { distance } = await model.distance(points);
const seconds = (performance.now() - began) / 1000, [least, most] = ['min', 'max'].map((name) => distance.reduce((a, b) => Math[name](a, b)));
console.log(`${distance.length} distances in ${seconds.toFixed(1)} s, from ${least} to ${most}`);
if (solid) {
  const { where } = await model.inside(points);
  console.log(`volume by points: ${size[0] * size[1] * size[2] * where.filter((x) => x === IN).length / where.length}`);
}
model.dispose();
await source.close?.();
