'use strict';
// Which figures each table shows. Columns' functions get a level, a deadline, a need or a method. A row that is not
// there (a method has fewer levels, or not this need) has no figures.

// `of`: a quantity's name, or a function; `why`: why it may be absent, else the quantity itself knows.
const figureOf = (of) => (typeof of === 'string' ? (row) => row[of] ?? null : (row) => of(row) ?? null);
const absences = new Map(report.quantities.map((q) => [q.name, q.absent]));

function reason(of, why) {
  return (row) => (row ? why ?? absences.get(of) ?? 'see the notes of the method' : 'the method has no such level or need');
}

const columnAs = (as) => (title, of, best, why) => ({
  title, as, best, value: (row) => (row ? figureOf(of)(row) : null), why: reason(of, why),
});
const bytes = columnAs(format.bytes), number = columnAs(format.number), count = columnAs(format.count);
const seconds = columnAs(format.seconds), share = columnAs((v) => format.percent(percent(v)));
const nanoseconds = columnAs((v) => format.seconds(fromNs(v)));
const percents = columnAs((v) => format.number(percent(v)));
const lengths = columnAs((v) => format.number(ofDiagonal(v)));
const levelNumber = columnAs(format.level);
const perQuestion = columnAs(format.number);

// A guaranteed bound; one that is more than 5 % above the lower one is marked.
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
    ...[10, 3, 1].map((goal) => bytes(`≤ ${goal} %`, (m) => bytesUntil(m, goal), null, 'no level that was measured comes so close')),
    seconds('build', 'build_seconds'), seconds('into memory', 'open_seconds'),
    bytes('memory', 'memory_bytes'), nanoseconds('point in solid, exact', 'exact_inside_ns'),
    nanoseconds('distance, exact', 'exact_distance_ns'),
  ];
  showTable('glance', 'method', [{ columns }], methods.map((m) => ({ title: m.name, of: m })));
}

// A group of columns for each method; a row holds something for each.
function byMethod(columns) {
  const ofMethod = (c, i) => ({
    ...c, value: (row) => c.value(row[i]), why: (row) => c.why(row[i]), best: (row) => methods.length > 1 && row[i] && c.best?.(row[i]),
  });
  return methods.map((m, i) => ({ title: m.name, columns: columns.map((c) => ofMethod(c, i)) }));
}

const levelRows = () => levels.map((level) => ({ title: `${level}`, of: methods.map((m) => levelOf(m, level)) }));

function showLimit() {
  const isLeast = (of) => (l) => of(l) !== null && of(l) <= least(l.level, of);
  const excess = (l) => l.excess, soFar = (l) => l.cumulative_bytes;
  const limit = number('%', (row) => leastOf(row, (l) => l.limit_excess), null, absences.get('limit_excess'));
  showTable('limit', 'level', [{ title: 'limit', columns: [limit] }, ...byMethod([
    number('%', excess, isLeast(excess), absences.get('excess')), number('× limit', 'excess_to_limit'),
    bytes('bytes', soFar, isLeast(soFar)),
  ])], levelRows());
}

function showDeadlines() {
  const row = (d, i) => ({ title: `${d.microseconds} µs`, of: methods.map((m) => m.deadlines[i]) });
  showTable('deadlines', 'within', byMethod([
    share('exact', 'deadline_exact'), lengths('width, %', 'deadline_width_p99'),
    nanoseconds('took', 'deadline_took_p99'), share('late', 'deadline_late'),
  ]), methods[0].deadlines.map(row));
}

function needTitle(need) {
  return need.target_bytes === undefined ?
    `error ≤ ${format.percent(ofDiagonal(need.max_error))}` : `size ≤ ${format.bytes(need.target_bytes)}`;
}

// Rows are the needs of the method that has most of them.
function showNeeds() {
  const most = methods.reduce((a, b) => (b.needs.length > a.needs.length ? b : a)).needs;
  const same = (n) => (o) => n.max_error === o.max_error && n.target_bytes === o.target_bytes;
  byId('needs').hidden = most.length === 0;
  showTable('needs', 'asked for', byMethod([
    bytes('bytes', 'need_bytes'), lengths('reaches ≥', 'need_hausdorff_lo'),
    upperBound('≤', 'need_hausdorff_lo', 'need_hausdorff_hi'), number('kept', 'need_ratio'),
  ]), most.map((n) => ({ title: needTitle(n), of: methods.map((m) => m.needs.find(same(n))) })));
}

function showTransmission() {
  byId('transmission').hidden = !methods.some((m) => m.levels.some((l) => l.thesis_bytes !== null));
  showTable('transmission', 'level', byMethod([
    bytes('theirs', 'thesis_bytes'), bytes('so far', 'thesis_cumulative_bytes'),
    bytes('ours', 'bytes'), bytes('so far', 'cumulative_bytes'),
  ]), levelRows());
}

// The theses' own trade: what a build costs, and what comes of it.
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
  showTable('lines', 'level', byMethod([bytes('sent', 'line_bytes'), count('trips', 'line_trips'), ...times]), levelRows());
}

function showBudgets() {
  const row = (b, i) => ({ title: b.part === 1 ? 'all' : `1/${b.part}`, of: methods.map((m) => m.budgets[i]) });
  byId('memory').hidden = !methods.some((m) => m.levels.some((l) => l.level_memory_bytes !== null)
    || m.budgets.some((b) => b.budget_distance_ns !== null));
  showTable('budgets', 'memory', byMethod([
    bytes('budget', 'budget_bytes'), levelNumber('to level', 'budget_level'), lengths('width, %', 'budget_width_median'),
    nanoseconds('exact', 'budget_distance_ns'), perQuestion('loads', 'budget_loads'), bytes('read', 'budget_read_bytes'),
  ]), methods[0].budgets.map(row));
}

// --- one method's levels ---

const IN_THE_FILE = [
  bytes('bytes', 'bytes'), bytes('so far', 'cumulative_bytes'), count('gray', 'gray'),
  count('leaves', 'leaf'), count('planes', 'planes'), count('of leaves', 'leaf_planes'),
];
const VOLUME = [
  number('envelopes', 'envelope_volume'), number('excess, %', 'excess'),
  number('levels alone, %', 'levels_excess'), number('limit’s, %', 'limit_excess'),
  number('× limit', 'excess_to_limit'),
];
const DISTANCE_TO_MODEL = [
  lengths('farthest ≥', 'hausdorff_lo'), upperBound('≤', 'hausdorff_lo', 'hausdorff_hi'),
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
const TO_HAVE = [
  seconds('time', 'have_seconds'), bytes('read', 'read_bytes'), count('reads', 'reads'),
  bytes('memory', 'level_memory_bytes'),
];

// With leaf planes in the file, the levels alone are all that is known.
function shapeTable(method, rows) {
  return table('level', [
    { title: 'in the file', columns: IN_THE_FILE },
    { title: 'volume', columns: VOLUME.filter((c) => !method.leaf_planes_stored || c.title !== 'levels alone, %') },
    { title: 'distance to the model, %', columns: DISTANCE_TO_MODEL },
  ], rows);
}

function answerTable(rows) {
  return table('level', [
    { title: 'point in solid, to the level', columns: INSIDE },
    { title: 'distance, to the level: width of the interval, %', columns: DISTANCE },
    { title: 'to have the level', columns: TO_HAVE },
  ], rows);
}

function showMethods() {
  for (const m of methods) {
    const rows = m.levels.map((l) => ({ title: `${l.level}`, of: l }));
    byId('tables').append(element('h3', {}, m.name), shapeTable(m, rows), answerTable(rows));
  }
}

function showTables() {
  showGlance();
  showLimit();
  showBuild();
  showDeadlines();
  showBudgets();
  showLines();
  showNeeds();
  showTransmission();
  showMethods();
}
