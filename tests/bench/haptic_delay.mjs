// Measures the time from a contact of a haptic device until the page of the viewer has submitted the drawing of its first paint to the browser, in a headless
// Chromium that draws in software: node haptic_delay.mjs EBPO MODEL.ebpo.h5 SOURCE_ROOT [TAPS]
// The device taps on the side of the model that the page shows, once a second. Taps count from when the page has drawn its final detail. Prints a table row.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { TIMEOUT, begin, idle } from '../web/live_page.mjs';

const [ebpo, model, root, taps = '60'] = process.argv.slice(2), { launch, deviceOn } = await begin(ebpo, root);
const work = mkdtempSync(join(tmpdir(), 'ebpo-delay-')), page = join(work, 'viewer'), load = () => readFileSync('/proc/loadavg', 'utf8').split(' ')[0];
const { box_origin: low, box_size: size, faces } = JSON.parse(execFileSync(ebpo, ['info', '--json', model], { encoding: 'utf8' }));
const diagonal = Math.hypot(...size), VIEW = [0.42, 0.32, 0.85].map((x) => x / Math.hypot(0.42, 0.32, 0.85)), STEPS = 500; // VIEW: from the model to the page's camera

// Returns a path that taps on the first faces of rays from the camera, one in STEPS * 2 steps.
function tapPath() {
  const starts = Array.from({ length: 4 * Number(taps) }, (_, i) => low.map((x, k) => x + size[k] * (0.5 + 0.3 * Math.sin((2 + k) * i)) + diagonal * VIEW[k]));
  const rays = starts.map((p) => [...p, ...VIEW.map((x) => -x)].join(' ')).join('\n');
  const hits = execFileSync(ebpo, ['ray', '--json', model], { input: rays, encoding: 'utf8' }).trim().split('\n').map((line) => JSON.parse(line)?.t);
  const lines = [], at = (p, t) => lines.push(p.map((x, k) => x - t * VIEW[k]).join(' '));
  starts.map((p, i) => [p, hits[i]]).filter(([, t]) => t > 0).slice(0, Number(taps)).forEach(([p, t]) => {
    for (let i = -STEPS; i <= STEPS; i++)
      at(p, t * (1 - Math.max(0, Math.abs(i / STEPS) - 0.1)) + (Math.abs(i / STEPS) < 0.1 ? 0.005 * diagonal : 0));
  });
  return lines.join('\n');
}

writeFileSync(join(work, 'taps.txt'), tapPath());
execFileSync('node', [join(root, 'tools/web/bundle.mjs'), page]);
const browser = await launch();
try {
  const tab = await browser.newPage({ viewport: { width: 480, height: 360 } });
  const haptic = await deviceOn(page, model, '--memory', '256M', '--path', join(work, 'taps.txt'), '--paint', join(work, 'a.paint.h5'), '--pen-radius', String(diagonal / 100));
  await tab.goto(haptic.address);
  await idle(tab);
  const before = load(), early = await tab.evaluate(() => window.ebpoViewer.live.delays.length);
  await tab.waitForFunction(() => window.ebpoViewer.live.ended, undefined, { ...TIMEOUT, timeout: 2000 * Number(taps) + TIMEOUT.timeout });
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
