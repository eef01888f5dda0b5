// Finds the intersecting faces of the visible instances, and draws them and their curves over the picture.
import { make, section } from '../parts.js';
import { kit } from '../scene.js';
import { $, count, toScene } from '../state.js';
import { boundsOf } from './bounds.js';
import { placed } from './poses.js';

const PAIRS_MOST = 200;
const COLOURS = ['#ff3b30', '#ff9500']; // faces of the first and of the second instance of a pair
const HTML = `<div class="row"><button id="contactsFind" class="small">Intersecting faces</button><button id="contactsClear" class="small" hidden>Clear</button></div>
  <p class="hint" id="contactsText" role="status">Finds all faces of the visible models that intersect each other, exactly.</p><ul id="contactsList" class="list"></ul>`;

/** Returns pairs of instances whose boxes overlap. `infoOf(instance)`: the header of its model. */
export function nearPairs(instances, infoOf) {
  const boxes = instances.map((instance) => {
    const { box_origin: origin, box_size: size } = infoOf(instance);
    return boundsOf([{ instance: { pose: instance.now }, origin, size }], { from: 0, to: 0 });
  });
  const apart = (a, b) => a.origin.some((x, k) => x > b.origin[k] + b.size[k] || b.origin[k] > x + a.size[k]);
  return instances.flatMap((a, i) => instances.slice(i + 1).flatMap((b, k) => (apart(boxes[i], boxes[i + 1 + k]) ? [] : [[a, b]])));
}

export class Contacts {
  #worker;
  #waiting = new Map();
  #search = 0; // a newer search ends an older one
  #ids = 0;

  /** `page`: { assembly, scene, lookAt(instance) }. */
  constructor(page) {
    this.page = page;
    this.group = new kit.Group();
    page.scene.scene.add(this.group);
    section('Contacts', HTML);
    $('contactsFind').onclick = () => this.find();
    $('contactsClear').onclick = () => this.clear();
  }

  #ask(sides) {
    this.#worker ??= this.#start();
    const id = ++this.#ids;
    return new Promise((done, fail) => {
      this.#waiting.set(id, { done, fail });
      this.#worker.postMessage({ id, sides });
    });
  }

  #start() {
    const worker = new Worker(new URL('./pairs_worker.js', import.meta.url), { type: 'module' });
    worker.onmessage = ({ data: { id, error, ...found } }) => {
      const { done, fail } = this.#waiting.get(id);
      this.#waiting.delete(id);
      error ? fail(new Error(error)) : done(found);
    };
    worker.onerror = (e) => this.#waiting.forEach(({ fail }) => fail(new Error(e.message || 'the worker could not be loaded')));
    return worker;
  }

  /** Searches all pairs of visible instances, one after the other. */
  async find() {
    this.clear();
    const { assembly } = this.page, search = this.#search, usable = assembly.models.flatMap((model) => model.shown).filter(({ model }) => assembly.models[model].info?.parts.has('mesh'));
    const pairs = nearPairs(usable, ({ model }) => assembly.models[model].info), some = pairs.slice(0, PAIRS_MOST), side = (instance) => ({ what: this.#fileOf(instance), pose: instance.now });
    let faces = 0, touching = 0;
    $('contactsClear').hidden = false;
    for (const [n, [a, b]] of some.entries()) {
      $('contactsText').textContent = `Pair ${n + 1} of ${some.length}: ${a.name}, ${b.name}`;
      try {
        const found = await this.#ask([side(a), side(b)]);
        if (search !== this.#search)
          return;
        faces += found.count;
        if (found.count) {
          touching++;
          this.#draw(found, [a, b]);
          this.#row(a, b, `${count(found.count)} pairs`);
        }
      } catch (error) {
        if (search !== this.#search)
          return;
        this.#row(a, b, error.message);
      }
    }
    $('contactsText').textContent = `${count(faces)} pairs of faces intersect, in ${count(touching)} of ${count(some.length)} pairs of models whose boxes overlap${
      pairs.length > some.length ? `; ${count(pairs.length - some.length)} more pairs were not searched: hide models` : ''}.`;
  }

  #fileOf({ model }) {
    const { file } = this.page.assembly.models[model];
    return typeof file === 'string' ? new URL(file, document.baseURI).href : file;
  }

  #row(a, b, text) {
    const li = make('li', ''), names = make('button', `${a.name} – ${b.name}`, { className: 'link' });
    names.onclick = () => this.page.lookAt(b);
    li.append(names, make('small', text));
    $('contactsList').append(li);
  }

  #points(values, pose) {
    const out = new Float32Array(values.length);
    for (let i = 0; i < values.length; i += 3)
      out.set(toScene(pose ? placed(pose, [...values.subarray(i, i + 3)]) : [...values.subarray(i, i + 3)]), i);
    return new kit.BufferGeometry().setAttribute('position', new kit.BufferAttribute(out, 3));
  }

  // The faces are drawn over the models, which may hide them.
  #draw({ segments, corners }, instances) {
    const over = { depthTest: false, transparent: true };
    corners.forEach((values, k) => {
      const material = new kit.MeshBasicMaterial({ ...over, color: COLOURS[k], opacity: 0.55, side: kit.DoubleSide });
      this.group.add(new kit.Mesh(this.#points(values, instances[k].now), material));
    });
    this.group.add(new kit.LineSegments(this.#points(segments), new kit.LineBasicMaterial({ ...over, color: '#ffffff' })));
    this.group.children.forEach((object, i) => {
      object.renderOrder = 5 + i % 3;
      object.frustumCulled = false;
    });
    this.page.scene.redraw();
  }

  /** Removes the results, which are those of the poses at the time of the search. */
  clear() {
    this.#search++;
    this.group.children.forEach(({ geometry, material }) => (geometry.dispose(), material.dispose()));
    this.group.clear();
    $('contactsList').replaceChildren();
    $('contactsClear').hidden = true;
    $('contactsText').textContent = 'Finds all faces of the visible models that intersect each other, exactly.';
    this.page.scene.redraw();
  }
}
