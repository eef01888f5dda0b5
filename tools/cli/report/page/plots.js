'use strict';
// Plots of series, drawn by Chart.js: logarithmic axes, levels as whole numbers, colours from the style sheet.
// An axis is { name, as: a function of format }. A series is { name, method, points: [{ x, y, level }], dotted }; a series
// without `method` is a reference, such as the limit.

const METHOD_COLOURS = 8;
const SHAPES = ['circle', 'rect', 'triangle', 'rectRot'];
const charts = new Map(); // by the figure's data-plot

// Returns a colour of the current style sheet (light, dark or print).
const styleColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const methodColour = (method) => styleColour(method === undefined ? 'reference' : `m${method % METHOD_COLOURS}`);

// --- axes ---

// Rounds v down or up to 1, 2 or 5 times a power of ten.
function rounded(v, up) {
  const decade = 10 ** Math.floor(Math.log10(v)), steps = [1, 2, 5, 10].map((s) => s * decade);
  return up ? steps.find((s) => s >= 0.9999 * v) : steps.findLast((s) => s <= 1.0001 * v);
}

// Returns true if an axis can show v. Axes of levels are linear, all others are logarithmic.
const fits = (axis, v) => Number.isFinite(v) && (axis.as === format.level ? v >= 0 : v > 0);

// Makes the scale of an axis. A range of less than a factor of five is linear; a logarithmic axis would have too few labels.
function scaleOf(values, axis) {
  const low = Math.min(...values), high = Math.max(...values);
  if (axis.as === format.level)
    return { type: 'linear', min: low - 0.25, max: high + 0.25, ticks: { stepSize: 1, includeBounds: false } };
  const margin = 0.06 * (high - low), ticks = { includeBounds: false };
  if (high < 5 * low)
    return { type: 'linear', min: 0.98 * low - margin, max: 1.02 * high + margin, ticks };
  const [min, max] = [rounded(low / 1.1, false), rounded(high * 1.1, true)];
  return { type: 'logarithmic', min, max, ticks: { autoSkip: false } };
}

// Returns true if v has a label. On a logarithmic axis, 1, 2 and 5 have labels if there is space, else only powers of ten.
function isLabelled(scale, v) {
  if (scale.type !== 'logarithmic')
    return true;
  const space = (scale.isHorizontal() ? scale.width / 150 : scale.height / 60) / Math.log10(scale.max / scale.min);
  const digit = Math.round(v / 10 ** Math.floor(Math.log10(v * 1.0001)));
  return digit === 1 || (space > 1 && (digit === 2 || digit === 5));
}

function scaleOptions(values, axis) {
  const { ticks, ...scale } = scaleOf(values, axis);
  const label = function (v) { return isLabelled(this, v) ? axis.as(v) : ''; };
  return {
    ...scale,
    ticks: { ...ticks, maxRotation: 0, padding: 6, color: () => styleColour('soft'), callback: label },
    grid: { drawBorder: false, drawTicks: false, color: (c) => styleColour(c.tick?.label ? 'grid' : 'grid-fine') },
  };
}

// --- series ---

function dataset({ name, method, points, dotted }) {
  const thin = method === undefined || dotted, colour = () => methodColour(method);
  return {
    label: name, data: points, method, dotted, showLine: true, clip: false,
    order: method ?? Infinity, // the first on top
    borderColor: colour, borderWidth: thin ? 1.6 : 2, borderDash: dotted ? [2, 4] : thin ? [6, 4] : [],
    pointStyle: thin ? 'circle' : SHAPES[method % SHAPES.length],
    pointRadius: thin ? 2 : method % SHAPES.length ? 5 : 4, pointHoverRadius: thin ? 4 : 6,
    pointBackgroundColor: colour, pointBorderColor: () => styleColour('card'), pointBorderWidth: 1.2,
    backgroundColor: colour,
  };
}

// Draws the level beside each point of the first series, or the number of planes beside every point. Omits labels that would
// overlap.
const levelNumbers = {
  id: 'levelNumbers',
  afterDatasetsDraw(chart) {
    const { ctx } = chart, noted = chart.data.datasets.some((d) => d.data.some((p) => p.note));
    const marks = chart.data.datasets.slice(0, noted ? undefined : 1).flatMap((d, k) => (
      chart.getDatasetMeta(k).data.map(({ x, y }, i) => ({ x, y, text: d.data[i].note ?? d.data[i].level }))));
    let last;
    ctx.save();
    Object.assign(ctx, { font: `11px ${Chart.defaults.font.family}`, textAlign: 'center', lineWidth: 3 });
    Object.assign(ctx, { lineJoin: 'round', fillStyle: styleColour('soft'), strokeStyle: styleColour('card') });
    for (const { x, y, text } of marks) {
      if (text === undefined || (last && Math.hypot(x - last.x, y - last.y) < 13))
        continue;
      ctx.strokeText(text, x, y - 9);
      ctx.fillText(text, x, y - 9);
      last = { x, y };
    }
    ctx.restore();
  },
};

// --- the plot ---

function tooltip(x, y) {
  const title = ([{ dataset, raw }]) => dataset.label + (raw.level === undefined ? '' : `, level ${raw.level}`) + (raw.note ? `, ${raw.note}` : '');
  const say = (axis, v) => (axis.as === format.level ? [] : [`${axis.name}: ${axis.as(v)}`]);
  return { displayColors: false, callbacks: { title, label: ({ raw }) => [...say(y, raw.y), ...say(x, raw.x)] } };
}

// Shows or hides both lines of a method, the continuous and the dotted line.
function toggle(event, item, legend) {
  const { chart } = legend, shown = chart.isDatasetVisible(item.datasetIndex);
  chart.data.datasets.forEach((d, i) => d.label === item.text && chart.setDatasetVisibility(i, !shown));
  chart.update();
}

function legend(datasets) {
  return {
    display: datasets.filter((d) => !d.dotted).length > 1, align: 'end', onClick: toggle,
    labels: {
      usePointStyle: true, boxWidth: 8, boxHeight: 8, padding: 12, color: () => styleColour('ink'),
      filter: (item) => !datasets[item.datasetIndex].dotted,
    },
  };
}

function options(x, y, datasets) {
  const points = datasets.flatMap((d) => d.data);
  const title = { display: true, text: x.name, align: 'end', color: () => styleColour('soft') };
  return {
    animation: false, maintainAspectRatio: false, devicePixelRatio: Math.max(2, window.devicePixelRatio),
    interaction: { mode: 'nearest', intersect: false },
    scales: { x: { ...scaleOptions(points.map((p) => p.x), x), title }, y: scaleOptions(points.map((p) => p.y), y) },
    plugins: { legend: legend(datasets), tooltip: tooltip(x, y) },
  };
}

// Draws a plot in the figure. Returns false, and leaves the figure unchanged, if there is nothing to draw.
function plot(figure, x, y, series) {
  const onAxes = series.map((s) => ({ ...s, points: s.points.filter((p) => fits(x, p.x) && fits(y, p.y)) }));
  const datasets = onAxes.filter((s) => s.points.length).map(dataset);
  if (datasets.every((d) => d.method === undefined))
    return false;
  const caption = figure.querySelector('figcaption'), canvas = element('canvas', { role: 'img' });
  canvas.ariaLabel = `${caption.textContent}: ${y.name} against ${x.name}`;
  caption.append(element('small', {}, y.name));
  figure.append(element('div', {}, canvas));
  const marked = (p) => p.level !== undefined || p.note;
  const numbered = x.as !== format.level && datasets.some((d) => d.data.some(marked));
  const chart = new Chart(canvas, {
    type: 'scatter', data: { datasets }, plugins: numbered ? [levelNumbers] : [], options: options(x, y, datasets),
  });
  charts.set(figure.dataset.plot, chart);
  return true;
}

// Sets the font, and redraws all plots when the system's colour scheme changes, and for printing. Call before the first plot.
function preparePlots() {
  Chart.defaults.font.family = getComputedStyle(document.body).fontFamily;
  for (const query of ['(prefers-color-scheme: dark)', 'print'])
    matchMedia(query).addEventListener('change', () => charts.forEach((chart) => chart.update()));
}
