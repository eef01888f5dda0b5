// node list.js FILE ...: prints a list of files and scenes (.scene.json) as JSON, for the viewer's first page (?samples=). Omits files that
// cannot be read, with a message. The exit code is 1 when no file remains.
import { promises as fs } from 'node:fs';
import { basename } from 'node:path';
import { openModel } from './model_file.js';

// Returns the list's entry of a model. Reads ranges, so that large files are not read completely.
async function headOf(path) {
  const handle = await fs.open(path), { size } = await handle.stat();
  const read = async (offset, length) => (await handle.read(new Uint8Array(length), 0, length, offset)).buffer;
  const source = { name: path, size, requests: 0, bytes: 0, read, open: (bytes) => read(0, Math.min(bytes, size)) };
  try {
    const { info } = await openModel(source);
    return { name: basename(path, '.ebpo.h5'), file: basename(path), faces: info.face_count, bytes: size };
  } finally {
    await handle.close();
  }
}

// Returns the list's entry of a scene. The scene's models are not read.
async function sceneOf(path) {
  const scene = JSON.parse(await fs.readFile(path, 'utf8'));
  if (typeof scene.ebpo_scene !== 'string')
    throw new Error('not a scene: the member ebpo_scene is missing');
  return { name: typeof scene.title === 'string' && scene.title ? scene.title : basename(path, '.scene.json'), scene: basename(path), instances: scene.instances?.length ?? 0 };
}

const list = [];
for (const path of process.argv.slice(2).sort()) {
  try {
    list.push(await (path.endsWith('.scene.json') ? sceneOf : headOf)(path));
  } catch (error) {
    console.error(`list.js: omitted: ${basename(path)}: ${error.message.replace(`${path}: `, '')}`);
  }
}
if (!list.length)
  process.exit(1);
console.log(JSON.stringify(list, null, 1));
