// Frame tree, with lookup of transforms.

import { compose, identity } from "./math.js";

const MOST_FRAMES = 2000;
const DEEPEST = 64;

export class Transforms {
  constructor() {
    this.frames = new Map();
  }

  add(transforms) {
    for (const { parent, child, position, rotation, stamp } of transforms) {
      if (this.frames.size >= MOST_FRAMES && !this.frames.has(child)) continue;
      if ([...position, ...rotation].every(Number.isFinite)) this.frames.set(child, { parent, position, rotation, stamp });
    }
  }

  // target_from_frame, or null without a connection.
  find(target, frame) {
    let [at, pose, stamp] = [frame, identity, 0];
    for (let depth = 0; depth < DEEPEST; depth++) {
      if (at === target) return { ...pose, stamp };
      const up = this.frames.get(at);
      if (!up) return null;
      pose = compose(up, pose);
      stamp = Math.max(stamp, up.stamp);
      at = up.parent;
    }
    return null;
  }
}
