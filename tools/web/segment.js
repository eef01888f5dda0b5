// A range of nodes of one level: types, planes and colours. Ranks are stored for every 16th group and counted from there.
const STEP = 16; // counts of at most 8 * 16 nodes fit in a byte

// For each byte with four types: the numbers of white, black, leaf and gray nodes, in one byte each.
const COUNTS = Uint32Array.from({ length: 256 }, (_, types) => [0, 2, 4, 6].reduce((sum, bit) => sum + 2 ** (8 * (types >> bit & 3)), 0));

function begins(counts) {
  const begin = new Float64Array(Math.ceil((counts?.length ?? 0) / STEP));
  for (let i = 0, total = 0; i < (counts?.length ?? 0); i++) {
    if (i % STEP === 0)
      begin[i / STEP] = total;
    total += counts[i];
  }
  return begin;
}

function slice(values, counts, begin, i) {
  let from = begin[Math.floor(i / STEP)];
  for (let k = i - i % STEP; k < i; k++)
    from += counts[k];
  return values.subarray(from, from + counts[i]);
}

const NONE = new Uint32Array(0);

export class Segment {
  /**
   * Creates a segment whose first group is `group`. The arrays are ranges of the arrays in format-spec, section 6, from there on. `first`: ranks of the first white, black, leaf
   * and gray node. Arrays that were not read are undefined.
   */
  constructor({ level, group = 0, first = [0, 0, 0, 0], types, planeCounts, planes, leafPlaneCounts, leafPlanes, grayColours }) {
    Object.assign(this, { level, group, first, types, planeCounts, planes, leafPlaneCounts, leafPlanes, grayColours });
    this.before = new Uint32Array(4 * Math.ceil(types.length / STEP));
    for (let g = 0, sum = 0, at = 0; g < types.length; g++) {
      if (g % STEP === 0) {
        for (let t = 0; g && t < 4; t++)
          this.before[at + 4 + t] = this.before[at + t] + (sum >>> 8 * t & 255);
        at += g ? 4 : 0;
        sum = 0;
      }
      sum += COUNTS[types[g] & 255] + COUNTS[types[g] >> 8];
    }
    this.planeBegin = begins(planeCounts);
    this.leafPlaneBegin = begins(leafPlaneCounts);
    this.byteLength = 2 * types.length + this.before.length * 4
      + [planeCounts, planes, leafPlaneCounts, leafPlanes, grayColours, this.planeBegin, this.leafPlaneBegin].reduce((sum, a) => sum + (a?.byteLength ?? 0), 0);
  }

  /** Returns the ranks (white, black, leaf, gray) at the beginning of a group. */
  ranks(group) {
    const g = group - this.group, at = 4 * Math.floor(g / STEP);
    let sum = 0;
    for (let i = g - g % STEP; i < g; i++)
      sum += COUNTS[this.types[i] & 255] + COUNTS[this.types[i] >> 8];
    return [0, 1, 2, 3].map((t) => this.first[t] + this.before[at + t] + (sum >>> 8 * t & 255));
  }

  typesOf(group) {
    return this.types[group - this.group];
  }

  grayPlanes(rank) {
    return this.planes && this.planeCounts ? slice(this.planes, this.planeCounts, this.planeBegin, rank - this.first[3]) : NONE;
  }

  leafPlanesOf(rank) {
    return this.leafPlanes && this.leafPlaneCounts ? slice(this.leafPlanes, this.leafPlaneCounts, this.leafPlaneBegin, rank - this.first[2]) : NONE;
  }

  /** Returns red + 256 green + 65,536 blue of a gray node, or undefined without a colour. */
  colour(rank) {
    return this.grayColours?.[rank - this.first[3]];
  }
}
