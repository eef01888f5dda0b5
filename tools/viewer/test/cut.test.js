// The choice of nodes: complete, without overlap, the same whether made in one pass or in many.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { Cut } from '../cut.js';
import { BLACK, GRAY, LEAF, Tree, openEbpo } from '../reader/index.js';

const bytes = readFileSync(new URL('../../../format-spec/vectors/passed/06_four_levels_leaf_planes.ebpo.h5', import.meta.url));
const view = { eye: [0.3, 0.4, 2], planes: [], pixels: 800 };
const all = { level: 99, pixels: 0, triangles: Infinity };

async function load(levels) {
  const file = await openEbpo(bytes), tree = new Tree(file.info);
  (await file.levels(0, (levels ?? file.info.level_count) - 1)).forEach((level) => tree.add(level));
  return { file, tree, cut: new Cut(tree) };
}

// Passes until nothing is left to do; the tiles as the page has them.
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

test('everything, level by level: as many nodes as the file says', async () => {
  const { file, tree } = await load();
  for (let level = 0; level <= tree.depth; level++) {
    const { stats } = settle(new Cut(tree), { ...all, level }), wanted = file.info.levels.map((l, i) => (i < level ? l.leaf : i === level ? l.leaf + l.gray : 0));
    assert.deepEqual([...stats.levels, ...wanted.slice(stats.levels.length).map(() => 0)], wanted);
  }
});

test('the tiles at the end do not depend on the way there', async () => {
  const { cut, tree } = await load(), tiles = new Map(), geometry = (t) => [...t.values()].map((tile) => [...tile.position].sort().join()).sort();
  for (const pixels of [200, 60, 300, 20])
    settle(cut, { ...all, pixels }, tiles);
  const once = settle(new Cut(tree), { ...all, pixels: 20 }).tiles;
  assert.equal(sum(tiles, (t) => t.triangles), sum(once, (t) => t.triangles));
  assert.deepEqual(geometry(tiles), geometry(once));
});

test('a view that has not changed makes nothing again', async () => {
  const { cut } = await load();
  settle(cut, all);
  const again = cut.update(view, all);
  assert.deepEqual([again.set, again.removed, again.more], [[], [], false]);
});

test('triangles: plane polygons first, all indices name vertices, walls counted', async () => {
  const { cut } = await load(), { tiles, stats } = settle(cut, { ...all, lines: true, cells: true });
  for (const t of tiles.values()) {
    assert.equal(t.index.length, 3 * t.triangles);
    assert.equal(t.inner, t.triangles - t.wallTriangles);
    assert.ok(t.index.every((i) => i < t.position.length / 3) && t.lines.every((i) => i < t.position.length / 3));
    assert.ok(t.position.every((x) => Math.abs(x) <= 1) && t.cells.every((x) => Math.abs(x) <= 1));
  }
  assert.equal(sum(tiles, (t) => t.cells.length / 72), stats.nodes);
});

test('levels that are not there are asked for, and drawn when they come', async () => {
  const { file, tree, cut } = await load(2);
  assert.ok(settle(cut, all).deeper);
  (await file.levels(2, file.info.level_count - 1)).forEach((level) => tree.add(level));
  const end = settle(cut, all);
  assert.ok(!end.deeper);
  assert.equal(end.stats.nodes, settle(new Cut(tree), all).stats.nodes);
});

test('with a budget there are fewer triangles, and the cut stays complete', async () => {
  const { tree, cut } = await load();
  const { stats, tiles } = settle(cut, { ...all, triangles: 400 });
  assert.ok(stats.triangles < sum(settle(new Cut(tree), all).tiles, (t) => t.triangles));
  assert.ok(stats.nodes > 0 && tiles.size > 0);
});

test('black nodes are drawn when asked for', async () => {
  const { file, cut } = await load(), black = file.info.levels.reduce((n, l) => n + l.black, 0);
  const without = settle(cut, all).stats.nodes;
  assert.ok(black > 0);
  assert.equal(settle(cut, { ...all, black: true }).stats.nodes, without + black);
});

test('leaves show their real faces once these are there', async () => {
  const { file, cut } = await load(), want = { ...all, mesh: true };
  const { leaves } = settle(cut, want), lists = await file.leafFaces(leaves);
  assert.equal(leaves.length, file.info.levels.reduce((n, l) => n + l.leaf, 0));
  leaves.forEach((leaf, i) => cut.addMesh(leaf, lists[i]));
  const { stats, leaves: missing } = settle(cut, want);
  assert.equal(missing.length, 0);
  assert.equal(stats.meshTriangles, file.info.levels.reduce((n, l) => n + l.faces_new + l.faces_referenced, 0));
  assert.equal(new Set(lists.flatMap((l) => [...l.numbers])).size, file.info.face_count);
});

test('the tree has the nodes that the file counts, and each has its place', async () => {
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
