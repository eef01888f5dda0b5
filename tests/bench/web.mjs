// Compares the npm package "ebpo" with three-mesh-bvh and with the native library, in one run:
//   node web.mjs PACKAGE MODEL MODULES [--native NATIVE_TIMES] [--rounds N]
// PACKAGE: folder made by tools/npm/build.sh; MODEL: an .ebpo.h5 file of a solid; MODULES: a folder with node_modules of
// three and three-mesh-bvh; NATIVE_TIMES: native_times (tests/bench), built with and without kernels for AVX2.
// Prints Markdown: times to the first result, and times per query, which are medians of N rounds
// (default 5) with other inputs, after one more round: of processor time, so that other programs disturb less.
import { execFileSync } from 'node:child_process';
import { createServer } from 'node:http';
import { closeSync, fstatSync, openSync, readFileSync, readSync, writeFileSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [folder, file, modules] = process.argv.slice(2), option = (name) => process.argv[process.argv.indexOf(name) + 1];
const native = process.argv.includes('--native') ? option('--native') : null, rounds = process.argv.includes('--rounds') ? +option('--rounds') : 5;
const { open } = await import(pathToFileURL(resolve(folder, 'index.js')));
const load = (path) => import(pathToFileURL(resolve(modules, 'node_modules', path)));
const THREE = await load('three/build/three.module.js'), { MeshBVH } = await load('three-mesh-bvh/src/index.js');

const COUNT = 20000, NEAR = 2000;
const now = () => performance.now();

/** Serves the file with range requests on this machine. */
function serve() {
  const descriptor = openSync(file), { size } = fstatSync(descriptor), seen = { requests: 0, bytes: 0 };
  const server = createServer((request, response) => {
    const [, first, last] = /bytes=(\d+)-(\d+)/.exec(request.headers.range), end = Math.min(+last, size - 1), bytes = Buffer.alloc(end - first + 1);
    readSync(descriptor, bytes, 0, bytes.length, +first);
    seen.requests++;
    seen.bytes += bytes.length;
    response.writeHead(206, { 'content-range': `bytes ${first}-${end}/${size}`, 'content-length': bytes.length, etag: '"1"' }).end(bytes);
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done({ url: `http://127.0.0.1:${server.address().port}/model.ebpo.h5`, seen,
    close: () => { server.close(); closeSync(descriptor); } })));
}

const median = (x) => x.sort((a, b) => a - b)[x.length >> 1];

/** Returns the median processor time of the rounds without the first one, in microseconds per item. */
async function measure(count, run) {
  const times = [];
  for (const input of inputs) {
    const began = process.cpuUsage();
    await run(input);
    const { user, system } = process.cpuUsage(began);
    times.push(user + system);
  }
  return median(times.slice(1)) / count;
}

/** Points and rays: half near the surface, half anywhere in the box. */
function makeInputs({ origin, size }, vertices, seed) {
  let state = seed;
  const next = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  const points = new Float64Array(3 * COUNT), rays = new Float64Array(6 * COUNT);
  for (let i = 0; i < COUNT; i++) {
    const at = 3 * Math.floor(next() * vertices.length / 3);
    for (let k = 0; k < 3; k++) {
      points[3 * i + k] = i % 2 ? origin[k] + size[k] * next() : vertices[at + k] + 0.01 * size[k] * (next() - 0.5);
      rays[6 * i + k] = origin[k] + size[k] * (2 * next() - 0.5);
    }
    for (let k = 0; k < 3; k++)
      rays[6 * i + 3 + k] = vertices[at + k] - rays[6 * i + k];
  }
  return { points, rays };
}

const server = await serve();

// ---- times to the first result, with new sources ----
const point = ({ origin, size }) => origin.map((x, i) => x + size[i] / 3);
let began = now();
let model = await open(server.url);
await model.distance(point(model.info));
const firstFromUrl = now() - began, remote = { ...server.seen, ...model.stats };
model.dispose();
began = now();
model = await open(server.url);
for await (const level of model.levels({ polygons: true }))
  if (level.level === 4)
    break;
const levelFromUrl = now() - began;
model.dispose();
began = now();
model = await open(readFileSync(file));
await model.distance(point(model.info));
const firstWhole = now() - began;
const mesh = await model.mesh(), { info } = model;
const inputs = Array.from({ length: rounds + 1 }, (_, i) => makeInputs(info, mesh.vertices, 7 + i));

// three-mesh-bvh begins with the arrays of the mesh, without reading a file.
began = now();
const geometry = new THREE.BufferGeometry();
geometry.setAttribute('position', new THREE.BufferAttribute(Float32Array.from(mesh.vertices), 3));
geometry.setIndex(new THREE.BufferAttribute(mesh.faces.slice(), 1));
const bvh = new MeshBVH(geometry), built = now() - began;

// ---- times per query ----
const ray = new THREE.Ray(), target = {}, at = new THREE.Vector3();
const each = (count, columns, values, run) => {
  for (let i = 0; i < count; i++)
    run(values.subarray(columns * i, columns * i + columns));
};
const ours = {
  'first hit': await measure(COUNT, ({ rays }) => model.raysSync(rays)),
  nearest: await measure(COUNT, ({ points }) => model.distanceSync(points, { unsigned: true })),
  inside: await measure(COUNT, ({ points }) => model.insideSync(points)),
};
const one = { // one item a call
  'first hit': await measure(NEAR, ({ rays }) => each(NEAR, 6, rays, (x) => model.raysSync(x))),
  nearest: await measure(NEAR, ({ points }) => each(NEAR, 3, points, (x) => model.distanceSync(x, { unsigned: true }))),
  inside: await measure(NEAR, ({ points }) => each(NEAR, 3, points, (x) => model.insideSync(x))),
};
const theirs = {
  'first hit': await measure(COUNT, ({ rays }) => each(COUNT, 6, rays, (x) => {
    ray.origin.fromArray(x);
    ray.direction.fromArray(x, 3).normalize();
    bvh.raycastFirst(ray, THREE.DoubleSide);
  })),
  nearest: await measure(NEAR, ({ points }) => each(NEAR, 3, points, (x) => bvh.closestPointToPoint(at.fromArray(x), target))),
  inside: await measure(NEAR, ({ points }) => each(NEAR, 3, points, (x) => { // by parity
    ray.origin.fromArray(x);
    ray.direction.set(0.371, 0.557, 0.743);
    new Set(bvh.raycast(ray, THREE.DoubleSide).map((hit) => hit.distance)).size % 2;
  })),
};

// ---- native times of the same queries ----
let natives = {};
if (native) {
  const work = mkdtempSync(join(tmpdir(), 'ebpo-web-')), input = join(work, 'inputs');
  writeFileSync(input, Buffer.concat([Float64Array.of(COUNT, rounds + 1), ...inputs.flatMap(({ points, rays }) => [points, rays])].map((x) => Buffer.from(x.buffer))));
  natives = JSON.parse(execFileSync(native, [file, input], { encoding: 'utf8' }));
  rmSync(work, { recursive: true });
}

const us = (x) => x === undefined ? '' : x.toPrecision(3), ms = (x) => x.toFixed(0);
console.log(`${info.faces} faces, ${info.fileBytes} bytes; node ${process.version}

| until the first result | ms |
|---|---|
| ebpo, URL, a distance (${remote.roundTrips} round trips, ${remote.requests} requests, ${remote.bytes} bytes) | ${ms(firstFromUrl)} |
| ebpo, URL, polygons of levels 0 to 4 | ${ms(levelFromUrl)} |
| ebpo, whole file, a distance | ${ms(firstWhole)} |
| three-mesh-bvh, tree of the mesh in memory | ${ms(built)} |

| query, us each | ebpo, ${COUNT} a call | ebpo, one a call | three-mesh-bvh | native |
|---|---|---|---|---|`);
for (const name of Object.keys(ours))
  console.log(`| ${name} | ${us(ours[name])} | ${us(one[name])} | ${us(theirs[name])} | ${us(natives[name])} |`);
model.dispose();
server.close();
