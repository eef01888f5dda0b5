// Measures the viewer over a slow line, in a headless Chromium: viewed.mjs VIEWER ADDRESS LOG MODEL EYE AT [PICTURE] -> JSON. Each measurement uses a newly opened page:
// the first picture, and the time to the last request; a click until its exact distance; a close-up until it has settled. Seconds are measured in the page, requests and bytes from LOG.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [viewer, address, log, model, eye, at, picture] = process.argv.slice(2), LONG = { timeout: 600000, polling: 'raf' };
const { chromium } = await import(pathToFileURL(join(viewer, 'node_modules/playwright-core/index.mjs')));
const gl = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: process.getuid() === 0 ? ['--no-sandbox', ...gl] : gl });
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

// Returns requests and bytes of the model and of the page since the last call.
let read = 0;
async function traffic() {
  await pause(300);
  const lines = readFileSync(log, 'utf8').split('\n').slice(read, -1), sum = { model: [0, 0], page: [0, 0] };
  read += lines.length;
  for (const line of lines) {
    const [, path, bytes] = /"\w+ (\S+) [^"]*" \d+ (\d+)/.exec(line), to = path.split('?')[0].endsWith(model) ? sum.model : sum.page;
    to[0]++;
    to[1] += Number(bytes);
  }
  return sum;
}

// Waits until no request was sent for two seconds, because requests for finer detail follow the first ones.
async function settledAt(page) {
  for (let since, now; ; await pause(50)) {
    const { idle, error } = await page.evaluate(() => window.ebpoViewer?.state ?? {});
    if (error)
      throw new Error(error.message);
    now = Date.now();
    since = idle ? since ?? now : undefined;
    if (now - since > 2000)
      return since;
  }
}

// Opens the page with an empty cache, and waits for its first picture.
async function open() {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, reducedMotion: 'reduce' }), page = await context.newPage();
  await page.goto(address, { waitUntil: 'commit' });
  const seconds = await page.waitForFunction(() => window.ebpoViewer?.state.shownAfter !== undefined && new Promise((done) =>
    requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now() / 1000)))), undefined, LONG).then((h) => h.jsonValue());
  return { page, seconds };
}

async function first() {
  const { page, seconds } = await open(), picked = { seconds, ...await traffic() }, begin = Date.now() - 1000 * seconds;
  const settled = { seconds: (await settledAt(page) - begin) / 1000, ...await traffic() };
  if (picture)
    await page.screenshot({ path: `${picture}-first.png` });
  return { page, first: picked, settled };
}

// Returns the position nearest to the middle of the canvas where the model is visible.
const middle = (page) => page.evaluate(() => {
  const { scene } = window.ebpoViewer, box = document.getElementById('canvas').getBoundingClientRect();
  for (let r = 0; r < 300; r += 10)
    for (let turn = 0; turn < 6.28; turn += 0.5) {
      const [x, y] = [box.left + box.width / 2 + r * Math.cos(turn), box.top + box.height / 2 + r * Math.sin(turn)];
      if (scene.pick(x, y) && document.elementFromPoint(x, y).id === 'canvas')
        return [x, y];
    }
  throw new Error('the model is not seen');
});

async function click(page) {
  const place = await middle(page);
  await traffic();
  const begin = Date.now();
  await page.mouse.click(...place);
  await page.waitForFunction(() => window.ebpoViewer.state.probe?.exact, undefined, LONG);
  const seconds = (Date.now() - begin) / 1000;
  return { seconds, ...await traffic() };
}

async function closeUp(page) {
  await traffic();
  const begin = Date.now();
  await page.evaluate(([from, to]) => {
    const { scene, place } = window.ebpoViewer, inScene = (p) => p.map((x, k) => (x - place.center[k]) * place.scale);
    scene.camera.position.set(...inScene(from));
    scene.controls.target.set(...inScene(to));
    scene.controls.update();
    scene.redraw();
  }, [eye, at].map((p) => p.split(',').map(Number)));
  await pause(500); // the worker receives a new camera with a delay
  const seconds = (await settledAt(page) - begin) / 1000, stats = await page.evaluate(() => window.ebpoViewer.state.stats);
  if (picture)
    await page.screenshot({ path: `${picture}-close.png` });
  return { seconds, ...await traffic(), stats };
}

const { page, ...found } = await first();
found.click = await click(page);
await page.context().close();
const again = await first();
found.close = await closeUp(again.page);
console.log(JSON.stringify(found));
await browser.close();
