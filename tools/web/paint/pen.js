// The pen: paints and erases with mouse, finger or stylus; layers; undo; save and open.
import { complain, make, modelName, positionsOf, reachOf, save, section, take, taken } from '../parts.js';
import { kit } from '../scene.js';
import { $, emit, on, state, toModel, toScene } from '../state.js';
import { Decals, splitStroke } from './decals.js';
import { PaintDocument, identityOf, misfit, received } from './document.js';
import { MOST, cleanText, readPaint, writePaint } from './paint_file.js';
import { ROWS, linkRows, radius, sendCommands, showRadius } from './pen_buttons.js';
import { Stroke } from './stroke.js';

const HTML = `${ROWS}
  <ul id="layers" class="list"></ul>
  <div class="buttons"><button id="layerAdd" class="small">Add a layer</button><button id="paintOpen" class="small">Open …</button><button id="paintSave" class="small">Save</button></div>
  <input type="file" id="paintFile" accept=".h5" hidden>`;
const FULL_SIZE = 32768, AT_ONCE = 200;

export function addPen({ scene, worker, query }, pipeline) {
  const decals = pipeline.layers = new Decals(kit), docs = new Map(), reaches = new WeakMap(); // documents by a model's digest; { normal, faces } by a point of a document
  let doc, layer = 0, stroke, pending = 0, unsettled = 0, details, requested = 0, command; // command(text): sends a command to a device that paints, see live.js
  const colour = () => [1, 3, 5].map((i) => parseInt($('penColour').value.slice(i, i + 2), 16));
  const positionsOfPoints = (points) => {
    if (!state.info.parts.has('mesh'))
      throw new Error('the file has no faces to paint on; convert the model with its mesh');
    return positionsOf(worker, points);
  };

  // Returns the document with functions for other modules of the page.
  const drawing = () => Object.assign(doc, { positionsOf: positionsOfPoints, layerForNew() {
    if (!doc.state.layers.length)
      doc.addLayer({});
    return layer;
  } });

  // --- the picture ---

  const decal = (s, points) => ({ erases: s.erases, colour: s.colour, radius: s.radius * state.scene.scale,
    points: points.map((p) => ({ centre: toScene(p.place), normal: reaches.get(p)?.normal ?? p.normal, faces: reaches.get(p)?.faces, share: p.size / FULL_SIZE })) });

  const made = new WeakMap(), decalsOf = (s) => splitStroke(s, made, { isKnown: (p) => reaches.has(p), about: state.scene.scale, decal });
  const inPicture = (faces) => faces && Float32Array.from({ length: faces.length }, (_, i) => (faces[i] - state.scene.center[i % 3]) * state.scene.scale);
  // Real faces are drawn at their exact positions, envelopes within one cell of them.
  decals.near = () => (state.stats?.meshTriangles === state.stats?.triangles ? 0 : 2 * (Number($('detail').value) || state.auto || 0));
  function draw() {
    const { layers, strokes } = doc.state, all = stroke ? [...strokes, stroke] : strokes;
    decals.set(layers.map((l, i) => ({ opacity: l.opacity / 255, strokes: l.visible ? all.filter((s) => s.layer === i).flatMap(decalsOf) : [] })), state.info?.solid !== false);
    scene.redraw();
  }

  function changed() {
    layer = Math.max(0, Math.min(layer, doc.state.layers.length - 1));
    $('penUndo').disabled = !doc.past.length;
    $('penRedo').disabled = !doc.future.length;
    showLayers();
    draw();
    emit('drawing');
  }

  // Waits until the positions of all strokes have arrived, then makes a change. Undo then reverts the last visible stroke, and no layer is removed before its stroke.
  async function inTurn(change) {
    const mine = doc;
    while (unsettled)
      await new Promise((done) => setTimeout(done, 20));
    if (!stroke && doc === mine)
      change();
  }
  const undo = () => (command ? command('undo') : inTurn(() => doc.undo())), redo = () => !command && inTurn(() => doc.redo());

  // --- layers ---

  function showLayers() {
    $('layers').replaceChildren(...doc.state.layers.map((l, i) => {
      const li = make('li', '', { className: i === layer ? 'chosen' : '' }), pick = make('input', '', { type: 'radio', name: 'layer', checked: i === layer, ariaLabel: `Paint on ${l.title}` });
      const name = make('input', '', { type: 'text', value: l.title, ariaLabel: 'Name of the layer', maxLength: 100 }), opacity = make('input', '', { type: 'range', min: 0, max: 255,
        value: l.opacity, ariaLabel: `Opacity of ${l.title}` });
      const eye = make('button', l.visible ? 'Hide' : 'Show', { className: 'small', ariaPressed: String(!l.visible) }), remove = make('button', '✕', { className: 'small',
        ariaLabel: `Remove ${l.title}` });
      const count = doc.state.strokes.filter((s) => s.layer === i).length;
      for (const input of command ? [name, eye, remove, opacity] : [])
        input.disabled = true;
      pick.onchange = () => {
        if (command)
          command(`layer ${i}`);
        layer = i;
        showLayers();
      };
      name.onchange = () => doc.setLayer(i, { title: cleanText(name.value, MOST.title) });
      opacity.onchange = () => doc.setLayer(i, { opacity: Number(opacity.value) });
      eye.onclick = () => doc.setLayer(i, { visible: !l.visible });
      remove.onclick = () => inTurn(() => doc.state.layers[i] === l && doc.removeLayer(i));
      li.append(pick, name, eye, remove, opacity, make('small', `${count} ${count === 1 ? 'stroke' : 'strokes'}${l.author ? ` · ${l.author}` : ''}`));
      return li;
    }));
  }

  // --- strokes ---

  const tools = {
    penOn: { hint: 'Drag on the model to paint; beside it, or with two fingers, to turn. Pressure widens the stroke.' },
    eraserOn: { hint: 'Drag over the paint to erase from the chosen layer.' },
  };
  for (const [id, tool] of Object.entries(tools)) {
    tool.click = () => {};
    tool.end = () => {
      $(id).ariaPressed = 'false';
      $('penHint').textContent = '';
    };
  }
  const pick = (x, y) => {
    const point = scene.pick(x, y);
    return point && toModel(point);
  };
  const active = () => Object.keys(tools).find((id) => taken() === tools[id]);

  function down(e) {
    if (stroke && e.pointerType === 'touch') { // a second finger begins to turn the model
      stroke = undefined;
      draw();
      return;
    }
    if (command || !active() || !e.isPrimary || e.button !== 0 || stroke || !scene.pick(e.clientX, e.clientY))
      return;
    if (!state.info.parts.has('mesh')) {
      complain('the file has no faces to paint on; convert the model with its mesh');
      return;
    }
    e.stopImmediatePropagation(); // the camera does not move
    $('canvas').setPointerCapture(e.pointerId);
    const erases = active() === 'eraserOn' || e.buttons === 32; // the eraser end of a stylus
    if (!doc.state.layers.length)
      doc.addLayer({ author: localStorage.getItem('ebpo:author') ?? '', colour: (colour().reduce((sum, c) => sum * 256 + c, 0) * 256 + 255) });
    stroke = new Stroke({ layer, erases, colour: [...colour(), 255], radius: radius() },
      { pick, pixels: (place) => scene.pixelsAt(toScene(place)) * state.scene.scale });
    stroke.pointer = e.pointerId;
    add(e);
  }

  function add(e) {
    const events = e.getCoalescedEvents?.() ?? [], light = e.pointerType === 'pen';
    const fresh = (events.length ? events : [e]).reduce((sum, one) => sum + stroke.to(one.clientX, one.clientY, one.pressure || 0.5, light), 0);
    if (fresh)
      draw();
  }

  function move(e) {
    if (stroke?.pointer !== e.pointerId)
      return;
    e.stopImmediatePropagation();
    add(e);
  }

  async function up(e) {
    if (stroke?.pointer !== e.pointerId)
      return;
    e.stopImmediatePropagation();
    const done = stroke, { opening } = state;
    stroke = undefined;
    if (!done.points.length)
      return;
    pending++;
    unsettled++;
    try {
      const settled = done.settled(await positionsOfPoints(done.points.map((p) => p.place)));
      if (opening === state.opening && settled.points.length) {
        await findReach([settled], () => opening === state.opening);
        doc.addStroke(settled);
      }
    } catch (error) {
      if (opening === state.opening)
        complain(error.message);
    }
    unsettled--;
    pending--;
  }

  // --- a device that paints ---

  // Takes new layers and points of a device: an event "paint" of `ebpo haptic --view`.
  async function receive({ count, layer: at, layers, strokes: parts }) {
    const { opening } = state, { length: before } = doc.state.strokes, { strokes, fresh } = received(doc.state.strokes, { count, strokes: parts });
    doc.state = doc.saved = { ...doc.state, layers: layers ?? doc.state.layers, strokes };
    if (layers || at !== layer || strokes.length !== before) {
      layer = at;
      showLayers();
    }
    draw();
    await findReach(fresh, () => opening === state.opening);
    if (opening === state.opening)
      draw();
  }

  // Lets the device do what the buttons of the pen otherwise do on this page.
  function beginLive(send) {
    command = send;
    details.open = true;
    $('paintOpen').hidden = true;
    sendCommands(details, command, () => doc.state.layers.length);
  }

  // --- files ---

  async function saveFile() {
    while (pending) // waits for the positions of strokes
      await new Promise((done) => setTimeout(done, 20));
    save(`${modelName()}.paint.h5`, writePaint(doc.file), 'application/x-hdf5');
    doc.saved = doc.state;
  }

  async function openBytes(name, bytes) {
    if (!doc.isSaved && !confirm('The paint and notes on this page are not saved. Replace them with the other file?'))
      return;
    const mine = ++requested;
    pending++;
    try {
      const file = readPaint(bytes), why = misfit(file, state.info);
      if (why)
        throw new Error(why);
      doc.take(file);
      details.open = true;
      await checkPlaces(file, () => mine === requested && doc.state.strokes === file.strokes);
    } catch (error) {
      if (mine === requested)
        complain(`${name}: ${error.message}`);
    }
    pending--;
  }

  // Lets the worker compute the faces that points of strokes cover. Returns a message when a point is not on its face. Stops when `goes()` returns false.
  async function findReach(strokes, goes, progress = () => {}) {
    const points = strokes.flatMap((s) => s.points.map((p) => ({ p, radius: s.radius * p.size / FULL_SIZE })));
    for (let i = 0; i < points.length && goes(); i += AT_ONCE) {
      const some = points.slice(i, i + AT_ONCE), found = await reachOf(worker, some.map(({ p: { face, place }, radius }) => ({ face, place, radius })));
      if (!goes())
        return undefined;
      if (found.some((f) => f.here === 'no'))
        return 'the paint has points that are not on their faces of the model: the paint file was changed; get a fresh copy';
      found.forEach(({ normal, faces }, k) => reaches.set(some[k].p, { normal, faces: inPicture(faces) }));
      progress();
    }
    return undefined;
  }

  async function checkPlaces({ strokes, notes }, goes) {
    if (!state.info.parts.has('mesh'))
      return;
    const onNotes = { radius: 0, points: notes.map(({ face, place }) => ({ face, place, size: FULL_SIZE })) }, why = await findReach([onNotes, ...strokes], goes, draw);
    if (why) {
      doc.take({ layers: [], notes: [], strokes: [] });
      throw new Error(why);
    }
    if (goes())
      draw();
  }

  function fresh() {
    requested++;
    const key = state.info && identityOf(state.info).model; // the paint of models that were opened earlier is kept
    doc = docs.get(key) ?? new PaintDocument(state.info ?? { parts: new Set() }, `${modelName()}.ebpo.h5`, changed);
    if (key)
      docs.set(key, doc);
    layer = 0;
    stroke = undefined;
    changed();
    if (state.info)
      showRadius();
  }

  async function fromAddress() {
    const wanted = new URLSearchParams(location.search).get('paint'), { opening } = state;
    if (!wanted || !state.info || doc.past.length || doc.state.strokes.length)
      return;
    try {
      const response = await fetch(new URL(wanted, location.href));
      if (!response.ok)
        throw new Error(`the server returned ${response.status}; check the address`);
      const bytes = new Uint8Array(await response.arrayBuffer());
      if (opening === state.opening) // unless another model was opened meanwhile
        await openBytes(wanted, bytes);
    } catch (error) {
      if (opening === state.opening)
        complain(`${wanted}: ${error.message}`);
    }
  }

  function begin() {
    details = section('Paint', HTML, { open: query.has('paint') });
    for (const id of Object.keys(tools))
      $(id).onclick = () => {
        const starts = taken() !== tools[id];
        take(starts ? tools[id] : undefined);
        $(id).ariaPressed = String(starts);
        $('penHint').textContent = starts ? tools[id].hint : '';
        details.open = true;
      };
    $('penUndo').onclick = undo;
    $('penRedo').onclick = redo;
    linkRows(details);
    $('layerAdd').onclick = () => {
      doc.addLayer({ author: localStorage.getItem('ebpo:author') ?? '' });
      layer = doc.state.layers.length - 1;
      showLayers();
    };
    $('paintSave').onclick = saveFile;
    $('paintOpen').onclick = () => $('paintFile').click();
    $('paintFile').onchange = async () => {
      const [file] = $('paintFile').files;
      if (file)
        await openBytes(file.name, new Uint8Array(await file.arrayBuffer()));
      $('paintFile').value = '';
    };
    const canvas = $('canvas'), early = { capture: true };
    for (const [name, listener] of [['pointerdown', down], ['pointermove', move], ['pointerup', up], ['pointercancel', up]])
      canvas.parentElement.addEventListener(name, listener, early); // before the camera receives the event
    on('key', (e) => ({ b: 'penOn', r: 'eraserOn' })[e.key.toLowerCase()] && $({ b: 'penOn', r: 'eraserOn' }[e.key.toLowerCase()]).click());
    addEventListener('keydown', (e) => {
      if ((e.ctrlKey || e.metaKey) && e.key.toLowerCase() === 'z' && state.info && !e.target.matches('input[type=text], textarea')) {
        e.preventDefault();
        e.shiftKey ? redo() : undo();
      }
    });
    addEventListener('beforeunload', (e) => [...docs.values()].every((d) => d.isSaved) || e.preventDefault());
    on('opened', () => {
      fresh();
      fromAddress();
    });
    on('closed', fresh);
    fresh();
    fromAddress();
    window.ebpoViewer.paint = { get file() { return doc.file; }, get pending() { return pending; }, openBytes, write: () => writePaint(doc.file) };
  }
  return { begin, drawing, live: { begin: beginLive, receive, decals, draw } };
}
