// Tests the exact predicates in cases where floating point alone is wrong, and the shift for points on faces, edges and vertices.
import assert from 'node:assert/strict';
import test from 'node:test';
import { axisCrossing, onTriangle, orient3d } from '../index.js';

// Closed solids: faces, and a function that returns true when a point shifted by infinitely small (d0, d1, d2), d0 >> d1 >> d2, is inside.
const cube = { faces: [], inside: (p) => p.every((x) => x >= 0 && x < 1) };
for (let axis = 0; axis < 3; axis++)
  for (const side of [0, 1]) {
    const corner = (u, v) => [0, 1, 2].map((k) => (k === axis ? side : k === (axis + 1) % 3 ? u : v)), q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    if (!side)
      q.reverse();
    cube.faces.push([q[0], q[1], q[2]], [q[0], q[2], q[3]]);
  }
const octahedron = { faces: [], inside: ([x, y, z]) => {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  return sum < 2 || (sum === 2 && x < 0); // on the surface d0 decides: for x >= 0 it points outwards
} };
for (let o = 0; o < 8; o++) {
  const [a, b, c] = [0, 1, 2].map((k) => [0, 1, 2].map((i) => (i === k ? (o >> k & 1 ? -2 : 2) : 0)));
  octahedron.faces.push([1, 2, 4, 7].includes(o) ? [a, c, b] : [a, b, c]);
}

for (const [name, { faces, inside }] of Object.entries({ cube, octahedron }))
  test(`${name}: crossings along a path to the outside classify points, also on faces, edges and vertices`, () => {
    const steps = [-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2];
    for (const x of steps)
      for (const y of steps)
        for (const z of steps)
          for (let axis = 0; axis < 3; axis++) {
            const sum = faces.reduce((total, f) => total + axisCrossing([x, y, z], 5, axis, ...f), 0);
            assert.equal(sum, inside([x, y, z]) ? -1 : 0, `${[x, y, z]} axis ${axis}`);
            for (const to of steps.filter((t) => t > [x, y, z][axis])) { // also to ends inside the solid
              const end = [x, y, z];
              end[axis] = to;
              assert.equal(faces.reduce((total, f) => total + axisCrossing([x, y, z], to, axis, ...f), 0), +inside(end) - +inside([x, y, z]), `${[x, y, z]} to ${end}`);
            }
          }
  });

test('orient3d: the sign is exact near the plane, and for the smallest and largest exponents', () => {
  for (const scale of [1, 2 ** -900, 2 ** 300]) {
    const s = (p) => p.map((x) => x * scale), plane = [[12, 12, 12], [24, 24, 24.5], [0.5, 0.5, 3]].map(s);
    for (let i = -3; i <= 3; i++) {
      const p = s([0.5 + i * 2 ** -53, 0.5, 7]); // the plane is x = y
      const sign = orient3d(...plane, p);
      assert.equal(sign, Math.sign(p[0] - p[1]) * orient3d(...plane, s([2, 1, 0])), `${i} at ${scale}`);
    }
  }
});

test('onTriangle: points on faces, edges and corners, and close to them', () => {
  const f = [[0, 0, 0], [3, 0, 0], [0, 3, 0]];
  assert.ok([[1, 1, 0], [1.5, 1.5, 0], [3, 0, 0], [0, 1, 0]].every((p) => onTriangle(p, ...f)));
  assert.ok([[1, 1, 2 ** -60], [1.5, 1.5 + 2 ** -51, 0], [-(2 ** -60), 1, 0], [4, 0, 0]].every((p) => !onTriangle(p, ...f)));
  assert.ok(onTriangle([1, 1, 1], [0, 0, 0], [2, 2, 2], [2, 2, 2]) && !onTriangle([1, 1, 1 + 2 ** -52], [0, 0, 0], [2, 2, 2], [2, 2, 2]));
});
