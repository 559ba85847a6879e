// Message in place of an empty map: the causes reported by nodes on /diagnostics.

import { by, element, tasks } from "./panel.js";

const WARN = 1;
const ERROR = 2;
// Mapping nodes in the order of data flow; tasks without information on the map.
const MAPPING = [/(^|\/)enu_transformer[^:]*: /, /(^|\/)lattice_mapper[^:]*: /];
const OTHERS = /: (transport|viewer)$/;
const MOST = 4;

// Causes of an empty map: those of the mapping nodes, else of all.
function causes() {
  const bad = tasks().filter(({ level, name }) => (level === WARN || level === ERROR) && !OTHERS.test(name));
  const rank = ({ name }) => {
    const place = MAPPING.findIndex((of) => of.test(name));
    return place < 0 ? MAPPING.length : place;
  };
  const making = bad.filter((task) => rank(task) < MAPPING.length);
  return (making.length ? making : bad).sort((a, b) => rank(a) - rank(b) || b.level - a.level).slice(0, MOST);
}

// Shows the causes; `topic`: that of the map.
export function showNothing(empty, lattice, topic) {
  const box = by("nothing");
  box.hidden = !empty;
  if (!empty) return;
  const found = causes();
  const lines = found.map(({ name, message, level }) => element("li", {}, element("b", { className: level === ERROR ? "bad" : "", textContent: name.split(": ")[0] }), `: ${message}`));
  if (!lines.length) {
    lines.push(element("li", { textContent: lattice ? "The mapper has mapped no point, or the map was emptied." : `No map was received on ${topic}: no mapper publishes it on this ROS domain, or its topic has another name.` }));
  }
  const heading = lattice ? "The map has no cells yet" : "No map yet";
  const text = [heading, ...lines.map((line) => line.textContent)].join("\n");
  // An unchanged line is not announced again by screen readers.
  if (showNothing.text === text) return;
  showNothing.text = text;
  box.querySelector("h2").textContent = heading;
  box.querySelector("ul").replaceChildren(...lines);
}
