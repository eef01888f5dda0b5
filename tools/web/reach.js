// Computes in the worker which faces a point of paint covers (format-spec/paint.md, section 4): the faces that are connected with the point's face inside the ball.
import { GRAY, LEAF, cellNear, growForQuery, nearestOnTriangle } from './reader/index.js';

const FACES_MOST = 100_000;   // around a point; with more faces the whole ball is coloured
const LEAVES_MOST = 20_000, LEAVES_AT_ONCE = 1024; // a ball may be as large as the model; the limit avoids fetching the whole model
const OFF = 2 ** -20;         // greatest distance of a position from its face, in diagonals

// Returns the leaves whose cells are within a distance of a point; 'elsewhere' when the file is a subset without some of them, 'many' when they are too many.
async function leavesAround(file, tree, point, distance) {
  const leaves = [], meets = (node) => (node.type === GRAY || node.type === LEAF) && cellNear(tree, node, point) <= distance;
  for (let nodes = [tree.root].filter(meets); nodes.length;) {
    leaves.push(...nodes.filter((node) => node.type === LEAF));
    if (Math.max(leaves.length, nodes.length) > LEAVES_MOST)
      return 'many';
    const gray = nodes.filter((node) => node.type === GRAY), missing = gray.filter((node) => !tree.children(node));
    if (missing.some((node) => tree.isPruned(node)))
      return 'elsewhere';
    if (missing.length)
      await growForQuery(file, tree, missing);
    if (gray.some((node) => !tree.children(node)))
      return 'elsewhere';
    nodes = gray.flatMap((node) => tree.children(node)).filter(meets);
  }
  return leaves;
}

// Returns all faces that may intersect a ball, each once: { numbers, corners: [nine numbers each] }; or 'elsewhere' or 'many', as leavesAround() does.
async function facesAround(file, tree, point, radius) {
  const corners = new Map(), leaves = await leavesAround(file, tree, point, radius);
  if (!Array.isArray(leaves))
    return leaves;
  for (let i = 0; i < leaves.length; i += LEAVES_AT_ONCE)
    for (const faces of await file.leafFaces(leaves.slice(i, i + LEAVES_AT_ONCE))) {
      faces.numbers.forEach((number, k) => {
        const nine = faces.subarray(9 * k, 9 * k + 9);
        if (!corners.has(number) && boxMeets(nine, point, radius))
          corners.set(number, nine);
      });
      if (corners.size > FACES_MOST)
        return 'many';
    }
  return { numbers: [...corners.keys()], corners: [...corners.values()] };
}

function boxMeets(f, point, radius) {
  for (let k = 0; k < 3; k++)
    if (Math.min(f[k], f[k + 3], f[k + 6]) > point[k] + radius || Math.max(f[k], f[k + 3], f[k + 6]) < point[k] - radius)
      return false;
  return true;
}

const holds = (centre, square, q) => {
  const [x, y, z] = [q[0] - centre[0], q[1] - centre[1], q[2] - centre[2]];
  return (x * x + y * y) + z * z <= square;
};

function segmentWithin(centre, square, p, q) {
  const differs = [0, 1, 2].find((k) => p[k] !== q[k]), [a, b] = differs === undefined || p[differs] < q[differs] ? [p, q] : [q, p];
  const e = [0, 1, 2].map((k) => b[k] - a[k]), d = [0, 1, 2].map((k) => centre[k] - a[k]), length = (e[0] * e[0] + e[1] * e[1]) + e[2] * e[2];
  const t = length === 0 ? 0 : Math.max(0, Math.min(1, ((d[0] * e[0] + d[1] * e[1]) + d[2] * e[2]) / length));
  return holds(centre, square, [0, 1, 2].map((k) => a[k] + t * e[k]));
}

/** Returns the indices of the faces that are connected with the face `own` inside a ball, ascending. `faces`: nine numbers each. */
export function connectedFaces(faces, own, centre, radius) {
  const square = radius * radius, places = new Map(), root = faces.map((_, i) => i), edges = new Map();
  const setOf = (i) => {
    while (root[i] !== i)
      i = root[i] = root[root[i]];
    return i;
  };
  const join = (table, key, i) => (table.has(key) ? (root[setOf(i)] = setOf(table.get(key))) : table.set(key, i));
  faces.forEach((f, i) => {
    const p = [0, 3, 6].map((c) => f.subarray(c, c + 3)), within = p.map((q) => holds(centre, square, q)), keys = p.map((q) => `${q[0] + 0},${q[1] + 0},${q[2] + 0}`); // -0 is 0
    for (let c = 0; c < 3; c++) {
      const next = (c + 1) % 3;
      if (within[c])
        join(places, keys[c], i);
      if (!within[c] && !within[next] && segmentWithin(centre, square, p[c], p[next])) // an edge with an end inside the ball is joined at this end
        join(edges, [keys[c], keys[next]].sort().join(' '), i);
    }
  });
  const set = setOf(own);
  return faces.map((_, i) => i).filter((i) => setOf(i) === set);
}

/**
 * Computes the covered faces of points [{ face, place, radius }]: [{ here, normal, faces }]. `face` is the number that paint files use.
 *
 * `here`: 'yes'; 'no' when the named face is not at the point; 'elsewhere' when the file is a subset without the face or without faces near it.
 *
 * `faces` (nine numbers each): the covered faces, when the ball also intersects faces that are not covered. `faces` is undefined when all faces in the ball are
 * covered, when there are too many faces, and for a radius of 0.
 */
export async function reachOf(file, tree, points) {
  const { info } = file, tolerance = OFF * Math.hypot(...info.box_size), subset = Boolean(info.subset_of), bySource = info.parts.has('maps'), out = [];
  for (const { face, place, radius } of points) {
    let around = await facesAround(file, tree, place, Math.max(radius, tolerance));
    const crowded = around === 'many';
    if (crowded) // a smaller ball suffices to find the face
      around = await facesAround(file, tree, place, tolerance);
    const names = !around.numbers?.length ? [] : bySource ? await file.sourceFaces(Uint32Array.from(around.numbers)) : around.numbers, own = names.indexOf(face);
    if (own < 0 || !(nearestOnTriangle(place, around.corners[own], 0)[0] <= tolerance)) {
      out.push({ here: subset && own < 0 ? 'elsewhere' : 'no' });
      continue;
    }
    const reach = crowded || !(radius > 0) ? undefined : connectedFaces(around.corners, own, place, radius);
    const inBall = reach && around.corners.filter((f) => nearestOnTriangle(place, f, 0)[0] <= radius);
    const alone = reach && inBall.length > reach.filter((i) => nearestOnTriangle(place, around.corners[i], 0)[0] <= radius).length;
    out.push({ here: 'yes', normal: normalOf(around.corners[own]), faces: alone ? Float64Array.from(reach.flatMap((i) => [...around.corners[i]])) : undefined });
  }
  return out;
}

function normalOf(f) {
  const u = [0, 1, 2].map((k) => f[3 + k] - f[k]), v = [0, 1, 2].map((k) => f[6 + k] - f[k]), n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const size = Math.hypot(...n);
  return n.map((x) => (size > 0 ? x / size : 0));
}
