// Compares the colours that leafFaces() returns with the source's colours: of vertices and of faces, with several types, with and without subtrees.
// Needs EBPO_TOOL, the ebpo program.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test from 'node:test';
import { GRAY, LEAF, Tree, openEbpo } from '../index.js';

const tool = process.env.EBPO_TOOL, SIDE = 24;
const FULL = { uchar: 255, ushort: 65535, float: 1, double: 1 };

// Returns the expected colour of a point, three numbers from 0 to 255. Neighbouring points have different colours, so that wrong orders of rows are detected.
const colourAt = ([x, y, z]) => [x * 10 % 256, (y * 7 + x * x) % 256, z * 41 % 256].map(Math.round);
const height = (x, y) => (x * 5 + y * y * 3) % 7;

// A curved sheet with two triangles for each square.
function sheet(element, type, prefix) {
  const points = [], faces = [], number = (c) => c.map((v) => v / 255 * FULL[type]).join(' ');
  for (let y = 0; y < SIDE; y++)
    for (let x = 0; x < SIDE; x++)
      points.push([x, y, height(x, y)]);
  for (let y = 0; y + 1 < SIDE; y++)
    for (let x = 0; x + 1 < SIDE; x++) {
      const a = y * SIDE + x;
      faces.push([a, a + 1, a + SIDE], [a + 1, a + SIDE + 1, a + SIDE]);
    }
  const properties = ['red', 'green', 'blue'].map((name) => `property ${type} ${prefix}${name}`).join('\n') + '\n', of = (which) => (which === element ? properties : '');
  const flat = element === 'face' ? 'property uchar red\nproperty uchar green\nproperty uchar blue\n' : '', white = flat && ' 255 255 255';
  return `ply\nformat ascii 1.0\nelement vertex ${points.length}\nproperty float x\nproperty float y\nproperty float z\n${of('vertex')}${flat}element face ${faces.length}\n` +
    `property list uchar int vertex_indices\n${of('face')}end_header\n` + points.map((p) => p.join(' ') + (of('vertex') && ' ' + number(colourAt(p))) + white).join('\n') + '\n' +
    faces.map((f) => `3 ${f.join(' ')}` + (of('face') && ' ' + number(colourAt(points[f[0]])))).join('\n') + '\n';
}

async function leavesOf(file) {
  const tree = new Tree(file.info), leaves = [], walk = (node) => (node.type === LEAF ? leaves.push(node) : node.type === GRAY && tree.children(node).forEach(walk));
  for (const level of await file.levels(0, file.info.level_count - 1))
    tree.add(level);
  walk(tree.root);
  return leaves;
}

async function converted(text, options) {
  const folder = mkdtempSync(join(tmpdir(), 'colours-')), [ply, out] = ['in.ply', 'out.ebpo.h5'].map((name) => join(folder, name));
  try {
    writeFileSync(ply, text);
    execFileSync(tool, ['convert', '-q', '--leaf-faces', '8', ...options, ply, out], { stdio: ['ignore', 'ignore', 'ignore'] });
    return await openEbpo(readFileSync(out));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

const LAYOUTS = { plainly: ['--subtree-faces', 'none'], 'by subtree': ['--subtree-faces', '100'], 'with deflate': ['--codec', 'deflate'] };

for (const [how, options] of Object.entries(LAYOUTS))
  for (const [element, type, prefix] of [['vertex', 'uchar', ''], ['vertex', 'float', ''], ['vertex', 'double', 'diffuse_'], ['face', 'uchar', ''], ['face', 'ushort', '']])
    test(`colours of ${element}, ${type} ${prefix}, ${how}`, { skip: !tool }, async () => {
      const file = await converted(sheet(element, type, prefix), options), leaves = await leavesOf(file), lists = await file.leafFaces(leaves);
      let seen = 0;
      assert.equal(file.colours.element, element);
      for (const faces of lists)
        for (let face = 0; face < faces.numbers.length; face++, seen++) {
          const three = (of) => [0, 1, 2].map((k) => [...of.subarray(9 * face + 3 * k, 9 * face + 3 * k + 3)]), corner = three(faces), found = three(faces.colours);
          if (element === 'vertex')
            assert.deepEqual(found, corner.map(colourAt));
          else
            assert.ok(corner.some((c) => found.every((f) => f.join() === colourAt(c).join())));
        }
      assert.ok(seen >= file.info.face_count);
    });

test('a file without colours returns no colours', { skip: !tool }, async () => {
  const file = await converted(sheet('vertex', 'uchar', 'pale_'), []), faces = await file.leafFaces(await leavesOf(file));
  assert.equal(file.colours, undefined);
  assert.ok(faces.every((f) => f.colours === undefined));
});

test('content_sha256 omits colours', { skip: !tool }, async () => {
  await (await converted(sheet('vertex', 'uchar', ''), ['--subtree-faces', '100'])).verifyContent();
});
