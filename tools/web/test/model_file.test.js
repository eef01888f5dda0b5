// Tests the data for drawing: parts of levels, and faces of leaves, agree with whole levels and with the mesh of the file; damaged files are errors.
import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { test } from 'node:test';
import { open } from '../ebpo/index.js';
import { EbpoError } from '../error.js';
import { addLevels, growForView } from '../grow.js';
import { openModel } from '../model_file.js';
import { GRAY, LEAF, Tree } from '../tree.js';

const vectors = new URL('../../../format-spec/vectors/', import.meta.url).pathname;
const filesOf = (folder) => readdirSync(vectors + folder).filter((name) => name.endsWith('.h5')).map((name) => `${vectors}${folder}/${name}`);
const generated = (process.env.EBPO_FILES ?? '').split(' ').filter(Boolean);

const everyLevel = ({ info }) => info.levels.map((_, level) => level);
function nodesOf(tree) {
  const out = [];
  (function walk(node) {
    out.push(node);
    tree.children(node)?.forEach(walk);
  })(tree.root);
  return out;
}
const facts = (tree) => nodesOf(tree).map((node) => [node.level, ...node.at, node.type, node.rank, ...tree.planes(node), tree.colour(node)].join());

test('nodes by parts are those of whole levels', async () => {
  for (const path of [...filesOf('passed'), ...generated]) {
    const file = await openModel(readFileSync(path), { name: path }), whole = new Tree(file.info), parts = new Tree(file.info);
    await addLevels(file, whole, everyLevel(file));
    await addLevels(file, parts, [0]);
    for (let missing = [parts.root]; missing.length;) {
      await growForView(file, parts, missing.map((node) => ({ node, levels: 2 })), { bytes: 4096 });
      missing = nodesOf(parts).filter((node) => node.type === GRAY && !node.children && !parts.isPruned(node));
    }
    assert.deepEqual(facts(parts), facts(whole), path);
  }
});

test('backs of faces are hidden only behind one shell that is oriented outwards', { skip: !generated.length }, async () => {
  const closed = { ring: true, cube: true, ring_box: false, cavity: false, overlapping_cubes: false, inside_out_cube: false, mobius: false };
  for (const [name, expected] of Object.entries(closed)) {
    const path = generated.find((file) => file.endsWith(`/${name}.ebpo.h5`));
    assert.equal((await openModel(readFileSync(path), { name })).info.closed, expected, name);
  }
});

// A text of a face, equal for each first corner.
function faceKey(corners) {
  const texts = [0, 3, 6].map((k) => corners.slice(k, k + 3).join(' ')), first = texts.indexOf([...texts].sort()[0]);
  return [0, 1, 2].map((k) => texts[(first + k) % 3]).join(', ');
}

test('faces of leaves are those of the mesh, each in some leaf', async () => {
  for (const path of [...filesOf('passed'), ...generated]) {
    const bytes = readFileSync(path), file = await openModel(bytes, { name: path }), tree = new Tree(file.info);
    await addLevels(file, tree, everyLevel(file));
    const leaves = nodesOf(tree).filter((node) => node.type === LEAF).reverse();
    if (!file.info.parts.has('mesh')) {
      await assert.rejects(file.leafFaces(leaves), { code: 'ABSENT' });
      continue;
    }
    // The mesh is in the order of the source, faces of leaves have their numbers in the file.
    const { vertices, faces } = await (await open(bytes)).mesh(), expected = [];
    for (let i = 0; i < faces.length; i += 3)
      expected.push(faceKey([...faces.slice(i, i + 3)].flatMap((v) => [...vertices.slice(3 * v, 3 * v + 3)])));
    const known = new Set(expected), found = new Map();
    for (const { numbers, corners } of await file.leafFaces(leaves)) {
      assert.ok(numbers.every((n, i) => i === 0 || n > numbers[i - 1]), path);
      numbers.forEach((n, i) => {
        const key = faceKey([...corners.slice(9 * i, 9 * i + 9)]);
        assert.ok(known.has(key), path);
        assert.equal(found.get(n) ?? key, key, path);
        found.set(n, key);
      });
    }
    if (!file.info.subset_of)
      assert.deepEqual([...found.values()].sort(), expected.sort(), path);
  }
});

test('damaged files are errors, or give the data of the undamaged file', async () => {
  const read = async (bytes) => {
    const file = await openModel(bytes), tree = new Tree(file.info);
    await addLevels(file, tree, everyLevel(file));
    const leaves = nodesOf(tree).filter((node) => node.type === LEAF), faces = file.info.parts.has('mesh') ? await file.leafFaces(leaves) : [];
    await file.sums;
    return JSON.stringify([facts(tree), faces.map(({ corners }) => [...corners])]);
  };
  const check = (error) => assert.ok(error instanceof EbpoError && ['FORMAT', 'VERSION', 'UNSUPPORTED', 'LIMIT'].includes(error.code), error.stack);
  for (const path of filesOf('failed'))
    await read(readFileSync(path)).catch(check);
  const good = readFileSync(`${vectors}passed/55_chunk_checksums_of_subtrees.ebpo.h5`), expected = await read(good);
  for (let at = 100; at < good.length; at += 997) {
    const bytes = Uint8Array.from(good);
    bytes[at] ^= 1 << at % 8;
    const found = await read(bytes).catch(check);
    assert.ok(found === undefined || found === expected, `byte ${at}`);
  }
});
