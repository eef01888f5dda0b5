'use strict';
// Formats values with three digits and a unit. null: the value is not available.

const NONE = '–';

function threeDigits(v) {
  const size = Math.abs(v);
  if (size === 0)
    return '0';
  if (size >= 1e6 || size < 1e-5)
    return v.toExponential(2);
  return size >= 99.95 ? v.toFixed(0) : String(Number(v.toPrecision(3)));
}

// Formats v in the largest unit that gives at least 1; `units` are sorted from the largest to the smallest.
function inUnits(v, units) {
  const [name, factor] = units.find(([, f]) => v >= 0.9995 * f) ?? units.at(-1);
  return `${threeDigits(v / factor)} ${name}`;
}

const BYTES = [['TB', 1e12], ['GB', 1e9], ['MB', 1e6], ['kB', 1e3], ['B', 1]];
const SECONDS = [['s', 1], ['ms', 1e-3], ['µs', 1e-6], ['ns', 1e-9]];

// Returns the function that formats a value with `write`, and a missing value as a dash.
const known = (write) => (v) => (v === null || v === undefined ? NONE : write(v));
const format = {
  number: known(threeDigits),
  percent: known((v) => `${threeDigits(v)} %`),
  times: known((v) => `${threeDigits(v)} ×`),
  bytes: known((v) => inUnits(v, BYTES)),
  seconds: known((v) => inUnits(v, SECONDS)),
  count: known((v) => v.toFixed(0).replace(/\B(?=(\d{3})+$)/g, ',')),
  level: known((v) => v.toFixed(0)),
};

// These functions return null for null.
const times = (factor, v) => (v === null ? null : factor * v);
const percent = (share) => times(100, share);
const fromNs = (v) => times(1e-9, v);
