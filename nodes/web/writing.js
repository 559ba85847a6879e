// Changes by the user: map and node parameters, as far as offered by the server.

import { askFirst } from "./dialog.js";
import { by, element, whole } from "./panel.js";
import { outcome, queried, requests } from "./requests.js";

const AXES = ["x", "y", "z"];

export class Writing {
  constructor(services, worker, state) {
    Object.assign(this, { services, worker, state, attempts: 0 });
    by("clear").addEventListener("click", () => this.tried(this.clear()));
    by("reset").addEventListener("click", () => this.tried(this.reset()));
    by("save").addEventListener("click", () => this.tried(this.save()));
    by("parameters").parentElement.addEventListener("toggle", () => this.readParameters());
  }

  offered() {
    const { services } = this;
    for (const [id, name] of [["clear", "clear_box"], ["reset", "reset"], ["save", "save_map"]]) by(id).hidden = !services.find(name);
    by("write").hidden = !services.find("clear_box");
    this.readParameters();
  }

  say(text, bad = false) {
    by("said").textContent = text;
    by("said").className = bad ? "bad" : "";
  }

  // Shows the result of an action; an empty result does not clear a later one.
  async tried(work) {
    const attempt = ++this.attempts;
    try {
      const text = (await work) ?? "";
      if (text || attempt === this.attempts) this.say(text);
    } catch (error) {
      this.say(error.message, true);
    }
  }

  async change(name, request) {
    const answer = outcome(await this.services.call(name, request));
    if (!answer.success) throw new Error(answer.message);
    return answer;
  }

  async clear() {
    const { measured, chosen } = this.state;
    const corners = measured.length === 2 ? measured : [chosen?.centre ?? [0, 0, 0]];
    const room = corners.length === 2 ? 0.01 : 1;
    const ends = [Math.min, Math.max].map((of, end) => AXES.map((_, k) => of(...corners.map((corner) => corner[k])) + (end ? room : -room)));
    const fields = ends.flatMap((point, end) => AXES.map((axis, k) => ({
      label: `${end ? "to" : "from"} ${axis}, m`, type: "number", value: point[k].toFixed(2), id: `box-${end ? "to" : "from"}-${axis}`,
    })));
    const text = "Removes the cells with centres in this box, for every user. The initial box spans two measured cells, or surrounds the selected cell.";
    const values = await askFirst({ title: "Clear a box", text, action: "Clear", fields });
    if (!values) return null;
    const { number } = await this.change("clear_box", requests.clearBox(values.slice(0, 3), values.slice(3)));
    return `${whole(number)} cells cleared`;
  }

  async reset() {
    const text = `Removes all ${whole(this.state.size)} cells, for every user. Unsaved changes are lost.`;
    if (!await askFirst({ title: "Empty the map", text, action: "Empty it" })) return null;
    return (await this.change("reset", requests.nothing())).message || "the map is emptied";
  }

  async save() {
    const text = "The mapper writes the file into its folder of maps.";
    const values = await askFirst({ title: "Save the map", text, action: "Save", fields: [{ label: "name", type: "text", value: "map.lattice", id: "save-name" }] });
    if (!values) return null;
    const { number, message } = await this.change("save_map", requests.saveMap(values[0]));
    return `${message}: ${whole(number)} cells`;
  }

  // Query of a point by the mapper; null if it is not available.
  async query(point) {
    if (!this.services.find("query")) return null;
    const answer = queried(await this.services.call("query", requests.query(point)));
    if (!answer.success) return answer.message;
    const here = answer.occupied ? `occupied, ${whole(answer.points)} points` : "free of points";
    return answer.hasNearest && !answer.occupied ? `${here}, ${answer.clearance.toFixed(2)} m clear` : here;
  }

  readParameters() {
    const box = by("parameters").parentElement;
    box.hidden = by("write").hidden;
    if (!box.hidden && box.open) this.worker.postMessage({ type: "get" });
  }

  showParameters(parameters) {
    for (const parameter of parameters) {
      const known = document.getElementById(`parameter ${parameter.name}`);
      if (known) known.replaceWith(this.field(parameter));
      else by("parameters").append(element("label", { className: "parameter" }, element("span", { textContent: parameter.name }), this.field(parameter)));
    }
  }

  field({ name, value, type }) {
    const kind = { boolean: "checkbox", number: "number" }[typeof value] ?? "text";
    const input = element("input", { type: kind, id: `parameter ${name}` });
    if (kind === "number") input.step = type || !Number.isInteger(value) ? "any" : 1;
    if (kind === "checkbox") input.checked = value;
    else input.value = typeof value === "object" ? JSON.stringify(value) : value;
    input.addEventListener("change", () => this.tried(this.set({ name, value, type }, input)));
    return input;
  }

  async set({ name, value, type }, input) {
    let wanted = input.value;
    if (input.type === "checkbox") wanted = input.checked;
    else if (input.type === "number") wanted = input.valueAsNumber;
    else if (typeof value === "object") wanted = JSON.parse(input.value);
    this.say("");
    this.worker.postMessage({ type: "set", parameter: { name, value: wanted, type } });
  }
}
