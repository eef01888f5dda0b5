// Compares the npm package "ebpo" with three-mesh-bvh and with the native library, in one run, and writes a page:
//   node web.mjs PACKAGE MODEL MODULES NATIVE_TIMES [--large MODEL] [--rounds N] [-o PAGE]
// PACKAGE: folder made by tools/npm/build.sh; MODEL: an .ebpo.h5 file of a solid; MODULES: a folder with node_modules of
// three and three-mesh-bvh; NATIVE_TIMES: native_times (tests/bench); --large: a file of 25 million faces or more.
// Times until the first result are wall-clock times, medians of N (default 5); those with loading of the modules are in new
// processes. three-mesh-bvh reads the same mesh from a binary PLY file, by PLYLoader of three. Times per query are medians of N
// rounds with other inputs, after one more round: of processor time, so that other programs disturb less.
import { execFileSync, fork } from 'node:child_process';
import { createServer } from 'node:http';
import { fstatSync, openAsBlob, openSync, readFileSync, readSync, writeFileSync, mkdtempSync, rmSync } from 'node:fs';
import { availableParallelism, cpus, loadavg, tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { brotliCompressSync, gzipSync } from 'node:zlib';

const COUNT = 20000, NEAR = 2000, COLD = 20;

/** Serves a file with range requests on this machine; reports requests and bytes. */
function serveFile(file) {
  const descriptor = openSync(file), { size } = fstatSync(descriptor);
  const server = createServer((request, response) => {
    const [, first, last] = /bytes=(\d+)-(\d+)/.exec(request.headers.range) ?? [0, 0, size - 1], end = Math.min(+last, size - 1), bytes = Buffer.alloc(end - first + 1);
    readSync(descriptor, bytes, 0, bytes.length, +first);
    response.writeHead(request.headers.range ? 206 : 200, { 'content-range': `bytes ${first}-${end}/${size}`, 'content-length': bytes.length, etag: '"1"' }).end(bytes);
  });
  process.on('disconnect', () => process.exit()); // the main process has ended, perhaps by an error
  server.listen(0, '127.0.0.1', () => process.send(`http://127.0.0.1:${server.address().port}/model.ebpo.h5`));
}

/** Starts another process that serves a file. */
async function startServer(file) {
  const child = fork(fileURLToPath(import.meta.url), ['--serve', file]), url = await new Promise((done) => child.once('message', done));
  return { url, close: () => child.kill() };
}

const FIRST = {
  url: 'URL, a distance', cold: 'URL, a distance, with loading of the module', file: 'File, a distance', levels: 'URL, polygons of levels 0 to 4',
  whole: 'all of the file in memory, a distance', built: 'three-mesh-bvh: tree of the mesh in memory',
  peer: 'three-mesh-bvh: URL of a binary PLY, a nearest point, with loading of the modules',
};
const median = (x) => [...x].sort((a, b) => a - b)[x.length >> 1];
const now = () => performance.now();

/** Returns a generator of numbers in 0 .. 1, the same in each run. */
function random(state) {
  return () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
}

/** Points and rays: half near the surface, half anywhere in the box. */
function makeInputs({ origin, size }, vertices, seed) {
  const next = random(seed), points = new Float64Array(3 * COUNT), rays = new Float64Array(6 * COUNT);
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

/** Returns the median processor time of the rounds without the first one, in microseconds per item. */
async function measure(inputs, count, run) {
  const times = [];
  for (const input of inputs) {
    const began = process.cpuUsage();
    await run(input);
    const { user, system } = process.cpuUsage(began);
    times.push(user + system);
  }
  return median(times.slice(1)) / count;
}

/** Returns the median time of opening and a first result, each time with a new source. */
async function timeFirst(rounds, open, use) {
  const times = [];
  for (let i = 0; i < rounds; i++) {
    const began = now(), model = await open();
    await use(model, i);
    times.push(now() - began);
    model.dispose();
  }
  return median(times);
}

/** Returns the median time until the first distance in new processes, which load the module. `what`: --first or --first-peer. */
async function timeNew(rounds, what, folder, url) {
  const times = [];
  for (let i = 0; i < rounds; i++) {
    const child = fork(fileURLToPath(import.meta.url), [what, folder, url]);
    times.push(await new Promise((done, fail) => child.once('message', done).once('exit', () => fail(new Error('the new process failed')))));
  }
  return median(times);
}

/** Reports the time of opening and a first distance in this process. */
async function reportFirst(folder, url) {
  const { open } = await import(pathToFileURL(resolve(folder, 'index.js'))), time = await timeFirst(1, () => open(url), (model) => model.distance(middle(model)));
  process.send(time, () => process.exit());
}

/** Reports the time of three-mesh-bvh until a nearest point of a PLY file in this process. */
async function reportPeer(modules, url) {
  const began = now(), load = (path) => import(pathToFileURL(resolve(modules, 'node_modules', path)));
  const [bytes, THREE, { PLYLoader }, { MeshBVH }] = await Promise.all([fetch(url).then((response) => response.arrayBuffer()), load('three/build/three.module.js'),
    load('three/examples/jsm/loaders/PLYLoader.js'), load('three-mesh-bvh/src/index.js')]);
  const geometry = new PLYLoader().parse(bytes);
  new MeshBVH(geometry).closestPointToPoint(new THREE.Vector3(0, 0, 0), {});
  process.send(now() - began, () => process.exit());
}

/** Writes a mesh as binary PLY. */
function writePly(path, { vertices, faces }) {
  const header = Buffer.from(`ply\nformat binary_little_endian 1.0\nelement vertex ${vertices.length / 3}\nproperty float x\nproperty float y\nproperty float z\n` +
    `element face ${faces.length / 3}\nproperty list uchar int vertex_indices\nend_header\n`);
  const positions = Buffer.from(Float32Array.from(vertices).buffer), rows = Buffer.alloc(13 * faces.length / 3);
  for (let i = 0; i < faces.length; i += 3) {
    const at = 13 * i / 3;
    rows[at] = 3;
    for (let k = 0; k < 3; k++)
      rows.writeUInt32LE(faces[i + k], at + 1 + 4 * k);
  }
  writeFileSync(path, Buffer.concat([header, positions, rows]));
}

/** Returns the median time of three-mesh-bvh from the URL of a PLY file of the mesh to a nearest point, in new processes. */
async function timePeer(rounds, modules, mesh) {
  const work = mkdtempSync(join(tmpdir(), 'ebpo-web-')), file = join(work, 'mesh.ply');
  writePly(file, mesh);
  const server = await startServer(file);
  try {
    return await timeNew(rounds, '--first-peer', modules, server.url);
  } finally {
    server.close();
    rmSync(work, { recursive: true });
  }
}

async function readLevels(model) {
  for await (const level of model.levels({ polygons: true }))
    if (level.level === 4)
      break;
}

const middle = ({ info: { origin, size } }) => origin.map((x, i) => x + size[i] / 3);

/** Counts round trips, requests and bytes of cold distances: medians. */
async function countCold(open, file, points) {
  const descriptor = openSync(file), { size } = fstatSync(descriptor), counts = [];
  for (const point of points) {
    let requests = 0, bytes = 0;
    const read = async (ranges) => ranges.map((range) => {
      const out = new Uint8Array(range.size);
      readSync(descriptor, out, 0, range.size, range.offset);
      requests++;
      bytes += range.size;
      return out;
    });
    const model = await open({ size, version: '1', read });
    await model.distance(point);
    counts.push([model.stats.roundTrips, requests, bytes]);
    model.dispose();
  }
  return [0, 1, 2].map((i) => median(counts.map((x) => x[i])));
}

/** Returns the size of the memory after queries of a large model by URL, in bytes. */
async function measureMemory(open, file) {
  const server = await startServer(file), model = await open(server.url, { heap: 512 << 20 }), { origin, size, faces } = model.info, next = random(5);
  await readLevels(model);
  for (let i = 0; i < 10; i++) {
    const points = new Float64Array(3 * 100).map((_, k) => origin[k % 3] + size[k % 3] * next());
    const rays = new Float64Array(6 * 100).map((_, k) => k % 6 < 3 ? origin[k % 3] + size[k % 3] * (2 * next() - 0.5) : next() - 0.5);
    await model.distance(points);
    await model.rays(rays);
    if (model.info.solid)
      await model.inside(points);
  }
  const { heap, memoryPeak, roundTrips } = model.stats;
  model.dispose();
  server.close();
  return { faces, heap, memoryPeak, roundTrips };
}

function nativeTimes(program, file, inputs) {
  const work = mkdtempSync(join(tmpdir(), 'ebpo-web-')), input = join(work, 'inputs');
  try {
    writeFileSync(input, Buffer.concat([Float64Array.of(COUNT, inputs.length), ...inputs.flatMap(({ points, rays }) => [points, rays])].map((x) => Buffer.from(x.buffer))));
    return JSON.parse(execFileSync(program, [file, input], { encoding: 'utf8' }));
  } finally {
    rmSync(work, { recursive: true });
  }
}

/** Copies item i of the values to `out`, and returns it. */
function take(values, i, out) {
  for (let k = 0; k < out.length; k++)
    out[k] = values[out.length * i + k];
  return out;
}

/** Evaluates all queries with the package and with three-mesh-bvh. Batches and single queries have different inputs, because
 * the first query in a leaf prepares it. Each query has its own loop, which the compiler optimizes for this query alone, as
 * in a program that makes one kind of query. Single queries of both use one object for the input again and again. */
async function measureQueries(model, bvh, THREE, inputs, others) {
  const ray = new THREE.Ray(), target = {}, at = new THREE.Vector3(), point = new Float64Array(3), line = new Float64Array(6);
  const many = {
    'first hit': await measure(inputs, COUNT, ({ rays }) => model.raysSync(rays)),
    nearest: await measure(inputs, COUNT, ({ points }) => model.distanceSync(points, { unsigned: true })),
    inside: await measure(inputs, COUNT, ({ points }) => model.insideSync(points)),
  };
  const one = {
    'first hit': await measure(others, COUNT, ({ rays }) => {
      for (let i = 0; i < COUNT; i++)
        model.raysSync(take(rays, i, line));
    }),
    nearest: await measure(others, COUNT, ({ points }) => {
      for (let i = 0; i < COUNT; i++)
        model.distanceSync(take(points, i, point), { unsigned: true });
    }),
    inside: await measure(others, COUNT, ({ points }) => {
      for (let i = 0; i < COUNT; i++)
        model.insideSync(take(points, i, point));
    }),
  };
  const theirs = {
    'first hit': await measure(inputs, COUNT, ({ rays }) => {
      for (let i = 0; i < COUNT; i++) {
        ray.origin.fromArray(rays, 6 * i);
        ray.direction.fromArray(rays, 6 * i + 3).normalize();
        bvh.raycastFirst(ray, THREE.DoubleSide);
      }
    }),
    nearest: await measure(inputs, NEAR, ({ points }) => {
      for (let i = 0; i < NEAR; i++)
        bvh.closestPointToPoint(at.fromArray(points, 3 * i), target);
    }),
    inside: await measure(inputs, NEAR, ({ points }) => { // by parity
      for (let i = 0; i < NEAR; i++) {
        ray.origin.fromArray(points, 3 * i);
        ray.direction.set(0.371, 0.557, 0.743);
        new Set(bvh.raycast(ray, THREE.DoubleSide).map((hit) => hit.distance)).size % 2;
      }
    }),
  };
  return { many, one, theirs };
}

const packedSizes = (bytes) => ({ brotli: brotliCompressSync(bytes).length, gzip: gzipSync(bytes, { level: 9 }).length }); // best quality

const short = (x) => x >= 1000 ? Math.round(x).toLocaleString('en') : String(+x.toPrecision(3));

/** Returns the page. */
function makePage({ info, counts, first, queries: { many, one, theirs }, native, memory, packed, args }) {
  const goals = [], add = (what, goal, value, met) => goals.push({ what, goal, value, met });
  const ratio = (what, goal, value) => add(what, `at least ${goal}`, short(value), value >= goal);
  const most = (what, goal, value) => add(what, `at most ${short(goal)}`, short(value), value <= goal);
  ratio('first distance: tree of three-mesh-bvh / URL', 20, first.built / first.url);
  ratio('first distance: tree of three-mesh-bvh / URL, with loading of the module', 20, first.built / first.cold);
  ratio('first distance by URL, with loading of the modules: three-mesh-bvh (PLY, tree) / ours', 20, first.peer / first.cold);
  ratio('first distance: tree of three-mesh-bvh / file', 20, first.built / first.file);
  for (const [name, goal] of [['first hit', 1.3], ['nearest', 5], ['inside', 10]])
    ratio(`${name}: three-mesh-bvh / one query a call`, goal, theirs[name] / one[name]);
  for (const name of Object.keys(many))
    most(`${name}: batch / native portable kernels`, 2.5, many[name] / native.portable[name]);
  most('cold distance near the surface: requests', 12, counts.near[1]);
  most('cold distance near the surface: bytes', 430000, counts.near[2]);
  if (memory)
    most(`memory.buffer, ${short(memory.faces)} faces by URL, MiB`, 512, memory.heap / 2 ** 20);
  most('ebpo.wasm with gzip, bytes', 400000, packed.gzip);
  const missed = goals.filter((x) => !x.met), row = (...x) => `| ${x.join(' | ')} |\n`;
  return `# The npm package

- On ${short(info.faces)} faces, a new process has the first distance by URL after ${short(first.cold)} ms, with three-mesh-bvh
  (PLY file, tree) after ${short(first.peer)} ms; later files take ${short(first.url)} ms.
- One query a call takes ${Object.keys(one).map((name) => `${short(one[name])} us (${name})`).join(', ')}; three-mesh-bvh takes
  ${Object.keys(one).map((name) => short(theirs[name])).join(', ')} us.
- ${missed.length ? `Missed goals: ${missed.length} of ${goals.length}.` : `All ${goals.length} goals are met.`}

## Goals

${row('what', 'goal', 'measured', '')}|---|---|---|---|
${[...missed, ...goals.filter((x) => x.met)].map((x) => row(x.what, x.goal, x.value, x.met ? 'met' : 'missed')).join('')}
## Measurement

    node tests/bench/web.mjs ${args}

node ${process.version}, ${cpus()[0].model.trim()}, ${availableParallelism()} cores, load average ${loadavg()[0].toFixed(1)}.
Model: \`ebpo-generate --base igea.ply --subdivide 2 igea4.ply\`${memory ? '; large model: that of [remote files](remote.md)' : ''}.
Server and client are on this machine. With brotli, ebpo.wasm has ${short(packed.brotli)} bytes.

${row('until the first result', 'ms')}|---|---|
${Object.entries(FIRST).map(([name, what]) => row(what, short(first[name]))).join('')}
${row('cold distance, medians', 'round trips', 'requests', 'bytes')}|---|---|---|---|
${row('near the surface', ...counts.near.map(short))}${row('anywhere in the box', ...counts.far.map(short))}
${row('query, us each', 'batch', 'one a call', 'three-mesh-bvh', 'native', 'native, portable')}|---|---|---|---|---|---|
${Object.keys(many).map((name) => row(name, ...[many, one, theirs, native.best, native.portable].map((x) => short(x[name])))).join('')}`;
}

async function main() {
  const [folder, file, modules, program] = process.argv.slice(2), option = (name, otherwise) => process.argv.includes(name) ? process.argv[process.argv.indexOf(name) + 1] : otherwise;
  const rounds = +option('--rounds', 5), large = option('--large'), page = option('-o');
  const { open } = await import(pathToFileURL(resolve(folder, 'index.js'))), load = (path) => import(pathToFileURL(resolve(modules, 'node_modules', path)));
  const server = await startServer(file), distance = (model) => model.distance(middle(model)), fromUrl = () => open(server.url), first = {};
  first.cold = await timeNew(rounds, '--first', folder, server.url);
  first.url = await timeFirst(rounds, fromUrl, distance);
  first.file = await timeFirst(rounds, async () => open(await openAsBlob(file)), distance);
  first.levels = await timeFirst(rounds, fromUrl, readLevels);
  const memory = large && await measureMemory(open, large), began = now(), model = await open(readFileSync(file));
  await distance(model);
  first.whole = now() - began;
  const mesh = await model.mesh(), { info } = model, [inputs, others] = [7, 1007].map((seed) => Array.from({ length: rounds + 1 }, (_, i) => makeInputs(info, mesh.vertices, seed + i)));
  const [near, far] = [1e-4, 1].map((size) => Array.from({ length: COLD }, (_, i) => {
    const next = random(100 + i), at = 3 * Math.floor(next() * mesh.vertices.length / 3);
    return size === 1 ? info.origin.map((x, k) => x + info.size[k] * next()) : [...mesh.vertices.subarray(at, at + 3)].map((x, k) => x + size * info.size[k] * (next() - 0.5));
  }));
  const counts = { near: await countCold(open, file, near), far: await countCold(open, file, far) };

  // three-mesh-bvh begins with the arrays of the mesh, without reading a file.
  const THREE = await load('three/build/three.module.js'), { MeshBVH } = await load('three-mesh-bvh/src/index.js'), building = now(), geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(Float32Array.from(mesh.vertices), 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.faces.slice(), 1));
  const bvh = new MeshBVH(geometry);
  first.built = now() - building;
  first.peer = await timePeer(Math.min(rounds, 5), modules, mesh);
  const queries = await measureQueries(model, bvh, THREE, inputs, others), native = nativeTimes(program, file, inputs);
  model.dispose();
  server.close();
  const text = makePage({ info, counts, first, queries, native, memory, packed: packedSizes(readFileSync(join(folder, 'ebpo.wasm'))),
    args: `PACKAGE igea4.ebpo.h5 MODULES NATIVE_TIMES${large ? ' --large lucy28.ebpo.h5' : ''}${page ? ' -o docs/measured/web.md' : ''}` });
  if (page)
    writeFileSync(page, text);
  else
    console.log(text);
}

const PARTS = { '--serve': serveFile, '--first': reportFirst, '--first-peer': reportPeer }; // in other processes
await (PARTS[process.argv[2]] ? PARTS[process.argv[2]](...process.argv.slice(3)) : main());
