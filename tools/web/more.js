// Modules that the page loads after the first picture: measuring, a section box, notes, the pen, sharing, shading, cube and scale.
import { addCompass } from './compass.js';
import { addLive } from './live.js';
import { addMeasuring } from './measure.js';
import { addNotes } from './notes.js';
import { addPen } from './paint/pen.js';
import { markOn } from './parts.js';
import { Pipeline } from './pipeline.js';
import { kit } from './scene.js';
import { addSectionBox } from './section_box.js';
import { addShading, styled } from './shading.js';
import { addSharing } from './sharebox.js';
import { $, on, state } from './state.js';

export async function begin(page) {
  await styled();
  const { scene } = page;
  state.address = page.address;
  markOn(scene);
  addSectionBox(page);
  addMeasuring(page);
  const pipeline = scene.pipeline = new Pipeline(kit), pen = addPen(page, pipeline);
  addNotes(page, pen.drawing);
  pen.begin(); // its section is the last one; it also notifies the other sections
  addShading(scene, pipeline, page.changed);
  addSharing({ address: page.address, elementOf });
  addCompass(page);
  addHelp();
  addLive(page, pen.live);
  state.more = true;
}

// Returns the element <ebpo-viewer> of a link to one model.
function elementOf(query) {
  const names = ['view', 'level', 'detail', 'clip', 'box', 'point', 'colour', 'cell-faces', 'theme'].filter((name) => query.has(name));
  const local = typeof state.what !== 'string';
  return { local, attributes: [['src', local ? 'ADDRESS' : state.what], ...names.map((name) => [name, query.get(name)])] };
}

// Enables the keys of the loaded modules only.
function addHelp() {
  $('help').querySelector('dl').insertAdjacentHTML('beforeend', `<dt><kbd>D</kbd> <kbd>N</kbd></dt><dd>measure distances, add a note</dd>
    <dt><kbd>B</kbd> <kbd>R</kbd></dt><dd>pen, eraser; <kbd>Ctrl Z</kbd> undo</dd><dt><kbd>E</kbd> <kbd>A</kbd> <kbd>L</kbd></dt><dd>shade by depth, ambient occlusion, share</dd>`);
}
