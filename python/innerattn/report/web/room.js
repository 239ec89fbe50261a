// Which places of a canvas are taken, so that texts and badges cover no robot and no other text.

/** Places are boxes around (x, y), with half their widths and heights, in CSS pixels. */
class Room {
  /** `discs`: [x, y, radius] of what nothing may cover; those without numbers are not there. */
  constructor(side, discs) {
    Object.assign(this, { side, discs, boxes: [] });
  }

  /** Whether a box lies on the canvas and covers nothing; a disc of number `but` does not count. */
  isFree(x, y, width, height, but = -1) {
    if (!(Math.min(x - width, y - height, this.side - x - width, this.side - y - height) >= 1)) return false;
    return this.boxes.every(([bx, by, bw, bh]) => Math.abs(bx - x) >= bw + width || Math.abs(by - y) >= bh + height) &&
      this.discs.every(([dx, dy, radius], index) => index === but ||
        !(Math.hypot(Math.max(Math.abs(dx - x) - width, 0), Math.max(Math.abs(dy - y) - height, 0)) < radius));
  }

  take(x, y, width, height) {
    this.boxes.push([x, y, width, height]);
  }

  /** Takes the first free one of some places [x, y]; undefined: none is free. */
  find(places, width, height, but = -1) {
    const found = places.find(([x, y]) => this.isFree(x, y, width, height, but));
    if (found) this.take(...found, width, height);
    return found;
  }
}
