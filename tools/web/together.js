// What the page loads when it shows several models or a scene.
export { ofFiles, wanted } from './together/asked.js';
export { begin } from './together/page.js';
