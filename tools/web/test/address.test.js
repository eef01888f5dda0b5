// Tests addresses: values are read as they were written, invalid texts are ignored, and texts are short.
import assert from 'node:assert/strict';
import test from 'node:test';
import { boxOf, boxText, cameraOf, cameraText, clipOf, clipText, cutOf, pointsOf, pointsText, withQuery } from '../address.js';

const near = (a, b, most) => a.forEach((x, i) => assert.ok(Math.abs(x - b[i]) <= most, `${a} is not ${b}`));

test('a camera is restored to a thousandth of its distance, from at most 50 characters', () => {
  for (const [eye, target] of [[[1.2, 0.9, 2.5], [0, 0, 0]], [[-0.3, -0.2, 0.1], [0.31234, -0.2345, 0.1]], [[0.500001, 0.25, 0.1251], [0.5, 0.25, 0.125]], [[0, 2, 0], [0, 0, 0]]]) {
    const text = cameraText({ eye, target }), back = cameraOf(text), distance = Math.hypot(...eye.map((x, k) => x - target[k]));
    assert.ok(text.length <= 50, text);
    near(back.target, target, 1e-3 * distance);
    near(back.eye, eye, 3e-3 * distance);
    assert.equal(cameraText(back), text);
  }
  assert.equal(cameraText({ eye: [0, 0, 3], target: [0, 0, 0] }), '0,0,3');
  for (const text of [undefined, '', 'x', '1,2', '1,2,0', '1,2,-3', '1,91,3', '1,2,3,4', '1,2,NaN', '1,2,Infinity', '1,,3'])
    assert.equal(cameraOf(text), undefined, text);
});

test('planes, boxes and points are restored; invalid texts are ignored', () => {
  for (const text of ['x0.25', '-z0.5', 'y1', '-x0'])
    assert.equal(clipText(clipOf(text)), text);
  for (const text of [undefined, '', 'w0.5', 'x', 'x1.5', 'x-1', 'xx0.5'])
    assert.equal(clipOf(text), undefined, text);
  assert.equal(boxText(boxOf('0,0.125,0,1,1,0.75')), '0,0.125,0,1,1,0.75');
  assert.equal(boxText([0, 0, 0, 1, 1, 1]), undefined);
  for (const text of ['0,0,0,1,1', '0.5,0,0,0.5,1,1', '0,0,0,1,1,2', '-1,0,0,1,1,1'])
    assert.equal(boxOf(text), undefined, text);
  assert.deepEqual(pointsOf('1,2,3,4e2,-5,6'), [[1, 2, 3], [400, -5, 6]]);
  assert.equal(pointsOf('1,2'), undefined);
  assert.equal(pointsOf('1,2,3,'.repeat(2000).slice(0, -1)), undefined); // too many to draw
  near(pointsOf(pointsText([[0.123456789, 1, 2]], 0.25))[0], [0.123456789, 1, 2], 0.25e-6);
  assert.equal(pointsText([[12345.678, 0, -1]], 20000), '12345.68,0,-1');
});

test('a plane and a box keep their intersection; axes without a limit are not cut', () => {
  const size = [2, 4, 6];
  assert.equal(cutOf(size, 1, undefined, undefined), undefined);
  assert.equal(cutOf(size, 1, undefined, [0, 0, 0, 1, 1, 1]), undefined);
  const plane = cutOf(size, 1, { axis: 1, at: 0.75, flip: false }), other = cutOf(size, 1, { axis: 1, at: 0.75, flip: true });
  assert.deepEqual([plane.high[1], other.low[1]], [1, 1]);
  assert.ok(plane.low.every((x) => x < -3) && plane.high[0] > 3 && other.high.every((x) => x > 3));
  const both = cutOf(size, 0.5, { axis: 0, at: 0.5, flip: false }, [0.25, 0, 0, 1, 1, 0.5]);
  near([both.low[0], both.high[0], both.high[2]], [-0.25, 0, 0], 1e-12);
});

test('an address keeps its other parameters and its commas', () => {
  const href = withQuery('https://example.org/v/?samples=a.json&view=1,2,3', [['view', '4,5,6'], ['file', 'models/a b.ebpo.h5'], ['clip', undefined]]);
  assert.equal(href, 'https://example.org/v/?samples=a.json&view=4,5,6&file=models/a+b.ebpo.h5');
});
