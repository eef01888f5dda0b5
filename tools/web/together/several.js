// Several models or a scene in the element <ebpo-viewer>.
import { Assembly } from './assembly.js';
import { Crew } from '../client.js';
import { fromPicture, toPicture } from '../state.js';

export class Several {
  #frame;
  #wasIdle = true;

  /** `scene`: draws the models; `worker`: the address of worker.js; `want()`: returns { pixels, triangles }; `heard(type, news)` receives idle, line and failed. */
  constructor(scene, { worker, want, heard }) {
    Object.assign(this, { scene, want, heard, ended: false });
    this.assembly = new Assembly({ crew: new Crew({ worker }), changed: () => this.moved(), news: () => this.#news(),
      failed: (model, { code = 'FORMAT', message }) => heard('failed', { error: { code, message: `${model.name}: ${message}` }, model: model.name }) });
  }

  /** Opens models. `requested`: the result of wanted() or ofParts() of addresses.js. Resolves to `facts` when all headers have been read. */
  async open(requested) {
    const { assembly, scene } = this, there = await assembly.open(requested);
    if (this.ended)
      throw new DOMException('other models were opened', 'AbortError');
    if (!there)
      throw new Error(`${requested.title}: no model could be opened; see the errors of the models`);
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

  /** Call it when the camera has moved or the visible models have changed. */
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

  /** Sets the pose and the visibility of an instance, by its index. */
  place(number, pose, hidden) {
    const instance = this.assembly.instances[number];
    if (instance)
      this.assembly.setPose(Object.assign(instance, { hidden }), pose);
  }

  setTime(time) {
    const { from, to } = this.assembly;
    this.assembly.setTime(Math.max(from, Math.min(to, time)));
  }

  /** Hides instances, layers or models by their names, separated by bars. */
  hide(text) {
    const names = new Set((text ?? '').split('|')), { models, instances } = this.assembly;
    instances.forEach((i) => (i.visible = !i.hidden && ![i.name, i.layer, models[i.model].name].some((name) => names.has(name))));
    this.moved();
  }

  /** Returns the last picked instance's name and a point of the picture in scene coordinates, { instance, point }; undefined when no instance was picked. */
  pickedAt(point) {
    const { scene: { picked }, assembly } = this, instance = picked && assembly.instanceOf(picked);
    return instance && { instance: instance.name, point: fromPicture(point, assembly.scene) };
  }

  /** Queries a point for one instance. Resolves to { point, instance, model, where, distance, nearest, lo, hi, exact }, in the scene's coordinates. */
  async query(point, name) {
    const { assembly } = this, instance = assembly.instances.find((i) => i.name === name), model = instance && assembly.models[instance.model];
    if (!model?.info)
      throw new Error(`"${name}" is not an instance that is shown; name one of info.instances`);
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
