// The octree as nodes with children, from levels as they arrive: format-spec/README.md, section 5.
import { BLACK, GRAY, LEAF, WHITE } from './decode.js';
import { cube, envelope } from './envelope.js';

/** One node. `at`: its cell's place in its level; `rank`: among the nodes of its type in its level; `octant`: among its siblings. */
export class Node {
  constructor(parent, octant, type, rank) {
    this.parent = parent;
    this.level = parent ? parent.level + 1 : 0;
    this.octant = octant;
    this.at = parent ? parent.at.map((n, k) => 2 * n + (octant >> k & 1)) : [0, 0, 0];
    this.type = type;
    this.rank = rank;
    this.children = undefined;
    this.polytope = undefined;
  }
}

export class Tree {
  constructor(info) {
    this.info = info;
    this.levels = []; // as file.levels() gives them, with `before` and `planeBegin` added
    this.root = undefined;
  }

  /** Levels come in order. */
  add(level) {
    const before = [WHITE, BLACK, LEAF, GRAY].map(() => new Uint32Array(level.groups)), count = [0, 0, 0, 0], octants = level.level ? 8 : 1;
    for (let g = 0; g < level.groups; g++) {
      const types = level.types[g];
      for (let t = 0; t < 4; t++)
        before[t][g] = count[t];
      for (let o = 0; o < octants; o++)
        count[types >> 2 * o & 3]++;
    }
    const begins = (counts) => {
      const begin = new Uint32Array((counts?.length ?? 0) + 1);
      counts?.forEach((n, i) => (begin[i + 1] = begin[i] + n));
      return begin;
    };
    this.levels.push({ ...level, before, planeBegin: begins(level.planeCounts), leafPlaneBegin: begins(level.leafPlaneCounts) });
    this.root ??= new Node(undefined, 0, level.types[0] & 3, 0);
  }

  /** Deepest level at hand. */
  get depth() {
    return this.levels.length - 1;
  }

  /** Whether a gray node has no children in the file, as in a subset; undefined while that is not known, the next level not being at hand. */
  isPruned(node) {
    if (node.type !== GRAY || !this.info.parts.has('pruned'))
      return false;
    if (node.level + 1 === this.info.level_count)
      return true;
    const level = this.levels[node.level + 1];
    return level && level.types[node.rank] === 0;
  }

  /** The eight children of a gray node; undefined while their level is not at hand, and for a pruned node. */
  children(node) {
    const level = this.levels[node.level + 1];
    if (!level || node.type !== GRAY || this.isPruned(node))
      return undefined;
    if (!node.children) {
      const rank = level.before.map((b) => b[node.rank]), types = level.types[node.rank];
      node.children = Array.from({ length: 8 }, (_, o) => {
        const type = types >> 2 * o & 3;
        return new Node(node, o, type, rank[type]++);
      });
    }
    return node.children;
  }

  /** The node's own plane codes. */
  planes(node) {
    const level = this.levels[node.level], i = node.rank;
    if (node.type === GRAY && level.planes)
      return level.planes.subarray(level.planeBegin[i], level.planeBegin[i + 1]);
    if (node.type === LEAF && level.leafPlanes)
      return level.leafPlanes.subarray(level.leafPlaneBegin[i], level.leafPlaneBegin[i + 1]);
    return [];
  }

  winding(node) {
    const level = this.levels[node.level];
    if (node.type === WHITE)
      return level.whiteWinding?.[node.rank] ?? 0;
    if (node.type === BLACK)
      return level.blackWinding?.[node.rank] ?? 1;
    return node.type === LEAF ? level.leafWinding?.[node.rank] ?? 0 : 0;
  }

  /**
   * The envelope, in cell coordinates: the cell cut by the node's planes and by those of all its ancestors. So a leaf without stored planes has
   * its parent's envelope in its own cell. Kept with the node.
   */
  polytope(node) {
    node.polytope ??= node.type === BLACK ? cube() : envelope(node.parent && this.polytope(node.parent), node.octant, this.planes(node));
    return node.polytope;
  }

  /** A wall of the node's cell: side 0 or 1. Exact. */
  wall(node, axis, side) {
    const { box_origin: origin, box_size: size } = this.info;
    return origin[axis] + (node.at[axis] + side) * (size[axis] / 2 ** node.level);
  }

  size(node, axis) {
    return this.info.box_size[axis] / 2 ** node.level;
  }
}
