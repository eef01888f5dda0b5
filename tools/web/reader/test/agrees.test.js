// Compares query results and polygons with those of the library. Needs EBPO_TOOL (the ebpo program) and EBPO_FILES (files, separated by spaces).
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import test from 'node:test';
import { BLACK, GRAY, LEAF, Tree, distanceInterval, inside, insideLeaf, nearestFace, openEbpo } from '../index.js';

const tool = process.env.EBPO_TOOL, files = (process.env.EBPO_FILES ?? '').split(' ').filter(Boolean);
const skip = !tool || !files.length ? 'EBPO_TOOL and EBPO_FILES are not set' : false;
const run = (args, input) => execFileSync(tool, args, { input, encoding: 'utf8', maxBuffer: 1 << 28 });

async function load(path) {
  const file = await openEbpo(readFileSync(path), { name: path }), tree = new Tree(file.info);
  (await file.levels(0, file.info.level_count - 1)).forEach((level) => tree.add(level));
  return { file, tree };
}

// Counts the triangles of a level's nodes and of leaves and black nodes above: all triangles, and those that are not on cell faces.
function countTriangles(tree, level) {
  const count = { all: 0, inner: 0 };
  const walk = (node) => {
    if (node.type === GRAY && node.level < level && !tree.isPruned(node))
      tree.children(node).forEach(walk);
    else if (node.type === GRAY || node.type === LEAF || node.type === BLACK) {
      const { faces, first, onCellFace } = tree.polytope(node);
      for (let f = 0; f < faces; f++) {
        count.all += first[f + 1] - first[f] - 2;
        count.inner += onCellFace[f] ? 0 : first[f + 1] - first[f] - 2;
      }
    }
  };
  walk(tree.root);
  return count;
}

// Returns reproducible points in and around the model. Every third point is a corner of a cell.
function points(info, n) {
  let state = 7;
  const random = () => (state = (state * 48271) % 2147483647) / 2147483647;
  const place = (i) => (i % 3 ? random() * 1.2 - 0.1 : Math.floor(random() * 9) / 8);
  return Array.from({ length: n }, (_, i) => [0, 1, 2].map((k) => info.box_origin[k] + info.box_size[k] * place(i)));
}

for (const path of files) {
  const name = basename(path);
  test(`${name}: each level has as many triangles as in the library`, { skip }, async () => {
    const { file, tree } = await load(path);
    if (file.info.parts.has('mesh') && !file.info.parts.has('leaf-planes'))
      return; // here the library derives planes from the faces of leaves
    const folder = mkdtempSync(join(tmpdir(), 'ebpo-')), triangles = (...options) => {
      run(['extract', '-q', ...options, path, join(folder, 'out.ply')]);
      return Number(/element face (\d+)/.exec(readFileSync(join(folder, 'out.ply'), 'latin1').slice(0, 2000))[1]);
    };
    for (let level = 0; level <= Math.min(6, tree.depth); level++)
      assert.deepEqual(countTriangles(tree, level), { all: triangles('--level', String(level)), inner: triangles('--level', String(level), '--no-cell-faces') }, `level ${level}`);
    rmSync(folder, { recursive: true });
  });

  test(`${name}: inside and distance agree with the library, and intervals contain the distance`, { skip }, async () => {
    const { file, tree } = await load(path);
    if (!file.info.parts.has('mesh'))
      return;
    const requested = points(file.info, 300), input = requested.map((p) => p.join(' ')).join('\n');
    const lines = (text) => text.trim().split('\n').map((line) => JSON.parse(line));
    const distances = lines(run(['distance', '--json', '--unsigned', path], input)).map((d) => d.distance);
    const wheres = file.info.solid ? lines(run(['inside', '--json', path], input)) : undefined;
    for (const [i, p] of requested.entries()) {
      for (let level = 0; level <= tree.depth; level++) {
        const { lo, hi } = distanceInterval(tree, p, level);
        assert.ok(lo <= distances[i] && distances[i] <= hi, `${p}: ${lo} ${distances[i]} ${hi}`);
      }
      const near = await nearestFace(tree, p, (leaves) => file.leafFaces(leaves), () => assert.fail());
      assert.ok(Math.abs(near.distance - distances[i]) <= 1e-12 * (1 + distances[i]), `${p}: ${near.distance} ${distances[i]}`);
      if (!wheres)
        continue;
      for (let level = 0; level <= tree.depth; level++) {
        const { where } = inside(tree, p, level);
        assert.ok(where === 'maybe' || where.toUpperCase() === wheres[i].where, `${p} at level ${level}: ${where} ${wheres[i].where}`);
      }
      let found = inside(tree, p);
      if (found.where === 'maybe')
        found = insideLeaf(tree, found.node, p, (await file.leafFaces([found.node]))[0]);
      assert.equal(found.where.toUpperCase(), wheres[i].where, String(p));
    }
  });

  test(`${name}: points on the surface are classified as on, and midpoints of edges as in the library`, { skip }, async () => {
    const { file, tree } = await load(path);
    if (!file.info.solid || !file.info.parts.has('mesh'))
      return;
    const { vertices, faces } = await file.mesh(), requested = [];
    for (let f = 0; f < file.info.face_count; f += Math.ceil(file.info.face_count / 100)) {
      const corner = (k) => [0, 1, 2].map((i) => vertices[3 * faces[3 * f + k] + i]);
      requested.push(corner(0), corner(1).map((x, i) => (x + corner(2)[i]) / 2), corner(0).map((x, i) => (x + corner(1)[i] + corner(2)[i]) / 3));
    }
    const wheres = run(['inside', '--json', path], requested.map((p) => p.join(' ')).join('\n')).trim().split('\n').map((line) => JSON.parse(line));
    for (const [i, p] of requested.entries()) {
      let found = inside(tree, p);
      if (found.where === 'maybe')
        found = insideLeaf(tree, found.node, p, (await file.leafFaces([found.node]))[0]);
      assert.equal(found.where.toUpperCase(), wheres[i].where, String(p));
    }
  });
}
test('files for the comparison are given', { skip }, () => {});
