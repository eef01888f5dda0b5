// The element <ebpo-viewer src="statue.ebpo.h5">: shows a model, with a camera, on other pages. With <ebpo-part> children or a scene it shows several models.
// Importing this file defines the element.
import { boxOf, cameraOf, cameraText, clipOf, cutOf, pointsOf } from './address.js';
import { Client } from './client.js';
import { Scene } from './scene.js';
import { fromPicture, rayThrough, toPicture } from './state.js';
import { ofParts, poseFrom, wanted } from './together/addresses.js';
import { Several } from './together/several.js';

const OPENS = ['src', 'scene', 'remote', 'up'], PART = 'ebpo-part';
const FIELD_OF_VIEW = 38, TRIANGLES_MOST = 2_000_000, PIXELS = 12, LATER_MS = 200;
const STYLE = `
  :host { display: block; position: relative; min-height: 200px; --text: #e6e9ef; --back: radial-gradient(ellipse at 45% 38%, #1b2028, #101318 72%); --plate: rgba(22, 26, 33, .86); }
  :host([hidden]) { display: none; }
  .light { --text: #1a2130; --back: radial-gradient(ellipse at 45% 38%, #d9dde5, #eef0f4 72%); --plate: rgba(255, 255, 255, .88); }
  #stage { position: absolute; inset: 0; background: var(--back); overflow: hidden; }
  canvas { width: 100%; height: 100%; display: block; outline: none; touch-action: none; cursor: grab; }
  canvas:focus-visible { outline: 2px solid #e8784f; outline-offset: -3px; }
  #bar { position: absolute; inset: 0 auto auto 0; height: 3px; background: #e8784f; transition: width .2s; }
  #say { position: absolute; left: 12px; right: 12px; bottom: 12px; margin: 0 auto; width: fit-content; max-width: 90%; padding: 8px 12px; border-radius: 8px; font: 13px/1.4 system-ui, sans-serif;
    color: var(--text); background: var(--plate); }
  #say:empty { display: none; }`;
const STEER = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1], '+': 0.8, '=': 0.8, '-': 1.25 };

// Returns the properties of parts as text. When they change, the parts are opened again.
const filesOf = (parts) => JSON.stringify(parts.map(({ src, colour, name }) => [src, colour, name]));

export class EbpoViewerElement extends HTMLElement {
  static observedAttributes = [...OPENS, 'view', 'level', 'detail', 'clip', 'box', 'point', 'colour', 'theme', 'cell-faces', 'time', 'hide', 'colours'];
  /** The address of worker.js, if worker.js is not beside this file. Set it before the first element exists. */
  static worker = undefined;

  #client;   // when one model is shown
  #several;  // when several models are shown
  #parts;    // the opened parts; undefined when load() or a scene selected the models
  #changes = new MutationObserver((all) => this.#partsChanged(all));
  #scene;
  #timer;

  constructor() {
    super();
    this.attachShadow({ mode: 'open' }).innerHTML = `<style>${STYLE}</style><div id="stage"><canvas tabindex="0" role="img"></canvas><div id="bar" hidden></div><p id="say" role="status"></p></div>`;
  }

  #part(name) {
    return this.shadowRoot.querySelector(name);
  }

  connectedCallback() {
    if (this.#scene)
      return;
    const canvas = this.#part('canvas');
    canvas.ariaLabel = this.getAttribute('alt') ?? 'A model in three dimensions: drag or arrow keys turn it, wheel, + and - zoom';
    this.#scene = new Scene(canvas, { contextOptions: { antialias: true }, fieldOfView: FIELD_OF_VIEW }, { changed: () => this.#moved(), drawn() {},
      lost: (gone) => this.#showMessage(gone ? 'The browser has taken the graphics context away.' : '') });
    this.#listen(canvas);
    EbpoViewerElement.observedAttributes.filter((name) => !OPENS.includes(name) && this.hasAttribute(name)).forEach((name) => this.#apply(name));
    if (!this.hasAttribute('theme'))
      this.#apply('theme');
    this.#changes.observe(this, { childList: true, subtree: true, attributes: true, attributeFilter: ['src', 'pose', 'name', 'colour', 'hidden'] });
    this.#open();
  }

  // Frees everything when the element was removed. An element that moves within its page is disconnected only briefly.
  disconnectedCallback() {
    queueMicrotask(() => {
      if (this.isConnected || !this.#scene)
        return;
      clearTimeout(this.#timer);
      this.#changes.disconnect();
      this.#client?.end();
      this.#several?.end();
      this.#scene.end();
      this.#scene = this.#client = this.#several = undefined;
      this.#part('canvas').replaceWith(Object.assign(document.createElement('canvas'), { tabIndex: 0, role: 'img' })); // a canvas that has lost its context is not reusable
    });
  }

  attributeChangedCallback(name, was, is) {
    if (this.#scene && was !== is)
      this.#apply(name);
  }

  #listen(canvas) {
    let down;
    canvas.addEventListener('pointerdown', (e) => (down = e.button === 0 ? [e.clientX, e.clientY] : undefined));
    canvas.addEventListener('pointerup', (e) => {
      const at = down && Math.hypot(e.clientX - down[0], e.clientY - down[1]) <= 4 && this.info ? this.#scene.pick(e.clientX, e.clientY) : undefined;
      const eye = this.#scene.pickedFrom, { point, instance } = (at && (this.#several ? this.#several.pickedAt(at) : { point: fromPicture(at, this.#client.scene) })) ?? {};
      if (point)
        this.#query(point, instance, eye && !this.#several ? rayThrough(fromPicture(eye, this.#client.scene), point) : undefined).catch(() => {});
    });
    canvas.addEventListener('keydown', (e) => {
      if (!STEER[e.key] || e.ctrlKey || e.metaKey || e.altKey)
        return;
      e.preventDefault();
      this.#scene.steer(STEER[e.key], e.shiftKey);
    });
  }

  #apply(name) {
    const text = this.getAttribute(name), scene = this.#scene;
    if (OPENS.includes(name))
      this.#open();
    else if (name === 'time')
      this.#several?.setTime(Number(text) || 0);
    else if (name === 'hide')
      this.#several?.hide(text);
    else if (name === 'colours')
      this.#several?.assembly.setColours(text);
    else if (name === 'view')
      this.#setView();
    else if (name === 'clip' || name === 'box')
      this.#cut();
    else if (name === 'point' && this.info && !this.#several && pointsOf(text)?.length === 1)
      this.query(pointsOf(text)[0]).catch(() => {});
    else if (name === 'point' && !text)
      scene.showProbe();
    else if (name === 'colour')
      this.#applyToScenes((it) => it.setColouring(['level', 'type'].includes(text) ? text : 'plain'));
    else if (name === 'cell-faces')
      this.#applyToScenes((it) => it.setCellFaces(text !== '0'));
    else if (name === 'theme')
      this.#setTheme(text ?? (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark'));
    this.#sendView();
  }

  #applyToScenes(change) {
    change(this.#scene);
    if (this.#several)
      change(this.#several.assembly);
  }

  #setTheme(theme) {
    this.#part('#stage').className = theme === 'light' ? 'light' : '';
    this.#applyToScenes((it) => it.setTheme(theme !== 'light'));
  }

  #setView() {
    const camera = cameraOf(this.getAttribute('view'));
    if (camera)
      this.#scene.place = camera;
    else
      this.#scene.home();
  }

  #cut() {
    if (this.#several?.assembly.box)
      this.#scene.cut = this.#several.assembly.setBox(boxOf(this.getAttribute('box')));
    if (!this.info || this.#several)
      return;
    const cut = cutOf(this.info.box_size, this.#client.scene.scale, clipOf(this.getAttribute('clip')), boxOf(this.getAttribute('box')));
    this.#scene.setCut(cut?.low, cut?.high);
  }

  #number(name) {
    return /^\d+$/.test(this.getAttribute(name) ?? '') ? Number(this.getAttribute(name)) : undefined;
  }

  #sendView() {
    const level = this.#number('level') ?? 99, pixels = this.#number('detail') ?? PIXELS, { info } = this;
    this.#several?.moved();
    if (this.#several || !this.#client)
      return;
    this.#client.look(this.#scene.view(), { level, mesh: Boolean(info?.parts.has('mesh')) && level >= info.level_count,
      surface: Boolean(info) && level >= info.level_count && !['level', 'type'].includes(this.getAttribute('colour')), pixels, triangles: pixels === 0 ? Infinity : TRIANGLES_MOST,
      black: this.#scene.cut !== undefined, lines: false, cells: false });
  }

  #moved() {
    if (!this.#client && !this.#several)
      return;
    this.#sendView();
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#dispatch('view', { view: this.view }), LATER_MS);
  }

  #dispatch(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  #handle(type, news) {
    if (type === 'tiles') {
      this.#scene.setTiles(news.set, news.removed);
    } else if (type === 'line') {
      const { got, want, quiet } = news, bar = this.#part('#bar');
      bar.hidden = !(want > 0);
      bar.style.width = want > 0 ? `${100 * got / want}%` : '';
      this.#showMessage(news.trouble ?? (want > 0 && quiet > 3000 ? `No data for ${Math.floor(quiet / 1000)} s` : ''));
      this.#dispatch('progress', { got, want, quiet });
    } else if (type === 'idle') {
      this.#part('#bar').hidden = true;
      this.#dispatch('idle', { traffic: news.traffic });
    } else if (type === 'failed') {
      this.#showMessage(news.error.message);
      this.#dispatch('error', { code: news.error.code, message: news.error.message, ...(news.model && { model: news.model }) });
    }
  }

  #showMessage(text) {
    if (this.#part('#say').textContent !== text)
      this.#part('#say').textContent = text;
  }

  // Closes what is open: one model or several.
  #close() {
    this.#client?.close();
    this.#several?.end();
    this.#several = undefined;
    this.#scene.clear();
    this.#scene.setCut();
    this.#showMessage('');
  }

  // --- opening the attributes and parts ---

  #open() {
    const parts = this.parts, src = this.getAttribute('src'), scene = this.getAttribute('scene');
    if (scene)
      this.#openSeveral(() => wanted(new URLSearchParams([['scene', scene], ...['up', 'remote'].filter((n) => this.hasAttribute(n)).map((n) => [n, this.getAttribute(n) || '1'])]),
        document.baseURI)).catch(() => {});
    else if (parts.length || src)
      this.load(parts.length ? parts : src).catch(() => {});
    else
      this.#close();
    this.#parts = scene ? undefined : filesOf(parts);
  }

  // Handles added, removed and changed parts. Changes while the page is being parsed arrive together.
  #partsChanged(all) {
    if (!all.some(({ type, target }) => type === 'childList' || target.localName === PART) || !this.#scene || this.#parts === undefined)
      return;
    const { parts } = this;
    if (filesOf(parts) !== this.#parts) {
      this.#open();
      return;
    }
    try { // the same files at other poses
      parts.forEach(({ pose, hidden }, i) => this.#several?.place(i, poseFrom(pose), hidden));
      this.#apply('hide');
    } catch (error) {
      this.#handle('failed', { error: { code: 'ARGUMENT', message: error.message } });
    }
  }

  async #openSeveral(parse) {
    this.#close();
    const several = this.#several = new Several(this.#scene, { worker: EbpoViewerElement.worker, heard: (type, news) => this.#handle(type, news),
      want: () => ({ pixels: this.#number('detail') ?? PIXELS, triangles: TRIANGLES_MOST }) });
    try {
      const facts = await several.open(await parse());
      ['time', 'hide', 'colours', 'colour', 'cell-faces', 'theme', 'view', 'box'].forEach((name) => this.#apply(name));
      this.#dispatch('load', facts);
      return facts;
    } catch (error) {
      if (error.name !== 'AbortError')
        this.#handle('failed', { error: { code: error.code ?? 'ARGUMENT', message: error.message } });
      throw error;
    }
  }

  // --- for the page ---

  /** The root attributes of the open file, by the format's names; for several models { box_origin, box_size, from, to, models, instances }. */
  get info() {
    return this.#several ? this.#several.assembly.box && this.#several.facts : this.#client?.info;
  }

  /** The attributes of the <ebpo-part> children, as unparsed texts: [{ src, pose, name, colour, hidden }]. */
  get parts() {
    const text = (part, name) => part.getAttribute(name) ?? undefined;
    return [...this.children].filter((part) => part.localName === PART && part.hasAttribute('src')).map((part) => ({ src: text(part, 'src'), pose: text(part, 'pose'),
      name: text(part, 'name'), colour: text(part, 'colour'), hidden: part.hasAttribute('hidden') }));
  }

  /** The view, in the form of the parameter `view` of the viewer's address. */
  get view() {
    return this.#scene && cameraText(this.#scene.place);
  }

  set view(text) {
    this.setAttribute('view', text);
  }

  get src() {
    return this.getAttribute('src');
  }

  set src(text) {
    this.setAttribute('src', text);
  }

  /** Opens an address, a File or a Blob, or a list of parts in the form of `parts`, whose `src` may be Files or Blobs. Resolves to the value of `info`. */
  async load(what) {
    this.#parts = undefined;
    if (Array.isArray(what))
      return this.#openSeveral(async () => ofParts(what.map((part) => ({ ...part, pose: poseFrom(part.pose) })), document.baseURI));
    this.#close();
    this.#client ??= new Client({ worker: EbpoViewerElement.worker, heard: (type, news) => this.#handle(type, news) });
    const { info } = await this.#client.open(what);
    this.#setView();
    this.#cut();
    this.#sendView();
    this.#dispatch('load', info);
    const points = pointsOf(this.getAttribute('point'));
    if (points?.length === 1)
      this.query(points[0]).catch(() => {});
    return info;
  }

  /** Moves the camera so that the whole model is visible. */
  home() {
    this.#scene.home();
  }

  /**
   * Queries a point and marks it. Resolves to { point, where, distance, nearest, lo, hi, exact }, which the event `point` also has. With several models, the point
   * is in the scene's coordinates, and `instance` is the name of the queried instance.
   */
  async query(point, instance) {
    if (!this.info)
      throw new Error('no model is open; wait for the event load');
    return this.#query(point, instance);
  }

  async #query(point, instance, ray) {
    const several = this.#several, inScene = several?.inPicture ?? ((p) => toPicture(p, this.#client.scene));
    this.#scene.showProbe(inScene(point));
    const result = several ? await several.query(point, instance) : await this.#queryOne(point, ray), { where, nearest } = result;
    this.#scene.showProbe(inScene(result.point), nearest && inScene(nearest), where === 'in' ? '#4cc38a' : where === 'out' ? '#ff6b6b' : '#ffb020');
    this.#dispatch('point', result);
    return result;
  }

  async #queryOne(asked, ray) {
    const { point, where, distance, nearest, lo, hi, exact } = await this.#client.probe(asked, ray);
    return { point, where, distance, nearest, lo, hi, exact };
  }
}

if (!customElements.get('ebpo-viewer'))
  customElements.define('ebpo-viewer', EbpoViewerElement);
