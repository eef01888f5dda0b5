// Tests the viewer in a headless Chromium, with files served by nginx: viewer.mjs EBPO GENERATE SOURCE_ROOT
// Exits with 77 (skipped) when Chromium, nginx or the viewer's packages are not installed; tools/install-deps.sh --tests installs them.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, symlinkSync, utimesSync, writeFileSync } from 'node:fs';
import { createServer as createHttp, request as send } from 'node:http';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [ebpo, generate, root] = process.argv.slice(2), viewer = join(root, 'tools/web');
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
const nginx = ['/usr/sbin/nginx', '/usr/bin/nginx'].some(existsSync);
if (!chromium || !nginx || !existsSync(join(viewer, 'node_modules/playwright-core')) ) {
  console.log('skipped: chromium, nginx or tools/web/node_modules is missing; run tools/install-deps.sh --tests');
  process.exit(77);
}
const load = (path) => import(pathToFileURL(join(viewer, path)));
const { chromium: playwright } = await load('node_modules/playwright-core/index.mjs');
const { open } = await load('ebpo/index.js');
const { cutFaces, measureOf } = await load('queries.js'), { plates } = await load('test/plates.js'), { readPaint } = await load('paint/paint_file.js');

const work = mkdtempSync(join(tmpdir(), 'ebpo-viewer-')), models = join(work, 'models'), log = join(work, 'access.log'), model = join(models, 'ring.ebpo.h5');
const run = (program, args, input, env) => execFileSync(program, args, { encoding: 'utf8', input, env, stdio: ['pipe', 'pipe', 'pipe'], maxBuffer: 1 << 26 });
const SIZE = { width: 800, height: 600 };
const PATIENCE_MS = 120000; // for the page's reactions, also on a busy machine
const cleanup = [() => rmSync(work, { recursive: true, force: true })];

// --- the model, the server, the browser ---

function makeModels() {
  mkdirSync(models);
  run(generate, ['--base', 'torus', '--faces', '40000', join(work, 'ring.ply')]);
  run(ebpo, ['convert', '-q', '--profile', 'full', join(work, 'ring.ply'), model]);
  run(generate, ['--base', 'torus', '--faces', '10000', join(work, 'other.ply')]);
  copyFileSync(model, join(models, 'small.ebpo.h5'));
  run(generate, ['--base', 'torus', '--faces', '280000', join(work, 'large.ply')]);
  run(ebpo, ['convert', '-q', '--parts=+surface', join(work, 'large.ply'), join(models, 'large.ebpo.h5')]);
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((v) => `${v & 1} ${v >> 1 & 1} ${v >> 2}`), sides = ['0 2 3 1', '4 5 7 6', '0 1 5 4', '2 6 7 3', '0 4 6 2', '1 3 7 5'];
  writeFileSync(join(work, 'red.ply'), `ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement face 6\n` +
    `property list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n${corners.join('\n')}\n${sides.map((s) => `4 ${s} 255 0 0\n`).join('')}`);
  run(ebpo, ['convert', '-q', join(work, 'red.ply'), join(models, 'red.ebpo.h5')]);
  run(ebpo, ['boolean', 'A - B', join(models, 'red.ebpo.h5'), join(models, 'red.ebpo.h5'), '--pose', 'B 0.4 0.4 0.4', '--operand-colours', '-o', join(models, 'notch.ebpo.h5')]);
  const damaged = Buffer.from(readFileSync(model));
  damaged[damaged.length >> 1] ^= 1;
  writeFileSync(join(models, 'damaged.ebpo.h5'), damaged);
  const at = (name) => join(models, name);
  copyFileSync(join(work, 'red.ply'), at('mesh.ebpo.h5'));
  writeFileSync(join(work, 'open.off'), `OFF\n8 5 0\n${corners.join('\n')}\n${sides.slice(0, 5).map((s) => `4 ${s}\n`).join('')}`);
  run(ebpo, ['convert', '-q', join(work, 'open.off'), at('open.ebpo.h5')]);
  plates(join(work, 'plates.ply'));
  run(ebpo, ['convert', '-q', join(work, 'plates.ply'), at('plates.ebpo.h5')]);
  run(ebpo, ['paint', at('plates.paint.h5'), at('plates.ebpo.h5'), '--new-layer', 'x', '--colour', 'ff0000', '--path', '-', '--radius', '0.4'], '-0.2 0.5 0.05\n');
  writeFileSync(at('move.scene.json'), JSON.stringify({ ebpo_scene: '1.0', title: 'Moving', models: { red: { file: 'red.ebpo.h5' } }, routes: { up: { keys: [{ time: 0, pose: {} },
    { time: 4, pose: { translation: [0, 0, 8] } }] } }, instances: [0, 3, 6].map((x) => ({ name: `cube ${x}`, model: 'red', pose: { translation: [x, 0, 0] }, ...(x === 3 && { route: 'up' }) })) }));
}

async function serve(...options) {
  const port = await new Promise((done) => {
    const probe = createServer().listen(0, '127.0.0.1', () => {
      const { port: free } = probe.address();
      probe.close(() => done(free));
    });
  });
  const server = spawn('sh', [join(root, 'samples/serve.sh'), '--port', String(port), '--folder', models, '--log', log, ...options], { stdio: 'inherit' });
  cleanup.push(() => new Promise((done) => server.once('exit', done).kill('SIGTERM')));
  const address = `http://localhost:${port}/`;
  for (let i = 0; i < 600; i++) { // up to a minute on a busy machine
    if (await fetch(address).then((r) => r.ok, () => false))
      return address;
    await new Promise((done) => setTimeout(done, 100));
  }
  throw new Error('nginx did not come up');
}

async function browse() {
  const flags = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
  const browser = await playwright.launch({ executablePath: chromium, args: process.getuid() === 0 ? ['--no-sandbox', ...flags] : flags });
  cleanup.push(() => browser.close());
  return browser;
}

const complaints = [];
async function show(browser, address) {
  const page = await browser.newPage({ viewport: SIZE, colorScheme: 'dark', reducedMotion: 'reduce' });
  page.setDefaultTimeout(PATIENCE_MS);
  page.on('pageerror', (e) => complaints.push(e.message));
  page.on('console', (m) => ['error', 'warning'].includes(m.type()) && !/GPU stall|WebGL-0x/.test(m.text()) && complaints.push(m.text()));
  await page.goto(address, { waitUntil: 'commit' });
  return page;
}

const stateOf = (page) => page.evaluate(() => window.ebpoViewer?.state);
async function settled(page) {
  await page.waitForFunction(() => window.ebpoViewer?.state.idle || window.ebpoViewer?.state.error, undefined, { timeout: PATIENCE_MS, polling: 100 });
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  return stateOf(page);
}

// --- results of the library ---

const levels = () => JSON.parse(run(ebpo, ['levels', '--json', model])).levels;
function triangles(level, ...options) {
  run(ebpo, ['extract', '-q', '--level', String(level), ...options, model, join(work, 'out.ply')]);
  return Number(/element face (\d+)/.exec(readFileSync(join(work, 'out.ply'), 'latin1').slice(0, 2000))[1]);
}
const sum = (list, what) => list.reduce((total, item) => total + what(item), 0);

// Returns the sizes in bytes of the requests for the model since the last call, from nginx's log.
let logged = 0;
function requests(name = 'ring') {
  const lines = readFileSync(log, 'utf8').split('\n').filter((line) => line.includes(`/models/${name}.ebpo.h5`)), fresh = lines.slice(logged);
  logged = lines.length;
  return fresh.map((line) => {
    const [, status, bytes] = /" (\d+) (\d+) "/.exec(line);
    assert.ok(['206', '304'].includes(status), line);
    return status === '206' ? Number(bytes) : 0;
  });
}

// Returns the bounds of the model's vertices on the page: [left, top, right, bottom].
async function silhouette(page) {
  const { vertices } = await (await open(readFileSync(model))).mesh();
  const { matrix, center, scale } = await page.evaluate(() => {
    const { camera } = window.ebpoViewer.scene;
    camera.updateMatrixWorld();
    return { matrix: camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements, ...window.ebpoViewer.place };
  });
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < vertices.length; i += 3) {
    const p = [0, 1, 2].map((k) => (vertices[i + k] - center[k]) * scale), row = (r) => matrix[r] * p[0] + matrix[r + 4] * p[1] + matrix[r + 8] * p[2] + matrix[r + 12];
    const x = (row(0) / row(3) + 1) / 2 * SIZE.width, y = (1 - row(1) / row(3)) / 2 * SIZE.height;
    box[0] = Math.min(box[0], x);
    box[1] = Math.min(box[1], y);
    box[2] = Math.max(box[2], x);
    box[3] = Math.max(box[3], y);
  }
  return box;
}

// Compares screenshots with and without the model, both without panels. Returns the bounds of the differing pixels, their share of the page, their mean colour,
// the number of their colours, and the share of orange ones among them. The page decodes the PNG.
async function look(page, hidden = '#panel, #bar, #tools, #progress, #compass, #scale { visibility: hidden; }') {
  const hide = await page.addStyleTag({ content: hidden });
  const shot = async () => (await page.screenshot()).toString('base64');
  const withModel = await shot(), stage = await page.addStyleTag({ content: '#canvas { visibility: hidden; }' }), without = await shot();
  await stage.evaluate((node) => node.remove());
  await hide.evaluate((node) => node.remove());
  return page.evaluate(async (pictures) => {
    const [a, b] = await Promise.all(pictures.map(async (png) => {
      const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + png)).blob());
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    }));
    const box = [Infinity, Infinity, -Infinity, -Infinity], colour = [0, 0, 0], shades = new Set();
    let count = 0, orange = 0;
    for (let i = 0; i < a.data.length; i += 4) {
      const difference = Math.abs(a.data[i] - b.data[i]) + Math.abs(a.data[i + 1] - b.data[i + 1]) + Math.abs(a.data[i + 2] - b.data[i + 2]);
      if (difference < 24)
        continue;
      const x = i / 4 % a.width, y = Math.floor(i / 4 / a.width);
      box[0] = Math.min(box[0], x);
      box[1] = Math.min(box[1], y);
      box[2] = Math.max(box[2], x + 1);
      box[3] = Math.max(box[3], y + 1);
      count++;
      orange += a.data[i] > 2 * a.data[i + 2];
      for (let k = 0; k < 3; k++)
        colour[k] += a.data[i + k];
      shades.add(a.data[i] << 16 | a.data[i + 1] << 8 | a.data[i + 2]);
    }
    return { box, share: count / (a.width * a.height), colour: colour.map((c) => c / count), shades: shades.size, orange: orange / count };
  }, [withModel, without]);
}

function checkBox(found, wanted, outside, inside) {
  const out = [wanted[0] - found[0], wanted[1] - found[1], found[2] - wanted[2], found[3] - wanted[3]];
  assert.ok(out.every((d) => d <= outside && d >= -inside), `seen at ${found.map(Math.round)}, expected at ${wanted.map(Math.round)}`);
}

// --- the tests ---

async function levelFour(page) {
  const state = await settled(page), bytes = requests();
  assert.equal(state.depth, 4);
  assert.ok(bytes.length <= 2 && sum(bytes, (b) => b) <= 150 * 1024, `levels 0 to 4 took ${bytes}`);
  assert.deepEqual([state.traffic.requests, state.traffic.bytes], [bytes.length, sum(bytes, (b) => b)]);
}

async function levelFive(page) {
  await page.keyboard.press('ArrowRight');
  const state = await settled(page), table = levels().slice(0, 6), black = sum(table, (l) => l.black);
  assert.ok(state.depth >= 5);
  assert.ok(requests().length <= 2);
  assert.equal(state.stats.nodes, table[5].gray + sum(table, (l) => l.leaf));
  const planes = triangles(5, '--no-cell-faces'), all = triangles(5);
  assert.equal(state.stats.triangles - state.stats.cellFaceTriangles, planes);
  const { cellFaceTriangles } = state.stats, cellFaces = all - 12 * black - planes;
  assert.ok(cellFaceTriangles > 0 && cellFaceTriangles < 0.4 * cellFaces, `hidden cell faces must not be drawn: ${cellFaceTriangles} of ${cellFaces}`);
  await page.keyboard.press('x'); // a section shows all cell faces and black cells
  assert.equal((await settled(page)).stats.triangles, all);
  for (let i = 0; i < 3; i++)
    await page.keyboard.press('x');
  await settled(page);
  const { box, share, colour, shades } = await look(page);
  assert.ok(share > 0.08 && shades > 300, `a picture: ${share} of the page in ${shades} colours`);
  checkBox(box, await silhouette(page), 3, 1); // envelopes contain the model, and little more
  assert.ok(Math.max(...colour) - Math.min(...colour) < 30, `plain: ${colour}`);
}

async function colours(page) {
  await page.keyboard.press('k'); // by level
  const level = await look(page);
  assert.ok(level.colour[1] > level.colour[0] + 30, `level 5 is blue-green: ${level.colour}`);
  await page.keyboard.press('k'); // by type
}

async function mesh(page) {
  for (let i = 0; i < 6; i++)
    await page.keyboard.press('ArrowRight');
  const state = await settled(page), table = levels(), { info } = await open(readFileSync(model));
  assert.equal(state.stats.meshTriangles, info.faces); // each once
  assert.equal(state.stats.triangles, state.stats.meshTriangles);
  assert.equal(state.stats.nodes, sum(table, (l) => l.leaf));
  const { box, colour } = await look(page);
  checkBox(box, await silhouette(page), 1, 1);
  assert.ok(colour[0] > colour[2] + 25, `real faces are tan: ${colour}`);
}

async function clipping(page) {
  const before = await look(page);
  await page.keyboard.press('x');
  await settled(page);
  const { share } = await look(page);
  assert.ok(share < before.share * 0.85, `half of the ring is cut away: ${share} of ${before.share}`);
  await page.keyboard.press('x');
  await page.keyboard.press('x');
  await page.keyboard.press('x');
  await settled(page);
}

async function point(page) {
  const { info } = await open(readFileSync(model)), at = info.origin.map((o, k) => o + info.size[k] * [0.08, 0.45, 0.5][k]);
  for (const p of [at, info.origin.map((o, k) => o + info.size[k] / 2)]) {
    await page.evaluate((x) => window.ebpoViewer.probeAt(x), p);
    await page.waitForFunction(() => window.ebpoViewer.state.probe?.exact, undefined, { timeout: PATIENCE_MS });
    const { probe } = await stateOf(page), line = p.join(' ') + '\n';
    assert.equal(probe.where.toUpperCase(), JSON.parse(run(ebpo, ['inside', '--json', model], line)).where);
    const { distance } = JSON.parse(run(ebpo, ['distance', '--json', '--unsigned', model], line));
    assert.ok(Math.abs(probe.distance - distance) <= 1e-12 && probe.lo <= distance && distance <= probe.hi, `${probe.distance} ${distance}`);
  }
  assert.match(await page.textContent('#where'), /Inside|Outside/);
}

// Opens a box with red faces. The picture is red while the switch is on; a file without colours has no switch.
async function modelColours(browser, address, plainPage) {
  const page = await show(browser, `${address}?file=models/red.ebpo.h5&detail=0`), colour = async () => (await look(page)).colour;
  await settled(page);
  const [r, g, b] = await colour();
  assert.ok(r > 60 && r > 2 * Math.max(g, b), `${[r, g, b]} is not red`);
  await page.keyboard.press('m');
  const [red, green, blue] = await colour();
  assert.ok(Math.abs(red - green) < 25 && Math.abs(red - blue) < 40, `${[red, green, blue]} is not gray`);
  assert.ok(await page.isVisible('#ownRow') && !await plainPage.isVisible('#ownRow'));
  await page.close();
}

// Opens a box without its corner. Faces of the corner are those of operand B, whose colour is orange; all others have the colour of operand A, which is nearly gray.
async function operandColours(browser, address) {
  const page = await show(browser, `${address}?file=models/notch.ebpo.h5&view=35,30,4&detail=0`);
  await settled(page);
  const { orange } = await look(page);
  assert.ok(orange > 0.15 && orange < 0.6, `${orange} of the picture is orange`);
  await page.keyboard.press('m');
  assert.equal((await look(page)).orange, 0, 'without colours');
  await page.close();
}

async function click(page) {
  const [x0, y0, x1, y1] = (await look(page)).box;
  await page.keyboard.press('Escape');
  await page.mouse.click(x0 + (x1 - x0) * 0.5, y1 - (y1 - y0) * 0.12);
  await page.waitForFunction(() => window.ebpoViewer.state.probe?.exact, undefined, { timeout: PATIENCE_MS });
  assert.ok((await stateOf(page)).probe.distance < 1e-12, 'a click queries a point of the real faces');
}

async function fromDisk(page) {
  await page.keyboard.press('o');
  assert.ok(await page.isVisible('#start'));
  await page.setInputFiles('#file', model);
  await page.waitForFunction(() => window.ebpoViewer.state.depth >= 0, undefined, { timeout: PATIENCE_MS });
  await settled(page);
  assert.equal(await page.textContent('#name'), 'ring.ebpo.h5');
  assert.equal(requests().length, 0);
}

async function errors(browser, address) {
  const quiet = complaints.length;
  for (const [query, expected] of [['file=models/damaged.ebpo.h5&detail=0', /damaged\.ebpo\.h5.*(damaged|checksum)/],
    ['file=models/none.ebpo.h5', /404/],
    ['file=icon.svg', /not a whole HDF5 file|does not serve ranges/],
    ['file=models/mesh.ebpo.h5', /mesh\.ebpo\.h5: this is a mesh file \(PLY\)/]]) {
    const page = await show(browser, `${address}?${query}`);
    await page.waitForSelector('#error:not([hidden])', { timeout: 60000 });
    assert.match(await page.textContent('#errorWhat'), expected);
    assert.ok((await page.textContent('#errorNext')).length > 5);
    await page.close();
  }
  complaints.length = quiet; // the browser logs the 404
}

async function samples(browser, address) {
  const page = await show(browser, `${address}?samples=models/index.json`);
  await page.click('#samples a:has-text("ring")');
  await page.waitForFunction(() => window.ebpoViewer.state.depth >= 0, undefined, { timeout: PATIENCE_MS });
  await page.close();
}

// Delays the page's code until the worker has the model. Neither the request nor the worker waits for the code.
async function modelFirst(browser, address) {
  const context = await browser.newContext({ viewport: SIZE, reducedMotion: 'reduce' });
  const come = new Promise((done) => context.on('requestfinished', (r) => r.url().endsWith('ring.ebpo.h5') && done()));
  await context.route('**/app.js', async (route) => {
    await come;
    await route.continue();
  });
  const page = await context.newPage();
  await page.goto(`${address}?file=models/ring.ebpo.h5&level=4`, { waitUntil: 'commit' });
  assert.ok((await settled(page)).depth >= 4);
  await context.close();
}

// The second half of the page arrives late. The code waits for it, also if no model is requested.
async function pageLate(browser, address) {
  const html = Buffer.from(await (await fetch(address)).text()), { port } = new URL(address);
  const server = createHttp((request, response) => {
    if (!/^\/(\?|$)/.test(request.url))
      return send({ port, path: request.url, headers: request.headers }, (far) => far.pipe(response.writeHead(far.statusCode, far.headers))).end();
    response.writeHead(200, { 'content-type': 'text/html' }).write(html.subarray(0, html.indexOf('<body>')));
    return setTimeout(() => response.end(html.subarray(html.indexOf('<body>'))), 3000);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  for (const query of ['file=models/plates.ebpo.h5', 'model=models/plates.ebpo.h5&model=models/red.ebpo.h5']) {
    const page = await show(browser, `http://localhost:${server.address().port}/?${query}`);
    assert.equal((await settled(page)).error, undefined);
    await page.close();
  }
  server.closeAllConnections();
  server.close();
}

// The page's code fails. The page says so.
async function codeFails(browser, address) {
  const page = await browser.newPage({ viewport: SIZE }), failed = new Promise((done) => page.on('pageerror', done));
  await page.route('**/app.js', (route) => route.abort());
  await page.goto(`${address}?file=models/plates.ebpo.h5`, { waitUntil: 'commit' });
  await failed;
  assert.match(await page.textContent('#openingText'), /The page's code could not be run/);
  assert.ok(await page.isVisible('#openingText'));
  await page.close();
}

// A file below 1 MiB takes one request. The second visit fetches no bytes, unless the file has changed.
async function oneRequest(browser, address) {
  const name = 'small', file = join(models, `${name}.ebpo.h5`), context = await browser.newContext({ viewport: SIZE, reducedMotion: 'reduce' }), ways = [];
  const visit = async (wanted) => {
    const page = await show(context, `${address}?file=models/${name}.ebpo.h5`), state = await settled(page);
    ways.push(requests(name));
    assert.equal(state.error, undefined);
    assert.match(await page.textContent('#facts'), new RegExp(`^${wanted} faces`));
    await page.close();
  };
  logged = 0;
  utimesSync(file, 1e9, 1e9); // an old date, for which a cache may assume that the file is fresh
  await visit('40,140');
  await visit('40,140');
  run(ebpo, ['convert', '-q', join(work, 'other.ply'), file]);
  await visit('(9|10),[0-9]*');
  const sizes = [statSync(model).size, 0, statSync(file).size];
  assert.deepEqual(ways, sizes.map((size) => [size]));
  await context.close();
  logged = 0;
  requests();
}

// Starts a proxy with fault injection: { address, line }. `line.mode` selects the handling of requests for the model: 'good', 'stall' after `line.most` bytes of
// the body, 'dead', or a status. `line.sent`: the delivered ranges [from, to].
async function badLine(address) {
  const line = { mode: 'good', most: 0, sent: [], held: new Set() }, { port } = new URL(address);
  const server = createHttp((request, response) => {
    const isModel = request.url.startsWith('/models/'), mode = isModel ? line.mode : 'good';
    if (mode === 'dead') {
      request.socket.destroy();
    } else if (typeof mode === 'number') {
      response.writeHead(mode);
      response.end();
    } else {
      send({ port, path: request.url, headers: request.headers }, (far) => {
        const begin = Number(/\d+/.exec(far.headers['content-range'] ?? '0')), most = mode === 'stall' ? line.most : Infinity, sent = [begin, begin];
        if (mode === 'stall' && most === 0)
          return;
        if (isModel)
          line.sent.push(sent);
        response.writeHead(far.statusCode, far.headers);
        far.on('data', (data) => {
          const part = data.subarray(0, Math.max(0, most - (sent[1] - begin)));
          sent[1] += part.length;
          response.write(part);
        });
        far.on('end', () => most === Infinity && response.end());
      }).end();
    }
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  cleanup.push(() => server.closeAllConnections() ?? server.close());
  return { address: `http://localhost:${server.address().port}/`, line };
}

// Checks that no byte was delivered twice. `gaps`: number of bytes allowed twice, from gaps between wanted ranges that were wanted later.
function checkOnce(sent, gaps = 0) {
  const sorted = [...sent].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  let twice = 0, end = 0;
  for (const [from, to] of sorted) {
    twice += Math.max(0, Math.min(end, to) - from);
    end = Math.max(end, to);
  }
  assert.ok(twice <= gaps, `nothing is fetched twice: ${JSON.stringify(sorted)}`);
}

// The first response stalls before its first byte and later in its body. The page reports the stall, and Retry fetches the rest.
async function stalls(browser, { address, line }) {
  const quiet = complaints.length;
  for (const most of [0, 200_000]) {
    Object.assign(line, { mode: 'stall', most, sent: [] });
    const page = await show(browser, `${address}?file=models/ring.ebpo.h5`);
    await page.waitForSelector('#stall:not([hidden])', { timeout: 15000 });
    assert.match(await page.textContent('#stallWhat'), /No data for \d+ s/);
    assert.match(await page.textContent('#stallNext'), most ? /Waiting for .*, \d+ kB of \d+ kB\./ : /Waiting for the first levels, 1\.05 MB of 1\.05 MB\./);
    assert.equal(await page.isVisible('#opening'), most === 0); // with more bytes a picture is already visible
    assert.equal(await page.textContent('#openingName'), 'ring.ebpo.h5');
    const percent = Number(await page.getAttribute('#progress', 'aria-valuenow'));
    assert.ok(most ? percent > 20 && percent < 60 : percent === 0, `progress ${percent}`);
    line.mode = 'good';
    await page.click('#stallRetry');
    const state = await settled(page);
    assert.ok(state.stats.meshTriangles > 0 && !state.error);
    assert.ok(await page.isHidden('#stall') && await page.isHidden('#opening'));
    checkOnce(line.sent);
    await page.close();
  }
  complaints.length = quiet;
}

// The connection is lost after the file was opened. No received data is lost, and everything is loaded when the connection is back.
async function dies(browser, { address, line }) {
  const quiet = complaints.length;
  Object.assign(line, { mode: 'good', sent: [] });
  const page = await show(browser, `${address}?file=models/ring.ebpo.h5&level=4&detail=0`);
  await settled(page);
  assert.match(await page.textContent('#sExcess'), /^\+[\d.]+ %$/);
  line.mode = 'dead';
  for (let i = 0; i < 6; i++)
    await page.keyboard.press('ArrowRight');
  await page.waitForSelector('#stall:not([hidden]):has-text("Connection lost")', { timeout: PATIENCE_MS });
  line.mode = 'good';
  await page.click('#stallRetry');
  const state = await settled(page);
  assert.ok(state.stats.meshTriangles > 0 && !state.error && await page.isHidden('#stall'));
  checkOnce(line.sent, 4096);
  await page.close();
  complaints.length = quiet;
}

// The page explains HTTP statuses and offers Retry.
async function statuses(browser, { address, line }) {
  const quiet = complaints.length;
  for (const [status, what, next] of [[403, /403.*does not let this page/, /access/], [404, /404.*no such file/, /address/], [416, /416.*is empty/, /again/], [503, /503/, /later/]]) {
    line.mode = status;
    const page = await show(browser, `${address}?file=models/ring.ebpo.h5&level=3`);
    await page.waitForSelector('#error:not([hidden])', { timeout: PATIENCE_MS });
    assert.match(await page.textContent('#errorWhat'), what);
    assert.match(await page.textContent('#errorNext'), next);
    line.mode = 'good';
    await page.click('#errorRetry');
    await settled(page);
    assert.ok(await page.isHidden('#error'));
    await page.close();
  }
  complaints.length = quiet;
}

// The page shows the view of its address. Changes of the view update the address without adding steps to the history. Opening another file adds a step, and Back
// returns to the previous file.
async function shares(browser, address) {
  const view = '120,30,2.2,0.1,0,-0.05', page = await show(browser,
    `${address}?file=models/ring.ebpo.h5&level=3&view=${view}&clip=-y0.4&box=0,0,0.125,1,1,1&colour=type&point=0.5,0.25,0&measure=1,0,0,0,1,0`);
  await settled(page);
  const { eye, target } = await page.evaluate(() => window.ebpoViewer.scene.place), d = eye.map((x, k) => x - target[k]);
  assert.ok(Math.hypot(target[0] - 0.1, target[1], target[2] + 0.05) < 1e-9 && Math.abs(Math.hypot(...d) - 2.2) < 1e-9 && Math.abs(d[1] - 1.1) < 1e-9, `${eye} ${target}`);
  assert.equal(await page.inputValue('#level'), '3');
  assert.ok(await page.isChecked('input[name=clip][value="1"]') && await page.isChecked('input[name=colouring][value=type]'));
  const { low, high } = await page.evaluate(() => window.ebpoViewer.scene.cut), { info } = await open(readFileSync(model)), scale = 2 / Math.hypot(...info.size);
  assert.ok(Math.abs(low[1] + 0.1 * info.size[1] * scale) < 1e-9 && high[1] > 1 && Math.abs(low[2] + 0.375 * info.size[2] * scale) < 1e-9, `${low} ${high}`);
  await page.waitForFunction(() => window.ebpoViewer.state.probe);
  assert.deepEqual((await stateOf(page)).probe.point, [0.5, 0.25, 0]);
  await page.waitForSelector('#measures li');
  const wanted = new URL(page.url()).search;
  assert.equal(await page.evaluate(() => new URL(window.ebpoViewer.address()).search), wanted);
  const steps = await page.evaluate(() => history.length);
  await page.focus('#canvas');
  await page.keyboard.press('ArrowRight'); // turns by 7.5 degrees
  await page.keyboard.press('.');
  await page.waitForFunction(() => /view=127.5,30,2.2/.test(location.search) && /level=4/.test(location.search));
  assert.equal(await page.evaluate(() => history.length), steps);
  await page.keyboard.press('o');
  await page.fill('#url', 'models/red.ebpo.h5');
  await page.keyboard.press('Enter');
  await settled(page);
  assert.doesNotMatch(page.url(), /view=|clip=|level=/);
  await page.goBack();
  await page.waitForSelector('#start:not([hidden])');
  await page.goBack();
  await page.waitForFunction(() => document.querySelector('#name').textContent === 'ring.ebpo.h5' && window.ebpoViewer.state.idle);
  assert.match(page.url(), /view=127.5,30,2.2.*level=4|level=4.*view=127.5,30,2.2/);
  assert.ok(await page.isChecked('input[name=clip][value="1"]'));
  await page.close();
}

// Distances and sections agree with the faces.
async function measures(browser, address) {
  const page = await show(browser, `${address}?file=models/ring.ebpo.h5&clip=z0.5`);
  await settled(page);
  await page.waitForFunction(() => window.ebpoViewer.paint);
  await page.evaluate(() => document.querySelectorAll('#panel details').forEach((d) => (d.open = true)));
  await page.click('#sectionOn');
  await page.waitForSelector('#sectionResult:not([hidden])');
  const { info, vertices, faces } = await open(readFileSync(model)).then(async (file) => ({ info: file.info, ...await file.mesh() })), segments = [];
  cutFaces(Float64Array.from([...faces].flatMap((v) => [...vertices.subarray(3 * v, 3 * v + 3)])), 2, info.origin[2] + 0.5 * info.size[2], segments);
  assert.equal(Number(await page.textContent('#sectionArea')), Number(measureOf(segments).area.toPrecision(6)));
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#sectionCsv')]), lines = readFileSync(await download.path(), 'utf8').trim().split('\n');
  assert.equal(lines[0], 'line,x,y,z');
  assert.equal(lines.length - 1, segments.length / 4 + 2); // two closed polylines
  await page.keyboard.press('x'); // no plane
  await page.keyboard.press('d');
  const [x0, y0, x1, y1] = await silhouette(page);
  for (const share of [0.4, 0.6])
    await page.mouse.click(x0 + (x1 - x0) * share, y1 - (y1 - y0) * 0.15);
  await page.waitForSelector('#measures li');
  const points = await page.evaluate(() => new URL(window.ebpoViewer.address()).searchParams.get('measure').split(',').map(Number));
  assert.ok(Math.abs(Number(await page.textContent('#measures li')) - Math.hypot(points[0] - points[3], points[1] - points[4], points[2] - points[5])) < 1e-5);
  for (const p of [points.slice(0, 3), points.slice(3)])
    assert.ok(JSON.parse(run(ebpo, ['distance', '--json', '--unsigned', model], `${p.join(' ')}\n`)).distance < 2e-6, 'a measured point lies on the faces');
  await page.close();
}

// Returns the number of red pixels in the model's picture.
const red = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
  const canvas = document.querySelector('#canvas'), context = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d');
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  done(data.reduce((sum, r, i) => sum + (i % 4 === 0 && r > data[i + 1] + 40 ? 1 : 0), 0));
}))));

// Reads paint from the browser with the command ebpo paint: lists and measures it, bakes it into vertex colours, and shows these colours.
async function readsPaint(browser, address, path) {
  const baked = join(work, 'baked.ply'), report = JSON.parse(run(ebpo, ['paint', '--json', '--area', path, model]));
  assert.deepEqual([report.stroke_count, report.layers.length, report.notes[0].title], [1, 1, 'A loss']);
  const { lo, area, hi } = report.areas.all;
  assert.ok(lo > 0 && lo <= area && area <= hi);
  run(ebpo, ['paint', path, model, '--bake', baked]);
  const converted = join(work, 'baked.ebpo.h5'); // not in the served folder, because the server serves only files that existed at its start
  run(ebpo, ['convert', '-q', baked, converted]);
  const page = await show(browser, address);
  await page.setInputFiles('#file', converted);
  await page.waitForFunction(() => window.ebpoViewer.state.depth >= 0, undefined, { timeout: PATIENCE_MS });
  await settled(page);
  assert.ok(await red(page) > 500, 'what was baked is seen');
  await page.close();
}

async function paints(browser, address) {
  const page = await show(browser, `${address}?file=models/ring.ebpo.h5`);
  await settled(page);
  await page.waitForFunction(() => window.ebpoViewer.paint);
  const [x0, y0, x1, y1] = await silhouette(page), pull = async (from, to) => {
    const at = ([u, v]) => [x0 + (x1 - x0) * u, y0 + (y1 - y0) * v];
    await page.mouse.move(...at(from));
    await page.mouse.down();
    await page.mouse.move(...at(to), { steps: 3 });
    await page.mouse.up();
  }, drag = async (from, to) => {
    const strokes = await page.evaluate(() => window.ebpoViewer.paint.file.strokes.length);
    await pull(from, to);
    await page.waitForFunction((n) => window.ebpoViewer.paint.file.strokes.length > n && !window.ebpoViewer.paint.pending, strokes);
  }, camera = await page.evaluate(() => window.ebpoViewer.address());
  await page.evaluate(() => document.querySelectorAll('#panel details').forEach((d) => (d.open = true)));
  await page.evaluate(() => {
    document.querySelector('#penSize').value = 95;
  });
  await page.keyboard.press('b');
  await pull([0.38, 0.87], [0.62, 0.87]);
  await page.keyboard.press('Control+z'); // undoes the stroke, not its layer, even when the stroke's positions have not arrived
  await page.waitForSelector('#penRedo:not([disabled])');
  assert.deepEqual(await page.evaluate(() => [window.ebpoViewer.paint.file.layers.length, window.ebpoViewer.paint.file.strokes.length]), [1, 0]);
  await drag([0.38, 0.87], [0.62, 0.87]);
  assert.equal(await page.evaluate(() => window.ebpoViewer.address()), camera, 'painting does not turn the model');
  const painted = await red(page);
  assert.ok(painted > 1000, `the stroke is seen: ${painted} pixels`);
  await page.keyboard.press('r');
  await drag([0.38, 0.87], [0.62, 0.87]);
  assert.ok(await red(page) < 0.02 * painted, 'the eraser takes it away');
  await page.keyboard.press('Control+z');
  assert.equal(await red(page), painted, 'and undo brings it back');
  await page.keyboard.press('n');
  await page.mouse.click(x0 + (x1 - x0) * 0.5, y0 + (y1 - y0) * 0.87);
  await page.waitForSelector('#noteForm:not([hidden])');
  await page.fill('#noteTitle', 'A loss');
  await page.focus('#noteBody');
  await page.keyboard.type('two\nlines'); // the page must not interpret these as its keys
  await page.click('#noteForm button');
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#paintSave')]), path = join(models, download.suggestedFilename());
  assert.equal(download.suggestedFilename(), 'ring.paint.h5');
  await download.saveAs(path);
  const doc = readPaint(new Uint8Array(readFileSync(path))), { info } = await open(readFileSync(model)), [stroke] = doc.strokes;
  assert.deepEqual([doc.model, doc.faceNumbers, doc.strokes.length, doc.layers.length, doc.notes[0].title, doc.notes[0].body], [info.contentSha256, 'source', 1, 1, 'A loss', 'two\u2028lines']);
  const far = run(ebpo, ['distance', '--json', '--unsigned', model], stroke.points.map((p) => `${p.place.join(' ')}\n`).join('')).trim().split('\n').map((line) => JSON.parse(line).distance);
  assert.ok(stroke.points.length > 5 && far.every((d) => d < 1e-12 * Math.hypot(...info.size)), 'its points lie on the faces');
  await readsPaint(browser, address, path);
  await page.close({ runBeforeUnload: false });

  const other = await show(browser, `${address}?file=models/ring.ebpo.h5`);
  await settled(other);
  await other.waitForFunction(() => window.ebpoViewer.paint);
  await other.setInputFiles('#paintFile', path);
  await other.waitForFunction(() => window.ebpoViewer.paint.file.strokes.length === 1);
  await other.waitForFunction(() => !window.ebpoViewer.paint.pending);
  const again = await red(other);
  assert.ok(Math.abs(again - painted) < 0.02 * painted, `it looks as before: ${painted} and ${again} pixels`);
  assert.equal(await other.textContent('.pin'), '1');
  await other.evaluate(() => document.querySelector('#errorClose').click());
  await other.keyboard.press('o');
  await other.fill('#url', 'models/red.ebpo.h5');
  await other.keyboard.press('Enter');
  await settled(other);
  await other.setInputFiles('#paintFile', path);
  await other.waitForSelector('#error:not([hidden]):has-text("this paint is for")');
  await other.close({ runBeforeUnload: false });
}

// Uses the package in a page of another origin: the element, and the three.js object in a separate scene.
async function embeds(browser, address) {
  const folder = join(work, 'project'), own = join(folder, 'node_modules/ebpo-viewer'), { build } = await load('node_modules/esbuild/lib/main.js');
  run('node', [join(viewer, 'package.mjs'), own]);
  symlinkSync(join(viewer, 'node_modules/three'), join(folder, 'node_modules/three'));
  writeFileSync(join(folder, 'main.js'), `import 'ebpo-viewer'; import { EbpoGroup } from 'ebpo-viewer/three'; import * as THREE from 'three';
    const renderer = new THREE.WebGLRenderer({ canvas: document.querySelector('canvas'), preserveDrawingBuffer: true }), scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40,
      1, 0.01, 20);
    const group = new EbpoGroup({ triangles: 3000, workers: 1 }), model = group.make(), ring = group.make(), draw = () => { group.update(camera, renderer); renderer.render(scene, camera); };
    renderer.setSize(300, 300);
    ring.position.set(-30, -18, -30);
    ring.load('${address}models/ring.ebpo.h5').then(draw);
    scene.add(group, new THREE.HemisphereLight('#fff', '#888', 3));
    model.addEventListener('change', draw);
    model.addEventListener('idle', () => (window.done = true));
    window.loaded = model.load('${address}models/red.ebpo.h5').then((info) => {
      const { min, max } = model.box; // in the file's coordinates
      camera.position.set(max.x + 2, max.y + 1, max.z + 2);
      camera.lookAt(min.clone().add(max).multiplyScalar(0.5));
      draw();
      return [info.face_count, min.toArray(), max.toArray()];
    });
    window.shares = () => [group.crew.workers.length, model.triangles, ring.triangles];
    window.probe = () => model.probe(new THREE.Vector3(0.5, 0.5, 0.5));`);
  const { outputFiles: [main] } = await build({ entryPoints: [join(folder, 'main.js')], bundle: true, format: 'esm', write: false });
  const html = `<body style="margin:0;display:flex"><canvas></canvas>
    <ebpo-viewer id="one" style="width:300px;height:300px" theme="light" level="3" view="10,20,2.5" src="${address}models/ring.ebpo.h5"></ebpo-viewer>
    <ebpo-viewer id="many" style="width:200px;height:200px" view="0,0,2.5"><ebpo-part src="${address}models/red.ebpo.h5" name="left"></ebpo-part>
      <ebpo-part src="${address}models/red.ebpo.h5" pose="4,0,0"></ebpo-part></ebpo-viewer>
    <script>window.heard = []; window.of = {};
      for (const element of document.querySelectorAll('ebpo-viewer')) for (const name of ['load', 'idle', 'view', 'point', 'error'])
        element.addEventListener(name, (e) => (element.id === 'one' ? heard : (of[element.id] ??= [])).push([name, e.detail]));</script>
    <script type="module" src="main.js"></script>`;
  const { info } = await open(readFileSync(join(models, 'red.ebpo.h5')));
  const scene = { ebpo_scene: '1.0', models: { red: { file: `${address}models/red.ebpo.h5`, content_sha256: info.contentSha256 } }, routes: { up: { keys: [{ time: 0, pose: {} },
    { time: 2, pose: { translation: [0, 0, 4] } }] } }, instances: [{ name: 'a', model: 'red' }, { name: 'b', model: 'red', route: 'up' }] };
  const server = createHttp((request, response) => {
    const file = { '/': ['text/html', html], '/main.js': ['text/javascript', main.text], '/pair.scene.json': ['application/json', JSON.stringify(scene)],
      '/worker.js': ['text/javascript', readFileSync(join(own, 'worker.js'))], ...Object.fromEntries(['ebpo-view.wasm', 'ebpo.wasm'].map((name) =>
        [`/${name}`, ['application/wasm', readFileSync(join(own, name))]])) }[request.url] ?? ['image/x-icon', ''];
    response.writeHead(200, { 'content-type': file[0] });
    response.end(file[1]);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  cleanup.push(() => server.closeAllConnections() ?? server.close());
  const page = await show(browser, `http://127.0.0.1:${server.address().port}/`);
  await page.waitForFunction(() => window.done && window.heard?.some(([name]) => name === 'idle'), undefined, { timeout: 60000 });
  const [faces, low, high] = await page.evaluate(() => window.loaded);
  assert.deepEqual([faces, low, high], [info.faces, info.origin, info.origin.map((x, k) => x + info.size[k])]);
  const { where, distance } = await page.evaluate(() => window.probe());
  assert.deepEqual([where, distance], ['in', 0.5]);
  await page.waitForFunction(() => window.shares()[2] < 2_000_000);
  assert.deepEqual(await page.evaluate(() => window.shares()), [1, 24, 2976], 'what the box cannot use the ring gets, from the same worker');
  const [r, g, b] = await page.evaluate(() => { // the middle of the picture
    const gl = document.querySelector('canvas').getContext('webgl2'), pixel = new Uint8Array(4);
    gl.readPixels(gl.drawingBufferWidth / 2, gl.drawingBufferHeight / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return [...pixel];
  });
  assert.ok(r > 60 && r > 2 * Math.max(g, b), `a red box: ${[r, g, b]}`);
  const element = page.locator('#one');
  assert.equal(await element.evaluate((e) => e.view), '10,20,2.5');
  await element.evaluate((e) => e.shadowRoot.querySelector('canvas').focus());
  await page.keyboard.press('ArrowLeft');
  await page.waitForFunction(() => window.heard.some(([name, detail]) => name === 'view' && detail.view === '2.5,20,2.5'));
  const response = await element.evaluate((e) => e.query(e.info.box_origin));
  assert.equal(response.where, 'out');
  await element.evaluate((e) => (e.src = e.src.replace('ring', 'none')));
  await page.waitForFunction(() => window.heard.some(([name, detail]) => name === 'error' && /404/.test(detail.message)));
  await element.evaluate((e) => e.remove());
  await embedsSeveral(page, address);
  await page.close();
}

// Tests the element with parts: queries, clicks and poses; then a scene, and one model again.
async function embedsSeveral(page, address) {
  const many = page.locator('#many'), heard = (name, count = 1) => page.waitForFunction(([event, n]) => window.of.many?.filter(([one]) => one === event).length >= n, [name, count],
    { timeout: 60000 });
  await heard('idle');
  const { box_size: size, instances, models: files } = await many.evaluate((e) => e.info);
  assert.ok(size.every((x, k) => Math.abs(x - [5, 1, 1][k]) < 0.01), `${size}`); // cells are slightly larger than the models
  assert.deepEqual([files.length, instances.map((i) => [i.name, i.model])], [1, [['left', 'red'], ['red', 'red']]]);
  const response = await many.evaluate((e) => e.query([4.5, 0.5, 3], 'red'));
  assert.deepEqual([response.where, response.distance, response.nearest, response.instance], ['out', 2, [4.5, 0.5, 1], 'red']);
  assert.match(await many.evaluate((e) => e.query([0, 0, 0], 'none').catch((error) => error.message)), /"none" is not an instance/);
  // Clicks the right cube from the front. Its centre is 2 units to the right of the centre of the box, which is 5 units wide; the box's diagonal is 2 in the picture.
  const { x, y, width, height } = await many.boundingBox(), right = 2 * 2 / Math.hypot(5, 1, 1) / (2.5 - 1 / Math.hypot(5, 1, 1)) * height / 2 / Math.tan(19 * Math.PI / 180);
  await page.mouse.click(x + width / 2 + right, y + height / 2);
  await page.waitForFunction(() => window.of.many.some(([name, { instance, exact }]) => name === 'point' && exact && instance === 'red'));
  await many.evaluate((e) => e.lastElementChild.setAttribute('pose', '8,0,0')); // changes the pose without opening the file again
  await page.waitForFunction(() => document.querySelector('#many').query([8.5, 0.5, 3], 'red').then((a) => a.nearest[0] === 8.5));
  assert.equal(await page.evaluate(() => window.of.many.filter(([name]) => name === 'load').length), 1);
  await many.evaluate((e) => e.append(Object.assign(document.createElement('ebpo-part'), { innerHTML: '' }), e.firstElementChild.cloneNode())); // adds a part without src and another part with src
  await heard('load', 2);
  assert.deepEqual(await many.evaluate((e) => e.info.instances.map((i) => i.name)), ['left', 'red', 'left (2)']);
  await many.evaluate((e) => {
    e.setAttribute('time', '1');
    e.setAttribute('scene', 'pair.scene.json');
  });
  await page.waitForFunction(() => window.of.many.some(([name, { message }]) => name === 'error' && /on another server/.test(message)));
  await many.evaluate((e) => e.setAttribute('remote', ''));
  await heard('load', 3);
  assert.deepEqual(await many.evaluate(async (e) => [e.info.to, e.info.models.map((m) => m.name), (await e.query([0.5, 0.5, 5], 'b')).distance]), [2, ['red'], 2]);
  await many.evaluate((e) => e.firstElementChild.setAttribute('pose', '0,0,90')); // changes a part while a scene is shown
  assert.deepEqual(await many.evaluate(async (e) => (await e.query([0.5, 0.5, 2], 'a')).nearest), [0.5, 0.5, 1]);
  await many.evaluate((e) => {
    e.removeAttribute('scene');
    e.replaceChildren();
    e.src = `${e.ownerDocument.location.origin}/none.ebpo.h5`;
    return e.load(new Blob([])).catch(() => {});
  });
  await many.evaluate((e, src) => e.load(src), `${address}models/red.ebpo.h5`);
  assert.equal(await many.evaluate((e) => e.info.face_count), 12);
  await many.evaluate((e) => e.remove());
}

// Saved views are written to a file and read by another browser. Views of another model are refused.
async function viewsAsFiles(browser, address) {
  const page = await show(browser, `${address}?file=models/red.ebpo.h5`), file = join(work, 'views.json');
  await settled(page);
  await page.waitForFunction(() => window.ebpoViewer.state.idle && document.getElementById('viewSave'));
  page.on('dialog', (dialog) => dialog.accept('From above'));
  const clickIn = (id) => page.evaluate((name) => document.getElementById(name).click(), id); // clicks an element in a folded section
  await page.evaluate(() => (window.ebpoViewer.scene.place = { eye: [0, 2, 0.1], target: [0, 0, 0] }));
  await clickIn('viewSave');
  await page.waitForFunction(() => document.querySelectorAll('#views li').length === 1);
  const [download] = await Promise.all([page.waitForEvent('download'), clickIn('viewsOut')]);
  await download.saveAs(file);
  await page.evaluate(() => localStorage.clear());
  await page.goto(`${address}?file=models/red.ebpo.h5`);
  await settled(page);
  await page.waitForSelector('#viewsFile', { state: 'attached' });
  assert.equal(await page.locator('#views li').count(), 0);
  await page.locator('#viewsFile').setInputFiles(file);
  await page.waitForFunction(() => document.querySelector('#views li .link')?.textContent === 'From above');
  await page.evaluate(() => document.querySelector('#views li .link').click());
  assert.ok((await page.evaluate(() => window.ebpoViewer.scene.place.eye[1])) > 1.9);
  await page.goto(`${address}?file=models/ring.ebpo.h5`);
  await settled(page);
  await page.waitForSelector('#viewsFile', { state: 'attached' });
  await page.locator('#viewsFile').setInputFiles(file);
  await page.waitForFunction(() => /these views belong to "red"/.test(document.getElementById('errorWhat').textContent));
  await page.close();
}

// Paints one of two plates with a crack between them. The point's ball intersects the other plate, but the picture must show paint only where ebpo paint does.
async function paintsByReach(browser, address) {
  const page = await show(browser, `${address}?file=models/plates.ebpo.h5&paint=models/plates.paint.h5&view=0,0,1.6`);
  await settled(page);
  await page.waitForFunction(() => window.ebpoViewer.paint?.file.strokes.length === 1 && window.ebpoViewer.paint.pending === 0);
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  // Counts the red pixels left and right of the crack.
  const [left, right] = await page.evaluate(() => {
    const { scene, place } = window.ebpoViewer, canvas = document.getElementById('canvas'), gl = canvas.getContext('webgl2'), w = gl.drawingBufferWidth, h = gl.drawingBufferHeight;
    const pixels = new Uint8Array(4 * w * h), crack = scene.project([0, 0.5, 0.05].map((x, k) => (x - place.center[k]) * place.scale))[0] * w / canvas.clientWidth, sides = [0, 0];
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    for (let i = 0; i < w * h; i++)
      if (pixels[4 * i] > 80 && pixels[4 * i] > 2.5 * pixels[4 * i + 1])
        sides[i % w < crack ? 0 : 1]++;
    return sides;
  });
  assert.ok(left > 2000, `${left} red pixels on the painted plate`);
  assert.ok(right < left / 100, `${right} red pixels on the other plate`);
  await page.close();
}

// Two cubes form a step. Ambient occlusion darkens the inner edge, and does not darken points with nothing above them.
async function occludes(browser, address) {
  const page = await show(browser, `${address}?model=models/red.ebpo.h5&model=models/red.ebpo.h5&pose=0,0,0&pose=1,-0.5,0&view=50,40,2.5`);
  await settled(page);
  const brightness = () => page.evaluate(async (points) => {
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    const { scene, together: { assembly: { scene: s } } } = window.ebpoViewer, canvas = document.getElementById('canvas'), gl = canvas.getContext('webgl2'), pixel = new Uint8Array(4);
    return points.map((p) => {
      const [x, y] = scene.project(p.map((q, k) => (q - s.center[k]) * s.scale)), share = gl.drawingBufferWidth / canvas.clientWidth;
      gl.readPixels(Math.round(x * share), gl.drawingBufferHeight - Math.round(y * share), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      return pixel[0];
    });
  }, [[1.03, 0.5, 0.5], [1.75, 0.5, 0.5], [0.5, 1, 0.5]]);
  const before = await brightness();
  await page.keyboard.press('a');
  const after = await brightness();
  assert.ok(before.every((x) => x > 40) && after[0] < 0.85 * before[0] && [1, 2].every((i) => Math.abs(after[i] - before[i]) <= 3), `${before} and ${after}`);
  await page.close();
}

// Two models intersect: the page shows the faces that the command prints.
async function contacts(browser, address) {
  const page = await show(browser, `${address}?model=models/ring.ebpo.h5&model=models/red.ebpo.h5&pose=0,0,0&pose=0.5,0,0`);
  await settled(page);
  const red = () => page.evaluate(async () => { // pixels of the colours of contacts
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    const gl = document.getElementById('canvas').getContext('webgl2'), { drawingBufferWidth: w, drawingBufferHeight: h } = gl, pixels = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return pixels.reduce((n, x, i) => n + (i % 4 === 0 && x > 150 && pixels[i + 1] < 0.75 * x && pixels[i + 2] < 0.6 * x), 0);
  });
  await page.click('summary:has-text("Contacts")');
  await page.locator('#own').uncheck(); // the cube has the colour red
  const before = await red(), all = run(ebpo, ['collide', '-q', '--all', '--pose-b', '0.5 0 0', model, join(models, 'red.ebpo.h5')]).trim().split('\n').filter((line) => /^\d/.test(line));
  assert.ok(all.length > 100, all[0]);
  await page.click('#contactsFind');
  await page.waitForFunction(() => /intersect, in/.test(document.getElementById('contactsText').textContent), undefined, { timeout: 60000 });
  assert.equal(await page.textContent('#contactsText'), `${all.length.toLocaleString('en')} pairs of faces intersect, in 1 of 1 pairs of models whose boxes overlap.`);
  const shown = await red();
  assert.ok(shown > before + 500, `${before} and ${shown} pixels`);
  await page.click('#contactsClear');
  assert.equal(await red(), before);
  await page.close();
}

// Shows two models and then a scene. Tests the drawn triangles, clicks, distances between models, hidden models, the time and the address.
async function together(browser, address) {
  const query = '?model=models/ring.ebpo.h5&model=models/red.ebpo.h5&pose=0,0,0&pose=2,0,0', at = (x, y) => ({ position: { x, y } });
  const page = await show(browser, `${address}${query}`);
  await settled(page);
  const seen = () => page.evaluate(() => window.ebpoViewer.together.assembly.stats), all = await seen(), faces = (await open(readFileSync(model))).info.faces;
  assert.equal(all.meshTriangles, all.triangles);
  assert.equal(all.triangles, faces + 12);
  // Returns the position on the page of a point in world coordinates.
  const spot = (p) => page.evaluate((point) => {
    const { scene, together: { assembly } } = window.ebpoViewer, s = assembly.scene;
    return scene.project(point.map((x, k) => (x - s.center[k]) * s.scale));
  }, p);
  await page.mouse.click(...await spot([2.5, 0.5, 1])); // the middle of the red cube's front
  await page.waitForFunction(() => document.getElementById('chosenWhere').textContent !== '');
  assert.equal(await page.textContent('#chosenName'), 'red');
  assert.match(await page.textContent('#chosenNote'), /within the accuracy of the click; at 2\.5, 0\.5, 1$/);
  assert.equal(await page.textContent('#chosenWhere'), 'On the surface');
  await page.waitForFunction(() => /chosen=red/.test(location.search) && /point=2\.5/.test(location.search) && !/level=/.test(location.search));
  await page.keyboard.press('l');
  assert.match(await page.inputValue('#shareLink'), /chosen=red/);
  assert.match(await page.inputValue('#shareElement'), /<ebpo-part src="models\/red\.ebpo\.h5" pose="2,0,0"><\/ebpo-part><\/ebpo-viewer>$/);
  await page.keyboard.press('Escape');
  const linked = await show(browser, page.url());
  await settled(linked);
  await linked.waitForFunction(() => document.getElementById('chosenWhere').textContent !== '');
  assert.equal(await linked.textContent('#chosenName'), 'red');
  await linked.close();
  // Measures between two points of the cube with a distance of 0.6 in world coordinates.
  await page.keyboard.press('d');
  for (const x of [2.2, 2.8])
    await page.mouse.click(...await spot([x, 0.5, 1]));
  await page.waitForSelector('#measures li');
  assert.ok(Math.abs(Number.parseFloat(await page.textContent('#measures li')) - 0.6) < 0.02);
  await page.keyboard.press('Escape');
  const red = await look(page);
  await page.locator('#models input[type=checkbox]').nth(1).uncheck();
  await settled(page);
  assert.ok((await look(page)).share < red.share, 'a hidden model must not be visible');
  await page.waitForFunction(() => location.search.includes('hide=red') && location.search.includes('measure='));
  await page.goto(page.url());
  await settled(page);
  assert.deepEqual([await page.locator('#models input[type=checkbox]').nth(1).isChecked(), await page.locator('#measures li').count()], [false, 1]);
  await page.close();

  assert.equal((await fetch(`${address}models/move.scene.json`)).headers.get('access-control-allow-origin'), '*');
  const scene = await show(browser, `${address}?scene=models/move.scene.json&time=1`);
  await settled(scene);
  assert.deepEqual(await scene.evaluate(() => window.ebpoViewer.together.assembly.inWorld(window.ebpoViewer.together.assembly.instances[1], [0, 0, 0])), [3, 0, 2]);
  assert.deepEqual(await scene.evaluate(() => { const { models, stats } = window.ebpoViewer.together.assembly; return [models.length, models[0].shown.length, stats.triangles,
    stats.requests]; }), [1, 3, 36, 1]);
  await scene.locator('#time').fill('500');
  await scene.waitForFunction(() => location.search.includes('time=2.000'));
  const left = await scene.evaluate(() => { // after end(), neither geometry nor workers remain
    const { scene: { renderer: { info: { memory } } }, together: { assembly } } = window.ebpoViewer, tiles = assembly.meshes.length, before = memory.geometries;
    assembly.end();
    return [tiles > 0, before - memory.geometries - tiles, assembly.crew.workers.length, assembly.group.parent];
  });
  assert.deepEqual(left, [true, 0, 0, null]);
  await scene.close();
  const wrong = await show(browser, `${address}?scene=models/index.json`);
  await wrong.waitForSelector('#error', { state: 'visible' });
  assert.match(await wrong.textContent('#errorWhat'), /index\.json: the scene: is not an object/);
  await wrong.close();
}

// A switch shows the caps of a mesh with holes in red. Models without holes have no such switch.
async function showsCaps(browser, address, plainPage) {
  const page = await show(browser, `${address}?file=models/open.ebpo.h5&view=35,30,4`);
  const red = async () => {
    await settled(page);
    return (await look(page)).orange;
  };
  assert.equal(await red(), 0);
  assert.ok(await page.isVisible('#capsRow') && !await plainPage.isVisible('#capsRow'));
  await page.keyboard.press('h');
  const share = await red();
  assert.ok(share > 0.15 && share < 0.6, `${share} of the picture is red`);
  await page.waitForFunction(() => /show=caps/.test(location.search));
  await page.goto(page.url());
  assert.equal(await red(), share, 'the link shows the caps');
  await page.keyboard.press('k');
  await page.keyboard.press('k');
  assert.ok(await red() > 0.15, 'caps are red beside faces coloured by type');
  await page.keyboard.press('k');
  await page.keyboard.press('h');
  assert.equal(await red(), 0, 'without caps');
  await page.close();
}

// A link contains the theme and the switches of shading, wireframe and cells.
async function sharesSwitches(browser, address) {
  const page = await show(browser, `${address}?file=models/small.ebpo.h5&level=3`);
  await settled(page);
  await page.waitForSelector('#toolShare');
  for (const key of ['t', 'w', 'e', 'a'])
    await page.keyboard.press(key);
  await page.waitForFunction(() => /show=depth,occlusion,wireframe&theme=light/.test(location.search));
  await page.goto(page.url());
  await settled(page);
  await page.waitForSelector('#ambient');
  assert.deepEqual(await page.evaluate(() => ['dome', 'ambient', 'wire', 'cells'].map((id) => document.getElementById(id).checked)), [true, true, true, false]);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), 'light');
  await page.close();
}

// A point can be entered without a mouse, the slider announces its levels, and on a narrow page a tap shows its result over the picture.
async function pointsWithoutMouse(browser, address) {
  const page = await show(browser, `${address}?file=models/red.ebpo.h5`), answered = () => page.waitForFunction(() => window.ebpoViewer.state.probe?.exact);
  await settled(page);
  for (const [id, text] of [['px', '0.5'], ['py', '0.5'], ['pz', '0.25']])
    await page.fill(`#${id}`, text);
  await page.keyboard.press('Tab');
  await answered();
  assert.deepEqual([await page.textContent('#where'), await page.textContent('#distance')], ['Inside', '0.25']);
  assert.match(await page.getAttribute('#level', 'aria-valuetext'), /^the surface$/);
  assert.ok(await page.isHidden('#pointCard'));
  await page.setViewportSize({ width: 390, height: 700 });
  await page.keyboard.press('Escape');
  await page.keyboard.press('p');
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  await page.mouse.click(195, 350);
  await answered();
  assert.ok(await page.isHidden('#panel') && await page.isVisible('#pointCard'));
  assert.equal(await page.textContent('#pointCard strong'), 'On the surface'); // the click is only as accurate as a pixel
  await page.close();
}

// The page explains a missing or lost graphics context. The picture returns with the context.
async function graphics(browser, address) {
  const quiet = complaints.length, none = await browser.newPage();
  await none.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await none.goto(`${address}?file=models/red.ebpo.h5`, { waitUntil: 'commit' });
  await none.waitForSelector('#error:not([hidden]):has-text("WebGL 2")');
  assert.ok(await none.isHidden('#opening'));
  await none.close();
  const page = await show(browser, `${address}?file=models/red.ebpo.h5`);
  await settled(page);
  const before = (await look(page)).share, extension = await page.evaluateHandle(() => document.getElementById('canvas').getContext('webgl2').getExtension('WEBGL_lose_context'));
  await extension.evaluate((it) => it.loseContext());
  await page.waitForSelector('#error:not([hidden]):has-text("graphics context")');
  await extension.evaluate((it) => it.restoreContext());
  await page.waitForSelector('#error', { state: 'hidden' });
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const after = (await look(page)).share;
  assert.ok(Math.abs(after - before) < 0.01, `the model covers ${before} of the page, and afterwards ${after}`);
  await page.close();
  complaints.length = quiet;
}

// The connection fails while the page's tools are loaded. Retry loads the tools.
async function toolsAgain(browser, address) {
  const quiet = complaints.length, context = await browser.newContext({ viewport: SIZE, reducedMotion: 'reduce' });
  await context.route('**/more.js', (route) => route.abort());
  const page = await context.newPage();
  await page.goto(`${address}?file=models/red.ebpo.h5`);
  await page.waitForSelector('#error:not([hidden]):has-text("tools could not be loaded")');
  await page.click('#errorRetry');
  await page.waitForSelector('#toolShare');
  await context.close();
  complaints.length = quiet;
}

// A page opened from disk explains that it must be served.
async function fromFolder(browser) {
  const page = await browser.newPage();
  await page.goto(pathToFileURL(join(viewer, 'index.html')).href);
  await page.waitForSelector('#fromDisk', { state: 'visible' });
  await page.close();
}

// Tests the page from its sources, without a bundle.
async function fromSources(browser) {
  const page = await show(browser, `${await serve('--sources')}?file=models/ring.ebpo.h5&level=4`), state = await settled(page);
  assert.equal(state.depth, 4);
  assert.ok(await page.evaluate(() => performance.getEntriesByType('resource').some((r) => r.name.endsWith('/scene.js'))));
  await page.close();
}

// When something is missing, serve.sh prints the command to run. It neither installs nor writes files.
async function servesOrSays() {
  const empty = join(work, 'empty'), script = join(root, 'samples/serve.sh'), says = (env, ...options) => {
    try {
      run('/bin/sh', [script, ...options], '', env);
    } catch ({ status, stderr }) {
      return `${status} ${stderr}`;
    }
    return 'no error';
  };
  mkdirSync(empty);
  assert.match(says(process.env, '--folder', empty), /^1 serve\.sh: .*no \.ebpo\.h5 file is there;.*--folder.*quickstart\.sh[^\n]*\n$/);
  writeFileSync(join(empty, 'torn.ebpo.h5'), readFileSync(join(models, 'ring.ebpo.h5')).subarray(0, 5000));
  assert.match(says(process.env, '--folder', empty), /^1 list\.js: omitted: torn\.ebpo\.h5: [^/\n]*truncated by copying[^/\n]*\nserve\.sh: .*none of its files can be shown\n$/);
  const list = JSON.parse(run('node', [join(root, 'tools/web/list.js'), join(empty, 'torn.ebpo.h5'), join(models, 'ring.ebpo.h5')]));
  assert.deepEqual(list.map((item) => item.file), ['ring.ebpo.h5']);
  rmSync(join(empty, 'torn.ebpo.h5'));
  assert.match(says(process.env, '--port'), /^2 usage: serve\.sh/);
  assert.match(says(process.env, '--folder', models, '--port', '99999'), /^1 [^]*\nserve\.sh: nginx does not serve [^\n]*--port[^\n]*\n$/);
  const few = join(work, 'bin');
  mkdirSync(few);
  for (const name of ['dirname', 'ls', 'sh', 'id'])
    symlinkSync(`/bin/${name}`, join(few, name));
  assert.match(says({ PATH: few }, '--folder', models), /^1 serve\.sh: (nginx|node) is missing; run sh .*install-deps\.sh --viewer\n$/);
  assert.deepEqual(readdirSync(empty), []);
}

// Returns a screenshot's pixels as brightness, 0 where the model is not drawn; without panels.
async function brightness(page) {
  const hide = await page.addStyleTag({ content: '#panel, #bar, #tools, #progress, #compass, #scale { visibility: hidden; } #stage { background: #f0f !important; }' });
  const png = (await page.screenshot()).toString('base64');
  await hide.evaluate((node) => node.remove());
  return page.evaluate(async (picture) => {
    const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + picture)).blob()), context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height), out = [];
    for (let i = 0; i < data.length; i += 4)
      out.push(data[i] > 240 && data[i + 1] < 15 && data[i + 2] > 240 ? 0 : 1 + data[i + 1]);
    return out;
  }, png);
}

// Frames that take no time do not make a surface finer, because that would need more bytes than the picture gains.
async function staysAtNormalDetail(browser, address) {
  const page = await show(browser, 'about:blank');
  await page.addInitScript(() => {
    const now = performance.now.bind(performance);
    performance.now = () => now() / 1000;
  });
  await page.goto(`${address}?file=models/large.ebpo.h5`);
  await settled(page);
  await page.waitForFunction(() => { // the frames that measure are over
    const { scene, state } = window.ebpoViewer, { frame } = scene.renderer.info.render, quiet = state.idle && frame === window.lastFrame;
    window.lastFrame = frame;
    return quiet && document.getElementById('sFrame').textContent;
  }, undefined, { timeout: PATIENCE_MS, polling: 1000 });
  assert.equal((await stateOf(page)).detail, 16);
  await page.close();
}

// The simplified surface of a large model looks like all of its faces. No background is visible within the silhouette. The label states what is drawn.
async function drawsSurface(browser, address) {
  const page = await show(browser, `${address}?file=models/large.ebpo.h5&detail=16`), { stats, calls } = await settled(page), bytes = sum(requests('large'), (b) => b);
  assert.ok(stats.surface && stats.triangles > 5000 && stats.triangles <= 300000 && calls <= 3, JSON.stringify({ stats, calls }));
  assert.ok(stats.surface.pixels > 0 && stats.surface.pixels < 16, `${stats.surface.pixels}`);
  assert.match(await page.textContent('#shown'), /^Surface within [\d.]+ px \([\d.e-]+\)/);
  assert.ok(bytes < 0.8 * statSync(join(models, 'large.ebpo.h5')).size, `${bytes}`);
  const drawn = await brightness(page), sides = () => page.evaluate(() => ['fronts', 'backs', 'both'][window.ebpoViewer.scene.look.faces.side]);
  assert.equal(await sides(), 'fronts');
  await page.keyboard.press('x'); // a clipping plane
  await settled(page);
  assert.equal(await sides(), 'both');
  for (let i = 0; i < 3; i++)
    await page.keyboard.press('x');
  await staysAtNormalDetail(browser, address);
  await page.selectOption('#detail', '0');
  assert.equal((await settled(page)).stats.meshTriangles, 280134);
  assert.equal(await page.textContent('#shown'), 'The faces of the model');
  const faces = await brightness(page), { width, height } = SIZE, inside = (i) => [0, 1, -1, 2, -2].every((x) => [0, 1, -1, 2, -2].every((y) => faces[i + x + y * width] > 0));
  let holes = 0, count = 0, difference = 0;
  for (let i = 2 * width + 2; i < width * (height - 2) - 2; i++)
    if (faces[i] && inside(i)) {
      count++;
      holes += drawn[i] === 0;
      difference += Math.abs(drawn[i] - faces[i]);
    }
  assert.ok(count > 20000, `${count} pixels`);
  assert.equal(holes, 0, 'no background within the silhouette');
  assert.ok(difference / count < 4, `mean difference of brightness: ${difference / count} of 255`);
  // Levels and their colours show envelopes; the surface returns.
  await page.keyboard.press('k');
  assert.equal((await settled(page)).stats.surface, undefined);
  assert.equal(await sides(), 'both');
  await page.selectOption('#detail', '16');
  for (const key of ['k', 'k', 'v', 'z', 'w'])
    await page.keyboard.press(key);
  assert.ok((await settled(page)).stats.surface);
  await page.waitForFunction(() => /show=wireframe,orthographic,z-up/.test(location.search));
  const size = Math.hypot(...(await look(page)).box);
  await page.keyboard.press('v');
  await settled(page);
  assert.ok(Math.abs(Math.hypot(...(await look(page)).box) / size - 1) < 0.1, 'the size of the model remains without perspective');
  await page.keyboard.press('s'); // turntable
  const before = await page.evaluate(() => window.ebpoViewer.scene.place.eye.join());
  await page.waitForFunction((eye) => window.ebpoViewer.scene.place.eye.join() !== eye, before);
  await page.close();
}

async function main() {
  makeModels();
  const address = await serve(), browser = await browse(), page = await show(browser, `${address}?file=models/ring.ebpo.h5&level=4&detail=0`);
  const step = async (name, work) => {
    await work().catch((error) => {
      throw new Error(`${name}: ${error.message}`, { cause: error });
    });
    console.log(`ok ${name}`);
  };
  await step('levels 0 to 4 need at most two requests and 150 kB', () => levelFour(page));
  await step('level 5 has the same nodes and triangles as in the library, at the model\'s position', () => levelFive(page));
  await step('colours show levels and types', () => colours(page));
  await step('leaves show the real faces at their positions', () => mesh(page));
  await step('the clipping plane cuts', () => clipping(page));
  await step('point queries agree with the library', () => point(page));
  await step('a click queries the visible point', () => click(page));
  await step('faces have the model\'s colours, with a switch', () => modelColours(browser, address, page));
  await step('caps of holes are shown', () => showsCaps(browser, address, page));
  await step('a Boolean result has the colours of its operands', () => operandColours(browser, address));
  requests();
  await step('a file from disk is shown without a server', () => fromDisk(page));
  await page.close();
  await step('errors state the problem and the next step', () => errors(browser, address));
  await step('the model is requested before the page\'s code is loaded', () => modelFirst(browser, address));
  await step('the code waits for the page', () => pageLate(browser, address));
  await step('a failure of the code is reported', () => codeFails(browser, address));
  await step('a small file needs one request, and is fetched again only after a change', () => oneRequest(browser, address));
  await step('the address describes the view, and Back works', () => shares(browser, address));
  await step('distances and sections agree with the faces', () => measures(browser, address));
  await step('paint is saved and shown again', () => paints(browser, address));
  await step('saved views are exchanged as files', () => viewsAsFiles(browser, address));
  await step('paint is visible only on connected faces', () => paintsByReach(browser, address));
  await step('several models and scenes are shown together', () => together(browser, address));
  await step('intersecting faces of two models are shown', () => contacts(browser, address));
  await step('the simplified surface looks like the faces', () => drawsSurface(browser, address));
  await step('links contain the theme and the switches', () => sharesSwitches(browser, address));
  await step('points need neither a mouse nor the panel', () => pointsWithoutMouse(browser, address));
  await step('a missing or lost graphics context is explained', () => graphics(browser, address));
  await step('tools that could not be loaded are loaded again', () => toolsAgain(browser, address));
  await step('ambient occlusion darkens inner edges', () => occludes(browser, address));
  const quiet = complaints.length;
  await step('the element and the three.js object work in a page of another origin', () => embeds(browser, address));
  complaints.length = quiet; // the browser logs the 404
  await step('a page from disk explains that it must be served', () => fromFolder(browser));
  const bad = await badLine(address);
  await step('a stall is reported, and Retry fetches the rest', () => stalls(browser, bad));
  await step('a lost connection loses no data', () => dies(browser, bad));
  await step('HTTP statuses are explained, with Retry', () => statuses(browser, bad));
  await step('the page works without a bundle', () => fromSources(browser));
  await step('serve.sh reports missing programs and files', () => servesOrSays());
  await step('a sample is opened from the list', () => samples(browser, address));
  assert.deepEqual(complaints, [], 'errors or warnings of the page');
}

let code = 0;
await main().catch((error) => {
  console.error(error);
  code = 1;
});
for (const undo of cleanup.reverse())
  await undo();
process.exit(code);
