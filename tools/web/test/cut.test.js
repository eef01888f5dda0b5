// Tests the choice of nodes: it is complete, without overlap, and does not depend on the number of passes.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { Cut } from '../cut.js';
import { MeshStore } from '../mesh.js';
import { CellFaces, sidesOf, subtract } from '../cell_faces.js';
import { addLevels } from '../grow.js';
import { openModel } from '../model_file.js';
import { BLACK, GRAY, LEAF, Tree } from '../tree.js';

const bytes = readFileSync(new URL('../../../format-spec/vectors/passed/06_four_levels_leaf_planes.ebpo.h5', import.meta.url));
const view = { eye: [0.3, 0.4, 2], planes: [], pixels: 800 };
const all = { level: 99, pixels: 0, triangles: Infinity };

async function load(levels) {
  const file = await openModel(bytes), tree = new Tree(file.info);
  await addLevels(file, tree, Array.from({ length: levels ?? file.info.level_count }, (_, level) => level));
  return { file, tree, cut: new Cut(tree) };
}

// Runs passes until nothing changes. Returns the tiles of the page.
function settle(cut, want, tiles = new Map()) {
  let result, passes = 0;
  do {
    result = cut.update(view, want);
    result.removed.forEach((key) => tiles.delete(key));
    result.set.forEach((tile) => tiles.set(tile.key, tile));
    assert.ok(++passes < 100);
  } while (result.more);
  return { ...result, tiles };
}

const sum = (tiles, what) => [...tiles.values()].reduce((total, tile) => total + what(tile), 0);

test('each level has as many nodes as the file states', async () => {
  const { file, tree } = await load();
  for (let level = 0; level <= tree.depth; level++) {
    const { stats } = settle(new Cut(tree), { ...all, level }), wanted = file.info.levels.map((l, i) => (i < level ? l.leaf : i === level ? l.leaf + l.gray : 0));
    assert.deepEqual([...stats.levels, ...wanted.slice(stats.levels.length).map(() => 0)], wanted);
  }
});

test('the final tiles do not depend on earlier views', async () => {
  const { cut, tree } = await load(), tiles = new Map(), geometry = (t) => [...t.values()].map((tile) => [...tile.position].sort().join()).sort();
  for (const pixels of [200, 60, 300, 20])
    settle(cut, { ...all, pixels }, tiles);
  const once = settle(new Cut(tree), { ...all, pixels: 20 }).tiles;
  assert.equal(sum(tiles, (t) => t.triangles), sum(once, (t) => t.triangles));
  assert.deepEqual(geometry(tiles), geometry(once));
});

test('an unchanged view builds no tile', async () => {
  const { cut } = await load();
  settle(cut, all);
  const again = cut.update(view, all);
  assert.deepEqual([again.set, again.removed, again.more], [[], [], false]);
});

test('triangles: plane polygons first, valid indices, cell faces counted', async () => {
  const { cut } = await load(), { tiles, stats } = settle(cut, { ...all, lines: true, cells: true });
  for (const t of tiles.values()) {
    assert.equal(t.index.length, 3 * t.triangles);
    assert.equal(t.inner, t.triangles - t.cellFaceTriangles);
    assert.ok(t.index.every((i) => i < t.position.length / 3) && t.lines.every((i) => i < t.position.length / 3));
    assert.ok(t.position.every((x) => Math.abs(x) <= 1) && t.cells.every((x) => Math.abs(x) <= 1));
  }
  assert.equal(sum(tiles, (t) => t.cells.length / 72), stats.nodes);
});

test('missing levels are requested, and drawn when they arrive', async () => {
  const { file, tree, cut } = await load(2);
  assert.ok(settle(cut, all).deeper);
  await addLevels(file, tree, Array.from({ length: file.info.level_count - 2 }, (_, i) => 2 + i));
  const end = settle(cut, all);
  assert.ok(!end.deeper);
  assert.equal(end.stats.nodes, settle(new Cut(tree), all).stats.nodes);
});

test('a budget reduces triangles and keeps the cut complete', async () => {
  const { tree, cut } = await load();
  const { stats, tiles } = settle(cut, { ...all, triangles: 400 });
  assert.ok(stats.triangles < sum(settle(new Cut(tree), all).tiles, (t) => t.triangles));
  assert.ok(stats.nodes > 0 && tiles.size > 0);
});

test('black nodes are drawn on request', async () => {
  const { file, cut } = await load(), black = file.info.levels.reduce((n, l) => n + l.black, 0);
  const without = settle(cut, all).stats.nodes;
  assert.ok(black > 0);
  assert.equal(settle(cut, { ...all, black: true }).stats.nodes, without + black);
});

test('leaves show their real faces when these have arrived', async () => {
  const { file, cut } = await load(), want = { ...all, mesh: true };
  const { leaves } = settle(cut, want), lists = await file.leafFaces(leaves);
  assert.equal(leaves.length, file.info.levels.reduce((n, l) => n + l.leaf, 0));
  leaves.forEach((leaf, i) => cut.addMesh(leaf, lists[i]));
  const { stats, leaves: missing } = settle(cut, want);
  assert.equal(missing.length, 0);
  assert.equal(stats.meshTriangles, file.info.face_count); // each face once, although several leaves may list it
  assert.ok(lists.reduce((n, l) => n + l.numbers.length, 0) > file.info.face_count);
  assert.equal(new Set(lists.flatMap((l) => [...l.numbers])).size, file.info.face_count);
});

test('the tree has as many nodes as the file states, each at its position', async () => {
  const { file, tree } = await load(), count = file.info.levels.map(() => ({ gray: 0, leaf: 0, black: 0 }));
  const walk = (node) => {
    const name = { [GRAY]: 'gray', [LEAF]: 'leaf', [BLACK]: 'black' }[node.type];
    if (name)
      assert.equal(node.rank, count[node.level][name]++);
    tree.children(node)?.forEach(walk);
  };
  walk(tree.root);
  file.info.levels.forEach((l, i) => assert.deepEqual(count[i], { gray: l.gray, leaf: l.leaf, black: l.black }));
});

// --- cell faces ---

const inside = (p, u, v) => {
  let sign = 0;
  for (let i = 0, j = p.length - 2; i < p.length; j = i, i += 2) {
    const side = Math.sign((p[i] - p[j]) * (v - p[j + 1]) - (p[i + 1] - p[j + 1]) * (u - p[j]));
    if (side && sign && side !== sign)
      return false;
    sign ||= side;
  }
  return true;
};

test('subtracting a convex polygon: every point is in one piece or hidden', () => {
  const square = [0, 0, 1, 0, 1, 1, 0, 1];
  const cases = [[0.2, 0.2, 0.7, 0.3, 0.5, 0.9], [-1, -1, 2, -1, 2, 0.5, -1, 0.5], [0.5, 0.9, 0.7, 0.3, 0.2, 0.2], [2, 2, 3, 2, 3, 3], [-1, -1, 2, -1, 2, 2, -1, 2]];
  for (const q of cases) {
    const pieces = subtract([square], q);
    for (let i = 0; i < 400; i++) {
      const u = (i % 20 + 0.513) / 20, v = (Math.floor(i / 20) + 0.487) / 20;
      assert.equal(pieces.filter((p) => inside(p, u, v)).length, inside(q, u, v) ? 0 : 1, `${u} ${v} of ${q}`);
    }
  }
});

// A point on a cell face of a drawn envelope is visible unless a black cell or a drawn envelope on the other side covers it.
test('cell faces are hidden exactly where a neighbour covers them', async () => {
  const { tree, cut } = await load();
  settle(cut, { ...all, level: 3 });
  const drawn = new Set(cut.nodes), cellFaces = new CellFaces(tree, (n) => drawn.has(n), (n) => tree.polytope(n)), found = { seen: 0, hidden: 0 };
  const polygon = (p, f, axis) => Array.from({ length: p.first[f + 1] - p.first[f] }, (_, i) => [(axis + 1) % 3, (axis + 2) % 3].map((k) => p.x[3 * p.corner[p.first[f] + i] + k])).flat();
  const twin = (node, axis, side, u, v) => { // reference implementation: descends from the root to a point on the other side
    const x = node.at.map((n) => n / 2 ** node.level);
    x[axis] = (node.at[axis] + side) / 2 ** node.level;
    x[(axis + 1) % 3] += u / 2 ** node.level;
    x[(axis + 2) % 3] += v / 2 ** node.level;
    if ((x[axis] === 0 && side === 0) || (x[axis] === 1 && side === 1))
      return false;
    let n = tree.root;
    while (!drawn.has(n) && tree.children(n))
      n = tree.children(n)[[0, 1, 2].reduce((o, k) => {
        const middle = (2 * n.at[k] + 1) / 2 ** (n.level + 1);
        return o | (k === axis && !side ? x[k] > middle : x[k] >= middle) << k;
      }, 0)];
    if (n.type === BLACK)
      return true;
    const p = tree.polytope(n), f = [...sidesOf(p)].indexOf(2 * axis + 1 - side), at = (k) => x[k] * 2 ** n.level - n.at[k];
    return drawn.has(n) && f >= 0 && inside(polygon(p, f, axis), at((axis + 1) % 3), at((axis + 2) % 3));
  };
  for (const node of drawn) {
    const p = tree.polytope(node), sides = sidesOf(p);
    for (let f = 0; f < p.faces; f++) {
      assert.equal(sides[f] >= 0, p.onCellFace[f] === 1);
      if (sides[f] < 0)
        continue;
      const axis = sides[f] >> 1, own = polygon(p, f, axis), pieces = cellFaces.seen(node, p, f) ?? [own];
      for (let i = 0; i < 49; i++) {
        const u = (i % 7 + 0.5137) / 7, v = (Math.floor(i / 7) + 0.4871) / 7;
        if (!inside(own, u, v))
          continue;
        const isSeen = pieces.some((q) => inside(q, u, v)), hidden = twin(node, axis, sides[f] & 1, u, v);
        found[isSeen ? 'seen' : 'hidden']++;
        assert.ok(!isSeen || !hidden, `${node.level} ${node.at} side ${sides[f]} at ${u} ${v}: drawn though hidden`);
        found.wrong = (found.wrong ?? 0) + (!isSeen && !hidden ? 1 : 0);
      }
    }
  }
  assert.ok(found.seen > 100 && found.hidden > 1000, JSON.stringify(found));
  assert.ok(found.wrong <= 0.01 * found.seen, `thin pieces only: ${JSON.stringify(found)}`);
});

// --- real faces ---

const CUBE = [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 7, 3], [1, 5, 7]];
const cornersOf = (v) => [v & 1, v >> 1 & 1, v >> 2];

test('normals: edges of a cube are sharp, a bent sheet is smooth, weights are angles', () => {
  const store = new MeshStore(), leaf = { id: 1 }, n = [0, 0, 0];
  store.add(leaf, CUBE.flat().flatMap(cornersOf), CUBE.map((_, i) => i));
  assert.equal(store.vertices, 8);
  for (let c = 0; c < 36; c++) {
    store.cornerNormal(c, n);
    const own = Math.floor(c / 3), size = Math.hypot(...n);
    for (let k = 0; k < 3; k++)
      assert.ok(Math.abs(n[k] / size - store.normal[3 * own + k]) < 1e-6);
  }
  const sheet = new MeshStore(), z = 0.1; // two triangles and one beyond the fold: angles of 45 + 45 degrees on one side weigh as much as 90 degrees on the other
  sheet.add({ id: 2 }, [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, -1, 0, z], [1, 2, 3]);
  sheet.cornerNormal(0, n);
  const lean = Math.hypot(z, 1), wanted = [z / lean * Math.PI / 2, 0, Math.PI / 2 + Math.PI / 2 / lean];
  for (let k = 0; k < 3; k++)
    assert.ok(Math.abs(Math.abs(n[k]) - Math.abs(wanted[k])) < 1e-5, `${n} ${wanted}`);
});

test('one of the leaves that list a face draws it, another one when this leaf is gone, and changed normals are reported', () => {
  const store = new MeshStore(), a = { id: 7 }, b = { id: 3 }, corners = CUBE.flat().flatMap(cornersOf);
  store.add(a, corners.slice(0, 27), [0, 1, 2]);
  const before = a.stamp;
  store.add(b, corners.slice(18, 45), [2, 3, 4]);
  assert.ok(a.stamp > before);
  assert.equal(store.faces, 5);
  store.share([a, b]);
  assert.deepEqual([a.owned, b.owned], [2, 3]);
  const { ownedHash } = a;
  store.share([a]);
  assert.equal(a.owned, 3);
  assert.notEqual(a.ownedHash, ownedHash);
  store.keep([a]);
  store.share([a]);
  assert.deepEqual([store.faces, a.owned], [3, 3]);
});
