// Reads EBP-Octree files: docs/guide/embedding.md.
export { EbpoError } from './error.js';
export { openEbpo, EbpoFile } from './file.js';
export { BlobSource, BytesSource, UrlSource, sourceOf } from './source.js';
export { loadZstd } from './chunk.js';
export { WHITE, BLACK, LEAF, GRAY, isInside } from './decode.js';
export { Tree } from './tree.js';
export { growForQuery, growForView } from './grow.js';
export { cube, decodePlane, envelope, volume } from './envelope.js';
export { cellNear, distanceInterval, inside, insideLeaf, nearestFace, nearestOnTriangle } from './query.js';
export { axisCrossing, onTriangle, orient3d } from './predicates.js';
