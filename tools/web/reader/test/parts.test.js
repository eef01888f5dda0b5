// Compares parts of levels and subtrees with whole levels: nodes, planes, lists, faces and query results must be equal. Limits requests, round trips and memory.
// Uses the vectors and the files in EBPO_FILES (separated by spaces).
import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { basename } from 'node:path';
import test from 'node:test';
import { GRAY, LEAF, Tree, growForQuery, growForView, inside, insideLeaf, nearestFace, nearestOnTriangle, openEbpo } from '../index.js';
import { SlowSource } from './slow_source.js';

const passed = new URL('../../../../format-spec/vectors/passed/', import.meta.url).pathname;
const files = [...readdirSync(passed).filter((n) => n.endsWith('.h5')).map((n) => passed + n), ...(process.env.EBPO_FILES ?? '').split(' ').filter(Boolean)];
const withSubtrees = (path) => readFileSync(path).includes('subtree_level');

// Reference implementation: builds the tree by loops over whole levels and counts nodes one by one.
function plainTree(levels) {
  const nodes = levels.map(() => [[], [], [], []]);
  levels.forEach((level) => {
    for (let group = 0; group < level.groups; group++)
      for (let octant = 0; octant < (level.level ? 8 : 1); octant++) {
        const type = level.types[group] >> 2 * octant & 3, above = level.level ? nodes[level.level - 1][GRAY][group] : undefined;
        const node = { type, level: level.level, octant, children: [], rank: nodes[level.level][type].length };
        nodes[level.level][type].push(node);
        above?.children.push(node);
      }
    let at = 0;
    nodes[level.level][GRAY].forEach((n, i) => (n.planes = level.planes ? [...level.planes.slice(at, at += level.planeCounts[i])] : []));
    at = 0;
    nodes[level.level][LEAF].forEach((n, i) => {
      n.planes = level.leafPlanes ? [...level.leafPlanes.slice(at, at += level.leafPlaneCounts[i])] : [];
      n.winding = level.leafWinding?.[i] ?? 0;
    });
    at = 0;
    if (level.leafFirst)
      nodes[level.level][LEAF].forEach((n, i) => (n.faces = [...level.leafRefs?.slice(at, at += level.leafRefCount[i]) ?? [],
        ...Array.from({ length: level.leafNew[i] }, (_, k) => level.leafFirst[i] + k)]));
    nodes[level.level][0].forEach((n, i) => (n.winding = level.whiteWinding?.[i] ?? 0));
    nodes[level.level][1].forEach((n, i) => (n.winding = level.blackWinding?.[i] ?? 1));
  });
  return nodes[0].flat()[0];
}

// Returns a tree with level 0 and the nodes that `grow(tree, nodes)` loads below nodes without children.
async function grown(file, grow) {
  const tree = new Tree(file.info);
  tree.add((await file.levels(0, 0))[0]);
  const walk = (node, out) => {
    if (node.type === GRAY && !tree.children(node) && !tree.isPruned(node))
      out.push(node);
    tree.children(node)?.forEach((child) => walk(child, out));
    return out;
  };
  for (let missing = walk(tree.root, []); missing.length; missing = walk(tree.root, []))
    await grow(tree, missing);
  return tree;
}

const partsBelow = async (file, tree, nodes) => {
  const wanted = new Map(nodes.map((n) => [`${n.level + 1} ${tree.partOf(n)}`, { level: n.level + 1, part: tree.partOf(n) }])), list = [...wanted.values()];
  (await file.nodeParts(list)).forEach((segment, i) => tree.addPart(list[i].part, segment));
};

function compare(tree, node, plain, planes) {
  const { type, level, octant, rank } = node;
  assert.deepEqual({ type, level, octant, rank }, { type: plain.type, level: plain.level, octant: plain.octant, rank: plain.rank });
  if (planes && (type === GRAY || type === LEAF))
    assert.deepEqual([...tree.planes(node)], plain.planes);
  if (type !== GRAY && !(planes && type === LEAF && node.parent))
    assert.equal(tree.winding(node), plain.winding);
  const children = tree.children(node) ?? [];
  assert.equal(children.length, tree.isPruned(node) ? 0 : plain.children.length);
  children.forEach((child, i) => compare(tree, child, plain.children[i], planes));
}

function leavesOf(tree, node = tree.root, out = []) {
  if (node.type === LEAF)
    out.push(node);
  tree.children(node)?.forEach((child) => leavesOf(tree, child, out));
  return out;
}

// Returns reproducible points: near faces, on corners of cells, and others.
async function points(file, n) {
  const { box_origin: origin, box_size: size } = file.info, { vertices, faces } = await file.mesh();
  let state = 5;
  const random = () => (state = (state * 48271) % 2147483647) / 2147483647;
  return Array.from({ length: n }, (_, i) => {
    if (i % 3 === 2)
      return origin.map((o, k) => o + size[k] * (i % 2 ? random() : Math.floor(random() * 9) / 8));
    const f = 3 * Math.floor(random() * faces.length / 3);
    return [0, 1, 2].map((k) => (vertices[3 * faces[f] + k] + vertices[3 * faces[f + 1] + k] + vertices[3 * faces[f + 2] + k]) / 3 + size[k] * (random() - 0.5) / (i % 3 ? 500 : 20));
  });
}

async function query(file, whole, p) {
  const lean = whole.lean(), deeper = (nodes) => growForQuery(file, lean, nodes);
  const near = await nearestFace(lean, p, (leaves) => file.leafFaces(leaves), deeper);
  if (!file.info.solid)
    return { near };
  let found = inside(lean, p);
  while (found.where === 'maybe' && found.node.type === GRAY) {
    await deeper([found.node]);
    found = inside(lean, p);
  }
  return { near, where: found.where === 'maybe' ? insideLeaf(lean, found.node, p, (await file.leafFaces([found.node]))[0]).where : found.where };
}

for (const path of files) {
  const name = basename(path), bytes = readFileSync(path);
  test(`${name}: parts of levels have the nodes, planes and windings of whole levels`, async () => {
    const file = await openEbpo(bytes), levels = await file.levels(0, file.info.level_count - 1, { faces: true }), plain = plainTree(levels);
    const ways = [[(tree, nodes) => partsBelow(file, tree, nodes), true], [(tree, nodes) => growForView(file, tree, nodes.map((node) => ({ node, levels: 3 }))), true],
      [(tree, nodes) => growForView(file, tree, nodes.slice(0, 5).map((node) => ({ node, levels: 1 })), { bytes: 1 }), true],
      [(tree, nodes) => growForQuery(file, tree, nodes), false]];
    for (const [grow, planes] of ways) {
      const tree = await grown(file, grow);
      compare(tree, tree.root, plain, planes);
    }
  });

  test(`${name}: leaves have the faces of whole levels, also with very little memory`, async () => {
    const all = await openEbpo(bytes);
    if (!all.info.parts.has('mesh'))
      return;
    const plain = plainTree(await all.levels(0, all.info.level_count - 1, { faces: true })), mesh = await all.mesh(), { info } = all;
    for (const cacheBytes of [1 << 26, 5000]) {
      const file = await openEbpo(bytes, { cacheBytes }), tree = await grown(file, (t, nodes) => growForQuery(file, t, nodes)), leaves = leavesOf(tree);
      const step = Math.ceil(leaves.length / 8);
      for (let i = 0; i < leaves.length; i += step) {
        const some = leaves.slice(i, i + Math.min(step, 100)), faces = await file.leafFaces(some);
        some.forEach((leaf, k) => {
          const numbers = find(tree, leaf, plain).faces;
          assert.deepEqual([...faces[k].numbers], numbers);
          assert.deepEqual([...faces[k]], numbers.flatMap((f) => [0, 1, 2].flatMap((c) => [...mesh.vertices.slice(3 * mesh.faces[3 * f + c], 3 * mesh.faces[3 * f + c] + 3)])));
        });
        assert.ok(file.store.cache.bytes <= cacheBytes, `${file.store.cache.bytes} bytes are kept`);
        assert.equal(file.store.cache.bytes, [...file.store.cache.kept.values()].reduce((sum, v) => sum + v.byteLength, 0));
      }
    }
    assert.ok(info.face_count > 0);
  });

  test(`${name}: nearest face and inside agree with a search of all faces`, async () => {
    const file = await openEbpo(bytes);
    if (!file.info.parts.has('mesh') || file.info.parts.has('pruned'))
      return;
    const { vertices, faces } = await file.mesh(), whole = new Tree(file.info), corners = new Float64Array(faces.length * 3);
    faces.forEach((v, i) => corners.set(vertices.subarray(3 * v, 3 * v + 3), 3 * i));
    whole.add((await file.levels(0, 0))[0]);
    const full = new Tree(file.info), all = await openEbpo(bytes);
    (await all.levels(0, all.info.level_count - 1)).forEach((level) => full.add(level));
    for (const p of await points(file, Math.max(6, Math.min(40, Math.floor(5e5 / file.info.face_count))))) {
      const { near, where } = await query(file, whole, p), old = await query(all, full, p);
      let best = Infinity;
      for (let at = 0; at < corners.length; at += 9)
        best = Math.min(best, nearestOnTriangle(p, corners, at)[0]);
      assert.equal(near.distance, best < Infinity ? best : old.near.distance, String(p));
      assert.equal(old.near.distance, near.distance);
      assert.equal(where, old.where, String(p));
    }
  });
}

// Returns the node of the reference tree at a node's position.
function find(tree, node, plain) {
  return node.parent ? find(tree, node.parent, plain).children[node.octant] : plain;
}

for (const path of files.filter(withSubtrees))
  test(`${basename(path)}: a subtree is read in one batch after one look-up`, async () => {
    const bytes = readFileSync(path), source = new SlowSource(bytes), file = await openEbpo(source, { headBytes: 16384 }), { info } = file;
    const tree = new Tree(info);
    (await file.levels(0, info.subtree_level)).forEach((level) => tree.add(level));
    await file.locate();
    await file.parts.subtrees.rows([0]); // the index, and a chunk of counts
    const roots = info.levels[info.subtree_level].gray, { cache } = file.store;
    for (let i = 0; i < roots; i += Math.ceil(roots / 12)) {
      await file.parts.subtrees.rows([i]); // the look-up of the table
      cache.kept.clear();
      cache.bytes = 0;
      await file.parts.subtrees.rows([i]); // cached, except for the counts
      source.count();
      const found = await file.subtrees([i]), { roundTrips, requests } = source.count(), lean = tree.lean();
      const turns = 1 + Math.ceil((requests - 1) / 6); // one round trip for shared blocks; the other requests run six at a time
      assert.ok(roundTrips <= turns && requests <= 10, `${roundTrips} round trips, ${requests} requests for subtree ${i}`);
      found.forEach(({ part, segment }) => lean.addPart(part, segment));
      const root = nodeOf(lean, lean.root, i, info.subtree_level), leaves = leavesOf(lean, root);
      if (info.parts.has('mesh') && leaves.length)
        await file.leafFaces(leaves);
      assert.deepEqual(source.requested.slice(source.requests - source.count().requests), [], 'its faces were requested after it');
    }
  });

function nodeOf(tree, node, rank, level) {
  if (node.level === level)
    return node.type === GRAY && node.rank === rank ? node : undefined;
  for (const child of tree.children(node) ?? []) {
    const found = nodeOf(tree, child, rank, level);
    if (found)
      return found;
  }
  return undefined;
}
