// Reads the nodes below some nodes of a tree in one batch: whole levels when a large share of a level is needed, otherwise parts of levels.
import { BLOCK_GROUPS } from './tree.js';

const BATCH_BYTES = 256 * 1024;                // limit of a batch of parts; pictures are drawn between batches
const WHOLE_SHARE = 0.3;                       // a level is read completely when a greater share of its parts is needed
const WHOLE_BYTES_MOST = 64 * 1024 * 1024;     // approximate limit of completely read levels, decoded

const bySubtree = (info, level) => info.subtree_level !== undefined && level > info.subtree_level;

/** Returns true for levels that are always read whole: the levels above subtrees, or small levels in other files. */
export function isSmall(info, level) {
  return info.subtree_level === undefined ? level === 0 || info.levels[level - 1].gray <= BLOCK_GROUPS : level <= info.subtree_level;
}

function fits(tree, level) {
  const bytes = (s) => s.gray * (tree.info.parts.has('colours') ? 10 : 6) + s.planes * 4 + s.leaf * 6 + s.leaf_planes * 4;
  return [...tree.levels.filter(Boolean).map((_, l) => tree.info.levels[l]), tree.info.levels[level]].reduce((sum, s) => sum + bytes(s), 0) < WHOLE_BYTES_MOST;
}

/** Reads whole levels into the tree. */
export async function addLevels(file, tree, levels) {
  for (const nodes of await file.nodes(levels.filter((level) => !tree.levels[level]).map((level) => ({ level, part: -1 }))))
    tree.add(nodes);
}

/**
 * Reads nodes for drawing. wants: [{ node, levels }], most important first: nodes whose children are not in the tree, and the number of levels to read below
 * them. `bytes`: approximate limit of fetched bytes.
 */
export async function growForView(file, tree, wants, { bytes = BATCH_BYTES } = {}) {
  const { info } = tree, whole = new Set(), parts = new Map(), count = [];
  const below = ({ node, levels }) => Array.from({ length: Math.min(levels, info.level_count - 1 - node.level) }, (_, i) => node.level + 1 + i)
    .filter((l) => !tree.levels[l] && (l === node.level + 1 || isSmall(info, l) || (bySubtree(info, l) && node.level >= info.subtree_level)));
  for (const want of wants)
    for (const level of below(want))
      (count[level] ??= new Set()).add(tree.partOf(want.node));
  count.forEach((numbers, level) => {
    const all = bySubtree(info, level) ? info.levels[info.subtree_level].gray : Math.ceil(info.levels[level - 1].gray / BLOCK_GROUPS);
    if (isSmall(info, level) || (numbers.size > WHOLE_SHARE * all && fits(tree, level)))
      whole.add(level);
  });
  if (whole.size) {
    await addLevels(file, tree, [...whole].sort((a, b) => a - b));
    return;
  }
  for (const want of wants) // the levels of a subtree stay together
    for (const level of below(want)) {
      const part = tree.partOf(want.node), levels = parts.get(part) ?? new Set();
      parts.set(part, levels);
      if (!tree.hasPart(level, part))
        levels.add(level);
    }
  const wanted = [...parts].flatMap(([part, levels]) => [...levels].sort((a, b) => a - b).map((level) => ({ level, part })));
  for (const nodes of await file.nodes(wanted, { bytes }))
    tree.addPart(nodes);
}
