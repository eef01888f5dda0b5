// SPDX-License-Identifier: MIT
// Everything that can be queried in a file, each kind as a text of its results, or the reader's own error. Other errors are thrown.
import { createHash } from 'node:crypto';
import { EbpoError, Tree, distanceInterval, envelope, inside, insideLeaf, nearestFace, openEbpo } from '../../../tools/web/reader/index.js';

function plain(_, v) {
  if (v instanceof Set)
    return [...v];
  if (typeof v === 'bigint')
    return String(v);
  return ArrayBuffer.isView(v) ? Buffer.from(v.buffer, v.byteOffset, v.byteLength).toString('base64') : v;
}

const digest = (value) => createHash('sha256').update(JSON.stringify(value, plain) ?? '').digest('base64');

const point = (info, i) => [0, 1, 2].map((k) => info.box_origin[k] + info.box_size[k] * (([0.7548776662466927, 0.5698402909980532, 0.3247179572447461][k] * (i + 1)) % 1 * 1.2 - 0.1));

async function treeOf(file) {
  const tree = new Tree(file.info);
  (await file.levels(0, file.info.level_count - 1)).forEach((level) => tree.add(level));
  return tree;
}

const evaluate = {
  facts: async (file) => Object.entries(file.info).filter(([name]) => !/^(chunk_index|top_bytes)/.test(name)),
  levels: async (file) => (await file.levels(0, file.info.level_count - 1, { faces: file.info.parts.has('mesh') })).map((l) => ({ ...l })),
  mesh: async (file) => (file.info.parts.has('mesh') ? file.mesh() : null),
  maps: async (file) => (file.info.parts.has('maps') ? file.maps() : null),
  envelopes: async (file) => {
    const tree = await treeOf(file), found = [];
    const walk = (node) => {
      if (node.level < 3 && node.type === 3 && !tree.isPruned(node))
        tree.children(node).forEach(walk);
      else if (node.type > 0)
        found.push([...tree.polytope(node).x]);
    };
    walk(tree.root);
    return found;
  },
  questions: async (file) => {
    if (!file.info.parts.has('mesh'))
      return null;
    const tree = await treeOf(file), found = [];
    for (let i = 0; i < 12; i++) {
      const p = point(file.info, i);
      let where = file.info.solid ? inside(tree, p) : {};
      if (where.where === 'maybe')
        where = insideLeaf(tree, where.node, p, (await file.leafFaces([where.node]))[0]);
      const near = await nearestFace(tree, p, (leaves) => file.leafFaces(leaves), () => {});
      found.push([where.where, where.winding, distanceInterval(tree, p, 2), near.distance, near.face]);
    }
    return found;
  },
  subtrees: async (file) => {
    const { info } = file;
    if (!info.subtree_level)
      return null;
    const all = await file.subtrees(Array.from({ length: Math.min(8, info.levels[info.subtree_level].gray) }, (_, i) => i));
    return all.map(({ level, part, segment }) => [level, part, [...segment.types]]);
  },
};
export const kinds = Object.keys(evaluate);

/** { open: error } or { [kind]: { said, error } }, and where the chunks are. */
export async function queryAll(bytes) {
  let file;
  try {
    file = await openEbpo(bytes, { name: 'damaged' });
    await file.locate();
  } catch (error) {
    if (error instanceof EbpoError)
      return { open: error.code };
    throw error;
  }
  const out = { chunks: [...file.arrays.values()].flatMap(({ path, chunks }) => chunks.map(({ at, bytes: size }, chunk) => ({ path, chunk, at, bytes: size }))) };
  for (const kind of kinds)
    try {
      out[kind] = { said: digest(await evaluate[kind](file)), error: false };
    } catch (error) {
      if (!(error instanceof EbpoError))
        throw error;
      out[kind] = { said: `error ${error.code}`, error: true };
    }
  out.verified = true;
  await file.verifyContent().catch((error) => {
    if (!(error instanceof EbpoError))
      throw error;
    out.verified = false;
  });
  return out;
}
