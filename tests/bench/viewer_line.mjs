// Measures the viewer in a headless Chromium over a slow line: viewer_line.mjs [OPTION VALUE ...] MODEL.ebpo.h5 ...
// Prints a table row for each model: time to the first picture (median of the rounds) and to the settled picture, requests and bytes of the model until
// then, all bytes that the line delivered (fewer if responses are ended early, as the server has sent more), triangles, and the bytes of a second visit.
// All connections share the line in turns.
// --kbits 5000   --ms 100 (round trip)   --rounds 9   --pictures FOLDER (of the settled page)   --query TEXT (appended to the URL)   --sources (not bundled)
// --viewer ROOT (another checkout)   --mesh MODEL.ply (more rows: the settled picture compared with all faces of the model, and the time of a frame)
// --tiles FOLDER --modules FOLDER --errors 16,8,4 (with --mesh; another row for each error in pixels: 3D Tiles of the model by ebpo export --tiles, over the same line, by
// 3d-tiles-renderer and three, which npm has installed in the second folder)
// --trace (prints each request: ms until it was sent, until the first and the last byte arrived, bytes, range)
// --near 0.03 (another row: the time of a click's distance; then the camera is at this many box diagonals from the point)
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, symlinkSync } from 'node:fs';
import { connect, createServer } from 'node:net';
import { loadavg, tmpdir } from 'node:os';
import { basename, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { comparePicture } from './viewer_picture.mjs';

const options = {
  kbits: 5000, ms: 100, rounds: 9, pictures: undefined, query: '', sources: false, mesh: '', tiles: '', modules: '', errors: '16,8,4', trace: false, near: 0,
  viewer: resolve(import.meta.dirname ?? new URL('.', import.meta.url).pathname, '../..') }, models = [];
for (let i = 2; i < process.argv.length; i++) {
  const name = process.argv[i].startsWith('--') ? process.argv[i].slice(2) : undefined;
  if (!name)
    models.push(resolve(process.argv[i]));
  else if (typeof options[name] === 'boolean')
    options[name] = true;
  else
    options[name] = typeof options[name] === 'number' ? Number(process.argv[++i]) : process.argv[++i];
}
const root = resolve(options.viewer), viewer = join(root, 'tools/web'), work = mkdtempSync(join(tmpdir(), 'ebpo-bench-')), log = join(work, 'access.log');
const { chromium } = await import(pathToFileURL(join(viewer, 'node_modules/playwright-core/index.mjs')));

const PIECE = 4096, QUEUE = 65536; // bytes of a turn, and bytes that the line stores for a connection

let delivered = 0; // bytes
const sent = [];   // requests since the last page was opened, for --trace
// Starts a line from a new port to `to`. It delays every connection and every byte, and limits the rate of bytes. Connections take turns.
function line(to) {
  const waiting = []; // connections with something to send: { queue, send }
  let busy = false;
  const later = (work) => setTimeout(work, options.ms / 2);
  const turn = () => {
    const next = waiting.shift();
    busy = Boolean(next);
    if (!next)
      return;
    const piece = next.queue.subarray(0, PIECE);
    next.queue = next.queue.subarray(PIECE);
    if (next.queue.length)
      waiting.push(next);
    delivered += piece.length;
    if (next.request) {
      next.request.bytes += piece.length;
      next.request.first ??= performance.now();
      next.request.last = performance.now();
    }
    next.sent(piece);
    free = Math.max(free, performance.now()) + piece.length * 8 / options.kbits;
    setTimeout(turn, free - performance.now());
  };
  let free = 0;
  const server = createServer((near) => {
    const far = connect(to, '127.0.0.1'), down = { queue: Buffer.alloc(0), sent: (piece) => {
      later(() => near.write(piece));
      if (down.queue.length < QUEUE)
        far.resume();
      if (!down.queue.length && down.ended)
        later(() => near.end());
    } };
    const ready = performance.now() + options.ms; // after the handshake
    near.on('data', (data) => {
      const [, what, range] = /^GET (\S+)[^]*?(?:\r\nrange: *(\S+)|\r\n\r\n)/i.exec(data.toString('latin1')) ?? [];
      if (what)
        sent.push(down.request = { what: what.split('?')[0], range, at: performance.now(), first: undefined, last: undefined, bytes: 0 });
      setTimeout(() => far.write(data), Math.max(0, ready - performance.now()) + options.ms / 2);
    });
    far.on('data', (data) => {
      if (!down.queue.length)
        waiting.push(down);
      down.queue = Buffer.concat([down.queue, data]);
      if (down.queue.length >= QUEUE)
        far.pause();
      if (!busy)
        turn();
    });
    far.on('end', () => {
      down.ended = true;
      if (!down.queue.length)
        later(() => near.end());
    });
    near.on('close', () => far.destroy());
    for (const socket of [near, far])
      socket.on('error', () => {});
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done(server)));
}

// --- the server and the browser ---

const cleanup = [() => rmSync(work, { recursive: true, force: true })];

async function serve() {
  const probe = await new Promise((done) => {
    const server = createServer().listen(0, '127.0.0.1', () => done(server));
  });
  const { port } = probe.address();
  await new Promise((done) => probe.close(done));
  for (const model of models)
    symlinkSync(model, join(work, basename(model)));
  if (options.tiles)
    symlinkSync(resolve(options.tiles), join(work, 'tiles'));
  const script = join(root, 'samples/serve.sh'), old = readFileSync(script, 'utf8').includes('--no-install') ? ['--no-install'] : options.sources ? ['--sources'] : [];
  const server = spawn('sh', [script, ...old, '--port', String(port), '--folder', work, '--log', log], { stdio: ['ignore', 'ignore', 'inherit'] });
  cleanup.push(() => new Promise((done) => server.once('exit', done).kill('SIGTERM')));
  for (let i = 0; i < 100 && !await fetch(`http://127.0.0.1:${port}/`).then((r) => r.ok, () => false); i++)
    await new Promise((done) => setTimeout(done, 100));
  const slow = await line(port);
  cleanup.push(() => slow.close());
  return `http://localhost:${slow.address().port}/`;
}

let logged = 0, counted = 0;
// Returns what was sent of the model and of the page since the last call.
function traffic() {
  const lines = readFileSync(log, 'utf8').split('\n').filter(Boolean), sums = { requests: 0, bytes: 0, page: 0, line: delivered - counted };
  for (const text of lines.slice(logged)) {
    const bytes = Number(/" \d+ (\d+) "/.exec(text)[1]), isModel = text.includes('/models/') && !text.includes('index.json');
    sums.requests += isModel ? 1 : 0;
    sums[isModel ? 'bytes' : 'page'] += bytes;
  }
  logged = lines.length;
  counted = delivered;
  return sums;
}

// Runs in the page: records the times of the first picture and of the last change.
const WATCH = `{
  const look = () => {
    if (!(window.ebpoViewer?.state.stats?.triangles > 0))
      requestAnimationFrame(look);
    else
      requestAnimationFrame(() => (window.firstPicture = performance.now()));
  };
  look();
}`;

async function visit(page, address) {
  const began = performance.now();
  sent.length = 0;
  await page.goto(address, { waitUntil: 'commit' });
  await page.waitForFunction(() => window.firstPicture, undefined, { timeout: 120000, polling: 50 });
  const first = await page.evaluate(() => window.firstPicture);
  await settle(page);
  const { settled, state } = await page.evaluate(() => ({ settled: performance.now(), state: window.ebpoViewer.state }));
  await page.waitForTimeout(200); // nginx writes its log after a response is sent
  if (options.trace) {
    const at = (time) => (time === undefined ? '-' : (time - began).toFixed(0)).padStart(6);
    sent.forEach((r) => console.log(`${at(r.at)}${at(r.first)}${at(r.last)} ${String(r.bytes).padStart(8)} ${r.what} ${r.range ?? ''}`));
    console.log(`first picture ${first.toFixed(0)}, settled ${(settled - 1000).toFixed(0)}`);
  }
  return { first, settled: settled - 1000, stats: state.stats, calls: state.calls, ...traffic() };
}

// Compares the settled picture with all faces of the model.
async function compare(page, { stats, calls }) {
  const tiles = options.tiles ? { url: new URL('models/tiles/tileset.json', page.url()).href, modules: resolve(options.modules), errors: options.errors.split(',').map(Number),
    delivered: () => delivered } : undefined;
  const c = await comparePicture(page, resolve(options.mesh), join(viewer, 'node_modules'), tiles), { inside, partly, holes } = c.silhouette;
  console.log(`  settled: ${stats.triangles} triangles, ${calls} draw calls, error ${stats.surface?.pixels.toFixed(2)} pixels; SSIM with all ${c.faces} faces ${c.ssim.toFixed(4)}; ` +
    `of ${inside} pixels inside the silhouette ${holes} show the background only, ${partly} in part; ` +
    `processor time of a frame ${c.frames.own.toFixed(3)} s, of a plain mesh of as many triangles ${c.frames.fronts.toFixed(3)} s, of its both sides ${c.frames.both.toFixed(3)} s; ` +
    `load ${loadavg()[0].toFixed(1)}`);
  for (const { error, ms, bytes, triangles, tiles: count, ssim } of c.others)
    console.log(`  3D Tiles, ${error} pixels: ${seconds(ms)} s, ${kilo(bytes)} kB, ${count} tiles, ${triangles} triangles, SSIM ${ssim.toFixed(4)}`);
}

// Clicks in the middle and waits for the exact distance; then moves close to that point and waits until the page has settled.
async function closeUp(page) {
  const { width, height } = page.viewportSize(), began = Date.now();
  await page.mouse.click(width / 2 - 155, height / 2);
  await page.waitForFunction(() => window.ebpoViewer.state.probe?.exact, undefined, { timeout: 120000, polling: 20 });
  const clicked = Date.now() - began;
  await page.waitForTimeout(200);
  const click = traffic(), moved = Date.now();
  await page.evaluate((near) => {
    const { scene, place, state } = window.ebpoViewer, at = state.probe.nearest.map((x, k) => (x - place.center[k]) * place.scale);
    const eye = scene.camera.position.toArray(), away = eye.map((x, k) => x - at[k]), length = Math.hypot(...away);
    scene.controls.target.set(...at);
    scene.camera.position.set(...at.map((x, k) => x + away[k] / length * 2 * near));
    scene.controls.update();
  }, options.near);
  await settle(page);
  const settled = Date.now() - moved - 1000;
  await page.waitForTimeout(200);
  const view = traffic(), stats = await page.evaluate(() => window.ebpoViewer.state.stats);
  const memory = await page.evaluate(() => performance.measureUserAgentSpecificMemory?.().then((m) => m.bytes).catch(() => 0));
  console.log(`  click: ${seconds(clicked)} s, ${click.requests} requests, ${kilo(click.bytes)} kB; ` +
    `close-up from ${options.near}: ${seconds(settled)} s, ${view.requests} requests, ${kilo(view.bytes)} kB, `
    + `${stats.triangles} triangles, ${stats.meshTriangles} of them real faces${memory ? `, ${kilo(memory / 1000)} MB` : ''}`);
}

async function settle(page) {
  const began = Date.now();
  await page.waitForTimeout(200);
  for (let idle = 0; idle < 10 && Date.now() - began < 180000;) {
    await page.waitForTimeout(100);
    idle = await page.evaluate(() => window.ebpoViewer.state.idle) ? idle + 1 : 0;
  }
}

const median = (list) => [...list].sort((a, b) => a - b)[list.length >> 1];
const seconds = (ms) => (ms / 1000).toFixed(2), kilo = (n) => (n / 1000).toFixed(0);

async function measure(browser, site, model) {
  const rounds = [], address = `${site}?file=models/${basename(model)}&theme=dark${options.query && '&' + options.query}`;
  let again;
  for (let round = 0; round < options.rounds; round++) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, reducedMotion: 'reduce' }), page = await context.newPage();
    await context.addInitScript(WATCH);
    traffic();
    rounds.push(await visit(page, address));
    if (round === 0) {
      if (options.pictures)
        await page.screenshot({ path: join(options.pictures, basename(model).replace('.ebpo.h5', '.png')) });
      if (options.near) {
        await closeUp(page);
        if (options.pictures)
          await page.screenshot({ path: join(options.pictures, basename(model).replace('.ebpo.h5', '_near.png')) });
      }
      if (options.mesh)
        await compare(page, rounds[0]);
      await page.goto('about:blank');
      again = await visit(page, address);
    }
    await context.close();
  }
  const of = (what) => median(rounds.map(what)), { stats } = rounds[0];
  console.log(`| ${basename(model)} | ${kilo(of((r) => r.page))} | ${seconds(of((r) => r.first))} | ${seconds(of((r) => r.settled))} | ${of((r) => r.requests)} | ${kilo(of((r) => r.bytes))} `
    + `| ${kilo(of((r) => r.line))} | ${stats.triangles} | ${stats.wallTriangles} | ${stats.meshTriangles} `
    + `| ${again.requests} | ${kilo(again.bytes)} | ${kilo(again.line)} | ${seconds(again.first)} |`);
}

let code = 0;
try {
  const site = await serve(), flags = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
  const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  const browser = await chromium.launch({ executablePath, args: process.getuid() === 0 ? ['--no-sandbox', ...flags] : flags });
  cleanup.push(() => browser.close());
  console.log(`${options.kbits} kbit/s, ${options.ms} ms, ${options.rounds} rounds${options.query && ', ' + options.query}${options.sources ? ', not bundled' : ''}; ` +
    'page and model in kB, times in s\n');
  console.log('| model | page | first picture | settled | requests | model | line | triangles | on walls | real faces | again: requests | model | line | first picture |\n' +
    '|---|---|---|---|---|---|---|---|---|---|---|---|---|---|');
  for (const model of models)
    await measure(browser, site, model);
} catch (error) {
  console.error(error);
  code = 1;
}
for (const undo of cleanup.reverse())
  await undo();
process.exit(code);
