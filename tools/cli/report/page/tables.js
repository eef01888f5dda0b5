'use strict';
// Makes tables of groups of columns. The function of a column returns the value of a row.

// element('td', { className: 'best' }, 'text or elements', ...)
function element(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Reasons for the dashes on the page.
const reasons = new Set();

// Makes a cell. A column is { title, value: (row) => value, as: a function of format, best: (row) => boolean,
// why: (row) => the reason for a dash }; best may be missing.
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

// Makes a table. `name` is the heading of the first column, which contains the titles of the rows. Rows are { title, of };
// the functions of columns get `of`.
function table(name, groups, rows) {
  const head = element('thead'), body = element('tbody');
  if (groups.some((g) => g.title))
    head.append(titles(groups));
  head.append(headings(name, groups));
  for (const { title, of } of rows)
    body.append(element('tr', {}, element('th', {}, title), ...groups.flatMap((g) => cells(g, of))));
  return element('div', { className: 'scroll' }, element('table', {}, head, body));
}
