'use strict';
// Defines the values that each table shows. The functions of columns get a level, a deadline, a target or a method. A row
// that a method does not have (it has fewer levels, or not this target) has no values.

// `of`: the name of a quantity, or a function; `why`: why the value may be absent, by default the reason in the report.
const valueOf = (of) => (typeof of === 'string' ? (row) => row[of] ?? null : (row) => of(row) ?? null);
const absences = new Map(report.quantities.map((q) => [q.name, q.absent]));

function reason(of, why) {
  return (row) => (row ? why ?? absences.get(of) ?? 'see the notes of the method' : 'the method has no such level or target');
}

const columnAs = (as) => (title, of, best, why) => ({
  title, as, best, value: (row) => (row ? valueOf(of)(row) : null), why: reason(of, why),
});
const bytes = columnAs(format.bytes), number = columnAs(format.number), count = columnAs(format.count);
const seconds = columnAs(format.seconds), share = columnAs((v) => format.percent(percent(v)));
const nanoseconds = columnAs((v) => format.seconds(fromNs(v)));
const percents = columnAs((v) => format.number(percent(v)));
const lengths = columnAs((v) => format.number(ofDiagonal(v)));
const levelNumber = columnAs(format.level);
const perQuery = columnAs(format.number);

// Makes a column of guaranteed bounds. A bound that is more than 5 % above the lower one gets a *.
function upperBound(title, lo, hi) {
  const wide = (l) => l[hi] > 1.0501 * l[lo];
  return {
    ...columnAs(known((l) => `${format.number(ofDiagonal(l[hi]))}${wide(l) ? '*' : ''}`))(title, (l) => (l[hi] === null || !(model.diagonal > 0) ? null : l)),
    why: reason(hi),
  };
}

function showTable(name, ...content) {
  document.querySelector(`[data-table=${name}]`).append(table(...content));
}

// --- methods side by side ---

function bytesUntil(method, goal) {
  return method.levels.find((l) => l.levels_excess !== null && l.levels_excess <= goal)?.cumulative_bytes ?? null;
}

function showGlance() {
  const columns = [
    bytes('file', 'file_bytes'), count('levels', 'levels_in_file'), count('planes', 'all_planes'),
    ...[10, 3, 1].map((goal) => bytes(`≤ ${goal} %`, (m) => bytesUntil(m, goal), null, 'no measured level has an excess that small')),
    seconds('build', 'build_seconds'), seconds('load', 'open_seconds'),
    bytes('memory', 'memory_bytes'), nanoseconds('point in solid, exact', 'exact_inside_ns'),
    nanoseconds('distance, exact', 'exact_distance_ns'),
  ];
  showTable('glance', 'method', [{ columns }], methods.map((m) => ({ title: m.name, of: m })));
}

// Makes a group of columns for each method. A row has an item for each method.
function byMethod(columns) {
  const ofMethod = (c, i) => ({
    ...c, value: (row) => c.value(row[i]), why: (row) => c.why(row[i]), best: (row) => methods.length > 1 && row[i] && c.best?.(row[i]),
  });
  return methods.map((m, i) => ({ title: m.name, columns: columns.map((c) => ofMethod(c, i)) }));
}

const levelRows = () => levels.map((level) => ({ title: `${level}`, of: methods.map((m) => levelOf(m, level)) }));

function showLimit() {
  const isLeast = (of) => (l) => of(l) !== null && of(l) <= least(l.level, of);
  const excess = (l) => l.excess, upToLevel = (l) => l.cumulative_bytes;
  const limit = number('%', (row) => leastOf(row, (l) => l.limit_excess), null, absences.get('limit_excess'));
  showTable('limit', 'level', [{ title: 'limit', columns: [limit] }, ...byMethod([
    number('%', excess, isLeast(excess), absences.get('excess')), number('× limit', 'excess_to_limit'),
    bytes('bytes', upToLevel, isLeast(upToLevel)),
  ])], levelRows());
}

function showDeadlines() {
  const row = (d, i) => ({ title: `${d.microseconds} µs`, of: methods.map((m) => m.deadlines[i]) });
  showTable('deadlines', 'deadline', byMethod([
    share('exact', 'deadline_exact'), lengths('width, %', 'deadline_width_p99'),
    nanoseconds('took', 'deadline_took_p99'), share('late', 'deadline_late'),
  ]), methods[0].deadlines.map(row));
}

function targetTitle(target) {
  return target.target_bytes === undefined ?
    `error ≤ ${format.percent(ofDiagonal(target.max_error))}` : `size ≤ ${format.bytes(target.target_bytes)}`;
}

// Shows the targets. The rows are the targets of the method with the greatest number of targets.
function showTargets() {
  const most = methods.reduce((a, b) => (b.targets.length > a.targets.length ? b : a)).targets;
  const same = (n) => (o) => n.max_error === o.max_error && n.target_bytes === o.target_bytes;
  byId('targets').hidden = most.length === 0;
  showTable('targets', 'target', byMethod([
    bytes('bytes', 'subset_bytes'), lengths('error ≥', 'subset_hausdorff_lo'),
    upperBound('≤', 'subset_hausdorff_lo', 'subset_hausdorff_hi'), number('ratio', 'subset_ratio'),
  ]), most.map((n) => ({ title: targetTitle(n), of: methods.map((m) => m.targets.find(same(n))) })));
}

function showTransmission() {
  byId('transmission').hidden = !methods.some((m) => m.levels.some((l) => l.thesis_bytes !== null));
  showTable('transmission', 'level', byMethod([
    bytes('cost model', 'thesis_bytes'), bytes('up to level', 'thesis_cumulative_bytes'),
    bytes('this file', 'bytes'), bytes('up to level', 'cumulative_bytes'),
  ]), levelRows());
}

// Shows build times and the excess volumes of the results.
function showBuild() {
  const built = methods.filter((m) => m.build_seconds !== null);
  const some = [...new Set([levels[0], MIDDLE, levels.at(-1)])];
  const at = (level) => number(`level ${level}, %`, (m) => levelOf(m, level)?.excess ?? null, null, absences.get('excess'));
  const columns = [
    seconds('build', 'build_seconds'), count('planes', 'all_planes'), bytes('levels', (m) => m.levels.at(-1)?.cumulative_bytes),
    ...some.map(at), number('sum of all levels, %', sumOfLevels, null, absences.get('excess')),
  ];
  byId('build').hidden = built.length === 0;
  showTable('build', 'method', [{ columns }], built.map((m) => ({ title: m.name, of: m })));
}

function showLines() {
  const times = LINES.map((line) => seconds(line.name, (l) => lineTime(line)(l), null, absences.get('line_trips')));
  byId('lines').hidden = !methods.some((m) => m.levels.some((l) => l.line_trips !== null));
  showTable('lines', 'level', byMethod([bytes('sent', 'line_bytes'), count('round trips', 'line_trips'), ...times]), levelRows());
}

function showBudgets() {
  const row = (b, i) => ({ title: b.part === 1 ? 'all' : `1/${b.part}`, of: methods.map((m) => m.budgets[i]) });
  byId('memory').hidden = !methods.some((m) => m.levels.some((l) => l.level_memory_bytes !== null)
    || m.budgets.some((b) => b.budget_distance_ns !== null));
  showTable('budgets', 'memory', byMethod([
    bytes('budget', 'budget_bytes'), levelNumber('deepest level', 'budget_level'), lengths('width, %', 'budget_width_median'),
    nanoseconds('exact', 'budget_distance_ns'), perQuery('loads', 'budget_loads'), bytes('read', 'budget_read_bytes'),
  ]), methods[0].budgets.map(row));
}

// --- one method's levels ---

const IN_THE_FILE = [
  bytes('bytes', 'bytes'), bytes('up to level', 'cumulative_bytes'), count('gray', 'gray'),
  count('leaves', 'leaf'), count('planes', 'planes'), count('of leaves', 'leaf_planes'),
];
const VOLUME = [
  number('envelopes', 'envelope_volume'), number('excess, %', 'excess'),
  number('levels alone, %', 'levels_excess'), number('limit, %', 'limit_excess'),
  number('× limit', 'excess_to_limit'),
];
const DISTANCE_TO_MODEL = [
  lengths('maximum ≥', 'hausdorff_lo'), upperBound('≤', 'hausdorff_lo', 'hausdorff_hi'),
  lengths('mean', 'distance_mean'), lengths('rms', 'distance_rms'),
];
const INSIDE = [
  percents('MAYBE, uniform, %', 'maybe_uniform'), percents('near the surface, %', 'maybe_near'),
  nanoseconds('time', 'inside_ns'),
];
const DISTANCE = [
  lengths('mean', 'width_mean'), lengths('median', 'width_median'),
  lengths('99 %', 'width_p99'), nanoseconds('time', 'distance_ns'),
];
const READING = [
  seconds('time', 'reading_seconds'), bytes('read', 'read_bytes'), count('reads', 'reads'),
  bytes('memory', 'level_memory_bytes'),
];

// With leaf planes in the file, the volume of the levels alone equals the volume.
function shapeTable(method, rows) {
  return table('level', [
    { title: 'in the file', columns: IN_THE_FILE },
    { title: 'volume', columns: VOLUME.filter((c) => !method.leaf_planes_stored || c.title !== 'levels alone, %') },
    { title: 'distance to the model, %', columns: DISTANCE_TO_MODEL },
  ], rows);
}

function queryTable(rows) {
  return table('level', [
    { title: 'point in solid down to the level', columns: INSIDE },
    { title: 'distance down to the level: width of the interval, %', columns: DISTANCE },
    { title: 'reading the level', columns: READING },
  ], rows);
}

function showMethods() {
  for (const m of methods) {
    const rows = m.levels.map((l) => ({ title: `${l.level}`, of: l }));
    byId('tables').append(element('h3', {}, m.name), shapeTable(m, rows), queryTable(rows));
  }
}

function showTables() {
  showGlance();
  showLimit();
  showBuild();
  showDeadlines();
  showBudgets();
  showLines();
  showTargets();
  showTransmission();
  showMethods();
}
