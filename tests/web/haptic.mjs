// Shows and paints with haptic devices in a headless Chromium: haptic.mjs EBPO GENERATE SOURCE_ROOT
// A recorded device writes a letter, which must be in the picture, in the file and in the baked mesh; also in a scene. Then the mouse of the page is the device.
// Exits with 77 (skipped) when Chromium or the viewer's packages are not installed; tools/install-deps.sh --tests installs them.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { TIMEOUT, begin, idle } from './live_page.mjs';

const [ebpo, generate, root] = process.argv.slice(2), viewer = join(root, 'tools/web'), { launch, deviceOn } = await begin(ebpo, root);
const { readPaint } = await import(pathToFileURL(join(viewer, 'paint/paint_file.js')));
const work = mkdtempSync(join(tmpdir(), 'ebpo-haptic-')), page = join(work, 'viewer');
const run = (program, ...args) => execFileSync(program, args, { encoding: 'utf8' });
const at = (name) => join(work, name), model = at('ball.ebpo.h5'), device = (...options) => deviceOn(page, model, ...options);

const strokesOf = (name) => readPaint(new Uint8Array(readFileSync(at(name)))).strokes;
const bare = (strokes) => strokes.map(({ points, ...s }) => ({ ...s, points: points.map(({ face, weights, place, size, pressure, time }) => ({ face, weights, place, size, pressure, time })) }));

// The letter L on the front of a sphere of radius 1, down and to the right.
const LETTER = [[-0.3, 0.4], [-0.3, -0.3], [0.25, -0.3]], RADIUS = 0.05, COLOUR = [0, 160, 60];
function letter() {
  const lines = [], put = (x, y, height) => lines.push(`${x} ${y} ${Math.sqrt(1 - x * x - y * y) + height}`);
  for (let i = 0; i < 400; i++)
    put(...LETTER[0], 0.3 - 0.32 * i / 400);
  for (let k = 0; k < 2; k++)
    for (let i = 0; i < 800; i++)
      put(...[0, 1].map((c) => LETTER[k][c] + (LETTER[k + 1][c] - LETTER[k][c]) * i / 800), -0.02);
  for (let i = 0; i < 200; i++)
    put(...LETTER[2], -0.02 + 0.3 * i / 200);
  return lines.join('\n');
}
const onLetter = ([x, y]) => Math.min(...[0, 1].map((k) => {
  const [a, b] = [LETTER[k], LETTER[k + 1]], d = [b[0] - a[0], b[1] - a[1]], t = Math.max(0, Math.min(1, ((x - a[0]) * d[0] + (y - a[1]) * d[1]) / (d[0] ** 2 + d[1] ** 2)));
  return Math.hypot(x - a[0] - t * d[0], y - a[1] - t * d[1]);
}));

// Returns for points of the model whether the picture has the colour of the paint there.
const painted = (tab, points) => tab.evaluate(async (all) => {
  const { scene, place: { center, scale } } = window.ebpoViewer;
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const copy = document.createElement('canvas'), { canvas } = scene, box = canvas.getBoundingClientRect();
  Object.assign(copy, { width: canvas.width, height: canvas.height });
  const context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  return all.map((p) => {
    const [x, y] = scene.project(p.map((v, k) => (v - center[k]) * scale));
    const [r, g, b] = context.getImageData(Math.round(x * canvas.width / box.width), Math.round(y * canvas.height / box.height), 1, 1).data;
    return g > 1.3 * r && g > 1.3 * b;
  });
}, points);

async function testRecording(tab) {
  writeFileSync(at('letter.txt'), letter());
  const haptic = await device('--path', at('letter.txt'), '--paint', at('letter.paint.h5'), '--pen-radius', String(RADIUS), '--full-force', '4', '--colour', '00a03c');
  await tab.goto(`${haptic.address}?file=models/0/ball.ebpo.h5&live=live&view=0,0,2.6`);
  await idle(tab);
  const programs = () => tab.evaluate(() => window.ebpoViewer.scene.renderer.info.programs.length), compiled = await programs();
  await tab.waitForFunction(() => window.ebpoViewer.live.ended, undefined, TIMEOUT);
  assert.equal(await programs(), compiled, 'a shader was compiled only when the device painted');
  const { code, report, err } = await haptic.ended;
  assert.equal(code, 0, err);
  assert.ok(!err.includes('has left'), err);
  const file = strokesOf('letter.paint.h5');
  assert.equal(report.paint.strokes, 1);
  assert.equal(report.paint.points, file[0].points.length);
  assert.deepEqual(bare(await tab.evaluate(() => window.ebpoViewer.paint.file.strokes)), bare(file), 'the page has the strokes of the file');
  // The picture shows the letter, and nothing beside it.
  const grid = [];
  for (let x = -0.6; x <= 0.6; x += 0.05)
    for (let y = -0.6; y <= 0.6; y += 0.05)
      grid.push([x, y, Math.sqrt(1 - x * x - y * y)]);
  const shows = await painted(tab, grid);
  grid.forEach((p, i) => {
    const far = onLetter(p);
    if (far < 0.6 * RADIUS)
      assert.ok(shows[i], `no paint at ${p}`);
    if (far > 1.6 * RADIUS)
      assert.ok(!shows[i], `paint at ${p}`);
  });
  // The baked mesh has the colour at the same vertices as the points of the stroke cover.
  run(ebpo, 'paint', '-q', at('letter.paint.h5'), model, '--bake', at('baked.ply'));
  const lines = readVertices(at('baked.ply'));
  let coloured = 0;
  for (const { place, colour } of lines) {
    const covered = file[0].points.some((p) => Math.hypot(...p.place.map((v, k) => v - place[k])) <= RADIUS * p.size / 32768);
    assert.equal(COLOUR.every((c, k) => c === colour[k]), covered, `vertex at ${place}`);
    coloured += covered;
  }
  assert.ok(coloured > 20, `${coloured} coloured vertices`);
  const delays = await tab.evaluate(() => window.ebpoViewer.live.delays);
  assert.equal(delays.length, 1, 'one contact');
  return delays[0];
}

// A scene of two spheres and of a box, whose left side is beside the letter: the letter is on both spheres, as they share their paint, and not on the box.
// `late`: the file of the spheres cannot be read until the letter is complete; then the device hovers.
async function testScene(tab, paints, late) {
  const pose = { translation: [0.9, 0.9, 0.5], scale: 0.25, quaternion: [0, 0, 1, 1] }, side = at('side.json'), folder = at(paints), source = '**/ball.ebpo.h5*';
  const box = { translation: [-0.28, 0, 0.8], scale: 0.4 };
  writeFileSync(side, JSON.stringify({ ebpo_scene: '1.0', models: { ball: { file: 'ball.ebpo.h5' }, box: { file: 'box.ebpo.h5' } }, cameras: [{ name: 'front', eye: [0, 0, 9],
    target: [0, 0, 0], up: [0, 1, 0] }], instances: [{ name: 'one', model: 'ball' }, { name: 'box', model: 'box', pose: box }, { name: 'two', model: 'ball', pose }] }));
  const lines = letter().split('\n'), hover = Array(late ? 6000 : 0).fill(lines.at(-1));
  writeFileSync(at('scene.txt'), [...lines, ...hover].join('\n'));
  const haptic = await deviceOn(page, side, '--path', at('scene.txt'), '--paint', folder, '--pen-radius', String(RADIUS), '--full-force', '4', '--colour', '00a03c');
  if (late)
    await tab.route(source, (route) => route.abort());
  await tab.goto(`${haptic.address}?scene=scene.json&live=live&view=-40,0,1.7`);
  await idle(tab);
  const programs = () => tab.evaluate(() => window.ebpoViewer.scene.renderer.info.programs.length), compiled = await programs();
  if (late) {
    await tab.waitForFunction(() => window.ebpoViewer.paint.files.ball?.strokes[0]?.points.length > 40, undefined, TIMEOUT);
    await tab.unroute(source);
    await tab.click('#errorRetry');
  }
  await tab.waitForFunction(() => window.ebpoViewer.live.ended, undefined, TIMEOUT);
  if (!late)
    assert.equal(await programs(), compiled, 'a shader was compiled only when the device painted');
  const { code, report, err } = await haptic.ended, file = strokesOf(`${paints}/ball.paint.h5`);
  assert.equal(code, 0, err);
  assert.deepEqual([report.paint.strokes, file.length, strokesOf(`${paints}/box.paint.h5`).length], [1, 1, 0]);
  const shown = await tab.evaluate(() => window.ebpoViewer.paint.files);
  assert.deepEqual(Object.keys(shown).sort(), ['ball', 'box']);
  assert.deepEqual([bare(shown.ball.strokes), shown.box.strokes], [bare(file), []]);
  const down = (t) => { // on the letter's first line, which the box does not hide
    const x = LETTER[0][0], y = 0.35 - 0.6 * t;
    return [x, y, Math.sqrt(1 - x * x - y * y)];
  };
  const all = [0, 1 / 3, 2 / 3, 1].map(down), turned = ([x, y, z]) => [0.9 - 0.25 * y, 0.9 + 0.25 * x, 0.5 + 0.25 * z];
  // Points on the box, within the balls of points of the letter, so that only the faces of these points decide.
  const beside = file[0].points.filter(({ place: [x, y] }) => Math.abs(x + 0.3) < 0.03 && y > 0.05 && y < 0.3).map(({ place: [x, y, z] }) => ({ from: x, at: [-0.28, y, z + 0.036] }))
    .filter(({ from }) => Math.hypot(from + 0.28, 0.036) < 0.9 * RADIUS).map((one) => one.at);
  assert.ok(beside.length > 5, `${beside.length} points`);
  assert.deepEqual(await painted(tab, [...all, ...all.map(turned)]), Array(8).fill(true));
  assert.deepEqual(await painted(tab, [...beside, [-0.6, 0, 0.8]]), Array(beside.length + 1).fill(false));
  const delays = await tab.evaluate(() => window.ebpoViewer.live.delays);
  assert.equal(delays.length, 1, 'one contact');
}

// Reads the vertices of a PLY file: float or double coordinates and colours, little-endian.
function readVertices(name) {
  const bytes = readFileSync(name), end = bytes.indexOf('end_header\n') + 11, head = bytes.subarray(0, end).toString(), count = Number(/element vertex (\d+)/.exec(head)[1]);
  const properties = [...head.split('element face')[0].matchAll(/property (\w+) (\w+)/g)].map(([, type, key]) => ({ type, key }));
  const size = { float: 4, float32: 4, double: 8, float64: 8, uchar: 1, uint8: 1 };
  if (head.includes('format ascii'))
    return bytes.subarray(end).toString().split('\n').slice(0, count).map((l) => l.split(' ').map(Number)).map((v) => ({ place: v.slice(0, 3), colour: v.slice(-3) }));
  let offset = end;
  return Array.from({ length: count }, () => {
    const v = {};
    for (const { type, key } of properties) {
      v[key] = size[type] === 8 ? bytes.readDoubleLE(offset) : size[type] === 4 ? bytes.readFloatLE(offset) : bytes[offset];
      offset += size[type];
    }
    return { place: [v.x, v.y, v.z], colour: [v.red, v.green, v.blue] };
  });
}

async function testMouse(tab) {
  const haptic = await device('--device', 'viewer', '--seconds', '600', '--paint', at('mouse.paint.h5'), '--pen-radius', '0.04', '--colour', '00a03c');
  await tab.goto(`${haptic.address}?file=models/0/ball.ebpo.h5&live=live&view=0,0,2.6`);
  await idle(tab);
  await tab.waitForSelector('#liveTouch:not([hidden])', { state: 'attached' });
  // Messages of other pages, and invalid ones, are refused.
  const post = async (path, body, headers) => (await fetch(haptic.address + path, { method: 'POST', body, headers })).status;
  const own = { Origin: haptic.address.slice(0, -1) };
  assert.equal(await post('device', 'press 0 0 2', {}), 403);
  assert.equal(await post('device', 'press 0 0 2', { Origin: 'http://example.org' }), 403);
  assert.equal(await post('device', 'press 0 0 2', { Origin: 'null' }), 403);
  for (const wrong of ['press nan 0 0', 'press 0 0', 'press 1e300 0 0', 'press 0 0 0 0 0 0 0', '', 'press', 'hover ', '0 0 2', 'hover 0 0 inf'])
    assert.equal(await post('device', wrong, own), 400, wrong);
  assert.equal(await post('pen', 'layer 7', own), 400);
  assert.equal(await post('pen', 'colour 12', own), 400);
  assert.equal(await post('other', '1', own), 404);
  assert.equal(await post('pen', 'x'.repeat(2000), own), 400);

  const click = (id) => tab.evaluate((name) => document.getElementById(name).click(), id); // the panel is closed in a small window
  await click('liveTouch');
  const canvas = await tab.locator('#canvas').boundingBox(), centre = await tab.evaluate(() => window.ebpoViewer.scene.project([0, 0, 0]));
  const to = (x, y) => tab.mouse.move(canvas.x + centre[0] + x, canvas.y + centre[1] + y, { steps: 6 });
  const stroke = async (y) => {
    await to(-60, y); // hovers, and does not paint, although the straight way goes through the sphere
    await tab.waitForTimeout(300);
    await tab.mouse.down();
    await to(60, y);
    await tab.mouse.up();
    await to(60, y + 4);
    await tab.waitForTimeout(300);
  };
  const count = (n) => tab.waitForFunction((wanted) => window.ebpoViewer.paint.file.strokes.length === wanted, n, TIMEOUT);
  await to(-60, -40);
  await tab.waitForFunction(() => window.ebpoViewer.live.steps > 0, undefined, TIMEOUT);
  await stroke(-40);
  await count(1);
  await stroke(0);
  await count(2);
  await click('penUndo');
  await count(1);
  await click('layerAdd');
  await tab.waitForFunction(() => window.ebpoViewer.paint.file.layers.length === 2, undefined, TIMEOUT);
  await click('eraserOn');
  await stroke(40);
  await count(2);
  const shown = await tab.evaluate(() => window.ebpoViewer.paint.file.strokes);
  haptic.stop();
  const { code, err } = await haptic.ended;
  assert.equal(code, 0, err);
  const file = strokesOf('mouse.paint.h5');
  assert.deepEqual(file.map(({ layer, erases }) => [layer, erases]), [[0, false], [1, true]]);
  assert.deepEqual(bare(shown), bare(file));
  assert.ok(file[0].points.length > 5, `${file[0].points.length} points`);
  for (const { place } of file[0].points) // the generated sphere is rough
    assert.ok(Math.abs(Math.hypot(...place) - 1) < 0.05, `a point at ${place}`);
}

async function testLostPage(tab) {
  const haptic = await device('--seconds', '600');
  await tab.goto(haptic.address);
  await tab.waitForFunction(() => window.ebpoViewer?.live?.steps > 0, undefined, TIMEOUT);
  const steps = await tab.evaluate(() => window.ebpoViewer.live.steps);
  await tab.goto('about:blank');
  for (let i = 0; i < 1200 && !haptic.err.includes('has left'); i++)
    await new Promise((done) => setTimeout(done, 100));
  assert.match(haptic.err, /a page of the viewer has left; the device continues/);
  await tab.goto(haptic.address); // the device still moves
  await tab.waitForFunction(() => window.ebpoViewer?.live?.steps > 10, undefined, TIMEOUT);
  haptic.stop();
  const { code, err, report } = await haptic.ended;
  assert.equal(code, 0, err);
  assert.ok(report.haptic.steps > steps);
}

run('node', join(viewer, 'bundle.mjs'), page);
run(generate, '--base', 'sphere', '--faces', '5000', at('ball.ply'));
run(ebpo, 'convert', '-q', at('ball.ply'), model);
writeFileSync(at('box.obj'), [...[0, 1, 2, 3, 4, 5, 6, 7].map((i) => `v ${i & 1} ${i >> 1 & 1} ${i >> 2}\n`),
  ...['1 3 4 2', '5 6 8 7', '1 2 6 5', '3 7 8 4', '1 5 7 3', '2 4 8 6'].map((f) => `f ${f}\n`)].join(''));
run(ebpo, 'convert', '-q', at('box.obj'), at('box.ebpo.h5'));
const browser = await launch();
try {
  const tab = await browser.newPage({ viewport: { width: 480, height: 360 } }), complaints = [];
  tab.on('pageerror', (e) => complaints.push(e.stack));
  const delay = await testRecording(tab);
  await testScene(tab, 'paints', false);
  await testScene(tab, 'late', true);
  await testMouse(tab);
  await testLostPage(tab);
  assert.deepEqual(complaints, []);
  console.log(`OK: a recording, scenes, the mouse, a lost page; ${Math.round(delay)} ms from contact to drawing`);
} finally {
  await browser.close();
  rmSync(work, { recursive: true, force: true });
}
