// Colour maps.

export const FREE_COLOUR = "#7fd8a0";

const PALETTES = {
  height: ["#31456e", "#2f6f8f", "#2f9a8f", "#7fbf7b", "#e3cf7a", "#f0a45d", "#e9825a"],
  count: ["#2b3350", "#5b4a8a", "#a5528f", "#e0706f", "#f5b36b", "#fbe8a6"],
  free: [FREE_COLOUR, FREE_COLOUR],
  age: ["#ffe08a", "#f0955f", "#b0598a", "#5a4a85", "#333d5c", "#2b3350"],
};

const numbers = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));

// 256 colours as bytes.
export function paletteBytes(name) {
  const stops = (PALETTES[name] ?? PALETTES.height).map(numbers);
  const bytes = new Uint8Array(1024);
  for (let i = 0; i < 256; i++) {
    const t = (i / 255) * (stops.length - 1);
    const k = Math.min(stops.length - 2, Math.floor(t));
    for (let c = 0; c < 3; c++) bytes[4 * i + c] = stops[k][c] + (stops[k + 1][c] - stops[k][c]) * (t - k);
    bytes[4 * i + 3] = 255;
  }
  return bytes;
}

// CSS gradient of the colour map for a legend.
export const gradient = (name) => `linear-gradient(90deg, ${(PALETTES[name] ?? PALETTES.height).join(", ")})`;

// Colour of a label, equal to that of the shader.
export function labelColour(label) {
  const hue = ((label * 0.61803399) % 1) * 6;
  const mixed = [0, 4, 2].map((shift) => {
    const pure = Math.min(1, Math.max(0, Math.abs(((hue + shift) % 6) - 3) - 1));
    return Math.round(255 * (0.55 + (pure - 0.55) * 0.6));
  });
  return `rgb(${mixed.join(" ")})`;
}
