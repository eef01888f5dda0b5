// Offers texts to copy: a link to this view, HTML for a page, an element.
import { make } from './parts.js';
import { $, on, state } from './state.js';

/** Returns a text as the value of an HTML attribute. */
export const quoted = (text) => text.replace(/[&"<>]/g, (c) => ({ '&': '&amp;', '"': '&quot;', '<': '&lt;', '>': '&gt;' })[c]);

/**
 * `address()`: returns the address of this view. `elementOf(query)`: returns, for the query of this address, the attributes [[name, value]] of an element
 * <ebpo-viewer>, the HTML of its children if it has some, and `local`: true if a file is on this computer only.
 */
export function addSharing({ address, elementOf }) {
  const button = make('button', 'Share', { id: 'toolShare', className: 'ghost', title: 'Link, iframe, element (L)' }), dialog = document.createElement('dialog');
  dialog.id = 'share';
  dialog.ariaLabel = 'Share this view';
  dialog.innerHTML = `<h2>Share this view</h2><p class="hint" id="shareHint"></p>
    ${[['Link', 'Link to this view'], ['Frame', 'In a page: one line'], ['Element', 'In a page that has the package ebpo-viewer']].map(([id, label]) => `<label for="share${id}">${label}</label>
    <div class="row"><textarea id="share${id}" rows="2" readonly></textarea><button class="small" type="button" data-copy="share${id}">Copy</button></div>`).join('')}
    <form method="dialog"><button>Close</button></form>`;
  $('toolHelp').before(button);
  document.body.append(dialog);
  dialog.querySelectorAll('[data-copy]').forEach((b) => (b.onclick = async () => {
    const field = $(b.dataset.copy);
    field.select();
    await navigator.clipboard?.writeText(field.value).catch(() => document.execCommand('copy'));
    b.textContent = 'Copied';
    setTimeout(() => (b.textContent = 'Copy'), 1500);
  }));
  button.onclick = () => {
    const link = address(), { attributes, children = '', local = false } = elementOf(new URL(link).searchParams);
    $('shareHint').textContent = local ? 'This file is on this computer. To share the view, put the file on a server and give its address in ?file=.' : '';
    $('shareLink').value = link;
    $('shareFrame').value = `<iframe src="${quoted(link)}" width="800" height="600" style="border:0" title="${quoted(state.shownName ?? '')}"></iframe>`;
    $('shareElement').value = `<ebpo-viewer ${attributes.map(([name, value]) => `${name}="${quoted(value)}" `).join('')}style="height: 600px">${children}</ebpo-viewer>`;
    dialog.showModal();
  };
  on('key', (e) => e.key.toLowerCase() === 'l' && button.click());
}
