// Compares the faces that a point of paint covers with a reference implementation and with the result of ebpo paint. The model is two plates with a crack between
// them, where the ball intersects faces that are not covered.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { open } from '../ebpo/index.js';
import { openModel } from '../model_file.js';
import { readPaint } from '../paint/paint_file.js';
import { Queries } from '../queries.js';
import { connectedFaces, reachOf } from '../reach.js';
import { addLevels } from '../grow.js';
import { LEAF, Tree } from '../tree.js';
import { plates } from './plates.js';

// A generator of reproducible pseudorandom numbers.
function chance(seed) {
  let state = seed;
  return () => (state = (state * 48271) % 2147483647) / 2147483647;
}

// Reference implementation: joins faces that share a corner inside the ball, or an edge with a point inside the ball. Tests edges in small steps and at their ends.
function referenceFaces(faces, own, centre, radius) {
  const corners = (f) => [0, 3, 6].map((c) => [...f.subarray(c, c + 3)]), near = (q) => Math.hypot(...q.map((x, k) => x - centre[k])) <= radius, same = (a, b) => a.every((x, k) => x === b[k]);
  const reached = (a, b) => Array.from({ length: 2001 }, (_, i) => i / 2000).some((t) => near(a.map((x, k) => x + t * (b[k] - x))));
  const joined = (f, g) => {
    const common = corners(f).filter((p) => corners(g).some((q) => same(p, q)));
    return common.some(near) || (common.length > 1 && reached(common[0], common[1]));
  };
  const reach = new Set([own]);
  for (let grew = true; grew;) {
    grew = false;
    for (let i = 0; i < faces.length; i++)
      if (!reach.has(i) && [...reach].some((j) => joined(faces[i], faces[j])))
        grew = reach.add(i) !== undefined;
  }
  return [...reach].sort((a, b) => a - b);
}

test('connected faces agree with the reference implementation', () => {
  const next = chance(7);
  for (let round = 0; round < 60; round++) {
    const points = Array.from({ length: 14 }, () => [next(), next(), next() * 0.4]), pick = () => points[Math.floor(next() * points.length)];
    const faces = Array.from({ length: 12 }, () => Float64Array.from([...pick(), ...pick(), ...pick()])), centre = [next(), next(), 0.2], radius = 0.1 + 0.3 * next();
    assert.deepEqual(connectedFaces(faces, 0, centre, radius), referenceFaces(faces, 0, centre, radius), `round ${round}`);
  }
});

test('covered faces agree with ebpo paint', { skip: process.env.EBPO_TOOL ? false : 'EBPO_TOOL is not set' }, async (t) => {
  const folder = mkdtempSync(join(tmpdir(), 'ebpo-reach-')), at = (name) => join(folder, name), ebpo = (...args) => execFileSync(process.env.EBPO_TOOL, args, { encoding: 'utf8' });
  t.after(() => rmSync(folder, { recursive: true, force: true }));
  plates(at('plates.ply'));
  ebpo('convert', '-q', at('plates.ply'), at('plates.ebpo.h5'));
  const queries = new Queries(await openModel(readFileSync(at('plates.ebpo.h5'))));
  const painted = async (place, radius) => {
    rmSync(at('p.paint.h5'), { force: true });
    writeFileSync(at('way'), `${place.join(' ')}\n`);
    ebpo('paint', at('p.paint.h5'), at('plates.ebpo.h5'), '--new-layer', 'x', '--colour', 'ff0000', '--path', at('way'), '--radius', String(radius));
    ebpo('paint', at('p.paint.h5'), at('plates.ebpo.h5'), '--base', '000000', '--bake', at('baked.ply'));
    const text = readFileSync(at('baked.ply'), 'latin1'), count = Number(/element vertex (\d+)/.exec(text)[1]);
    ebpo('convert', '-q', at('baked.ply'), at('baked.ebpo.h5'));
    const baked = await openModel(readFileSync(at('baked.ebpo.h5'))), tree = new Tree(baked.info), leaves = [], red = new Set();
    await addLevels(baked, tree, baked.info.levels.map((_, level) => level));
    (function walk(node) {
      (node.type === LEAF ? leaves.push(node) : tree.children(node)?.forEach(walk));
    })(tree.root);
    for (const { corners, colours } of await baked.leafFaces(leaves))
      for (let c = 0; c < corners.length / 3; c++)
        if (colours[3 * c] > 0)
          red.add([...corners.subarray(3 * c, 3 * c + 3)].join());
    assert.ok(count > 0 && red.size > 0);
    const [point] = readPaint(Uint8Array.from(readFileSync(at('p.paint.h5')))).strokes[0].points;
    return { point, red };
  };
  for (const [place, radius, differs] of [[[-0.1, 0.5, 0.05], 0.3, true], [[0.6, 0.51, 0.05], 0.3, true], [[0.6, 0.51, 0.05], 0.04, false], [[0.05, 0.95, 0], 0.25, true]]) {
    const { point, red } = await painted(place, radius), [found] = await reachOf(queries, [{ face: point.face, place: point.place, radius }]);
    assert.equal(found.here, 'yes');
    assert.equal(found.faces !== undefined, differs, `at ${place} with ${radius}`);
    if (!differs)
      continue;
    const mine = new Set();
    for (let c = 0; c < found.faces.length; c += 3)
      if (Math.hypot(...[0, 1, 2].map((k) => found.faces[c + k] - point.place[k])) <= radius)
        mine.add([...found.faces.subarray(c, c + 3)].join());
    assert.deepEqual([...mine].sort(), [...red].sort(), `at ${place} with ${radius}`);
  }
  // A point on an edge is on its named face, although another face is as near. A point is not on a distant face.
  const { origin, size } = (await open(readFileSync(at('plates.ebpo.h5')))).info;
  const { face: numbers, corners: all } = await queries.with((model) => model.boxTriangles(origin, origin.map((x, k) => x + size[k])));
  const place = [0, 1, 2].map((k) => (all[k] + all[3 + k]) / 2), holders = [...numbers].filter((_, f) => [0, 3, 6].filter((c) => [0, 3].some((d) => [0, 1,
    2].every((k) => all[9 * f + c + k] === all[d + k]))).length === 2);
  assert.equal(holders.length, 2);
  const [one, other, wrong] = await reachOf(queries, [...holders, numbers.find((n) => !holders.includes(n))].map((face) => ({ face, place, radius: 0 })));
  assert.deepEqual([one.here, other.here, wrong.here, (await reachOf(queries, [{ face: holders[0], place: [5, 5, 5], radius: 0 }]))[0].here], ['yes', 'yes', 'no', 'no']);
});

test('the faces around a point are limited', async () => {
  let most;
  const model = { boxTriangles: (low, high, options) => ({ face: new Uint32Array((most = options.most) + 1), corners: new Float64Array(0) }) };
  const queries = { info: { box_size: [1, 1, 1] }, with: async (use) => use(model) };
  assert.deepEqual(await reachOf(queries, [{ face: 0, place: [0.5, 0.5, 0.5], radius: 1e300 }]), [{ here: 'no' }]);
  assert.ok(most <= 100_000);
});
