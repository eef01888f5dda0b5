// Notes at points of the model, stored with the paint, and saved views, stored in this browser and as files.
import { complain, make, mark, modelName, save, section, take, taken } from './parts.js';
import { MOST, cleanText } from './paint/paint_file.js';
import { today } from './paint/document.js';
import { $, on, state, toScene } from './state.js';
import { mergedViews, readViews, viewOf, writeViews } from './views.js';

const KEPT = 'Saved with the paint.';
const HTML = `
  <div class="row"><button id="noteAdd" class="small" aria-pressed="false" title="Then click a point of the model (N)">Add a note</button><span class="hint" id="noteHint">${KEPT}</span></div>
  <form id="noteForm" hidden><input id="noteTitle" type="text" placeholder="Title" aria-label="Title" maxlength="200">
    <textarea id="noteBody" rows="4" placeholder="Text" aria-label="Text" maxlength="16000"></textarea>
    <input id="noteAuthor" type="text" placeholder="Author" aria-label="Author" maxlength="200">
    <div class="row"><button class="small">Keep</button><button type="button" class="small" id="noteCancel">Cancel</button></div></form>
  <ol id="notes" class="list"></ol>
  <div class="row"><span>Views</span><button id="viewSave" class="small">Save this view</button></div>
  <ul id="views" class="list"></ul>
  <div class="buttons"><button id="viewsOut" class="small" hidden>Save as a file</button><button id="viewsIn" class="small">Open a file …</button></div>
  <input type="file" id="viewsFile" accept=".json" hidden>`;
const NEAR = 0.35; // least distance of the camera from a note

export function addNotes({ scene, changed, shownAs }, drawing) {
  const details = section('Notes and views', HTML);
  let shown = [], editing; // { note } of the list, or { place } for a new note
  const list = () => drawing().state.notes;

  const show = () => {
    shown.forEach((remove) => remove());
    const visible = (n) => drawing().state.layers[n.layer].visible;
    shown = !state.info ? [] : list().flatMap((note, i) => {
      if (!visible(note))
        return [];
      const pin = make('button', String(i + 1), { className: 'pin', title: note.title, ariaLabel: `Note ${i + 1}: ${note.title}` });
      pin.onclick = () => goTo(i);
      return [mark(pin, [toScene(note.place)], ([[x, y]]) => (pin.style.translate = `calc(${x}px - 50%) calc(${y}px - 100%)`))];
    });
    $('notes').replaceChildren(...(state.info ? list() : []).map((note, i) => {
      const li = make('li', ''), go = make('button', note.title || 'Untitled', { className: 'link' }), body = make('p', note.body.replaceAll('\u2028', '\n'), { className: 'body' });
      const by = make('small', [note.author, note.date.slice(0, 10)].filter(Boolean).join(', ')), change = make('button', 'Edit', { className: 'small' }), remove = make('button', 'Remove',
        { className: 'small' });
      go.onclick = () => goTo(i);
      change.onclick = () => edit({ note });
      remove.onclick = () => drawing().removeNote(i);
      li.append(go, body, by, change, remove);
      return li;
    }));
  };

  function goTo(number) {
    const at = toScene(list()[number].place), { eye, target } = scene.place, away = eye.map((x, k) => x - target[k]), distance = Math.hypot(...away);
    scene.place = { target: at, eye: at.map((x, k) => x + away[k] / distance * Math.min(distance, 2 * NEAR)) };
    changed();
    details.open = true;
    $('notes').children[number]?.scrollIntoView({ block: 'nearest' });
  }

  function edit(what) {
    editing = what;
    const note = what?.note ?? { title: '', body: '', author: localStorage.getItem('ebpo:author') ?? '' };
    $('noteForm').hidden = !what;
    if (!what)
      return;
    Object.entries({ noteTitle: note.title, noteBody: note.body.replaceAll('\u2028', '\n'), noteAuthor: note.author }).forEach(([id, value]) => ($(id).value = value));
    details.open = true;
    $('noteTitle').focus();
  }

  $('noteForm').onsubmit = (e) => {
    e.preventDefault();
    const members = { title: cleanText($('noteTitle').value, MOST.title), body: cleanText($('noteBody').value, MOST.body), author: cleanText($('noteAuthor').value, MOST.author), date: today() };
    localStorage.setItem('ebpo:author', members.author);
    try {
      if (editing.note) { // its index may have changed meanwhile
        const number = list().indexOf(editing.note);
        if (number < 0)
          throw new Error('the note was removed; undo restores it');
        drawing().setNote(number, members);
      } else {
        const { face, weights, place } = editing.place;
        drawing().addNote({ ...members, layer: drawing().layerForNew(), face, weights, place });
      }
    } catch (error) {
      complain(error.message);
    }
    edit();
  };
  $('noteCancel').onclick = () => edit();

  const button = $('noteAdd'), tool = {
    end: () => {
      button.ariaPressed = 'false';
      $('noteHint').textContent = KEPT;
    },
    click: async (point) => {
      try {
        const [place] = await drawing().positionsOf([point]);
        take();
        edit({ place });
      } catch (error) {
        complain(error.message);
      }
    },
  };
  button.onclick = () => {
    const begin = taken() !== tool;
    take(begin ? tool : undefined);
    button.ariaPressed = String(begin);
    $('noteHint').textContent = begin ? 'Click a point of the model.' : KEPT;
  };
  on('key', (e) => e.key.toLowerCase() === 'n' && button.click());
  on('drawing', show);
  on('closed', () => {
    edit();
    show();
  });
  savedViews({ shownAs });
}

// --- saved views: stored as addresses, by the model's digest ---

function savedViews({ shownAs }) {
  const key = () => `ebpo:views:${state.info.content_sha256}`, read = () => {
    try {
      return mergedViews([], JSON.parse(localStorage.getItem(key()) ?? '[]'));
    } catch {
      return [];
    }
  };
  const write = (list) => {
    try {
      localStorage.setItem(key(), JSON.stringify(list));
    } catch (error) {
      complain(`the browser cannot store the view (${error.message}); copy its link instead`);
    }
    show();
  };
  const showFiles = () => ($('viewsOut').hidden = !state.info || !read().length);
  const show = () => showFiles($('views').replaceChildren(...(state.info ? read() : []).map(({ name, query }, i, all) => {
    const li = make('li', ''), go = make('button', name, { className: 'link' }), remove = make('button', 'Remove', { className: 'small' });
    go.onclick = () => shownAs(new URLSearchParams(query));
    remove.onclick = () => write(all.filter((_, k) => k !== i));
    li.append(go, remove);
    return li;
  })));
  $('viewsOut').onclick = () => save(`${modelName()}.views.json`, writeViews(read(), state.info.content_sha256, modelName()), 'application/json');
  $('viewsIn').onclick = () => $('viewsFile').click();
  $('viewsFile').onchange = async () => {
    const [file] = $('viewsFile').files;
    $('viewsFile').value = '';
    try {
      if (file && state.info)
        write(mergedViews(read(), readViews(await file.text(), state.info.content_sha256)));
    } catch (error) {
      complain(`${file.name}: ${error.message}`);
    }
  };
  $('viewSave').onclick = () => {
    const name = prompt('A name for this view', `View ${read().length + 1}`);
    if (name?.trim())
      write([...read(), { name: name.trim().slice(0, 100), query: viewOf(state.address()) }]);
  };
  on('opened', show);
  on('closed', show);
  show();
}
