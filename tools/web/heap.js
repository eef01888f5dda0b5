// A priority queue, largest first.
export class Heap {
  constructor() {
    this.items = [];
  }

  push(item) {
    const a = this.items;
    let i = a.push(item) - 1;
    for (let up; i > 0 && a[up = (i - 1) >> 1].px < item.px; i = up)
      a[i] = a[up];
    a[i] = item;
  }

  pop() {
    const a = this.items, top = a[0], last = a.pop();
    if (a.length) {
      let i = 0;
      for (let c; (c = 2 * i + 1) < a.length; i = c) {
        if (c + 1 < a.length && a[c + 1].px > a[c].px)
          c++;
        if (a[c].px <= last.px)
          break;
        a[i] = a[c];
      }
      a[i] = last;
    }
    return top;
  }
}
