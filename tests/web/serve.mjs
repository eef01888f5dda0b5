// Opens the page of `ebpo serve` in a headless Chromium: serve.mjs EBPO GENERATE SOURCE_ROOT
// Exits with 77 (skipped) when Chromium or the viewer's packages are not installed; tools/install-deps.sh --tests installs them.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [ebpo, generate, root] = process.argv.slice(2), viewer = join(root, 'tools/web');
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
if (!chromium || !['playwright-core', 'esbuild'].every((name) => existsSync(join(viewer, 'node_modules', name)))) {
  console.log('skipped: chromium or tools/web/node_modules is missing; run tools/install-deps.sh --tests');
  process.exit(77);
}
const { chromium: playwright } = await import(pathToFileURL(join(viewer, 'node_modules/playwright-core/index.mjs')));
const work = mkdtempSync(join(tmpdir(), 'ebpo-serve-')), page = join(work, 'viewer'), TIMEOUT = { timeout: 120000, polling: 100 };
const run = (program, ...args) => execFileSync(program, args, { encoding: 'utf8' });

// Starts the command, and returns the address that it prints.
async function serve(...models) {
  const server = spawn(ebpo, ['serve', '-q', '--port', '0', '--viewer', page, ...models], { stdio: ['ignore', 'pipe', 'inherit'] });
  const [line] = await new Promise((done) => server.stdout.once('data', (text) => done(String(text).split('\n'))));
  const end = () => new Promise((done) => server.once('exit', done).kill('SIGINT'));
  return { address: line, end };
}

run('node', join(viewer, 'bundle.mjs'), page);
for (const name of ['ring', 'a b#']) {
  run(generate, '--base', 'torus', '--faces', '3000', join(work, 'ring.ply'));
  run(ebpo, 'convert', '-q', join(work, 'ring.ply'), join(work, `${name}.ebpo.h5`));
}
const flags = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
const browser = await playwright.launch({ executablePath: chromium, args: process.getuid() === 0 ? ['--no-sandbox', ...flags] : flags });
try {
  const tab = await browser.newPage(), complaints = [];
  tab.on('pageerror', (e) => complaints.push(e.message));
  tab.on('console', (m) => m.type() === 'error' && complaints.push(m.text()));
  const opened = async (name) => {
    await tab.waitForFunction(() => window.ebpoViewer?.state.idle || window.ebpoViewer?.state.error, undefined, TIMEOUT);
    assert.equal(await tab.evaluate(() => window.ebpoViewer.state.error ?? null), null);
    assert.equal(await tab.textContent('#name'), `${name}.ebpo.h5`);
  };
  const list = await serve(join(work, 'ring.ebpo.h5'), join(work, 'a b#.ebpo.h5'));
  await tab.goto(list.address);
  await tab.waitForFunction(() => document.querySelectorAll('#samples li').length === 2 && [...document.querySelectorAll('#samples img')].every((i) => i.complete), undefined, TIMEOUT);
  assert.ok((await tab.evaluate(() => [...document.querySelectorAll('#samples img')].map((i) => i.naturalWidth))).every((width) => width === 320));
  await tab.click('#samples li:nth-child(2) a');
  await opened('a b#');
  assert.equal(await list.end(), 0);
  const single = await serve(join(work, 'ring.ebpo.h5'));
  await tab.goto(single.address);
  await opened('ring');
  assert.equal(await single.end(), 0);
  assert.deepEqual(complaints, []);
  console.log('OK: a list of two models, and a single one');
} finally {
  await browser.close();
  rmSync(work, { recursive: true, force: true });
}
