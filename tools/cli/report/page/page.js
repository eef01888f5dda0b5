'use strict';
// Makes the page's header, its pictures and its notes; then shows all sections.

// --- header ---

// Makes an item of the list of facts. more: a text that follows in small letters; optional.
function fact(name, text, more) {
  const value = element('dd', {}, text, ...(more ? [' ', element('small', {}, more)] : []));
  return element('div', { className: text.length > 24 ? 'wide' : '' }, element('dt', {}, name), value);
}

const fourDigits = (v) => String(Number(v.toPrecision(4)));

function modelFacts() {
  const size = model.max.map((v, i) => fourDigits(v - model.min[i])).join(' × ');
  const inside = model.kind === 'solid', capped = !inside && !(model.volume_lo === 0 && model.volume_hi === 0);
  return [
    fact('faces', format.count(model.faces)),
    fact('vertices', format.count(model.vertices), model.coordinates),
    fact('kind', model.kind, inside ? model.rule : capped ? 'holes closed by caps' : 'no inside'),
    ...(inside ? [fact('volume', model.volume === null ? 'beyond a double' : fourDigits(model.volume), model.unit)] : []),
    ...(capped ? [fact('volume', model.volume_hi === null ? `at least ${fourDigits(model.volume_lo)}` : `${fourDigits(model.volume_lo)} to ${fourDigits(model.volume_hi)}`, model.unit)] : []),
    fact('area', fourDigits(model.area)),
    fact('size', size, `diagonal ${fourDigits(model.diagonal)}`),
    ...(model.source ? [fact('source', model.source, format.bytes(model.source_bytes))] : []),
  ];
}

function runFacts() {
  const { processor, cores } = report.machine;
  return [
    fact('levels', `${levels[0]} to ${levels.at(-1)}`),
    fact('query points', format.count(report.points), `seed ${report.seed}`),
    fact('machine', processor || 'unknown', `${cores} core${cores === 1 ? '' : 's'}`),
  ];
}

function showHead() {
  document.title = `${model.name}: bytes, error, run time`;
  document.querySelector('h1').textContent = model.name;
  byId('facts').append(...modelFacts(), ...runFacts());
  if (drawn.portrait)
    document.querySelector('header').append(element('img', { src: drawn.portrait, alt: `The model ${model.name}` }));
}

// --- the pictures ---

const levelName = (level) => element('div', { className: 'level' }, `level ${level}`);

function caption(of) {
  const excess = of.excess === null ? [] : [element('b', {}, `+${format.percent(of.excess)}`), ' · '];
  return element('figcaption', {}, levelName(of.level), ...excess, format.bytes(of.cumulative_bytes));
}

function tile(method, pictures, level) {
  const figure = element('figure'), of = levelOf(method, level);
  if (pictures[level])
    figure.append(element('img', { src: pictures[level], alt: `${method.name}, level ${level}` }));
  if (of)
    figure.append(caption(of));
  return figure;
}

// Makes a grid of pictures of some levels, with a row for each method.
function strip(someLevels, columns) {
  const grid = element('div', { className: 'strip' }, element('div', { className: 'level' }), ...someLevels.map(levelName));
  grid.style.setProperty('--columns', columns);
  methods.forEach((m, i) => {
    const methodName = element('div', { className: 'methodName' }, m.name);
    methodName.style.color = `var(--m${i % METHOD_COLOURS})`;
    grid.append(methodName, ...someLevels.map((level) => tile(m, drawn.levels[i], level)));
  });
  return grid;
}

function showPictures() {
  const ROW_MOST = 6;
  const last = Math.max(-1, ...drawn.levels.flatMap((pictures) => Object.keys(pictures).map(Number)));
  const shown = levels.filter((l) => l <= last), rows = Math.ceil(shown.length / ROW_MOST);
  const columns = Math.ceil(shown.length / rows);
  for (let first = 0; first < shown.length; first += columns)
    byId('pictures').append(strip(shown.slice(first, first + columns), columns));
  byId('pictures').hidden = shown.length === 0;
}

// --- notes ---

function showNotes() {
  const ofMethods = methods.flatMap((m) => m.notes.map((note) => `${m.name}: ${note}`));
  const notes = [...(report.without_pictures ? [`no pictures: ${report.without_pictures}`] : []), ...ofMethods, ...reasons];
  byId('missing').hidden = notes.length === 0;
  byId('missing').querySelector('ul').append(...notes.map((note) => element('li', {}, note)));
  for (const q of report.quantities)
    byId('quantities').append(element('dt', {}, `${q.name}, ${q.unit}`), element('dd', {}, q.meaning));
  const version = `, version ${report.version}, in ${report.seconds.toFixed(0)} s.`;
  document.querySelector('footer').append('Made by ', element('code', {}, 'ebpo report'), version);
}

// Hides sections without a plot, and the table of the limit if no method has a solid.
function hideEmpty() {
  byId('against-limit').hidden = !solid;
  for (const section of document.querySelectorAll('section:has([data-plot])'))
    section.hidden ||= [...section.querySelectorAll('[data-plot]')].every((figure) => figure.hidden);
}

showHead();
showPictures();
showTables();
showPlots();
showNotes();
hideEmpty();
document.documentElement.dataset.shown = 'all';
