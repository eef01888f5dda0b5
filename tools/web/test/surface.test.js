// Tests the choice of patches of the simplified surface, and their mesh: the patches replace all faces once, within the allowed error.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { sceneOf } from '../cut.js';
import { open } from '../ebpo/index.js';
import { openModel } from '../model_file.js';
import { Surface, capsTile } from '../surface.js';

const view = { eye: [0.3, 0.4, 2], planes: [], pixels: 800 }, want = { pixels: 16, triangles: 2e6 };

const bytesOf = (name) => readFileSync(new URL(`../../../format-spec/vectors/passed/${name}.ebpo.h5`, import.meta.url));

async function load(name, small = false) {
  const file = await openModel(bytesOf(name)), scene = sceneOf(file.info);
  return { file, scene, surface: new Surface(file.info, scene, await file.patches(), small) };
}

// Returns true if triangles use each edge equally often in both directions. `place(vertex)`: equal for vertices at the same position.
function isClosed(index, place) {
  const edges = new Map();
  for (let i = 0; i < index.length; i++) {
    const a = place(index[i]), b = place(index[i % 3 === 2 ? i - 2 : i + 1]);
    edges.set(`${a} ${b}`, (edges.get(`${a} ${b}`) ?? 0) + 1);
    edges.set(`${b} ${a}`, (edges.get(`${b} ${a}`) ?? 0) - 1);
  }
  return [...edges.values()].every((n) => n === 0);
}

const sum = (list, of) => list.reduce((total, item) => total + of(item), 0);

test('patches of any error replace all faces, each once', async () => {
  for (const name of ['69_surface', '70_surface_with_subtrees', '71_surface_without_mesh']) {
    const { file, surface } = await load(name), { patches } = surface;
    let before = 0;
    for (const pixels of [800, 160, 32, 16, 4, 1]) {
      const { chosen, triangles, pixels: error } = surface.choose(view, { ...want, pixels });
      assert.equal(sum(chosen, ({ patch }) => patches[patch].faces), file.info.face_count);
      assert.equal(triangles, sum(chosen, ({ patch, faces }) => (faces ? patches[patch].faces : patches[patch].triangles)));
      assert.ok(triangles >= before, `${pixels}: ${triangles} after ${before}`);
      assert.ok(error <= pixels / 8 || chosen.every(({ patch, faces }) => faces || patches[patch].end === patches[patch].child), `${error} px`);
      assert.ok(chosen.every(({ faces }) => !faces || file.info.parts.has('mesh')));
      before = triangles;
    }
  }
});

test('a limit of triangles is kept, and cells out of sight stay coarse', async () => {
  const { surface } = await load('70_surface_with_subtrees'), all = surface.choose(view, { ...want, pixels: 1 });
  const few = surface.choose(view, { ...want, pixels: 1, triangles: 900 }), away = surface.choose({ ...view, planes: [[1, 0, 0, -9]] }, { ...want, pixels: 1 });
  assert.ok(few.triangles <= 900 && all.triangles > 900);
  assert.deepEqual(away.chosen.map(({ patch }) => patch), [0]);
});

test('small models are drawn by their faces; the first picture comes in stages', async () => {
  const { file, scene, surface } = await load('70_surface_with_subtrees', true), { chosen } = surface.choose(view, want);
  assert.ok(chosen.every(({ faces }) => faces));
  const { triangles, faces, index } = await file.surface(chosen, scene);
  assert.deepEqual([triangles, faces, index.length], [8448, 8448, 3 * 8448]);
  const seen = [];
  for (let next; !next?.last; surface.read(next))
    seen.push(next = surface.next(view, want));
  assert.ok(seen.every(({ triangles: n }, i) => i === 0 || n >= seen[i - 1].triangles));
});

test('few faces in the corner of a cell are not taken for large faces', () => {
  const info = { parts: new Set(['mesh']), box_size: [1, 1, 1], face_count: 1e6 }, leaf = { level: 1, error: 0.5, child: 3, end: 3 };
  const patches = (faces) => [{ level: 0, at: [0, 0, 0], error: 1, triangles: 10, faces: faces + 20, child: 1, end: 3 },
    { ...leaf, at: [0, 0, 0], triangles: 5, faces: 20 }, { ...leaf, at: [1, 0, 0], triangles: 50, faces }];
  const replaced = (faces) => new Surface(info, { scale: 1 }, patches(faces), false).choose(view, want).chosen.map((c) => c.faces);
  assert.deepEqual(replaced(1e6), [false, false]);
  assert.deepEqual(replaced(2000), [true, true]);
});

// Returns patches of all cells of levels 0 to 3.
function fullTree(triangles, errorOf) {
  const patches = [{ level: 0, at: [0, 0, 0] }];
  for (let i = 0; i < 73; i++)
    for (let octant = 0; octant < 8; octant++)
      patches.push({ level: patches[i].level + 1, at: patches[i].at.map((x, k) => 2 * x + ((octant >> k) & 1)) });
  patches.forEach((p, i) => Object.assign(p, { error: errorOf(p.level, i), triangles, faces: 1e6, child: i < 73 ? 8 * i + 1 : 585, end: i < 73 ? 8 * i + 9 : 585 }));
  return new Surface({ parts: new Set(), box_size: [1, 1, 1], face_count: 1e9 }, { scale: 1 }, patches, false);
}

test('below a limit of triangles, patches that are stored together are refined together', () => {
  const surface = fullTree(500, (level, i) => 0.1 / 4 ** level * (1 + (i * 37 % 64) / 64));
  const { chosen, triangles } = surface.choose({ ...view, eye: [0, 0, 20], pixels: 30_000 }, { ...want, triangles: 135_000 });
  const fine = chosen.map(({ patch }) => patch).filter((patch) => patch >= 73), runs = fine.filter((patch) => !fine.includes(patch - 1)).length;
  assert.ok(triangles <= 135_000 && fine.length > 200, `${fine.length} of 512 patches`);
  assert.ok(runs <= 5, `${fine.length} patches are in ${runs} places`);
});

test('patches behind others stay coarser, in a known view', () => {
  const surface = fullTree(10, (level) => 0.06 / 4 ** level), { patches } = surface, s = Math.SQRT1_2;
  const far = { eye: [0, 0, 2.5], planes: [[s, 0, -s, 2.5 * s], [-s, 0, -s, 2.5 * s], [0, -s, -s, 2.5 * s], [0, s, -s, 2.5 * s]], pixels: 2000 };
  const levelsAt = (v, z, w = want) => new Set(surface.choose(v, w).chosen.map(({ patch }) => patches[patch])
    .filter(({ level, at }) => Math.floor(at[2] * 4 / 2 ** level) === z).map(({ level }) => level));
  assert.deepEqual(levelsAt(far, 3), new Set([3]));
  assert.deepEqual(levelsAt(far, 0), new Set([2]));
  assert.deepEqual(levelsAt({ ...far, planes: [] }, 0), new Set([3]));
  assert.deepEqual(levelsAt(far, 0, { ...want, black: true }), new Set([3]), 'what covers them may be cut away');
  assert.ok(surface.choose(far, want).pixels > surface.choose({ ...far, planes: [] }, want).pixels, 'the error of hidden patches counts');
});

test('a mesh has unit coordinates of the scene, colours and closed edges', async () => {
  for (const faces of [false, true]) {
    const { file, scene, surface } = await load('70_surface_with_subtrees'), wanted = surface.patches.map((_, patch) => ({ patch, faces: faces && patch % 2 === 0 })).slice(1);
    const mesh = await file.surface(wanted, scene), { position, normal, hue, index } = mesh, count = position.length / 3;
    assert.ok(mesh.triangles > 2000 && index.length === 3 * mesh.triangles && index.every((v) => v < count));
    assert.equal(mesh.faces, sum(wanted, (w) => (w.faces ? surface.patches[w.patch].faces : 0)));
    assert.deepEqual([normal.length, hue.length], [2 * count, 4 * count]);
    assert.ok(position.every((x) => Math.abs(x) <= 1.01));
    assert.ok(isClosed(index, (v) => position.subarray(3 * v, 3 * v + 3).join()), 'each edge has an opposite one');
    const tile = surface.tileOf(mesh, true);
    assert.equal(tile.tag.length, 4 * count);
    assert.ok(tile.lines.length > mesh.triangles && tile.lines.length % 2 === 0);
  }
});

test('caps close the holes of a mesh', async () => {
  for (const name of ['65_border', '66_border_doubles', '67_border_with_subtrees', '73_inside_with_subtrees']) {
    const { center, scale } = sceneOf((await openModel(bytesOf(name))).info), { vertices, faces } = await (await open(bytesOf(name))).mesh();
    const caps = await (await openModel(bytesOf(name))).caps({ center, scale }), tile = capsTile(caps), first = vertices.length / 3;
    const position = [...Array.from(vertices, (x, i) => Math.fround((x - center[i % 3]) * scale)), ...caps.position];
    const place = (v) => position.slice(3 * v, 3 * v + 3).join();
    assert.ok(caps.triangles > 0 && !isClosed(faces, place), name);
    assert.ok(isClosed([...faces, ...Array.from(caps.index, (v) => first + v)], place), name);
    assert.deepEqual([tile.hue.length, tile.tag.length, tile.triangles], [12 * caps.triangles, 12 * caps.triangles, caps.triangles]);
  }
});
