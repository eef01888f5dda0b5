// A haptic device that moves in another program (`ebpo haptic --view`): its steps and its paint arrive as server-sent events. The mouse can be the device.
import { complain, mark, section, svg, take, taken } from './parts.js';
import { $, length, on, state, toModel, toScene } from './state.js';

const HTML = `
  <p id="liveState" role="status">Waiting for the device</p>
  <div class="buttons"><button id="liveTouch" class="small" aria-pressed="false" hidden>Touch</button></div>
  <p class="hint" id="liveHint"></p>`;
const FREE = '#8a94a6', CONTACT = '#e5484d';
const ARROW = 0.3;       // length of the arrow of the greatest force, in halves of the box's diagonal
const GAP = 0.01;        // distance of the tool from the surface while no button is pressed, in halves of the diagonal
const KEPT = 10000;      // most delays that are kept

export function addLive({ scene, query }, pen) {
  if (!query.has('live'))
    return;
  const address = new URL(query.get('live'), location.href);
  if (address.origin !== location.origin) {
    complain('the device must be on the server of this page; open the address that ebpo haptic prints');
    return;
  }
  // Milliseconds from each contact until its first paint has arrived (arrivals), and until the page has submitted its drawing (delays). Without paint: the contact.
  const live = { arrivals: [], delays: [], steps: 0, paints: 0, connected: false, ended: false, last: undefined };
  let hello = { radius: 0, full_depth: 0, device: false, paint: false }, source, touched, submits, greatest = 0;
  section('Device', HTML, { open: true });

  // --- the picture ---

  const line = svg('line', { stroke: CONTACT, 'stroke-width': 3, 'stroke-linecap': 'round' }), ends = [[0, 0, 0], [0, 0, 0]];
  mark(line, ends, ([a, b]) => Object.entries({ x1: a[0], y1: a[1], x2: b[0], y2: b[1] }).forEach(([name, value]) => line.setAttribute(name, value)));

  function show(step) {
    const { device, proxy, force, contact, depth, colour } = step, size = Math.hypot(...force), from = toScene(proxy);
    greatest = Math.max(greatest, size);
    // toScene() of a direction: the difference of two points
    const to = toScene(proxy.map((x, k) => x + (size ? force[k] / greatest * ARROW / state.scene.scale : 0)));
    ends.splice(0, 2, from, to);
    line.style.visibility = size ? '' : 'hidden';
    scene.showProbe(toScene(device), from, colour ?? (contact ? CONTACT : FREE)); // also draws a new frame
    $('liveState').textContent = colour ? `Distance ${depth === null ? 'unknown' : length(depth, 4)}` : contact ? `Contact: force ${size.toPrecision(3)}, depth ${length(depth, 3)}` : 'No contact';
  }

  const isSame = (a, b) => b && a.contact === b.contact && a.colour === b.colour && ['device', 'proxy', 'force'].every((name) => a[name].every((x, k) => x === b[name][k]));
  function takeStep(step) {
    const moved = !isSame(step, live.last);
    live.steps++;
    live.last = step;
    const begin = step.now - step.touch_age;
    if (step.contact && !(Math.abs(begin - touched) < 5)) { // a new contact
      touched = begin;
      submits = { begin, arrived: hello.paint ? undefined : Date.now() };
    }
    if (state.info && moved)
      show(step);
  }

  function takePaint(news) {
    const first = submits && !submits.arrived && news.strokes.length;
    live.paints++;
    if (first)
      submits.arrived = Date.now();
    pen.receive(news);
    if (first && state.info)
      scene.draw(); // the next frame of the browser may be late
  }

  on('frame', () => {
    if (submits?.arrived) {
      live.arrivals.push(submits.arrived - submits.begin);
      live.delays.push(Date.now() - submits.begin);
      for (const list of [live.arrivals, live.delays])
        list.splice(0, list.length - KEPT);
      submits = undefined;
    }
  });

  // --- the connection ---

  function connect() {
    source = new EventSource(address);
    const listen = (name, listener) => source.addEventListener(name, ({ data }) => listener(JSON.parse(data)));
    listen('hello', (news) => {
      hello = news;
      live.connected = true;
      $('liveTouch').hidden = !hello.device;
    });
    listen('step', takeStep);
    listen('paint', takePaint);
    listen('end', () => {
      source.close();
      live.ended = true;
      $('liveState').textContent = 'The device has ended';
      scene.showProbe();
      line.style.visibility = 'hidden';
    });
    source.onerror = () => { // the browser connects again
      live.connected = false;
      $('liveState').textContent = 'The connection to the device is lost';
    };
  }

  const post = async (path, text) => {
    try {
      const response = await fetch(new URL(path, address), { method: 'POST', body: text, headers: { 'Content-Type': 'text/plain' } });
      return response.ok;
    } catch {
      return false;
    }
  };
  const command = async (text) => (await post('pen', text)) || complain(`${text}: the device refused this`);

  // --- the mouse as the device ---

  const tool = {
    click: () => {},
    end: () => {
      $('liveTouch').ariaPressed = 'false';
      $('liveHint').textContent = '';
    },
  };
  let next, sends = false;
  // Sends the newest position only: later ones replace those that wait.
  async function send(message) {
    next = message;
    if (sends)
      return;
    sends = true;
    while (next) {
      const text = next;
      next = undefined;
      await post('device', text);
    }
    sends = false;
  }

  function move(e) {
    if (taken() !== tool || !e.isPrimary)
      return;
    const point = scene.pick(e.clientX, e.clientY);
    if (!point)
      return;
    if (e.buttons & 1)
      e.stopImmediatePropagation(); // the camera does not move
    const at = toModel(point), eye = toModel(scene.camera.position.toArray()), away = eye.map((x, k) => x - at[k]), far = Math.hypot(...away);
    // The pressure of a mouse is 0.5; a stylus reports its own. A mouse presses with full pressure.
    const depth = e.buttons & 1 ? 2 * hello.full_depth * (e.pressure || 0.5) : -GAP / state.scene.scale;
    send(`${e.buttons & 1 ? 'press' : 'hover'} ${at.map((x, k) => x + away[k] / far * (hello.radius - depth)).join(' ')}`); // paints only while a button is pressed
  }

  function begin() {
    $('liveTouch').onclick = () => {
      const starts = taken() !== tool;
      take(starts ? tool : undefined);
      $('liveTouch').ariaPressed = String(starts);
      $('liveHint').textContent = starts ? 'Move over the model; press to touch it.' : '';
    };
    for (const name of ['pointerdown', 'pointermove', 'pointerup'])
      $('canvas').parentElement.addEventListener(name, move, { capture: true });
    pen.begin(command);
    pen.decals.warmUp(scene); // the device begins when this page is connected
    pen.draw();
    connect();
    addEventListener('pagehide', () => source.close());
    window.ebpoViewer.live = live;
  }
  if (state.info)
    begin();
  else
    on('opened', () => source ?? begin());
}
