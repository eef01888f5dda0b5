// Loads the nodes below some nodes of a tree in one batch: whole levels when a large share of a level is needed, otherwise parts of levels.
import { INDEX_ROWS } from './facts.js';

const BATCH_BYTES = 256 * 1024;                // default size limit of a batch of parts; pictures are drawn between batches
const WHOLE_SHARE = 0.3;                       // a level is loaded completely when a greater share of its parts is needed
const WHOLE_BYTES_MOST = 64 * 1024 * 1024;     // approximate limit of completely loaded levels, decoded

/** Returns the levels that are always read whole: the levels above subtrees, or small levels in other files. */
export function isSmall(info, level) {
  return info.subtree_level === undefined ? level === 0 || info.levels[level - 1].gray <= INDEX_ROWS : level <= info.subtree_level;
}

function fits(tree, level) {
  const bytes = (s) => s.gray * (tree.info.parts.has('colours') ? 10 : 6) + s.planes * 4 + s.leaf * 6 + s.leaf_planes * 4;
  return [...tree.levels.filter(Boolean).map((_, l) => tree.info.levels[l]), tree.info.levels[level]].reduce((sum, s) => sum + bytes(s), 0) < WHOLE_BYTES_MOST;
}

async function addWhole(file, tree, numbers) {
  const missing = numbers.filter((level) => !tree.levels[level]).sort((a, b) => a - b);
  for (let i = 0, from = 0; i < missing.length; i++)
    if (missing[i + 1] !== missing[i] + 1) { // reads consecutive levels together
      (await file.levels(missing[from], missing[i])).forEach((level) => tree.add(level));
      from = i + 1;
    }
}

/**
 * Loads nodes for drawing. wants: [{ node, levels }], most important first: nodes whose children are not loaded, and the number of levels to load below them.
 * `bytes`: approximate limit of fetched bytes. Returns the number of loaded parts and levels.
 */
export async function growForView(file, tree, wants, { bytes = BATCH_BYTES } = {}) {
  const { info } = tree, whole = new Set(), parts = new Map(), count = [];
  const below = ({ node, levels }) => Array.from({ length: Math.min(levels, info.level_count - 1 - node.level) }, (_, i) => node.level + 1 + i)
    .filter((l) => !tree.levels[l] && (l === node.level + 1 || isSmall(info, l) || (file.parts.bySubtree(l) && node.level >= info.subtree_level)));
  for (const want of wants)
    for (const level of below(want))
      (count[level] ??= new Set()).add(tree.partOf(want.node));
  count.forEach((numbers, level) => {
    const all = file.parts.bySubtree(level) ? info.levels[info.subtree_level].gray : Math.ceil(info.levels[level - 1].gray / INDEX_ROWS);
    if (isSmall(info, level) || (numbers.size > WHOLE_SHARE * all && fits(tree, level)))
      whole.add(level);
  });
  for (const want of wants)
    for (const level of below(want)) {
      const part = tree.partOf(want.node);
      if (!whole.has(level))
        parts.set(level * 2 ** 40 + part, { level, part });
    }
  const some = whole.size ? [] : await affordable(file, [...parts.values()].filter(({ level, part }) => !tree.hasPart(level, part)), bytes);
  const [segments] = await Promise.all([file.nodeParts(some), addWhole(file, tree, [...whole])]);
  segments.forEach((segment, i) => tree.addPart(some[i].part, segment));
  return whole.size + some.length;
}

async function affordable(file, parts, bytes) {
  let n = Math.min(parts.length, 16);
  while (n < parts.length && await file.costOfParts(parts.slice(0, 2 * n)) <= bytes)
    n *= 2;
  return parts.slice(0, n);
}

/** Loads nodes for exact queries, without planes; in files with subtrees also loads the faces. `tree` is a tree without planes. */
export async function growForQuery(file, tree, nodes) {
  const { info } = tree, C = info.subtree_level, whole = [], parts = new Map(), subtrees = new Set();
  for (const node of nodes)
    if (C !== undefined && node.level >= C)
      subtrees.add(tree.partOf(node));
    else if (isSmall(info, node.level + 1))
      for (let level = node.level + 1; level <= (C ?? node.level + 1); level++)
        whole.push(level);
    else
      parts.set((node.level + 1) * 2 ** 40 + tree.partOf(node), { level: node.level + 1, part: tree.partOf(node) });
  const some = [...parts.values()];
  const [segments, found] = await Promise.all([some.length ? file.nodeParts(some, { planes: false }) : [], subtrees.size ? file.subtrees([...subtrees]) : [],
    addWhole(file, tree, [...new Set(whole)])]);
  segments.forEach((segment, i) => tree.addPart(some[i].part, segment));
  found.forEach(({ part, segment }) => tree.addPart(part, segment));
}
