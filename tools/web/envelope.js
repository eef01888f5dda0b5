// Computes envelopes as convex polytopes for drawing by clipping the cell. The vertices are rounded; exact queries use the decoded half-spaces
// (query.js). The steps and their order are those of lib/geometry/polytope.c, so that both draw the same polygons.
// Source: BP 2008, section 3.4.3 (clipping of the box); this code clips vertex loops.

const TOLERANCE = 1e-10; // in cell units
const VERTICES = 192, FACES = 96, CORNERS = 576;

/**
 * A polytope in cell coordinates, 0 to 1 on each axis. `x`: three numbers for each vertex. Polygon f has the vertices corner[first[f]] to
 * corner[first[f + 1] - 1], counter-clockwise as seen from outside. onCellFace[f] is 1 when polygon f is on a cell face.
 * @typedef {{ vertices: number, faces: number, x: Float64Array, first: Uint16Array, corner: Uint8Array, onCellFace: Uint8Array }} Polytope
 */
const room = () => ({ vertices: 0, faces: 0, x: new Float64Array(3 * VERTICES), first: new Uint16Array(FACES + 1), corner: new Uint8Array(CORNERS), onCellFace: new Uint8Array(FACES) });

function copy(to, from) {
  to.vertices = from.vertices;
  to.faces = from.faces;
  to.x.set(from.x.subarray(0, 3 * from.vertices));
  to.first.set(from.first.subarray(0, from.faces + 1));
  to.corner.set(from.corner.subarray(0, from.first[from.faces]));
  to.onCellFace.set(from.onCellFace.subarray(0, from.faces));
}

/** The whole cell. In the index of a vertex, bit 0 is x, bit 1 is y, bit 2 is z. */
const CUBE = {
  vertices: 8, faces: 6,
  x: Float64Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1),
  first: Uint16Array.of(0, 4, 8, 12, 16, 20, 24),
  corner: Uint8Array.of(0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4, 2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6),
  onCellFace: new Uint8Array(6).fill(1),
};
export const cube = () => CUBE;

/** Returns the half-space 4096 * (n . xi) <= d of a plane code (format-spec, section 8) as integers { n, d }. */
export function decodePlane(code) {
  const u = (code & 1023) - 511, v = (code >>> 10 & 1023) - 511, w = 511 - Math.abs(u) - Math.abs(v);
  const n = w >= 0 ? [u, v, w] : [(u < 0 ? -1 : 1) * (511 - Math.abs(v)), (v < 0 ? -1 : 1) * (511 - Math.abs(u)), w];
  return { n, d: 4096 * (Math.min(n[0], 0) + Math.min(n[1], 0) + Math.min(n[2], 0)) + 511 * ((code >>> 20) + 1) };
}

// Working memory for one polytope: `at` is the current polytope, `spare` receives the next one.
let at = room(), spare = room();
const dist = new Float64Array(VERTICES), number = new Uint8Array(VERTICES), on = new Uint8Array(VERTICES), next = new Int16Array(VERTICES);
const edgeIn = new Uint8Array(FACES), edgeOut = new Uint8Array(FACES), edgeNumber = new Uint8Array(FACES);
const rimFrom = new Uint8Array(CORNERS), rimTo = new Uint8Array(CORNERS);
let edges, rims, corners, full;

function addVertex(x, y, z, isOn) {
  if (spare.vertices === VERTICES) {
    full = true;
    return 0;
  }
  const i = spare.vertices++;
  spare.x[3 * i] = x;
  spare.x[3 * i + 1] = y;
  spare.x[3 * i + 2] = z;
  on[i] = isOn;
  return i;
}

// Returns the new vertex on an edge that leaves the half-space.
function crossing(i, o) {
  if (dist[i] >= -TOLERANCE)
    return number[i]; // the inner end of the edge is on the plane
  for (let e = 0; e < edges; e++)
    if (edgeIn[e] === i && edgeOut[e] === o)
      return edgeNumber[e];
  if (edges === FACES) {
    full = true;
    return 0;
  }
  const t = dist[i] / (dist[i] - dist[o]), x = at.x, a = 3 * i, b = 3 * o;
  edgeIn[edges] = i;
  edgeOut[edges] = o;
  return edgeNumber[edges++] = addVertex(x[a] + t * (x[b] - x[a]), x[a + 1] + t * (x[b + 1] - x[a + 1]), x[a + 2] + t * (x[b + 2] - x[a + 2]), 1);
}

function addCorner(start, v) {
  if (corners > start && spare.corner[corners - 1] === v)
    return;
  if (corners === CORNERS)
    full = true;
  else
    spare.corner[corners++] = v;
}

function closeFace(start, onCellFace) {
  while (corners > start + 1 && spare.corner[corners - 1] === spare.corner[start])
    corners--;
  if (corners - start < 3 || spare.faces === FACES) {
    full ||= spare.faces === FACES;
    corners = start;
    return;
  }
  spare.onCellFace[spare.faces] = onCellFace;
  spare.first[spare.faces++] = start;
  spare.first[spare.faces] = corners;
}

function clipFace(f) {
  const from = at.first[f], to = at.first[f + 1], start = corners;
  let inside = false;
  for (let i = from; i < to; i++)
    inside ||= dist[at.corner[i]] < -TOLERANCE;
  if (!inside)
    return;
  for (let i = from; i < to; i++) {
    const a = at.corner[i], b = at.corner[i + 1 < to ? i + 1 : from], aOut = dist[a] > TOLERANCE, bOut = dist[b] > TOLERANCE;
    if (!aOut)
      addCorner(start, number[a]);
    if (aOut !== bOut)
      addCorner(start, aOut ? crossing(b, a) : crossing(a, b));
  }
  closeFace(start, at.onCellFace[f]);
  for (let i = start; i < corners; i++) {
    const a = spare.corner[i], b = spare.corner[i + 1 < corners ? i + 1 : start];
    if (on[a] && on[b]) {
      rimFrom[rims] = a;
      rimTo[rims++] = b;
    }
  }
}

// Rim edges used in both directions are between two kept polygons. The other rim edges, reversed, bound the cap.
function closeCap(onCellFace) {
  let open = 0, begin = -1;
  next.fill(-1, 0, spare.vertices);
  for (let i = 0; i < rims; i++) {
    let paired = false;
    for (let j = 0; j < rims && !paired; j++)
      paired = rimFrom[i] === rimTo[j] && rimTo[i] === rimFrom[j];
    if (paired)
      continue;
    if (next[rimTo[i]] !== -1)
      return false;
    next[begin = rimTo[i]] = rimFrom[i];
    open++;
  }
  if (open < 3)
    return false;
  const start = corners;
  let v = begin, steps = 0;
  do {
    addCorner(start, v);
    v = next[v];
    steps++;
  } while (v !== -1 && v !== begin && steps <= open);
  if (v !== begin || steps !== open)
    return false;
  closeFace(start, onCellFace);
  return true;
}

/**
 * Clips `at` to n . x <= d. Returns false when almost nothing would remain, memory is too small, or rounding broke the loops. The polytope is
 * then unchanged: it may be too large, but is never too small.
 */
function clip(nx, ny, nz, d, onCellFace) {
  let most = -Infinity, least = Infinity;
  for (let i = 0; i < at.vertices; i++) {
    const e = dist[i] = nx * at.x[3 * i] + ny * at.x[3 * i + 1] + nz * at.x[3 * i + 2] - d;
    most = e > most ? e : most;
    least = e < least ? e : least;
  }
  if (most <= TOLERANCE)
    return true;
  if (least >= -1e-7)
    return false;
  spare.vertices = spare.faces = edges = rims = corners = 0;
  full = false;
  for (let i = 0; i < at.vertices; i++)
    if (dist[i] <= TOLERANCE)
      number[i] = addVertex(at.x[3 * i], at.x[3 * i + 1], at.x[3 * i + 2], dist[i] >= -TOLERANCE ? 1 : 0);
  for (let f = 0; f < at.faces && !full; f++)
    clipFace(f);
  if (full || !closeCap(onCellFace) || full || spare.faces < 4)
    return false;
  [at, spare] = [spare, at];
  return true;
}

function half(axis, side) {
  for (let i = axis; i < 3 * at.vertices; i += 3)
    at.x[i] = 2 * at.x[i] - side;
  const sign = side ? -1 : 1;
  if (!clip(axis === 0 ? sign : 0, axis === 1 ? sign : 0, axis === 2 ? sign : 0, side ? 0 : 1, 1))
    copy(at, CUBE);
}

/**
 * Returns the envelope of child `octant` of `parent` (undefined: the whole cell), scaled to the child's cell and cut by plane codes.
 * Returns the whole cell when the envelope is numerically empty.
 * @returns {Polytope}
 */
export function envelope(parent, octant, codes) {
  copy(at, parent ?? CUBE);
  if (parent)
    for (let axis = 2; axis >= 0; axis--)
      half(axis, octant >> axis & 1);
  for (const code of codes) {
    const { n, d } = decodePlane(code);
    clip(n[0] * (1 / 511), n[1] * (1 / 511), n[2] * (1 / 511), d * (1 / (511 * 4096)), 0);
  }
  return { vertices: at.vertices, faces: at.faces, x: at.x.slice(0, 3 * at.vertices), first: at.first.slice(0, at.faces + 1),
    corner: at.corner.slice(0, at.first[at.faces]), onCellFace: at.onCellFace.slice(0, at.faces) };
}

/** Returns the volume in units of the cell's volume. */
export function volume({ x, faces, first, corner }) {
  let sum = 0;
  for (let f = 0; f < faces; f++)
    for (let i = first[f] + 1; i + 1 < first[f + 1]; i++) {
      const a = 3 * corner[first[f]], b = 3 * corner[i], c = 3 * corner[i + 1];
      const bx = x[b] - x[0], by = x[b + 1] - x[1], bz = x[b + 2] - x[2], cx = x[c] - x[0], cy = x[c + 1] - x[1], cz = x[c + 2] - x[2];
      sum += (x[a] - x[0]) * (by * cz - bz * cy) + (x[a + 1] - x[1]) * (bz * cx - bx * cz) + (x[a + 2] - x[2]) * (bx * cy - by * cx);
    }
  return sum / 6;
}
