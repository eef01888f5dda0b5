// What the element <ebpo-viewer> shows when it has several models in it, or a scene.
import { Assembly } from './assembly.js';
import { Crew } from '../client.js';
import { fromPicture, toPicture } from '../state.js';

export class Several {
  #frame;
  #wasIdle = true;

  /** `scene` shows it; `worker`: the address of worker.js; `want()`: { pixels, triangles }; `heard(type, news)` gets idle, line, failed. */
  constructor(scene, { worker, want, heard }) {
    Object.assign(this, { scene, want, heard, ended: false });
    this.assembly = new Assembly({ crew: new Crew({ worker }), changed: () => this.moved(), news: () => this.#news(),
      failed: (model, { code = 'FORMAT', message }) => heard('failed', { error: { code, message: `${model.name}: ${message}` }, model: model.name }) });
  }

  /** `asked`: what wanted() or ofParts() of asked.js give. Resolves to facts of all when their heads are there. */
  async open(asked) {
    const { assembly, scene } = this, there = await assembly.open(asked);
    if (this.ended)
      throw new DOMException('other models were opened', 'AbortError');
    if (!there)
      throw new Error(`${asked.title}: none of it could be opened; see what was said of each`);
    scene.scene.add(assembly.group);
    scene.others = assembly;
    this.moved();
    return this.facts;
  }

  get facts() {
    const { box, from, to, models, instances } = this.assembly;
    return { box_origin: box.origin, box_size: box.size, from, to, models: models.map(({ name, info, error }) => ({ name, info, error: error?.message })),
      instances: instances.map(({ name, model, layer }) => ({ name, model: models[model].name, layer })) };
  }

  /** The camera has moved, or what is shown is another. */
  moved() {
    this.#frame ??= requestAnimationFrame(() => {
      this.#frame = undefined;
      if (this.ended || !this.assembly.box)
        return;
      this.assembly.update(this.scene.camera, this.scene.canvas.clientHeight, { ...this.want(), mesh: true });
      this.scene.redraw();
      this.#news();
    });
  }

  #news() {
    const { idle, line, stats: { requests, bytes } } = this.assembly;
    if (this.ended)
      return;
    this.heard('line', line);
    if (idle && !this.#wasIdle)
      this.heard('idle', { traffic: { requests, bytes } });
    this.#wasIdle = idle;
  }

  /** An instance by its number: where it is, and whether. */
  place(number, pose, hidden) {
    const instance = this.assembly.instances[number];
    if (instance)
      this.assembly.setPose(Object.assign(instance, { hidden }), pose);
  }

  setTime(time) {
    const { from, to } = this.assembly;
    this.assembly.setTime(Math.max(from, Math.min(to, time)));
  }

  /** By names of instances, layers or models, with a bar between. */
  hide(text) {
    const names = new Set((text ?? '').split('|')), { models, instances } = this.assembly;
    instances.forEach((i) => (i.visible = !i.hidden && ![i.name, i.layer, models[i.model].name].some((name) => names.has(name))));
    this.moved();
  }

  /** What was picked at last, at a point of the picture: { instance (its name), point (of the scene) }; undefined if nothing was. */
  pickedAt(point) {
    const { scene: { picked }, assembly } = this, instance = picked && assembly.instanceOf(picked);
    return instance && { instance: instance.name, point: fromPicture(point, assembly.scene) };
  }

  /** About a point of the scene, of one instance: { point, instance, model, where, distance, nearest, lo, hi, exact }, all in the scene's coordinates. */
  async ask(point, name) {
    const { assembly } = this, instance = assembly.instances.find((i) => i.name === name), model = instance && assembly.models[instance.model];
    if (!model?.info)
      throw new Error(`"${name}" is no instance that is shown; name one of info.instances`);
    const { where, distance, nearest, lo, hi, exact } = await model.client.probe(assembly.inModel(instance, point)), { scale } = instance.now, far = (d) => (d === undefined ? undefined : d * scale);
    return { point, instance: name, model: model.name, where, distance: far(distance), nearest: nearest && assembly.inWorld(instance, nearest), lo: far(lo), hi: far(hi), exact };
  }

  inPicture = (point) => toPicture(point, this.assembly.scene);

  end() {
    this.ended = true;
    cancelAnimationFrame(this.#frame);
    if (this.scene.others === this.assembly)
      this.scene.others = this.scene.cut = undefined;
    this.assembly.end();
    this.scene.redraw();
  }
}
