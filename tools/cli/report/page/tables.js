'use strict';
// Tables: groups of columns, each figure of a row by the column's function.

// element('td', { className: 'best' }, 'text or elements', ...)
function element(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Why there are dashes on the page.
const reasons = new Set();

// A column is { title, value: (row) => figure, as: a function of format, best: (row) => boolean, why: (row) => the reason
// of a dash }; best may be missing.
function cell(column, row, first) {
  const text = column.as(column.value(row)), td = element('td', {}, text);
  td.classList.toggle('first', first);
  td.classList.toggle('none', text === NONE);
  if (text === NONE) {
    td.title = column.why(row);
    reasons.add(td.title);
  }
  td.classList.toggle('best', Boolean(column.best?.(row)));
  return td;
}

const cells = ({ title, columns }, row) => columns.map((c, i) => cell(c, row, Boolean(title) && i === 0));

function titles(groups) {
  const row = element('tr', { className: 'groups' }, element('th'));
  row.append(...groups.map((g) => element('th', { colSpan: g.columns.length }, g.title)));
  return row;
}

function headings(name, groups) {
  const row = element('tr', {}, element('th', {}, name));
  for (const { title, columns } of groups)
    columns.forEach((c, i) => row.append(element('th', { className: title && i === 0 ? 'first' : '' }, c.title)));
  return row;
}

// `name` heads the first column, which holds rows' titles: rows are { title, of }, and columns see `of`.
function table(name, groups, rows) {
  const head = element('thead'), body = element('tbody');
  if (groups.some((g) => g.title))
    head.append(titles(groups));
  head.append(headings(name, groups));
  for (const { title, of } of rows)
    body.append(element('tr', {}, element('th', {}, title), ...groups.flatMap((g) => cells(g, of))));
  return element('div', { className: 'scroll' }, element('table', {}, head, body));
}
