// Compares sections and positions on faces with simple geometry and with the library.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { Queries, cutFaces, measureOf, positionsOf, sectionOf, weightsOf } from '../queries.js';
import { open } from '../ebpo/index.js';
import { openModel } from '../model_file.js';

// Returns a box as twelve faces, counter-clockwise as seen from outside.
function box(low, high) {
  const corner = (i) => [0, 1, 2].map((k) => (i >> k & 1 ? high : low)[k]), quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  return Float64Array.from(quads.flatMap(([a, b, c, d]) => [a, b, c, a, c, d].flatMap(corner)));
}

test('the section of a box is a rectangle on each axis, also through corners, and a hole reduces the area', () => {
  for (let axis = 0; axis < 3; axis++)
    for (const at of [0.3, 1, -0.5]) { // at 1 is the upper side, whose corners count as above the plane
      const out = [], size = [2, 3, 5], low = [-1, -2, -4], shift = low[axis] + (at === 1 ? size[axis] : at === -0.5 ? 1e-9 : size[axis] * at);
      cutFaces(box(low, low.map((x, k) => x + size[k])), axis, shift, out);
      const { area, length } = measureOf(out), [a, b] = [size[(axis + 1) % 3], size[(axis + 2) % 3]];
      assert.ok(Math.abs(area - a * b) < 1e-12 && Math.abs(length - 2 * (a + b)) < 1e-12, `axis ${axis}: ${area}, ${length}`);
    }
  const out = [], hole = box([0.25, 0.25, 0.25], [0.75, 0.75, 0.75]);
  cutFaces(box([0, 0, 0], [1, 1, 1]), 2, 0.5, out);
  for (let f = 0; f < hole.length; f += 9) // reverses the orientation
    cutFaces(Float64Array.from([...hole.subarray(f, f + 3), ...hole.subarray(f + 6, f + 9), ...hole.subarray(f + 3, f + 6)]), 2, 0.5, out);
  assert.ok(Math.abs(measureOf(out).area - 0.75) < 1e-15);
});

test('weights reproduce the point', () => {
  const corners = Float64Array.of(1, 0, 0, 4, 1, 0, 0, 3, 2), at = (w) => [0, 1,
    2].map((k) => corners[k] * (1 - (w[0] + w[1]) / 2 ** 30) + corners[3 + k] * w[0] / 2 ** 30 + corners[6 + k] * w[1] / 2 ** 30);
  for (const [s, t] of [[0, 0], [1, 0], [0, 1], [0.25, 0.5], [0.3, 0.7]]) {
    const p = [0, 1, 2].map((k) => corners[k] * (1 - s - t) + corners[3 + k] * s + corners[6 + k] * t), w = weightsOf(p, corners);
    assert.ok(w[0] + w[1] <= 2 ** 30 && w.every((x) => Number.isInteger(x) && x >= 0));
    at(w).forEach((x, k) => assert.ok(Math.abs(x - p[k]) < 1e-8));
  }
  assert.deepEqual(weightsOf([0.5, 0, 0], Float64Array.of(0, 0, 0, 1, 0, 0, 2, 0, 0)), [0, 2 ** 28]); // a triangle without area
  assert.deepEqual(weightsOf([1, 1, 1], new Float64Array(9).fill(1)), [0, 0]);
});

const paths = (process.env.EBPO_FILES ?? '').split(' ').filter((path) => /\/ring(_subtrees|_blocks|_without_mesh|_box)?\.ebpo\.h5$/.test(path)), tool = process.env.EBPO_TOOL;
test('sections of files agree with those of all faces; positions are on the source\'s faces', { skip: paths.length && tool ? false : 'EBPO_TOOL and EBPO_FILES are not set' }, async () => {
  for (const path of paths) {
    const file = await openModel(readFileSync(path), { name: path }), { info } = file, queries = new Queries(file), reports = [];
    const axis = 1, at = info.box_origin[1] + 0.4375 * info.box_size[1];
    await sectionOf(queries, axis, at, (news) => reports.push(news), () => false);
    const last = reports.at(-1);
    if (!info.parts.has('mesh')) {
      assert.match(last.fault, /no faces/);
      continue;
    }
    const model = await open(readFileSync(path)), { vertices, faces } = await model.mesh(), all = Float64Array.from([...faces].flatMap((v) => [...vertices.subarray(3 * v, 3 * v + 3)])), plain = [];
    cutFaces(all, axis, at, plain);
    const wanted = measureOf(plain);
    assert.equal(last.partial, info.parts.has('pruned'), path);
    if (last.partial)
      continue;
    assert.equal(last.faces, plain.length / 4);
    assert.ok(Math.abs(last.length - wanted.length) <= 1e-9 * wanted.length && Math.abs(last.area - wanted.area) <= 1e-9 * wanted.area, `${last.area} ${wanted.area}`);

    const points = [[0.1, 0.2, 0.3], [0.9, 0.9, 0.1], [0.5, 0.5, 0.5]].map((s) => s.map((x, k) => info.box_origin[k] + x * info.box_size[k])), places = await positionsOf(queries, points);
    const { face: named, corners } = await model.boxTriangles(info.box_origin, info.box_origin.map((x, k) => x + info.box_size[k]));
    const results = points.map((p) => JSON.parse(execFileSync(tool, ['distance', '--json', '--unsigned', path], { input: `${p.join(' ')}\n`, encoding: 'utf8' })));
    places.forEach(({ face, weights, place, distance }, i) => {
      const own = named.indexOf(face), p = [0, 1, 2].map((k) => [2 ** 30 - weights[0] - weights[1], ...weights].reduce((sum, w, c) => sum + w / 2 ** 30 * corners[9 * own + 3 * c + k], 0));
      assert.ok(own >= 0 && p.every((x, k) => Math.abs(x - place[k]) < 1e-6 * info.box_size[k]), `${path}: face ${face}`);
      assert.ok(Math.abs(distance - results[i].distance) < 1e-12);
    });

    const ray = [...info.box_origin.map((o, k) => o - 0.1 * info.box_size[k]), ...info.box_size.map((s, k) => s * [1, 0.97, 1.02][k])], hit = await queries.hit(ray);
    const found = JSON.parse(execFileSync(tool, ['ray', '--json', path], { input: `${ray.join(' ')}\n`, encoding: 'utf8' }));
    assert.deepEqual(hit, found ? [0, 1, 2].map((k) => ray[k] + found.t * ray[3 + k]) : undefined);
    const [exact, coarse] = await Promise.all([queries.exact(points[0]), queries.coarse(points[0], 2)]);
    assert.ok(exact.distance === results[0].distance && coarse.lo <= exact.distance && exact.distance <= coarse.hi, path);
  }
});
