// Tests several models: reading of scenes and addresses, poses of instances and budgets of triangles. tests/web/viewer.mjs tests workers with many files.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { open } from '../ebpo/index.js';
import { sharesOf, weightOf } from '../together/budget.js';
import { boundsOf } from '../together/bounds.js';
import { parseStrict } from '../together/strict_json.js';
import { after, matrixOf, placed, poseAt, quaternionOf, routeAt, unitQuaternion, unplaced } from '../together/poses.js';
import { poseFrom, wanted } from '../together/addresses.js';
import { cameraAt, poseOf, readScene } from '../together/scene_file.js';

const near = (a, b, off = 1e-12) => a.forEach((x, k) => assert.ok(Math.abs(x - b[k]) <= off * (1 + Math.abs(b[k])), `${a} and ${b}`));
const SCENE = {
  ebpo_scene: '1.0', title: 'Two', unit: 'm', models: { wall: { file: 'wall.ebpo.h5' }, arm: { file: 'parts/arm.ebpo.h5', 'x-price': 12 } }, layers: ['building', 'robot'], groups: ['tools'],
  routes: { reach: { keys: [{ time: 0, pose: {} }, { time: 2, pose: { translation: [1, 0, 0], quaternion: [0, 0, 1, 1], scale: 3 } }] },
    steps: { csv: 'steps.csv', between: 'jump' }, even: { poses: [{}, { translation: [0, 5, 0] }], begin: 1, step: 4 } },
  instances: [{ name: 'north', model: 'wall', layer: 'building', fixed: true, pose: { translation: [0, -4, 0], rotation: [-1, 0, 0, 0, -1, 0, 0, 0, 1] } },
    { name: 'arm', model: 'arm', layer: 'robot', groups: ['tools'], route: 'reach', pose: { scale: 0.5, translation: [1, 2, 3] } }, { name: 'stepper', model: 'arm', route: 'steps' },
    { name: 'slider', model: 'arm', route: 'even' }],
  cameras: [{ name: 'door', eye: [8, 8, 2], target: [0, 0, 1], route: 'even' }], ignore: [['arm', 'north']], clearance: [],
};
const CSV = 'time;qx;qy;qz;qw;x;y;z\r\n0;0;0;0;1;0;0;0\r\n\r\n3;0;0;1;1;7;8;9\r\n';
const read = (scene, csv = CSV) => readScene(JSON.stringify(scene), async (path) => (assert.equal(path, 'steps.csv'), csv));

test('instances of a scene have their poses at each time', async () => {
  const scene = await read(SCENE), [north, arm, stepper, slider] = scene.instances;
  assert.deepEqual([scene.title, scene.unit, scene.from, scene.to, scene.models.length, arm.model, arm.layer], ['Two', 'm', 0, 5, 2, 1, 'robot']);
  near(placed(poseAt(north, 1), [1, 2, 3]), [-1, -6, 3]);
  near(placed(poseAt(arm, -1), [2, 0, 0]), [2, 2, 3]);
  near(placed(poseAt(arm, 2), [2, 0, 0]), [-5, 6, 9]); // a right angle around z, times 3, moved by 1
  near(placed(poseAt(arm, 1), [0, 0, 0]), [0.5 + 2 * (Math.SQRT1_2 - 2 * Math.SQRT1_2), 2 * (Math.SQRT1_2 + 2 * Math.SQRT1_2), 6]);
  near(placed(poseAt(stepper, 2.99), [0, 0, 0]), [0, 0, 0]);
  near(placed(poseAt(stepper, 3), [1, 0, 0]), [7, 9, 9]);
  near(placed(poseAt(slider, 3), [0, 0, 0]), [0, 2.5, 0]);
  near(cameraAt(scene.cameras[0], 5).eye, [8, 13, 2]);
});

test('rotations have constant speed along the shorter arc', () => {
  const turn = (angle) => [0, Math.sin(angle / 2), 0, Math.cos(angle / 2)], keys = [0, 1].map((time) => ({ time, turn: time ? turn(2).map((x) => -x) : turn(0), scale: 1, translation: [0, 0, 0] }));
  for (const u of [0.1, 0.37, 0.5, 0.9])
    near(poseAt({ pose: poseFrom(''), route: { keys } }, u).rotation, matrixOf(turn(2 * u)), 1e-8);
});

test('poses can be inverted and composed', () => {
  for (const q of [[0, 0, 0, 1], [1, 2, 3, 4], [-4, 1, 0, 0.1], [0, 5, 0, 0], [0, 0, 1, -1e-9]]) {
    const pose = poseOf({ quaternion: q, scale: 2.5, translation: [1, -2, 3] }, 'pose'), p = [0.3, 7, -5], again = quaternionOf(pose.rotation), unit = unitQuaternion(q);
    near(unplaced(pose, placed(pose, p)), p);
    near(placed(after(pose, pose), p), placed(pose, placed(pose, p)));
    near(again.map((x) => x * Math.sign(again.reduce((s, y, k) => s + y * unit[k], 0))), unit, 1e-8);
  }
});

const REFUSED = {
  'another version': [(s) => (s.ebpo_scene = '2.0'), /ebpo_scene/], 'an unknown member': [(s) => (s.colour = 1), /"colour"/], 'no such model': [(s) => (s.instances[1].model = 'leg'),
    /instances\[1\]\.model: "leg"/],
  'a path out of the folder': [(s) => (s.models.wall.file = '../wall.ebpo.h5'), /models\.wall\.file.*leads out/], 'an absolute path': [(s) => (s.models.wall.file = '/etc/x'), /leads out/],
  'another scheme': [(s) => (s.models.wall.file = 'data:x'), /leads out/], 'a server without a digest': [(s) => (s.models.wall.file = 'https://example.org/x.ebpo.h5'), /content_sha256/],
  'a mirror': [(s) => (s.instances[0].pose.rotation = [-1, 0, 0, 0, 1, 0, 0, 0, 1]), /mirror/], 'no rotation': [(s) => (s.instances[0].pose.rotation = [1, 0, 0, 0, 2, 0, 0, 0, 1]), /not a rotation/],
  'no quaternion': [(s) => (s.routes.reach.keys[1].pose.quaternion = [0, 0, 0, 0]), /is 0/], 'descending times': [(s) => (s.routes.reach.keys[1].time = 0), /ascend/],
    'fixed and moving': [(s) => (s.instances[1].fixed = true), /fixed/],
  'a duplicate name': [(s) => (s.instances[1].name = 'north'), /twice/], 'a scale of 0': [(s) => (s.instances[1].pose.scale = 0), /scale/],
    'a text for a number': [(s) => (s.instances[1].pose.scale = '1'), /scale/],
  'null as a pose': [(s) => (s.instances[1].pose = null), /pose: is not an object/], 'false as a rotation': [(s) => (s.instances[1].pose.rotation = false), /9 numbers/],
  'null for models': [(s) => (s.models = null), /models: is not an object/], 'poses of another server': [(s) => (s.routes.steps.csv = 'https://elsewhere.example/steps.csv'), /files of poses/],
  'too many instances': [(s) => (s.instances = Array.from({ length: 100_001 }, () => null)), /more than 100000 instances/],
};
for (const [what, [spoil, says]] of Object.entries(REFUSED))
  test(`a scene with ${what} is refused`, async () => {
    const scene = structuredClone(SCENE);
    spoil(scene);
    await assert.rejects(read(scene), says);
  });

test('duplicate members, also with escapes, and too deep nesting are refused', async () => {
  const text = JSON.stringify(SCENE), twice = text.replace('"title":"Two"', '"title":"Two","t\\u0069tle":"Three"');
  assert.notEqual(text, twice);
  await assert.rejects(readScene(twice), /"t\\u0069tle" is there twice/);
  await assert.rejects(readScene(text.replace('"x-price":12', '"x-price":[{"a":1,"b":"a","a":2}]')), /"a" is there twice/);
  await assert.rejects(readScene(`{"x-deep":${'['.repeat(40)}${']'.repeat(40)}}`), /32 levels/);
  for (const good of [text, '{"a":"a","b":{"a":["a","a",{"a":"}"}]},"c\\"{":1}', '["a",{"b":[]},"b",{"b":{}}]', '"a"', '{}'])
    assert.deepEqual(parseStrict(good), JSON.parse(good));
});

test('many routes and instances take little time, and boxes beyond double precision are reported', async () => {
  const keys = Array.from({ length: 5000 }, (_, time) => ({ time, pose: { translation: [time, 0, 0] } })), scene = { ...SCENE, cameras: [], ignore: [], routes: { long: { keys } },
    instances: Array.from({ length: 20_000 }, (_, i) => ({ name: `${i}`, model: 'arm', route: 'long' })) };
  const { instances, from, to } = await read(scene), boxes = instances.map((instance) => ({ instance, origin: [0, 0, 0], size: [1, 1, 1] }));
  assert.deepEqual([from, to], [0, 4999]);
  assert.deepEqual(boundsOf(boxes, { from, to }), { origin: [0, 0, 0], size: [5000, 1, 1] });
  assert.equal(boundsOf([], { from, to }), undefined);
  for (const poses of [[{ translation: [1e308, 0, 0] }, { translation: [-1e308, 0, 0] }], [{ scale: 2 ** 300 }], [{ scale: 2 ** -300 }]])
    assert.throws(() => boundsOf(poses.map((pose) => ({ instance: { pose: poseOf(pose, 'pose') }, origin: [0, 0, 0], size: [poses[0].scale < 1 ? 1e-220 : 1e220, 0, 0] })), { from: 0, to: 0 }),
      /correct their poses/);
});

test('a key is found among many', () => {
  const keys = Array.from({ length: 1000 }, (_, i) => ({ time: i * i, turn: [0, 0, 0, 1], scale: 1, translation: [i, 0, 0] }));
  for (const time of [-1, 0, 0.5, 1, 8, 9, 10, 998 * 998, 999 * 999, 1e9]) {
    const last = Math.max(0, keys.findLastIndex((key) => key.time <= time));
    assert.equal(routeAt({ keys, jumps: true }, time).translation[0], last, `at ${time}`);
  }
});

test('an invalid file of poses is refused with the line number', async () => {
  await assert.rejects(read(SCENE, 'time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,a,0,0,0,0,1\n'), /steps\.csv: line 3/);
  await assert.rejects(read(SCENE, 'time,x,y,z\n'), /line 1/);
});

test('addresses name models and poses', async () => {
  const requested = await wanted(new URLSearchParams('model=a/x.ebpo.h5&model=b/x.ebpo.h5&pose=1,2,3&pose=0,0,0,0,0,2,0,4&model=a/x.ebpo.h5&up=z'), 'https://example.org/v/');
  assert.deepEqual(requested.models.map((m) => [m.name, m.file]), [['x', 'https://example.org/v/a/x.ebpo.h5'], ['x (2)', 'https://example.org/v/b/x.ebpo.h5']]);
  assert.deepEqual(requested.instances.map((i) => [i.name, i.model]), [['x', 0], ['x (2)', 1], ['x (3)', 0]]);
  assert.deepEqual([requested.up, requested.instances[0].pose.translation, requested.instances[1].pose.scale], [2, [1, 2, 3], 4]);
  near(requested.instances[1].pose.rotation, [-1, 0, 0, 0, -1, 0, 0, 0, 1]);
  assert.equal(await wanted(new URLSearchParams('file=x'), 'https://example.org/'), undefined);
  await assert.rejects(async () => wanted(new URLSearchParams('model=x&pose=1,2'), 'https://example.org/'), /pose=1,2/);
  for (const bad of ['model=javascript:alert(1)', 'model=http://[', 'scene=data:,x', 'scene=file:///s.json', new URLSearchParams(Array.from({ length: 101 }, () => ['model', 'x']))])
    await assert.rejects(async () => wanted(new URLSearchParams(bad), 'https://example.org/'), /not an address of a file|at most 100/);
  const get = async (url) => new Response(url.pathname.endsWith('.csv') ? CSV : JSON.stringify(SCENE));
  const scene = await wanted(new URLSearchParams('scene=p/plant.scene.json'), 'https://example.org/v/', get);
  assert.deepEqual([scene.title, scene.up, scene.models[1].file], ['Two', 2, 'https://example.org/v/p/parts/arm.ebpo.h5']);
  const far = structuredClone(SCENE);
  far.models.wall = { file: 'https://elsewhere.example/x.ebpo.h5', content_sha256: '0'.repeat(64) };
  const getFar = async (url) => (url.pathname.endsWith('.csv') ? get(url) : new Response(JSON.stringify(far)));
  await assert.rejects(wanted(new URLSearchParams('scene=p/s.scene.json'), 'https://example.org/', getFar), /another server/);
  assert.ok(await wanted(new URLSearchParams('scene=p/s.scene.json&remote=1'), 'https://example.org/', getFar));
  let sent = 0;
  const endless = async () => new Response(new ReadableStream({ pull: (c) => c.enqueue(new Uint8Array(sent++ < 1000 ? 1 << 20 : 0)) }));
  await assert.rejects(wanted(new URLSearchParams('scene=p/s.scene.json'), 'https://example.org/', endless), /larger than 64 MiB/);
  assert.ok(sent < 70, `${sent} MiB were read`);
});

test('larger models get more triangles, and unused triangles go to other models', () => {
  assert.deepEqual(sharesOf(1e6, [{ weight: 1, copies: 1, faces: 1e9 }, { weight: 3, copies: 1, faces: 1e9 }]), [250000, 750000]);
  assert.deepEqual(sharesOf(1e6, [{ weight: 3, copies: 1, faces: 100000 }, { weight: 1, copies: 3, faces: 1e9 }, { weight: 0, copies: 0, faces: 1e9 }]), [100000, 300000, 500]);
  const total = [[5, 2, 1000], [1, 10, 7000], [2, 1, 1e6]].map(([weight, copies, faces]) => ({ weight, copies, faces }));
  assert.ok(sharesOf(200000, total).reduce((sum, share, i) => sum + share * total[i].copies, 0) <= 200000);
  const view = { eye: [0, 0, 10], planes: [[1, 0, 0, 5]], pixels: 500 };
  assert.equal(weightOf(view), 2500);
  assert.equal(weightOf({ ...view, planes: [[1, 0, 0, -1.5]] }), 0);
});

// Compares the poses of instances with those of the library.
test('poses of instances agree with ebpo scene', { skip: process.env.EBPO_TOOL ? false : 'EBPO_TOOL is not set' }, async (t) => {
  const folder = mkdtempSync(join(tmpdir(), 'ebpo-scene-')), model = process.env.EBPO_FILES.split(' ').find((name) => name.endsWith('/ring.ebpo.h5')), scene = structuredClone(SCENE);
  t.after(() => rmSync(folder, { recursive: true, force: true }));
  copyFileSync(model, join(folder, 'ring.ebpo.h5'));
  writeFileSync(join(folder, 'steps.csv'), CSV);
  scene.models = { wall: { file: 'ring.ebpo.h5' }, arm: { file: 'ring.ebpo.h5' } };
  writeFileSync(join(folder, 's.scene.json'), JSON.stringify(scene));
  const { vertices } = await (await open(readFileSync(model))).mesh();
  const mine = await read(scene);
  for (const time of [0, 0.7, 1.9, 4.2]) {
    const { boxes } = JSON.parse(execFileSync(process.env.EBPO_TOOL, ['scene', 'boxes', '--json', '--from', String(time), '--to', String(time), join(folder, 's.scene.json')], { encoding: 'utf8' }));
    assert.equal(boxes.length, mine.instances.length);
    boxes.forEach((theirs, i) => {
      const pose = poseAt(mine.instances[i], time), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let v = 0; v < vertices.length; v += 3)
        placed(pose, vertices.subarray(v, v + 3)).forEach((x, k) => {
          low[k] = Math.min(low[k], x);
          high[k] = Math.max(high[k], x);
        });
      const { min, max } = theirs, slack = 1e-6 * Math.hypot(...max), size = Math.hypot(...max.map((x, k) => x - min[k]));
      assert.equal(theirs.instance, mine.instances[i].name);
      assert.ok(low.every((x, k) => x >= min[k] - slack && x <= min[k] + size / 4) && high.every((x, k) => x <= max[k] + slack && x >= max[k] - size / 4), `${theirs.instance} at ${time}`);
    });
  }
});
