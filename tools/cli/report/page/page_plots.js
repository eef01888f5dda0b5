'use strict';
// Defines the values that each plot shows. The functions of an axis get a level or a deadline: `of` returns the value,
// `dotted` a second value, and `limit` the value of the limit, which gets a separate line.

const { percent: PERCENT, bytes: BYTE, seconds: TIME } = format;

const LEVEL = { name: 'level', as: format.level, of: (l) => l.level };
const BYTES_SO_FAR = { name: 'bytes up to the level', as: BYTE, of: (l) => l.cumulative_bytes };
const LEVEL_TIME = { name: 'time to read the level', as: TIME, of: (l) => l.reading_seconds };
const INSIDE_TIME = { name: 'time of a query', as: TIME, of: (l) => fromNs(l.inside_ns) };
const DISTANCE_TIME = { name: 'time of a query', as: TIME, of: (l) => fromNs(l.distance_ns) };
const [SLOW_TIME, FAST_TIME] = LINES.map((line) => ({ name: `time to download the level, ${line.name}`, as: TIME, of: lineTime(line) }));
const LEVEL_MEMORY = { name: 'memory of levels 0 to this one', as: BYTE, of: (l) => l.level_memory_bytes };
const BUDGET = { name: 'memory', as: BYTE, of: (b) => b.budget_bytes };
const BUILD = { name: 'build time', as: TIME, of: (m) => m.build_seconds };
const DEADLINE = { name: 'deadline', as: TIME, of: (d) => 1e-6 * d.microseconds };

const excess = (of) => ({ name: 'excess volume, % of the solid', as: PERCENT, of, limit: (l) => l.limit_excess });
const volume = (of) => ({ name: 'volume of the envelopes', as: format.number, of });
// Surfaces have no volume, so plots show the volume of the envelopes.
const ALL_KNOWN = solid ? excess((l) => l.excess) : volume((l) => l.envelope_volume);
const LEVELS_ALONE = solid ? excess((l) => l.levels_excess) : volume((l) => l.levels_volume);
const RATIO = { name: 'excess / excess of the limit', as: format.times, of: (l) => l.excess_to_limit, limit: () => 1 };
const FARTHEST = {
  name: 'greatest distance, % of the diagonal', as: PERCENT, of: (l) => ofDiagonal(l.hausdorff_hi),
};
const MEAN = { name: 'mean distance, % of the diagonal', as: PERCENT, of: (l) => ofDiagonal(l.distance_mean) };
const MAYBE_NEAR = {
  name: 'MAYBE, % of points within 1 % of the diagonal', as: PERCENT, of: (l) => percent(l.maybe_near),
};
const MAYBE_UNIFORM = { name: 'MAYBE, % of uniform points', as: PERCENT, of: (l) => percent(l.maybe_uniform) };
const WIDTH = { name: '% of the diagonal', as: PERCENT, of: (l) => ofDiagonal(l.width_median) };
const CERTAIN = { name: '% of the diagonal', as: PERCENT, of: (d) => ofDiagonal(d.deadline_width_p99) };
const EXACT = { name: 'time of a query', as: TIME, of: (b) => fromNs(b.budget_distance_ns) };
const excessAt = (level) => ({
  name: `excess volume at level ${level}, %`, as: PERCENT, of: (m) => levelOf(m, level)?.excess ?? null,
});
const TAKEN = {
  name: 'time taken', as: TIME, of: (d) => fromNs(d.deadline_took_p99), dotted: (d) => fromNs(d.deadline_took_median),
};
const SENT_SO_FAR = {
  name: 'bytes up to the level', as: BYTE, of: (l) => l.cumulative_bytes, dotted: (l) => l.thesis_cumulative_bytes,
};
const SENT = { name: 'bytes of the level', as: BYTE, of: (l) => l.bytes, dotted: (l) => l.thesis_bytes };

// Axes of each plot; the keys are the data-plot attributes of the <figure> elements of the page.
const axesOf = {
  'volume-by-level': [LEVEL, ALL_KNOWN],
  'ratio-by-level': [LEVEL, RATIO],
  'volume-by-bytes': [BYTES_SO_FAR, LEVELS_ALONE],
  'farthest-by-bytes': [BYTES_SO_FAR, FARTHEST],
  'mean-by-bytes': [BYTES_SO_FAR, MEAN],
  'maybe-by-bytes': [BYTES_SO_FAR, MAYBE_NEAR],
  'volume-by-time': [LEVEL_TIME, LEVELS_ALONE],
  'farthest-by-time': [LEVEL_TIME, FARTHEST],
  'maybe-by-time': [INSIDE_TIME, MAYBE_UNIFORM],
  'width-by-time': [DISTANCE_TIME, WIDTH],
  'first-by-build': [BUILD, excessAt(levels[0])],
  'middle-by-build': [BUILD, excessAt(MIDDLE)],
  'volume-by-slow-line': [SLOW_TIME, LEVELS_ALONE],
  'farthest-by-slow-line': [SLOW_TIME, FARTHEST],
  'volume-by-fast-line': [FAST_TIME, LEVELS_ALONE],
  'farthest-by-fast-line': [FAST_TIME, FARTHEST],
  'volume-by-memory': [LEVEL_MEMORY, LEVELS_ALONE],
  'width-by-memory': [LEVEL_MEMORY, WIDTH],
  'distance-by-budget': [BUDGET, EXACT],
  'width-by-deadline': [DEADLINE, CERTAIN],
  'taken-by-deadline': [DEADLINE, TAKEN],
  'sent-so-far': [LEVEL, SENT_SO_FAR],
  'sent-by-level': [LEVEL, SENT],
};

// --- series ---

function methodSeries(x, of, dotted) {
  const rows = (m) => (x === DEADLINE ? m.deadlines : x === BUDGET ? m.budgets : m.levels);
  const points = (m) => rows(m).map((r) => ({ x: x.of(r), y: of(r), level: r.level }));
  return methods.map((m, method) => ({ name: m.name, method, dotted, points: points(m) }));
}

// Returns the series of the limit, which depends on the cells only. If methods have different leaves, the least limit is
// used. The limit has no bytes and no time, so it is drawn at the method with the least value. Times are noisy, so a deeper
// level never gets a smaller x than the level above.
function limitSeries(x, limit) {
  let at = 0;
  const points = levels.map((level) => {
    at = Math.max(at, least(level, x.of) ?? 0);
    return { x: at, y: least(level, limit), level };
  });
  return { name: 'limit', points };
}

// Returns the line on which the time taken equals the deadline.
function deadlineSeries() {
  return { name: 'deadline', points: methods[0].deadlines.map((d) => ({ x: DEADLINE.of(d), y: DEADLINE.of(d) })) };
}

// Returns a line for each selection, with a point for each number of planes.
function buildSeries(y) {
  const families = [...new Set(methods.map((m) => m.selection))];
  const numberOf = (m) => (m.percent ? `${m.percent} %` : m.k_root ? `K = ${format.number(m.k_root)}` : undefined);
  return families.map((name) => {
    const members = methods.filter((m) => m.selection === name);
    const points = members.map((m) => ({ x: BUILD.of(m), y: y.of(m), note: numberOf(m) }));
    return { name, method: methods.indexOf(members[0]), points };
  });
}

function seriesOf(x, y) {
  if (x === BUILD)
    return buildSeries(y);
  return [
    ...methodSeries(x, y.of, false),
    ...(y.dotted ? methodSeries(x, y.dotted, true) : []),
    ...(y.limit ? [limitSeries(x, y.limit)] : []),
    ...(y === TAKEN ? [deadlineSeries()] : []),
  ];
}

// Draws the plots of visible sections. The tables hide sections without data, so they are shown first.
function showPlots() {
  preparePlots();
  for (const figure of document.querySelectorAll('section:not([hidden]) [data-plot]')) {
    const [x, y] = axesOf[figure.dataset.plot];
    if (!solid && (y === ALL_KNOWN || y === LEVELS_ALONE))
      figure.querySelector('figcaption').textContent = 'Volume of the envelopes';
    figure.hidden = !plot(figure, x, y, seriesOf(x, y));
  }
}
