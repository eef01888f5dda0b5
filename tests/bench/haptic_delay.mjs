// Measures the time from a contact of a haptic device until the page of the viewer has submitted the drawing of its first paint to the browser, in a headless
// Chromium that draws in software: node haptic_delay.mjs EBPO MODEL.ebpo.h5 SOURCE_ROOT [SECONDS]
// The built-in device touches and leaves the model about once in two seconds; contacts count from when the page has drawn its final detail. Prints a row for
// docs/measured/haptic.md.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { TIMEOUT, begin, idle } from '../web/live_page.mjs';

const [ebpo, model, root, seconds = '60'] = process.argv.slice(2), { launch, deviceOn } = await begin(ebpo, root);
const work = mkdtempSync(join(tmpdir(), 'ebpo-delay-')), page = join(work, 'viewer'), load = () => readFileSync('/proc/loadavg', 'utf8').split(' ')[0];
const { box_size: size, faces } = JSON.parse(execFileSync(ebpo, ['info', '--json', model], { encoding: 'utf8' }));
execFileSync('node', [join(root, 'tools/web/bundle.mjs'), page]);
const browser = await launch();
try {
  const tab = await browser.newPage({ viewport: { width: 960, height: 720 } });
  const haptic = await deviceOn(page, model, '--memory', '256M', '--seconds', seconds, '--paint', join(work, 'a.paint.h5'), '--pen-radius', String(Math.hypot(...size) / 100));
  await tab.goto(haptic.address);
  await idle(tab);
  const before = load(), early = await tab.evaluate(() => window.ebpoViewer.live.delays.length);
  await tab.waitForFunction(() => window.ebpoViewer.live.ended, undefined, { ...TIMEOUT, timeout: 2000 * Number(seconds) + TIMEOUT.timeout });
  const [arrivals, delays] = await tab.evaluate((n) => [window.ebpoViewer.live.arrivals.slice(n), window.ebpoViewer.live.delays.slice(n)], early), { code, err } = await haptic.ended;
  if (code !== 0)
    throw new Error(err);
  const at = (list, share) => Math.round([...list].sort((a, b) => a - b)[Math.ceil(share * list.length) - 1]);
  console.log('| faces | contacts | paint arrived p50, ms | max | drawing submitted p50, ms | p90 | max | above 50 ms | load |\n|---|---|---|---|---|---|---|---|---|');
  console.log(`| ${faces.toLocaleString('en')} | ${delays.length} | ${at(arrivals, 0.5)} | ${at(arrivals, 1)} | ${at(delays, 0.5)} | ${at(delays, 0.9)} | ${at(delays, 1)} | ${
    delays.filter((ms) => ms > 50).length} | ${before} to ${load()} |`);
} finally {
  await browser.close();
  rmSync(work, { recursive: true, force: true });
}
