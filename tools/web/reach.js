// Computes in the worker which faces a point of paint covers (format-spec/paint.md, section 4): the faces that are connected with the point's face inside the ball.
import { normalOf } from './queries.js';

const FACES_MOST = 100_000;   // around a point; with more faces the whole ball is coloured
const OFF = 2 ** -20;         // greatest distance of a position from its face, in diagonals

// Returns the faces that intersect the box around a ball, with the numbers of paint files: { numbers, corners: [nine numbers each] }; 'elsewhere' when the file is a subset without some of them,
// 'many' when they are too many.
async function facesAround(queries, point, radius) {
  try {
    const { face, corners } = await queries.with((model) => model.boxTriangles(point.map((x) => x - radius), point.map((x) => x + radius), { most: FACES_MOST }));
    return face.length > FACES_MOST ? 'many' : { numbers: [...face], corners: Array.from(face, (_, i) => corners.subarray(9 * i, 9 * i + 9)) };
  } catch (error) {
    if (error.code !== 'ABSENT')
      throw error;
    return 'elsewhere';
  }
}

/**
 * Returns the point of a triangle (nine numbers from `at` on) that is nearest to p: [distance, x, y, z]. Computes in doubles.
 * Source: Ericson, "Real-Time Collision Detection", 5.1.5.
 */
function nearestOnTriangle(p, f, at) {
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
 * Computes the covered faces of points [{ face, place, radius, always }]: [{ here, normal, faces }]. `face` is the number that paint files use.
 *
 * `here`: 'yes'; 'no' when the named face is not at the point; 'elsewhere' when the file is a subset without the face or without faces near it.
 *
 * `faces` (nine numbers each): the covered faces, when the ball also intersects faces that are not covered. `faces` is undefined when all faces in the ball are
 * covered (unless `always` is true), when there are too many faces, and for a radius of 0.
 */
export async function reachOf(queries, points) {
  const { info } = queries, tolerance = OFF * Math.hypot(...info.box_size), subset = Boolean(info.subset_of), out = [];
  for (const { face, place, radius, always } of points) {
    let around = await facesAround(queries, place, Math.max(radius, tolerance));
    const crowded = around === 'many';
    if (crowded) // a smaller ball suffices to find the face
      around = await facesAround(queries, place, tolerance);
    const own = around.numbers?.indexOf(face) ?? -1;
    if (own < 0 || !(nearestOnTriangle(place, around.corners[own], 0)[0] <= tolerance)) {
      out.push({ here: subset && own < 0 ? 'elsewhere' : 'no' });
      continue;
    }
    const reach = crowded || !(radius > 0) ? undefined : connectedFaces(around.corners, own, place, radius);
    const inBall = reach && around.corners.filter((f) => nearestOnTriangle(place, f, 0)[0] <= radius);
    const alone = reach && (always || inBall.length > reach.filter((i) => nearestOnTriangle(place, around.corners[i], 0)[0] <= radius).length);
    out.push({ here: 'yes', normal: normalOf(around.corners[own]), faces: alone ? Float64Array.from(reach.flatMap((i) => [...around.corners[i]])) : undefined });
  }
  return out;
}
