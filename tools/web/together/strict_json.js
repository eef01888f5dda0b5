// Checks JSON of scene files more strictly than JSON.parse(): rejects duplicate members and too deep nesting. No DOM.
const LEVELS_MOST = 32;
const PIECES = /"(?:[^"\\]|\\.)*"|[{}[\],]/g; // colons, numbers and words do not matter

/** The value of a text that JSON.parse() takes; throws an Error that says what is wrong. */
export function parseStrict(text) {
  const value = JSON.parse(text), open = []; // of each bracket around: the names of its object's members so far, or undefined in an array
  let first = false; // whether a text here is a member's name
  for (const [piece] of text.matchAll(PIECES)) {
    if (piece === '{' || piece === '[') {
      open.push(piece === '{' ? new Set() : undefined);
      if (open.length > LEVELS_MOST)
        throw new Error(`more than ${LEVELS_MOST} levels of brackets`);
    } else if (piece === '}' || piece === ']') {
      open.pop();
    } else if (piece !== ',' && first) {
      const name = JSON.parse(piece), names = open.at(-1);
      if (names.has(name))
        throw new Error(`a member ${piece} is there twice in one object`);
      names.add(name);
    }
    first = (piece === '{' || piece === ',') && open.at(-1) !== undefined;
  }
  return value;
}
