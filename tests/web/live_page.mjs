// Starts haptic devices with pages, and a headless Chromium, for haptic.mjs and for tests/bench/haptic_delay.mjs.
import { spawn } from 'node:child_process';
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

export const TIMEOUT = { timeout: 120000, polling: 50 };

/** Waits until the page has drawn the final detail and is connected to the device. */
export async function idle(tab) {
  await tab.waitForFunction(() => window.ebpoViewer?.state.idle && window.ebpoViewer.live?.connected, undefined, TIMEOUT);
}

/** Returns { launch, deviceOn }. Exits with 77 (skipped) when Chromium or the viewer's packages are not installed. */
export async function begin(ebpo, root) {
  const viewer = join(root, 'tools/web'), chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  if (!chromium || !['playwright-core', 'esbuild'].every((name) => existsSync(join(viewer, 'node_modules', name)))) {
    console.log('skipped: chromium or tools/web/node_modules is missing; run tools/install-deps.sh --tests');
    process.exit(77);
  }
  const { chromium: playwright } = await import(pathToFileURL(join(viewer, 'node_modules/playwright-core/index.mjs')));
  const flags = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
  const launch = () => playwright.launch({ executablePath: chromium, args: process.getuid() === 0 ? ['--no-sandbox', ...flags] : flags });

  // Starts a device with a page, from the bundle in the folder `page`. Returns its address, and functions that end it and return its report and messages.
  async function deviceOn(page, what, ...options) {
    const process_ = spawn(ebpo, ['haptic', '--json', '--view', '--port', '0', '--viewer', page, ...options, what], { stdio: ['ignore', 'pipe', 'pipe'] });
    let out = '', err = '';
    process_.stdout.on('data', (text) => (out += text));
    const ended = new Promise((done) => process_.once('exit', (code) => done({ code, report: code === 0 ? JSON.parse(out) : undefined, get err() { return err; } })));
    const address = await new Promise((done, fail) => {
      process_.stderr.on('data', (text) => {
        err += text;
        const found = /http:\/\/127\.0\.0\.1:\d+\//.exec(err);
        if (found)
          done(found[0]);
      });
      ended.then(() => fail(new Error(err)));
    });
    return { address, ended, stop: () => process_.kill('SIGINT'), get err() { return err; } };
  }
  return { launch, deviceOn };
}
