// Mouse, touch and keyboard control of the camera, and clicks.

const STILL = 4;

export function watchPointer(canvas, camera, { moved, clicked }) {
  const down = new Map();
  let travelled = 0;
  // Distance of two fingers, pixels.
  let pinch = null;
  const apart = () => {
    const [a, b] = [...down.values()];
    return Math.max(1, Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY));
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (down.size === 0) travelled = 0;
    down.set(event.pointerId, event);
    pinch = down.size === 2 ? apart() : null;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = down.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    down.set(event.pointerId, event);
    travelled += Math.abs(dx) + Math.abs(dy);
    if (travelled <= STILL) return;
    if (down.size === 2) {
      const now = apart();
      camera.zoom(pinch / now);
      pinch = now;
      camera.pan(dx / 2, dy / 2);
    } else if (event.buttons & 2 || event.buttons & 4 || event.shiftKey) camera.pan(dx, dy);
    else camera.orbit(dx, dy);
    moved();
  });
  const up = (event) => {
    if (down.delete(event.pointerId) && travelled <= STILL && event.type === "pointerup" && event.button === 0) {
      const box = canvas.getBoundingClientRect();
      clicked(event.clientX - box.left, event.clientY - box.top);
    }
    pinch = down.size === 2 ? apart() : null;
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(event.deltaY * (event.deltaMode === 1 ? 0.04 : 0.0012)));
    moved();
  }, { passive: false });
}

// Keyboard shortcuts, except while typing into a field.
export function watchKeys(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(SELECT|INPUT)$/.test(event.target.tagName)) return;
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}
