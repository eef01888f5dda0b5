// Module that the page loads to show several models or a scene.
export { ofFiles, wanted } from './together/addresses.js';
export { begin } from './together/page.js';
