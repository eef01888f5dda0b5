// Runs one reader in a headless Chromium: browser.mjs VIEWER SITE READER URL TO|whole -> JSON. Page and worker come from SITE, the model from URL.
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [viewer, site, reader, url, to] = process.argv.slice(2);
const { chromium } = await import(pathToFileURL(join(viewer, 'node_modules/playwright-core/index.mjs')));
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: process.getuid() === 0 ? ['--no-sandbox'] : [] });
const page = await browser.newPage();
await page.goto(`${site}/bench.html`);
const result = await page.evaluate(([reader, url, to]) => new Promise((done) => {
  const worker = new Worker('/worker.js', { type: 'module' });
  worker.onmessage = ({ data }) => done(data);
  worker.onerror = (e) => done({ failed: e.message });
  worker.postMessage({ reader, url, to: Number(to), whole: to === 'whole' });
}), [reader, url, to]);
console.log(JSON.stringify(result));
await browser.close();
