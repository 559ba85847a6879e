// Confirmation dialog.

import { by, element } from "./panel.js";

// Shows a dialog with fields; resolves to their values, or null if cancelled. Escape and the first focus cancel.
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
    const end = (values) => (resolve(values), box.close());
    no.addEventListener("click", () => end(null));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      end(inputs.map(({ lastChild: of }) => (of.type === "number" ? of.valueAsNumber : of.value)));
    });
    // Ignores the result of an earlier dialog.
    box.onclose = () => box.open || resolve(null);
    box.showModal();
  });
}
