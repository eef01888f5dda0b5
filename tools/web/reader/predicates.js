// Exact predicates over doubles. A floating-point filter decides nearly all cases; integers of any size decide the rest. The predicates and the
// infinitely small shift are those of the library; see lib/geometry/triangle_predicates.c.
// Source of the filters: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997.
// Source of the shift: Edelsbrunner and Muecke, "Simulation of Simplicity", 1990.

const view = new DataView(new ArrayBuffer(8));
const BOUND_2D = 3.4e-16, BOUND_3D = 7.9e-16; // greater than (3 + 16 u) u and (7 + 56 u) u, where u = 2^-53
const SMALL = 1e-250;                         // smaller products may have lost bits to underflow

// Scales all numbers by a common power of two to integers.
function integers(numbers) {
  let least = Infinity;
  const parts = numbers.map((x) => {
    view.setFloat64(0, x);
    const bits = view.getBigUint64(0), exponent = Number(bits >> 52n & 0x7ffn), fraction = bits & 0xfffffffffffffn;
    const m = exponent ? fraction | 0x10000000000000n : fraction, e = Math.max(exponent, 1);
    if (m)
      least = Math.min(least, e);
    return { m: bits >> 63n ? -m : m, e };
  });
  return parts.map(({ m, e }) => (m ? m << BigInt(e - least) : 0n));
}

const signOf = (big) => (big > 0n) - (big < 0n);

/** Returns 1 when a, b, c (two numbers each, as separate arguments) turn counter-clockwise, -1 when clockwise, 0 on a line. */
function turn(ax, ay, bx, by, cx, cy) {
  const left = (bx - ax) * (cy - ay), right = (by - ay) * (cx - ax), det = left - right, bulk = Math.abs(left) + Math.abs(right);
  if (bulk > SMALL && bulk < Infinity && Math.abs(det) > BOUND_2D * bulk)
    return Math.sign(det);
  const [p, q, r, s, t, u] = integers([ax, ay, bx, by, cx, cy]);
  return signOf((r - p) * (u - q) - (s - q) * (t - p));
}

/** Returns 1 when d is on the side to which the normal of counter-clockwise a, b, c points, -1 on the other side, 0 in their plane. */
export function orient3d(a, b, c, d) {
  const bx = b[0] - a[0], by = b[1] - a[1], bz = b[2] - a[2], cx = c[0] - a[0], cy = c[1] - a[1], cz = c[2] - a[2];
  const dx = d[0] - a[0], dy = d[1] - a[1], dz = d[2] - a[2];
  const det = (by * cz - bz * cy) * dx + (bz * cx - bx * cz) * dy + (bx * cy - by * cx) * dz;
  const bulk = (Math.abs(by * cz) + Math.abs(bz * cy)) * Math.abs(dx) + (Math.abs(bz * cx) + Math.abs(bx * cz)) * Math.abs(dy) +
    (Math.abs(bx * cy) + Math.abs(by * cx)) * Math.abs(dz);
  if (bulk > SMALL && bulk < Infinity && Math.abs(det) > BOUND_3D * bulk)
    return Math.sign(det);
  const [ax, ay, az, px, py, pz, qx, qy, qz, rx, ry, rz] = integers([...a, ...b, ...c, ...d]);
  const u = [px - ax, py - ay, pz - az], v = [qx - ax, qy - ay, qz - az], w = [rx - ax, ry - ay, rz - az];
  return signOf((u[1] * v[2] - u[2] * v[1]) * w[0] + (u[2] * v[0] - u[0] * v[2]) * w[1] + (u[0] * v[1] - u[1] * v[0]) * w[2]);
}

// Returns the sign of component k of the normal of a, b, c.
function normalSign(k, a, b, c) {
  const u = k === 2 ? 0 : k + 1, v = k === 0 ? 2 : k - 1;
  return turn(a[u], a[v], b[u], b[v], c[u], c[v]);
}

function shiftedSide2d(axis, a, b, p) {
  const sign = normalSign(axis, a, b, p);
  if (sign !== 0)
    return sign;
  const u = axis === 2 ? 0 : axis + 1, v = axis === 0 ? 2 : axis - 1;
  const byU = a[v] > b[v] ? 1 : a[v] < b[v] ? -1 : 0, byV = b[u] > a[u] ? 1 : b[u] < a[u] ? -1 : 0;
  return u < v ? byU || byV : byV || byU;
}

function shiftedSide3d(a, b, c, p) {
  return orient3d(a, b, c, p) || normalSign(0, a, b, c) || normalSign(1, a, b, c) || normalSign(2, a, b, c);
}

/**
 * Returns the change of the winding number at the face a, b, c along the segment from `from` in direction +axis to coordinate `to`: +1 when the segment enters
 * through the face, -1 when it leaves, and 0 when it does not cross the face. Both ends are shifted by infinitely small (d0, d1, d2).
 */
export function axisCrossing(from, to, axis, a, b, c) {
  if (!(from[axis] < to))
    return 0;
  for (let k = 0; k < 3; k++)
    if ((k === axis ? to : from[k]) < Math.min(a[k], b[k], c[k]) || from[k] >= Math.max(a[k], b[k], c[k]))
      return 0;
  const side = shiftedSide2d(axis, a, b, from);
  if (side === 0 || shiftedSide2d(axis, b, c, from) !== side || shiftedSide2d(axis, c, a, from) !== side)
    return 0;
  if (from[axis] >= Math.min(a[axis], b[axis], c[axis]) && shiftedSide3d(a, b, c, from) === side)
    return 0;
  if (to < Math.max(a[axis], b[axis], c[axis])) {
    const end = [...from];
    end[axis] = to;
    if (shiftedSide3d(a, b, c, end) !== side)
      return 0;
  }
  return -side;
}

function onSegment(p, a, b) {
  for (let k = 0; k < 3; k++)
    if (p[k] < Math.min(a[k], b[k]) || p[k] > Math.max(a[k], b[k]))
      return false;
  return [0, 1, 2].every((k) => normalSign(k, a, b, p) === 0);
}

/** Returns true when p is on the closed triangle a, b, c, which may have no area. */
export function onTriangle(p, a, b, c) {
  for (let k = 0; k < 3; k++)
    if (p[k] < Math.min(a[k], b[k], c[k]) || p[k] > Math.max(a[k], b[k], c[k]))
      return false;
  if (orient3d(a, b, c, p) !== 0)
    return false;
  for (let k = 0; k < 3; k++) {
    const side = normalSign(k, a, b, c);
    if (side !== 0)
      return normalSign(k, a, b, p) !== -side && normalSign(k, b, c, p) !== -side && normalSign(k, c, a, p) !== -side;
  }
  return onSegment(p, a, b) || onSegment(p, b, c) || onSegment(p, c, a);
}
