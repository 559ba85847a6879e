// Free space: cells traversed by rays, as faint points.

import { CellRenderer } from "./renderer.js";

const FAINT = 0.35;

export class FreeSpace extends CellRenderer {
  constructor(gl) {
    super(gl);
    this.setPalette("free");
    this.size = 0;
  }

  // Handles a message of the worker.
  take({ info, tiles, size }) {
    if (info) this.setLattice(info);
    for (const tile of tiles) this.setTile(tile);
    this.size = size;
  }

  draw(view) {
    if (!this.lattice) return;
    const { gl, flat } = this;
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, FAINT);
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    gl.depthMask(false);
    this.use(flat, view);
    gl.uniform1f(flat.at.u_enlarge, 0.5);
    this.drawn = 0;
    for (const { tile } of this.visible(view)) {
      this.place(flat, tile, view, tile.number);
      gl.drawArrays(gl.POINTS, 0, tile.size);
      this.drawn += tile.size;
    }
    gl.bindVertexArray(null);
    gl.depthMask(true);
  }
}
