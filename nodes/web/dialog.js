// A question before something is done.

import { by, element } from "./panel.js";

// Asks with fields; gives their values, or null for no. Escape is no, and so is what the focus begins with.
export function askFirst({ title, text, action, fields = [] }) {
  const box = by("ask");
  const inputs = fields.map(({ label, ...properties }) => {
    const input = element("input", { required: true, ...properties });
    if (properties.type === "number") input.step = "any";
    return element("label", {}, `${label} `, input);
  });
  const no = element("button", { type: "button", textContent: "Cancel", autofocus: true });
  const yes = element("button", { type: "submit", className: "do", textContent: action });
  const heading = element("h2", { id: "ask-title", textContent: title });
  const form = element("form", {}, heading, element("p", { textContent: text }), ...inputs, element("div", { className: "row" }, no, yes));
  box.replaceChildren(form);
  return new Promise((resolve) => {
    let values = null;
    no.addEventListener("click", () => box.close());
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      values = inputs.map((label) => (label.lastChild.type === "number" ? label.lastChild.valueAsNumber : label.lastChild.value));
      box.close();
    });
    box.onclose = () => resolve(values);
    box.showModal();
  });
}
