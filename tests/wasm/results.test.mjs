// Compares queries of the package with those of the native library, bit by bit. EBPO_PACKAGE: the package's folder;
// EBPO_NATIVE: native_results; EBPO_FILES: models, separated by spaces; EBPO_TEST_SCALE: share of 100,000 queries of each kind.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import test from 'node:test';

const { EBPO_PACKAGE: folder, EBPO_NATIVE: native, EBPO_FILES: files = '', EBPO_TEST_SCALE: scale = '0.05' } = process.env;
const { open } = await import(join(folder, 'index.js')), { partsOf } = await import(join(folder, 'view.js'));
const count = Math.max(200, Math.round(1e5 * scale));

/** Returns a generator of numbers in 0 .. 1, the same in each run. */
function random(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/** Returns points, rays and boxes around a model. Half of the points and rays begin near faces. */
function makeInputs({ info, mesh }, n) {
  const next = random(7), { origin, size } = info, points = new Float64Array(3 * n), rays = new Float64Array(6 * n), boxes = new Float64Array(6 * n);
  const near = (k, spread) => {
    const vertices = mesh?.vertices;
    if (!vertices?.length || next() < 0.5)
      return origin.map((x, i) => x + size[i] * (1.2 * next() - 0.1));
    const at = 3 * Math.floor(next() * vertices.length / 3);
    return [...vertices.subarray(at, at + 3)].map((x, i) => next() < 0.1 ? x : x + spread * size[i] * (next() - 0.5));
  };
  for (let i = 0; i < n; i++) {
    points.set(near(i, 0.02), 3 * i);
    rays.set(near(i, 1), 6 * i);
    for (let k = 3; k < 6; k++)
      rays[6 * i + k] = next() < 0.05 ? 0 : next() - 0.5;
    if (!rays[6 * i + 3] && !rays[6 * i + 4])
      rays[6 * i + 5] = 1;
    const low = near(i, 0.02), wide = 0.02 * next();
    boxes.set([...low, ...low.map((x, k) => x + wide * size[k])], 6 * i);
  }
  return { points, rays, boxes };
}

/** Returns the sections that native_results writes. */
function nativeSections(file, { points, rays, boxes }, n) {
  const work = mkdtempSync(join(tmpdir(), 'ebpo-wasm-')), [input, output] = [join(work, 'in'), join(work, 'out')];
  try {
    writeFileSync(input, Buffer.concat([Float64Array.of(n), points, rays, boxes].map((x) => Buffer.from(x.buffer))));
    execFileSync(native, [file, input, output]);
    const bytes = readFileSync(output), sections = [];
    for (let at = 0; at < bytes.length;) {
      const size = bytes.readDoubleLE(at);
      sections.push(bytes.subarray(at + 8, at + 8 + size));
      at += 8 + size;
    }
    return sections;
  } finally {
    rmSync(work, { recursive: true });
  }
}

const joined = (arrays) => Buffer.concat(arrays.map((x) => Buffer.from(x.buffer, x.byteOffset, x.byteLength)));

async function levelSections(model) {
  const levels = [];
  for await (const level of model.levels({ polygons: true }))
    levels.push(level);
  const last = await model.level(Math.min(4, model.info.levels.length - 1));
  return ['octcode', 'winding', 'nodeVolume', 'planes', 'vertices'].map((name) => [`nodes: ${name}`, joined(levels.map((l) => l[name]))])
    .concat(['vertices', 'triangles', 'normals'].map((name) => [`level: ${name}`, joined([last[name]])]));
}

async function partSections(model) {
  const { info } = model, out = [], add = (kind, result, names) => names.forEach((name) => out.push([`${kind}: ${name}`, joined([result[name]])]));
  const arrays = [];
  for (const { element, names, columns, list } of info.attributes) {
    const each = await Promise.all(names.split(' ').map((name) => model.attribute(`${element}:${name}`, { order: 'file' })));
    arrays.push(list || each.length === 1 ? each[0] // columns side by side
      : { values: each[0].values.constructor.from({ length: each[0].values.length * columns }, (_, i) => each[i % columns].values[Math.floor(i / columns)]) });
  }
  out.push(['attributes', joined(arrays.map(({ values }) => values))], ['attributes: ends', joined(arrays.flatMap(({ ends }) => ends ?? []))]);
  if (partsOf(info).includes('maps'))
    add('maps', await model.maps(), ['vertex', 'face']);
  out.push(...await viewSections(model));
  if (!info.pruned) {
    const subtree = await model.subtree();
    add('subtree', subtree, ['octcode', 'type', 'planes', ...(subtree.faces ? ['faces', 'number', 'list'] : [])]);
  }
  return out;
}

/** Nodes by their size for an observer, and their faces, in small parts. */
async function viewSections(model) {
  const { info } = model, eye = info.origin.map((x, k) => x + (k + 1) * info.size[k]), faces = info.hasMesh && !info.pruned, parts = [];
  const view = model.view({ priority: 'pixels', observer: { eye, direction: [-1, -1, -1] }, pixels: 20, faces });
  try {
    for (let nodes; (nodes = await view.next({ most: 100 }));)
      parts.push(nodes);
    assert.equal(view.end, 'done');
  } catch (error) {
    assert.ok(error.status === 'EBPO_E_ABSENT' && info.pruned, error.message);
  }
  view.dispose();
  const each = (name, of = (x) => x[name] ?? new Uint8Array(0)) => [`view: ${name}`, joined(parts.map(of))];
  return [each('octcode'), each('planes'), each('flags', ({ complete, seen }) => complete.length ? Uint8Array.from({ length: 2 * complete.length }, (_, i) => [complete, seen][i % 2][i >> 1])
    : complete), each('distance'), each('pixels'), each('faceCorners'), each('faceNumber')];
}

async function querySections(model, mesh, { points, rays, boxes }, n) {
  const out = [], add = (kind, result, names) => names.forEach((name) => out.push([`${kind}: ${name}`, joined([result[name]])]));
  add('mesh', mesh, ['vertices', 'faces']);
  if (model.info.solid)
    add('inside', await model.inside(points), ['where', 'winding']);
  add('distance', await model.distance(points), ['distance', 'point', 'normal', 'face', 'lo', 'hi']);
  const near = [];
  for (let i = 0; i < n; i++)
    near.push(model.nearestSync(points.subarray(3 * i, 3 * i + 3), { most: 3 }));
  out.push(...['distance', 'face'].map((name) => [`nearest: ${name}`, joined(near.map((x) => x[name]))]));
  add('first hit', await model.rays(rays), ['t', 'face', 'side']);
  add('all hits', await model.raysAll(rays), ['t', 'face', 'side', 'begin']);
  add('any hit', { hit: await model.raysAny(rays) }, ['hit']);
  const faces = [], corners = [];
  for (let i = 0; i < n; i++) {
    const box = boxes.subarray(6 * i, 6 * i + 6);
    faces.push(model.boxFacesSync(box.subarray(0, 3), box.subarray(3)));
    if (i % 16 === 0)
      corners.push((await model.boxTriangles(box.subarray(0, 3), box.subarray(3))).corners);
  }
  out.push(['boxes: counts', joined([Uint32Array.from(faces, (x) => x.length)])], ['boxes: faces', joined(faces)], ['boxes: corners', joined(corners)]);
  const sampled = model.info.attributes.find(({ element, list }) => !list && (element === 'vertex' || element === 'face'));
  if (sampled) {
    const { point, face } = await model.distance(points);
    out.push(['samples', joined([await model.sample(`${sampled.element}:${sampled.names.split(' ')[0]}`, point, face)])]);
  }
  return out;
}

/** Compares a file in memory and, if `parts`, loaded in parts. */
async function compare(file, n, options = {}) {
  const model = await open(readFileSync(file), options), { info } = model;
  const mesh = info.hasMesh && !info.pruned ? await model.mesh() : null;
  const inputs = makeInputs({ info, mesh }, n), expected = nativeSections(file, inputs, n);
  const found = [...await levelSections(model), ...await partSections(model)];
  if (mesh)
    found.push(...await querySections(model, mesh, inputs, n));
  model.dispose();
  assert.equal(found.length, expected.length);
  found.forEach(([name, bytes], i) => {
    assert.equal(bytes.length, expected[i].length, `${name}: ${bytes.length} bytes, native ${expected[i].length}`);
    if (!bytes.equals(expected[i]))
      assert.fail(`${name}: differs from native at byte ${bytes.findIndex((x, k) => x !== expected[i][k])} of ${bytes.length}`);
  });
  return found.length;
}

for (const file of files.split(' ').filter(Boolean)) {
  test(`${basename(file)}: ${count} queries of each kind equal native results`, () => compare(file, count));
  test(`${basename(file)}: loaded in parts, equal too`, () => compare(file, Math.ceil(count / 10), { whole: false }));
}

const vectors = join(process.env.EBPO_VECTORS, 'passed');
for (const name of (await import('node:fs')).readdirSync(vectors).filter((x) => x.endsWith('.h5')))
  test(`${name}: equals native results`, () => compare(join(vectors, name), 200));
