// Builds the octree of nodes with children from levels as they arrive: format-spec/README.md, section 7.
import { cube, envelope } from './envelope.js';
import { Segment } from './segment.js';

/** Types of nodes. */
export const WHITE = 0, BLACK = 1, LEAF = 2, GRAY = 3;

export const BLOCK_GROUPS = 4096; // groups of a part in levels without subtrees

const PARTS_BYTES = 48 * 1024 * 1024; // limit of cached segments, in addition to those of existing nodes

/** A node. `at`: its cell's position in the grid of its level; `rank`: number among the nodes of its type in its level; `octant`: index among its siblings. */
export class Node {
  constructor(parent, octant, type, rank, segment, subtree) {
    this.parent = parent;
    this.level = parent ? parent.level + 1 : 0;
    this.octant = octant;
    this.at = parent ? [2 * parent.at[0] + (octant & 1), 2 * parent.at[1] + (octant >> 1 & 1), 2 * parent.at[2] + (octant >> 2)] : [0, 0, 0];
    this.type = type;
    this.rank = rank;
    this.segment = segment; // the segment with the node's data
    this.subtree = subtree; // number of the subtree that contains the node, in files with subtrees
    this.children = undefined;
    this.polytope = undefined;
  }
}

export class Tree {
  constructor(info) {
    this.info = info;
    this.levels = []; // completely loaded levels, as segments
    this.parts = new Map(); // segments of parts, by level and part, oldest first
    this.partBytes = 0;
    this.partDepth = -1; // deepest level with a part that was loaded at some time
    this.root = undefined;
  }

  /** Returns the deepest level with loaded nodes. */
  get depth() {
    return Math.max(this.levels.length - 1, this.partDepth);
  }

  /** Adds a whole level. */
  add(level) {
    this.levels[level.level] = new Segment(level);
    if (level.level === 0)
      this.root = new Node(undefined, 0, level.types[0] & 3, 0, this.levels[0]);
  }

  /** Adds a part of a level. */
  addPart(nodes) {
    const { part } = nodes, segment = new Segment(nodes), key = segment.level * 2 ** 40 + part;
    if (this.parts.has(key))
      return;
    this.parts.set(key, segment);
    this.partBytes += segment.byteLength;
    this.partDepth = Math.max(this.partDepth, segment.level);
    for (const [old, { byteLength }] of this.parts) {
      if (this.partBytes <= PARTS_BYTES || old === key)
        break;
      this.parts.delete(old);
      this.partBytes -= byteLength;
    }
  }

  hasPart(level, part) {
    return this.parts.has(level * 2 ** 40 + part);
  }

  /** Returns the part of the next level that contains a gray node's children. */
  partOf(node) {
    const { subtree_level: C } = this.info;
    return C === undefined || node.level < C ? Math.floor(node.rank / BLOCK_GROUPS) : node.level === C ? node.rank : node.subtree;
  }

  #segmentBelow(node) {
    const whole = this.levels[node.level + 1];
    if (whole)
      return whole;
    const key = (node.level + 1) * 2 ** 40 + this.partOf(node), part = this.parts.get(key);
    if (part) {
      this.parts.delete(key); // moves the part to the newest end
      this.parts.set(key, part);
    }
    return part;
  }

  /** Returns true when a gray node is pruned; undefined while the part of the next level for its children is not loaded. */
  isPruned(node) {
    if (node.type !== GRAY || !this.info.parts.has('pruned'))
      return false;
    if (node.level + 1 === this.info.level_count)
      return true;
    if (node.children)
      return false;
    const segment = this.#segmentBelow(node);
    return segment && segment.typesOf(node.rank) === 0;
  }

  /** Returns the eight children of a gray node; undefined while their part of the level is not loaded, and for a pruned node. */
  children(node) {
    if (node.children || node.type !== GRAY)
      return node.children;
    const segment = this.#segmentBelow(node), types = segment?.typesOf(node.rank);
    if (!segment || (types === 0 && this.info.parts.has('pruned')))
      return undefined;
    const ranks = segment.ranks(node.rank), subtree = node.level === this.info.subtree_level ? node.rank : node.subtree;
    node.children = Array.from({ length: 8 }, (_, o) => {
      const type = types >> 2 * o & 3;
      return new Node(node, o, type, ranks[type]++, segment, subtree);
    });
    return node.children;
  }

  /** Returns the node's plane codes, without those of its ancestors. */
  planes(node) {
    return node.type === GRAY ? node.segment.grayPlanes(node.rank) : node.type === LEAF ? node.segment.leafPlanesOf(node.rank) : [];
  }

  /** Returns the colour of a gray node, or of another node's parent, as red + 256 green + 65,536 blue; undefined without a colour. */
  colour(node) {
    const gray = node.type === GRAY ? node : node.parent;
    return gray?.segment.colour(gray.rank);
  }

  /**
   * Returns the envelope in cell coordinates: the cell cut by the planes of the node and of all its ancestors. A leaf without stored planes has its parent's
   * envelope, cut by its cell. The node stores the result.
   */
  polytope(node) {
    node.polytope ??= node.type === BLACK ? cube() : envelope(node.parent && this.polytope(node.parent), node.octant, this.planes(node));
    return node.polytope;
  }
}
