'use strict';
// Parses the data of the report, and computes values from it.

const byId = (id) => document.getElementById(id);
const report = JSON.parse(byId('report').textContent); // as in report.json
const drawn = JSON.parse(byId('drawn').textContent); // pictures: data URIs

const { model, methods } = report;
const levels = Array.from({ length: report.levels.last - report.levels.first + 1 }, (_, i) => report.levels.first + i);
const solid = methods.some((m) => m.levels.some((l) => l.excess !== null));

// Returns a level of a method, or undefined if the method has no such level.
const levelOf = (method, level) => method.levels.find((l) => l.level === level);

// Converts a length to percent of the diagonal of the model's box.
const ofDiagonal = (v) => (model.diagonal > 0 ? times(100 / model.diagonal, v) : null);

// Returns the least value of some levels, which may be undefined; null if no level has a value. valueOfLevel: a function.
function leastOf(someLevels, valueOfLevel) {
  const values = someLevels.filter(Boolean).map(valueOfLevel).filter((v) => v !== null);
  return values.length ? Math.min(...values) : null;
}

// The middle level of the measured levels.
const MIDDLE = levels[Math.floor(levels.length / 2)];

// Returns the sum of the volumes of all levels, in percent of the solid (EBP 2017, chart 18).
function sumOfLevels(method) {
  const all = method.levels.map((l) => l.excess);
  return all.includes(null) ? null : all.reduce((sum, excess) => sum + 100 + excess, 0);
}

// Simulated connections: `trip` is the time of a round trip in seconds, `rate` is in bytes per second.
const LINES = [
  { name: '10 Mbit/s, 100 ms', trip: 0.1, rate: 1.25e6 }, { name: '100 Mbit/s, 20 ms', trip: 0.02, rate: 1.25e7 },
];
// Returns the function that computes the download time of a level.
const lineTime = (line) => (l) => (l.line_trips === null ? null : l.line_trips * line.trip + l.line_bytes / line.rate);

// Returns the least value of a level among all methods.
const least = (level, valueOfLevel) => leastOf(methods.map((m) => levelOf(m, level)), valueOfLevel);
