// Mixed reality: a WebXR session that sends surfaces to the robot, and draws its map where the calibration is OK.

import { askFirst } from "./dialog.js";
import { OK, VERDICTS } from "./headset.js";
import { compose, multiply, rotate } from "./math.js";
import { by } from "./panel.js";
import { outcome, requests } from "./requests.js";
import { Sign } from "./sign.js";
import { ROS_FROM_WEBXR, SurfaceSender, labelNames } from "./surfaces.js";

const FRAME = "headset_origin";
const OPTIONAL = ["mesh-detection", "plane-detection"];
// Period of reading surfaces, and time without any until the sign says so, ms.
const LOOK_MS = 500;
const NOTHING_MS = 6000;
// Time from the last surface to a request, from an answer to the next request, and the longest wait for an answer, ms.
const SETTLE_MS = 1500;
const AGAIN_MS = 5000;
const PATIENCE_MS = 130000;
// Age of the transform of an accepted pose at which it is lost, ms.
const LOST_MS = 3000;
// Time of appearing and disappearing, and time for which the sign of an accepted pose is shown, ms.
const FADE_MS = 800;
const SIGN_MS = 5000;
// Opacity of the map before the real world.
const OPACITY = 0.5;
const CONSENT = "Your headset's surfaces (room mesh or planes, with labels such as wall or table) are sent to this robot until the session ends. No images are sent. Nothing is sent before you agree.";

export class MixedReality {
  constructor({ gl, cells, drawing, services, worker, state, transforms }) {
    Object.assign(this, { gl, cells, drawing, services, worker, state, transforms, session: null, sender: null, opacity: 0, pose: null, drawn: 0 });
    this.button = by("mixed");
    this.button.addEventListener("click", () => this.toggle().catch((error) => this.say(`Mixed reality: ${error.message}`)));
    this.detect();
  }

  say(text) {
    by("said").textContent = text;
    by("said").className = "bad";
  }

  // Shows the button where the browser has a device.
  async detect() {
    for (const mode of ["immersive-ar", "immersive-vr"]) {
      if (!await navigator.xr?.isSessionSupported(mode).catch(() => false)) continue;
      this.mode = mode;
      this.button.hidden = false;
      return;
    }
  }

  async toggle() {
    if (this.session) return this.session.end();
    by("said").textContent = "";
    if (!this.services.find("calibrate")) throw new Error("the robot accepts no headset: set allow_headset of viewer_server");
    const agreed = await askFirst({ title: "Mixed reality", text: CONSENT, action: "Agree and start" });
    if (!agreed) return null;
    const session = await navigator.xr.requestSession(this.mode, { requiredFeatures: ["local-floor"], optionalFeatures: OPTIONAL });
    try {
      await this.begin(session);
    } catch (error) {
      await session.end().catch(() => null);
      this.ended();
      throw error;
    }
    return null;
  }

  async begin(session) {
    const { gl, drawing } = this;
    await gl.makeXRCompatible();
    this.reference = await session.requestReferenceSpace("local-floor");
    drawing.paused = true;
    session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl), depthNear: 0.1, depthFar: 200 });
    this.sign ??= new Sign(gl);
    const topic = this.state.channels.find(({ kind }) => kind === "calibration")?.topic ?? "/calibration";
    const prefix = topic.slice(0, -"calibration".length);
    const publish = (name, schemaName, bytes) => this.worker.postMessage({ type: "publish", topic: `${prefix}headset/${name}`, schemaName, bytes });
    this.announce = () => publish("labels/label_info", "vision_msgs/msg/LabelInfo", labelNames(FRAME));
    this.sender = new SurfaceSender({ frame: FRAME, publish: (bytes) => publish("mesh", "lattice_msgs/msg/HeadsetMesh", bytes) });
    this.session = session;
    this.restart();
    this.beganAt = performance.now();
    this.button.textContent = "End mixed reality";
    this.reference.addEventListener("reset", ({ transform }) => this.recentred(transform));
    session.addEventListener("end", () => this.ended());
    session.requestAnimationFrame((time, frame) => this.frame(frame));
  }

  // Begins with the robot; a map that is drawn fades where it is.
  restart() {
    this.announce();
    this.sender.begin();
    Object.assign(this, { asking: false, askedAt: -Infinity, answeredAt: -Infinity, isOk: false, verdict: 0, reason: "", changedAt: performance.now(), lookedAt: -Infinity });
  }

  // The user has recentred: the origin is another, with a transform if the device knows it.
  recentred(transform) {
    const { position: p, orientation: o } = transform ?? {};
    if (this.pose && transform) this.pose = compose(this.pose, { position: [p.x, p.y, p.z], rotation: [o.x, o.y, o.z, o.w] });
    else this.opacity = 0;
    this.restart();
  }

  // A robot that has started again, or a connection that has been made again.
  connected() {
    if (this.session) this.restart();
  }

  ended() {
    Object.assign(this, { session: null, sender: null, pose: null, opacity: 0, drawn: 0 });
    this.drawing.paused = false;
    this.button.textContent = "Mixed reality";
    this.drawing.redraw();
  }

  // Takes a result of the calibration.
  calibrated({ session, verdict, reason, position, rotation, header, frame }) {
    if (!this.session) return;
    const mine = session === this.sender.session;
    if (!mine && !this.isOk) return;
    this.changedAt = performance.now();
    // Nothing is calculated yet.
    if (mine && verdict === 0 && !this.isOk) return;
    if (mine && verdict === OK) {
      const fromMap = this.transforms().find(this.state.frame, header.frame);
      const place = { position, rotation };
      const isFinite = [...position, ...rotation].every(Number.isFinite);
      const known = !isFinite ? null : header.frame === this.state.frame ? place : fromMap && compose(fromMap, place);
      this.child = frame;
      if (known) {
        // A map that has not faded yet does not move.
        if (!this.isOk) this.opacity = 0;
        Object.assign(this, { pose: compose(known, ROS_FROM_WEBXR), isOk: true, verdict, reason, heardAt: performance.now() });
        return;
      }
      this.refused(verdict, `the frame ${header.frame} of the calibration is not connected to the map`);
    } else this.refused(verdict, mine ? reason : "the robot calibrates another headset");
  }

  refused(verdict, reason) {
    Object.assign(this, { isOk: false, verdict, reason });
  }

  // Takes transforms: those of the headset confirm its pose.
  confirm(transforms) {
    if (this.isOk && transforms.some(({ child }) => child === this.child)) this.heardAt = performance.now();
  }

  async ask(now) {
    const { sender } = this;
    const isDue = sender.doneAt !== null && now - sender.doneAt > SETTLE_MS && sender.queue.length === 0;
    if (this.isOk || this.asking || !isDue || now - this.answeredAt < AGAIN_MS || !this.state.open) return;
    const { session } = sender;
    Object.assign(this, { asking: true, askedAt: now });
    const answer = await this.services.call("calibrate", requests.calibrate(session), PATIENCE_MS).catch((error) => error);
    if (!this.session || sender.session !== session) return;
    Object.assign(this, { asking: false, answeredAt: performance.now() });
    // A result comes on its topic; a request without one has a reason only.
    if (answer instanceof Error) this.refused(0, answer.message);
    else if (this.verdict === 0 && !outcome(answer).success) this.refused(0, outcome(answer).message);
  }

  // State as title, text, kind and filled part of the ring.
  status(now) {
    const { sender } = this;
    const { surfaces, left } = sender.counts;
    if (!this.state.open) return { title: "No connection", text: "The robot is not reached. Trying again.", kind: "bad", part: 0 };
    if (this.isOk) return { title: "OK", text: this.reason, kind: "ok", part: 1 };
    const result = this.reason ? `${this.verdict === 0 ? "" : `${VERDICTS[this.verdict] ?? this.verdict}: `}${this.reason}` : "";
    if (surfaces === 0) return { title: "Look about", text: this.lacking(now), kind: "wait", part: 0.05 };
    if (sender.queue.length > 0) {
      const [{ chunk, chunks }] = sender.queue;
      return { title: "Sending surfaces", text: `${surfaces} surfaces, ${Math.round(sender.sentBytes / 1000)} kB sent${left ? `, ${left} left out` : ""}. ${result}`, kind: "wait", part: 0.1 + 0.5 * (chunk / chunks) };
    }
    if (this.asking) return { title: "Asked the robot", text: `Waiting for the calibration: ${Math.round((now - this.askedAt) / 1000)} s. ${result}`, kind: "wait", part: 0.7 };
    if (result) return { title: "Not found yet", text: `${result}. Look at other parts of the room.`, kind: "bad", part: 0.7 };
    return { title: "Surfaces sent", text: `${surfaces} surfaces. The robot is asked next.`, kind: "wait", part: 0.6 };
  }

  lacking(now) {
    if (this.offers === "none") return "This browser offers neither room mesh nor planes: there is nothing to find your place by.";
    if (now - this.beganAt < NOTHING_MS) return "No surface is known yet.";
    return `No ${this.offers} yet. Set up the room in the headset's settings, then look at floor and walls.`;
  }

  frame(frame) {
    const { session, gl, sender } = this;
    if (!session) return;
    session.requestAnimationFrame((time, next) => this.frame(next));
    const now = performance.now();
    const step = now - (this.framedAt ?? now);
    this.framedAt = now;
    const viewer = frame.getViewerPose(this.reference);
    if (now - this.lookedAt > LOOK_MS) {
      this.lookedAt = now;
      this.offers = frame.detectedMeshes ? "room mesh" : frame.detectedPlanes ? "planes" : "none";
      if (viewer) sender.look(frame, this.reference, now);
    }
    if (this.state.open) sender.pump(now);
    this.ask(now);
    if (this.isOk && now - this.heardAt > LOST_MS) {
      this.refused(0, "the robot does not confirm the pose any more");
      this.changedAt = now;
    }
    const target = this.isOk && viewer && !viewer.emulatedPosition ? 1 : 0;
    this.opacity += Math.max(-step, Math.min(step, (target - this.opacity) * FADE_MS)) / FADE_MS;
    const layer = session.renderState.baseLayer;
    gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.drawn = 0;
    this.sign.set(this.status(now));
    if (viewer) {
      gl.enable(gl.SCISSOR_TEST);
      for (const view of viewer.views) this.draw(view, viewer, layer.getViewport(view), now);
      gl.disable(gl.SCISSOR_TEST);
    }
    gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.frames = (this.frames ?? 0) + 1;
  }

  draw(view, viewer, { x, y, width, height }, now) {
    const { gl, cells } = this;
    if (width === 0 || height === 0) return;
    gl.viewport(x, y, width, height);
    // Points reach beyond the viewport of their eye.
    gl.scissor(x, y, width, height);
    if (this.pose && this.opacity > 0.01) {
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.BLEND);
      gl.blendColor(0, 0, 0, OPACITY * this.opacity);
      gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
      cells.draw(this.seen(view, [x, y, width, height]), true);
      this.drawn += cells.drawn;
    }
    if (!this.isOk || now - this.changedAt < SIGN_MS) this.sign.draw(view, viewer.transform);
  }

  // A view of the renderer from one of WebXR, in the map.
  seen({ projectionMatrix: p, transform: { position: at, orientation: o } }, window) {
    const { position: eye, rotation } = compose(this.pose, { position: [at.x, at.y, at.z], rotation: [o.x, o.y, o.z, o.w] });
    const [right, up, back] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(rotation, axis));
    const turn = new Float32Array([right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, 0, 0, 0, 1]);
    const rays = [...right.map((c) => c / p[0]), ...up.map((c) => c / p[5]), ...back.map((c, k) => (right[k] * p[8]) / p[0] + (up[k] * p[9]) / p[5] - c)];
    const [, , width, height] = window;
    return {
      ratio: 1, width, height, axes: { right, up, back }, eye, clip: multiply(p, turn), rays: new Float32Array(rays),
      focal: (p[5] * height) / 2, near: p[14] / (p[10] - 1), aside: Math.abs(p[8]), above: Math.abs(p[9]), window,
    };
  }
}
