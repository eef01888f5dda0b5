// Envelopes as convex polytopes, cut from the cell: for drawing. Their vertices are rounded; what is certain comes from the decoded half-spaces
// (query.js). The same steps in the same order as the library's (lib/geom/polytope.c), so that both draw the same polygons.
// Source: BP 2008, section 3.4.3 (clipping of the box), done here on vertex loops.

const TOLERANCE = 1e-10; // in cell units

/**
 * In cell coordinates, 0 .. 1 on each axis. `x`: three numbers a vertex; `loops`: vertex numbers of each polygon, counter-clockwise seen from
 * outside; `wall`: for each polygon whether it lies on a wall of the cell.
 * @typedef {{ x: number[], loops: number[][], wall: boolean[] }} Polytope
 */

/** The whole cell. Vertex i has bit 0 x, bit 1 y, bit 2 z. */
export function cube() {
  return {
    x: [0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1],
    loops: [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]],
    wall: [true, true, true, true, true, true],
  };
}

/** The half-space of a plane code (format-spec, section 6): { n, d }, integers; 4096 * (n . xi) <= d is kept. */
export function decodePlane(code) {
  const u = (code & 1023) - 511, v = (code >>> 10 & 1023) - 511, w = 511 - Math.abs(u) - Math.abs(v);
  const n = w >= 0 ? [u, v, w] : [(u < 0 ? -1 : 1) * (511 - Math.abs(v)), (v < 0 ? -1 : 1) * (511 - Math.abs(u)), w];
  return { n, d: 4096 * (Math.min(n[0], 0) + Math.min(n[1], 0) + Math.min(n[2], 0)) + 511 * ((code >>> 20) + 1) };
}

/** Cuts by the half-space of a plane code. */
export function clipByCode(p, code) {
  const { n, d } = decodePlane(code);
  return clip(p, n[0] * (1 / 511), n[1] * (1 / 511), n[2] * (1 / 511), d * (1 / (511 * 4096)), false) ?? p;
}

/**
 * Keeps n . x <= d. Returns p itself when nothing is cut away, and undefined when next to nothing would remain or rounding spoils the loops:
 * the caller then keeps p, which is too large, never too small.
 */
function clip(p, nx, ny, nz, d, wall) {
  const count = p.x.length / 3, dist = new Float64Array(count);
  let most = -Infinity, least = Infinity;
  for (let i = 0; i < count; i++) {
    const e = nx * p.x[3 * i] + ny * p.x[3 * i + 1] + nz * p.x[3 * i + 2] - d;
    dist[i] = e;
    most = Math.max(most, e);
    least = Math.min(least, e);
  }
  if (most <= TOLERANCE)
    return p;
  if (least >= -1e-7)
    return undefined;
  const out = { x: [], loops: [], wall: [] }, number = new Int16Array(count).fill(-1), on = [], cuts = new Map(), rim = [];
  const add = (x, y, z, isOn) => {
    out.x.push(x, y, z);
    return on.push(isOn) - 1;
  };
  for (let i = 0; i < count; i++)
    if (dist[i] <= TOLERANCE)
      number[i] = add(p.x[3 * i], p.x[3 * i + 1], p.x[3 * i + 2], dist[i] >= -TOLERANCE);
  const crossing = (i, o) => { // from inside to outside
    if (dist[i] >= -TOLERANCE)
      return number[i];
    const key = i * count + o;
    let made = cuts.get(key);
    if (made === undefined) {
      const t = dist[i] / (dist[i] - dist[o]), at = (k) => p.x[3 * i + k] + t * (p.x[3 * o + k] - p.x[3 * i + k]);
      cuts.set(key, made = add(at(0), at(1), at(2), true));
    }
    return made;
  };
  p.loops.forEach((loop, f) => {
    if (!loop.some((v) => dist[v] < -TOLERANCE))
      return;
    const kept = [];
    const corner = (v) => {
      if (kept.at(-1) !== v)
        kept.push(v);
    };
    for (let i = 0; i < loop.length; i++) {
      const a = loop[i], b = loop[i + 1 < loop.length ? i + 1 : 0], aOut = dist[a] > TOLERANCE, bOut = dist[b] > TOLERANCE;
      if (!aOut)
        corner(number[a]);
      if (aOut !== bOut)
        corner(aOut ? crossing(b, a) : crossing(a, b));
    }
    close(out, kept, p.wall[f]);
    if (kept.length >= 3)
      for (let i = 0; i < kept.length; i++) {
        const a = kept[i], b = kept[i + 1 < kept.length ? i + 1 : 0];
        if (on[a] && on[b])
          rim.push([a, b]);
      }
  });
  return closeCap(out, rim, wall) && out.loops.length >= 4 ? out : undefined;
}

function close(out, loop, wall) {
  while (loop.length > 1 && loop.at(-1) === loop[0])
    loop.pop();
  if (loop.length < 3)
    return;
  out.loops.push(loop);
  out.wall.push(wall);
}

// Rim edges used in both directions lie between two kept polygons; the others, reversed, bound the cap.
function closeCap(out, rim, wall) {
  const next = new Map();
  let begin;
  for (const [a, b] of rim) {
    if (rim.some(([c, d]) => c === b && d === a))
      continue;
    if (next.has(b))
      return false;
    next.set(b, a);
    begin = b;
  }
  if (next.size < 3)
    return false;
  const loop = [];
  let at = begin;
  do {
    loop.push(at);
    at = next.get(at);
  } while (at !== undefined && at !== begin && loop.length <= next.size);
  if (at !== begin || loop.length !== next.size)
    return false;
  close(out, loop, wall);
  return true;
}

function half(p, axis, side) {
  const scaled = { x: p.x.slice(), loops: p.loops, wall: p.wall };
  for (let i = axis; i < scaled.x.length; i += 3)
    scaled.x[i] = 2 * scaled.x[i] - side;
  const sign = side ? -1 : 1;
  return clip(scaled, axis === 0 ? sign : 0, axis === 1 ? sign : 0, axis === 2 ? sign : 0, side ? 0 : 1, true) ?? cube();
}

/** The part in a child's cell, in the child's coordinates; the whole cell when (numerically) nothing lies in it. */
export function childPart(p, octant) {
  return half(half(half(p, 2, octant >> 2 & 1), 1, octant >> 1 & 1), 0, octant & 1);
}

/** Volume in cells. */
export function volume(p) {
  const { x } = p;
  let sum = 0;
  for (const loop of p.loops)
    for (let i = 1; i + 1 < loop.length; i++) {
      const [a, b, c] = [3 * loop[0], 3 * loop[i], 3 * loop[i + 1]];
      const bx = x[b] - x[0], by = x[b + 1] - x[1], bz = x[b + 2] - x[2], cx = x[c] - x[0], cy = x[c + 1] - x[1], cz = x[c + 2] - x[2];
      sum += (x[a] - x[0]) * (by * cz - bz * cy) + (x[a + 1] - x[1]) * (bz * cx - bx * cz) + (x[a + 2] - x[2]) * (bx * cy - by * cx);
    }
  return sum / 6;
}
