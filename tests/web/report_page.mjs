// Tests the pages of `ebpo report` in a headless Chromium: report_page.mjs EBPO CLI_INPUTS SOURCE_ROOT
// Each page must show without errors, warnings or further requests. Values in tables and plots must agree with report.json.
// Exits with 77 (skipped) when Chromium or the viewer's packages are missing; tools/install-deps.sh --tests installs them.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [ebpo, inputs, root] = process.argv.slice(2), packages = join(root, 'tools/web/node_modules');
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
if (!chromium || !existsSync(join(packages, 'playwright-core'))) {
  console.log('skipped: chromium or tools/web/node_modules is missing; run tools/install-deps.sh --tests');
  process.exit(77);
}
const { chromium: playwright } = await import(pathToFileURL(join(packages, 'playwright-core/index.mjs')));

const work = mkdtempSync(join(tmpdir(), 'ebpo-report-')), input = (name) => join(work, name);
const run = (program, args) => execFileSync(program, args, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'inherit'] });
// A triangle with both orientations: a solid without volume.
const FLAT = `ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
3 0 2 1
`;
const ODD = "<long> & 'odd'";

// --- formats of values ---

const UNITS = { '': 1, '%': 1, '×': 1, B: 1, kB: 1e3, MB: 1e6, s: 1, ms: 1e-3, 'µs': 1e-6, ns: 1e-9 };

// Returns the value of a text such as "12.3 kB", or null for a dash.
function valueOf(text) {
  if (text === '–')
    return null;
  const [, digits, unit] = /^([0-9.,e+-]+)\*? ?(\S*)$/.exec(text) ?? assert.fail(`'${text}' is not a value`);
  assert.ok(unit in UNITS, text);
  return Number(digits.replaceAll(',', '')) * UNITS[unit];
}

function same(text, figure, what) {
  const shown = valueOf(text), expected = figure ?? null;
  if (shown === null || expected === null)
    assert.equal(shown, expected, `${what}: ${text}`);
  else
    assert.ok(Math.abs(shown - expected) <= 0.0051 * Math.abs(expected), `${what}: ${text}, not ${expected}`);
}

// --- tables ---

const figure = (name, factor = 1) => (row) => (row?.[name] == null ? null : factor * row[name]);
const LIMIT = ['excess', 'excess_to_limit', 'cumulative_bytes'].map((n) => figure(n));
const SENT = ['thesis_bytes', 'thesis_cumulative_bytes', 'bytes', 'cumulative_bytes'].map((n) => figure(n));
const GLANCE = [
  figure('file_bytes'), figure('levels_in_file'), figure('all_planes'), null, null, null, figure('build_seconds'),
  figure('open_seconds'), figure('memory_bytes'), figure('exact_inside_ns', 1e-9), figure('exact_distance_ns', 1e-9),
];

const LINES = [[0.1, 1.25e6], [0.02, 1.25e7]];
const onLine = ([trip, rate]) => (l) => (l?.line_trips == null ? null : l.line_trips * trip + l.line_bytes / rate);
const LINE = [figure('line_bytes'), figure('line_trips'), ...LINES.map(onLine)];

// Returns all levels, and the levels in the table of build times: the first, one in the middle, and the last.
function levelsOf(report) {
  const deepest = Math.max(...report.methods.map((m) => m.levels.at(-1).level));
  const numbers = Array.from({ length: deepest - report.levels.first + 1 }, (_, i) => report.levels.first + i);
  return { numbers, some: [...new Set([numbers[0], numbers[Math.floor(numbers.length / 2)], numbers.at(-1)])] };
}

const excessAt = (n) => (m) => m.levels.find((l) => l.level === n)?.excess ?? null;

function buildColumns(report) {
  const sum = (m) => (m.levels.some((l) => l.excess === null) ? null : m.levels.reduce((s, l) => s + 100 + l.excess, 0));
  const all = (m) => m.levels.at(-1).cumulative_bytes;
  return [figure('build_seconds'), figure('all_planes'), all, ...levelsOf(report).some.map(excessAt), sum];
}

function lengths(report, ...names) {
  return names.map((n) => (report.model.diagonal > 0 ? figure(n, 100 / report.model.diagonal) : () => null));
}

function shapeColumns(report, method) {
  const volume = ['envelope_volume', 'excess', 'levels_excess', 'limit_excess', 'excess_to_limit'];
  return [
    ...['bytes', 'cumulative_bytes', 'gray', 'leaf', 'planes', 'leaf_planes'].map((n) => figure(n)),
    ...volume.filter((n) => n !== 'levels_excess' || !method.leaf_planes_stored).map((n) => figure(n)),
    ...lengths(report, 'hausdorff_lo', 'hausdorff_hi', 'distance_mean', 'distance_rms'),
  ];
}

const queryColumns = (report) => [
  figure('maybe_uniform', 100), figure('maybe_near', 100), figure('inside_ns', 1e-9),
  ...lengths(report, 'width_mean', 'width_median', 'width_p99'), figure('distance_ns', 1e-9),
  figure('reading_seconds'), figure('read_bytes'), figure('reads'), figure('level_memory_bytes'),
];

function rowsAgree(table, rows, columns, what) {
  assert.equal(table.length, rows.length, what);
  table.forEach((cells, i) => {
    assert.equal(cells.length, columns.length, what);
    cells.forEach((text, k) => columns[k] && same(text, columns[k](rows[i]), `${what}, row ${i}, column ${k}`));
  });
}

// Returns columns for rows that have one item for each method. All methods have the same columns.
const perMethod = (report, columns) => report.methods.flatMap((_, i) => columns.map((c) => (row) => c(row[i])));

function tablesAgree(report, { tables, ofMethods }) {
  const { methods } = report, { numbers } = levelsOf(report);
  const levelRows = numbers.map((n) => methods.map((m) => m.levels.find((l) => l.level === n)));
  const dueRows = methods[0].deadlines.map((_, i) => methods.map((m) => m.deadlines[i]));
  const [width] = lengths(report, 'deadline_width_p99');
  const due = [figure('deadline_exact', 100), width, figure('deadline_took_p99', 1e-9), figure('deadline_late', 100)];
  rowsAgree(tables.glance, methods, GLANCE, 'glance');
  rowsAgree(tables.limit, levelRows, [null, ...perMethod(report, LIMIT)], 'limit');
  rowsAgree(tables.deadlines, dueRows, perMethod(report, due), 'deadlines');
  rowsAgree(tables.build, methods.filter((m) => m.build_seconds !== null), buildColumns(report), 'build');
  rowsAgree(tables.lines, levelRows, perMethod(report, LINE), 'lines');
  const [known] = lengths(report, 'budget_width_median'), loads = figure('budget_loads'), read = figure('budget_read_bytes');
  const budget = [figure('budget_bytes'), figure('budget_level'), known, figure('budget_distance_ns', 1e-9), loads, read];
  rowsAgree(tables.budgets, methods[0].budgets.map((_, i) => methods.map((m) => m.budgets[i])), perMethod(report, budget), 'budgets');
  rowsAgree(tables.transmission, levelRows, perMethod(report, SENT), 'transmission');
  if (methods.length === 1) {
    const target = [figure('subset_bytes'), ...lengths(report, 'subset_hausdorff_lo', 'subset_hausdorff_hi'), figure('subset_ratio')];
    rowsAgree(tables.targets, methods[0].targets, target, 'targets');
  }
  assert.equal(ofMethods.length, 2 * methods.length);
  methods.forEach((m, i) => {
    rowsAgree(ofMethods[2 * i], m.levels, shapeColumns(report, m), `${m.name}, shapes`);
    rowsAgree(ofMethods[2 * i + 1], m.levels, queryColumns(report), `${m.name}, queries`);
  });
}

// --- plots ---

const far = (report, name) => lengths(report, name)[0];
const level = figure('level'), soFar = figure('cumulative_bytes'), have = figure('reading_seconds');
const plotAxes = (report) => {
  const solid = report.methods.some((m) => m.levels.some((l) => l.excess !== null));
  const known = figure(solid ? 'excess' : 'envelope_volume'), alone = figure(solid ? 'levels_excess' : 'levels_volume');
  const deadline = figure('microseconds', 1e-6);
  return {
    'volume-by-level': [level, known], 'ratio-by-level': [level, figure('excess_to_limit')],
    'volume-by-bytes': [soFar, alone], 'farthest-by-bytes': [soFar, far(report, 'hausdorff_hi')],
    'mean-by-bytes': [soFar, far(report, 'distance_mean')], 'maybe-by-bytes': [soFar, figure('maybe_near', 100)],
    'volume-by-time': [have, alone], 'farthest-by-time': [have, far(report, 'hausdorff_hi')],
    'maybe-by-time': [figure('inside_ns', 1e-9), figure('maybe_uniform', 100)],
    'width-by-time': [figure('distance_ns', 1e-9), far(report, 'width_median')],
    ...Object.fromEntries(['slow', 'fast'].flatMap((name, i) => [
      [`volume-by-${name}-line`, [onLine(LINES[i]), alone]],
      [`farthest-by-${name}-line`, [onLine(LINES[i]), far(report, 'hausdorff_hi')]],
    ])),
    ...Object.fromEntries(['first', 'middle'].map((name, i) => [`${name}-by-build`, [figure('build_seconds'), excessAt(levelsOf(report).some[i] ?? levelsOf(report).some[0])]])),
    'volume-by-memory': [figure('level_memory_bytes'), alone],
    'width-by-memory': [figure('level_memory_bytes'), far(report, 'width_median')],
    'distance-by-budget': [figure('budget_bytes'), figure('budget_distance_ns', 1e-9)],
    'width-by-deadline': [deadline, far(report, 'deadline_width_p99')],
    'taken-by-deadline': [deadline, figure('deadline_took_p99', 1e-9), figure('deadline_took_median', 1e-9)],
    ...(report.methods.some((m) => m.levels.some((l) => l.thesis_bytes !== null)) && {
      'sent-so-far': [level, soFar, figure('thesis_cumulative_bytes')],
      'sent-by-level': [level, figure('bytes'), figure('thesis_bytes')],
    }),
  };
};

// Returns the points that are within the axes: levels from 0 on, other values greater than 0.
function pointsOf(rows, x, y) {
  const fits = (v, of) => v !== null && (of === level ? v >= 0 : v > 0);
  return rows.map((r) => [x(r), y(r)]).filter(([a, b]) => fits(a, x) && fits(b, y));
}

// Returns the expected lines: those of each method, then the dotted lines of each method.
function expectedLines(report, name, [x, ...ys]) {
  if (name.endsWith('build')) { // one line for each selection
    const families = [...new Set(report.methods.map((m) => m.selection))], [y] = ys;
    const members = (s) => report.methods.filter((m) => m.selection === s);
    return families.map((s) => [s, pointsOf(members(s), x, y)]).filter(([, points]) => points.length);
  }
  const rows = (m) => (name.endsWith('deadline') ? m.deadlines : name.endsWith('budget') ? m.budgets : m.levels);
  return ys.flatMap((y) => report.methods.map((m) => [m.name, pointsOf(rows(m), x, y)])).filter(([, points]) => points.length);
}

function plotsAgree(report, plots, count) {
  let drawn = 0;
  for (const [name, axes] of Object.entries(plotAxes(report))) {
    const expected = expectedLines(report, name, axes), { lines, limits, inside } = plots[name] ?? { lines: [] };
    assert.equal(lines.filter((l) => !l.reference).length, expected.length, name);
    expected.forEach(([method, points], i) => {
      assert.equal(lines[i].name, method, name);
      assert.equal(lines[i].points.length, points.length, `${name}, ${method}`);
      lines[i].points.forEach((p, k) => p.forEach((v, axis) => assert.ok(Math.abs(v / points[k][axis] - 1) < 1e-9 || v === points[k][axis], name)));
    });
    assert.ok(!expected.length || inside, `${name}: points are outside ${JSON.stringify(limits)}`);
    drawn += expected.length > 0;
  }
  assert.equal(drawn, Object.keys(plots).length);
  assert.ok(drawn >= count, `${drawn} plots, not ${count}`);
}

// --- the pages ---

// Returns the contents of the page. Runs in the page.
function look() {
  const texts = (table) => [...table.querySelectorAll('tbody tr')].map((tr) => [...tr.querySelectorAll('td')].map((td) => td.textContent));
  const placed = [...document.querySelectorAll('[data-table]')].map((d) => [d.dataset.table, texts(d.querySelector('table'))]);
  const plots = [...charts].map(([name, chart]) => {
    const { x, y } = chart.scales;
    const lines = chart.data.datasets.map((d) => ({ name: d.label, reference: d.method === undefined, points: d.data.map((p) => [p.x, p.y]) }));
    const inside = lines.every((l) => l.points.every(([a, b]) => x.min <= a && a <= x.max && y.min <= b && b <= y.max));
    const ink = new Set(chart.canvas.getContext('2d').getImageData(0, 0, chart.canvas.width, chart.canvas.height).data).size;
    return [name, { lines, inside, ink, limits: [x.min, x.max, y.min, y.max], ticks: [x, y].map((s) => s.ticks.filter((t) => t.label).length) }];
  });
  const text = [...document.querySelectorAll('main > :not(#notes)')].map((e) => e.innerText).join('\n');
  const pictures = [...document.images].map((i) => i.complete && i.naturalWidth > 0);
  return {
    done: document.documentElement.dataset.shown, title: document.querySelector('h1').textContent, text, pictures,
    wide: document.documentElement.scrollWidth - innerWidth, tables: Object.fromEntries(placed),
    ofMethods: [...document.querySelectorAll('#tables table')].map(texts), plots: Object.fromEntries(plots),
    unexplained: [...document.querySelectorAll('td.none')].filter((td) => !td.title || !byId('missing').innerText.includes(td.title)).length,
    shownPlots: [...document.querySelectorAll('canvas')].filter((c) => c.checkVisibility()).length,
  };
}

async function show(browser, folder, viewport, colorScheme) {
  const page = await browser.newPage({ viewport, colorScheme }), complaints = [], requested = [];
  page.on('pageerror', (e) => complaints.push(e.message));
  page.on('console', (m) => complaints.push(m.text()));
  page.on('request', (r) => r.url().startsWith('data:') || requested.push(r.url()));
  const address = pathToFileURL(join(folder, 'report.html')).href;
  await page.goto(address);
  const seen = await page.evaluate(look);
  await page.close();
  assert.deepEqual(complaints, []);
  assert.deepEqual(requested, [address]);
  return seen;
}

function everywhere(report, seen, pictures) {
  assert.equal(seen.done, 'all');
  assert.equal(seen.title, report.model.name);
  assert.equal(seen.unexplained, 0, 'dashes without a reason');
  assert.ok(seen.wide <= 0, `wider than the window by ${seen.wide}`);
  assert.ok(!/\b(NaN|undefined|null|Infinity)\b|\[object/.test(seen.text), 'an invalid value in the text');
  assert.ok(seen.pictures.every(Boolean) && seen.pictures.length === pictures, `${seen.pictures.length} pictures, not ${pictures}`);
  assert.equal(seen.shownPlots, Object.keys(seen.plots).length);
  for (const [name, { ink, ticks }] of Object.entries(seen.plots)) {
    assert.ok(ink > 20, `${name} is empty`);
    assert.ok(ticks[0] >= 1 && ticks[1] >= 2, `${name}: ${ticks} labels at the axes`);
  }
}

async function check(browser, name, { plots, pictures }, ...args) {
  const folder = join(work, name);
  run(ebpo, ['report', '-q', '--points', '50', '-o', folder, ...args]);
  const report = JSON.parse(readFileSync(join(folder, 'report.json'), 'utf8'));
  const shown = report.without_pictures ? 0 : pictures;
  const seen = await show(browser, folder, { width: 1280, height: 900 }, 'light');
  everywhere(report, seen, shown);
  tablesAgree(report, seen);
  plotsAgree(report, seen.plots, plots);
  everywhere(report, await show(browser, folder, { width: 390, height: 800 }, 'dark'), shown);
  console.log(`${name}: OK`);
  return seen;
}

async function checkAll(browser) {
  const a = input('a.ebpo.h5'), b = input('b.ebpo.h5'), bare = input('bare.ebpo.h5');
  run(ebpo, ['convert', '-q', '--max-level', '2', input('sphere.ply'), a]);
  run(ebpo, ['convert', '-q', '--max-level', '3', '--profile', 'full', input('sphere.ply'), b]);
  run(ebpo, ['convert', '-q', '--max-level', '2', '--parts', '-mesh', input('torus.ply'), bare]);
  await check(browser, 'usual', { plots: 10, pictures: 0 }, '--select', 'inherit,kmedoids,offset', '--percent', '10,40', '--no-pictures', '--max-level', '3', input('torus.ply'));
  const odd = await check(browser, 'files', { plots: 10, pictures: 8 }, '--name', 'short', '--name', ODD, a, b);
  assert.ok(odd.text.split(ODD).length > 5);
  await check(browser, 'some', { plots: 8, pictures: 3 }, '--targets', '--levels', '1-2', b);
  await check(browser, 'surface', { plots: 4, pictures: 0 }, '--no-pictures', '--max-level', '2', input('open_box.ply'));
  await check(browser, 'leaf', { plots: 1, pictures: 2 }, '--max-level', '0', input('tetrahedron.ply'));
  writeFileSync(input('flat.ply'), FLAT);
  await check(browser, 'flat', { plots: 1, pictures: 2 }, '--max-level', '1', input('flat.ply'));
  await check(browser, 'bare', { plots: 5, pictures: 3 }, bare);
}

let browser;
try {
  run(inputs, [work]);
  browser = await playwright.launch({ executablePath: chromium, args: process.getuid() === 0 ? ['--no-sandbox'] : [] });
  await checkAll(browser);
} finally {
  await browser?.close();
  rmSync(work, { recursive: true, force: true });
}
