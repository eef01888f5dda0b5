// Tests hidden.js: nodes behind a wall are hidden, nodes beside and before the wall are not, and nothing is hidden in an unknown view.
import assert from 'node:assert/strict';
import test from 'node:test';
import { Hidden } from '../hidden.js';

// A view from the origin along -z, 90 degrees wide and high.
const s = Math.SQRT1_2, view = { eye: [0, 0, 0], planes: [[s, 0, -s, 0], [-s, 0, -s, 0], [0, -s, -s, 0], [0, s, -s, 0]], pixels: 500 };
const node = (x, y, z, size) => ({ x, y, z, size }), place = ({ x, y, z, size }) => ({ center: [x, y, z], radius: size * Math.sqrt(3) / 2 });

// Cells of a wall at a distance of 1 that covers the left half of the view. Some cells are behind others, as for any surface.
const wall = [];
for (const z of [-1, -1.02])
  for (let x = -1; x < 0; x += 0.02)
    for (let y = -1; y < 1; y += 0.02)
      wall.push(node(x + 0.01, y + 0.01, z, 0.02));

test('nodes behind the wall are hidden, and nodes beside or before it are not', () => {
  const hidden = new Hidden(view, wall, place);
  assert.ok(hidden.has(node(-1, 0, -2, 0.1)) && hidden.has(node(-2, 1, -4, 0.5)));
  for (const seen of [node(1, 0, -2, 0.1), node(-0.2, 0, -0.4, 0.1), node(0, 0, -2, 0.5), node(-0.5, 0.5, -1, 0.05)])
    assert.ok(!hidden.has(seen), JSON.stringify(seen));
});
test('a wall with holes hides less', () => {
  const hidden = new Hidden(view, wall.filter(({ x }) => x < -0.6 || x > -0.5), place);
  assert.ok(!hidden.has(node(-2, 1, -4, 1)));
});
test('in a parallel view nothing is hidden', () => {
  const parallel = { ...view, planes: [[1, 0, 0, 2], [-1, 0, 0, 2], [0, -1, 0, 2], [0, 1, 0, 2]] };
  assert.ok(!new Hidden(parallel, wall, place).has(node(-1, 0, -2, 0.1)));
});
test('without the planes of the view nothing is hidden', () => assert.ok(!new Hidden({ ...view, planes: [] }, wall, place).has(node(-1, 0, -2, 0.1))));
