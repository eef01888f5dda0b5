// Evaluates longer queries of the page in the worker: positions on faces for painting and measuring, and sections of the real faces.
import { GRAY, LEAF, growForQuery, nearestFace } from './reader/index.js';

const ONE_WEIGHT = 2 ** 30;     // format-spec/paint.md
const LEAVES_AT_ONCE = 1024, NODES_AT_ONCE = 256;
const FACES_MOST = 4_000_000;   // in a section

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]], dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Returns the barycentric weights of a triangle's second and third corner at a point of the triangle, in units of 2^-30. `corners`: nine numbers. */
export function weightsOf(p, corners) {
  const a = corners.subarray(0, 3), u = sub(corners.subarray(3, 6), a), v = sub(corners.subarray(6, 9), a), w = sub(p, a);
  const uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v), area = uu * vv - uv * uv;
  if (!(area > 0)) // the triangle is a segment or a point: weights along its longer side
    return uu >= vv ? [unit(uu > 0 ? wu / uu : 0), 0] : [0, unit(wv / vv)];
  const second = unit((vv * wu - uv * wv) / area);
  return [second, Math.min(ONE_WEIGHT - second, unit((uu * wv - uv * wu) / area))];
}
const unit = (x) => Math.round(Math.min(1, Math.max(0, x)) * ONE_WEIGHT);

/**
 * Returns the nearest positions on the faces: [{ face, weights, place, normal, distance }]. `face` is the number that paint files use. Computes in double
 * precision. The file must have the part `mesh`.
 */
export async function positionsOf(file, tree, points) {
  const found = [];
  for (const p of points)
    found.push(await nearestFace(tree, p, (leaves) => file.leafFaces(leaves), (nodes) => growForQuery(file, tree, nodes)));
  const own = found.map((f) => f.face), numbers = file.info.parts.has('maps') ? await file.sourceFaces(own) : own;
  return found.map(({ point, corners, distance }, i) => {
    const n = cross(sub(corners.subarray(3, 6), corners.subarray(0, 3)), sub(corners.subarray(6, 9), corners.subarray(0, 3))), size = Math.hypot(...n);
    return { face: numbers[i], weights: weightsOf(point, corners), place: point, normal: n.map((x) => (size > 0 ? x / size : 0)), distance };
  });
}

/**
 * Cuts faces (nine numbers each) by a plane across an axis. Adds segments [u, v, u, v] to `out`, where u and v are coordinates on the two axes after `axis`.
 * Seen from the axis' upper end, the interior of a closed mesh is on the left of each segment. Corners on the plane count as above the plane, so that
 * outlines are closed.
 */
export function cutFaces(faces, axis, at, out) {
  const u = (axis + 1) % 3, v = (axis + 2) % 3, crossing = (low, high) => { // from below to above, so that both faces of an edge compute the same point
    const t = (at - faces[low + axis]) / (faces[high + axis] - faces[low + axis]);
    return [faces[low + u] + t * (faces[high + u] - faces[low + u]), faces[low + v] + t * (faces[high + v] - faces[low + v])];
  };
  for (let f = 0; f < faces.length; f += 9) {
    const above = [0, 3, 6].map((c) => faces[f + c + axis] >= at);
    if (above[0] === above[1] && above[1] === above[2])
      continue;
    let up, down;
    for (let c = 0; c < 3; c++) {
      const next = (c + 1) % 3;
      if (!above[c] && above[next])
        up = crossing(f + 3 * c, f + 3 * next);
      else if (above[c] && !above[next])
        down = crossing(f + 3 * next, f + 3 * c);
    }
    out.push(...down, ...up);
  }
}

/** Returns { area, length } of segments from cutFaces(). The area is the integral of the winding number. */
export function measureOf(segments) {
  const [u, v] = segments; // an origin near the segments reduces rounding errors
  let area = 0, length = 0;
  for (let i = 0; i < segments.length; i += 4) {
    const [a, b, c, d] = [segments[i] - u, segments[i + 1] - v, segments[i + 2] - u, segments[i + 3] - v];
    area += (a * d - b * c) / 2;
    length += Math.hypot(c - a, d - b);
  }
  return { area, length };
}

/**
 * Computes the section of the real faces by a plane across an axis, in the model's coordinates. Calls `emit` repeatedly with the progress { looked, of }, and at
 * the end with { segments, area, length, faces, partial } or { fault }. `area` is present only for solids. `partial`: the file is a subset and lacks part of
 * the section.
 */
export async function sectionOf(file, tree, axis, at, emit, ended) {
  const { info } = file;
  if (!info.parts.has('mesh')) {
    emit({ fault: 'the file has no faces; convert it with its mesh' });
    return;
  }
  const leaves = [];
  let partial = false;
  for (let nodes = [tree.root]; nodes.length && !ended();) {
    const here = nodes.filter((node) => (node.type === GRAY || node.type === LEAF) && tree.cellFace(node, axis, 0) <= at && tree.cellFace(node, axis, 1) >= at);
    leaves.push(...here.filter((node) => node.type === LEAF));
    const gray = here.filter((node) => node.type === GRAY && !tree.isPruned(node)), missing = gray.filter((node) => !tree.children(node));
    partial ||= gray.length < here.filter((node) => node.type === GRAY).length;
    for (let i = 0; i < missing.length && !ended(); i += NODES_AT_ONCE) { // children are created at once, because the cache may drop these chunks when the next ones arrive
      await growForQuery(file, tree, missing.slice(i, i + NODES_AT_ONCE));
      missing.slice(i, i + NODES_AT_ONCE).forEach((node) => tree.children(node));
    }
    partial ||= gray.some((node) => !tree.children(node) && tree.isPruned(node));
    nodes = gray.flatMap((node) => tree.children(node) ?? (tree.isPruned(node) ? [] : [node]));
  }
  const seen = new Set(), segments = [];
  for (let i = 0; i < leaves.length && !ended(); i += LEAVES_AT_ONCE) {
    for (const faces of await file.leafFaces(leaves.slice(i, i + LEAVES_AT_ONCE))) {
      const fresh = faces.numbers.reduce((list, number, k) => (seen.has(number) ? list : (seen.add(number), list.push(k), list)), []);
      cutFaces(fresh.length === faces.numbers.length ? faces : Float64Array.from(fresh.flatMap((k) => [...faces.subarray(9 * k, 9 * k + 9)])), axis, at, segments);
    }
    if (seen.size > FACES_MOST) {
      emit({ fault: `the section intersects more than ${FACES_MOST / 1e6} million faces; cut a part of the model out with ebpo subset` });
      return;
    }
    emit({ looked: Math.min(leaves.length, i + LEAVES_AT_ONCE), of: leaves.length });
  }
  if (!ended()) {
    const { area, length } = segments.length ? measureOf(segments) : { area: 0, length: 0 };
    emit({ segments: Float64Array.from(segments), area: info.solid ? area : undefined, length, faces: segments.length / 4, partial });
  }
}
