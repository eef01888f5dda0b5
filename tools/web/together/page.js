// The page with several models or a scene: instances, poses, colours, time and clicks. Levels, notes, and a pen of this page are not supported here.
import { Assembly, COLOURS } from './assembly.js';
import { Contacts } from './contacts.js';
import { addPainted } from './painted.js';
import { boxText, cameraOf, cameraText, boxOf, pointsOf, pointsText, withQuery } from '../address.js';
import { addCompass } from '../compass.js';
import { busy, bytes, showError, showLine, showPointCard } from '../line.js';
import { addLive } from '../live.js';
import { addDistances } from '../measure.js';
import { complain, make, markOn, section } from '../parts.js';
import { Pipeline } from '../pipeline.js';
import { kit } from '../scene.js';
import { addSectionBox } from '../section_box.js';
import { addShading, shownText, styled, themeText } from '../shading.js';
import { addSharing, quoted } from '../sharebox.js';
import { $, count, emit, length, on, state, toScene } from '../state.js';
import { cameraAt } from './scene_file.js';

const TRIANGLES_MOST = 2_000_000, PIXELS = 12, LATER_MS = 300, NAMES_MOST = 300;
const HTML = `<div class="row" id="timeRow" hidden><button id="timePlay" class="small" aria-pressed="false">Play</button><input type="range" id="time" min="0" max="1000" value="0"
  aria-label="Time"><output id="timeText"></output></div>
  <div id="cameras" class="buttons"></div><ul id="models" class="list"></ul><div id="sceneLayers" class="toggles"></div>`;
const CHOSEN = `<p class="hint" id="chosenHint">Click a model to select it and to query the point.</p><div id="chosen" hidden>
  <div class="result"><strong id="chosenName"></strong><span id="chosenModel"></span></div><dl id="chosenFacts" class="facts"></dl>
  <div class="result"><strong id="chosenWhere"></strong><span id="chosenNote"></span></div>
  <div class="buttons"><button id="chosenLook" class="small">Look at it</button><a id="chosenOpen" class="small">Open it alone</a></div></div>`;

/** Shows several models. `page`: { scene, layout } of app.js; `requested`: the result of wanted() or ofFiles() of addresses.js. */
export async function begin(page, requested) {
  const { scene } = page;
  await styled();
  return new Together(page, requested, scene).open();
}

class Together {
  constructor(page, requested, scene) {
    Object.assign(this, { page, requested, scene, hidden: new Set(), hiddenLayers: new Set() });
    this.query = new URLSearchParams(location.search);
    this.assembly = new Assembly({ changed: () => this.#soon(), news: () => this.#news(), failed: (model, error) => this.#failed(model, error) });
    this.assembly.setTheme(document.documentElement.dataset.theme !== 'light');
    state.together = this;
  }

  async open() {
    const { requested, assembly, scene } = this;
    document.documentElement.classList.add('together');
    $('start').hidden = true;
    document.documentElement.classList.add('opening');
    $('openingName').textContent = requested.title;
    $('openingText').textContent = `${count(requested.models.length)} models`;
    scene.scene.add(assembly.group);
    scene.others = assembly;
    let there = false;
    try {
      there = await assembly.open(requested);
    } finally {
      document.documentElement.classList.remove('opening');
      if (!there)
        this.#leave();
    }
    if (!there)
      return;
    this.#opened();
    this.#build();
    this.#takeAddress();
    this.#soon();
    emit('opened');
    assembly.models.filter((m) => m.error).forEach((m) => this.#failed(m, m.error)); // shows errors again, now with a button to retry
  }

  // Sets the state that other modules of the page read.
  #opened() {
    const { requested, assembly: { box, models, scene } } = this, unit = requested.unit ?? models.find((m) => m.info?.unit)?.info.unit;
    state.scene = scene;
    state.info = { box_origin: box.origin, box_size: box.size, unit, parts: new Set(), levels: [], level_count: 0 };
  }

  // Returns to the first page, because no model can be shown.
  #leave() {
    this.assembly.end();
    this.scene.others = state.together = undefined;
    document.documentElement.classList.remove('together');
    busy(false);
    $('start').hidden = false;
  }

  #failed(model, error) {
    const again = async () => {
      await this.assembly.retry();
      this.#opened();
      this.#rows();
      this.#marks();
      this.moved();
      this.painted?.retry();
    };
    showError({ message: `${model.name}: ${error.message}` }, error.code === 'NETWORK' && state.info ? again : undefined);
  }

  /** Repeats pending requests. */
  retry() {
    this.assembly.models.forEach((model) => model.client.retry());
    this.moved();
  }

  // --- panel ---

  #build() {
    const { requested, assembly, scene, page } = this, faces = assembly.instances.reduce((sum, i) => sum + (assembly.models[i.model].info?.face_count ?? 0), 0);
    document.title = `${requested.title} – EBP-Octree viewer`;
    $('name').textContent = requested.title;
    const { length } = assembly.models;
    $('facts').textContent = `${count(length)} model${length === 1 ? '' : 's'} · ${count(assembly.instances.length)} instances · ${count(faces)} faces`;
    for (const id of ['panel', 'bar', 'tools'])
      $(id).hidden = id === 'panel' && innerWidth <= 760;
    markOn(scene);
    section('Models', HTML, { open: true });
    section('Selected instance', CHOSEN, { open: true });
    addSectionBox({ cutChanged: () => this.#cut() });
    addDistances({ scene, placeOf: (point) => this.#placeOf(point), changed: () => this.changed() });
    if (assembly.instances.length > 1)
      this.contacts = new Contacts({ assembly, scene, lookAt: (instance) => this.#lookAt(instance) });
    const pipeline = scene.pipeline = new Pipeline(kit);
    addShading(scene, pipeline, () => this.changed());
    addSharing({ address: () => this.address(), elementOf: (query) => this.#elementOf(query) });
    addCompass({ scene, changed: () => this.changed(), up: assembly.up });
    this.#rows();
    this.#layers();
    this.#cameras();
    this.#times();
    $('ownRow').hidden = false;
    $('own').onchange = () => (assembly.setOwnColours($('own').checked), scene.redraw());
    $('cellFaces').onchange = () => (assembly.setCellFaces($('cellFaces').checked), scene.redraw());
    $('colouring').onchange = () => (assembly.setColouring(document.querySelector('input[name=colouring]:checked').value), scene.redraw());
    $('detail').onchange = () => this.moved();
    $('chosenLook').onclick = () => this.#lookAt(assembly.chosen);
    on('theme', () => (assembly.setTheme(document.documentElement.dataset.theme !== 'light'), scene.redraw()));
    on('escape', () => this.#choose());
    page.layout();
    scene.home();
    this.homeView = cameraText(scene.place);
    if (this.query.has('live'))
      addLive({ scene, query: this.query }, this.painted = addPainted({ scene, assembly, pipeline }));
  }

  #rows() {
    const { assembly } = this;
    $('models').replaceChildren(...assembly.models.map((model) => {
      const li = make('li', ''), eye = make('input', '', { type: 'checkbox', checked: model.visible, ariaLabel: `Show ${model.name}` }), colour = make('input', '', { type: 'color',
        value: model.colour, ariaLabel: `Colour of ${model.name}` });
      const name = make('button', model.name, { className: 'link', disabled: !model.info });
      const facts = model.info ? [`${count(model.info.face_count)} faces`, model.instances.length > 1 && `${count(model.instances.length)} instances`, model.size && bytes(model.size)]
        : [model.error ? 'could not be opened' : 'no instance'];
      eye.onchange = () => this.#show(model, eye.checked);
      colour.oninput = () => {
        assembly.setColour(model, colour.value);
        this.scene.redraw();
        this.changed();
      };
      name.onclick = () => this.#choose(model.instances.find((i) => i.visible) ?? model.instances[0]);
      li.append(eye, colour, name, make('small', facts.filter(Boolean).join(' · ')));
      return li;
    }));
  }

  #show(model, visible) {
    model.visible = visible;
    this.moved();
    this.changed();
  }

  #layers() {
    const { layers = [] } = this.requested;
    $('sceneLayers').replaceChildren(...layers.slice(0, NAMES_MOST).map((layer) => {
      const label = make('label', '', { className: 'switch' }), box = make('input', '', { type: 'checkbox', checked: !this.hiddenLayers.has(layer) });
      box.onchange = () => {
        box.checked ? this.hiddenLayers.delete(layer) : this.hiddenLayers.add(layer);
        this.#applyLayers();
        this.changed();
      };
      label.append(box, make('span', layer));
      return label;
    }));
  }

  #applyLayers() {
    this.assembly.instances.forEach((i) => (i.visible = !this.hiddenLayers.has(i.layer)));
    this.moved();
  }

  #cameras() {
    const { cameras = [] } = this.requested;
    $('cameras').replaceChildren(...cameras.slice(0, NAMES_MOST).map((camera) => {
      const go = make('button', camera.name, { className: 'small' });
      go.onclick = () => {
        const { eye, target } = cameraAt(camera, this.assembly.time);
        this.scene.place = { eye: toScene(eye), target: toScene(target) };
        this.changed();
      };
      return go;
    }));
  }

  // --- time ---

  #times() {
    const { from, to } = this.assembly, moves = to > from;
    $('timeRow').hidden = !moves;
    if (!moves)
      return;
    $('time').oninput = () => this.#setTime(from + (to - from) * $('time').value / 1000);
    $('timePlay').onclick = () => {
      this.playing = !this.playing;
      $('timePlay').ariaPressed = String(this.playing);
      this.changed();
      let last = performance.now();
      const step = (now) => {
        if (!this.playing)
          return;
        const time = this.assembly.time + (now - last) / 1000;
        last = now;
        this.#setTime(time > to ? from : time);
        requestAnimationFrame(step);
      };
      requestAnimationFrame(step);
    };
    this.#showTime();
  }

  #setTime(time) {
    this.assembly.setTime(time);
    this.contacts?.clear();
    this.#showTime();
    this.#marks();
    this.changed();
  }

  #showTime() {
    const { from, to, time } = this.assembly;
    $('time').value = 1000 * (time - from) / (to - from);
    $('timeText').textContent = `${time.toFixed(2)} s`;
  }

  // --- the selected instance ---

  /** Handles a click. app.js calls it with the clicked point in world coordinates. */
  clicked(point) {
    const instance = this.scene.picked && this.assembly.instanceOf(this.scene.picked);
    this.#choose(instance, instance && this.assembly.inModel(instance, point), this.scene.pickPrecision(toScene(point)) / state.scene.scale);
  }

  // `precision`: the accuracy of a clicked point, in world coordinates.
  async #choose(instance, point, precision = 0) {
    const { assembly } = this, queries = this.queries = (this.queries ?? 0) + 1, model = instance && assembly.models[instance.model];
    assembly.chosen = instance;
    this.point = point;
    this.near = undefined;
    $('chosen').hidden = !instance;
    showPointCard(instance?.name);
    this.changed();
    $('chosenHint').hidden = Boolean(instance);
    this.#marks();
    this.moved();
    if (!instance)
      return;
    this.#showChosen(instance, model);
    if (!point || !model.info)
      return;
    try {
      const response = await model.client.probe(point);
      if (queries !== this.queries)
        return;
      this.near = response.nearest;
      this.#showResult(model, response, instance.now.scale, precision);
      this.#marks();
    } catch (error) {
      if (error.name !== 'AbortError')
        complain(error.message);
    }
  }

  #showChosen(instance, { name, info, size, error, file }) {
    $('chosenName').textContent = instance.name;
    $('chosenModel').textContent = instance.name === name ? '' : name;
    const rows = info ? [['Faces', count(info.face_count)], ['Kind', info.solid ? 'solid' : 'surface'], ['Levels', `0–${info.level_count - 1}`], ['File', bytes(size)],
      ...(instance.layer ? [['Layer', instance.layer]] : []), ...(instance.now?.scale === 1 ? [] :
        [['Scale', String(Number(instance.now?.scale.toPrecision(5)))]])] : [['Problem', error?.message ?? '']];
    $('chosenFacts').replaceChildren(...rows.flatMap(([dt, dd]) => [make('dt', dt), make('dd', dd)]));
    $('chosenWhere').textContent = $('chosenNote').textContent = '';
    $('chosenOpen').hidden = typeof file !== 'string';
    if (typeof file === 'string')
      $('chosenOpen').href = withQuery(new URL(location.pathname, location.href).href, [['file', file]]);
  }

  #showResult({ info }, { where, distance, lo, hi, exact }, scale, precision) {
    const words = { in: 'Inside', out: 'Outside', on: 'On the surface', maybe: 'Undecided' }, onSurface = exact && distance * scale <= precision;
    $('chosenWhere').textContent = onSurface ? words.on : info.solid ? words[where] ?? '' : 'A surface';
    const near = onSurface ? 'within the accuracy of the click' : exact ? `${length(distance * scale, 6)} to the nearest face`
      : `${length(lo * scale, 3)} – ${length(hi * scale, 3)} to the surface`;
    $('chosenNote').textContent = `${near}; at ` +
      this.assembly.inWorld(this.assembly.chosen, this.point).map((x) => Number(x.toPrecision(6))).join(', ');
    showPointCard(this.assembly.chosen.name, `${$('chosenWhere').textContent}, ${$('chosenNote').textContent}`);
  }

  // Shows the query point and its nearest point, which move with their instance.
  #marks() {
    const { assembly, point, near } = this, at = (p) => p && toScene(assembly.inWorld(assembly.chosen, p));
    this.scene.showProbe(assembly.chosen && at(point), assembly.chosen && at(near));
  }

  // Returns the position on the nearest face of the clicked instance, for measuring distances.
  async #placeOf(point) {
    const { picked, pickedCut } = this.scene, instance = picked && this.assembly.instanceOf(picked), model = instance && this.assembly.models[instance.model];
    if (!instance || pickedCut || !model.info.parts.has('mesh'))
      return point;
    const [{ place }] = await model.client.positions([this.assembly.inModel(instance, point)]);
    return this.assembly.inWorld(instance, place);
  }

  #lookAt(instance) {
    if (!instance?.at)
      return;
    const { eye, target } = this.scene.place, away = eye.map((x, k) => x - target[k]), far = Math.hypot(...away), near = Math.min(11, Math.max(0.01, 3 * instance.radius));
    this.scene.place = { target: instance.at, eye: instance.at.map((x, k) => x + away[k] / far * near) };
    this.changed();
  }

  // --- the picture ---

  #cut() {
    this.scene.cut = this.assembly.setBox(state.box);
    this.moved();
    this.changed();
  }

  /** Call it when the camera has moved or the visible models have changed. */
  moved() {
    this.#soon();
    this.changed();
  }

  #soon() {
    this.timer ??= requestAnimationFrame(() => {
      this.timer = undefined;
      if (!state.info)
        return;
      this.painted?.draw();
      const detail = $('detail').value === 'auto' ? PIXELS : Number($('detail').value);
      this.assembly.update(this.scene.camera, this.scene.canvas.clientHeight, { pixels: detail, triangles: TRIANGLES_MOST, mesh: true });
      this.scene.redraw();
      this.#news();
    });
  }

  #news() {
    const idle = this.assembly.idle, s = this.assembly.stats;
    state.idle = Boolean(state.info) && idle;
    busy(!idle);
    if (!idle)
      showLine(this.assembly.line);
    Object.entries({ sRequests: count(s.requests), sBytes: `${bytes(s.bytes)} of ${bytes(s.size)}`, sNodes: count(s.nodes), sTriangles: count(s.triangles), sMesh: count(s.meshTriangles) })
      .forEach(([id, text]) => ($(id).textContent = text));
  }

  // --- the address ---

  #takeAddress() {
    const { query, assembly } = this, names = (key) => (query.get(key) ?? '').split('|').filter(Boolean), time = Number(query.get('time')), [home] = [this.scene.place];
    const view = cameraOf(query.get('view'));
    this.scene.place = view ?? home;
    for (const name of names('hide')) {
      assembly.models.filter((m) => m.name === name).forEach((m) => (m.visible = false));
      if (this.requested.layers?.includes(name))
        this.hiddenLayers.add(name);
    }
    assembly.setColours(query.get('colours'));
    this.#rows();
    this.#layers();
    this.#applyLayers();
    if (query.has('time') && Number.isFinite(time) && assembly.to > assembly.from)
      this.#setTime(Math.max(assembly.from, Math.min(assembly.to, time)));
    state.box = boxOf(query.get('box'));
    if (state.box)
      this.#cut();
    state.measured = pointsOf(query.get('measure'));
    const instance = assembly.instances.find((i) => i.name === query.get('chosen')), [point] = pointsOf(query.get('point')) ?? [];
    if (instance)
      this.#choose(instance, point && assembly.inModel(instance, point));
  }

  /** Returns the address of the current view. */
  address() {
    const { assembly, scene } = this, view = cameraText(scene.place), diagonal = Math.hypot(...assembly.box.size);
    const hidden = [...assembly.models.filter((m) => !m.visible).map((m) => m.name), ...this.hiddenLayers];
    const colours = assembly.models.filter((m, i) => m.colour !== COLOURS[i % COLOURS.length]).map((m) => `${m.name}:${m.colour.slice(1)}`);
    const chosen = assembly.chosen?.name, point = chosen && this.point && assembly.inWorld(assembly.chosen, this.point);
    return withQuery(location.href, [['chosen', chosen], ['point', point && pointsText([point], diagonal)], ['show', shownText()], ['theme', themeText()],
      ['view', view === this.homeView ? undefined : view], ['time', assembly.time === assembly.from ? undefined : assembly.time.toFixed(3)],
      ['hide', hidden.join('|')], ['colours', colours.join('|')], ['box', boxText(state.box)], ['measure', state.measured?.length ? pointsText(state.measured, diagonal) : undefined]]);
  }

  // Returns the element <ebpo-viewer> of a link to the scene or the models; the argument of addSharing().
  #elementOf(query) {
    const attributes = ['scene', 'up', 'remote', 'view', 'time', 'hide', 'colours', 'box', 'theme'].filter((name) => query.has(name)).map((name) => [name, query.get(name)]);
    const poses = query.getAll('pose'), children = query.getAll('model').map((src, i) => `<ebpo-part src="${quoted(src)}"${poses[i] ? ` pose="${quoted(poses[i])}"` : ''}></ebpo-part>`);
    return { attributes, children: children.join(''), local: Boolean(this.requested.local) };
  }

  changed() {
    if (!state.info || this.requested.local || this.playing) // browsers reject changes of the address that are too frequent
      return;
    this.later ??= setTimeout(() => {
      this.later = undefined;
      if (this.address() !== location.href)
        history.replaceState(history.state, '', this.address());
    }, LATER_MS);
  }
}
