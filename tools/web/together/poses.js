// Poses and routes of scene files: format-spec/scene.md, sections 3 and 4. A pose is { rotation (nine numbers, row by row), scale, translation }.
const ARC_HALVES = 28;

export const AT_HOME = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], scale: 1, translation: [0, 0, 0] };

const lengthOf = (q) => Math.sqrt((q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]));

/** Returns the quaternion scaled to length 1, or undefined for 0. */
export function unitQuaternion(q) {
  const most = Math.max(...q.map(Math.abs));
  if (!(most > 0))
    return undefined;
  const small = q.map((x) => x / most), length = lengthOf(small);
  return small.map((x) => x / length);
}

export function matrixOf([x, y, z, w]) {
  return [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)];
}

/** Returns the quaternion of a rotation matrix, computed from the component with the greatest magnitude. */
export function quaternionOf(m) {
  const [a, b, c] = [m[0], m[4], m[8]], squares = [1 + a - b - c, 1 - a + b - c, 1 - a - b + c, 1 + a + b + c], k = squares.indexOf(Math.max(...squares));
  return unitQuaternion([[squares[0], m[1] + m[3], m[2] + m[6], m[7] - m[5]], [m[1] + m[3], squares[1], m[5] + m[7], m[2] - m[6]], [m[2] + m[6], m[5] + m[7], squares[2], m[3] - m[1]],
    [m[7] - m[5], m[2] - m[6], m[3] - m[1], squares[3]]][k]);
}

// Interpolates rotations with constant speed along the shorter arc. Halves the arc until the chord equals the arc.
function turnBetween(from, to, share) {
  let a = from, u = share, b = (from[0] * to[0] + from[1] * to[1]) + (from[2] * to[2] + from[3] * to[3]) < 0 ? to.map((x) => -x) : to;
  for (let i = 0; i < ARC_HALVES; i++) {
    const middle = unitQuaternion(a.map((x, k) => x + b[k]));
    if (u >= 0.5)
      [a, u] = [middle, 2 * u - 1];
    else
      [b, u] = [middle, 2 * u];
  }
  return unitQuaternion(a.map((x, k) => x + u * (b[k] - x)));
}

/** Returns the pose of a route at a time. `route`: { keys: [{ time, turn (a quaternion of length 1), scale, translation }], jumps }. */
export function routeAt({ keys, jumps }, time) {
  let n = 0; // index of the last key not after the time, or 0
  for (let end = keys.length; end - n > 1;) {
    const middle = (n + end) >> 1;
    keys[middle].time <= time ? (n = middle) : (end = middle);
  }
  const a = keys[n], b = keys[n + 1] ?? a, pose = (turn, scale, translation) => ({ rotation: matrixOf(turn), scale, translation });
  if (a === b || jumps || time <= a.time)
    return pose(a.turn, a.scale, a.translation);
  const u = (time - a.time) / (b.time - a.time), between = (x, y) => x + u * (y - x);
  return pose(turnBetween(a.turn, b.turn, u), between(a.scale, b.scale), a.translation.map((x, k) => between(x, b.translation[k])));
}

/** Returns the image of a model's point under a pose. */
export const placed = ({ rotation: r, scale, translation: t }, p) => [0, 1, 2].map((i) => r[3 * i] * scale * p[0] + r[3 * i + 1] * scale * p[1] + r[3 * i + 2] * scale * p[2] + t[i]);

/** Returns the model's point whose image under a pose is p. */
export function unplaced({ rotation: r, scale, translation: t }, p) {
  const d = p.map((x, k) => x - t[k]);
  return [0, 1, 2].map((k) => (r[k] * d[0] + r[3 + k] * d[1] + r[6 + k] * d[2]) / scale);
}

/** Returns the pose that applies `inner` first and then `outer`. */
export function after(outer, inner) {
  const a = outer.rotation, b = inner.rotation, rotation = [0, 1, 2].flatMap((i) => [0, 1, 2].map((k) => a[3 * i] * b[k] + a[3 * i + 1] * b[3 + k] + a[3 * i + 2] * b[6 + k]));
  return { rotation, scale: outer.scale * inner.scale, translation: placed(outer, inner.translation) };
}

/** Returns the pose of an instance { pose, route } at a time. */
export const poseAt = ({ pose, route }, time) => (route ? after(routeAt(route, time), pose) : pose);
