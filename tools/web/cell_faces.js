// Computes the visible parts of polygons on cell faces: two touching envelopes hide each other's polygons.
import { BLACK, WHITE } from './tree.js';

const ON = 1e-9;           // in cells
const THIN = 1 / 128;      // in cells: pieces with a smaller mean width are omitted
const HIDDEN = [];
const QUADRANT = (u, v) => [u, v, u + 0.5, v, u + 0.5, v + 0.5, u, v + 0.5];

const area = (p) => {
  let sum = 0;
  for (let i = 0, j = p.length - 2; i < p.length; j = i, i += 2)
    sum += p[j] * p[i + 1] - p[i] * p[j + 1];
  return sum / 2;
};

// Splits a convex polygon by the line through (x, y) with direction (dx, dy). Returns the parts left and right of the line.
function split(p, x, y, dx, dy) {
  const left = [], right = [], side = (i) => dx * (p[i + 1] - y) - dy * (p[i] - x);
  for (let i = 0; i < p.length; i += 2) {
    const j = (i + 2) % p.length, a = side(i), b = side(j);
    if (a >= -ON)
      left.push(p[i], p[i + 1]);
    if (a <= ON)
      right.push(p[i], p[i + 1]);
    if ((a > ON && b < -ON) || (a < -ON && b > ON)) {
      const t = a / (a - b), u = p[i] + t * (p[j] - p[i]), v = p[i + 1] + t * (p[j + 1] - p[i + 1]);
      left.push(u, v);
      right.push(u, v);
    }
  }
  return [left, right];
}

function isSeen(p) {
  let around = 0;
  for (let i = 0, j = p.length - 2; i < p.length; j = i, i += 2)
    around += Math.hypot(p[i] - p[j], p[i + 1] - p[j + 1]);
  return 2 * Math.abs(area(p)) > THIN * around;
}

/** Subtracts the convex polygon `q` from convex polygons [u, v, u, v ...]. Returns convex polygons. */
export function subtract(pieces, q) {
  if (area(q) < 0)
    q = q.map((_, i) => q[q.length - 2 - i + 2 * (i % 2)]); // counter-clockwise
  const out = [];
  for (let piece of pieces) {
    const outside = [];
    for (let i = 0, j = q.length - 2; i < q.length && piece; j = i, i += 2) {
      const length = Math.hypot(q[i] - q[j], q[i + 1] - q[j + 1]) || 1;
      const [left, right] = split(piece, q[j], q[j + 1], (q[i] - q[j]) / length, (q[i + 1] - q[j + 1]) / length);
      if (right.length > 4 && isSeen(right))
        outside.push(right);
      piece = left.length > 4 && Math.abs(area(left)) > ON ? left : undefined;
    }
    out.push(...outside); // the remaining piece is inside q and hidden
  }
  return out;
}

/** Returns, for each polygon, 2 axis + side of the cell face that contains the polygon, or -1. Stores the result in the polytope. */
export function sidesOf(p) {
  p.sides ??= Int8Array.from({ length: p.faces }, (_, f) => {
    for (let s = 0; p.onCellFace[f] && s < 6; s++) {
      let on = true;
      for (let i = p.first[f]; i < p.first[f + 1]; i++)
        on &&= Math.abs(p.x[3 * p.corner[i] + (s >> 1)] - (s & 1)) < ON;
      if (on)
        return s;
    }
    return -1;
  });
  return p.sides;
}

// Returns a polygon of node `of` as [u, v ...] in coordinates of the cell of `node`, on the two axes after `axis`.
function inCell(node, of, p, f, axis) {
  const scale = 2 ** (node.level - of.level), u = (axis + 1) % 3, v = (axis + 2) % 3, out = [];
  for (let i = p.first[f]; i < p.first[f + 1]; i++) {
    const x = 3 * p.corner[i];
    out.push((of.at[u] + p.x[x + u]) * scale - node.at[u], (of.at[v] + p.x[x + v]) * scale - node.at[v]);
  }
  return out;
}

export class CellFaces {
  /** `drawn(node)`: returns true when a node is in the cut; `envelope(node)`: returns its polytope, or undefined when its real faces are drawn. */
  constructor(tree, drawn, envelope) {
    Object.assign(this, { tree, drawn, envelope });
  }

  sideOf(p, f) {
    return sidesOf(p)[f];
  }

  /** Returns the visible part of polygon f of a node's polytope p, which is on a cell face: convex pieces [u, v ...], or undefined for the whole polygon. */
  seen(node, p, f) {
    const side = sidesOf(p)[f], axis = side >> 1;
    if (side < 0)
      return undefined;
    const other = this.#across(node, axis, side & 1 ? 1 : -1);
    if (!other || other.type === WHITE)
      return undefined;
    if (other.type === BLACK)
      return HIDDEN;
    const own = [inCell(node, node, p, f, axis)];
    if (this.drawn(other))
      return other.level < node.level - 1 ? undefined : this.#without(own, node, other, side ^ 1);
    return other.children ? this.#belowOf(own, node, other, side ^ 1) : undefined;
  }

  #without(pieces, node, other, side) {
    const p = this.envelope(other), sides = p && sidesOf(p);
    for (let f = 0; p && f < p.faces; f++)
      if (sides[f] === side)
        return subtract(pieces, inCell(node, other, p, f, side >> 1));
    return pieces;
  }

  // Subtracts the polygons of those four children of the neighbour that touch the common cell face.
  #belowOf(pieces, node, other, side) {
    const axis = side >> 1, u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const child of other.children)
      if ((child.octant >> axis & 1) === (side & 1)) {
        if (child.type === BLACK)
          pieces = subtract(pieces, QUADRANT((child.octant >> u & 1) / 2, (child.octant >> v & 1) / 2));
        else if (this.drawn(child))
          pieces = this.#without(pieces, node, child, side);
      }
    return pieces;
  }

  // Returns the node behind a cell face: of the same level, or a drawn or uniform ancestor of that node; undefined outside the root cell.
  #across(node, axis, step) {
    const { level } = node, to = [...node.at];
    to[axis] += step;
    if (to[axis] < 0 || to[axis] >= 2 ** level)
      return undefined;
    let n = node, up = 0;
    do { // up to a common ancestor
      n = n.parent;
      up++;
    } while (Math.floor(to[axis] / 2 ** up) !== n.at[axis]);
    for (; up > 0 && n.children && !this.drawn(n); up--) {
      const at = 2 ** (up - 1);
      n = n.children[(Math.floor(to[0] / at) & 1) | (Math.floor(to[1] / at) & 1) << 1 | (Math.floor(to[2] / at) & 1) << 2];
    }
    return n;
  }
}
