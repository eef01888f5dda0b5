'use strict';
// Which figures each table shows. Columns' functions get a level, a deadline, a need or a method. A row that is not
// there (a method has fewer levels, or not this need) has no figures.

const columnAs = (as) => (title, of, best) => ({ title, as, best, value: (row) => (row ? of(row) ?? null : null) });
const bytes = columnAs(format.bytes), number = columnAs(format.number), count = columnAs(format.count);
const seconds = columnAs(format.seconds), share = columnAs((v) => format.percent(percent(v)));
const nanoseconds = columnAs((v) => format.seconds(fromNs(v)));
const percents = columnAs((v) => format.number(percent(v)));
const lengths = columnAs((v) => format.number(ofDiagonal(v)));

function showTable(name, ...content) {
  document.querySelector(`[data-table=${name}]`).append(table(...content));
}

// --- methods side by side ---

function bytesUntil(method, goal) {
  return method.levels.find((l) => l.levels_excess !== null && l.levels_excess <= goal)?.cumulative_bytes ?? null;
}

function showGlance() {
  const columns = [
    bytes('file', (m) => m.file_bytes), count('levels', (m) => m.levels_in_file), count('planes', (m) => m.all_planes),
    ...[10, 3, 1].map((goal) => bytes(`≤ ${goal} %`, (m) => bytesUntil(m, goal))),
    seconds('build', (m) => m.build_seconds), seconds('into memory', (m) => m.open_seconds),
    bytes('memory', (m) => m.memory_bytes), nanoseconds('point in solid, exact', (m) => m.exact_inside_ns),
    nanoseconds('distance, exact', (m) => m.exact_distance_ns),
  ];
  showTable('glance', 'method', [{ columns }], methods.map((m) => ({ title: m.name, of: m })));
}

// A group of columns for each method; a row holds something for each.
function byMethod(columns) {
  const ofMethod = (c, i) => ({
    ...c, value: (row) => c.value(row[i]), best: (row) => methods.length > 1 && row[i] && c.best?.(row[i]),
  });
  return methods.map((m, i) => ({ title: m.name, columns: columns.map((c) => ofMethod(c, i)) }));
}

const levelRows = () => levels.map((level) => ({ title: `${level}`, of: methods.map((m) => levelOf(m, level)) }));

function showLimit() {
  const isLeast = (of) => (l) => of(l) !== null && of(l) <= least(l.level, of);
  const excess = (l) => l.excess, soFar = (l) => l.cumulative_bytes;
  const limit = number('%', (row) => leastOf(row, (l) => l.limit_excess));
  showTable('limit', 'level', [{ title: 'limit', columns: [limit] }, ...byMethod([
    number('%', excess, isLeast(excess)), number('× limit', (l) => l.excess_to_limit),
    bytes('bytes', soFar, isLeast(soFar)),
  ])], levelRows());
}

function showDeadlines() {
  const row = (d, i) => ({ title: `${d.microseconds} µs`, of: methods.map((m) => m.deadlines[i]) });
  showTable('deadlines', 'within', byMethod([
    share('exact', (d) => d.deadline_exact), lengths('width, %', (d) => d.deadline_width_p99),
    nanoseconds('took', (d) => d.deadline_took_p99), share('late', (d) => d.deadline_late),
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
    bytes('bytes', (n) => n.need_bytes), lengths('reaches ≥', (n) => n.need_hausdorff_lo),
    lengths('≤', (n) => n.need_hausdorff_hi), number('kept', (n) => n.need_ratio),
  ]), most.map((n) => ({ title: needTitle(n), of: methods.map((m) => m.needs.find(same(n))) })));
}

function showTransmission() {
  byId('transmission').hidden = !methods.some((m) => m.levels.some((l) => l.thesis_bytes !== null));
  showTable('transmission', 'level', byMethod([
    bytes('theirs', (l) => l.thesis_bytes), bytes('so far', (l) => l.thesis_cumulative_bytes),
    bytes('ours', (l) => l.bytes), bytes('so far', (l) => l.cumulative_bytes),
  ]), levelRows());
}

// --- one method's levels ---

const IN_THE_FILE = [
  bytes('bytes', (l) => l.bytes), bytes('so far', (l) => l.cumulative_bytes), count('gray', (l) => l.gray),
  count('leaves', (l) => l.leaf), count('planes', (l) => l.planes), count('of leaves', (l) => l.leaf_planes),
];
const VOLUME = [
  number('envelopes', (l) => l.envelope_volume), number('excess, %', (l) => l.excess),
  number('levels alone, %', (l) => l.levels_excess), number('limit’s, %', (l) => l.limit_excess),
  number('× limit', (l) => l.excess_to_limit),
];
const DISTANCE_TO_MODEL = [
  lengths('farthest ≥', (l) => l.hausdorff_lo), lengths('≤', (l) => l.hausdorff_hi),
  lengths('mean', (l) => l.distance_mean), lengths('rms', (l) => l.distance_rms),
];
const INSIDE = [
  percents('MAYBE, uniform, %', (l) => l.maybe_uniform), percents('near the surface, %', (l) => l.maybe_near),
  nanoseconds('time', (l) => l.inside_ns),
];
const DISTANCE = [
  lengths('mean', (l) => l.width_mean), lengths('median', (l) => l.width_median),
  lengths('99 %', (l) => l.width_p99), nanoseconds('time', (l) => l.distance_ns),
];
const TO_HAVE = [
  seconds('time', (l) => l.have_seconds), bytes('read', (l) => l.read_bytes), count('reads', (l) => l.reads),
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
  showDeadlines();
  showNeeds();
  showTransmission();
  showMethods();
}
