// Parses JSON of scene files more strictly than JSON.parse(): rejects duplicate members and too deep nesting. Uses no DOM.
const LEVELS_MOST = 32;
const PIECES = /"(?:[^"\\]|\\.)*"|[{}[\],]/g; // other tokens are skipped

/** Returns the value of a JSON text. Throws an Error for invalid JSON, duplicate members and too deep nesting. */
export function parseStrict(text) {
  const value = JSON.parse(text), open = []; // for each open bracket: the names of the object's members so far, or undefined for an array
  let first = false; // true when the next string is a member's name
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
