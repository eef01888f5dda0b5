// Queries of points. Bounds are widened by more than the rounding error, and exact predicates decide between inside and outside.
// Distances to faces are computed in doubles.
import { BLACK, GRAY, LEAF, WHITE, isInside } from './decode.js';
import { decodePlane } from './envelope.js';
import { EbpoError } from './error.js';
import { axisCrossing, onTriangle } from './predicates.js';

const MORE = 1 + 1e-12, LESS = 1 - 1e-12; // factors for lengths: the rounding error is about 1e-15
const TOGETHER = 8, TOGETHER_MOST = 64;   // initial and greatest number of leaves whose faces are requested together
const NEAR = 1 / 256;                     // a gray node or leaf has surface within its cell enlarged by this share: format-spec, section 7

/** Returns true when p is certainly outside one of the node's own half-spaces. Computes in doubles with a margin: values are up to 2^22, errors below 1e-8. */
function beyondPlanes(tree, node, p) {
  const codes = tree.planes(node);
  if (!codes.length)
    return false;
  const xi = [0, 1, 2].map((k) => (p[k] - tree.cellFace(node, k, 0)) / tree.size(node, k));
  for (const code of codes) {
    const { n, d } = decodePlane(code);
    if (4096 * (n[0] * xi[0] + n[1] * xi[1] + n[2] * xi[2]) > d + 1e-6)
      return true;
  }
  return false;
}

function inRoot(tree, p) {
  return [0, 1, 2].every((k) => p[k] >= tree.cellFace(tree.root, k, 0) && p[k] <= tree.cellFace(tree.root, k, 1));
}

/**
 * Classifies a point by the loaded levels, down to `deepest`: { where: 'in' | 'out' | 'maybe', node, winding }. 'in' and 'out' are certain. `node`
 * is the leaf or gray node at which the descent ended. For a leaf, insideLeaf() decides the result. For solids only.
 */
export function inside(tree, p, deepest = tree.depth) {
  const rule = tree.info.winding_rule;
  if (!inRoot(tree, p))
    return { where: 'out', winding: 0 };
  for (let node = tree.root; ;) {
    if (node.type === WHITE || node.type === BLACK) {
      const winding = tree.winding(node);
      return { where: isInside(rule, winding) ? 'in' : 'out', winding, node };
    }
    if (beyondPlanes(tree, node, p))
      return { where: 'out', node };
    const children = node.level < deepest ? tree.children(node) : undefined;
    if (!children)
      return { where: 'maybe', node };
    node = children[[0, 1, 2].reduce((o, k) => o | (p[k] >= tree.cellFace(node, k, 0) + tree.size(node, k) / 2) << k, 0)];
  }
}

/**
 * Classifies a point in a leaf's cell by the leaf's faces (nine numbers each): { where: 'in' | 'out' | 'on', winding }. Exact: sums signed crossings along the path
 * from the cell's lowest corner; the file stores the winding number of that corner.
 */
export function insideLeaf(tree, leaf, p, faces) {
  const corner = (i, k) => faces.subarray(9 * i + 3 * k, 9 * i + 3 * k + 3);
  const at = [0, 1, 2].map((k) => tree.cellFace(leaf, k, 0));
  let winding = tree.winding(leaf);
  for (let i = 0; i < faces.length / 9; i++)
    if (onTriangle(p, corner(i, 0), corner(i, 1), corner(i, 2)))
      return { where: 'on' };
  for (let axis = 0; axis < 3; axis++) {
    for (let i = 0; i < faces.length / 9; i++)
      winding += axisCrossing(at, p[axis], axis, corner(i, 0), corner(i, 1), corner(i, 2));
    at[axis] = p[axis];
  }
  return { where: isInside(tree.info.winding_rule, winding) ? 'in' : 'out', winding };
}

/** Returns a lower bound of the distance from p to the node's cell. */
export function cellNear(tree, node, p) {
  let sum = 0;
  for (let k = 0; k < 3; k++) {
    const d = Math.max(tree.cellFace(node, k, 0) - p[k], p[k] - tree.cellFace(node, k, 1), 0);
    sum += d * d;
  }
  return Math.sqrt(sum) * LESS;
}

// Returns an upper bound of the distance from p to the surface inside the node.
function cellFar(tree, node, p) {
  let sum = 0, size = 0;
  for (let k = 0; k < 3; k++) {
    const d = Math.max(Math.abs(p[k] - tree.cellFace(node, k, 0)), Math.abs(p[k] - tree.cellFace(node, k, 1)));
    sum += d * d;
    size += tree.size(node, k) ** 2;
  }
  return (Math.sqrt(sum) + NEAR * Math.sqrt(size)) * MORE;
}

/** Returns { lo, hi }: guaranteed bounds of the distance to the surface, from the cells of the loaded levels, down to `deepest`. */
export function distanceInterval(tree, p, deepest = tree.depth) {
  let lo = Infinity, hi = Infinity;
  const walk = (node, near) => {
    if (near > hi || node.type === WHITE || node.type === BLACK)
      return;
    hi = Math.min(hi, cellFar(tree, node, p));
    const children = node.level < deepest ? tree.children(node) : undefined;
    if (!children) {
      lo = Math.min(lo, near);
      return;
    }
    children.map((child) => [child, cellNear(tree, child, p)]).sort((a, b) => a[1] - b[1]).forEach(([child, d]) => walk(child, d));
  };
  walk(tree.root, cellNear(tree, tree.root, p));
  return { lo: Math.min(lo, hi), hi };
}

/**
 * Returns the point of a triangle (nine numbers from `at` on) that is nearest to p: [distance, x, y, z]. Computes in doubles.
 * Source: Ericson, "Real-Time Collision Detection", 5.1.5.
 */
export function nearestOnTriangle(p, f, at) {
  const sub = (i, j) => [f[at + i] - f[at + j], f[at + i + 1] - f[at + j + 1], f[at + i + 2] - f[at + j + 2]];
  const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const from = (i) => [p[0] - f[at + i], p[1] - f[at + i + 1], p[2] - f[at + i + 2]];
  const result = (i, u, s, v, t) => {
    const q = [0, 1, 2].map((k) => f[at + i + k] + s * u[k] + (v ? t * v[k] : 0));
    return [Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]), ...q];
  };
  const ab = sub(3, 0), ac = sub(6, 0), ap = from(0), d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0)
    return result(0, ab, 0);
  const bp = from(3), d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3)
    return result(3, ab, 0);
  const vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0)
    return result(0, ab, d1 - d3 > 0 ? d1 / (d1 - d3) : 0);
  const cp = from(6), d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6)
    return result(6, ac, 0);
  const vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0)
    return result(0, ac, d2 - d6 > 0 ? d2 / (d2 - d6) : 0);
  const va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return result(3, sub(6, 3), (d4 - d3) / (d4 - d3 + (d5 - d6)));
  const sum = va + vb + vc;
  if (!(sum > 0)) // almost no area: use the nearest edge
    return [0, 3, 6].map((i) => result(i, ab, 0)).reduce((a, b) => (b[0] < a[0] ? b : a));
  return result(0, ab, vb / sum, ac, vc / sum);
}

/**
 * Finds the nearest face. Returns { distance, point, face (its index), corners (nine coordinates), leaves (number of visited leaves) }. `facesOf(leaves)` returns
 * the faces of each leaf, or a promise of them. `deeper(nodes)` loads the children of these nodes together. Cells are searched nearest first, so that few
 * leaves are visited.
 */
export async function nearestFace(tree, p, facesOf, deeper) {
  let best = [Infinity], face, bound = Infinity, visited = 0, together = TOGETHER, ahead = 1;
  const queue = [];
  const add = (node) => {
    queue.push([cellNear(tree, node, p), node]);
    bound = Math.min(bound, cellFar(tree, node, p));
  };
  const wanted = (near) => near <= best[0] && near <= bound;
  const missing = (node) => node.type === GRAY && !tree.children(node) && !tree.isPruned(node);
  add(tree.root);
  while (queue.length) {
    queue.sort((a, b) => b[0] - a[0]); // the queue is short, so that a heap would not be faster
    const [near, node] = queue.at(-1), leaves = [];
    if (!wanted(near))
      break;
    while (queue.at(-1)?.[1].type === LEAF && wanted(queue.at(-1)[0]) && leaves.length < together)
      leaves.push(queue.pop()[1]);
    if (!leaves.length) {
      if (missing(node)) { // also loads nodes that are probably needed next, and doubles their number each time
        const next = queue.filter(([d, n]) => wanted(d) && missing(n)).reverse(), close = near + tree.size(node, 0) / 16;
        await deeper(next.filter(([d], i) => i < ahead || d <= close).map(([, n]) => n));
        ahead *= 2;
      }
      const children = tree.children(node);
      if (!children)
        throw new EbpoError('ABSENT', 'the file is a subset: the nearest face may be among the omitted faces; use a larger subset of the original file');
      queue.splice(queue.findLastIndex((entry) => entry[1] === node), 1);
      for (const child of children)
        if (child.type === GRAY || child.type === LEAF)
          add(child);
      continue;
    }
    visited += leaves.length;
    together = Math.min(2 * together, TOGETHER_MOST);
    for (const faces of await facesOf(leaves))
      for (let at = 0; at < faces.length; at += 9) {
        const found = nearestOnTriangle(p, faces, at);
        if (found[0] < best[0]) {
          best = found;
          face = { number: faces.numbers?.[at / 9], corners: faces.subarray(at, at + 9) };
        }
      }
  }
  return { distance: best[0], point: best.slice(1), face: face?.number, corners: face?.corners, leaves: visited };
}
